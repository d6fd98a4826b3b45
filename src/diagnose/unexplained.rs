//! What no family explains: how large it is, where it fits best, and where it gathers.

use super::finding::Where;
use super::nameless::Gathering;
use super::search::Search;
use super::stretch::wheres;
use crate::machine::{JointKind, Machine};

/// So many rows in a row tell how large the misfit is around them.
const BLOCK: usize = 16;
/// Parts of a joint's travel.
const PARTS: usize = 24;
/// A stretch holds at least this part of the misfit, and so many times more of it than of the samples.
const HALF: f64 = 0.5;
const DENSE: f64 = 2.0;
/// A direction is told if it has this part of the misfit in the stretch.
const ONE_WAY: f64 = 0.85;
/// No more stretches are told.
const MOST: usize = 2;

/// Energy of the misfit in each row, in units of the noise's variance; `left`: whitened rows.
pub(super) fn energies(search: &Search, left: &[f64]) -> Vec<f64> {
    let mut energies = vec![0.0; left.len()];
    for block in search.runs.iter().flat_map(|run| run.chunks(BLOCK)) {
        let used: Vec<usize> = block.iter().copied().filter(|r| !search.rows.whitener.out[*r]).collect();
        let mean = used.iter().map(|r| left[*r] * left[*r]).sum::<f64>() / used.len().max(1) as f64;
        used.iter().for_each(|row| energies[*row] = (mean - 1.0).max(0.0));
    }
    energies
}

/// When it is there, and where on the travel of the joints.
pub(super) fn gathered(search: &Search, machine: &Machine, left: &[f64]) -> (Vec<Where>, Vec<Gathering>) {
    let energies = energies(search, left);
    let linear = search.rows.linear;
    let mut of_sample = vec![0.0; linear.lines.len()];
    energies.iter().zip(&linear.sample).for_each(|(e, sample)| of_sample[*sample] += e);
    let mut gatherings: Vec<Gathering> = (0..machine.dyads().len())
        .filter_map(|j| gathering(search, machine, j, &of_sample))
        .filter(|g| g.share_of_misfit > DENSE * g.share_of_samples)
        .collect();
    gatherings.sort_by(|a, b| {
        let dense = |g: &Gathering| g.share_of_misfit / g.share_of_samples;
        dense(b).total_cmp(&dense(a))
    });
    gatherings.truncate(MOST);
    (wheres(search, &|row| energies[row]), gatherings)
}

/// The shortest stretch of a joint's travel with half of the misfit.
fn gathering(search: &Search, machine: &Machine, j: usize, energies: &[f64]) -> Option<Gathering> {
    let joint = machine.dyads()[j].joint.as_ref()?;
    let mut points: Vec<(f64, f64, f64)> = Vec::new();
    for (samples, span) in search.rows.linear.samples.iter().zip(&search.rows.linear.spans) {
        let columns = samples.joints[j].as_ref()?;
        let here = columns.position.iter().zip(&columns.direction);
        points.extend(here.zip(&energies[span.samples.0..]).map(|((q, d), e)| (*q, *d, *e)));
    }
    let all: f64 = points.iter().map(|p| p.2).sum();
    let (low, high) =
        points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.0), h.max(p.0)));
    if high <= low || all <= 0.0 {
        return None;
    }
    let part = |q: f64| (((q - low) / (high - low) * PARTS as f64) as usize).min(PARTS - 1);
    let mut sums = [(0.0, 0usize); PARTS];
    for (q, _, e) in &points {
        let sum = &mut sums[part(*q)];
        *sum = (sum.0 + e, sum.1 + 1);
    }
    let stretches = (0..PARTS).flat_map(|from| (from..PARTS).map(move |to| (from, to)));
    let holds_half =
        |(from, to): &(usize, usize)| sums[*from..=*to].iter().map(|s| s.0).sum::<f64>() >= HALF * all;
    let samples = |(from, to): &(usize, usize)| sums[*from..=*to].iter().map(|s| s.1).sum::<usize>();
    let (from, to) = stretches.filter(holds_half).min_by_key(samples)?;
    let inside = || points.iter().filter(|p| (from..=to).contains(&part(p.0)));
    let energy = |direction: f64| inside().filter(|p| p.1 == direction).map(|p| p.2).sum::<f64>();
    let (own, up, down) = (inside().map(|p| p.2).sum::<f64>(), energy(1.0), energy(-1.0));
    let direction = [(1, up), (-1, down)].into_iter().find(|(_, e)| *e > ONE_WAY * own).map(|(d, _)| d);
    let at = |part: usize| low + (high - low) * part as f64 / PARTS as f64;
    let counted = inside().filter(|p| direction.is_none_or(|d| p.1 == f64::from(d))).count();
    Some(Gathering {
        joint: joint.name.clone(),
        from: at(from),
        to: at(to + 1),
        unit: if joint.kind == JointKind::Prismatic { "m" } else { "rad" }.into(),
        direction,
        share_of_misfit: own / all,
        share_of_samples: counted as f64 / points.len() as f64,
    })
}

impl Gathering {
    /// As part of a sentence.
    pub(super) fn in_words(&self) -> String {
        let (factor, unit) = if self.unit == "m" { (1e3, "mm") } else { (1f64.to_degrees(), "deg") };
        let way = match self.direction {
            Some(1) => " on the way up",
            Some(_) => " on the way down",
            None => "",
        };
        format!(
            "{:.0} % of it lies where {} is between {:.1} and {:.1} {unit}{way}, in {:.0} % of the samples",
            100.0 * self.share_of_misfit,
            self.joint,
            factor * self.from,
            factor * self.to,
            100.0 * self.share_of_samples,
        )
    }
}
