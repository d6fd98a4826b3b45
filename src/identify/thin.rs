//! A thin selection of samples for what does not need all of them: alignment and robust scales.

use super::evaluator::{Evaluator, Moment};
use super::noise::Noise;
use super::replay::Spread;
use super::source::Sources;
use super::unknowns::Unknowns;
use crate::error::Result;
use crate::machine::Machine;
use crate::recording::Chunk;
use crate::units::ByQuantity;

/// No instrument resolves less, m or rad; without it, exact simulated data would have no noise at all.
pub(crate) const FINEST: f64 = 1e-9;
/// As many samples of one recording at most.
const MOST: u64 = 2000;

/// One sample.
pub(crate) struct Thin {
    pub source: usize,
    pub q: Vec<f64>,
    pub values: Vec<f64>,
}

/// Evenly spread samples of every recording.
pub(crate) fn thin(machine: &Machine, sources: &Sources) -> Result<Vec<Thin>> {
    if let Some(replay) = &sources.replay {
        let of = |(source, own): (usize, &Spread)| {
            let thin = own.iter().cloned().map(|(q, values)| Thin { source, q, values });
            thin.collect::<Vec<_>>()
        };
        return Ok(replay.thin.iter().enumerate().flat_map(of).collect());
    }
    let commands = machine.commands().len();
    let mut all = Vec::new();
    let mut take = |source: usize, chunk: &Chunk, k: usize| {
        let width = sources.all[source].recording.value_count();
        let (q, values) = (&chunk.commands[k * commands..], &chunk.values[k * width..]);
        all.push(Thin { source, q: q[..commands].to_vec(), values: values[..width].to_vec() });
    };
    let strides: Vec<u64> =
        sources.all.iter().map(|source| source.summary.samples.div_ceil(MOST).max(1)).collect();
    if sources.is_plain() {
        sources.pass_few(
            |index, before, len| {
                let first = before.next_multiple_of(strides[index]) - before;
                (first..len as u64).step_by(strides[index] as usize).map(|k| k as usize).collect()
            },
            |_, stretch| stretch.chunk.clone(),
            |index, chunk| (0..chunk.len).for_each(|k| take(index, &chunk, k)),
        )?;
        return Ok(all);
    }
    let mut seen = vec![0u64; sources.all.len()];
    // The chunks come in order, so the running number of a sample is known when they are merged.
    sources.pass(
        |_, stretch| stretch.chunk.clone(),
        |index, chunk| {
            let is_one = |k: &usize| (seen[index] + *k as u64).is_multiple_of(strides[index]);
            (0..chunk.len).filter(is_one).for_each(|k| take(index, &chunk, k));
            seen[index] += chunk.len as u64;
        },
    )?;
    Ok(all)
}

/// Robust noise of each source from the median of its residuals; sources of one kind and stated `sigma` share it.
pub(crate) fn robust_noise(
    machine: &Machine,
    sources: &Sources,
    thin: &[Thin],
    unknowns: &Unknowns,
) -> Vec<Noise> {
    let evaluators: Vec<_> = sources.all.iter().map(|s| Evaluator::new(machine, unknowns, s)).collect();
    let kinds: Vec<_> = sources.all.iter().map(|s| s.noise_group()).collect();
    let mut sizes: Vec<ByQuantity<Vec<f64>>> = sources.all.iter().map(|_| Default::default()).collect();
    for sample in thin {
        let (evaluator, source) = (&evaluators[sample.source], &sources.all[sample.source]);
        let mut work = evaluator.workspace();
        let residuals = evaluator.residuals(&sample.q, &sample.values, Moment::Still, &mut work, None);
        // The first source of this kind collects for all of them.
        let group = kinds.iter().position(|k| *k == kinds[sample.source]).unwrap_or(sample.source);
        for (i, r) in residuals.iter().take(source.sensor.reading_count()).enumerate() {
            sizes[group][source.quantity(machine, i)].push(r.abs());
        }
    }
    let scales: Vec<Noise> = sizes.into_iter().map(|group| group.map(median_scale)).collect();
    kinds
        .iter()
        .map(|kind| {
            let group = kinds.iter().position(|k| k == kind).unwrap_or(0);
            scales[group]
        })
        .collect()
}

/// 1.4826 times the median of absolute values, never zero.
fn median_scale(mut sizes: Vec<f64>) -> f64 {
    sizes.retain(|s| s.is_finite());
    if sizes.is_empty() {
        return 1.0;
    }
    sizes.sort_by(f64::total_cmp);
    (1.4826 * sizes[sizes.len() / 2]).max(FINEST)
}
