//! SINUMERIK 840D and its relatives.

use super::super::modes::{Distance, Feed, MotionKind, Plane, Units};
use super::super::vocabulary::{Action::*, Codes, Statement, Vocabulary};

pub(super) const VOCABULARY: Vocabulary = Vocabulary {
    g: &[
        Codes::one(0_0, Motion(MotionKind::Rapid)),
        Codes::one(1_0, Motion(MotionKind::Linear)),
        Codes::one(2_0, Motion(MotionKind::ArcCw)),
        Codes::one(3_0, Motion(MotionKind::ArcCcw)),
        Codes::one(4_0, NoTargets),
        Codes::one(9_0, Nothing),
        Codes::one(17_0, Plane(Plane::Xy)),
        Codes::one(18_0, Plane(Plane::Zx)),
        Codes::one(19_0, Plane(Plane::Yz)),
        // Limits of the spindle and of the working area.
        Codes::whole(25_0, 26_0, NoTargets),
        Codes::whole(33_0, 35_0, Motion(MotionKind::Other)),
        Codes::whole(40_0, 42_0, Nothing),
        Codes::one(53_0, MachineFrame),
        Codes::one(54_0, Offset),
        Codes::one(55_0, Offset),
        Codes::one(56_0, Offset),
        Codes::one(57_0, Offset),
        Codes::whole(58_0, 59_0, Frame),
        Codes::one(60_0, Nothing),
        Codes::one(62_0, Nothing),
        Codes::one(63_0, Motion(MotionKind::Other)),
        Codes::one(64_0, Nothing),
        Codes::one(70_0, Units(Units::Inch)),
        Codes::one(71_0, Units(Units::Millimetre)),
        Codes::whole(74_0, 75_0, Reference),
        Codes::one(90_0, Distance(Distance::Absolute)),
        Codes::one(91_0, Distance(Distance::Incremental)),
        Codes::one(93_0, Feed(Feed::InverseTime)),
        Codes::one(94_0, Feed(Feed::PerMinute)),
        Codes::one(95_0, Feed(Feed::PerRevolution)),
        Codes::whole(96_0, 97_0, Nothing),
        // Poles of polar coordinates, which are refused where a block uses them.
        Codes::whole(110_0, 112_0, NoTargets),
        Codes::one(153_0, MachineFrame),
        Codes::whole(331_0, 332_0, Motion(MotionKind::Other)),
        Codes::whole(450_0, 451_0, Nothing),
        Codes::whole(460_0, 462_0, Nothing),
        Codes::one(500_0, Offset),
        Codes::whole(505_0, 599_0, Offset),
        Codes::whole(601_0, 603_0, Nothing),
        Codes::one(621_0, Nothing),
        Codes::whole(641_0, 645_0, Nothing),
        Codes::one(700_0, Units(Units::Inch)),
        Codes::one(710_0, Units(Units::Millimetre)),
        Codes::one(751_0, Reference),
        Codes::whole(961_0, 962_0, Nothing),
        Codes::whole(971_0, 973_0, Nothing),
    ],
    m: &[
        Codes::whole(0_0, 5_0, Nothing),
        Codes::one(6_0, ToolChange),
        Codes::whole(7_0, 11_0, Nothing),
        Codes::one(17_0, Nothing),
        Codes::one(19_0, Nothing),
        Codes::one(30_0, Nothing),
        Codes::whole(40_0, 45_0, Nothing),
        Codes::one(70_0, Nothing),
    ],
    addresses: &[
        "A2", "A3", "A4", "A5", "ACC", "ADIS", "ADISPOS", "AP", "AR", "ATOL", "B2", "B3", "B4", "B5", "C2", "C3", "C4",
        "C5", "CFTCP", "CHF", "CHR", "CR", "CTOL", "D", "F", "FB", "FRC", "FRCM", "FZ", "G", "H", "I", "I1", "J", "J1",
        "K", "K1", "L", "LEAD", "LIMS", "M", "N", "OTOL", "OVR", "OVRRAP", "P", "RND", "RNDM", "RP", "RPL", "S", "SCC",
        "SF", "SPOS", "SPOSA", "STAT", "SVC", "T", "TILT", "TU", "TURN",
    ],
    names: "
        TRAORI TRAFOOF SUPA SUPD COMPON COMPOF COMPCURV COMPCAD COMPSURF COMPPATH SOFT SOFTA BRISK BRISKA DRIVE DRIVEA
        FFWON FFWOF FNORM FLIN FCUB FPO FENDNORM CFC CFTCP CFIN DIAMOF DYNNORM DYNPOS DYNROUGH DYNSEMIFIN DYNFINISH
        DYNPREC ORIEULER ORIRPY ORIRPY2 ORIVIRT1 ORIVIRT2 ORIMKS ORIWKS ORIAXES ORIVECT ORIPATH ORIPATHS ORIPLANE
        ORICURVE ORICONCW ORICONCCW ORICONIO ORICONTO ORIC ORID ORIS ORISOF ORISON ORIROTA ORIROTR ORIROTT ORIROTC
        ORISOLH OSC OSD OSS OSSE OST OSOF CUT2D CUT2DF CUT2DD CUT3DC CUT3DF CUT3DFS CUT3DFF CUTCONON CUTCONOF CDON CDOF
        CDOF2 KONT KONTC KONTT NORM RTLION RTLIOF UPATH SPATH STOPRE STARTFIFO STOPFIFO FIFOCTRL SBLON SBLOF DISPLON
        DISPLOF DISPLAY SAVE WALIMON WALIMOF WALCS0 CP LFON LFOF LFTXT LFWP LFPOS TOFFOF ECOF PON POF SPON SPOF PONS SON
        SONS PDELAYON PDELAYOF BAUTO EAUTO BNAT ENAT BTAN ETAN DELDTG SPCON SPCOF FGROUP MSG SETMS FRCM RPLON PAROTOF
        TANGOF G1ADIS ADIS ADISPOS CTOL OTOL ROTOF MCALL RET
    ",
    calls: "
        MSG CYCLE832 SETAL SETMS WORKPIECE GROUP_BEGIN GROUP_END STOPRE ORISON WRITE READ DELETE WAITM WAITMC WAITE START
        INIT CLEARM SETM COUPDEL COUPOF TRAILOF AXNAME GETSELT GETT MMC SETPIECE ADIS PRIO SPI FCTDEF ENABLE DISABLE DEBUG
        PRINT LOG AC IC DC ACP ACN FGROUP TANGOF TRAORI SUPD WALIMOF SPCON SPCOF
    ",
    // What runs beside the program, or interrupts it.
    statements: &[
        Statement { name: "WHEN", starts: &[], never: &[] },
        Statement { name: "WHENEVER", starts: &[], never: &[] },
        Statement { name: "EVERY", starts: &[], never: &[] },
        Statement { name: "FROM", starts: &[], never: &[] },
        Statement { name: "SETINT", starts: &[], never: &[] },
    ],
    // Several spindles and auxiliary functions, arithmetic parameters, the user's own names; of the control's variables those
    // that count, time and switch; limits of speed by axis.
    parameters: &[
        "F", "H", "M", "R", "S", "T", "_", "R[", "$R[", "$AC_TIMER", "$AC_MARKER", "$AC_PARAM", "$A_OUT", "FA[", "OVRA[", "ACC[",
        "ACCLIMA[", "VELOLIM[", "JERKLIM[", "JERKLIMA[", "FL[", "FGREF[", "VELOLIMA[", "SPOS[", "SPOSA[", "LIMS[", "SVC[",
    ],
};
