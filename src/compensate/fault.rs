//! Why a program cannot be corrected as it stands, and the mend for each.

use crate::error::Fault;
use crate::nc::Unknown;
use crate::wording::count;

/// A block whose correction matters and cannot be written.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CompensateFault {
    /// An axis word that only the control can evaluate.
    #[error("`{address}` is the expression `{text}`; its correction cannot be known here")]
    Expression {
        /// Address of the axis.
        address: String,
        /// As written.
        text: String,
    },
    /// An increment or a preset from a place that is not known.
    #[error("`{address}` counts from a place that the program has not said")]
    UnknownStart {
        /// Address of the axis.
        address: String,
    },
    /// An arc, and no tolerance for lines in its place.
    #[error("an arc that the machine's errors deform")]
    Arc,
    /// An arc that is none.
    #[error("this arc cannot be followed: {what}")]
    ArcGeometry {
        /// What is wrong with it.
        what: String,
    },
    /// A tolerance below what the written digits hold.
    #[error(
        "a tolerance of {tolerance_um} um cannot be held with {}",
        count(*decimals as u64, "decimal", "decimals")
    )]
    ArcTolerance {
        /// As asked for, um.
        tolerance_um: f64,
        /// Digits behind the point.
        decimals: usize,
    },
    /// An arc that stays further off than its tolerance, whatever lines take its place.
    #[error(
        "{left_um:.1} um are left on this arc, more than the {tolerance_um} um of --arcs{}",
        without(axes)
    )]
    ArcNotHeld {
        /// What is left, um.
        left_um: f64,
        /// As asked for, um.
        tolerance_um: f64,
        /// Axes that the program has not placed before, so that they are not written.
        axes: Vec<String>,
    },
    /// Another kind of motion.
    #[error("{what} cannot be corrected word by word")]
    OtherMotion {
        /// Which, with the words that say so.
        what: String,
    },
    /// A tool without known length.
    #[error("the correction depends on the length of tool {tool}, which is not known")]
    UnknownTool {
        /// As the program calls it.
        tool: String,
    },
    /// A work offset without known numbers.
    #[error("the correction depends on work offset {name}, which is not known")]
    UnknownOffset {
        /// As the program calls it.
        name: String,
    },
    /// More than one of these two.
    #[error("the correction depends on {}, which are not known", unknown(tools, offsets))]
    UnknownSetup {
        /// Tools without known length, as the program calls them, each with the first line that depends on it.
        tools: Vec<(String, usize)>,
        /// Work offsets without known numbers, likewise.
        offsets: Vec<(String, usize)>,
    },
    /// A piece of a block whose meaning is not known.
    #[error("{}", unfollowed(*what, text))]
    NotFollowed {
        /// What kind of piece it is.
        what: Unknown,
        /// As written.
        text: String,
    },
    /// A move that needs axes of which it is not known where they stand.
    #[error("the correction of this move needs {}, and where {} is not known here", listed(axes), if axes.len() == 1 { "it stands" } else { "they stand" })]
    UnknownPlace {
        /// Addresses of the axes.
        axes: Vec<String>,
    },
    /// An M code of the machine's builder in a block that moves or changes the tool.
    #[error("what the axes do at `{code}` is not known, and this block moves or changes the tool")]
    UnknownFunction {
        /// As written.
        code: String,
    },
    /// A rotary move whose feed would mean something else.
    #[error(
        "by its correction this rotary move gets linear words, and F would no longer be degrees per minute"
    )]
    RotaryFeed,
    /// A joint that would leave its travel.
    #[error("`{joint}` would be sent {} beyond its travel", beyond(*by, *rotary))]
    OutOfTravel {
        /// Name of the joint.
        joint: String,
        /// How far, m or rad.
        by: f64,
        /// Whether it is a rotary one.
        rotary: bool,
    },
    /// A correction so large that the model is likely that of another machine.
    #[error("the tip would be corrected by {:.3} mm, more than the {:.3} mm that are taken for a correction", by_m * 1e3, bound_m * 1e3)]
    TooFar {
        /// By how much, m.
        by_m: f64,
        /// The bound, m.
        bound_m: f64,
    },
    /// Numbers without a point that cannot count micrometres.
    #[error("numbers without a point are to count um (`--integer-unit um`), and {what}")]
    Increments {
        /// Why not.
        what: &'static str,
    },
    /// A program that bears the mark of one that was written here.
    #[error("this program is compensated already{how}")]
    Compensated {
        /// For what and with what, where that is known.
        how: String,
    },
    /// A compensated program that was written from something else.
    #[error("this program was written {from}")]
    Foreign {
        /// From what.
        from: &'static str,
    },
    /// A place so far beyond what the calibration has seen that the model says nothing of it.
    #[error("the model is continued beyond what its recordings have seen{}: that alone moves the tip by {:.3} mm, more than the {:.3} mm that a machine as declared would be off", of_joints(joints), by_m * 1e3, bound_m * 1e3)]
    Unseen {
        /// Joints that are beyond their range.
        joints: Vec<String>,
        /// By how much, m.
        by_m: f64,
        /// What deviations of the size of the tolerances make, m.
        bound_m: f64,
    },
    /// A frame that is not followed.
    #[error("`{what}` changes what coordinates mean in a way that is not followed")]
    Frame {
        /// As written.
        what: String,
    },
    /// A call of something that may move.
    #[error("`{what}` calls what is not in this file, or may move in its own way")]
    Call {
        /// As written.
        what: String,
    },
    /// The order of blocks is not that of lines.
    #[error("`{what}`: which block comes next is decided on the control")]
    Jump {
        /// As written.
        what: String,
    },
    /// A block that the operator may leave out.
    #[error(
        "a block that may be left out moves, or changes what later blocks mean; what follows depends on whether it does"
    )]
    Skipped,
    /// A tool direction instead of rotary words.
    #[error("`{address}` gives the tool direction as a vector; which joints the control turns is not known")]
    ToolVector {
        /// The address.
        address: String,
    },
    /// Tool centre point programs on a machine without three linear axes X, Y, Z.
    #[error("tool centre point coordinates cannot be reached by this machine's X, Y and Z alone")]
    NoTcp,
    /// A line of a sub-program that would have to read differently at every call.
    #[error("this line belongs to a sub-program whose calls need different corrections here")]
    Contexts,
    /// Sub-programs that call each other without end.
    #[error("sub-programs call each other more than {limit} deep")]
    TooDeep {
        /// Most levels.
        limit: usize,
    },
}

