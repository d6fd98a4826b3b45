//! Commands that put the tool somewhere, for tests that need all axes.

use nalgebra::{DMatrix, DVector, SVD};

use crate::chain::Chain;
use crate::lie::{Vec3, Wrench};
use crate::machine::Machine;

/// Commands that bring the tool point to `p_w` and the tool's z axis along `axis_w` (unit vector), starting from `start`;
/// `None` where the machine cannot reach it.
pub fn inverse(
    chain: &Chain<f64>,
    machine: &Machine,
    p_w: Vec3<f64>,
    axis_w: Vec3<f64>,
    start: &[f64],
) -> Option<Vec<f64>> {
    let mut q = start.to_vec();
    let unit = |k: usize| Vec3(std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }));
    for _ in 0..60 {
        let sweep = chain.sweep(&q);
        let w_from_t = sweep.w_from_t();
        let (p, axis) = (w_from_t.translation, w_from_t.rotation.column(2));
        let (gap, turn) = (p_w - p, axis.cross(axis_w));
        // Opposite directions have no cross product either.
        let turned_round = axis.dot(axis_w) < 0.0;
        if gap.norm() < 1e-12 && turn.norm() < 1e-13 && !turned_round {
            return Some(q);
        }
        let mut matrix = DMatrix::zeros(6, q.len());
        let mut row = vec![0.0; q.len()];
        for k in 0..6 {
            // Position rows in m; axis rows are the turn that is missing, square to the axis.
            let wrench = if k < 3 {
                Wrench::at_point(unit(k), p)
            } else {
                let n = unit(k - 3);
                Wrench::couple(n - axis.times(axis.dot(n)))
            };
            sweep.command_row(machine, wrench, &mut row);
            row.iter().enumerate().for_each(|(c, x)| matrix[(k, c)] = *x);
        }
        let push = if turned_round { axis.cross(Vec3([0.36, 0.48, 0.8])) } else { turn };
        let wanted = DVector::from_iterator(6, gap.0.into_iter().chain(push.0));
        let step = SVD::new(matrix, true, true).solve(&wanted, 1e-9).ok()?;
        let longest = step.amax();
        let shorten = if longest > 0.5 { 0.5 / longest } else { 1.0 };
        q.iter_mut().zip(step.iter()).for_each(|(x, s)| *x += s * shorten);
    }
    None
}
