//! Residuals of thinned recordings at their optimum, and how they answer to the frame of their set-up and to each command.

use super::thinned::Thinned;
use crate::error::Result;
use crate::identify::{CalibrateOptions, Evaluator, Moment, Plausibility, by_commands, optimum};
use crate::machine::Machine;
use crate::recording::Recording;
use crate::units::ByQuantity;

/// Residuals beyond so many times the size that three quarters stay below count no more than that size.
const FAR: f64 = 3.0;

/// One sample at the optimum; everything over the size that three quarters of the residuals of its kind stay below.
#[derive(Clone, Debug)]
pub(super) struct Seen {
    /// The recording, and the place of the sample in it.
    pub recording: usize,
    pub place: usize,
    pub residuals: Vec<f64>,
    /// By reading, how it answers to a small twist of frame `w`, m and rad.
    pub by_frame: Vec<[f64; 6]>,
    /// By command, its way from the row before, m or rad, or that a second where the recording has a clock.
    pub way: Vec<f64>,
    /// By reading, how it answers to each command, per m or rad.
    pub by_command: Vec<Vec<f64>>,
}

/// Thinned recordings at their optimum.
pub(super) struct Rows {
    pub thinned: Vec<Thinned>,
    pub plausibility: Vec<Plausibility>,
    pub seen: Vec<Seen>,
}

impl Rows {
    /// Calibrates on thinned recordings.
    pub fn of(machine: &Machine, recordings: &[Recording], progress: &dyn Fn(&str)) -> Result<Rows> {
        let thinned = recordings.iter().map(Thinned::of).collect::<Result<Vec<_>>>()?;
        let read = thinned.iter().map(|t| t.recording(machine)).collect::<Result<Vec<_>>>()?;
        let found = optimum(machine, &read, CalibrateOptions::default(), progress)?;
        let (w, dyads) = (machine.w_index(), machine.dyads().len());
        let mut seen = Vec::new();
        for (index, source) in found.sources.all.iter().enumerate().filter(|(_, s)| s.sees_frames()) {
            let evaluator = Evaluator::new(machine, &found.unknowns, source);
            let (mut work, width) = (evaluator.workspace(), evaluator.width());
            let count = source.sensor.reading_count();
            let mut rows = vec![0.0; count * width];
            let first = seen.len();
            let before = thinned[index].neighbours(-1);
            for (place, (sample, before)) in thinned[index].samples.iter().zip(before).enumerate() {
                let since = sample.time.zip(before.time).map_or(1.0, |(now, then)| now - then);
                let ways = sample.commands.iter().zip(&before.commands);
                let (q, values) = (&sample.commands, &sample.values);
                let residuals = evaluator.residuals(q, values, Moment::Still, &mut work, Some(&mut rows));
                let row = |i: usize| &rows[i * width..i * width + 6 * dyads];
                seen.push(Seen {
                    recording: index,
                    place,
                    way: ways.map(|(q, before)| (q - before) / since.max(f64::MIN_POSITIVE)).collect(),
                    residuals: residuals[..count].to_vec(),
                    by_frame: (0..count).map(|i| std::array::from_fn(|k| row(i)[6 * w + k])).collect(),
                    by_command: (0..count).map(|i| by_commands(machine, row(i))).collect(),
                });
            }
            let mut sizes = ByQuantity::<Vec<f64>>::default();
            for sample in &seen[first..] {
                let all = sample.residuals.iter().enumerate();
                all.for_each(|(i, r)| sizes[source.quantity(machine, i)].push(r.abs()));
            }
            let scales = sizes.map(|mut sizes| {
                sizes.sort_by(f64::total_cmp);
                let of = (3 * sizes.len().saturating_sub(1)) / 4;
                sizes.get(of).copied().unwrap_or(1.0).max(f64::MIN_POSITIVE)
            });
            for sample in &mut seen[first..] {
                for i in 0..count {
                    let scale = scales[source.quantity(machine, i)];
                    sample.residuals[i] = (sample.residuals[i] / scale).clamp(-FAR, FAR);
                    sample.by_frame[i].iter_mut().for_each(|x| *x /= scale);
                    sample.by_command[i].iter_mut().for_each(|x| *x /= scale);
                }
            }
        }
        Ok(Rows { thinned, plausibility: found.fit.plausibility, seen })
    }
}
