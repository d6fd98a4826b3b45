//! Text files of laser interferometers by Renishaw: `.rtl` (linear) and `.rta` (angular).
//!
//! Sections begin with lines `NAME::`. `TARGET DATA::` lists the targets, mm or deg; `DEVIATIONS::` has lines `run target deviation`, in um or
//! mrad. What stands in other sections is not needed.

use std::path::Path;

use super::Request;
use super::heading::Heading;
use super::map::{Map, Part};
use super::table::{Row, Table};
use super::text::decoded;
use crate::error::{Error, Place, Result};
use crate::machine::{JointKind, Machine};
use crate::wording::shown;

/// Whether a file is one of these.
pub(super) fn is_one(file: &Path, bytes: &[u8]) -> bool {
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]).into_owned();
    ["rtl", "rta"].contains(&ending.as_str())
        || (start.contains("HEADER::") && start.contains("TARGET DATA::"))
}

struct Laser {
    angular: bool,
    /// The axis that the operator wrote down.
    axis: Option<String>,
    targets: Vec<f64>,
    /// Line, run and target from 1, deviation.
    readings: Vec<(usize, usize, usize, f64)>,
}

/// Direction of approach of the readings.
#[derive(Clone, Copy, PartialEq)]
enum Approach {
    Alternating,
    Rising,
    Falling,
}

/// The table of such a file with its map: command, direction of approach and what the laser read of one joint.
pub(super) fn read(
    file: &Path,
    bytes: &[u8],
    machine: Option<&Machine>,
    request: &Request,
) -> Result<(Table, Map, Vec<String>)> {
    let laser = Laser::read(file, &decoded(bytes))?;
    let joint = joint(file, &laser, machine, request)?;
    let approaches = approaches(file, &laser, request)?;
    let reversed = request.deviation.as_deref() == Some("target-minus-laser");
    let (unit, per) = if laser.angular { ("deg", 1e-3f64.to_degrees()) } else { ("mm", 1e-3) };
    let headings = [format!("target [{unit}]"), "approach".into(), format!("laser [{unit}]")];
    let mut rows = Vec::with_capacity(laser.readings.len());
    for ((line, _, target, deviation), approach) in laser.readings.iter().zip(approaches) {
        let target = laser.targets[target - 1];
        let deviation = if reversed { -deviation } else { *deviation };
        // Lengths to a tenth of a nanometre, so that sums of decimals stay short.
        let read = if laser.angular {
            target + deviation * per
        } else {
            ((target + deviation * per) * 1e7).round() / 1e7
        };
        let fields = [format!("{target:?}"), approach.to_string(), format!("{read:?}")];
        rows.push(Row { line: *line, fields: fields.iter().collect() });
    }
    let table = Table {
        file: file.to_path_buf(),
        headings: headings.iter().map(|h| Heading::read(h)).collect(),
        line: 0,
        rows,
        separator: None,
        decimal_comma: false,
    };
    let part = |to: String, k: usize, unit: Option<&str>| Part {
        unit: unit.map(str::to_string),
        ..Part::new(to, &headings[k])
    };
    let map = Map {
        machine: machine.map(|m| m.name().to_string()),
        measurement: "joint".into(),
        head: request.head.clone(),
        columns: vec![
            part(joint.clone(), 0, Some(unit)),
            part(format!("{joint}_direction"), 1, None),
            part(format!("{joint}_meas"), 2, Some(unit)),
        ],
        ..Map::default()
    };
    let (small, order) = (
        if laser.angular { "mrad" } else { "um" },
        if reversed { "target less laser" } else { "laser less target" },
    );
    let mut told = vec![format!(
        "targets are read in {unit}, deviations in {small} as {order}; `--deviation` says the other sense"
    )];
    if !request.head.iter().any(|line| line.trim_start_matches(['#', ' ']).starts_with("zero")) {
        told.push(
            "the laser's zero is taken as the machine's; if it was set somewhere, say --head 'zero: unknown'"
                .into(),
        );
    }
    Ok((table, map, told))
}

