//! Room for the error motions of the axes, `docs/model.md` (32): what no axis is free of and no constant deviation holds.
//!
//! Every joint may deviate smoothly along its travel, in all six components, by a small part of its tolerance. That is no part of the
//! model that is found: it is eliminated from the normal equations, so that it neither bends the constants nor counts as noise.

use std::f64::consts::PI;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::source::Sources;
use crate::machine::{JointKind, Machine};

/// Functions of one joint: cosine and sine, once and twice.
const FUNCTIONS: usize = 4;
/// Columns of one joint.
const OF_JOINT: usize = 6 * FUNCTIONS;

/// The error motions that a fit leaves room for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Motions {
    joints: Vec<Room>,
}

/// The room of one joint.
#[derive(Clone, Debug)]
struct Room {
    dyad: usize,
    /// Displacement at which the functions begin, m or rad.
    from: f64,
    /// Their argument per displacement: a turn of a rotary joint is a turn, the travel seen of a linear one half a turn.
    rate: f64,
    /// Standard deviation of every component, m and rad.
    size: [f64; 6],
}

impl Motions {
    /// Room for `share` of every joint's tolerance; none for 0.
    pub fn new(machine: &Machine, sources: &Sources, share: f64) -> Self {
        if share <= 0.0 {
            return Motions::default();
        }
        let seen = |j: usize| {
            let terms = machine.drive(j).map_or(&[][..], |d| &d.terms);
            terms.iter().fold((0.0, 0.0), |(low, high), (c, factor)| {
                let ranges = sources.all.iter().map(|s| s.summary.commands[*c]);
                let (l, h) =
                    ranges.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, b)| (l.min(a), h.max(b)));
                let (a, b) = (factor * l, factor * h);
                (low + a.min(b), high + a.max(b))
            })
        };
        let room = |(j, joint): (usize, &crate::machine::Joint)| {
            let (low, high) = seen(j);
            let moves = high - low > 1e-9;
            let (from, rate) = match joint.kind {
                JointKind::Revolute => (0.0, 1.0),
                JointKind::Prismatic => (low, PI / (high - low)),
            };
            let size = machine.tolerance(j).to_array().map(|t| share * t);
            moves.then_some(Room { dyad: j, from, rate, size })
        };
        Motions { joints: machine.joints().filter_map(room).collect() }
    }

    /// Columns.
    pub fn len(&self) -> usize {
        OF_JOINT * self.joints.len()
    }

    /// The columns of a reading, each over the standard deviation of its coefficient, from its row over the deviations.
    pub fn columns(&self, machine: &Machine, q: &[f64], row: &[f64], columns: &mut [f64]) {
        if self.joints.is_empty() {
            return;
        }
        let displacements = machine.displacements(q);
        for (room, columns) in self.joints.iter().zip(columns.chunks_exact_mut(OF_JOINT)) {
            let (sin, cos) = (room.rate * (displacements[room.dyad] - room.from)).sin_cos();
            let functions = [cos, sin, cos * cos - sin * sin, 2.0 * sin * cos];
            for (k, columns) in columns.chunks_exact_mut(FUNCTIONS).enumerate() {
                let block = row[6 * room.dyad + k] * room.size[k];
                columns.iter_mut().zip(functions).for_each(|(column, f)| *column = block * f);
            }
        }
    }
}

/// Normal equations with the error motions eliminated.
pub(crate) struct Eliminated {
    pub matrix: DMatrix<f64>,
    pub gradient: DVector<f64>,
    /// What the objective falls by when the motions take their best values.
    pub gain: f64,
    /// Those values.
    pub values: Vec<f64>,
    /// Effective number of parameters that they have used up.
    pub used: f64,
}

/// Eliminates the last unknowns, those of the motions, which stand at `values` with a prior of unit deviation:
/// `N - N_m (N_mm + I)⁻¹ N_mᵀ`.
pub(crate) fn eliminate(matrix: &DMatrix<f64>, gradient: &DVector<f64>, values: &[f64]) -> Eliminated {
    let (count, kept) = (values.len(), gradient.len() - values.len());
    let own = matrix.view((kept, kept), (count, count)) + DMatrix::identity(count, count);
    let cross = matrix.view((kept, 0), (count, kept)).into_owned();
    let values = DVector::from_column_slice(values);
    let pull = gradient.rows(kept, count) - &values;
    // The identity makes it positive definite, whatever the data say.
    let Some(cholesky) = Cholesky::new(own) else {
        let matrix = matrix.view((0, 0), (kept, kept)).into_owned();
        let gradient = gradient.rows(0, kept).into_owned();
        return Eliminated { matrix, gradient, gain: 0.0, values: values.as_slice().to_vec(), used: 0.0 };
    };
    let step = cholesky.solve(&pull);
    let solved = cholesky.solve(&cross);
    Eliminated {
        matrix: matrix.view((0, 0), (kept, kept)) - cross.tr_mul(&solved),
        gradient: gradient.rows(0, kept) - cross.tr_mul(&step),
        gain: 0.5 * pull.dot(&step) - 0.5 * values.norm_squared(),
        values: (&values + &step).as_slice().to_vec(),
        used: count as f64 - cholesky.inverse().trace(),
    }
}
