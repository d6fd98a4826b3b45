//! Effects so large that the machine is not linear between the one without them and the one with them.

use nalgebra::DVector;

use super::held_out::Model;
use super::linear::{Displaced, Linear};
use super::marginal::Marginal;
use super::search::Search;
use super::terms::ModelTerm;
use crate::effects::Candidate;
use crate::error::Result;
use crate::machine::Machine;
use crate::recording::Recording;
use crate::variation::{Part, Slot, Term};

/// Half of so much energy that no effect accounts for, in units of the noise's variance, sways the odds of names.
const SWAYS: f64 = 10.0;

/// The machine linearised anew where geometry and effects stand.
pub(super) struct Straightened {
    /// Residuals are again those without the effects, as they would be if the machine were linear: what is left where they stand, and to
    /// that what they do there. A step of Gauss and Newton from there finds them exactly, and so do their hypotheses.
    pub linear: Linear,
    /// What is left there, m and rad.
    pub left: Vec<f64>,
    /// Whether the machine is not as good as linear on the way there.
    pub is_bent: bool,
    /// Whether geometry explains more from there.
    pub is_nearer: bool,
}

/// What a model leaves, as the machine is and not as it was linearised.
pub(super) fn straightened(
    search: &Search,
    in_model: &[ModelTerm],
    machine: &Machine,
    recordings: &[Recording],
    dead_bands: &[f64],
) -> Result<Straightened> {
    let linear = search.rows.linear;
    let model = Model::new(search, in_model);
    let mut to = Displaced {
        constants: model.constants(search),
        terms: Vec::new(),
        coefficients: Vec::new(),
        features: Vec::new(),
    };
    for (i, effect) in in_model.iter().enumerate() {
        let candidate = &search.candidates[effect.candidate];
        let features = candidate.over(&linear.samples, &effect.score.parameters);
        for (coefficient, value) in candidate.coefficients.iter().zip(model.coefficients(search, in_model, i))
        {
            let mut parts = Vec::new();
            for part in &coefficient.parts {
                // What is added to a reading bends nothing.
                if part.slot == Slot::Reading {
                    continue;
                }
                let feature = candidate.features[part.feature].clone();
                parts.push(Part { slot: part.slot, direction: part.direction, feature });
                to.features.push(features[part.feature].clone());
            }
            to.terms.push(Term { parts, scale: 1.0, prior: false, of_setup: false });
            to.coefficients.push(value);
        }
    }
    let displaced = linear.displaced(machine, recordings, dead_bands, &to)?;
    let energy = |left: &[f64], beside: &Marginal| {
        let mut white = DVector::zeros(left.len());
        search.rows.whitener.apply(left, white.as_mut_slice());
        beside.apply(&white).norm_squared()
    };
    let there = displaced.residual.iter().zip(&displaced.acting).map(|(all, acting)| all - acting);
    let left: Vec<f64> = there.collect();
    let expected = model.residual_without(search, in_model, moves_machine);
    let bend: Vec<f64> = left.iter().zip(expected).map(|(a, b)| a - b).collect();
    let is_bent = energy(&bend, &search.beside(in_model, None)) > SWAYS;
    let is_nearer = energy(&left, &search.base) < energy(&linear.residual, &search.base);
    Ok(Straightened { linear: displaced, left, is_bent, is_nearer })
}

/// Whether it is on the machine: a delay of all readings is one of all joints.
fn moves_machine(candidate: &Candidate) -> bool {
    candidate.coefficients.iter().flat_map(|c| &c.parts).any(|part| part.slot != Slot::Reading)
}
