//! How a corrected program is written.

use crate::inverse::Mode;
use crate::nc::Dialect;

/// What becomes of a move that needs the word of an axis of which it is not known where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnknownAxes {
    /// The move is refused, rapid or not.
    Refuse,
    /// The move is written without that word, and told.
    Keep,
}

/// How to write.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Default)]
pub struct CompensateOptions {
    /// Digits behind the point; without, the most that the program itself has, but 3 (4 in inch) at least.
    pub decimals: Option<usize>,
    /// Tolerance within which arcs become lines, m; without, an arc that the errors deform is refused.
    pub arcs: Option<f64>,
    /// Largest error of the tip that a straight move may leave between its ends, m; without, moves stay
    /// whole.
    pub split: Option<f64>,
    /// Largest correction of the tip, m; without, ten times what deviations of the size of the machine's tolerances make.
    pub max_correction: Option<f64>,
    /// What counts, where it is not what the machine has joints for.
    pub mode: Option<Mode>,
    /// The dialect, where it is not to be taken from the program.
    pub dialect: Option<Dialect>,
    /// What becomes of moves that need an axis of which it is not known where it stands; without, rapid moves are kept and
    /// others refused.
    pub unknown: Option<UnknownAxes>,
}

impl CompensateOptions {
    /// The same with so many digits behind the point.
    #[must_use]
    pub fn with_decimals(mut self, decimals: usize) -> Self {
        self.decimals = Some(decimals);
        self
    }

    /// The same with arcs that may become lines within a tolerance, m.
    #[must_use]
    pub fn with_arcs(mut self, arcs: f64) -> Self {
        self.arcs = Some(arcs);
        self
    }

    /// The same with straight moves that are split where their tip would be off by more, m.
    #[must_use]
    pub fn with_split(mut self, split: f64) -> Self {
        self.split = Some(split);
        self
    }

    /// The same with corrections of the tip up to a bound, m.
    #[must_use]
    pub fn with_max_correction(mut self, bound: f64) -> Self {
        self.max_correction = Some(bound);
        self
    }

    /// The same with another account of what counts.
    #[must_use]
    pub fn with_mode(mut self, mode: Mode) -> Self {
        self.mode = Some(mode);
        self
    }

    /// The same with a dialect that is not taken from the program.
    #[must_use]
    pub fn with_dialect(mut self, dialect: Dialect) -> Self {
        self.dialect = Some(dialect);
        self
    }

    /// The same with another fate of moves that need an axis of which it is not known where it stands.
    #[must_use]
    pub fn with_unknown(mut self, unknown: UnknownAxes) -> Self {
        self.unknown = Some(unknown);
        self
    }
}
