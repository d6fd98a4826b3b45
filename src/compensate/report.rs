//! What compensation did, for people and machines.

use serde::{Deserialize, Serialize};

use crate::calibration::LeftOut;

/// Most lines that a list names; the count beside it goes on.
pub const MOST_LISTED: usize = 50;

/// A list that names the first [`MOST_LISTED`] of its entries and counts all.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Listed<T> {
    /// How many there are.
    pub count: u64,
    /// The first of them.
    pub first: Vec<T>,
    /// Line of the last.
    #[serde(skip)]
    last: usize,
}

impl<T> Default for Listed<T> {
    fn default() -> Self {
        Listed { count: 0, first: Vec::new(), last: 0 }
    }
}

impl<T> Listed<T> {
    /// One entry per line.
    pub(super) fn push_once(&mut self, entry: T, line: usize) {
        if self.last != line {
            self.last = line;
            self.push(entry);
        }
    }

    pub(super) fn push(&mut self, entry: T) {
        self.count += 1;
        if self.first.len() < MOST_LISTED {
            self.first.push(entry);
        }
    }
}

/// A figure, and the line at which it is reached.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Worst {
    /// m or rad.
    pub value: f64,
    /// Line of the program, from 1; 0 where there was nothing.
    pub line: usize,
}

impl Worst {
    pub(super) fn take(&mut self, value: f64, line: usize) {
        if value > self.value {
            *self = Worst { value, line };
        }
    }
}

/// The correction changes at once, because the direction of travel did.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Reversal {
    /// Line of the block that starts with it.
    pub line: usize,
    /// By how much the tip is corrected otherwise from here on, m.
    pub step_m: f64,
    /// By how much the tool axis is, rad.
    pub step_rad: f64,
}

/// The axes travel in a pattern of directions that no recording has shown.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnseenPiece {
    /// Line of the block.
    pub line: usize,
    /// Name of the pattern, such as `AFCR`.
    pub piece: String,
}

/// A joint that leaves the range in which the calibration has seen it.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ExtrapolatedJoint {
    /// Name of the joint.
    pub joint: String,
    /// Whether it turns.
    pub rotary: bool,
    /// By how much at most, m or rad; whole turns do not count.
    pub by: Worst,
}

/// An axis comes to a block's end from a place that is not known.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnknownWay {
    /// Line of the block.
    pub line: usize,
    /// Name of the joint.
    pub joint: String,
    /// The direction that is taken: that of its first motion on a known way, or 0 for the mean of both.
    pub side: i8,
}

/// A move that needs the words of axes of which it is not known where they stand, and is written without.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnknownPlace {
    /// Line of the block.
    pub line: usize,
    /// Addresses of the axes.
    pub axes: Vec<String>,
}

/// A pose at which the joints have lost a direction.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SingularBlock {
    /// Line of the block.
    pub line: usize,
    /// The direction in frame `w`: displacement of the tip and turn about it.
    pub lost_w: [f64; 6],
    /// Error of the tool axis that stays, rad.
    pub left_rad: f64,
}

/// A pose that the corrected machine does not reach.
#[non_exhaustive]
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Unreached {
    /// Line of the block.
    pub line: usize,
    /// Error of the tip that stays, m.
    pub left_m: f64,
    /// Error of the tool axis that stays, rad.
    pub left_rad: f64,
}

/// What [`compensate`](super::compensate) did. Lengths in m, angles in rad.
#[non_exhaustive]
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// Name of the machine.
    pub machine: String,
    /// Lines read.
    pub blocks: u64,
    /// Blocks that move under program coordinates, as often as they run.
    pub moves: u64,
    /// Blocks that move in the machine's own frame or to a reference point, left as they are.
    pub machine_moves: u64,
    /// Axis words with another number than before.
    pub corrected_words: u64,
    /// Axis words that were not there before.
    pub inserted_words: u64,
    /// Arcs written as lines.
    pub split_arcs: u64,
    /// Lines written in their place.
    pub arc_lines: u64,
    /// Straight moves that were subdivided.
    pub split_moves: u64,
    /// Drilling cycles: their places are corrected in the plane, their depths are not.
    pub cycles: u64,
    /// Largest error of the tip that this leaves.
    pub largest_cycle_m: Worst,
    /// Largest displacement of the tip by the correction.
    pub largest_correction_m: Worst,
    /// Largest turn of the tool axis by the correction.
    pub largest_correction_rad: Worst,
    /// Largest error of the tip that is left at the end of a move, rounding included, by the model.
    pub largest_left_m: Worst,
    /// Largest error of the tool axis that is left at the end of a move.
    pub largest_left_rad: Worst,
    /// Largest error of the tip that is left between the ends of a straight move.
    pub largest_mid_line_m: Worst,
    /// Largest distance of the lines from their arc.
    pub largest_arc_m: Worst,
    /// Where the correction steps because a direction of travel changed.
    pub reversals: Listed<Reversal>,
    /// Those of these steps that are larger than was asked for.
    #[serde(default)]
    pub large_steps: Listed<Reversal>,
    /// Largest of these steps.
    pub largest_reversal_m: Worst,
    /// Blocks in a pattern of directions that the calibration has not seen; they are corrected by what single directions have
    /// shown.
    pub unseen_directions: Listed<UnseenPiece>,
    /// Where an axis whose direction of travel counts comes from a place that is not known.
    pub unknown_ways: Listed<UnknownWay>,
    /// Moves that are not corrected in full, because it is not known where an axis stands.
    #[serde(default)]
    pub unknown_places: Listed<UnknownPlace>,
    /// Blocks at which a direction of the tool is lost.
    pub singular: Listed<SingularBlock>,
    /// Blocks whose tip the machine does not reach.
    pub unreachable: Listed<Unreached>,
    /// Axis numbers without a decimal point, taken as millimetres and degrees; 0 where [`CompensateOptions::integer_unit`](super::CompensateOptions) says what
    /// they are, and for controls that have no choice.
    #[serde(default)]
    pub numbers_without_point: u64,
    /// Moves beyond what the calibration has seen.
    pub extrapolated_moves: u64,
    /// Joints that leave what the calibration has seen, and how far they do.
    #[serde(default)]
    pub extrapolated_joints: Vec<ExtrapolatedJoint>,
    /// Addresses that the program never names; their joints were taken where they stand at the start, and
    /// left there.
    pub never_programmed: Vec<String>,
    /// Effects of the calibration that a program says nothing of: they are not corrected.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
    /// Effects that change with time, and the state in which they are corrected.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held: Vec<LeftOut>,
    /// What the calibration has not seen of the errors of tip and tool axis at the ends of these moves;
    /// `None` where that is not known.
    pub unseen: Option<Unseen>,
}

impl Report {
    /// Whether anything is written otherwise than it was.
    pub fn has_corrected(&self) -> bool {
        self.corrected_words + self.inserted_words + self.split_arcs + self.split_moves > 0
    }
}

/// Errors of tip and tool axis that may be left because no recording has shown them. Root mean squares over
/// the moves, one standard deviation.
#[non_exhaustive]
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Unseen {
    /// Of the tip, m.
    pub tip_m: f64,
    /// Of the tool axis, rad.
    pub axis_rad: f64,
    /// The deviations behind it, largest first.
    pub patterns: Vec<UnseenPattern>,
}

/// One combination of deviations that no recording has shown.
#[non_exhaustive]
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct UnseenPattern {
    /// Its largest components, in units of their tolerances: `c.vx`.
    pub mostly: Vec<String>,
    /// Of the tip, m.
    pub tip_m: f64,
    /// Of the tool axis, rad.
    pub axis_rad: f64,
}