fn without(axes: &[String]) -> String {
    if axes.is_empty() {
        return String::new();
    }
    format!(": the program has not placed {} before it", axes.join(", "))
}

/// ` by c and x`, where there are any.
fn of_joints(joints: &[String]) -> String {
    if joints.is_empty() { String::new() } else { format!(" by {}", listed(joints)) }
}

/// A travel that is exceeded, with its unit.
fn beyond(by: f64, rotary: bool) -> String {
    if rotary { format!("{:.4} deg", by.to_degrees()) } else { format!("{:.4} mm", by * 1e3) }
}

/// `X, Y and Z`.
fn listed(names: &[String]) -> String {
    match names.split_last() {
        None => String::new(),
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} and {last}", others.join(", ")),
    }
}

/// What is not followed, and why that matters.
fn unfollowed(what: Unknown, text: &str) -> String {
    match what {
        Unknown::Code => format!("what `{text}` does to axes and coordinates is not followed"),
        Unknown::Function => format!("`{text}` changes what moves mean in a way that is not followed"),
        Unknown::Axis => format!("`{text}` names an axis that the machine does not have"),
        Unknown::Address => format!("`{text}` is no word that is followed"),
        Unknown::Name => format!("`{text}` is not followed"),
        Unknown::Parameter => format!("`{text}` writes what the control itself goes by"),
        Unknown::Text => {
            format!("`{text}` is no word: no control reads it as it stands, or each in its own way")
        }
    }
}

/// `the lengths of tools 3 (line 8) and 7 (line 20), work offset G55 (line 8)`.
fn unknown(tools: &[(String, usize)], offsets: &[(String, usize)]) -> String {
    let some = |one: &str, many: &str, all: &[(String, usize)]| {
        let each: Vec<String> = all.iter().map(|(name, line)| format!("{name} (line {line})")).collect();
        let noun = if each.len() == 1 { one } else { many };
        (!each.is_empty()).then(|| format!("{noun} {}", listed(&each)))
    };
    let tools = some("the length of tool", "the lengths of tools", tools);
    let offsets = some("work offset", "work offsets", offsets);
    tools.into_iter().chain(offsets).collect::<Vec<_>>().join(", and on ")
}

/// The fields of a set-up that say how long these tools are.
fn tools_field<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let each: Vec<String> = names.map(|name| format!("\"{name}\": LENGTH")).collect();
    format!("tools: {{{}}}", each.join(", "))
}

/// The fields of a set-up that say where these work offsets lie.
fn offsets_field<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let each: Vec<String> = names.map(|name| format!("\"{name}\": {{\"X\": ..., ...}}")).collect();
    format!("work_offsets: {{{}}}", each.join(", "))
}

