//! Values of a column as the fields that they would be in a table of text.

use std::fmt::Write;

use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::*;
use arrow_schema::{DataType, TimeUnit};

/// Appends the value of a row, which is not null.
type Values<'a> = Box<dyn Fn(usize, &mut String) + 'a>;

/// The fields of one array.
pub(super) struct Fields<'a> {
    array: &'a dyn Array,
    values: Values<'a>,
}

impl<'a> Fields<'a> {
    /// `None` for a type that no table of text has.
    pub fn of(array: &'a dyn Array) -> Option<Fields<'a>> {
        Some(Fields { array, values: values(array)? })
    }

    /// Appends the field of a row; nothing where there is none.
    pub fn push(&self, row: usize, out: &mut String) {
        if self.array.is_valid(row) {
            (self.values)(row, out);
        }
    }
}

/// Whether columns of this type can be read.
pub(super) fn is_read(kind: &DataType) -> bool {
    use DataType::*;
    match kind {
        Dictionary(_, values) => is_read(values) && !matches!(**values, Dictionary(..)),
        _ => {
            kind.is_integer()
                || kind.is_floating()
                || kind.is_decimal()
                || matches!(kind, Null | Boolean | Utf8 | LargeUtf8 | Utf8View)
                || matches!(kind, Timestamp(..) | Time32(_) | Time64(_) | Duration(_))
        }
    }
}

fn values(array: &dyn Array) -> Option<Values<'_>> {
    /// Numbers with the shortest digits that are this number of their type.
    macro_rules! numbers {
        ($kind:ty) => {{
            let array = array.as_primitive_opt::<$kind>()?;
            Box::new(move |row, out: &mut String| {
                let _ = write!(out, "{:?}", array.value(row));
            })
        }};
    }
    macro_rules! decimals {
        ($kind:ty) => {{
            let array = array.as_primitive_opt::<$kind>()?;
            Box::new(move |row, out: &mut String| out.push_str(&array.value_as_string(row)))
        }};
    }
    macro_rules! counts {
        ($kind:ty, $push:expr) => {{
            let array = array.as_primitive_opt::<$kind>()?;
            Box::new(move |row, out: &mut String| $push(i64::from(array.value(row)), out))
        }};
    }
    macro_rules! words {
        ($array:expr) => {{
            let array = $array?;
            Box::new(move |row, out: &mut String| out.push_str(array.value(row)))
        }};
    }
    let moment = |digits: u32| move |count: i64, out: &mut String| push_moment(count, digits, out);
    let clock = |digits: u32| move |count: i64, out: &mut String| push_clock(count, digits, out);
    let plain = |count: i64, out: &mut String| {
        let _ = write!(out, "{count}");
    };
    use TimeUnit::*;
    Some(match array.data_type() {
        DataType::Null => Box::new(|_, _| {}),
        DataType::Boolean => {
            let array = array.as_boolean_opt()?;
            Box::new(move |row, out| out.push_str(if array.value(row) { "true" } else { "false" }))
        }
        DataType::Int8 => numbers!(Int8Type),
        DataType::Int16 => numbers!(Int16Type),
        DataType::Int32 => numbers!(Int32Type),
        DataType::Int64 => numbers!(Int64Type),
        DataType::UInt8 => numbers!(UInt8Type),
        DataType::UInt16 => numbers!(UInt16Type),
        DataType::UInt32 => numbers!(UInt32Type),
        DataType::UInt64 => numbers!(UInt64Type),
        DataType::Float16 => {
            let array = array.as_primitive_opt::<Float16Type>()?;
            Box::new(move |row, out| {
                let _ = write!(out, "{:?}", f32::from(array.value(row)));
            })
        }
        DataType::Float32 => numbers!(Float32Type),
        DataType::Float64 => numbers!(Float64Type),
        DataType::Decimal32(..) => decimals!(Decimal32Type),
        DataType::Decimal64(..) => decimals!(Decimal64Type),
        DataType::Decimal128(..) => decimals!(Decimal128Type),
        DataType::Decimal256(..) => decimals!(Decimal256Type),
        DataType::Utf8 => words!(array.as_string_opt::<i32>()),
        DataType::LargeUtf8 => words!(array.as_string_opt::<i64>()),
        DataType::Utf8View => words!(array.as_string_view_opt()),
        DataType::Timestamp(Second, _) => counts!(TimestampSecondType, moment(0)),
        DataType::Timestamp(Millisecond, _) => counts!(TimestampMillisecondType, moment(3)),
        DataType::Timestamp(Microsecond, _) => counts!(TimestampMicrosecondType, moment(6)),
        DataType::Timestamp(Nanosecond, _) => counts!(TimestampNanosecondType, moment(9)),
        DataType::Time32(Second) => counts!(Time32SecondType, clock(0)),
        DataType::Time32(_) => counts!(Time32MillisecondType, clock(3)),
        DataType::Time64(Nanosecond) => counts!(Time64NanosecondType, clock(9)),
        DataType::Time64(_) => counts!(Time64MicrosecondType, clock(6)),
        DataType::Duration(Second) => counts!(DurationSecondType, plain),
        DataType::Duration(Millisecond) => counts!(DurationMillisecondType, plain),
        DataType::Duration(Microsecond) => counts!(DurationMicrosecondType, plain),
        DataType::Duration(Nanosecond) => counts!(DurationNanosecondType, plain),
        DataType::Dictionary(..) => {
            let array = array.as_any_dictionary_opt()?;
            let fields = Fields::of(&**array.values())?;
            let keys = array.normalized_keys();
            Box::new(move |row, out| {
                if let Some(key) = keys.get(row).filter(|key| **key < fields.array.len()) {
                    fields.push(*key, out);
                }
            })
        }
        _ => return None,
    })
}

