//! What others do, in the same harness: effects one at a time ranked by share, stepwise by BIC, LASSO.
//!
//! They know the harness's own textbook, so their figures are an upper bound of what such methods can reach.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;
use std::time::Instant;

use nalgebra::DVector;

use super::body::{Body, Errors, Rigid};
use super::effect::Place;
use super::path::Run;
use super::textbook::{self, Hints};
use super::track::Track;
use super::verdict::{CaseFiles, Diagnoser, Finding, Verdict};
use super::world::{Answers, Instrument, World};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Baseline {
    /// Every effect as if it acted alone, ranked by its share, as ball-bar software does.
    Ranked,
    /// Forward by BIC with chi-squared arithmetic.
    Stepwise,
    /// L1 over all columns at their best nonlinear parameters, strength by BIC.
    Lasso,
}

impl Diagnoser for Baseline {
    fn name(&self) -> String {
        match self {
            Baseline::Ranked => "one at a time, by share",
            Baseline::Stepwise => "stepwise, BIC",
            Baseline::Lasso => "LASSO, BIC",
        }
        .into()
    }

    fn diagnose(&self, case: &CaseFiles) -> Result<Verdict, String> {
        let started = Instant::now();
        let (world, readings) = open(case)?;
        let n = world.track.recorded;
        let stride = (n * world.width()).div_ceil(1500).max(1);
        // Steps of uneven length, so that no period is aliased.
        let samples: Vec<usize> =
            (0..n).step_by(stride).map(|k| (k + (k * k / 7) % stride).min(n - 1)).collect();
        let mut answers = Answers::of(&world, samples);
        let none = Errors::none(world.body.links.len());
        let mut y = DVector::zeros(answers.rows());
        for (i, k) in answers.samples.iter().enumerate() {
            let (model, tool) = world.measure(*k, &none);
            for (r, value) in misfit(&world, &readings[*k], &model, &tool).into_iter().enumerate() {
                y[i * world.width() + r] = value;
            }
        }
        let y = answers.beyond_geometry(&y);
        let hints = Hints { frequencies: loudest(&world, &answers, &y), ..Hints::default() };
        let findings = match self {
            Baseline::Ranked => ranked(&answers, &y, &hints),
            Baseline::Stepwise => stepwise(&mut answers, y, &hints),
            Baseline::Lasso => lasso(&answers, &y, &hints),
        };
        let findings = findings.into_iter().map(|(name, place, probability)| Finding {
            effect: name.into(),
            at: at(&world.body, place),
            probability,
            coefficients: vec![],
            confusable: vec![],
        });
        Ok(Verdict {
            findings: findings.collect(),
            seconds: started.elapsed().as_secs_f64(),
            samples: n as f64,
            ..Verdict::default()
        })
    }
}

