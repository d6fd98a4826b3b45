//! Models keyed on directions of travel, on the machine of the paper: on the path that was measured, and on others.

use kincal::feature::Feature;
use kincal::identify::{CalibrateOptions, ErrorModel, calibrate_model};
use kincal::inverse::{Goal, Inverse, InverseOptions as Limits, Mode};
use kincal::lie::{Pose, Twist};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::variation::{Directions, Part, Slot, Term, Varying};
use kincal::{CalibratedMachine, Chain, Machine};
use rand::SeedableRng;
use rand::rngs::StdRng;
use rayon::prelude::*;

use crate::outcome::{Outcome, given};
use crate::sets::{Data, machine};
use crate::table::{Table as Printed, median};
use crate::tilting_table::{Bar, Best, Body, Table, noisy, path, recording};

/// Tables of a figure.
const TABLES: u64 = 20;
/// Room for error motions where a model is to hold on other paths.
const ERROR_MOTIONS: f64 = 0.03;

type Path = Vec<Vec<f64>>;

fn body() -> Outcome<Body> {
    Body::new(machine("ac_table_tilting_paper")?)
}

/// A model under one of its names.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    NoFr,
    CFr,
    AcFr,
    Unified,
}

const KINDS: [(Kind, &str); 4] =
    [(Kind::NoFr, "No-FR"), (Kind::CFr, "C-FR"), (Kind::AcFr, "AC-FR"), (Kind::Unified, "unified")];

fn varying(body: &Body, kind: Kind) -> Varying {
    let keyed = |axes: Vec<usize>| Varying { directions: Some(Directions::new(axes)), terms: Vec::new() };
    match kind {
        Kind::NoFr => Varying::default(),
        Kind::CFr => keyed(vec![body.c]),
        Kind::AcFr => keyed(vec![body.a, body.c]),
        Kind::Unified => {
            let both = body.machine.joints().filter(|(_, joint)| ["a", "c"].contains(&joint.name.as_str()));
            let terms = both.map(|(dyad, joint)| {
                // The width is the coefficient.
                let feature = Feature::half_direction(dyad);
                let part = Part { slot: Slot::Before(dyad), direction: joint.twist(), feature };
                Term { parts: vec![part], scale: 1e-4, prior: false, of_setup: false }
            });
            Varying { directions: None, terms: terms.collect() }
        }
    }
}

fn identify(
    body: &Body,
    kind: Kind,
    recordings: &[Recording],
    samples: Option<u64>,
    error_motions: f64,
) -> Outcome<CalibratedMachine> {
    let model = ErrorModel::default().with_varying(varying(body, kind)).with_error_motions(error_motions);
    let model = samples.map_or(model.clone(), |samples| model.with_samples(samples));
    Ok(calibrate_model(&body.machine, recordings, &model, CalibrateOptions::default(), &|_| {})?.0)
}

/// Mean size of lengths minus model along a path, um.
fn error(body: &Body, model: &CalibratedMachine, path: &[Vec<f64>], lengths: &[f64]) -> Outcome<f64> {
    let found = predict(model, &recording(body, path, lengths, "judge.csv")?, None)?;
    Ok(1e6 * given(found.mean_abs.m, "distances")?)
}

/// Directions of travel of all commands along a path.
fn directions(path: &[Vec<f64>]) -> Vec<Vec<i8>> {
    let sign = |d: f64| if d > 0.0 { 1 } else { -1 };
    let first = |c: usize| path.iter().map(|q| q[c] - path[0][c]).find(|d| d.abs() > 1e-9).map_or(0, sign);
    let mut now: Vec<i8> = (0..path[0].len()).map(first).collect();
    let mut all = Vec::with_capacity(path.len());
    let mut last = &path[0];
    for q in path {
        for (c, now) in now.iter_mut().enumerate() {
            if (q[c] - last[c]).abs() > 1e-9 {
                *now = sign(q[c] - last[c]);
            }
        }
        last = q;
        all.push(now.clone());
    }
    all
}

/// The chain of the model in a pattern of directions at the commands `q`; its terms are play of axes that follow their own commands.
fn chain(model: &CalibratedMachine, directions: &[i8], q: &[f64]) -> Chain<f64> {
    let machine = model.machine();
    let variation = model.variation();
    let mut dh: Vec<Twist<f64>> = model.deviations().to_vec();
    if let Some(keyed) = &variation.varying.directions {
        let parts = variation.direction_part(keyed.piece(directions), dh.len());
        dh = dh.iter().zip(parts).map(|(a, b)| *a + b).collect();
    }
    variation.motions.add(machine, q, directions, &mut dh);
    for (term, coefficient) in variation.varying.terms.iter().zip(&variation.coefficients) {
        for part in &term.parts {
            let Slot::Before(dyad) = part.slot else { continue };
            let command = machine.drive(dyad).and_then(|drive| drive.terms.first().copied());
            let direction = command.map_or(0, |(c, _)| directions[c]);
            dh[dyad] = dh[dyad] + part.direction.times(0.5 * f64::from(direction) * coefficient);
        }
    }
    Chain::new(machine, &dh)
}