impl Laser {
    fn read(file: &Path, text: &str) -> Result<Laser> {
        let fault =
            |line: usize, what: String, mend: &str| Error::mistake(Place::at(file, line, 0), what, mend);
        let ending = file.extension().and_then(|e| e.to_str()).unwrap_or_default();
        let mut laser = Laser {
            angular: ending.eq_ignore_ascii_case("rta"),
            axis: None,
            targets: Vec::new(),
            readings: Vec::new(),
        };
        let (mut section, mut in_targets, mut announced) = (String::new(), false, None);
        for (line, content) in (1..).zip(text.lines().map(str::trim)) {
            if let Some(name) = content.strip_suffix("::") {
                (section, in_targets) = (name.trim().to_ascii_uppercase(), false);
                continue;
            }
            let (key, value) =
                content.split_once(':').map_or(("", ""), |(key, value)| (key.trim(), value.trim()));
            let number = |word: &str| {
                word.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(|| {
                    fault(
                        line,
                        format!("`{}` is no number", shown(word)),
                        "compare with the file that the program wrote",
                    )
                })
            };
            match section.as_str() {
                "TARGET DATA" if key.eq_ignore_ascii_case("Target-count") => {
                    announced = value.parse::<usize>().ok()
                }
                "TARGET DATA" if key.eq_ignore_ascii_case("Targets") => in_targets = true,
                "TARGET DATA" if !key.is_empty() => in_targets = false,
                "TARGET DATA" if in_targets => {
                    for word in content.split_whitespace() {
                        laser.targets.push(number(word)?);
                    }
                }
                "USER-TEXT" if key.eq_ignore_ascii_case("Axis") && !value.is_empty() => {
                    laser.axis = Some(value.into())
                }
                "DEVIATIONS" if key.is_empty() && !content.is_empty() => {
                    let words: Vec<&str> = content.split_whitespace().collect();
                    let &[run, target, deviation] = &words[..] else {
                        let what = format!("{} words, expected run, target and deviation", words.len());
                        return Err(fault(line, what, "compare with the file that the program wrote"));
                    };
                    let index = |word: &str| word.parse::<usize>().ok().filter(|n| *n > 0);
                    let (Some(run), Some(target)) = (index(run), index(target)) else {
                        let what = format!(
                            "`{} {}` are no numbers of a run and a target",
                            shown(run),
                            shown(target)
                        );
                        return Err(fault(line, what, "runs and targets count from 1"));
                    };
                    if target > laser.targets.len() {
                        let what = format!("target {target} is read, the list has {}", laser.targets.len());
                        return Err(fault(line, what, "targets count from 1; is the file whole?"));
                    }
                    laser.readings.push((line, run, target, number(deviation)?));
                }
                _ => {}
            }
        }
        if announced.is_some_and(|n| n != laser.targets.len()) {
            let what = format!("{} targets, announced are {}", laser.targets.len(), announced.unwrap_or(0));
            return Err(fault(0, what, "the file is not whole, or not of this form"));
        }
        if laser.readings.is_empty() {
            let what = "no section `DEVIATIONS::` with readings".into();
            return Err(fault(0, what, "save the measurement with its data, or export it as a table"));
        }
        Ok(laser)
    }
}

/// The joint that was measured: as told, or the only one of its kind.
fn joint(file: &Path, laser: &Laser, machine: Option<&Machine>, request: &Request) -> Result<String> {
    let kind = if laser.angular { JointKind::Revolute } else { JointKind::Prismatic };
    let noted = laser
        .axis
        .as_ref()
        .map_or(String::new(), |axis| format!("; the operator noted `Axis: {}`", shown(axis)));
    let of_kind: Vec<String> = machine.map_or(Vec::new(), |m| {
        let joints = 0..m.commands().len();
        joints.filter(|c| m.command_joint(*c).kind == kind).map(|c| m.commands()[c].clone()).collect()
    });
    let ask = |what: String| {
        let names = if of_kind.is_empty() { "NAME".to_string() } else { of_kind.join("|") };
        Err(Error::mistake(Place::file(file), what, format!("--joint {names}{noted}")))
    };
    match (&request.joint, machine) {
        (Some(joint), None) => Ok(joint.clone()),
        (Some(joint), Some(_)) if of_kind.contains(joint) => Ok(joint.clone()),
        (Some(joint), Some(_)) => {
            let is = if laser.angular { "turning" } else { "linear" };
            ask(format!("`{}` is no {is} joint of the machine", shown(joint)))
        }
        (None, Some(m)) if m.commands().len() == 1 && of_kind.len() == 1 => Ok(of_kind[0].clone()),
        (None, _) => ask("the file does not say which joint of the machine was measured".into()),
    }
}

/// Direction of approach of each reading: as told, or as the targets of each run follow each other in the file.
fn approaches(file: &Path, laser: &Laser, request: &Request) -> Result<Vec<i8>> {
    let runs: std::collections::BTreeSet<usize> = laser.readings.iter().map(|r| r.1).collect();
    let rising = |run: usize| -> Option<bool> {
        let of: Vec<f64> =
            laser.readings.iter().filter(|r| r.1 == run).map(|r| laser.targets[r.2 - 1]).collect();
        let all = |up: bool| of.windows(2).all(|p| if up { p[1] > p[0] } else { p[1] < p[0] });
        match (all(true), all(false)) {
            (true, false) => Some(true),
            (false, true) => Some(false),
            _ => None,
        }
    };
    let told = match request.approach.as_deref() {
        Some("alternating") => Some(Approach::Alternating),
        Some("rising") => Some(Approach::Rising),
        Some("falling") => Some(Approach::Falling),
        _ => None,
    };
    let senses: std::collections::BTreeMap<usize, Option<bool>> =
        runs.iter().map(|run| (*run, rising(*run))).collect();
    let both = senses.values().any(|s| *s == Some(true)) && senses.values().any(|s| *s == Some(false));
    let known = senses.values().all(Option::is_some);
    if told.is_none() && !(both && known) {
        let what = format!(
            "the file does not say from which side the targets of {} runs were approached",
            runs.len()
        );
        let mend = "--approach alternating (run 1 towards higher numbers of targets, run 2 back, ...), rising or falling";
        return Err(Error::mistake(Place::file(file), what, mend));
    }
    // Numbers of targets may count down along the axis.
    let upward = laser.targets.last() >= laser.targets.first();
    let sense = |run: usize| match told {
        Some(Approach::Rising) => true,
        Some(Approach::Falling) => false,
        Some(Approach::Alternating) => (run % 2 == 1) == upward,
        None => senses.get(&run).copied().flatten().unwrap_or(true),
    };
    Ok(laser.readings.iter().map(|r| if sense(r.1) { 1 } else { -1 }).collect())
}
