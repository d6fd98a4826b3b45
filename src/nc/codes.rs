//! Names and codes of the dialects that change what follows them in a block or in the program.

use super::Dialect;

/// Functions of RS-274 that may stand directly behind an address: `XSIN[30]`.
pub(super) const FUNCTIONS: &[&str] = &[
    "ABS", "ACOS", "ASIN", "ATAN", "COS", "EXISTS", "EXP", "FIX", "FUP", "LN", "ROUND", "SIN", "SQRT", "TAN", "BIN",
    "BCD",
];

/// Operators of Siemens expressions that are words.
pub(super) const OPERATORS: &[&str] =
    &["DIV", "MOD", "AND", "OR", "XOR", "B_AND", "B_OR", "B_XOR", "NOT", "B_NOT"];

/// A name behind which the rest of the block is no motion: declarations, conditions, jumps, calls by name.
pub(super) fn takes_the_rest(name: &str, dialect: Dialect) -> bool {
    let name = name.trim_end_matches(|c: char| c.is_ascii_digit());
    match dialect {
        Dialect::Heidenhain => matches!(
            name,
            "BEGIN"
                | "END"
                | "BLK"
                | "TOOL"
                | "CYCL"
                | "LBL"
                | "CALL"
                | "FN"
                | "FUNCTION"
                | "PLANE"
                | "TCH"
                | "TRANS"
                | "DECLARE"
                | "PATTERN"
                | "SEL"
        ),
        _ => jumps(name) || by_name(name) || declares(name),
    }
}

/// Names after which the program need not go on with the next line.
pub(super) fn jumps(name: &str) -> bool {
    let name = name.trim_end_matches(|c: char| c.is_ascii_digit());
    matches!(
        name,
        "IF" | "ELSE" | "ELSEIF" | "ENDIF" | "WHILE" | "ENDWHILE" | "DO" | "END" | "FOR" | "ENDFOR" | "LOOP"
            | "ENDLOOP" | "REPEAT" | "REPEATB" | "ENDREPEAT" | "UNTIL" | "GOTO" | "GOTOF" | "GOTOB" | "GOTOC" | "GOTOS"
            | "CASE" | "BREAK" | "CONTINUE" | "RETURN" | "RET" | "SUB" | "ENDSUB"
    )
}

/// Names that call a program.
pub(super) fn by_name(name: &str) -> bool {
    matches!(name, "CALL" | "PCALL" | "EXTCALL" | "ISOCALL")
}

/// Names of declarations and of actions that run beside the program.
fn declares(name: &str) -> bool {
    matches!(
        name,
        "DEF" | "REDEF" | "DEFINE" | "PROC" | "EXTERN" | "WHEN" | "WHENEVER" | "EVERY" | "FROM" | "SETINT" | "MCALL"
    )
}

/// Calls that neither move nor call a program of the user.
pub(super) fn harmless_call(name: &str) -> bool {
    matches!(
        name,
        "MSG" | "CYCLE832" | "SETAL" | "SETMS" | "WORKPIECE" | "GROUP_BEGIN" | "GROUP_END" | "STOPRE" | "ORISON"
            | "WRITE" | "READ" | "DELETE" | "WAITM" | "WAITMC" | "WAITE" | "START" | "INIT" | "CLEARM" | "SETM" | "COUPON"
            | "COUPOF" | "COUPDEF" | "COUPDEL" | "TRAILON" | "TRAILOF" | "AXNAME" | "GETSELT" | "GETT" | "MMC" | "SETPIECE"
            | "ADIS" | "PRIO" | "SPI" | "GET" | "RELEASE" | "GETD" | "FCTDEF" | "TANG" | "ENABLE" | "DISABLE" | "DEBUG" | "PRINT"
            | "LOG" | "AC" | "IC" | "DC" | "ACP" | "ACN"
    )
}

/// Names of frames: numbers in their block are no targets, and coordinates mean something else behind them.
pub(super) fn frame(name: &str) -> bool {
    matches!(
        name,
        "TRANS" | "ATRANS" | "ROT" | "AROT" | "ROTS" | "AROTS" | "CROTS" | "SCALE" | "ASCALE" | "MIRROR" | "AMIRROR"
            | "TOFRAME" | "TOFRAMEX" | "TOFRAMEY" | "TOFRAMEZ" | "TOROT" | "TOROTX" | "TOROTY" | "TOROTZ" | "TOROTOF"
            | "PAROT" | "PAROTOF" | "TCARR" | "TCOABS" | "TCOFR" | "TCOFRX" | "TCOFRY" | "TCOFRZ"
    )
}

/// Names of kinematic transformations other than the five-axis one.
pub(super) fn other_transformation(name: &str) -> bool {
    matches!(name, "TRANSMIT" | "TRACYL" | "TRAANG" | "TRACON")
}

/// Names of interpolations of Siemens' first group.
pub(super) fn interpolation(name: &str) -> bool {
    matches!(name, "CIP" | "CT" | "ASPLINE" | "BSPLINE" | "CSPLINE" | "POLY" | "INVCW" | "INVCCW")
}

/// Siemens names without arguments that neither move nor call: anything else alone in a block is a program of the user.
pub(super) fn modal_name(name: &str) -> bool {
    const FAMILIES: &[&str] = &[
        "COMP", "SOFT", "BRISK", "DRIVE", "FFW", "FNORM", "FLIN", "FCUB", "FPO", "FENDNORM", "CFC", "CFTCP", "CFIN", "DIAM",
        "DIAC", "DYN", "ORI", "OSC", "OSD", "OSS", "OSOF", "OST", "CUT", "CDOF", "CDON", "KONT", "NORM", "ISD", "RTLI", "SUPA",
        "TRA", "UPATH", "SPATH", "SP", "STOPRE", "STARTFIFO", "STOPFIFO", "FIFO", "SBLOF", "SBLON", "DISP", "SAVE", "WALIM",
        "MCALL", "G64", "ADIS", "PTP", "CP", "LF", "TOFF", "TOW", "WAIT", "TCOF", "CYCLE832", "ACC", "LIMS", "OFFN", "ECOF",
        "PUNCH", "RND", "CHF", "CHR", "FRC", "BAUTO", "EAUTO", "BNAT", "ENAT", "BTAN", "ETAN", "MSG", "SUPD", "DISCL", "CLR",
        "DELDTG", "ROTA", "HOLD", "LEAD", "TILT", "SETMS", "PAROT", "DIST",
    ];
    frame(name)
        || other_transformation(name)
        || interpolation(name)
        || jumps(name)
        || declares(name)
        || FAMILIES.iter().any(|family| name.starts_with(family))
}