/// The path with every axis corrected by the model's inverse, the direction of travel choosing the piece.
fn corrected(model: &CalibratedMachine, path: &[Vec<f64>]) -> Path {
    let machine: &Machine = model.machine();
    let nominal = Chain::nominal(machine);
    let limits = Limits::default().with_within_travel(false);
    let inverse = Inverse::new(machine).with_mode(Mode::PositionAndAxis).with_options(limits);
    let free = vec![true; machine.commands().len()];
    (path.iter().zip(directions(path)))
        .map(|(q, directions)| {
            let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: nominal.w_from_t(q) };
            inverse.solve(&chain(model, &directions, q), &goal, q, &free).commands
        })
        .collect()
}

fn largest(lengths: &[f64], nominal: f64) -> f64 {
    lengths.iter().map(|length| (length - nominal).abs()).fold(0.0, f64::max)
}

/// Of every table the figures of every model, in parallel and in the order of the tables.
fn of_tables<T: Send>(first: u64, one: impl Fn(u64) -> Outcome<T> + Sync + Send) -> Outcome<Vec<T>> {
    (first..first + TABLES).into_par_iter().map(one).collect()
}

pub fn measured_path(_: &Data) -> Outcome<String> {
    let body = body()?;
    let lengths = [0.1, 0.15];
    let paths = lengths.map(|length| path(&body, length, Bar::Machine, None, 600));
    // By model: prediction error, um; fall of the largest distance variation with each bar, per cent.
    let one = |seed: u64| -> Outcome<[[f64; 3]; 4]> {
        let mut rng = StdRng::seed_from_u64(7000 + seed);
        let table = Table::random(&body, seed);
        let mut of_run = StdRng::seed_from_u64(1000 + seed);
        let learnt = noisy(table.lengths(&body, &paths[0]), &mut of_run);
        let recordings = [recording(&body, &paths[0], &learnt, "path.csv")?];
        let readings = noisy(table.lengths(&body, &paths[0]), &mut rng);
        let mut figures = [[0.0; 3]; 4];
        for (figures, (kind, _)) in figures.iter_mut().zip(KINDS) {
            let samples = (kind != Kind::Unified).then_some(100);
            let model = identify(&body, kind, &recordings, samples, 0.0)?;
            figures[0] = error(&body, &model, &paths[0], &readings)?;
            for (figure, (path, length)) in figures[1..].iter_mut().zip(paths.iter().zip(lengths)) {
                let before = largest(&noisy(table.lengths(&body, path), &mut rng), length);
                let after = largest(&noisy(table.lengths(&body, &corrected(&model, path)), &mut rng), length);
                *figure = 100.0 * (1.0 - after / before);
            }
        }
        Ok(figures)
    };
    let all = of_tables(0, one)?;
    let mut printed =
        Printed::new(&["model", "prediction error, um", "fall at 100 mm, %", "fall at 150 mm, %"]);
    for (i, (_, name)) in KINDS.iter().enumerate() {
        let of = |k: usize| median(all.iter().map(|figures| figures[i][k]).collect());
        printed.row(&[
            name.to_string(),
            format!("{:.2}", of(0)),
            format!("{:.1}", of(1)),
            format!("{:.1}", of(2)),
        ]);
    }
    Ok(printed.after(&format!(
        "The machine of the paper, {TABLES} tables drawn at random, medians. Location errors 50 um and 100 urad; play of A 60 (1 + 0.4 cos A) \
         and of C 40 urad, each spread by a fifth; the table's weight 20 urad sin A; error motions of all five axes that no model here has; \
         noise 1 um. Prediction error: mean size of measured minus model on a second run, noise included. Fall: of the largest variation of \
         the distance, by the inverse of the model, identified at 100 mm. Unified: one model with two plays as terms, on all samples; the \
         others use 100 samples of each piece."
    )))
}

fn degrees(a: f64) -> f64 {
    a.to_radians()
}

