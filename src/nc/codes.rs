//! Names and codes of the dialects that change what follows them in a block or in the program.

use super::dialect::Dialect;

/// Functions of RS-274 that may stand directly behind an address: `XSIN[30]`.
pub(super) const FUNCTIONS: &[&str] = &[
    "ABS", "ACOS", "ASIN", "ATAN", "COS", "EXISTS", "EXP", "FIX", "FUP", "LN", "ROUND", "SIN", "SQRT", "TAN",
    "BIN", "BCD",
];

/// Operators of Siemens expressions that are words.
pub(super) const OPERATORS: &[&str] =
    &["DIV", "MOD", "AND", "OR", "XOR", "B_AND", "B_OR", "B_XOR", "NOT", "B_NOT"];

/// A name behind which the rest of the block is no motion: declarations, conditions, jumps, calls by name.
pub(super) fn takes_the_rest(name: &str, dialect: Dialect) -> bool {
    let name = name.trim_end_matches(|c: char| c.is_ascii_digit());
    match dialect {
        Dialect::Heidenhain => [
            "BEGIN", "END", "BLK", "TOOL", "CYCL", "LBL", "CALL", "FN", "FUNCTION", "PLANE", "TCH", "TRANS",
            "DECLARE", "PATTERN", "SEL",
        ]
        .contains(&name),
        _ => jumps(name) || by_name(name) || declares(name),
    }
}

/// Names after which the program need not go on with the next line.
pub(super) fn jumps(name: &str) -> bool {
    let name = name.trim_end_matches(|c: char| c.is_ascii_digit());
    [
        "IF",
        "ELSE",
        "ELSEIF",
        "ENDIF",
        "WHILE",
        "ENDWHILE",
        "DO",
        "END",
        "FOR",
        "ENDFOR",
        "LOOP",
        "ENDLOOP",
        "REPEAT",
        "REPEATB",
        "ENDREPEAT",
        "UNTIL",
        "GOTO",
        "GOTOF",
        "GOTOB",
        "GOTOC",
        "GOTOS",
        "CASE",
        "BREAK",
        "CONTINUE",
        "RETURN",
        "RET",
        "SUB",
        "ENDSUB",
    ]
    .contains(&name)
}

/// Names that call a program.
pub(super) fn by_name(name: &str) -> bool {
    ["CALL", "PCALL", "EXTCALL", "ISOCALL"].contains(&name)
}

/// Names of declarations and of actions that run beside the program.
fn declares(name: &str) -> bool {
    ["DEF", "REDEF", "DEFINE", "PROC", "EXTERN", "WHEN", "WHENEVER", "EVERY", "FROM", "SETINT", "MCALL"]
        .contains(&name)
}

/// Names of frames: numbers in their block are no targets, and coordinates mean something else behind them.
pub(super) fn frame(name: &str) -> bool {
    [
        "TRANS", "ATRANS", "ROT", "AROT", "ROTS", "AROTS", "CROTS", "SCALE", "ASCALE", "MIRROR", "AMIRROR",
        "TOFRAME", "TOFRAMEX", "TOFRAMEY", "TOFRAMEZ", "TOROT", "TOROTX", "TOROTY", "TOROTZ", "TOROTOF",
        "PAROT", "PAROTOF", "TCARR", "TCOABS", "TCOFR", "TCOFRX", "TCOFRY", "TCOFRZ",
    ]
    .contains(&name)
}

/// Names of kinematic transformations other than the five-axis one.
pub(super) fn other_transformation(name: &str) -> bool {
    ["TRANSMIT", "TRACYL", "TRAANG", "TRACON"].contains(&name)
}

/// Names of interpolations of Siemens' first group.
pub(super) fn interpolation(name: &str) -> bool {
    ["CIP", "CT", "ASPLINE", "BSPLINE", "CSPLINE", "POLY", "INVCW", "INVCCW"].contains(&name)
}

/// Names that say what a block is, whatever the dialect's own list has.
pub(super) fn structures(name: &str) -> bool {
    frame(name)
        || other_transformation(name)
        || interpolation(name)
        || jumps(name)
        || by_name(name)
        || declares(name)
}
