//! Room for the error motions of the axes, `docs/model.md` (32): what no axis is free of and no constant deviation holds.
//!
//! Every joint may deviate smoothly along its travel, in all six components, by a small part of its tolerance. That is eliminated from the
//! normal equations, so that it neither bends the constants nor counts as noise, and told beside them.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::{ErrorMotions, HARMONICS, JointMotion, direction_of, harmonics};
use crate::lie::Twist;
use crate::machine::{JointKind, Machine};

/// Functions of one joint and component: cosine and sine of every harmonic.
const FUNCTIONS: usize = 2 * HARMONICS;
/// Columns of one joint: those of its deviation, and two of its play.
const OF_JOINT: usize = 6 * FUNCTIONS + 2;
/// By what share of its prior play varies along the travel, standard deviation.
const PLAY_VARIES: f64 = 0.3;

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
    /// Displacement of one period: a turn of a rotary joint, twice the travel seen of a linear one, m or rad.
    period: f64,
    /// Standard deviation of every component in the first harmonic, m and rad; in harmonic `h` one over `h` of it.
    size: [f64; 6],
    /// Standard deviation by which half the play varies, m or rad; 0 where the model has no play here.
    play: f64,
}

impl Motions {
    /// Room for `share` of every joint's tolerance; none for 0. `seen`: range of every command, m or rad; `play`: standard deviation of
    /// half the play of the joint of a dyad, m or rad, where the model has some.
    pub fn new(
        machine: &Machine,
        seen: &[(f64, f64)],
        share: f64,
        play: impl Fn(usize) -> Option<f64>,
    ) -> Self {
        if share <= 0.0 {
            return Motions::default();
        }
        let seen = |j: usize| {
            let terms = machine.drive(j).map_or(&[][..], |d| &d.terms);
            terms.iter().fold((0.0, 0.0), |(low, high), (c, factor)| {
                let (a, b) = (factor * seen[*c].0, factor * seen[*c].1);
                (low + a.min(b), high + a.max(b))
            })
        };
        let room = |(j, joint): (usize, &crate::machine::Joint)| {
            let (low, high) = seen(j);
            let moves = high - low > 1e-9;
            let (from, period) = match joint.kind {
                JointKind::Revolute => (0.0, TAU),
                JointKind::Prismatic => (low, 2.0 * (high - low)),
            };
            let size = machine.tolerance(j).to_array().map(|t| share * t);
            let play = play(j).unwrap_or(0.0);
            moves.then_some(Room { dyad: j, from, period, size, play: PLAY_VARIES * play })
        };
        Motions { joints: machine.joints().filter_map(room).collect() }
    }

    /// The same with other sizes: factors on the standard deviations of lengths and of angles. That of play stays.
    pub fn sized(&self, sizes: [f64; 2]) -> Self {
        let sized =
            |room: &Room| Room { size: std::array::from_fn(|k| sizes[k / 3] * room.size[k]), ..room.clone() };
        Motions { joints: self.joints.iter().map(sized).collect() }
    }

    /// The factor of every column under [`Motions::sized`].
    pub fn factors(&self, sizes: [f64; 2]) -> DVector<f64> {
        let of_joint = |i: usize| if i < 6 * FUNCTIONS { sizes[i / FUNCTIONS / 3] } else { 1.0 };
        DVector::from_fn(self.len(), |i, _| of_joint(i % OF_JOINT))
    }

    /// Columns.
    pub fn len(&self) -> usize {
        OF_JOINT * self.joints.len()
    }

    /// The error motions of these values, over the standard deviations of their coefficients.
    pub fn found(&self, values: &[f64]) -> ErrorMotions {
        let joint = |(room, values): (&Room, &[f64])| {
            let twist = |h: usize, which: usize| {
                let of = |k: usize| room.size[k] * values[FUNCTIONS * k + 2 * h + which] / (h + 1) as f64;
                Twist::from_array(std::array::from_fn(of))
            };
            JointMotion {
                dyad: room.dyad,
                from: room.from,
                period: room.period,
                cosines: std::array::from_fn(|h| twist(h, 0)),
                sines: std::array::from_fn(|h| twist(h, 1)),
                play: [0, 1].map(|i| room.play * values[6 * FUNCTIONS + i]),
            }
        };
        ErrorMotions { joints: self.joints.iter().zip(values.chunks_exact(OF_JOINT)).map(joint).collect() }
    }

    /// The columns of a reading, each over the standard deviation of its coefficient, from its row over the deviations. `directions`: of
    /// all commands, where the model depends on them.
    pub fn columns(&self, machine: &Machine, q: &[f64], directions: &[i8], row: &[f64], columns: &mut [f64]) {
        if self.joints.is_empty() {
            return;
        }
        let displacements = machine.displacements(q);
        for (room, columns) in self.joints.iter().zip(columns.chunks_exact_mut(OF_JOINT)) {
            let functions = functions(TAU * (displacements[room.dyad] - room.from) / room.period);
            let (columns, of_play) = columns.split_at_mut(6 * FUNCTIONS);
            of_play.fill(0.0);
            if room.play > 0.0
                && let Some(joint) = &machine.dyads()[room.dyad].joint
            {
                let along = joint.twist().to_array().into_iter().zip(&row[6 * room.dyad..]);
                let along = along.map(|(xi, by)| xi * by).sum::<f64>() * room.play;
                let direction = direction_of(machine, room.dyad, directions);
                of_play.iter_mut().zip(functions).for_each(|(column, f)| *column = along * direction * f);
            }
            for (k, columns) in columns.chunks_exact_mut(FUNCTIONS).enumerate() {
                let block = row[6 * room.dyad + k] * room.size[k];
                columns.iter_mut().zip(functions).for_each(|(column, f)| *column = block * f);
            }
        }
    }
}

/// Cosine and sine of every harmonic, each over its number: smooth motions fade so.
fn functions(u: f64) -> [f64; FUNCTIONS] {
    let all = harmonics(u);
    std::array::from_fn(|i| {
        let (cos, sin) = all[i / 2];
        let function = if i % 2 == 0 { cos } else { sin };
        function / (i / 2 + 1) as f64
    })
}

/// Normal equations with the error motions eliminated.
pub(crate) struct Eliminated {
    pub matrix: DMatrix<f64>,
    pub gradient: DVector<f64>,
    /// What the objective falls by when the motions take their best values.
    pub gain: f64,
    /// Those values.
    pub values: Vec<f64>,
    /// Triangle of their posterior information.
    posterior: Option<Cholesky<f64, Dyn>>,
}

impl Eliminated {
    /// Effective number of parameters that they have used up.
    pub fn used(&self) -> f64 {
        self.posterior.as_ref().map_or(0.0, |own| self.values.len() as f64 - own.inverse().trace())
    }

    /// Half the logarithm of the determinant of their posterior information.
    pub fn half_log_det(&self) -> f64 {
        self.posterior.as_ref().map_or(0.0, |own| own.l_dirty().diagonal().iter().map(|x| x.ln()).sum())
    }
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
        return Eliminated {
            matrix,
            gradient,
            gain: 0.0,
            values: values.as_slice().to_vec(),
            posterior: None,
        };
    };
    let step = cholesky.solve(&pull);
    let solved = cholesky.solve(&cross);
    Eliminated {
        matrix: matrix.view((0, 0), (kept, kept)) - cross.tr_mul(&solved),
        gradient: gradient.rows(0, kept) - cross.tr_mul(&step),
        gain: 0.5 * pull.dot(&step) - 0.5 * values.norm_squared(),
        values: (&values + &step).as_slice().to_vec(),
        posterior: Some(cholesky),
    }
}