/// Five paths that are judged, with what they are.
fn judged(body: &Body) -> [(&'static str, Path); 5] {
    let run = |length, bar, angles: fn(f64) -> (f64, f64)| path(body, length, bar, Some(angles), 180);
    let twice: fn(f64) -> (f64, f64) = |phi| (degrees(45.0 + 30.0 * (2.0 * phi).cos()), phi);
    let (on_machine, on_table) = (Bar::Machine, Bar::Table);
    [
        ("A = 45° + 30° cos 2C, bar as the machine's axes", run(0.1, on_machine, twice)),
        ("the same, bar as the table", run(0.1, on_table, twice)),
        (
            "A = 40° + 30° sin φ, C = 2φ",
            run(0.1, on_machine, |phi| (degrees(40.0 + 30.0 * phi.sin()), 2.0 * phi)),
        ),
        (
            "A = 25° + 20° cos 3C, 150 mm",
            run(0.15, on_table, |phi| (degrees(25.0 + 20.0 * (3.0 * phi).cos()), phi)),
        ),
        (
            "A = 45° - 30° cos φ, C back and uneven, 150 mm",
            run(0.15, on_machine, |phi| (degrees(45.0 - 30.0 * phi.cos()), 0.5 * (2.0 * phi).sin() - phi)),
        ),
    ]
}

/// Plans of measurement, three paths each; the first is the one that docs/directions.md recommends.
fn measured(body: &Body) -> [(&'static str, [Path; 3]); 5] {
    let run = |length, bar, angles: Option<fn(f64) -> (f64, f64)>| path(body, length, bar, angles, 180);
    let (m, t) = (Bar::Machine, Bar::Table);
    let paper = run(0.1, m, None);
    let tilted = |bar| run(0.1, bar, Some(|phi| (degrees(45.0 + 10.0 * phi.cos()), phi)));
    let swung = || run(0.1, m, Some(|phi| (degrees(45.0 + 30.0 * phi.sin()), phi)));
    [
        ("paper, cone on the table, A = 45° + 30° sin C", [paper.clone(), run(0.1, t, None), swung()]),
        ("paper, paper at 150 mm, A = 45° + 10° cos C", [paper.clone(), run(0.15, m, None), tilted(m)]),
        ("paper, cone on the table, paper at 150 mm", [paper.clone(), run(0.1, t, None), run(0.15, m, None)]),
        ("paper, A = 45° + 10° cos C, A = 45° + 30° sin C", [paper, tilted(m), swung()]),
        (
            "cones on the table at 100 and 150 mm, A = 45° + 10° cos C",
            [run(0.1, t, None), tilted(t), run(0.15, t, None)],
        ),
    ]
}

/// Errors of one table on one path, um.
#[derive(Clone, Copy, Default)]
struct Errors {
    pieces: f64,
    unified: f64,
    without_room: f64,
    best: f64,
}

impl Errors {
    fn with(self, other: Errors) -> Errors {
        Errors {
            pieces: self.pieces + other.pieces,
            unified: self.unified + other.unified,
            without_room: self.without_room + other.without_room,
            best: self.best + other.best,
        }
    }

    fn sum(all: impl IntoIterator<Item = Errors>) -> Errors {
        all.into_iter().fold(Errors::default(), Errors::with)
    }
}

/// What is learnt from three paths, judged on others.
struct Elsewhere {
    /// Of the best estimator by path, um.
    expected: Vec<f64>,
    /// By table and path.
    errors: Vec<Vec<Errors>>,
}

impl Elsewhere {
    fn new(body: &Body, trained: &[Path], unseen: &[&Path], first: u64) -> Outcome<Self> {
        let best = Best::new(body, &trained.iter().map(Vec::as_slice).collect::<Vec<_>>())?;
        let expected = unseen.iter().map(|path| 1e6 * best.expected_error(body, path)).collect();
        let one = |seed: u64| -> Outcome<Vec<Errors>> {
            let table = Table::random(body, seed);
            let (mut recordings, mut readings) = (Vec::new(), Vec::new());
            for (i, path) in trained.iter().enumerate() {
                let mut rng = StdRng::seed_from_u64(100 + 10 * seed + i as u64);
                let lengths = noisy(table.lengths(body, path), &mut rng);
                recordings.push(recording(body, path, &lengths, &format!("{i}.csv"))?);
                readings.extend(lengths);
            }
            let guess = best.table(body, &readings);
            let pieces = identify(body, Kind::AcFr, &recordings, None, ERROR_MOTIONS)?;
            let unified = identify(body, Kind::Unified, &recordings, None, ERROR_MOTIONS)?;
            let without_room = identify(body, Kind::Unified, &recordings, None, 0.0)?;
            let on = |path: &&Path| -> Outcome<Errors> {
                let truth = table.lengths(body, path);
                let of = |model| error(body, model, path, &truth);
                let off = guess.lengths(body, path).into_iter().zip(&truth).map(|(a, b)| (a - b).abs());
                Ok(Errors {
                    pieces: of(&pieces)?,
                    unified: of(&unified)?,
                    without_room: of(&without_room)?,
                    best: 1e6 * off.sum::<f64>() / truth.len() as f64,
                })
            };
            unseen.iter().map(on).collect()
        };
        Ok(Elsewhere { expected, errors: of_tables(first, one)? })
    }

    /// Mean of a path over the tables.
    fn of_path(&self, path: usize) -> Errors {
        Errors::sum(self.errors.iter().map(|of| of[path]))
    }

    /// The columns of [`RATIOS`].
    fn ratios(&self) -> [String; 4] {
        let all = Errors::sum(self.errors.iter().flatten().copied());
        let by_table = self.errors.iter().map(|of| {
            let sum = Errors::sum(of.iter().copied());
            sum.pieces / sum.unified
        });
        let by_table: Vec<f64> = by_table.collect();
        let worst = by_table.iter().copied().fold(0.0, f64::max);
        [
            format!("{:.3}", all.pieces / all.best),
            format!("{:.3}", all.unified / all.best),
            format!("{:.3}", all.without_room / all.best),
            format!("{:.4}, {worst:.3}", median(by_table)),
        ]
    }
}

const RATIOS: [&str; 4] = ["AC-FR", "unified", "without room", "AC-FR against unified: median, worst"];

pub fn unseen_paths(_: &Data) -> Outcome<String> {
    let body = body()?;
    let [(plan, trained), ..] = measured(&body);
    let judged = judged(&body);
    let found = Elsewhere::new(&body, &trained, &judged.each_ref().map(|(_, path)| path), 0)?;
    let mut by_path =
        Printed::new(&["path", "AC-FR, um", "unified, um", "best, um", "expected of the best, um"]);
    for (i, (name, _)) in judged.iter().enumerate() {
        let Errors { pieces, unified, best, .. } = found.of_path(i);
        let mean = [pieces, unified, best].map(|sum| format!("{:.2}", sum / TABLES as f64));
        let [pieces, unified, best] = mean;
        by_path.row(&[name.to_string(), pieces, unified, best, format!("{:.2}", found.expected[i])]);
    }
    let mut over_all = Printed::new(&RATIOS);
    over_all.row(&found.ratios());
    let by_path = by_path.after(&format!(
        "Measured: {plan}. The same machine and tables as in the section before, `--error-motions {ERROR_MOTIONS}`; mean error over {TABLES} \
         tables against the truth without noise. Best: the posterior mean of a linear estimator that knows the law by which tables are \
         drawn, the shape of all that the models lack included; expected: its error over all tables of that law."
    ));
    let over_all = over_all.after("All five paths together, error over that of the best on the same tables:");
    Ok(format!("{by_path}\n{over_all}"))
}

pub fn plans(_: &Data) -> Outcome<String> {
    let body = body()?;
    let judged = judged(&body);
    let unseen = judged.each_ref().map(|(_, path)| path);
    let mut printed =
        Printed::new(&[&["measured", "expected of the best, um", "tables from"][..], &RATIOS].concat());
    for (plan, trained) in measured(&body) {
        for first in [0, 1000, 2000] {
            let found = Elsewhere::new(&body, &trained, &unseen, first)?;
            let expected = found.expected.iter().sum::<f64>() / found.expected.len() as f64;
            let row = [plan.to_string(), format!("{expected:.2}"), first.to_string()];
            printed.row(&[row.as_slice(), &found.ratios()].concat());
        }
    }
    Ok(printed.after(
        "Error over that of the best estimator on the five paths of the section before, after three paths that were measured. Without room: \
         unified, no error motions.",
    ))
}

pub fn three_of_five(_: &Data) -> Outcome<String> {
    let body = body()?;
    let all = judged(&body);
    let mut printed = Printed::new(&[&["judged on"][..], &RATIOS].concat());
    for first in 0..all.len() {
        for second in first + 1..all.len() {
            let rest = (0..all.len()).filter(|k| *k != first && *k != second);
            let trained: Vec<Path> = rest.map(|k| all[k].1.clone()).collect();
            let found = Elsewhere::new(&body, &trained, &[&all[first].1, &all[second].1], 1000)?;
            let row = [format!("{}, {}", first + 1, second + 1)];
            printed.row(&[row.as_slice(), &found.ratios()].concat());
        }
    }
    Ok(printed.after(
        "Of the five paths two sections before, by number, three are measured and two judged. Error over that of the best estimator.",
    ))
}
