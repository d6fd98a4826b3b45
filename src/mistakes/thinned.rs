//! A recording thinned to what mistakes are tried on.

use std::collections::{BTreeSet, HashMap};
use std::fmt::Write;

use crate::error::Result;
use crate::machine::{JointKind, Machine};
use crate::recording::{Header, Measurement, Recording, Role};
use crate::units::Unit;

/// So many samples of a recording are enough to tell a machine from another.
const SAMPLES: u64 = 300;
/// Neighbours of a sample, before and behind, that rows may be shifted by.
pub(super) const SHIFTS: usize = 3;

/// One sample, m and rad.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// Where it stands in the file.
    pub line: u64,
    /// s, where the recording says.
    pub time: Option<f64>,
    pub commands: Vec<f64>,
    pub values: Vec<f64>,
}

/// Evenly spread samples of a recording with their neighbours.
#[derive(Clone, Debug)]
pub(super) struct Thinned {
    /// The recording as the user named it.
    pub path: String,
    /// Lines of the head that hold whatever the columns say.
    pub head: Vec<String>,
    pub header: Header,
    pub measurement: Measurement,
    /// Units in which the file states commands and readings, where it has such columns.
    pub units: Vec<Option<Unit>>,
    pub value_units: Vec<Unit>,
    /// By place in the thinned recording: the sample in the middle and `SHIFTS` neighbours on each side.
    pub windows: Vec<Vec<Sample>>,
    /// The samples that a change works on.
    pub samples: Vec<Sample>,
}

impl Thinned {
    /// Reads a recording once.
    pub fn of(recording: &Recording) -> Result<Thinned> {
        let total = recording.scan()?.samples;
        let wanted = SAMPLES.min(total);
        // Symmetric, so that the same samples are there from behind.
        let pick = |i: u64| if wanted < 2 { 0 } else { (i * (total - 1) + (wanted - 1) / 2) / (wanted - 1) };
        let picks: Vec<u64> = (0..wanted).map(pick).collect();
        let (commands, values) = (recording.fixed().len(), recording.value_count());
        let shifts = -(SHIFTS as i64)..=SHIFTS as i64;
        let rows = |pick: u64| shifts.clone().map(move |by| pick.saturating_add_signed(by).min(total - 1));
        let wanted: BTreeSet<u64> = picks.iter().flat_map(|pick| rows(*pick)).collect();
        let mut known: HashMap<u64, Sample> = HashMap::new();
        for chunk in recording.chunks_with(&wanted)? {
            let (first, chunk) = chunk?;
            for number in wanted.range(first..first + chunk.len as u64) {
                let k = (number - first) as usize;
                let row = |all: &[f64], width: usize| all[k * width..(k + 1) * width].to_vec();
                let (commands, values) = (row(&chunk.commands, commands), row(&chunk.values, values));
                let (line, time) = (chunk.lines[k], chunk.time.as_ref().map(|t| t[k]));
                known.insert(*number, Sample { line, time, commands, values });
            }
        }
        let window = |pick: &u64| rows(*pick).filter_map(|row| known.get(&row).cloned()).collect();
        let windows: Vec<Vec<Sample>> = picks.iter().map(window).collect();
        let middle = |window: &Vec<Sample>| window[SHIFTS].clone();
        let key = |line: &str| line.trim_start_matches('#').trim_start().starts_with("fixed");
        let lines = recording.preamble().lines();
        let unit = |role: Role| recording.columns().iter().find(|c| c.role == role).map(|c| c.unit);
        Ok(Thinned {
            path: recording.path().to_string_lossy().into_owned(),
            head: lines.filter(|l| l.trim_start().starts_with('#') && !key(l)).map(String::from).collect(),
            header: recording.header().clone(),
            measurement: recording.header().measurement,
            units: (0..commands).map(|c| unit(Role::Command(c))).collect(),
            value_units: (0..values).filter_map(|i| unit(Role::Value(i))).collect(),
            samples: windows.iter().map(middle).collect(),
            windows,
        })
    }

    /// Every sample with its neighbour so many rows further on.
    pub fn neighbours(&self, rows: isize) -> impl Iterator<Item = &Sample> {
        self.windows
            .iter()
            .map(move |window| &window[SHIFTS.saturating_add_signed(rows).min(window.len() - 1)])
    }

    /// Its file name.
    pub fn name(&self) -> String {
        let name = std::path::Path::new(&self.path).file_name();
        name.map_or_else(|| self.path.clone(), |name| name.to_string_lossy().into_owned())
    }

    /// The commands of the rows before the samples, as they were read.
    pub fn commands_before(&self) -> Vec<Vec<f64>> {
        self.neighbours(-1).map(|sample| sample.commands.clone()).collect()
    }

    /// As a recording again, m and rad.
    pub fn recording(&self, machine: &Machine) -> Result<Recording> {
        let kind = |kind| if kind == JointKind::Revolute { "rad" } else { "m" };
        let commands = machine.commands().iter().enumerate();
        let mut names: Vec<String> =
            commands.map(|(c, name)| format!("{name}[{}]", kind(machine.command_joint(c).kind))).collect();
        match self.measurement {
            Measurement::Distance { absolute } => names.push(if absolute { "r[m]" } else { "d[m]" }.into()),
            Measurement::Displacement => names.push("s[m]".into()),
            Measurement::Joint { dyad } => {
                let joint = machine.dyads()[dyad].joint.as_ref();
                names.extend(joint.map(|joint| format!("{}_meas[{}]", joint.name, kind(joint.kind))));
            }
            Measurement::Position | Measurement::Pose => {
                names.extend(["px[m]", "py[m]", "pz[m]"].map(String::from));
                if self.measurement == Measurement::Pose {
                    names.extend(["rx[rad]", "ry[rad]", "rz[rad]"].map(String::from));
                }
            }
        }
        let mut text = String::new();
        self.head.iter().for_each(|line| {
            let _ = writeln!(text, "{line}");
        });
        let _ = writeln!(text, "{}", names.join(","));
        for sample in &self.samples {
            let row: Vec<String> =
                sample.commands.iter().chain(&sample.values).map(|x| format!("{x:?}")).collect();
            let _ = writeln!(text, "{}", row.join(","));
        }
        Recording::from_bytes(&self.path, text.into_bytes(), machine)
    }
}
