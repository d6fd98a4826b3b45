//! Known effects put into real recordings: the command column of one joint is rewritten, so that noise, drift and every other fault
//! stay the machine's own.
//!
//! A recording whose command is `q - e` and whose reading is that of `q` is one of a machine that is `e` off.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use kincal::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use kincal::effects::Library;
use kincal::identify::{CalibrateOptions, Loss, calibrate};
use kincal::machine::JointKind;
use kincal::recording::Recording;

use crate::findings;
use crate::outcome::{Failure, Outcome, given};
use crate::sets::{self, Data, Set};
use crate::table::Table;

const DRAWS: usize = 60;
/// Arms, small sets first.
const SETS: [&str; 10] = [
    "kuka_14",
    "panda_4",
    "panda_6",
    "panda_1",
    "dinova_2",
    "dlr_justin left",
    "panda_3",
    "dlr_justin right",
    "fanuc_r2000ic",
    "hilti_jaibot",
];
/// No joint that follows its command is farther off, rad or m: six degrees, ten centimetres.
const POSSIBLE: f64 = 0.1;
/// Most that a wave may change per change of the command.
const STEEP: f64 = 0.3;
/// A joint that moves less says nothing, rad or m.
const MOVES: f64 = 0.05;
/// A change of a command that is a motion, rad or m.
const MOTION: f64 = 1e-4;

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

/// What is concealed, at unit size.
#[derive(Clone, Copy)]
enum Concealed {
    Backlash,
    /// Waves in a radian (a metre), phase.
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

    /// Along the positions of a joint.
    fn along(self, joint: &Positions) -> Vec<f64> {
        let q = &joint.q;
        match self {
            Concealed::Cyclic(waves, phase) => q.iter().map(|q| (waves * q + phase).sin()).collect(),
            Concealed::Scale => q.clone(),
            Concealed::Slip(part) => {
                let from = (part * q.len() as f64) as usize;
                (0..q.len()).map(|k| if k < from { 0.0 } else { 1.0 }).collect()
            }
            Concealed::Backlash => joint.files().flat_map(sides).collect(),
        }
    }
}

/// The side of play of unit width along a file: against the last motion, before the first one as that will be.
fn sides(q: &[f64]) -> Vec<f64> {
    let steps = || q.windows(2).map(|two| two[1] - two[0]);
    let mut last = steps().find(|step| step.abs() > MOTION).unwrap_or(1.0).signum();
    let mut side = Vec::with_capacity(q.len());
    for step in [0.0].into_iter().chain(steps()).take(q.len()) {
        if step.abs() > MOTION {
            last = step.signum();
        }
        side.push(-0.5 * last);
    }
    side
}

/// Positions of a command, all files one after the other, and where files begin.
struct Positions {
    q: Vec<f64>,
    starts: Vec<usize>,
}

impl Positions {
    fn of(set: &Set, command: &str) -> Outcome<Self> {
        let (mut q, mut starts) = (Vec::new(), Vec::new());
        for text in &set.texts {
            starts.push(q.len());
            let (at, factor) = column(set, &text.columns(), command)?;
            for row in &text.rows {
                q.push(number(row, at)? * factor);
            }
        }
        Ok(Positions { q, starts })
    }

    fn files(&self) -> impl Iterator<Item = &[f64]> {
        self.starts.iter().enumerate().map(|(i, from)| {
            let to = self.starts.get(i + 1).copied().unwrap_or(self.q.len());
            &self.q[*from..to]
        })
    }

    fn moves(&self) -> bool {
        self.q.iter().any(|q| (q - self.q[0]).abs() > MOVES)
    }
}

/// Column of a command and the factor to SI.
fn column(set: &Set, columns: &[&str], command: &str) -> Outcome<(usize, f64)> {
    let named = |column: &&str| column.split('[').next() == Some(command);
    let at = columns.iter().position(named);
    let at = at.ok_or_else(|| Failure::Broken(format!("{}: no column of {command}", set.name)))?;
    let unit = columns[at].split(['[', ']']).nth(1);
    Ok((
        at,
        match unit {
            Some("mm") => 1e-3,
            Some("deg") => 1f64.to_radians(),
            _ => 1.0,
        },
    ))
}

fn number(row: &str, at: usize) -> Outcome<f64> {
    let cell = row.split(',').nth(at).and_then(|cell| cell.trim().parse().ok());
    given(cell, "number in a command")
}

/// The recordings with `command - effect` in place of the command.
fn rewritten(set: &Set, command: &str, effect: &[f64]) -> Outcome<Vec<Recording>> {
    let mut next = effect.iter();
    let mut recordings = Vec::new();
    for text in &set.texts {
        let (at, factor) = column(set, &text.columns(), command)?;
        let mut csv = text.head.join("\n") + "\n";
        for row in &text.rows {
            let changed = number(row, at)? - given(next.next(), "effect")? / factor;
            let cells = row.split(',').enumerate();
            let cells: Vec<String> =
                cells.map(|(i, cell)| if i == at { format!("{changed:.12}") } else { cell.into() }).collect();
            csv += &(cells.join(",") + "\n");
        }
        recordings.push(Recording::from_bytes(&text.name, csv.into_bytes(), &set.machine)?);
    }
    Ok(recordings)
}

/// RMS that constant geometry leaves, m.
fn geometric(set: &Set, recordings: &[Recording]) -> Outcome<f64> {
    let options = CalibrateOptions::default().with_loss(Loss::Squares).with_prior(false);
    let (_, fit) = calibrate(&set.machine, recordings, options)?;
    Ok(given(fit.rms.m, "lengths")?.geometric)
}

