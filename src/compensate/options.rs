//! How a corrected program is written.

use crate::inverse::Mode;
use crate::nc::Dialect;

/// How to write.
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
