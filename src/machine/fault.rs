//! What can be wrong with a machine, and the mend for each.

use crate::error::Fault;

/// A fault in a machine declaration.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MachineFault {
    /// A branch without a frame.
    #[error("list `{branch}` is empty")]
    EmptyBranch {
        /// `workpiece`, `tool` or `dh.rows`.
        branch: String,
    },
    /// A list of frames that is not there, and no block `dh` in its place.
    #[error("field `{list}` of `Machine` is missing")]
    MissingList {
        /// `workpiece` or `tool`.
        list: String,
    },
    /// Denavit-Hartenberg parameters beside the list that they stand for.
    #[error("`dh` stands beside `tool`")]
    DhBesideTool,
    /// A row of `dh` whose sign is none.
    #[error("sign of joint \"{joint}\" is {sign}")]
    Sign {
        /// Name of the joint.
        joint: String,
        /// As written.
        sign: i8,
    },
    /// The last frame of a list has the wrong name.
    #[error("list `{branch}` ends with frame \"{found}\", not with \"{expected}\"")]
    LastFrame {
        /// `workpiece` or `tool`.
        branch: String,
        /// `w` or `t`.
        expected: String,
        /// The name found.
        found: String,
    },
    /// The last frame carries a joint.
    #[error("last frame \"{frame}\" has a joint")]
    JointOnLastFrame {
        /// Its name.
        frame: String,
    },
    /// A name that stands twice.
    #[error("{what} \"{name}\" is named twice")]
    NameTwice {
        /// `frame` or `joint`.
        what: String,
        /// The name.
        name: String,
    },
    /// A name that recordings could not use.
    #[error("{what} name \"{name}\" cannot be used")]
    BadName {
        /// `machine`, `frame` or `joint`.
        what: String,
        /// The name.
        name: String,
    },
    /// A vector of length zero.
    #[error("{what} has length 0")]
    ZeroVector {
        /// Whose.
        what: String,
    },
    /// An axis that is not a unit vector.
    #[error("axis of joint \"{joint}\" has length {length:.6}, expected 1")]
    AxisLength {
        /// Name of the joint.
        joint: String,
        /// Its length.
        length: f64,
        /// The unit vector along it.
        unit: [f64; 3],
    },
    /// An axis word that names none.
    #[error("axis \"{word}\" is not known")]
    AxisWord {
        /// As written.
        word: String,
    },
    /// NaN or infinite, or too large to be meant.
    #[error("{what} is {value:?}, not a usable number")]
    NotFinite {
        /// Of what.
        what: String,
        /// The value.
        value: f64,
    },
    /// Lower limit not below the upper one.
    #[error("travel of joint \"{joint}\" runs from {from} to {to}")]
    TravelReversed {
        /// Name of the joint.
        joint: String,
        /// Lower limit in the file's unit.
        from: f64,
        /// Upper limit in the file's unit.
        to: f64,
    },
    /// A tolerance that is not positive.
    #[error("tolerance of {what} is {value}")]
    Tolerance {
        /// `translation` or `rotation`.
        what: String,
        /// In the file's unit; in SI where there is no file.
        value: f64,
    },
    /// A mass that is negative.
    #[error("mass of frame \"{frame}\" is {value} kg")]
    Mass {
        /// Name of the frame.
        frame: String,
        /// kg.
        value: f64,
    },
    /// A centre of mass on a frame without mass.
    #[error("frame \"{frame}\" has a centre of mass but no mass")]
    CentreWithoutMass {
        /// Name of the frame.
        frame: String,
    },
    /// A joint with an empty list of leaders.
    #[error("joint \"{joint}\" follows nothing")]
    FollowsNothing {
        /// Name of the joint.
        joint: String,
    },
    /// A joint follows a name that is no joint, or one that itself has no command.
    #[error("joint \"{joint}\" follows \"{leader}\", which has no command of its own")]
    Leader {
        /// The follower.
        joint: String,
        /// The unknown leader.
        leader: String,
        /// Joints that could lead.
        known: String,
    },
    /// `at`/`rotation` and `moves` both given.
    #[error("frame \"{frame}\" has `moves` beside `at` or `rotation`")]
    TwoPlacements {
        /// Name of the frame.
        frame: String,
    },
    /// NC sign other than 1 and -1, or an address that is not letters and digits.
    #[error("NC word of joint \"{joint}\" has address \"{address}\" and sign {sign}")]
    NcWord {
        /// Name of the joint.
        joint: String,
        /// As written.
        address: String,
        /// As written.
        sign: i8,
    },
    /// A side branch with what only a chain that is measured can have.
    #[error("{what}")]
    BadSideBranch {
        /// What is wrong.
        what: String,
    },
    /// A side branch with recordings of its own, of which no column could be named.
    #[error("{what}")]
    UnnamedSideBranch {
        /// What is wrong.
        what: String,
    },
    /// A machine without any joint.
    #[error("no dyad has a joint")]
    NoJoint,
    /// A frame named in a calibration that the machine does not have.
    #[error("frame \"{frame}\" is not one of the machine's")]
    UnknownFrame {
        /// As written.
        frame: String,
        /// The machine's frames.
        known: String,
    },
    /// Pieces of a calibration that do not fit together.
    #[error("{what}")]
    BadPieces {
        /// What is wrong.
        what: String,
    },
    /// An effect of a calibration that does not fit the machine.
    #[error("{what}")]
    BadEffect {
        /// What is wrong.
        what: String,
    },
    /// An error motion of a calibration that is none.
    #[error("{what}")]
    BadErrorMotion {
        /// What is wrong.
        what: String,
    },
}