type Name = (String, String);

fn names(said: &Diagnosis) -> Vec<Name> {
    said.findings.iter().filter(|f| f.probability > 0.5).map(|f| (f.effect.clone(), f.at.clone())).collect()
}

/// What a set says of itself.
struct Own {
    findings: Vec<Name>,
    held_out: f64,
    geometric: f64,
}

impl Own {
    fn of(set: &Set) -> Outcome<Own> {
        let said = findings::of(set)?;
        Ok(Own {
            findings: names(&said),
            held_out: given(said.held_out_rms.m, "lengths")?.r#final,
            geometric: geometric(set, &set.whole()?)?,
        })
    }
}

/// A joint, an effect and its values, so large that what geometry does not take in of it is `ratio` times the held-out error.
struct Case {
    command: String,
    concealed: Concealed,
    effect: Vec<f64>,
}

impl Case {
    /// `None` where geometry takes in whatever is drawn.
    fn draw(set: &Set, own: &Own, number: usize, ratio: f64, random: &mut Random) -> Outcome<Option<Case>> {
        let commands = set.machine.commands();
        for _ in 0..8 {
            let c = random.below(commands.len());
            let command = &commands[c];
            let kind = set.machine.command_joint(c).kind;
            let concealed = Concealed::draw(number + number / 4, kind, random);
            let joint = Positions::of(set, command)?;
            if !joint.moves() || own.findings.contains(&(concealed.name().into(), command.clone())) {
                continue;
            }
            let unit = concealed.along(&joint);
            // So large a trial that what the recordings are off on their own does not matter.
            let lever = if kind == JointKind::Revolute { 0.5 } else { 1.0 };
            let trial = 20.0 * own.held_out.max(own.geometric) / lever;
            let times = |size: f64| -> Vec<f64> { unit.iter().map(|e| size * e).collect() };
            let off = geometric(set, &rewritten(set, command, &times(trial))?)?;
            let beyond = (off * off - own.geometric * own.geometric).max(0.0).sqrt();
            if beyond < 0.02 * trial * lever {
                continue;
            }
            let size = ratio * own.held_out * trial / beyond;
            // A joint that turned back within a wave would not follow its command at all.
            if concealed.steepest() * size > STEEP {
                continue;
            }
            let effect = times(size);
            if effect.iter().all(|e| e.abs() <= POSSIBLE) {
                return Ok(Some(Case { command: command.clone(), concealed, effect }));
            }
        }
        Ok(None)
    }
}

/// Counts of a row of the table.
#[derive(Default)]
struct Count {
    right: usize,
    kept: usize,
    of: usize,
}

pub fn concealed(data: &Data) -> Outcome<String> {
    let mut random = Random(7);
    let mut known: BTreeMap<usize, (Set, Own)> = BTreeMap::new();
    let mut counts: BTreeMap<(&str, bool), Count> = BTreeMap::new();
    let mut taken_in = 0;
    for number in 0..DRAWS {
        // Every set meets every kind.
        let which = (number + number / SETS.len()) % SETS.len();
        if let std::collections::btree_map::Entry::Vacant(free) = known.entry(which) {
            let set = sets::arm(data, SETS[which])?;
            let own = Own::of(&set)?;
            free.insert((set, own));
        }
        let (set, own) = &known[&which];
        let ratio = 0.5 * 10f64.powf(random.unit());
        let Some(case) = Case::draw(set, own, number, ratio, &mut random)? else {
            taken_in += 1;
            continue;
        };
        let recordings = rewritten(set, &case.command, &case.effect)?;
        let said =
            diagnose(&set.machine, &recordings, &Library::standard(), &DiagnoseOptions::default(), &|_| {})?;
        let told = names(&said);
        // The first that the set did not say of itself.
        let new = told.iter().find(|name| !own.findings.contains(name));
        let is_right = new.is_some_and(|(effect, at)| effect == case.concealed.name() && *at == case.command);
        // What it says of itself stays if it is told at all.
        let stays = |(effect, at): &Name| said.findings.iter().any(|f| (&f.effect, &f.at) == (effect, at));
        let count = counts.entry((case.concealed.name(), ratio >= 2.0)).or_default();
        count.of += 1;
        count.right += usize::from(is_right);
        let gone: Vec<String> = (own.findings.iter().filter(|name| !stays(name)))
            .map(|(effect, at)| format!(", {effect} at {at} gone"))
            .collect();
        count.kept += usize::from(gone.is_empty());
        let name = case.concealed.name();
        let word = if is_right { "named" } else { "not named" };
        eprintln!("  {number}: {name} at {} of {}: {word}{}", case.command, set.name, gone.concat());
    }
    let mut table =
        Table::new(&["concealed", "times the held-out error", "named with its joint", "own findings stay"]);
    for ((name, above), Count { right, kept, of }) in &counts {
        let times = if *above { "2 and more" } else { "0.5 to 2" };
        table.row(&[
            format!("`{name}`"),
            times.into(),
            format!("{right} of {of}"),
            format!("{kept} of {of}"),
        ]);
    }
    Ok(table.after(&format!(
        "{DRAWS} draws of joint, effect and size on the arms; in {taken_in} of them geometry takes in whatever is drawn. Size: what geometry \
         does not take in of it, over the error on stretches left out. Own findings are what the recordings say before anything is put in."
    )))
}
