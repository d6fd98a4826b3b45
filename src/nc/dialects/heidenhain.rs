//! Heidenhain TNC, in its own conversational language or in DIN/ISO.

use super::super::modes::{Distance, Feed, MotionKind, Plane, Units};
use super::super::vocabulary::{Action::*, Codes, Statement, Vocabulary};

pub(super) const VOCABULARY: Vocabulary = Vocabulary {
    // DIN/ISO.
    g: &[
        Codes::one(0_0, Motion(MotionKind::Rapid)),
        Codes::one(1_0, Motion(MotionKind::Linear)),
        Codes::one(2_0, Motion(MotionKind::ArcCw)),
        Codes::one(3_0, Motion(MotionKind::ArcCcw)),
        Codes::one(4_0, NoTargets),
        Codes::one(17_0, Plane(Plane::Xy)),
        Codes::one(18_0, Plane(Plane::Zx)),
        Codes::one(19_0, Plane(Plane::Yz)),
        // Datum shift, mirror, tilted plane, rotation, scale.
        Codes::one(28_0, FrameOfAll),
        // Form of the blank.
        Codes::whole(30_0, 31_0, NoTargets),
        Codes::whole(40_0, 42_0, Nothing),
        Codes::whole(53_0, 54_0, FrameOfAll),
        Codes::whole(70_0, 70_0, Units(Units::Inch)),
        Codes::one(71_0, Units(Units::Millimetre)),
        Codes::whole(72_0, 73_0, FrameOfAll),
        Codes::one(79_0, Call),
        Codes::one(80_0, FrameOfAll),
        Codes::one(90_0, Distance(Distance::Absolute)),
        Codes::one(91_0, Distance(Distance::Incremental)),
        Codes::one(94_0, Feed(Feed::PerMinute)),
        Codes::one(98_0, Nothing),
        Codes::one(99_0, Nothing),
    ],
    m: &[
        Codes::whole(0_0, 6_0, Nothing),
        Codes::whole(8_0, 9_0, Nothing),
        Codes::whole(13_0, 14_0, Nothing),
        Codes::one(19_0, Nothing),
        Codes::one(30_0, Nothing),
        Codes::one(89_0, Call),
        Codes::whole(91_0, 92_0, MachineFrame),
        Codes::whole(97_0, 98_0, Nothing),
        Codes::one(99_0, Call),
        Codes::one(103_0, Nothing),
        Codes::whole(107_0, 112_0, Nothing),
        Codes::whole(116_0, 117_0, Nothing),
        // A path laid over by hand.
        Codes::one(118_0, NotFollowed),
        Codes::one(120_0, Nothing),
        Codes::whole(126_0, 127_0, Nothing),
        Codes::one(128_0, Tcp(true)),
        Codes::one(129_0, Tcp(false)),
        // The untilted frame, the tilted axes, tool retraction, basic rotation, the machine's kinematics.
        Codes::one(130_0, NotFollowed),
        Codes::whole(136_0, 137_0, Nothing),
        Codes::one(138_0, NotFollowed),
        Codes::one(140_0, NotFollowed),
        Codes::whole(143_0, 145_0, NotFollowed),
        Codes::whole(148_0, 149_0, Nothing),
    ],
    addresses: &[
        "CCA", "D", "DL", "DR", "DR2", "F", "FT", "FU", "FZ", "G", "H", "I", "J", "K", "L", "LEN", "M", "N", "NX", "NY", "NZ", "P",
        "PA", "PR", "R", "S", "T", "TX", "TY", "TZ",
    ],
    names: "
        L LN C CR CT LP CP CTP RND CHF APPR DEP CC LT LCT PLT PLN PCT PLCT FMAX FAUTO F R0 RL RR DR+ DR- BEGIN END BLK TOOL
        CYCL LBL CALL FN FUNCTION PLANE TCH TRANS DECLARE PATTERN SEL STOP MAX AUTO
    ",
    calls: "",
    statements: &[
        Statement {
            name: "FUNCTION",
            starts: &["TCPM", "RESET TCPM", "MODE MILL", "FEED", "RESET FEED", "S-PULSE", "DWELL"],
            never: &[],
        },
        // Allowances of length.
        Statement { name: "TOOL", starts: &["CALL", "DEF"], never: &[" DL"] },
        Statement {
            name: "PLANE",
            starts: &["RESET", "SPATIAL", "PROJECTED", "EULER", "VECTOR", "POINTS", "RELATIV", "AXIAL"],
            never: &["RESET TURN", "RESET MOVE"],
        },
        // Arithmetic, texts, reading; not what writes into the control.
        Statement {
            name: "FN",
            starts: &["0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12", "13", "14", "15", "16", "18", "19", "20"],
            never: &[],
        },
        // Frames, dwell, orientation, tolerance, and definitions that a later call runs.
        Statement {
            name: "CYCL",
            starts: &[
                "CALL", "DEF 1", "DEF 2", "DEF 3", "DEF 4", "DEF 5", "DEF 7", "DEF 8", "DEF 9", "DEF 10", "DEF 11", "DEF 13", "DEF 14",
                "DEF 17", "DEF 18", "DEF 19", "DEF 20", "DEF 21", "DEF 22", "DEF 23", "DEF 24", "DEF 25", "DEF 26", "DEF 32", "DEF 200",
                "DEF 201", "DEF 202", "DEF 203", "DEF 204", "DEF 205", "DEF 206", "DEF 207", "DEF 208", "DEF 209", "DEF 233", "DEF 240",
                "DEF 241", "DEF 247", "DEF 251", "DEF 252", "DEF 253", "DEF 254", "DEF 256", "DEF 257", "DEF 258", "DEF 262", "DEF 263",
                "DEF 264", "DEF 265", "DEF 267", "DEF 270", "DEF 271", "DEF 272", "DEF 273", "DEF 274", "DEF 275", "DEF 276",
            ],
            never: &[],
        },
    ],
    parameters: &["Q", "QL", "QR", "QS"],
};
