//! One full pass: every row checked, ranges and counts taken.

use super::Recording;
use super::chunk::Chunk;
use super::column::Role;
use super::kept::Keeping;
use super::reader::Reading;
use super::rows::Parsed;
use super::summary::Summary;
use super::text::Fail;
use super::{RecordingFault as Fault, entry};
use crate::error::Result;
use crate::units::Unit;

/// A difference between a follower's column and its coupling that is worth a warning, m or rad.
const COUPLING_TOLERANCE: f64 = 1e-6;

/// A command that moves by no more than this stands still, m or rad.
const STANDSTILL: f64 = 1e-9;

/// Fewer samples do not show how a clock runs.
const STEADY: u64 = 30;

/// A gap in time longer than this many median steps is a pause.
const PAUSE_STEPS: f64 = 5.0;

/// Times between samples, counted in bins of 1/32 octave: median and pauses of any number of samples in bounded memory.
struct Steps {
    bins: Vec<u64>,
    count: u64,
}

impl Steps {
    const PER_OCTAVE: f64 = 32.0;
    /// 2^-40 s is the least step told from zero, 2^50 s the longest.
    const LEAST: f64 = -40.0 * Self::PER_OCTAVE;
    const BINS: usize = 90 * 32;

    fn new() -> Self {
        Steps { bins: vec![0; Self::BINS], count: 0 }
    }

    fn bin(step: f64) -> usize {
        ((step.log2() * Self::PER_OCTAVE - Self::LEAST) as usize).min(Self::BINS - 1)
    }

    fn edge(bin: f64) -> f64 {
        ((bin + Self::LEAST) / Self::PER_OCTAVE).exp2()
    }

    fn take(&mut self, step: f64) {
        self.bins[Self::bin(step)] += 1;
        self.count += 1;
    }

    /// Median step, length of a pause, number of pauses.
    fn pauses(&self) -> Option<(f64, f64, u64)> {
        let mut below = 0;
        let median = self.bins.iter().position(|count| {
            below += count;
            2 * below >= self.count && below > 0
        })?;
        let median = Self::edge(median as f64 + 0.5);
        let first = Self::bin(PAUSE_STEPS * median) + 1;
        let pauses = self.bins.get(first..).map_or(0, |bins| bins.iter().sum());
        Some((median, Self::edge(first as f64), pauses))
    }
}

/// What pieces of a recording add up to.
struct Counts {
    rows: u64,
    samples: u64,
    dropped: u64,
    drops: Vec<u64>,
    worst: Vec<(f64, u64)>,
    ranges: Vec<(f64, f64)>,
    time: Option<(f64, f64)>,
    steps: Steps,
    /// The longest step and the line behind it.
    longest: (f64, u64),
}

impl Counts {
    fn none(recording: &Recording) -> Self {
        Counts {
            rows: 0,
            samples: 0,
            dropped: 0,
            drops: vec![0; recording.layout.columns.len()],
            worst: vec![(0.0, 0); recording.layout.followers.len()],
            ranges: vec![(f64::INFINITY, f64::NEG_INFINITY); recording.fixed.len()],
            time: None,
            steps: Steps::new(),
            longest: (0.0, 0),
        }
    }

    fn take(&mut self, parsed: &Parsed) {
        self.rows += parsed.rows_read;
        self.drops.iter_mut().zip(&parsed.drops).for_each(|(sum, own)| *sum += own);
        for (worst, own) in self.worst.iter_mut().zip(&parsed.worst) {
            if own.0 > worst.0 {
                *worst = *own;
            }
        }
        for Chunk { len, lines, time, commands, dropped, .. } in &parsed.chunks {
            self.samples += *len as u64;
            self.dropped += dropped;
            for row in commands.chunks_exact(self.ranges.len()) {
                for (range, value) in self.ranges.iter_mut().zip(row) {
                    *range = (range.0.min(*value), range.1.max(*value));
                }
            }
            for (t, line) in time.iter().flatten().copied().zip(lines.iter().copied()) {
                let (first, last) = self.time.unwrap_or((t, t));
                if t > last {
                    self.steps.take(t - last);
                    if t - last > self.longest.0 {
                        self.longest = (t - last, line);
                    }
                }
                self.time = Some((first, t));
            }
        }
    }
}

