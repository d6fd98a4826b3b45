//! How a corrected program is written.

use crate::inverse::Mode;
use crate::nc::Dialect;

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
    /// What counts, where it is not what the machine has joints for.
    pub mode: Option<Mode>,
    /// The dialect, where it is not to be taken from the program.
    pub dialect: Option<Dialect>,
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
}
