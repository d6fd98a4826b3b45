//! What a calibration leaves open of tip and tool axis: deviations that may be there as well, one pattern for
//! each direction.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::SeedableRng;
use rand::rngs::StdRng;

use super::information::Information;
use super::unknowns::{Layout, Role};
use crate::chain::Chain;
use crate::check::random_command;
use crate::lie::{Twist, Vec3, Wrench};
use crate::location::{LISTED, UNSEEN};
use crate::machine::Machine;

/// Poses over which the directions that move the tool are gathered.
const POSES: usize = 24;

/// One twist per dyad in machine order (m, rad), one standard deviation long.
type Pattern = Vec<Twist<f64>>;

/// Patterns of deviations that a calibration leaves open, `docs/compensate.md` (C13).
#[derive(Clone, Debug, Default)]
pub(super) struct Unseen {
    /// Of all directions that move the tool as the workpiece sees it, those that come from the tolerances by more than [`LISTED`] of
    /// their variance.
    pub patterns: Vec<Pattern>,
    /// What the data do not see at all, where it is not just those of `patterns` that are one tolerance long: a known set-up's frame that
    /// takes part in it is no part of a pattern, which is shorter then.
    pub at_all: Option<Vec<Pattern>>,
}

/// What the data leave open.
pub(super) fn unseen(machine: &Machine, layout: &Layout, information: &Information) -> Unseen {
    let count = information.positions.len();
    if count == 0 {
        return Unseen::default();
    }
    // Where each component of each dyad stands among the unknowns with a prior; `w` as in the first set-up
    // that has one.
    let known_w = layout.blocks.iter().find(|b| b.prior && matches!(b.role, Role::Setup(_)));
    let block = |j: usize| {
        let found = if j == machine.w_index() { known_w } else { layout.block(Role::Dyad(j)) };
        found.filter(|b| b.prior)
    };
    let at = |j: usize, k: usize| {
        let position = block(j)?.offset + k;
        information.positions.iter().position(|p| *p == position)
    };
    let dyads = machine.dyads().len();
    let places: Vec<Option<usize>> = (0..6 * dyads).map(|i| at(i / 6, i % 6)).collect();
    let scale = |i: usize| machine.tolerance(i / 6).to_array()[i % 6];

    // What moves the tool on general poses.
    let chain = Chain::nominal(machine);
    let mut rng = StdRng::seed_from_u64(9);
    let mut rows = DMatrix::zeros(6 * POSES, count);
    let mut row = vec![0.0; 6 * dyads];
    for pose in 0..POSES {
        let q: Vec<f64> =
            (0..machine.commands().len()).map(|c| random_command(machine, c, &mut rng)).collect();
        let sweep = chain.sweep(&q);
        let tip = sweep.w_from_t().translation;
        for k in 0..6 {
            let unit = Vec3(std::array::from_fn(|i| if i == k % 3 { 1.0 } else { 0.0 }));
            let wrench = if k < 3 { Wrench::at_point(unit, tip) } else { Wrench::couple(unit.times(0.3)) };
            sweep.error_row(wrench, &mut row);
            for (i, place) in places.iter().enumerate() {
                if let Some(place) = place {
                    rows[(6 * pose + k, *place)] += row[i] * scale(i);
                }
            }
        }
    }
    let eigen = SymmetricEigen::new(rows.transpose() * &rows);
    let largest = eigen.eigenvalues.amax();
    let moving: Vec<usize> = (0..count).filter(|i| eigen.eigenvalues[*i] > 1e-12 * largest).collect();
    let basis = DMatrix::from_fn(count, moving.len(), |a, i| eigen.eigenvectors[(a, moving[i])]);
    if moving.is_empty() {
        return Unseen::default();
    }

    // A covariance of theirs in units of the tolerances squared, as patterns with their variances.
    let along = information.directions.transpose() * &basis;
    let listed = |weights: DVector<f64>, least: f64| -> Vec<(f64, Pattern)> {
        let covariance = along.transpose() * DMatrix::from_diagonal(&weights) * &along;
        let eigen = SymmetricEigen::new(covariance);
        let mut order: Vec<usize> = (0..moving.len()).filter(|i| eigen.eigenvalues[*i] > least).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let pattern = |i: usize| {
            let scaled = &basis * eigen.eigenvectors.column(i) * eigen.eigenvalues[i].sqrt();
            (0..dyads)
                .map(|j| {
                    Twist::from_array(std::array::from_fn(|k| {
                        let value = places[6 * j + k].map_or(0.0, |place| scaled[place]);
                        // What is a millionth of its tolerance is rounding.
                        if value.abs() < 1e-6 { 0.0 } else { value * scale(6 * j + k) }
                    }))
                })
                .collect()
        };
        order.into_iter().map(|i| (eigen.eigenvalues[i], pattern(i))).collect()
    };
    let all = listed(information.strength.map(|s| 1.0 / (1.0 + s)), LISTED);
    // What moves the tool is told on the machine as declared, and what is seen on the machine as found: directions that move nothing
    // come out here with the square of their difference, which is less than makes a number one that is not identified.
    let at_all = listed(information.strength.map(|s| if s == 0.0 { 1.0 } else { 0.0 }), UNSEEN);
    let is_told = at_all.iter().all(|(variance, _)| *variance >= 1.0 - UNSEEN);
    let patterns = |listed: Vec<(f64, Pattern)>| listed.into_iter().map(|(_, pattern)| pattern).collect();
    Unseen { patterns: patterns(all), at_all: (!is_told).then(|| patterns(at_all)) }
}