impl Fault for CompensateFault {
    fn mend(&self) -> String {
        use CompensateFault::*;
        let in_setup = |fields: &str| format!("give --setup FILE.ron with `{fields}` (docs/compensate.md)");
        match self {
            Expression { .. } => "let the CAM system or an editor put the number in, then compensate".into(),
            UnknownStart { address } => format!("move `{address}` to an absolute place first (G90)"),
            Arc => "give a tolerance, such as --arcs 0.002mm: the arc is written as lines within it".into(),
            ArcGeometry { .. } => "check start, end and centre of the arc".into(),
            ArcTolerance { decimals, .. } => {
                format!("give a larger tolerance, or --decimals {}", decimals + 1)
            }
            ArcNotHeld { axes, .. } if axes.is_empty() => {
                "keep the arc away from the ends of travel, or give a larger tolerance".into()
            }
            ArcNotHeld { axes, .. } => {
                let starts: Vec<String> = axes.iter().map(|axis| format!("\"{axis}\": ...")).collect();
                format!(
                    "name {} with an absolute place before the arc, or say where it stands: --setup FILE.ron with `start: {{{}}}`",
                    axes.join(", "),
                    starts.join(", ")
                )
            }
            NotFollowed { what: Unknown::Axis, .. } => {
                "give the calibrated file of the machine that the program is for, or take the word out".into()
            }
            NotFollowed { what: Unknown::Parameter, .. } => {
                "put it before the program, and say in the set-up what it sets (docs/compensate.md)".into()
            }
            NotFollowed { what: Unknown::Text, .. } => "write words as letter and number, without blanks between".into(),
            NotFollowed { what: Unknown::Address, .. } => {
                "a variable: declare it (DEF); anything else: let the CAM system do without (docs/compensate.md#followed)".into()
            }
            NotFollowed { .. } => {
                "let the CAM system write the block without it (docs/compensate.md#followed says what is followed)".into()
            }
            RotaryFeed => "program this block in inverse time (G93), or as a rapid move".into(),
            OutOfTravel { .. } => {
                "keep the move away from the ends of travel; where the control's zero is not that of the machine file, say so: --setup FILE.ron with `zero` and `work_offsets`".into()
            }
            TooFar { .. } => {
                "check that the calibrated file, units, set-up and program belong together; --max-correction LENGTH allows more".into()
            }
            Increments { .. } => "leave --integer-unit out, or write the program with points and in mm".into(),
            Compensated { .. } => {
                "compensate the program as it was before; --force compensates this one all the same".into()
            }
            Foreign { .. } => {
                "name the program, the set-up and the model that it was written from; --force compares all the same".into()
            }
            Unseen { .. } => {
                "record where the program goes, and calibrate again; --force goes on all the same".into()
            }
            UnknownPlace { axes } => format!(
                "name {} in this block or before it, or leave such moves as they are with --unknown keep",
                listed(axes)
            ),
            UnknownFunction { code } => {
                format!("say which axes it moves: --setup FILE.ron with `m_codes: {{\"{code}\": []}}`, or put it into a block of its own")
            }
            OtherMotion { .. } => "let the CAM system write it as G0, G1, G2, G3".into(),
            UnknownTool { tool } => in_setup(&tools_field([tool.as_str()].into_iter())),
            UnknownOffset { name } => in_setup(&offsets_field([name.as_str()].into_iter())),
            UnknownSetup { tools, offsets } => {
                let tools = (!tools.is_empty()).then(|| tools_field(tools.iter().map(|t| t.0.as_str())));
                let offsets =
                    (!offsets.is_empty()).then(|| offsets_field(offsets.iter().map(|o| o.0.as_str())));
                in_setup(&tools.into_iter().chain(offsets).collect::<Vec<_>>().join(", "))
            }
            Frame { .. } => "let the CAM system write coordinates without this frame".into(),
            Call { what } => format!(
                "put its blocks into this program; if it does not cut, give --setup FILE.ron with `calls: [\"{what}\"]`"
            ),
            Jump { .. } => "write the program in the order in which it runs".into(),
            Skipped => "take the skip mark away, or the block".into(),
            ToolVector { .. } => "let the CAM system write rotary axes instead of a vector".into(),
            NoTcp => "program joint coordinates, tool centre point function off".into(),
            Contexts => "put the sub-program's blocks into the program, once for each call".into(),
            TooDeep { .. } => "end each sub-program with a return".into(),
        }
    }
}
