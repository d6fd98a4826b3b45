//! Known effects put into real recordings: the command column of one joint is rewritten, so that noise, drift and every other fault
//! stay the machine's own. A recording whose command is `q - e` and whose reading is that of `q` is one of a machine that is `e` off.
//!
//! The section `concealed` of `examples/benchmarks` measures how often what is concealed is named.
#![allow(dead_code)]

use kincal::Machine;
use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::Library;
use kincal::recording::Recording;

use crate::common::{data, machine};

/// Arms, small sets first: machine, folder, files.
pub const SETS: [(&str, &str, &[&str]); 10] = [
    ("kuka_iiwa14", "mukca/kuka_14", &["front", "left_back"]),
    ("franka_panda", "mukca/panda_4", &["left", "very-front"]),
    ("franka_panda", "mukca/panda_6", &["front", "right"]),
    ("franka_panda", "mukca/panda_1", &["back-high", "front"]),
    ("kinova_gen3_lite", "mukca/dinova_2", &["front", "left"]),
    ("dlr_justin_left", "dlr_justin", &["left"]),
    ("franka_panda", "mukca/panda_3", &["backleft", "backright", "frontcenter", "frontright"]),
    ("dlr_justin_right", "dlr_justin", &["right"]),
    ("fanuc_r2000ic_165f", "fanuc_r2000ic", &["mark_A", "mark_B", "mark_C"]),
    ("hilti_jaibot", "hilti_jaibot", &["diagonal_wood", "flat", "pallet", "seesaw"]),
];

/// What is concealed, at unit size.
#[derive(Clone, Copy, Debug)]
pub enum Concealed {
    Backlash,
    /// Waves in a turn (a metre), phase.
    Cyclic(f64, f64),
    Scale,
    /// From this part of all samples on.
    Slip(f64),
}

impl Concealed {
    pub fn name(self) -> &'static str {
        match self {
            Concealed::Backlash => "backlash",
            Concealed::Cyclic(..) => "cyclic_error",
            Concealed::Scale => "scale_error",
            Concealed::Slip(_) => "setup_slip",
        }
    }

    /// Along the positions of a joint, all files one after the other; `starts`: where files begin.
    pub fn along(self, q: &[f64], starts: &[usize]) -> Vec<f64> {
        match self {
            Concealed::Cyclic(waves, phase) => q.iter().map(|q| (waves * q + phase).sin()).collect(),
            Concealed::Scale => q.to_vec(),
            Concealed::Slip(part) => {
                let from = (part * q.len() as f64) as usize;
                (0..q.len()).map(|k| if k < from { 0.0 } else { 1.0 }).collect()
            }
            Concealed::Backlash => {
                let mut side = vec![0.0; q.len()];
                for (i, from) in starts.iter().enumerate() {
                    let to = starts.get(i + 1).copied().unwrap_or(q.len());
                    // By the sign of the commanded change; before the first one as that will be.
                    let step = |k: usize| if k == *from { 0.0 } else { q[k] - q[k - 1] };
                    let first = (*from..to).map(step).find(|s| s.abs() > 1e-4).unwrap_or(1.0);
                    let mut last = first.signum();
                    for (k, side) in side.iter_mut().enumerate().take(to).skip(*from) {
                        if step(k).abs() > 1e-4 {
                            last = step(k).signum();
                        }
                        *side = -0.5 * last;
                    }
                }
                side
            }
        }
    }
}

/// A set of recordings as text.
pub struct Set {
    pub name: String,
    pub machine: Machine,
    /// File name, lines of the head, rows.
    pub files: Vec<(String, Vec<String>, Vec<String>)>,
}

impl Set {
    pub fn read(stem: &str, folder: &str, files: &[&str]) -> Set {
        let read = |file: &&str| {
            let path = data(&format!("recordings/{folder}/{file}.csv"));
            let text = std::fs::read_to_string(path).expect("readable");
            let keys = text.lines().take_while(|l| l.starts_with('#')).count();
            let lines: Vec<String> = text.lines().map(str::to_string).collect();
            (format!("{file}.csv"), lines[..=keys].to_vec(), lines[keys + 1..].to_vec())
        };
        let files = files.iter().map(read).collect();
        let last = folder.rsplit('/').next().expect("a name");
        Set { name: format!("{stem} {last}"), machine: machine(stem), files }
    }

    /// Column of a command and the factor to SI.
    pub fn column(&self, file: usize, command: &str) -> (usize, f64) {
        let header = self.files[file].1.last().expect("a header row");
        let at = header.split(',').position(|c| c.split('[').next() == Some(command)).expect("a command");
        let unit = header.split(',').nth(at).and_then(|c| c.split('[').nth(1)).expect("a unit");
        let factor = match unit {
            "mm]" => 1e-3,
            "deg]" => 1f64.to_radians(),
            _ => 1.0,
        };
        (at, factor)
    }

    /// Positions of a command, all files one after the other, and where files begin.
    pub fn positions(&self, command: &str) -> (Vec<f64>, Vec<usize>) {
        let (mut q, mut starts) = (Vec::new(), Vec::new());
        for (i, (_, _, rows)) in self.files.iter().enumerate() {
            starts.push(q.len());
            let (at, factor) = self.column(i, command);
            q.extend(rows.iter().map(|row| {
                row.split(',').nth(at).and_then(|x| x.trim().parse::<f64>().ok()).expect("a number") * factor
            }));
        }
        (q, starts)
    }

    /// The recordings with `command - effect` in place of the command.
    pub fn rewritten(&self, command: &str, effect: &[f64]) -> Vec<Recording> {
        let texts = self.texts(command, effect).into_iter();
        (self.files.iter().zip(texts))
            .map(|((name, ..), text)| {
                Recording::from_bytes(name, text.into_bytes(), &self.machine)
                    .unwrap_or_else(|e| panic!("{e}"))
            })
            .collect()
    }

    /// The same as text.
    pub fn texts(&self, command: &str, effect: &[f64]) -> Vec<String> {
        let mut next = effect.iter();
        self.files
            .iter()
            .enumerate()
            .map(|(i, (_, head, rows))| {
                let (at, factor) = self.column(i, command);
                let mut text = head.join("\n") + "\n";
                for row in rows {
                    let mut cells: Vec<String> = row.split(',').map(str::to_string).collect();
                    let q: f64 = cells[at].trim().parse().expect("a number");
                    cells[at] = format!("{:.12}", q - next.next().expect("as many") / factor);
                    text += &(cells.join(",") + "\n");
                }
                text
            })
            .collect()
    }

    pub fn as_it_is(&self) -> Vec<Recording> {
        let command = &self.machine.commands()[0];
        self.rewritten(command, &vec![0.0; self.positions(command).0.len()])
    }

    pub fn diagnosis(&self, recordings: &[Recording]) -> Diagnosis {
        diagnose(&self.machine, recordings, &Library::standard(), &DiagnoseOptions::default(), &|_| ())
            .unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }
}

/// Effect and place of all that is told with more than even odds.
pub fn names(said: &Diagnosis) -> Vec<(String, String)> {
    said.findings.iter().filter(|f| f.probability > 0.5).map(|f| (f.effect.clone(), f.at.clone())).collect()
}
