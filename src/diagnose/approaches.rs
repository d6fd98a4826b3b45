//! From which side a joint came that stands still all through a recording, as the readings say it: `docs/diagnosis-method.md` (73).

use super::diagnosis::{SaidBy, StandsStill};
use super::held_out::Model;
use super::search::Search;
use super::terms::ModelTerm;
use crate::feature::{Feature, JointSamples, Samples};
use crate::identify::Approach;
use crate::machine::Machine;

/// Sides of approach of all joints that stand still, and have an effect that depends on it. What was found of how the effect was before
/// anybody looked is compared with what either side would be; the middle is no side.
pub(super) fn approaches(search: &Search, kept: &[ModelTerm], machine: &Machine) -> Vec<StandsStill> {
    let linear = search.rows.linear;
    let model = Model::new(search, kept);
    // By recording and dyad: the product of what was found with what rising would be, and its square.
    let mut votes: Vec<(usize, usize, f64, f64)> = Vec::new();
    for (i, effect) in kept.iter().enumerate() {
        let Some(found) = model.early(search, kept, i) else { continue };
        let candidate = &search.candidates[effect.candidate];
        let mut joints: Vec<usize> =
            candidate.features.iter().filter(|f| f.needs_history()).flat_map(Feature::joints).collect();
        joints.sort_unstable();
        joints.dedup();
        let now = effects_of(search, kept, &model, i, &linear.samples);
        for j in joints {
            for (r, span) in linear.spans.iter().enumerate() {
                let stands = |joint: &JointSamples| joint.direction.iter().all(|direction| *direction == 0.0);
                if !linear.samples[r].joints[j].as_ref().is_some_and(stands) {
                    continue;
                }
                let mut rising = linear.samples.clone();
                rising[r].joints[j].iter_mut().for_each(|joint| joint.direction.fill(1.0));
                let rising = effects_of(search, kept, &model, i, &rising);
                let (mut product, mut square) = (0.0, 0.0);
                for row in span.rows.0..span.rows.1 {
                    let change = rising[row] - now[row];
                    product += found[row] * change;
                    square += change * change;
                }
                match votes.iter_mut().find(|(other, dyad, ..)| (*other, *dyad) == (r, j)) {
                    Some(known) => (known.2, known.3) = (known.2 + product, known.3 + square),
                    None => votes.push((r, j, product, square)),
                }
            }
        }
    }
    let told = votes.into_iter().filter_map(|(recording, dyad, product, square)| {
        let direction = (product / square).round().clamp(-1.0, 1.0);
        let at = machine.dyads()[dyad].joint.as_ref()?.name.clone();
        let direction = direction as i8;
        (direction != 0).then(|| StandsStill {
            recording: linear.spans[recording].label.clone(),
            at,
            direction,
            said_by: said_by(machine, dyad, direction),
            approach: Approach { recording, dyad, direction },
        })
    });
    told.collect()
}

fn said_by(machine: &Machine, dyad: usize, direction: i8) -> Option<SaidBy> {
    let [(command, factor)] = machine.drive(dyad)?.terms.as_slice() else { return None };
    let value = if *factor < 0.0 { -direction } else { direction };
    (*factor != 0.0)
        .then(|| SaidBy { column: format!("{}_direction[1]", machine.commands()[*command]), value })
}

/// What effect `i` does to every row over these samples, m or rad.
fn effects_of(search: &Search, kept: &[ModelTerm], model: &Model, i: usize, samples: &[Samples]) -> Vec<f64> {
    let rows = search.rows;
    let candidate = &search.candidates[kept[i].candidate];
    let features = candidate.over(samples, &kept[i].score.parameters);
    let mut sum = vec![0.0; rows.residual.len()];
    for (coefficient, value) in candidate.coefficients.iter().zip(model.coefficients(search, kept, i)) {
        for part in &coefficient.parts {
            let answer = rows.answer(part.slot, part.direction);
            for ((sum, a), sample) in sum.iter_mut().zip(answer.iter()).zip(&rows.linear.sample) {
                *sum += value * a * features[part.feature][*sample];
            }
        }
    }
    sum
}