/// What a column of durations counts.
pub(super) fn unit(kind: &DataType) -> Option<&'static str> {
    match kind {
        DataType::Duration(TimeUnit::Second) => Some("s"),
        DataType::Duration(TimeUnit::Millisecond) => Some("ms"),
        DataType::Duration(TimeUnit::Microsecond) => Some("us"),
        DataType::Duration(TimeUnit::Nanosecond) => Some("ns"),
        _ => None,
    }
}

const DAY: i64 = 86_400;

/// `2024-03-05T12:30:01.250` of so many 10^-`digits` s since 1970.
fn push_moment(count: i64, digits: u32, out: &mut String) {
    let per = 10i64.pow(digits);
    let (days, clock) = (count.div_euclid(per).div_euclid(DAY), count.rem_euclid(per.saturating_mul(DAY)));
    // Days since the first of March of year 0, in eras of 400 years, so that a leap day is the last of its year.
    let since = days + 719_468;
    let (era, day) = (since.div_euclid(146_097), since.rem_euclid(146_097));
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (year, month) = if month < 10 { (year, month + 3) } else { (year + 1, month - 9) };
    let _ = write!(out, "{:04}-{month:02}-{day:02}T", 400 * era + year);
    push_clock(clock, digits, out);
}

/// `12:30:01.250` of so many 10^-`digits` s since midnight.
fn push_clock(count: i64, digits: u32, out: &mut String) {
    let per = 10i64.pow(digits);
    let seconds = count.div_euclid(per);
    let _ = write!(out, "{:02}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60);
    if digits > 0 {
        let _ = write!(out, ".{:0width$}", count.rem_euclid(per), width = digits as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_dates() {
        let moment = |count, digits| {
            let mut out = String::new();
            push_moment(count, digits, &mut out);
            out
        };
        assert_eq!(moment(0, 0), "1970-01-01T00:00:00");
        assert_eq!(moment(-1, 3), "1969-12-31T23:59:59.999");
        assert_eq!(moment(951_825_600_250_000, 6), "2000-02-29T12:00:00.250000");
        assert_eq!(moment(1_709_644_368_666_655_501, 9), "2024-03-05T13:12:48.666655501");
        // Nothing that a file can hold overflows.
        for (count, digits) in [(i64::MIN, 0), (i64::MAX, 0), (i64::MIN, 9), (i64::MAX, 9)] {
            assert!(moment(count, digits).contains('T'));
        }
    }
}