impl Fault for MachineFault {
    fn mend(&self) -> String {
        use MachineFault::*;
        match self {
            EmptyBranch { branch } if branch == "dh.rows" => {
                "write a row for each joint: (joint: \"q1\", d: 330, a: 50, alpha: -90)".into()
            }
            EmptyBranch { branch } => {
                let last = if branch == "tool" { "t" } else { "w" };
                format!("write at least the last frame: {branch}: [(frame: \"{last}\")]")
            }
            MissingList { list } => format!("add `{list}: ...`; `dh: ...` may stand in place of both lists"),
            DhBesideTool => "leave one of them out: `dh` says all frames from the base to the tool".into(),
            Sign { .. } => "write 1, or -1 where the joint counts the other way".into(),
            LastFrame { branch, expected, .. } => {
                format!("end the list `{branch}` with (frame: \"{expected}\", at: (x, y, z))")
            }
            JointOnLastFrame { frame } => {
                format!("give the joint a frame of its own before \"{frame}\"; nothing comes after \"{frame}\" that it could move")
            }
            NameTwice { what, .. } => format!("give every {what} a name of its own"),
            BadName { .. } => {
                "use letters, digits, `_` and `-`, starting with a letter; `t` is the tool frame and the time column, `w` the workpiece frame".into()
            }
            ZeroVector { .. } => "write a vector of length 1, such as (0, 0, -1)".into(),
            AxisLength { unit: [x, y, z], .. } => {
                format!("write one of \"x\" \"-x\" \"y\" \"-y\" \"z\" \"-z\", or the unit vector ({x}, {y}, {z})")
            }
            AxisWord { .. } => {
                "write one of \"x\" \"-x\" \"y\" \"-y\" \"z\" \"-z\", or a unit vector (0, 0.6, 0.8)".into()
            }
            NotFinite { .. } => "write a plain number; nothing on a machine is larger than 1e9 m or 1e9 rad".into(),
            TravelReversed { .. } => "write the lower limit first: travel: (lower, upper)".into(),
            Tolerance { .. } => "write a positive number: how far off you expect such a value to be".into(),
            Mass { .. } => "write a mass of zero or more, in kg".into(),
            CentreWithoutMass { .. } => "add `mass: ...` in kg".into(),
            FollowsNothing { joint } => {
                format!("name what it follows, follows: {{\"{joint}\": 1}}, or leave `follows` out")
            }
            Leader { known, .. } if known.is_empty() => {
                "let one joint move by itself: leave out its `follows`, or name it in its own".into()
            }
            Leader { known, .. } => format!("joints that can lead: {known}"),
            TwoPlacements { .. } => "keep one of the two ways of saying where the frame is".into(),
            NcWord { .. } => "write address: letters and digits such as \"B\" or \"C1\", sign: 1 or -1".into(),
            NoJoint => "a machine needs a joint: (frame: \"x\", joint: Prismatic(axis: \"x\"))".into(),
            UnnamedSideBranch { .. } => "call them NAME.q1, NAME.q2 and so on: column q1 of its recordings becomes NAME.q1".into(),
            BadSideBranch { .. } => "leave it out: a side branch weighs, its joints are columns of recordings, and nothing of it is identified".into(),
            UnknownFrame { known, .. } => format!("frames of this machine: {known}"),
            BadPieces { .. } => "write the pieces as `calibrate --directions` does".into(),
            BadEffect { .. } => "write the effects as `diagnose -o` does, or take this one out".into(),
            BadErrorMotion { .. } => "write error motions as `calibrate --error-motions` does".into(),
        }
    }
}
