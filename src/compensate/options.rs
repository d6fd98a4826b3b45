//! How a corrected program is written.

use crate::inverse::Mode;
use crate::nc::Dialect;

/// What becomes of a move that needs the word of an axis of which it is not known where it stands.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnknownAxes {
    /// The move is refused, rapid or not.
    Refuse,
    /// The move is written without that word, and told.
    Keep,
}

/// What an axis number without a decimal point counts in an RS-274 program.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntegerUnit {
    /// Millimetres and degrees, as with LinuxCNC: `X10` is `X10.`
    Mm,
    /// Least increments of 0.001 mm and 0.001 deg, as with Fanuc: `X10` is `X0.010`.
    Um,
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
    /// What axis numbers without a point count; without, millimetres and degrees, and the report says how many there are.
    pub integer_unit: Option<IntegerUnit>,
    /// What becomes of moves that need an axis of which it is not known where it stands; without, rapid moves are kept and
    /// others refused.
    pub unknown: Option<UnknownAxes>,
    /// Steps of the correction at a reversal that are told apart as too large, m.
    pub max_step: Option<f64>,
    /// Whether a comment behind the last block says from what the program was written; where nothing is corrected there is none.
    pub marked: bool,
    /// Whether a program is compensated that bears such a comment already, or that goes where the model says nothing.
    pub force: bool,
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

    /// The same with another account of numbers without a point.
    #[must_use]
    pub fn with_integer_unit(mut self, unit: IntegerUnit) -> Self {
        self.integer_unit = Some(unit);
        self
    }

    /// The same with steps of the correction that are told apart as too large, m.
    #[must_use]
    pub fn with_max_step(mut self, step: f64) -> Self {
        self.max_step = Some(step);
        self
    }

    /// The same with a comment behind the last block that says from what the program was written.
    #[must_use]
    pub fn with_mark(mut self) -> Self {
        self.marked = true;
        self
    }

    /// The same also for programs that are compensated already, and beyond what the model says.
    #[must_use]
    pub fn with_force(mut self) -> Self {
        self.force = true;
        self
    }
}
