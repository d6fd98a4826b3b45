//! HEIDENHAIN: what the kinematics cycles should find, and errors under the names of KinematicsComp.

use std::fmt::Write;

use super::control::{Seen, common, square, unit};
use super::numbers::{MM, fixed, heading, left_open};
use super::{ExportOptions, Exported, Number, iso230};
use crate::calibration::CalibratedMachine;
use crate::error::Result;

/// The largest change of a kinematics description that cycle 451 takes by itself, MP6600 as delivered, m.
const LARGEST_CHANGE: f64 = 5e-5;

pub(super) fn write(calibrated: &CalibratedMachine, options: &ExportOptions) -> Result<Exported> {
    let seen = Seen::new(calibrated, options, "HEIDENHAIN")?;
    let axes: Vec<(usize, usize)> = seen.layout.part.iter().chain(&seen.layout.tool).copied().collect();
    let places = |lines: &super::lines::Lines| -> Vec<f64> {
        axes.iter().flat_map(|(line, axis)| seen.point(lines, *line, *axis).0).collect()
    };
    let full = seen.calibrated_lines();
    let (values, declared) = (places(&full), places(&seen.declared_lines()));
    let verdicts = seen.judge(places);
    let mut exported =
        common(&seen, "KinematicsOpt holds places of rotary axes; `compensate` takes the rest")?;
    exported.told.push("offset: calibrated less declared place of each rotary axis, mm, for the transformations of the kinematics description; check by cycle 451 with Q406 = 0, set by 451 or 452".into());
    exported.told.push("cycle 451 takes no change above MP6600 (0.05 mm as delivered)".into());
    exported.told.push("location errors below bear the names that KinematicsComp uses; there errors are defined before the affected axis, in the ideal system of the table".into());
    let mut text = format!("# {}\n", heading(calibrated.machine().name(), "HEIDENHAIN kinematics"));
    exported.told.iter().for_each(|line| text.push_str(&format!("# {line}\n")));
    text.push_str("axis,component,declared[mm],calibrated[mm],offset[mm],note\n");
    for (n, (line, axis)) in axes.iter().enumerate() {
        for k in (0..3).filter(|k| k != axis) {
            let i = 3 * n + k;
            let (value, was) = (values[i], declared[i]);
            let is_open = !verdicts[i].is_determined();
            let because = is_open.then(|| left_open(verdicts[i].open * MM.per_si, MM.symbol));
            let name = format!("{},{}", seen.layout.names[*line], ["X", "Y", "Z"][k]);
            let change = value - was;
            let note = match &because {
                Some(because) => because.clone(),
                None if change.abs() > LARGEST_CHANGE => "above MP6600 as delivered".into(),
                None => String::new(),
            };
            let shown = |x: f64| if because.is_some() { String::new() } else { fixed(x * MM.per_si) };
            let _ =
                writeln!(text, "{name},{},{},{},{note}", fixed(was * MM.per_si), shown(value), shown(change));
            exported.numbers.push(Number {
                name: name.replace(',', "."),
                value: because.is_none().then_some(value * MM.per_si),
                declared: was * MM.per_si,
                unit: "mm".into(),
                because,
            });
        }
    }
    let errors = iso230::write(calibrated)?;
    text.push('\n');
    errors
        .text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .for_each(|line| text.push_str(&format!("{line}\n")));
    exported.numbers.extend(errors.numbers);
    let mut held = square(&seen.layout, &full);
    for (line, axis) in &axes {
        let own = held.lines[*line].u.0[*axis].signum();
        held.lines[*line].u = unit(*axis).times(own);
    }
    let constant =
        seen.remainders(&held, "no place of a rotary axis holds it; KinematicsComp or `compensate` takes it");
    exported.left_out.splice(0..0, constant);
    exported.text = text;
    Ok(exported)
}
