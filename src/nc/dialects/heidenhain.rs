//! Heidenhain TNC, in its own conversational language or in DIN/ISO.

use super::super::modes::{Distance, Feed, MotionKind, Plane, Units};
use super::super::vocabulary::{Action::*, Codes, Vocabulary};

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
        Codes::range(30_0, 31_0, NoTargets),
        Codes::range(40_0, 42_0, Nothing),
        Codes::range(53_0, 54_0, FrameOfAll),
        Codes::range(70_0, 70_0, Units(Units::Inch)),
        Codes::one(71_0, Units(Units::Millimetre)),
        Codes::range(72_0, 73_0, FrameOfAll),
        Codes::one(79_0, Call),
        Codes::one(80_0, FrameOfAll),
        Codes::one(90_0, Distance(Distance::Absolute)),
        Codes::one(91_0, Distance(Distance::Incremental)),
        Codes::one(94_0, Feed(Feed::PerMinute)),
        Codes::one(98_0, Nothing),
        Codes::one(99_0, Nothing),
    ],
    m: &[
        Codes::range(0_0, 6_0, Nothing),
        Codes::range(8_0, 9_0, Nothing),
        Codes::range(13_0, 14_0, Nothing),
        Codes::one(19_0, Nothing),
        Codes::one(30_0, Nothing),
        Codes::one(89_0, Call),
        Codes::range(91_0, 92_0, MachineFrame),
        Codes::range(97_0, 98_0, Nothing),
        Codes::one(99_0, Call),
        Codes::one(103_0, Nothing),
        Codes::range(107_0, 112_0, Nothing),
        Codes::range(116_0, 117_0, Nothing),
        // A path laid over by hand.
        Codes::one(118_0, NotFollowed),
        Codes::one(120_0, Nothing),
        Codes::range(126_0, 127_0, Nothing),
        Codes::one(128_0, Tcp(true)),
        Codes::one(129_0, Tcp(false)),
        // The untilted frame, the tilted axes, tool retraction, basic rotation, the machine's kinematics.
        Codes::one(130_0, NotFollowed),
        Codes::range(136_0, 137_0, Nothing),
        Codes::one(138_0, NotFollowed),
        Codes::one(140_0, NotFollowed),
        Codes::range(143_0, 145_0, NotFollowed),
        Codes::range(148_0, 149_0, Nothing),
    ],
    addresses: &[
        "CCA", "D", "DL", "DR", "DR2", "F", "FT", "FU", "FZ", "G", "H", "I", "J", "K", "L", "LEN", "M", "N", "NX", "NY", "NZ", "P",
        "PA", "PR", "R", "S", "T", "TX", "TY", "TZ",
    ],
    names: "
        L LN C CR CT LP CP CTP RND CHF APPR DEP CC LT LCT PLT PLN PCT PLCT FMAX FAUTO F R0 RL RR DR+ DR- BEGIN END BLK TOOL
        CYCL LBL CALL FN FUNCTION PLANE TCH TRANS DECLARE PATTERN SEL STOP MAX
    ",
    calls: "",
    parameters: &["Q", "QL", "QR", "QS"],
};