type Named = (&'static str, Place, f64);

fn ranked(answers: &Answers, y: &DVector<f64>, hints: &Hints) -> Vec<Named> {
    let all = textbook::shares(answers, y, hints);
    all.into_iter().filter(|s| s.share > 0.1).map(|s| (s.name, s.place, s.share)).collect()
}

fn stepwise(answers: &mut Answers, mut y: DVector<f64>, hints: &Hints) -> Vec<Named> {
    let n = y.len() as f64;
    let mut found = Vec::new();
    while found.len() < 8 {
        let ranked = textbook::ranked(answers, &y, hints);
        let bic = |share: f64, count: usize| n * (1.0 - share).max(1e-12).ln() + (count + 1) as f64 * n.ln();
        let best = ranked
            .into_iter()
            .map(|(s, columns)| (bic(s.share, columns.len()), s, columns))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((bic, share, columns)) = best else { break };
        if bic >= 0.0 {
            break;
        }
        found.push((share.name, share.place, 1.0 - (bic / 2.0).exp()));
        answers.absorb(&columns);
        y = answers.beyond_geometry(&y);
    }
    found
}

fn lasso(answers: &Answers, y: &DVector<f64>, hints: &Hints) -> Vec<Named> {
    let mut columns = Vec::new();
    let mut owners = Vec::new();
    for (share, own) in textbook::ranked(answers, y, hints) {
        for column in own {
            let beyond = answers.beyond_geometry(&column);
            if beyond.norm() > 1e-6 * column.norm() {
                columns.push(&beyond / beyond.norm());
                owners.push((share.name, share.place));
            }
        }
    }
    let n = y.len() as f64;
    let strongest = columns.iter().map(|c| c.dot(y).abs()).fold(0.0, f64::max);
    let mut weights = vec![0.0; columns.len()];
    let mut rest = y.clone();
    let mut best: (f64, Vec<f64>) = (n * (y.norm_squared() / n).ln(), weights.clone());
    for step in 1..=25 {
        let lambda = strongest * 0.8f64.powi(step);
        for _ in 0..60 {
            let mut moved: f64 = 0.0;
            for (column, w) in columns.iter().zip(&mut weights) {
                let pull = column.dot(&rest) + *w;
                let new = pull.signum() * (pull.abs() - lambda).max(0.0);
                if new != *w {
                    rest.axpy(*w - new, column, 1.0);
                    moved = moved.max((new - *w).abs());
                    *w = new;
                }
            }
            if moved < 1e-3 * lambda {
                break;
            }
        }
        let active = weights.iter().filter(|w| **w != 0.0).count();
        let bic = n * (rest.norm_squared() / n).ln() + active as f64 * n.ln();
        if bic < best.0 {
            best = (bic, weights.clone());
        }
    }
    let mut energy: BTreeMap<String, (Named, f64)> = BTreeMap::new();
    for (w, (name, place)) in best.1.iter().zip(owners).filter(|(w, _)| **w != 0.0) {
        let slot = energy.entry(format!("{name} {place:?}")).or_insert(((name, place, 0.9), 0.0));
        slot.1 += w * w;
    }
    let mut found: Vec<(Named, f64)> = energy.into_values().collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.into_iter().map(|f| f.0).collect()
}

fn at(body: &Body, place: Place) -> String {
    match place {
        Place::Joint(j) => body.links[j].joint.as_ref().map_or_else(String::new, |a| a.name.clone()),
        Place::Frame(j) => body.links[j].frame.clone(),
        Place::Measurement => "measurement".into(),
    }
}

/// Measured minus model in units of the noise.
fn misfit(world: &World, reading: &[f64], model: &[f64], tool: &Rigid) -> Vec<f64> {
    let sigma = if world.reads_angle() { world.sigma.1 } else { world.sigma.0 };
    let mut out: Vec<f64> = reading.iter().zip(model).map(|(r, m)| (r - m) / sigma).collect();
    if let [.., w, x, y, z] = *reading
        && world.instrument == Instrument::Pose
    {
        let half = (x * x + y * y + z * z).sqrt();
        let angle = 2.0 * half.atan2(w) / half.max(1e-300);
        let measured = Rigid::turn([x * angle, y * angle, z * angle]);
        let plain = Rigid { p: [0.0; 3], ..*tool };
        out.truncate(3);
        out.extend(measured.then(&plain.inverse()).vector().map(|a| a / world.sigma.1));
    }
    out
}

/// The loudest frequencies of a misfit, Hz; none for settled positions.
fn loudest(world: &World, answers: &Answers, y: &DVector<f64>) -> Vec<f64> {
    let track = &world.track;
    if track.settled {
        return vec![];
    }
    let dt = track.time[1] - track.time[0];
    let step = 0.4 / track.seen_s();
    let count = ((0.4 / dt).min(25.0) / step) as usize;
    let width = world.width();
    let times: Vec<f64> = answers.samples.iter().map(|k| track.time[*k]).collect();
    let power = |f: f64| -> f64 {
        let mut sums = vec![(0.0, 0.0); width.min(3)];
        for (i, t) in times.iter().enumerate() {
            let (s, c) = (TAU * f * t).sin_cos();
            for (r, sum) in sums.iter_mut().enumerate() {
                sum.0 += s * y[i * width + r];
                sum.1 += c * y[i * width + r];
            }
        }
        sums.iter().map(|(a, b)| a * a + b * b).sum()
    };
    let mut all: Vec<(f64, f64)> =
        (1..=count).map(|i| i as f64 * step).filter(|f| *f > 0.5).map(|f| (power(f), f)).collect();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.truncate(5);
    all.into_iter().map(|p| p.1).collect()
}

/// Reads a case's recordings, as the harness writes them, into a world whose noise is guessed from fast changes.
fn open(case: &CaseFiles) -> Result<(World, Vec<Vec<f64>>), String> {
    let machine = kincal::Machine::open(&case.machine).map_err(|e| e.to_string())?;
    let body = Body::of(&machine);
    let mut runs = Vec::new();
    let mut readings = Vec::new();
    let mut header = BTreeMap::new();
    for file in &case.recordings {
        let (run, rows) = open_run(&body, file, &mut header)?;
        runs.push(run);
        readings.extend(rows);
    }
    // In place of the judge's path, which nobody may see.
    runs.push(Run { stated: runs[0].stated.as_ref().map(|_| vec![]), ..Run::default() });
    let gap = runs[0].time.get(1).unwrap_or(&1.0) - runs[0].time[0];
    runs[0].settled = gap > 0.5;
    let triple = |key: &str, per: f64| -> [f64; 3] {
        let numbers: Vec<f64> = header
            .get(key)
            .map_or(vec![], |v: &String| v.split(',').filter_map(|x| x.trim().parse().ok()).collect());
        if numbers.len() == 3 { [numbers[0] * per, numbers[1] * per, numbers[2] * per] } else { [0.0; 3] }
    };
    let joint = body.links.iter().position(|l| l.joint.is_some()).unwrap_or(0);
    let instrument = match header.get("measurement").map(String::as_str) {
        Some("position") => Instrument::Position,
        Some("pose") => Instrument::Pose,
        Some("displacement") => Instrument::Displacement(triple("direction", 1.0)),
        Some("joint") => Instrument::Joint(joint),
        _ => Instrument::Distance { absolute: !header.contains_key("nominal_length[mm]") },
    };
    let track = Track::of(&body, &runs);
    let (tool_point, workpiece_point) = (triple("tool_point[mm]", 1e-3), triple("workpiece_point[mm]", 1e-3));
    let mut world = World { body, instrument, tool_point, workpiece_point, sigma: (1.0, 1.0), runs, track };
    world.sigma = guess(&world, &readings);
    Ok((world, readings))
}

/// Noise from differences of neighbours where a path is passed through, else from poses' typical uncertainty.
fn guess(world: &World, readings: &[Vec<f64>]) -> (f64, f64) {
    if world.track.settled {
        return (1.7e-5, 4e-5);
    }
    let none = Errors::none(world.body.links.len());
    let model: Vec<f64> =
        (0..readings.len()).step_by(1).map(|k| readings[k][0] - world.measure(k, &none).0[0]).collect();
    let mut steps: Vec<f64> = model.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    steps.sort_by(f64::total_cmp);
    let sigma = (steps[steps.len() / 2] / 0.6745 / 6f64.sqrt()).max(1e-8);
    if world.instrument == Instrument::Pose { (sigma, 4e-5) } else { (sigma, sigma) }
}

fn open_run(
    body: &Body,
    file: &Path,
    header: &mut BTreeMap<String, String>,
) -> Result<(Run, Vec<Vec<f64>>), String> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next_if(|l| l.starts_with('#')) {
        if let Some((key, value)) = line.trim_start_matches('#').split_once(':') {
            header.insert(key.trim().into(), value.trim().into());
        }
    }
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let per = |name: &str| match name.split(['[', ']']).nth(1) {
        Some("mm") => 1e-3,
        Some("deg") => 1f64.to_radians(),
        _ => 1.0,
    };
    let column = |name: &str| names.iter().position(|n| n.split('[').next() == Some(name));
    let commands: Vec<usize> = body.commands.iter().filter_map(|c| column(c)).collect();
    let direction = column(&format!("{}_direction", body.commands[0]));
    let measured: Vec<usize> =
        (1..names.len()).filter(|i| !commands.contains(i) && Some(*i) != direction).collect();
    let mut run = Run::default();
    let mut readings = Vec::new();
    let mut stated = Vec::new();
    for line in lines {
        let row: Vec<f64> =
            line.split(',').zip(&names).map(|(x, n)| x.parse::<f64>().unwrap_or(f64::NAN) * per(n)).collect();
        if row.len() != names.len() || row.iter().any(|x| x.is_nan()) {
            continue;
        }
        run.time.push(row[0]);
        run.commands.push(commands.iter().map(|c| row[*c]).collect());
        readings.push(measured.iter().map(|c| row[*c]).collect());
        stated.extend(direction.map(|d| row[d]));
    }
    run.stated = direction.map(|_| stated);
    run.length = header.get("nominal_length[mm]").and_then(|l| l.parse::<f64>().ok()).unwrap_or(0.0) * 1e-3;
    let n = run.time.len();
    let dt = if n > 1 { run.time[1] - run.time[0] } else { 1.0 };
    run.settled = dt > 0.5;
    let zero = vec![0.0; body.commands.len()];
    for k in 0..n {
        // Over some samples each way, because commands are written with six decimals only.
        let (a, b) = (k.saturating_sub(4), (k + 4).min(n - 1));
        let whole = b - a == 8 && run.time[b] - run.time[a] < 8.5 * dt;
        let half = (run.time[b] - run.time[a]) / 2.0;
        let (qa, q, qb) = (&run.commands[a], &run.commands[k], &run.commands[b]);
        let each = |f: &dyn Fn(usize) -> f64| (0..q.len()).map(f).collect::<Vec<f64>>();
        run.velocity.push(if whole { each(&|c| (qb[c] - qa[c]) / (2.0 * half)) } else { zero.clone() });
        run.acceleration.push(if whole {
            each(&|c| (qb[c] - 2.0 * q[c] + qa[c]) / (half * half))
        } else {
            zero.clone()
        });
        run.after_pause.push(k == 0);
    }
    Ok((run, readings))
}
