//! Known effects put into real recordings: the command column of one joint is rewritten, so that noise, drift and every other fault
//! stay the machine's own.
//!
//! `KINCAL_DRAWS=60 cargo test --release --test real_concealment -- --nocapture` prints the whole table; `KINCAL_SEED` draws others, and
//! `KINCAL_ONLY=15,31` diagnoses these alone, `KINCAL_WRITE=DIR` keeps what is diagnosed. A recording whose command is
//! `q - e` and whose reading is that of `q` is one of a machine that is `e` off.

mod common;

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use common::{machine, shared};
use kincal::Machine;
use kincal::diagnose::{Diagnosis, Request, diagnose};
use kincal::effects::Library;
use kincal::identify::{Loss, Options, calibrate};
use kincal::machine::JointKind;
use kincal::recording::Recording;

/// Arms, small sets first: machine, folder, files.
const SETS: [(&str, &str, &[&str]); 10] = [
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

/// splitmix64, so that draws are the same on every machine.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }
}

/// No joint that follows its command is farther off, rad or m: six degrees, ten centimetres.
const POSSIBLE: f64 = 0.1;
/// Most that a wave may change per change of the command.
const STEEP: f64 = 0.3;

/// What is concealed, at unit size.
#[derive(Clone, Copy, Debug)]
enum Concealed {
    Backlash,
    /// Waves in a turn (a metre), phase.
    Cyclic(f64, f64),
    Scale,
    /// From this part of all samples on.
    Slip(f64),
}

