//! Dimensions of features: products of powers of m, rad, s, K, N, A, V.

use std::fmt;

use crate::machine::JointKind;
use crate::units::Quantity;

/// Symbols in the order of the exponents.
const SYMBOLS: [&str; 7] = ["m", "rad", "s", "K", "N", "A", "V"];

/// Exponents of m, rad, s, K, N, A, V. An angle is not a pure number here: a feature of a rotary joint and the same one of a
/// linear joint differ in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Dimension([i8; 7]);

impl Dimension {
    /// A pure number.
    pub const ONE: Dimension = Dimension([0; 7]);
    /// Length, m.
    pub const LENGTH: Dimension = Dimension([1, 0, 0, 0, 0, 0, 0]);
    /// Angle, rad.
    pub const ANGLE: Dimension = Dimension([0, 1, 0, 0, 0, 0, 0]);
    /// Time, s.
    pub const TIME: Dimension = Dimension([0, 0, 1, 0, 0, 0, 0]);
    /// Force, N.
    pub const FORCE: Dimension = Dimension([0, 0, 0, 0, 1, 0, 0]);

    /// Of a joint's displacement.
    pub fn of_joint(kind: JointKind) -> Self {
        match kind {
            JointKind::Prismatic => Self::LENGTH,
            JointKind::Revolute => Self::ANGLE,
        }
    }

    /// Of a column of a recording.
    pub fn of_quantity(quantity: Quantity) -> Self {
        match quantity {
            Quantity::Time => Self::TIME,
            Quantity::Length => Self::LENGTH,
            Quantity::Angle => Self::ANGLE,
            Quantity::Temperature => Dimension([0, 0, 0, 1, 0, 0, 0]),
            Quantity::Force => Self::FORCE,
            Quantity::Torque => Self::FORCE.times(Self::LENGTH),
            Quantity::Current => Dimension([0, 0, 0, 0, 0, 1, 0]),
            Quantity::Voltage => Dimension([0, 0, 0, 0, 0, 0, 1]),
            Quantity::One => Self::ONE,
        }
    }

    /// Reads `m`, `1`, `s^2`, `travel/s`, `rad/N/m`; `travel` stands for the unit of the joint's displacement, where there is one.
    pub fn parse(text: &str, travel: Option<Dimension>) -> Option<Self> {
        let mut all = Self::ONE;
        for (i, factor) in text.split('/').enumerate() {
            for factor in factor.split_whitespace() {
                let (symbol, power) = factor.split_once('^').unwrap_or((factor, "1"));
                let power: i8 = power.parse().ok().filter(|p| (-6..=6).contains(p))?;
                let base = match symbol {
                    "1" => Self::ONE,
                    "travel" => travel?,
                    _ => {
                        let k = SYMBOLS.iter().position(|s| *s == symbol)?;
                        let mut exponents = [0; 7];
                        exponents[k] = 1;
                        Dimension(exponents)
                    }
                };
                all = all.times(base.power(if i == 0 { power } else { -power }));
            }
        }
        Some(all)
    }

    /// Of a product.
    pub fn times(self, other: Self) -> Self {
        Dimension(std::array::from_fn(|k| self.0[k].saturating_add(other.0[k])))
    }

    /// Of a quotient.
    pub fn over(self, other: Self) -> Self {
        Dimension(std::array::from_fn(|k| self.0[k].saturating_sub(other.0[k])))
    }

    /// Of a power.
    pub fn power(self, exponent: i8) -> Self {
        Dimension(self.0.map(|e| e.saturating_mul(exponent)))
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let factor = |symbol: &str, e: i8| if e == 1 { symbol.to_string() } else { format!("{symbol}^{e}") };
        let part = |sign: i8| {
            let one = move |(e, symbol): (&i8, &&str)| (e.signum() == sign).then(|| factor(symbol, e.abs()));
            self.0.iter().zip(&SYMBOLS).filter_map(one).collect::<Vec<_>>()
        };
        let above = part(1).join(" ");
        f.write_str(if above.is_empty() { "1" } else { &above })?;
        part(-1).iter().try_for_each(|below| write!(f, "/{below}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dimensions_are_written_as_they_are_read() {
        for text in ["1", "m", "rad", "s^2", "m/s", "m/s^2", "rad/m/N", "1/s", "m/rad"] {
            assert_eq!(Dimension::parse(text, None).map(|d| d.to_string()).as_deref(), Some(text));
        }
        let travel = Some(Dimension::ANGLE);
        assert_eq!(Dimension::parse("travel/s", travel).map(|d| d.to_string()).as_deref(), Some("rad/s"));
        assert_eq!(Dimension::parse("travel", None), None);
        assert_eq!(Dimension::parse("furlong", None), None);
    }
}
