//! What lengths and angles have one of each: noise, residuals, steps.

use std::marker::PhantomData;
use std::ops::{Index, IndexMut};

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};

use super::Quantity;

/// One value for lengths, in m, and one for angles, in rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ByQuantity<T> {
    /// Of lengths, m.
    pub m: T,
    /// Of angles, rad.
    pub rad: T,
}

/// Root mean square of the residuals' Euclidean norm over samples; `None` where nothing of the kind was measured.
pub type Rms = ByQuantity<Option<f64>>;

impl<T> ByQuantity<T> {
    /// Both values of a function.
    pub fn of(mut value: impl FnMut(Quantity) -> T) -> Self {
        ByQuantity { m: value(Quantity::Length), rad: value(Quantity::Angle) }
    }

    /// A function of both values.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> ByQuantity<U> {
        ByQuantity { m: f(self.m), rad: f(self.rad) }
    }

    /// Both, each with its counterpart.
    pub fn zip<U>(self, other: ByQuantity<U>) -> ByQuantity<(T, U)> {
        ByQuantity { m: (self.m, other.m), rad: (self.rad, other.rad) }
    }
}

impl<T> ByQuantity<Option<T>> {
    /// Those that are there, lengths first.
    pub fn there(self) -> impl Iterator<Item = (Quantity, T)> {
        let pairs = [self.m.map(|m| (Quantity::Length, m)), self.rad.map(|rad| (Quantity::Angle, rad))];
        pairs.into_iter().flatten()
    }
}

/// Angles have the second, everything else the first.
impl<T> Index<Quantity> for ByQuantity<T> {
    type Output = T;

    fn index(&self, quantity: Quantity) -> &T {
        if quantity == Quantity::Angle { &self.rad } else { &self.m }
    }
}

impl<T> IndexMut<Quantity> for ByQuantity<T> {
    fn index_mut(&mut self, quantity: Quantity) -> &mut T {
        if quantity == Quantity::Angle { &mut self.rad } else { &mut self.m }
    }
}

/// Writes the values that are there under two names.
pub(crate) fn write<T: Serialize, S: Serializer>(
    both: &ByQuantity<Option<T>>,
    names: &'static [&'static str; 2],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(None)?;
    for (name, value) in names.iter().zip([&both.m, &both.rad]) {
        if let Some(value) = value {
            map.serialize_entry(name, value)?;
        }
    }
    map.end()
}

/// Reads the values of two names; what is not there, or null, is `None`.
pub(crate) fn read<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
    names: &'static [&'static str; 2],
    deserializer: D,
) -> Result<ByQuantity<Option<T>>, D::Error> {
    struct Both<T>(&'static [&'static str; 2], PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Both<T> {
        type Value = ByQuantity<Option<T>>;

        fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
            write!(f, "`{}` and `{}`", self.0[0], self.0[1])
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut both = ByQuantity { m: None, rad: None };
            while let Some(key) = map.next_key::<String>()? {
                match self.0.iter().position(|name| *name == key) {
                    Some(0) => both.m = map.next_value()?,
                    Some(_) => both.rad = map.next_value()?,
                    None => {
                        map.next_value::<IgnoredAny>()?;
                    }
                }
            }
            Ok(both)
        }
    }

    deserializer.deserialize_struct("", names, Both(names, PhantomData))
}

impl<T: Serialize> Serialize for ByQuantity<Option<T>> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        write(self, &["m", "rad"], serializer)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for ByQuantity<Option<T>> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        read(&["m", "rad"], deserializer)
    }
}

/// `field_by_quantity!(rms)`: a module for `#[serde(flatten, with = "rms")]` that writes a field as two, `rms_m` and `rms_rad`.
macro_rules! field_by_quantity {
    ($($name:ident),+) => {$(
        mod $name {
            use crate::units::{ByQuantity, by_quantity};
            use serde::{Deserialize, Deserializer, Serialize, Serializer};

            const NAMES: [&str; 2] = [concat!(stringify!($name), "_m"), concat!(stringify!($name), "_rad")];

            pub(super) fn serialize<T: Serialize, S: Serializer>(
                both: &ByQuantity<Option<T>>,
                serializer: S,
            ) -> Result<S::Ok, S::Error> {
                by_quantity::write(both, &NAMES, serializer)
            }

            pub(super) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
                deserializer: D,
            ) -> Result<ByQuantity<Option<T>>, D::Error> {
                by_quantity::read(&NAMES, deserializer)
            }
        }
    )+};
}
pub(crate) use field_by_quantity;

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    use super::{ByQuantity, Rms};

    field_by_quantity!(rms, mean);

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Figures {
        samples: u64,
        #[serde(flatten, with = "rms")]
        rms: Rms,
        #[serde(flatten, with = "mean")]
        mean: ByQuantity<Option<f64>>,
    }

    #[test]
    fn a_field_is_written_as_two_and_read_again() {
        let rms = ByQuantity { m: Some(1e-6), rad: Some(2e-6) };
        let figures = Figures { samples: 3, rms, mean: ByQuantity { m: None, rad: Some(0.5) } };
        let text = serde_json::to_string(&figures).expect("writes");
        assert_eq!(text, r#"{"samples":3,"rms_m":1e-6,"rms_rad":2e-6,"mean_rad":0.5}"#);
        assert_eq!(serde_json::from_str::<Figures>(&text).expect("reads"), figures);
        let empty: Figures = serde_json::from_str(r#"{"samples":0,"rms_m":null}"#).expect("reads");
        assert_eq!(empty, Figures { samples: 0, rms: Rms::default(), mean: Rms::default() });
        assert_eq!(serde_json::to_string(&rms).expect("writes"), r#"{"m":1e-6,"rad":2e-6}"#);
    }
}
