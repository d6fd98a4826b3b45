//! Units as foreign tables spell them.

use crate::units::{Quantity, UNITS, Unit};

/// A unit of a table, and the unit of recordings that its numbers become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spelled {
    /// Unit of the recording.
    pub unit: Unit,
    /// A number of the table times this, over `over`, is one in `unit`.
    pub times: f64,
    pub over: f64,
}

/// Seconds, which dates and times of day are in.
pub(super) const SECONDS: Spelled = Spelled { unit: UNITS[0], times: 1.0, over: 1.0 };
/// A pure number.
pub(super) const PURE: Spelled = Spelled { unit: UNITS[UNITS.len() - 1], times: 1.0, over: 1.0 };

impl Spelled {
    /// Whether numbers stay as they are.
    pub fn is_native(self) -> bool {
        self.times == 1.0 && self.over == 1.0
    }

    pub fn quantity(self) -> Quantity {
        self.unit.quantity
    }
}

/// Spellings that mean a unit as it is, then those that need a factor. Letters count: `mA` is no `MA`. Words of four letters and more are
/// compared without case.
const SAME: [(&str, &[&str]); 19] = [
    ("s", &["s", "sec", "secs", "second", "seconds", "sek"]),
    ("ms", &["ms", "msec", "millisecond", "milliseconds"]),
    ("m", &["m", "meter", "meters", "metre", "metres"]),
    ("mm", &["mm", "millimeter", "millimeters", "millimetre", "millimetres"]),
    (
        "um",
        &[
            "um",
            "\u{b5}m",
            "\u{3bc}m",
            "micron",
            "microns",
            "micrometer",
            "micrometers",
            "micrometre",
            "micrometres",
        ],
    ),
    ("nm", &["nm", "nanometer", "nanometers", "nanometre", "nanometres"]),
    ("in", &["in", "inch", "inches"]),
    ("rad", &["rad", "rads", "radian", "radians"]),
    ("mrad", &["mrad", "milliradian", "milliradians"]),
    ("urad", &["urad", "\u{b5}rad", "\u{3bc}rad", "microradian", "microradians"]),
    ("deg", &["deg", "degs", "degree", "degrees", "\u{b0}"]),
    ("arcsec", &["arcsec", "arcsecs", "arcsecond", "arcseconds"]),
    ("degC", &["degC", "\u{b0}C", "\u{2103}", "celsius"]),
    ("K", &["K", "kelvin"]),
    ("N", &["N", "newton"]),
    ("Nm", &["Nm", "N.m", "N*m", "N\u{b7}m"]),
    ("A", &["A", "amp", "amps", "ampere"]),
    ("V", &["V", "volt", "volts"]),
    ("1", &["1"]),
];

const SCALED: [(&str, f64, f64, &[&str]); 12] = [
    ("s", 1.0, 1e6, &["us", "\u{b5}s", "\u{3bc}s", "usec", "microsecond", "microseconds"]),
    ("s", 1.0, 1e7, &["100ns"]),
    ("s", 1.0, 1e9, &["ns", "nsec", "nanosecond", "nanoseconds"]),
    ("s", 60.0, 1.0, &["min", "minute", "minutes"]),
    ("mm", 10.0, 1.0, &["cm", "centimeter", "centimeters", "centimetre", "centimetres"]),
    ("arcsec", 60.0, 1.0, &["arcmin", "arcmins", "arcminute", "arcminutes"]),
    ("deg", 360.0, 1.0, &["revs", "turn", "turns", "revolution", "revolutions"]),
    ("deg", 9.0, 10.0, &["gon"]),
    ("A", 1.0, 1e3, &["mA"]),
    ("V", 1.0, 1e3, &["mV"]),
    ("N", 1e3, 1.0, &["kN"]),
    ("1", 1.0, 100.0, &["percent"]),
];

/// The unit that a text spells, if there is one.
pub(super) fn spelled(text: &str) -> Option<Spelled> {
    let text = text.trim().trim_end_matches('.');
    let is =
        |known: &&str| *known == text || (known.chars().count() >= 3 && known.eq_ignore_ascii_case(text));
    if let Some((symbol, _)) = SAME.iter().find(|(_, all)| all.iter().any(is)) {
        return Some(Spelled { unit: Unit::named(symbol)?, times: 1.0, over: 1.0 });
    }
    let (symbol, times, over, _) = SCALED.iter().find(|(.., all)| all.iter().any(is))?;
    Some(Spelled { unit: Unit::named(symbol)?, times: *times, over: *over })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_spellings_are_one_unit() {
        let symbol = |text| spelled(text).map(|s| (s.unit.symbol, s.times / s.over));
        for text in ["mm", "MM", "Millimeters", " mm "] {
            assert_eq!(symbol(text), if text == "MM" { None } else { Some(("mm", 1.0)) }, "{text}");
        }
        assert_eq!(symbol("µm"), Some(("um", 1.0)));
        assert_eq!(symbol("°"), Some(("deg", 1.0)));
        assert_eq!(symbol("DEG"), Some(("deg", 1.0)));
        assert_eq!(symbol("us"), Some(("s", 1e-6)));
        assert_eq!(symbol("cm"), Some(("mm", 10.0)));
        assert_eq!(symbol("MA"), None);
        assert_eq!(symbol("grad"), None);
        assert_eq!((SECONDS.unit.symbol, PURE.unit.symbol), ("s", "1"));
        // Every unit of recordings is understood as it is written there.
        for unit in crate::units::UNITS {
            assert_eq!(symbol(unit.symbol), Some((unit.symbol, 1.0)));
        }
    }
}
