//! Text files of laser interferometers by Renishaw: `.rtl` (linear) and `.rta` (angular).
//!
//! Sections begin with lines `NAME::`. `TARGET DATA::` lists the targets, mm or deg; `DEVIATIONS::` has lines `run target deviation`, in um or
//! mrad. What stands in other sections is not needed.

use std::collections::BTreeMap;
use std::path::Path;

use super::Request;
use super::deviations::{Deviations, Measured, is_reversed, joint, senses};
use super::positioning::Reading;
use super::text::decoded;
use crate::error::{Error, Place, Result};
use crate::machine::Machine;
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

/// The recording of such a file: command, sense of approach and what the laser read of one joint.
pub(super) fn read(
    file: &Path,
    bytes: &[u8],
    machine: Option<&Machine>,
    request: &Request,
) -> Result<Measured> {
    let laser = Laser::read(file, &decoded(bytes))?;
    let joint = joint(file, laser.angular, laser.axis.as_deref(), machine, request)?;
    let mut runs: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for (_, run, target, _) in &laser.readings {
        runs.entry(*run).or_default().push(laser.targets[target - 1]);
    }
    // Numbers of targets may count down along the axis.
    let senses = senses(file, &runs, laser.targets.last() >= laser.targets.first(), request)?;
    let (small, per) = if laser.angular { ("mrad", 1e-3) } else { ("um", 1e-6) };
    let sign = if is_reversed(request) { -1.0 } else { 1.0 };
    let reading = |(line, run, target, deviation): &(usize, usize, usize, f64)| Reading {
        line: *line,
        run: *run,
        target: laser.targets[target - 1],
        from_below: senses.get(run).copied().unwrap_or(true),
        deviation: sign * deviation * per,
    };
    let readings = laser.readings.iter().map(reading).collect();
    let deviations = Deviations { file: file.to_path_buf(), angular: laser.angular, joint, readings };
    let mut measured = deviations.measured(machine, request);
    let unit = if laser.angular { "deg" } else { "mm" };
    let order = if is_reversed(request) { "target less laser" } else { "laser less target" };
    let units = format!(
        "targets are read in {unit}, deviations in {small} as {order}; `--deviation` says the other sense"
    );
    measured.told.insert(0, units);
    Ok(measured)
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