impl Concealed {
    fn name(self) -> &'static str {
        match self {
            Concealed::Backlash => "backlash",
            Concealed::Cyclic(..) => "cyclic_error",
            Concealed::Scale => "scale_error",
            Concealed::Slip(_) => "setup_slip",
        }
    }

    /// An encoder that loses counts turns all that hangs on its axis from one moment on: a slip of the joint, or of its frame about it.
    fn is_named(self, effect: &str) -> bool {
        effect == self.name()
    }

    /// The largest slope of a wave of unit size.
    fn steepest(self) -> f64 {
        if let Concealed::Cyclic(waves, _) = self { waves } else { 0.0 }
    }

    fn draw(number: usize, kind: JointKind, random: &mut Random) -> Self {
        match number % 4 {
            0 => Concealed::Backlash,
            1 => {
                let phase = TAU * random.unit();
                match kind {
                    JointKind::Revolute => Concealed::Cyclic((10 + random.below(70)) as f64, phase),
                    JointKind::Prismatic => Concealed::Cyclic(TAU / (0.01 + 0.04 * random.unit()), phase),
                }
            }
            2 => Concealed::Scale,
            _ => Concealed::Slip(0.25 + 0.5 * random.unit()),
        }
    }

    /// Along the positions of a joint, all files one after the other; `starts`: where files begin.
    fn along(self, q: &[f64], starts: &[usize]) -> Vec<f64> {
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
struct Set {
    name: String,
    machine: Machine,
    /// File name, lines of the head, rows.
    files: Vec<(String, Vec<String>, Vec<String>)>,
}

impl Set {
    fn read(stem: &str, folder: &str, files: &[&str]) -> Option<Set> {
        let read = |file: &&str| {
            let text = std::fs::read_to_string(shared(&format!("recordings/{folder}/{file}.csv"))?)
                .expect("readable");
            let keys = text.lines().take_while(|l| l.starts_with('#')).count();
            let lines: Vec<String> = text.lines().map(str::to_string).collect();
            Some((format!("{file}.csv"), lines[..=keys].to_vec(), lines[keys + 1..].to_vec()))
        };
        let files: Option<Vec<_>> = files.iter().map(read).collect();
        let last = folder.rsplit('/').next().expect("a name");
        Some(Set { name: format!("{stem} {last}"), machine: machine(stem), files: files? })
    }

    /// Column of a command and the factor to SI.
    fn column(&self, file: usize, command: &str) -> (usize, f64) {
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
    fn positions(&self, command: &str) -> (Vec<f64>, Vec<usize>) {
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
    fn rewritten(&self, command: &str, effect: &[f64]) -> Vec<Recording> {
        let texts = self.texts(command, effect).into_iter();
        (self.files.iter().zip(texts))
            .map(|((name, ..), text)| {
                Recording::from_bytes(name, text.into_bytes(), &self.machine)
                    .unwrap_or_else(|e| panic!("{e}"))
            })
            .collect()
    }

    /// The same as text.
    fn texts(&self, command: &str, effect: &[f64]) -> Vec<String> {
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

    fn as_it_is(&self) -> Vec<Recording> {
        let command = &self.machine.commands()[0];
        self.rewritten(command, &vec![0.0; self.positions(command).0.len()])
    }

    fn has_time(&self) -> bool {
        self.files.iter().all(|(_, head, _)| head.last().is_some_and(|h| h.starts_with("t[")))
    }

    /// RMS that constant geometry leaves, m.
    fn geometric(&self, recordings: &[Recording]) -> f64 {
        let options = Options { loss: Loss::Squares, prior: false, ..Options::default() };
        let (_, fit) =
            calibrate(&self.machine, recordings, options).unwrap_or_else(|e| panic!("{}: {e}", self.name));
        fit.rms_m.expect("lengths").geometric
    }

    fn diagnosis(&self, recordings: &[Recording]) -> Diagnosis {
        diagnose(&self.machine, recordings, &Library::standard(), &Request::default(), &|_| ())
            .unwrap_or_else(|e| panic!("{}: {e}", self.name))
    }
}

/// What a set says of itself.
struct Own {
    findings: Vec<(String, String)>,
    unexplained: Option<String>,
    held_out: f64,
    geometric: f64,
}

fn names(said: &Diagnosis) -> Vec<(String, String)> {
    said.findings.iter().filter(|f| f.probability > 0.5).map(|f| (f.effect.clone(), f.at.clone())).collect()
}

impl Own {
    fn of(set: &Set) -> Own {
        let recordings = set.as_it_is();
        let said = set.diagnosis(&recordings);
        Own {
            findings: names(&said),
            unexplained: said.unexplained.as_ref().map(|u| u.at.clone()),
            held_out: said.held_out_rms_m.expect("lengths").r#final,
            geometric: set.geometric(&recordings),
        }
    }
}

/// Counts of a row of the table.
#[derive(Default)]
struct Count {
    right: usize,
    kept: usize,
    of: usize,
}

#[test]
fn what_is_concealed_in_real_recordings_is_named_and_their_own_findings_stay() {
    let draws: usize = std::env::var("KINCAL_DRAWS").ok().and_then(|d| d.parse().ok()).unwrap_or(6);
    let only: Option<Vec<usize>> = std::env::var("KINCAL_ONLY")
        .ok()
        .map(|list| list.split(',').map(|number| number.parse().expect("numbers of draws")).collect());
    let seed = std::env::var("KINCAL_SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(2026);
    let mut random = Random(seed);
    let mut sets: BTreeMap<usize, (Set, Own)> = BTreeMap::new();
    let mut table: BTreeMap<(&str, bool), Count> = BTreeMap::new();
    for number in 0..draws {
        // Every set meets every kind.
        let which = (number + number / SETS.len()) % SETS.len();
        if let std::collections::btree_map::Entry::Vacant(free) = sets.entry(which) {
            let (stem, folder, files) = SETS[which];
            let Some(set) = Set::read(stem, folder, files) else { return };
            let own = Own::of(&set);
            println!(
                "{}: own findings {:?}, unexplained {:?}, held out {:.3} mm",
                set.name,
                own.findings,
                own.unexplained,
                1e3 * own.held_out
            );
            free.insert((set, own));
        }
        let (set, own) = &sets[&which];
        let ratio = 0.5 * 10f64.powf(random.unit());
        let Some((command, concealed, effect)) = sized(set, own, number, ratio, &mut random) else {
            println!("{number}: {}: geometry takes in whatever was drawn", set.name);
            continue;
        };
        if only.as_ref().is_some_and(|only| !only.contains(&number)) {
            continue;
        }
        let size = effect.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        let recordings = set.rewritten(&command, &effect);
        if let Some(folder) = std::env::var_os("KINCAL_WRITE") {
            let folder = std::path::Path::new(&folder).join(number.to_string());
            std::fs::create_dir_all(&folder).expect("a folder");
            for ((file, ..), text) in set.files.iter().zip(set.texts(&command, &effect)) {
                std::fs::write(folder.join(file), text).expect("a file");
            }
        }
        let said = set.diagnosis(&recordings);
        let told = names(&said);
        // The first that the set did not say of itself.
        let new: Vec<_> = told.iter().filter(|f| !own.findings.contains(f)).collect();
        let is_right = new.first().is_some_and(|(e, at)| concealed.is_named(e) && *at == command);
        // What it says of itself stays if it is told at all.
        let stays = |(effect, at): &&(String, String)| {
            said.findings.iter().any(|f| (&f.effect, &f.at) == (effect, at))
        };
        let gone: Vec<_> = own.findings.iter().filter(|f| !stays(f)).collect();
        let is_kept = gone.is_empty();
        let count = table.entry((concealed.name(), ratio >= 2.0)).or_default();
        count.of += 1;
        count.right += usize::from(is_right);
        count.kept += usize::from(is_kept);
        println!(
            "{number}: {} {} at {command}{}: {:.3} mrad or mm, {ratio:.2} times: {}, own findings {}; {new:?}, gone {gone:?}, unexplained {:?}",
            set.name,
            concealed.name(),
            if set.has_time() { "" } else { " (no time)" },
            1e3 * size,
            if is_right { "named" } else { "NOT NAMED" },
            if is_kept { "stay" } else { "CHANGE" },
            said.unexplained.as_ref().map(|u| &u.at),
        );
    }
    println!(
        "| concealed | times the held-out error | named with its joint | own findings stay |\n| --- | --- | --- | --- |"
    );
    for ((name, above), count) in &table {
        let times = if *above { ">= 2" } else { "< 2" };
        println!("| {name} | {times} | {} of {} | {} of {} |", count.right, count.of, count.kept, count.of);
    }
}

/// A joint gives way about its axis and across it: two effects, told as one. Both stay at their joint, or move to another together
/// (`docs/diagnosis-method.md` (80)).
#[test]
fn weight_is_told_of_its_own_joint_beside_counts_that_its_encoder_lost() {
    let (stem, folder, files) = SETS[6];
    let Some(set) = Set::read(stem, folder, files) else { return println!("skipped: no recordings") };
    let (q, starts) = set.positions("q3");
    let weight = ("gravity_compliance".to_string(), "q3".to_string());
    assert!(names(&set.diagnosis(&set.as_it_is())).contains(&weight));
    for part in [0.3, 0.6] {
        let effect: Vec<f64> = Concealed::Slip(part).along(&q, &starts).iter().map(|e| 3e-3 * e).collect();
        let told = names(&set.diagnosis(&set.rewritten("q3", &effect)));
        let elsewhere = told.iter().any(|(effect, at)| *effect == weight.0 && *at != weight.1);
        assert!(told.contains(&weight) && !elsewhere, "from {part} on: {told:?}");
    }
}

/// A joint, an effect and its values, so large that what geometry does not take in of it is `ratio` times the held-out error.
fn sized(
    set: &Set,
    own: &Own,
    number: usize,
    ratio: f64,
    random: &mut Random,
) -> Option<(String, Concealed, Vec<f64>)> {
    let commands = set.machine.commands();
    for _ in 0..8 {
        let c = random.below(commands.len());
        let kind = set.machine.command_joint(c).kind;
        let concealed = Concealed::draw(number + number / 4, kind, random);
        let (q, starts) = set.positions(&commands[c]);
        let moves = q.iter().any(|x| (x - q[0]).abs() > 0.05);
        if !moves || own.findings.contains(&(concealed.name().into(), commands[c].clone())) {
            continue;
        }
        let unit = concealed.along(&q, &starts);
        // So large a trial that what the recordings are off on their own does not matter.
        let lever = if kind == JointKind::Revolute { 0.5 } else { 1.0 };
        let trial = 20.0 * own.held_out.max(own.geometric) / lever;
        let off =
            set.geometric(&set.rewritten(&commands[c], &unit.iter().map(|e| trial * e).collect::<Vec<_>>()));
        let beyond = (off * off - own.geometric * own.geometric).max(0.0).sqrt();
        if beyond < 0.02 * trial * lever {
            continue;
        }
        let size = ratio * own.held_out * trial / beyond;
        // A joint that turned back within a wave would not follow its command at all.
        if concealed.steepest() * size > STEEP {
            continue;
        }
        let effect: Vec<f64> = unit.iter().map(|e| size * e).collect();
        // Nor is what takes more than a machine could show to be seen at all.
        if effect.iter().any(|e| e.abs() > POSSIBLE) {
            continue;
        }
        return Some((commands[c].clone(), concealed, effect));
    }
    None
}
