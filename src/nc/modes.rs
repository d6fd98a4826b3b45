//! What can be in force, and what is known of an axis.

/// How a block moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionKind {
    /// `G0`, `L ... FMAX`.
    Rapid,
    /// `G1`, `L`.
    Linear,
    /// `G2`.
    ArcCw,
    /// `G3`.
    ArcCcw,
    /// A canned cycle of RS-274 at this position, `G73`, `G81` ...
    Cycle,
    /// Another interpolation: splines, threads, probing, `CIP`, Heidenhain's path functions other than `L`.
    Other,
    /// The program has not said how, or has cancelled it with `G80`.
    Unstated,
}

/// What numbers of axis words mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distance {
    /// `G90`.
    Absolute,
    /// `G91`.
    Incremental,
}

/// Unit of lengths in the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Units {
    /// `G21`, `G71`, `G710`.
    Millimetre,
    /// `G20`, `G70`, `G700`.
    Inch,
}

/// What the `F` word means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feed {
    /// `G93`: one over the time of the block.
    InverseTime,
    /// `G94`: per minute.
    PerMinute,
    /// `G95`: per revolution of the spindle.
    PerRevolution,
}

/// Plane of arcs; its normal is the direction of the tool length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// `G17`.
    Xy,
    /// `G18`.
    Zx,
    /// `G19`.
    Yz,
}

/// What is in force; `None` until the program says it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Modes {
    /// The motion of blocks that name axes only.
    pub motion: Option<MotionKind>,
    /// Absolute or incremental; absolute is taken until the program says it.
    pub distance: Option<Distance>,
    /// Unit of lengths.
    pub units: Option<Units>,
    /// Meaning of `F`.
    pub feed: Option<Feed>,
    /// Plane of arcs.
    pub plane: Option<Plane>,
    /// Whether coordinates are those of the tool centre point: `G43.4`, `G43.5`, `G234`, `TRAORI`, `M128`, `FUNCTION TCPM`.
    pub tool_centre_point: Option<bool>,
    /// Whether tool length counts: `G43`, `G49`.
    pub tool_length: Option<bool>,
    /// The `H` word in RS-274, the `D` word in Siemens programs.
    pub length_offset: Option<f64>,
    /// The `T` word's value as written, or the first value behind `TOOL CALL`.
    pub tool: Option<String>,
    /// Whether a cycle or macro is called behind every block that moves: `MCALL`, `G66`.
    pub modal_call: bool,
    /// The work offset: `G54`, `G54.1 P3`, `G500`.
    pub work_offset: Option<String>,
}

impl Modes {
    /// First letter of the axis along the normal of the plane.
    pub(super) fn normal(&self) -> char {
        match self.plane {
            None | Some(Plane::Xy) => 'Z',
            Some(Plane::Zx) => 'Y',
            Some(Plane::Yz) => 'X',
        }
    }
}

/// Why a coordinate is not known any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// Its value is an expression, or an increment upon something unknown.
    Expression,
    /// The frame changed: `TRANS`, `ROT`, `G92`, `G52`, `G68`, `CYCLE800`.
    Frame,
    /// Another work offset.
    WorkOffset,
    /// It was programmed in the machine's frame: `G53`, `SUPA`.
    MachineFrame,
    /// Tool centre point mode or another transformation was switched.
    Transformation,
    /// Another tool or tool length.
    Tool,
    /// The unit changed.
    Units,
    /// A sub-program, macro or cycle may have moved it.
    Call,
    /// It went to a reference point, or stopped where a probe touched.
    Reference,
    /// It was given by polar coordinates or by a tool direction.
    OtherWords,
}

/// The programmed position of one axis, programmed units, in the frame in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinate {
    /// Not programmed so far.
    Unprogrammed,
    /// Programmed, absolute.
    Known(f64),
    /// Once programmed, not known now.
    Lost {
        /// Line since which it is not known.
        line: usize,
        /// What happened there.
        why: Why,
        /// The value before that, if one was known.
        last: Option<f64>,
    },
}

impl Coordinate {
    /// The value where it is known.
    pub fn value(self) -> Option<f64> {
        match self {
            Coordinate::Known(value) => Some(value),
            _ => None,
        }
    }
}