/// Every chunk goes to `keeping`, while those behind it are read.
pub(super) fn scan(recording: &Recording, keeping: &mut Keeping) -> Result<Summary> {
    let mut counts = Counts::none(recording);
    let mut reading = Reading::start(recording, false)?;
    let mut present = reading.batch();
    while !present.is_empty() {
        let take = || {
            present.into_iter().try_for_each(|parsed| {
                let parsed = parsed?;
                counts.take(&parsed);
                parsed.chunks.into_iter().try_for_each(|chunk| keeping.take(chunk))
            })
        };
        let (next, taken) = rayon::join(|| reading.batch(), take);
        taken?;
        present = next;
    }
    let Counts { rows, samples, dropped, drops, worst, ranges, time, steps, longest } = counts;
    if rows == 0 {
        return Err(recording.error(Fail::at(0, 0, Fault::NoRows)));
    }
    if samples == 0 {
        let (column, count) =
            drops.iter().enumerate().max_by_key(|(i, n)| (**n, usize::MAX - i)).unwrap_or((0, &0));
        let column = recording.layout.columns[column].name.clone();
        return Err(recording.error(Fail::at(0, 0, Fault::AllDropped { rows, column, count: *count })));
    }
    let mut warnings = recording.warnings.clone();
    warn_of_couplings(recording, &worst, &mut warnings);
    warn_of_travel(recording, &ranges, &mut warnings);
    let moving: Vec<bool> = ranges.iter().map(|(from, to)| to - from > STANDSTILL).collect();
    if !moving.contains(&true) {
        warnings.push("no joint moves in this recording".into());
    }
    let (step, pause_after, pauses) = match steps.pauses() {
        Some((step, pause, count)) => (Some(step), Some(pause), count),
        None => (None, None, 0),
    };
    if pauses > 0 && samples >= STEADY {
        warn_of_jump(longest, time, &mut warnings);
    }
    Ok(Summary {
        rows,
        samples,
        dropped,
        commands: ranges,
        moving,
        time,
        step,
        pause_after,
        pauses,
        warnings,
    })
}

/// A pause longer than all the rest of the recording may be none: whatever drifts with time hangs on it alone.
fn warn_of_jump((step, line): (f64, u64), time: Option<(f64, f64)>, warnings: &mut Vec<String>) {
    let Some((first, last)) = time else { return };
    let rest = last - first - step;
    if step > rest {
        warnings.push(format!(
            "`t` jumps by {} s at line {line}, and runs for {} s in all the rest: a long pause, or a clock that was set",
            brief(step),
            brief(rest)
        ));
    }
}

fn warn_of_couplings(recording: &Recording, worst: &[(f64, u64)], warnings: &mut Vec<String>) {
    for ((column, _), (difference, line)) in recording.layout.followers.iter().zip(worst) {
        if *difference > COUPLING_TOLERANCE {
            let column = &recording.layout.columns[*column];
            let (name, value) = (&column.name, brief(column.unit.from_si(*difference)));
            let unit = column.unit;
            warnings.push(format!(
                "column `{name}` differs by up to {value} {unit} from what the machine's couplings give (line {line}); the couplings are used"
            ));
        }
    }
}

fn warn_of_travel(recording: &Recording, ranges: &[(f64, f64)], warnings: &mut Vec<String>) {
    for (c, (from, to)) in ranges.iter().enumerate() {
        let joint = recording.machine.command_joint(c);
        let Some((least, most)) = joint.travel else { continue };
        let slack = 1e-6 * (most - least);
        if *from >= least - slack && *to <= most + slack {
            continue;
        }
        let written = recording.layout.columns.iter().find(|column| column.role == Role::Command(c));
        let example = || Unit::named(entry::example_unit(joint.kind.quantity()));
        let Some(unit) = written.map(|column| column.unit).or_else(example) else { continue };
        let shown = |value: f64| brief(unit.from_si(value));
        warnings.push(format!(
            "joint \"{}\" is commanded from {} to {} {unit}, beyond its travel from {} to {} {unit}",
            joint.name,
            shown(*from),
            shown(*to),
            shown(least),
            shown(most),
        ));
    }
}

/// A number with at most six decimals.
fn brief(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_of_many_median_steps_is_a_pause() {
        let mut steps = Steps::new();
        assert_eq!(steps.pauses(), None);
        for step in [1e-3, 1e-3, 1e-3, 1.1e-3, 0.9e-3, 0.9e-3, 4e-3, 5.5e-3, 60.0] {
            steps.take(step);
        }
        let (median, pause, count) = steps.pauses().expect("steps");
        assert!((median - 1e-3).abs() < 0.02 * 1e-3, "{median}");
        assert!((5e-3..5.2e-3).contains(&pause), "{pause}");
        assert_eq!(count, 2);
    }

    #[test]
    fn extreme_steps_do_not_leave_the_bins() {
        let mut steps = Steps::new();
        for step in [f64::MIN_POSITIVE, 1e15, 2e15] {
            steps.take(step);
        }
        assert!(steps.pauses().is_some());
    }
}
