//! How often what is concealed in real recordings is named with its joint, and whether their own findings stay.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;

use clap::Args;
use kincal::identify::{CalibrateOptions, Loss, calibrate};
use kincal::machine::JointKind;
use kincal::recording::Recording;

use crate::concealed::{Concealed, SETS, Set, names};

#[derive(Args)]
pub struct Arguments {
    /// How many effects are concealed, each in one set of recordings.
    #[arg(long, default_value_t = 6)]
    draws: usize,
    #[arg(long, default_value_t = 2026)]
    seed: u64,
    /// Diagnoses these draws alone.
    #[arg(long, value_name = "NUMBER", value_delimiter = ',')]
    only: Vec<usize>,
    /// Keeps what is diagnosed in this folder.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
}

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

/// The largest slope of a wave of unit size.
fn steepest(concealed: Concealed) -> f64 {
    if let Concealed::Cyclic(waves, _) = concealed { waves } else { 0.0 }
}

fn draw(number: usize, kind: JointKind, random: &mut Random) -> Concealed {
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

fn has_time(set: &Set) -> bool {
    set.files.iter().all(|(_, head, _)| head.last().is_some_and(|h| h.starts_with("t[")))
}

/// RMS that constant geometry leaves, m.
fn geometric(set: &Set, recordings: &[Recording]) -> f64 {
    let options = CalibrateOptions::default().with_loss(Loss::Squares).with_prior(false);
    let (_, fit) =
        calibrate(&set.machine, recordings, options).unwrap_or_else(|e| panic!("{}: {e}", set.name));
    fit.rms.m.expect("lengths").geometric
}

/// What a set says of itself.
struct Own {
    findings: Vec<(String, String)>,
    unexplained: Option<String>,
    held_out: f64,
    geometric: f64,
}

impl Own {
    fn of(set: &Set) -> Own {
        let recordings = set.as_it_is();
        let said = set.diagnosis(&recordings);
        Own {
            findings: names(&said),
            unexplained: said.unexplained.as_ref().map(|u| u.at.clone()),
            held_out: said.held_out_rms.m.expect("lengths").r#final,
            geometric: geometric(set, &recordings),
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

/// Conceals, diagnoses and prints what was named.
pub fn run(arguments: &Arguments) {
    let mut random = Random(arguments.seed);
    let mut sets: BTreeMap<usize, (Set, Own)> = BTreeMap::new();
    let mut table: BTreeMap<(&str, bool), Count> = BTreeMap::new();
    for number in 0..arguments.draws {
        // Every set meets every kind.
        let which = (number + number / SETS.len()) % SETS.len();
        if let std::collections::btree_map::Entry::Vacant(free) = sets.entry(which) {
            let (stem, folder, files) = SETS[which];
            let set = Set::read(stem, folder, files);
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
        if !arguments.only.is_empty() && !arguments.only.contains(&number) {
            continue;
        }
        let size = effect.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        let recordings = set.rewritten(&command, &effect);
        if let Some(folder) = &arguments.write {
            let folder = folder.join(number.to_string());
            std::fs::create_dir_all(&folder).expect("a folder");
            for ((file, ..), text) in set.files.iter().zip(set.texts(&command, &effect)) {
                std::fs::write(folder.join(file), text).expect("a file");
            }
        }
        let said = set.diagnosis(&recordings);
        let told = names(&said);
        // The first that the set did not say of itself.
        let new: Vec<_> = told.iter().filter(|f| !own.findings.contains(f)).collect();
        let is_right = new.first().is_some_and(|(e, at)| e == concealed.name() && *at == command);
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
            if has_time(set) { "" } else { " (no time)" },
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
        let concealed = draw(number + number / 4, kind, random);
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
            geometric(set, &set.rewritten(&commands[c], &unit.iter().map(|e| trial * e).collect::<Vec<_>>()));
        let beyond = (off * off - own.geometric * own.geometric).max(0.0).sqrt();
        if beyond < 0.02 * trial * lever {
            continue;
        }
        let size = ratio * own.held_out * trial / beyond;
        // A joint that turned back within a wave would not follow its command at all.
        if steepest(concealed) * size > STEEP {
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
