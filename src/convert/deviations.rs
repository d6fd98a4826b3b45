//! Deviations of one axis at targets: what a laser's file and a table after ISO 230-2 hold.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::Request;
use super::heading::Heading;
use super::map::{Map, MappedColumn};
use super::positioning::{Positioning, Reading};
use super::table::{Row, Table};
use crate::error::{Error, Place, Result};
use crate::machine::{JointKind, Machine};
use crate::wording::shown;

/// All that was read of an axis, in the order of the measurement.
pub(super) struct Deviations {
    pub file: PathBuf,
    pub angular: bool,
    pub joint: String,
    pub readings: Vec<Reading>,
}

/// A recording in the making: what the reader of tables has to know of a file.
pub(super) struct Measured {
    pub table: Table,
    pub map: Map,
    pub told: Vec<String>,
    pub positioning: Option<Positioning>,
    /// Whether rows and columns are others than those of the file, so that no map can say which is what.
    pub is_rearranged: bool,
}

impl Deviations {
    /// The table of command, sense of approach and reading, with its map.
    pub fn measured(&self, machine: Option<&Machine>, request: &Request) -> Measured {
        let unit = if self.angular { "deg" } else { "mm" };
        let headings = [format!("target [{unit}]"), "approach".into(), format!("laser [{unit}]")];
        let row = |reading: &Reading| {
            let Reading { target, deviation, .. } = *reading;
            // Lengths to a tenth of a nanometre, so that sums of decimals stay short.
            let read = match self.angular {
                true => target + deviation.to_degrees(),
                false => ((target + deviation * 1e3) * 1e7).round() / 1e7,
            };
            let way = if reading.from_below { "1" } else { "-1" };
            let fields = [format!("{target:?}"), way.to_string(), format!("{read:?}")];
            Row { line: reading.line, fields: fields.iter().collect() }
        };
        let table = Table {
            file: self.file.clone(),
            headings: headings.iter().map(|h| Heading::read(h)).collect(),
            line: 0,
            rows: self.readings.iter().map(row).collect(),
            separator: None,
            decimal_comma: false,
        };
        let part = |to: String, k: usize, unit: Option<&str>| MappedColumn {
            unit: unit.map(str::to_string),
            ..MappedColumn::new(to, &headings[k])
        };
        let joint = &self.joint;
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
        let positioning = Some(Positioning::of(joint, self.angular, &self.readings));
        let mut told = Vec::new();
        if !request.head.iter().any(|line| line.trim_start_matches(['#', ' ']).starts_with("zero")) {
            told.push(
                "the laser's zero is taken as the machine's; if it was set somewhere, say --head 'zero: unknown'"
                    .into(),
            );
        }
        Measured { table, map, told, positioning, is_rearranged: false }
    }
}

/// Whether deviations are told to be target less actual.
pub(super) fn is_reversed(request: &Request) -> bool {
    request.deviation.as_deref() == Some("target-minus-laser")
}

/// The joint that was measured: as told, or the only one of its kind. `noted`: what the file says of it.
pub(super) fn joint(
    file: &Path,
    angular: bool,
    noted: Option<&str>,
    machine: Option<&Machine>,
    request: &Request,
) -> Result<String> {
    let kind = if angular { JointKind::Revolute } else { JointKind::Prismatic };
    let noted = noted.map_or(String::new(), |axis| format!("; the operator noted `Axis: {}`", shown(axis)));
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
            let is = if angular { "turning" } else { "linear" };
            ask(format!("`{}` is no {is} joint of the machine", shown(joint)))
        }
        (None, Some(m)) if m.commands().len() == 1 && of_kind.len() == 1 => Ok(of_kind[0].clone()),
        (None, _) => ask("the file does not say which joint of the machine was measured".into()),
    }
}

/// How runs were made, where it is told.
#[derive(Clone, Copy, PartialEq)]
enum Approach {
    Alternating,
    Rising,
    Falling,
}

/// Whether each run came to its targets in the positive sense: as told, or as its targets follow each other. `runs`: number of the run and its
/// targets in the order of the file; `upward`: whether targets are numbered along the axis.
pub(super) fn senses(
    file: &Path,
    runs: &BTreeMap<usize, Vec<f64>>,
    upward: bool,
    request: &Request,
) -> Result<BTreeMap<usize, bool>> {
    let told = match request.approach.as_deref() {
        Some("alternating") => Some(Approach::Alternating),
        Some("rising") => Some(Approach::Rising),
        Some("falling") => Some(Approach::Falling),
        _ => None,
    };
    let rising = |targets: &Vec<f64>| -> Option<bool> {
        let all = |up: bool| targets.windows(2).all(|p| if up { p[1] > p[0] } else { p[1] < p[0] });
        match (all(true), all(false)) {
            (true, false) => Some(true),
            (false, true) => Some(false),
            _ => None,
        }
    };
    let found: BTreeMap<usize, Option<bool>> =
        runs.iter().map(|(run, targets)| (*run, rising(targets))).collect();
    // All runs in one order are the order of the form, not of the measurement.
    let ways: BTreeSet<Option<bool>> = found.values().copied().collect();
    if told.is_none() && ways != BTreeSet::from([Some(true), Some(false)]) {
        let what = format!(
            "the file does not say from which side the targets of {} runs were approached",
            runs.len()
        );
        let mend = "--approach alternating (run 1 towards higher numbers of targets, run 2 back, ...), rising or falling";
        return Err(Error::mistake(Place::file(file), what, mend));
    }
    let sense = |run: usize, own: Option<bool>| match told {
        Some(Approach::Rising) => true,
        Some(Approach::Falling) => false,
        Some(Approach::Alternating) => (run % 2 == 1) == upward,
        None => own.unwrap_or(true),
    };
    Ok(found.into_iter().map(|(run, own)| (run, sense(run, own))).collect())
}
