//! One line `# key[unit]: value`, cut into its parts.

use super::RecordingFault as Fault;
use super::text::{self, Fail, LARGEST};
use crate::lie::Vec3;
use crate::units::{Quantity, Unit};

/// One line, cut into its parts; columns in characters from 1.
pub(super) struct Entry<'a> {
    pub line: u64,
    pub key: &'a str,
    pub key_column: usize,
    pub unit: Option<&'a str>,
    pub unit_column: usize,
    pub value: &'a str,
    pub value_column: usize,
}

impl<'a> Entry<'a> {
    /// `None` for a comment that is no `key: value`.
    pub fn cut(line: u64, text: &'a str) -> Option<Self> {
        let column = |part: &str| {
            let bytes = (part.as_ptr() as usize).saturating_sub(text.as_ptr() as usize).min(text.len());
            text.char_indices().take_while(|(i, _)| *i < bytes).count() + 1
        };
        let (left, value) = text.trim_start().strip_prefix('#')?.split_once(':')?;
        let (left, value) = (left.trim(), value.trim());
        let (key, unit) = match left.split_once('[') {
            Some((key, rest)) => (key.trim_end(), Some(rest.strip_suffix(']')?.trim())),
            None => (left, None),
        };
        let unit_column = unit.map_or(0, column);
        Some(Entry {
            line,
            key,
            key_column: column(key),
            unit,
            unit_column,
            value,
            value_column: column(value),
        })
    }

    pub fn at_key(&self, fault: Fault) -> Fail {
        Fail::at(self.line, self.key_column, fault)
    }

    pub fn at_value(&self, fault: Fault) -> Fail {
        Fail::at(self.line, self.value_column, fault)
    }

    pub fn what(&self) -> String {
        format!("header key `{}`", self.key)
    }

    /// The unit, which must be one of `fits`; the first is the one that messages take as example.
    pub fn unit(&self, fits: &[Quantity]) -> Result<Unit, Fail> {
        let one = (fits.len() == 1).then(|| fits[0]);
        let Some(symbol) = self.unit else {
            let unit = example_unit(fits[0]);
            let example = format!("`# {}[{unit}]: {}`", self.key, text::shown(self.value.as_bytes()));
            return Err(self.at_key(Fault::NoUnit { what: self.what(), example, expected: one }));
        };
        let place = |fault| Fail::at(self.line, self.unit_column, fault);
        let Some(unit) = Unit::named(symbol) else {
            let unit = text::shown(symbol.as_bytes());
            return Err(place(Fault::UnknownUnit { what: self.what(), unit, expected: one }));
        };
        if fits.contains(&unit.quantity) {
            return Ok(unit);
        }
        let known = fits.iter().map(|q| Unit::symbols_of(*q)).collect::<Vec<_>>().join(" ");
        let (unit, found) = (symbol.to_string(), unit.quantity);
        Err(place(Fault::WrongUnit { what: self.what(), unit, found, known }))
    }

    pub fn no_unit(&self) -> Result<(), Fail> {
        match self.unit {
            None => Ok(()),
            Some(unit) => {
                let (key, unit) = (self.key.to_string(), text::shown(unit.as_bytes()));
                Err(Fail::at(self.line, self.unit_column, Fault::UnitNotWanted { key, unit }))
            }
        }
    }

    pub fn number(&self, part: &str, unit: Option<Unit>) -> Result<f64, Fail> {
        let shown = text::shown(part.as_bytes());
        let value = part.trim().parse::<f64>().ok().filter(|v| !v.is_nan());
        let Some(value) = value else {
            return Err(self.at_value(Fault::NotANumber { what: self.what(), text: shown }));
        };
        let value = unit.map_or(value, |u| u.to_si(value));
        if value.abs() > LARGEST {
            return Err(self.at_value(Fault::NotUsable { what: self.what(), text: shown }));
        }
        Ok(value)
    }

    pub fn positive(&self, unit: Unit) -> Result<f64, Fail> {
        let value = self.number(self.value, Some(unit))?;
        if value > 0.0 {
            return Ok(value);
        }
        let text = format!("{} {unit}", self.value);
        Err(self.at_value(Fault::NotPositive { what: self.what(), text }))
    }

    pub fn vector(&self, unit: Option<Unit>) -> Result<Vec3<f64>, Fail> {
        let found = self.value.split(',').count();
        if found != 3 {
            return Err(self.at_value(Fault::NotThree { key: self.key.to_string(), found }));
        }
        let mut vector = [0.0; 3];
        for (component, part) in vector.iter_mut().zip(self.value.split(',')) {
            *component = self.number(part, unit)?;
        }
        Ok(Vec3(vector))
    }

    pub fn unit_vector(&self) -> Result<Vec3<f64>, Fail> {
        let vector = self.vector(None)?;
        let length = vector.norm();
        if length < 1e-9 {
            return Err(self.at_value(Fault::ZeroVector { what: self.what() }));
        }
        Ok(if (length - 1.0).abs() < 1e-15 { vector } else { vector.times(length.recip()) })
    }

    pub fn unknown(&self) -> Result<bool, Fail> {
        self.no_unit()?;
        match self.value {
            "unknown" => Ok(true),
            "known" => Ok(false),
            _ => Err(self.bad_word("`unknown`, or leave the line out")),
        }
    }

    pub fn bad_word(&self, expected: &str) -> Fail {
        let (key, found) = (self.key.to_string(), text::shown(self.value.as_bytes()));
        self.at_value(Fault::BadWord { key, found, expected: expected.into() })
    }
}

/// The unit that examples in messages bear.
pub(super) fn example_unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "s",
        Quantity::Length => "mm",
        Quantity::Angle => "deg",
        Quantity::Temperature => "degC",
        Quantity::Force => "N",
        Quantity::Torque => "Nm",
        Quantity::Current => "A",
        Quantity::Voltage => "V",
        Quantity::One => "1",
    }
}
