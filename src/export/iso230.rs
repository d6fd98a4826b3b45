//! Location errors as a table.

use std::fmt::Write;

use super::known::Known;
use super::numbers::{UM, URAD, exact, fixed, heading, left_open};
use super::varying::varying;
use super::{Exported, Number, refused};
use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::lie::Vec3;
use crate::location::location_errors;

pub(super) fn write(calibrated: &CalibratedMachine) -> Result<Exported> {
    let machine = calibrated.machine();
    let known = Known::new(calibrated);
    let found = location_errors(machine, calibrated.deviations(), Vec3([0.0; 3]), Some(&known));
    if let Some(reason) = &found.reason {
        return Err(refused(
            format!("machine \"{}\" has no location errors: {reason}", machine.name()),
            "export an arm by --to urdf, dh or mdh",
        ));
    }
    let joint = |name: &Option<String>| name.clone().unwrap_or_default();
    let mut told = vec![
        "offsets are counted along, tilts and squareness right-handed about the direction that is given, in machine coordinates with all axes at zero".to_string(),
        format!(
            "machine coordinates: X along {}, the plane X Y spanned by {} and {}; offsets are seen from the tip of the tool at home",
            joint(&found.primary),
            joint(&found.primary),
            joint(&found.secondary)
        ),
        "squareness is the turn of the axis, not 90 deg less the angle between axes".to_string(),
    ];
    told.extend(known.sentence());
    let mut numbers = Vec::new();
    let mut rows = String::from(
        "name,value,unit,axis,direction_x[1],direction_y[1],direction_z[1],determined,meaning\n",
    );
    for error in &found.errors {
        let offset = error.unit == "m";
        let unit = if offset { UM } else { URAD };
        let determined = known.determines(error);
        let value = determined.then_some(error.value * unit.per_si);
        let because = (!determined).then(|| left_open(error.std_error * unit.per_si, unit.symbol));
        let meaning = match (
            offset,
            error.name.contains("0C") || error.name.contains("0A") || error.name.contains("0B"),
        ) {
            (true, _) => "positive: the line of the axis lies further along the direction",
            (false, true) => "positive: the line of the axis is turned right-handed about the direction",
            (false, false) => "positive: the axis is turned right-handed about the direction",
        };
        let direction = error.direction.map(exact).join(",");
        let says = match (&because, known.is_stated()) {
            (Some(because), _) => format!("no,{because}"),
            (None, true) => format!("yes,{meaning}"),
            (None, false) => format!("not stated,{meaning}"),
        };
        let shown = value.map(fixed).unwrap_or_default();
        let _ = writeln!(rows, "{},{shown},{},{},{direction},{says}", error.name, unit.symbol, error.axis);
        numbers.push(Number {
            name: error.name.clone(),
            value,
            declared: 0.0,
            unit: unit.symbol.into(),
            because,
        });
    }
    let left_out = varying(calibrated, "location errors are constant")?;
    let mut text = format!("# {}\n", heading(machine.name(), "location errors after ISO 230-1"));
    told.iter().for_each(|line| text.push_str(&format!("# {line}\n")));
    text.push_str(&rows);
    Ok(Exported { text, numbers, left_out, told })
}
