//! Numbers as texts, in the units of those who read them.

use crate::machine::JointKind;

/// A unit of a foreign file and how many of it make 1 m or 1 rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct In {
    pub symbol: &'static str,
    pub per_si: f64,
}

pub(super) const UM: In = In { symbol: "um", per_si: 1e6 };
pub(super) const URAD: In = In { symbol: "urad", per_si: 1e6 };
pub(super) const MM: In = In { symbol: "mm", per_si: 1e3 };
pub(super) const DEG: In = In { symbol: "deg", per_si: 180.0 / std::f64::consts::PI };

impl In {
    /// Of a joint's position.
    pub fn position(kind: JointKind) -> In {
        if kind == JointKind::Revolute { DEG } else { MM }
    }

    /// Of a joint's error.
    pub fn error(kind: JointKind) -> In {
        if kind == JointKind::Revolute { URAD } else { UM }
    }
}

/// A number with six decimals; no minus before a zero.
pub(super) fn fixed(value: f64) -> String {
    let text = format!("{value:.6}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { "0.000000".into() } else { text }
}

/// A number with ten decimals, zeros at its end left out.
pub(super) fn fine(value: f64) -> String {
    let text = format!("{value:.10}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text.trim_start_matches(['-', '0']).is_empty() { "0".into() } else { text.to_string() }
}

/// Why a number is not entered that may be off by so much of its unit, one standard deviation.
pub(super) fn left_open(by: f64, unit: &str) -> String {
    // A component of a direction is off by an angle.
    let (by, unit) = if unit == "1" { (by * URAD.per_si, URAD.symbol) } else { (by, unit) };
    // Of a standard deviation two digits say enough.
    let decimals = (1.0 - by.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("the recordings leave it open: it may be off by {by:.decimals$} {unit} (one standard deviation)")
}

/// As short as it reads back.
pub(super) fn exact(x: f64) -> String {
    let text = format!("{:?}", if x == 0.0 { 0.0 } else { x });
    text.strip_suffix(".0").map_or(text.clone(), str::to_string)
}

/// A text where a line must stay one.
pub(super) fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The name of a machine in a foreign file.
pub(super) fn heading(machine: &str, form: &str) -> String {
    format!("{form} of machine {}, written by kincal {}", one_line(machine), env!("CARGO_PKG_VERSION"))
}
