//! Numbers in the units that people use.

use crate::feature::Dimension;

/// A number in SI as a machinist would say it, with its standard uncertainty: `12.4 ± 0.1 arcsec`, `-35.0 ± 0.8 um`, `8.3 min`.
///
/// `shown` forces a unit: `ppm`, `%`, `per turn`.
pub fn in_words(value: f64, std_error: Option<f64>, dimension: Dimension, shown: Option<&str>) -> String {
    let (factor, unit) = scale(value, dimension, shown);
    let (value, error) =
        (value * factor, std_error.map(|e| (e * factor).abs()).filter(|e| e.is_finite() && *e > 0.0));
    let decimals = |x: f64, digits: i32| {
        let first = if x == 0.0 || !x.is_finite() { 0 } else { x.abs().log10().floor() as i32 };
        (digits - 1 - first).clamp(0, 9) as usize
    };
    let number = match error {
        Some(error) => {
            // One digit of the uncertainty, two where the first is a 1.
            let first = error / 10f64.powf(error.log10().floor());
            let places = decimals(error, if first < 1.95 { 2 } else { 1 });
            format!("{value:.places$} ± {error:.places$}")
        }
        // A whole number that is not measured but counted.
        None if std_error == Some(0.0) && value.fract() == 0.0 => format!("{value:.0}"),
        None => format!("{value:.*}", decimals(value, 3)),
    };
    match unit.as_str() {
        "" => number,
        unit => format!("{number} {unit}"),
    }
}

/// Factor from SI and name of the unit.
fn scale(value: f64, dimension: Dimension, shown: Option<&str>) -> (f64, String) {
    let arcsec = 3600.0f64.to_degrees();
    let own = |factor: f64, unit: &str| (factor, unit.to_string());
    match shown {
        Some("ppm") => return own(1e6, "ppm"),
        Some("%") => return own(100.0, "%"),
        Some("mm") => return own(1e3, "mm"),
        Some("deg") => return own(1f64.to_degrees(), "deg"),
        Some("per turn") => return own(1.0, "per turn"),
        Some(unit) => return own(1.0, unit),
        None => {}
    }
    match dimension.to_string().as_str() {
        "m" if value.abs() < 1e-3 => own(1e6, "um"),
        "m" if value.abs() < 1.0 => own(1e3, "mm"),
        "rad" if value.abs() < 2e-3 => own(arcsec, "arcsec"),
        "rad" => own(1f64.to_degrees(), "deg"),
        "s" if value.abs() < 1.0 => own(1e3, "ms"),
        "s" if value.abs() > 120.0 => own(1.0 / 60.0, "min"),
        "1/s" => own(1.0, "Hz"),
        "m/s" => own(3.6e9, "um/h"),
        "rad/s" => own(3600.0 * arcsec, "arcsec/h"),
        "m/K" => own(1e6, "um/K"),
        "rad/K" => own(arcsec, "arcsec/K"),
        "1/K" | "m/m/K" => own(1e6, "ppm/K"),
        "rad/m" => own(arcsec, "arcsec/m"),
        "m/rad" => own(1e6f64.to_radians(), "um/deg"),
        "1" => own(1.0, ""),
        other => (1.0, other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_in_the_units_that_people_use() {
        let said = |value, error, unit: &str, shown| {
            in_words(value, error, Dimension::parse(unit, None).expect("a unit"), shown)
        };
        assert_eq!(said(6.012e-5, Some(4e-7), "rad", None), "12.40 ± 0.08 arcsec");
        assert_eq!(said(-3.5e-5, Some(1.2e-6), "m", None), "-35.0 ± 1.2 um");
        assert_eq!(said(0.0104, None, "m", None), "10.4 mm");
        assert_eq!(said(0.0125, Some(3e-4), "s", None), "12.5 ± 0.3 ms");
        assert_eq!(said(1159.0, None, "s", None), "19.3 min");
        assert_eq!(said(2.5e-5, Some(1e-6), "1", Some("ppm")), "25.0 ± 1.0 ppm");
        assert_eq!(said(72.0, None, "1", Some("per turn")), "72.0 per turn");
    }
}
