//! Units of the borders. Inside, everything is m, rad, s; here is the one place that converts.

pub(crate) mod by_quantity;
mod unbounded;

pub(crate) use by_quantity::field_by_quantity;
pub use by_quantity::{ByQuantity, Rms};
pub(crate) use unbounded::unbounded;

use std::fmt;

/// What a unit measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Quantity {
    /// Time, s inside.
    Time,
    /// Length, m inside.
    Length,
    /// Angle, rad inside.
    Angle,
    /// Temperature, K inside.
    Temperature,
    /// Force, N inside.
    Force,
    /// Torque, Nm inside.
    Torque,
    /// Electric current, A inside.
    Current,
    /// Electric voltage, V inside.
    Voltage,
    /// A pure number.
    One,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Quantity::Time => "time",
            Quantity::Length => "length",
            Quantity::Angle => "angle",
            Quantity::Temperature => "temperature",
            Quantity::Force => "force",
            Quantity::Torque => "torque",
            Quantity::Current => "current",
            Quantity::Voltage => "voltage",
            Quantity::One => "pure number",
        })
    }
}

/// A unit as written in brackets in a recording or as `units:` in a machine file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// How it is written.
    pub symbol: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    factor: f64,
    divisor: f64,
    zero: f64,
}

const RADIAN: f64 = std::f64::consts::PI / 180.0;

const fn unit(symbol: &'static str, quantity: Quantity, factor: f64, divisor: f64) -> Unit {
    Unit { symbol, quantity, factor, divisor, zero: 0.0 }
}

/// Every unit that a border understands, `contract` order.
pub const UNITS: [Unit; 19] = [
    unit("s", Quantity::Time, 1.0, 1.0),
    unit("ms", Quantity::Time, 1.0, 1e3),
    unit("m", Quantity::Length, 1.0, 1.0),
    unit("mm", Quantity::Length, 1.0, 1e3),
    unit("um", Quantity::Length, 1.0, 1e6),
    unit("nm", Quantity::Length, 1.0, 1e9),
    unit("in", Quantity::Length, 25.4, 1e3),
    unit("rad", Quantity::Angle, 1.0, 1.0),
    unit("mrad", Quantity::Angle, 1.0, 1e3),
    unit("urad", Quantity::Angle, 1.0, 1e6),
    unit("deg", Quantity::Angle, RADIAN, 1.0),
    unit("arcsec", Quantity::Angle, RADIAN, 3600.0),
    Unit { symbol: "degC", quantity: Quantity::Temperature, factor: 1.0, divisor: 1.0, zero: 273.15 },
    unit("K", Quantity::Temperature, 1.0, 1.0),
    unit("N", Quantity::Force, 1.0, 1.0),
    unit("Nm", Quantity::Torque, 1.0, 1.0),
    unit("A", Quantity::Current, 1.0, 1.0),
    unit("V", Quantity::Voltage, 1.0, 1.0),
    unit("1", Quantity::One, 1.0, 1.0),
];

impl Unit {
    /// The unit written `symbol`, if there is one.
    ///
    /// ```
    /// use kincal::units::Unit;
    /// let um = Unit::named("um").expect("a unit");
    /// assert_eq!(um.to_si(5.0), 5e-6);
    /// assert_eq!(um.from_si(5e-6), 5.0);
    /// assert!(Unit::named("furlong").is_none());
    /// ```
    pub fn named(symbol: &str) -> Option<Unit> {
        UNITS.into_iter().find(|u| u.symbol == symbol)
    }

    /// All units of one quantity, as they are written, for messages: `m mm um nm in`.
    pub fn symbols_of(quantity: Quantity) -> String {
        let symbols: Vec<_> = UNITS.iter().filter(|u| u.quantity == quantity).map(|u| u.symbol).collect();
        symbols.join(" ")
    }

    /// From this unit to m, rad, s, K. A division by a power of ten, so that `158.5` mm is the same number as `0.1585` m.
    #[inline]
    pub fn to_si(self, value: f64) -> f64 {
        value * self.factor / self.divisor + self.zero
    }

    /// From m, rad, s, K to this unit.
    #[inline]
    pub fn from_si(self, value: f64) -> f64 {
        (value - self.zero) * self.divisor / self.factor
    }

    /// The number in this unit that comes back as exactly `value` through [`Unit::to_si`], where there is one; else the nearest.
    pub fn write_si(self, value: f64) -> f64 {
        let near = self.from_si(value);
        let mut candidates = [near; 5];
        candidates[1] = near.next_up();
        candidates[2] = near.next_down();
        candidates[3] = near.next_up().next_up();
        candidates[4] = near.next_down().next_down();
        // Of the numbers that come back exactly, the one that is written shortest.
        let mut exact: Vec<f64> =
            candidates.into_iter().filter(|c| self.to_si(*c).to_bits() == value.to_bits()).collect();
        exact.sort_by_key(|c| c.to_string().len());
        exact.first().copied().unwrap_or(near)
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol)
    }
}

/// A number with its unit, as command lines and faults files write it: `100mm`, `-0.5 um`, `60urad`; in SI.
///
/// ```
/// use kincal::units::{Quantity, amount};
/// assert_eq!(amount("100mm", Quantity::Length), Ok(0.1));
/// assert_eq!(amount("100", Quantity::Length).unwrap_err(), "`100` has no unit; write one of: m mm um nm in");
/// ```
///
/// # Errors
/// What is wrong, with the units that fit.
pub fn amount(text: &str, quantity: Quantity) -> Result<f64, String> {
    let text = text.trim();
    let fits = || format!("write one of: {}", Unit::symbols_of(quantity));
    let (number, symbol) = cut_amount(text).ok_or_else(|| format!("`{text}` is no number with a unit"))?;
    if symbol.is_empty() {
        return Err(format!("`{text}` has no unit; {}", fits()));
    }
    let Some(unit) = Unit::named(symbol) else {
        return Err(format!("unit `{symbol}` is not known; {}", fits()));
    };
    if unit.quantity != quantity {
        return Err(format!("`{symbol}` is a unit of {}; {}", unit.quantity, fits()));
    }
    let value = unit.to_si(number);
    if value.is_finite() && value.abs() <= 1e9 {
        Ok(value)
    } else {
        Err(format!("`{text}` is not a usable number"))
    }
}

/// The number at the start of a text, and what follows it.
pub(crate) fn cut_amount(text: &str) -> Option<(f64, &str)> {
    // The longest start that is a number, so that the `e` of `1e3mm` belongs to it.
    let ends = text.char_indices().map(|(i, c)| i + c.len_utf8());
    let plain = |part: &str| part.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b));
    let number = |end: usize| text.get(..end).filter(|part| plain(part))?.parse::<f64>().ok();
    let (end, value) = ends.rev().find_map(|end| Some((end, number(end)?)))?;
    Some((value, text[end..].trim()))
}
