//! From which side joints came before they first moved in a recording, as the readings say it: `docs/diagnosis-method.md` (73).

use super::diagnosis::{SaidBy, StandsStill};
use super::held_out::Model;
use super::search::Search;
use super::terms::ModelTerm;
use crate::feature::{Feature, Samples};
use crate::identify::Approach;
use crate::machine::Machine;

/// What the readings say of one joint in one recording.
struct Vote {
    recording: usize,
    dyad: usize,
    /// Direction of its first motion; 0 where it stands still throughout.
    first: i8,
    /// The product of what was found with what the other side would be, and the square of that.
    product: f64,
    square: f64,
}

impl Vote {
    /// The side where it is another one than that of the first motion; the middle is no side.
    fn approach(&self) -> Option<Approach> {
        let part = (self.product / self.square).round().clamp(-1.0, 1.0) as i8;
        let direction = match self.first {
            0 => part,
            first if part > 0 => -first,
            _ => 0,
        };
        (direction != 0).then(|| Approach::new(self.recording, self.dyad, direction))
    }
}

/// Sides of approach of all joints that have an effect that depends on it, as far as they are not those of their first motion. What was
/// found of how the effect was before anybody looked is compared with what it is behind a motion the other way, of joints that stand still
/// behind one that rises.
pub(super) fn approaches(search: &Search, kept: &[ModelTerm]) -> Vec<Approach> {
    let linear = search.rows.linear;
    let model = Model::new(search, kept);
    let mut votes: Vec<Vote> = Vec::new();
    for (i, effect) in kept.iter().enumerate() {
        let Some(found) = model.early(search, kept, i) else { continue };
        let candidate = &search.candidates[effect.candidate];
        let mut joints: Vec<usize> =
            candidate.features.iter().filter(|f| f.needs_history()).flat_map(Feature::joints).collect();
        joints.sort_unstable();
        joints.dedup();
        let mut from = 0;
        for (recording, (span, stretch)) in linear.spans.iter().zip(&linear.samples).enumerate() {
            let sample = |row: usize| linear.sample[row] - from;
            let now = effect_of(search, kept, &model, i, stretch, span.rows, &sample);
            for j in &joints {
                let Some(joint) = &stretch.joints[*j] else { continue };
                let first = joint.direction.iter().find(|d| **d != 0.0).map_or(0, |d| *d as i8);
                let mut other = stretch.clone();
                match &mut other.joints[*j] {
                    Some(still) if first == 0 => still.direction.fill(1.0),
                    joint => joint.clone_from(&linear.turned_before()[recording].joints[*j]),
                }
                let other = effect_of(search, kept, &model, i, &other, span.rows, &sample);
                let (mut product, mut square) = (0.0, 0.0);
                for (row, (now, other)) in (span.rows.0..span.rows.1).zip(now.iter().zip(other)) {
                    let change = other - now;
                    product += found[row] * change;
                    square += change * change;
                }
                match votes.iter_mut().find(|vote| (vote.recording, vote.dyad) == (recording, *j)) {
                    Some(known) => {
                        (known.product, known.square) = (known.product + product, known.square + square)
                    }
                    None => votes.push(Vote { recording, dyad: *j, first, product, square }),
                }
            }
            from += stretch.len;
        }
    }
    votes.iter().filter_map(Vote::approach).collect()
}

/// Those of joints that stand still all through a recording, in words.
pub(super) fn stand_still(search: &Search, approaches: &[Approach], machine: &Machine) -> Vec<StandsStill> {
    let linear = search.rows.linear;
    let stands = |Approach { recording, dyad, .. }: &&Approach| {
        let joint = &linear.samples[*recording].joints[*dyad];
        joint.as_ref().is_some_and(|joint| joint.direction.iter().all(|direction| *direction == 0.0))
    };
    let one = |Approach { recording, dyad, direction }: &Approach| {
        Some(StandsStill {
            recording: linear.spans[*recording].label.clone(),
            at: machine.dyads()[*dyad].joint.as_ref()?.name.clone(),
            direction: *direction,
            said_by: said_by(machine, *dyad, *direction),
        })
    };
    approaches.iter().filter(stands).filter_map(one).collect()
}

fn said_by(machine: &Machine, dyad: usize, direction: i8) -> Option<SaidBy> {
    let [(command, factor)] = machine.drive(dyad)?.terms.as_slice() else { return None };
    let value = if *factor < 0.0 { -direction } else { direction };
    (*factor != 0.0)
        .then(|| SaidBy { column: format!("{}_direction[1]", machine.commands()[*command]), value })
}

/// What effect `i` does to the rows of one recording over these samples, m or rad; `sample`: that of a row.
fn effect_of(
    search: &Search,
    kept: &[ModelTerm],
    model: &Model,
    i: usize,
    stretch: &Samples,
    (first, end): (usize, usize),
    sample: &dyn Fn(usize) -> usize,
) -> Vec<f64> {
    let rows = search.rows;
    let candidate = &search.candidates[kept[i].candidate];
    let features = candidate.over(std::slice::from_ref(stretch), &kept[i].score.parameters);
    let mut sum = vec![0.0; end - first];
    for (coefficient, value) in candidate.coefficients.iter().zip(model.coefficients(search, kept, i)) {
        for part in &coefficient.parts {
            let answer = rows.answer(part.slot, part.direction);
            for (sum, row) in sum.iter_mut().zip(first..end) {
                *sum += value * answer[row] * features[part.feature][sample(row)];
            }
        }
    }
    sum
}
