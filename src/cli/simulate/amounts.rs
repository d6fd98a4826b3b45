//! Numbers with their units as the command line takes them: `100mm`, `1000mm/min`, `uniform:10um`, `0,0,50mm`.

use crate::lie::Vec3;
use crate::simulate::Scatter;
use crate::units::{Quantity, Unit, amount};

pub(crate) fn length(text: &str) -> Result<f64, String> {
    amount(text, Quantity::Length)
}

pub(crate) fn angle(text: &str) -> Result<f64, String> {
    amount(text, Quantity::Angle)
}

pub(crate) fn time(text: &str) -> Result<f64, String> {
    let value = amount(text, Quantity::Time)?;
    if value >= 0.0 { Ok(value) } else { Err(format!("`{text}` is below zero")) }
}

pub(crate) fn positive_length(text: &str) -> Result<f64, String> {
    above_zero(text, length(text)?)
}

pub(crate) fn positive_angle(text: &str) -> Result<f64, String> {
    above_zero(text, angle(text)?)
}

fn above_zero(text: &str, value: f64) -> Result<f64, String> {
    if value > 0.0 { Ok(value) } else { Err(format!("`{text}` is not above zero")) }
}

/// A part of one, 0 to 1.
pub(crate) fn part(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("write a part of one, between 0 and 1".into()),
    }
}

/// A plain number above zero.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1e9 => Ok(value),
        _ => Err("write a number above zero, 1e9 at most".into()),
    }
}

/// Zero or more.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if (0.0..=1e9).contains(&value) => Ok(value),
        _ => Err("write a number, zero or more".into()),
    }
}

/// Three amounts; a part without unit takes that of the last, `0, 0, 50mm`.
fn triple(text: &str, quantity: Quantity) -> Result<Vec3<f64>, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let [x, y, z] = parts[..] else {
        return Err(format!("`{text}` has {} numbers, expected 3: x,y,z", parts.len()));
    };
    let unit = z.trim_start_matches(|c: char| c.is_ascii_digit() || "+-. ".contains(c));
    let with_unit = |part: &str| match part.parse::<f64>() {
        Ok(_) => amount(&format!("{part}{unit}"), quantity),
        Err(_) => amount(part, quantity),
    };
    Ok(Vec3([with_unit(x)?, with_unit(y)?, with_unit(z)?]))
}

pub(crate) fn point(text: &str) -> Result<Vec3<f64>, String> {
    triple(text, Quantity::Length)
}

pub(crate) fn turn(text: &str) -> Result<Vec3<f64>, String> {
    triple(text, Quantity::Angle)
}

/// A direction, made a unit vector.
pub(crate) fn direction(text: &str) -> Result<Vec3<f64>, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>().map_err(|_| format!("`{part}` is no number")))
        .collect::<Result<_, _>>()?;
    let [x, y, z] = numbers[..] else {
        return Err(format!("`{text}` has {} numbers, expected 3: x,y,z", numbers.len()));
    };
    let vector = Vec3([x, y, z]);
    let length = vector.norm();
    if !(length.is_finite() && length > 1e-9) {
        return Err("a direction must have a length".into());
    }
    Ok(vector.times(length.recip()))
}

/// A length or an angle over a power of time, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rate {
    pub quantity: Quantity,
    pub si: f64,
}

fn rate(text: &str, times: &[(&str, f64)], example: &str) -> Result<Rate, String> {
    let wrong = || format!("write a length or an angle over a time, {example}");
    let (above, below) = text.split_once('/').ok_or_else(wrong)?;
    let (_, seconds) = times.iter().find(|(word, _)| *word == below.trim()).ok_or_else(wrong)?;
    let quantity = match Unit::named(
        above.trim_start_matches(|c: char| c.is_ascii_digit() || "+-. ".contains(c)).trim(),
    ) {
        Some(unit) => unit.quantity,
        None => return Err(wrong()),
    };
    if !matches!(quantity, Quantity::Length | Quantity::Angle) {
        return Err(wrong());
    }
    let si = above_zero(text, amount(above, quantity)? / seconds)?;
    Ok(Rate { quantity, si })
}

