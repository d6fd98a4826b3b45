//! By what a trace is told, in words.

use std::f64::consts::TAU;

use super::trace::Trace;

/// Parts of a turn that are looked at.
const BINS: usize = 180;

/// How the senses compare, which figure it is, where it jumps.
pub fn of(trace: &Trace) -> String {
    if !trace.is_polar() {
        let pairs = both(trace, |at| (((at + 150.0) / 300.0 * BINS as f64) as usize).min(BINS - 1));
        return sentence(vec![senses(&pairs).to_string()]);
    }
    let bin = |at: f64| ((at.rem_euclid(TAU) / TAU * BINS as f64) as usize).min(BINS - 1);
    let pairs = both(trace, bin);
    let mut parts = vec![senses(&pairs).to_string()];
    let one: Vec<f64> = pairs.iter().map(|(there, _)| *there).collect();
    parts.extend(figure(&one));
    let jumps = jumps(trace);
    if !jumps.is_empty() {
        let places: Vec<String> = jumps.iter().map(|at| format!("{at}°")).collect();
        parts.push(format!("jumps at {}", places.join(", ")));
    }
    if trace.passes().len() > 2 {
        parts.push("passes differ".into());
        if growth(trace) {
            parts.last_mut().expect("it was pushed").push_str(", each more than the one before");
        }
    }
    sentence(parts)
}

fn sentence(parts: Vec<String>) -> String {
    let text = parts.join("; ");
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", letters.as_str())
}

/// Readings of the first pass in each sense by place; places that one of them has not are left out.
fn both(trace: &Trace, bin: impl Fn(f64) -> usize) -> Vec<(f64, f64)> {
    let mut sums = vec![[(0.0, 0u32); 2]; BINS];
    let passes = trace.passes();
    for positive in [true, false] {
        let Some((_, points)) = passes.iter().find(|(way, _)| *way == positive) else { continue };
        for (at, reading) in points {
            let cell = &mut sums[bin(*at)][usize::from(!positive)];
            *cell = (cell.0 + reading, cell.1 + 1);
        }
    }
    let mean = |(sum, n): (f64, u32)| sum / f64::from(n.max(1));
    sums.iter()
        .filter(|cell| cell[0].1 > 0 && cell[1].1 > 0)
        .map(|cell| (mean(cell[0]), mean(cell[1])))
        .collect()
}

fn senses(pairs: &[(f64, f64)]) -> &'static str {
    let sum = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / pairs.len().max(1) as f64;
    let (same, opposite) = (sum(&|(a, b)| (a - b).powi(2)), sum(&|(a, b)| (a + b).powi(2)));
    let size = sum(&|(a, b)| a * a + b * b).max(1e-30);
    if same < 0.1 * size {
        "the same in both senses"
    } else if opposite < 0.1 * size {
        "opposite in the two senses"
    } else {
        "different in the two senses"
    }
}

/// What most of it is by its harmonics.
fn figure(values: &[f64]) -> Option<String> {
    let n = values.len();
    let power = |order: usize| {
        let (mut c, mut s) = (0.0, 0.0);
        for (k, x) in values.iter().enumerate() {
            let angle = TAU * order as f64 * (k as f64 + 0.5) / n as f64;
            c += x * angle.cos();
            s += x * angle.sin();
        }
        let scale = if order == 0 { 1.0 } else { 2.0 };
        scale * (c * c + s * s) / (n * n) as f64
    };
    let powers: Vec<f64> = (0..=40.min(n / 2)).map(power).collect();
    let all: f64 = values.iter().map(|x| x * x).sum::<f64>() / n as f64;
    let (order, most) = powers.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (most > 0.7 * all).then(|| match order {
        0 => "a circle of another size".to_string(),
        1 => "a circle about another centre".to_string(),
        2 => "an oval".to_string(),
        n => format!("{n} waves a turn"),
    })
}

/// Angles at which the trace jumps from one sample to the next, degrees.
fn jumps(trace: &Trace) -> Vec<i64> {
    let most = trace.readings.iter().fold(f64::NEG_INFINITY, |m, x| m.max(*x));
    let least = trace.readings.iter().fold(f64::INFINITY, |m, x| m.min(*x));
    let mut found: Vec<i64> = Vec::new();
    for (_, points) in trace.passes() {
        for pair in points.windows(2) {
            if (pair[1].1 - pair[0].1).abs() > 0.35 * (most - least) {
                let at = (0.5 * (pair[0].0 + pair[1].0)).rem_euclid(TAU).to_degrees().round() as i64 % 360;
                if found
                    .iter()
                    .all(|known| (known - at).rem_euclid(360).min((at - known).rem_euclid(360)) > 4)
                {
                    found.push(at);
                }
            }
        }
    }
    found.sort_unstable();
    if found.len() > 4 { Vec::new() } else { found }
}

/// Whether every pass lies farther off than the one before it in the same sense.
fn growth(trace: &Trace) -> bool {
    let passes = trace.passes();
    let size = |points: &[(f64, f64)]| points.iter().map(|(_, x)| x * x).sum::<f64>() / points.len() as f64;
    [true, false].iter().all(|sense| {
        let sizes: Vec<f64> = passes.iter().filter(|(way, _)| way == sense).map(|(_, p)| size(p)).collect();
        sizes.windows(2).all(|pair| pair[1] > 1.02 * pair[0])
    })
}