pub(crate) fn feed(text: &str) -> Result<Rate, String> {
    rate(text, &[("s", 1.0), ("min", 60.0)], "1000mm/min or 20deg/s")
}

pub(crate) fn acceleration(text: &str) -> Result<Rate, String> {
    rate(text, &[("s^2", 1.0), ("s2", 1.0)], "0.5m/s^2 or 100deg/s^2")
}

pub(crate) fn jerk(text: &str) -> Result<Rate, String> {
    rate(text, &[("s^3", 1.0), ("s3", 1.0)], "20m/s^3 or 1000deg/s^3")
}

/// `1um`, `normal:1um`, `uniform:10um`, `symmetric:3um`.
fn noise(text: &str, quantity: Quantity) -> Result<(Scatter, f64), String> {
    let (scatter, size) = match text.split_once(':') {
        None => (Scatter::Normal, text),
        Some(("normal", size)) => (Scatter::Normal, size),
        Some(("uniform", size)) => (Scatter::Uniform, size),
        Some(("symmetric", size)) => (Scatter::Symmetric, size),
        Some((word, _)) => {
            return Err(format!(
                "`{word}` is not known; write normal, uniform or symmetric before the colon"
            ));
        }
    };
    let value = amount(size, quantity)?;
    if value >= 0.0 { Ok((scatter, value)) } else { Err(format!("`{size}` is below zero")) }
}

pub(crate) fn length_noise(text: &str) -> Result<(Scatter, f64), String> {
    noise(text, Quantity::Length)
}

pub(crate) fn angle_noise(text: &str) -> Result<(Scatter, f64), String> {
    noise(text, Quantity::Angle)
}

/// `c=30deg`, `x=100mm`: a joint and where it stands; the unit says whether a length or an angle is meant.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Held {
    pub joint: String,
    pub amount: String,
}

pub(crate) fn held(text: &str) -> Result<Held, String> {
    let (joint, amount) = text.split_once('=').ok_or("write JOINT=AMOUNT, c=30deg")?;
    Ok(Held { joint: joint.trim().into(), amount: amount.trim().into() })
}

/// `mm,deg`: a unit of length and one of angle.
pub(crate) fn units(text: &str) -> Result<crate::machine::FileUnits, String> {
    let find = |symbol: &str, quantity| {
        let unit = Unit::named(symbol.trim()).filter(|unit| unit.quantity == quantity);
        unit.ok_or_else(|| {
            format!(
                "`{}` is no unit of {quantity}; write one of: {}",
                symbol.trim(),
                Unit::symbols_of(quantity)
            )
        })
    };
    let (length, angle) = text.split_once(',').ok_or("write a unit of length and one of angle: mm,deg")?;
    Ok(crate::machine::FileUnits {
        length: find(length, Quantity::Length)?,
        angle: find(angle, Quantity::Angle)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_read_with_their_units() {
        assert_eq!(point("0, -20,50mm"), Ok(Vec3([0.0, -0.02, 0.05])));
        assert_eq!(point("1m,2mm,3um"), Ok(Vec3([1.0, 0.002, 3e-6])));
        assert!(point("1,2,3").is_err() && point("1,2mm").is_err());
        assert_eq!(feed("1200mm/min"), Ok(Rate { quantity: Quantity::Length, si: 0.02 }));
        assert!(feed("1200mm").is_err() && feed("5K/s").is_err() && feed("-5mm/s").is_err());
        assert_eq!(length_noise("uniform:10um"), Ok((Scatter::Uniform, 1e-5)));
        assert!(length_noise("pink:1um").is_err() && length_noise("1deg").is_err());
        assert!(units("mm,deg").is_ok() && units("deg,mm").is_err());
    }
}
