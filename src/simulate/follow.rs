//! Axes that are solved from others: linear axes that carry the tool point along, rotary axes that aim the tool.

use nalgebra::{DMatrix, SVD, Vector3};

use crate::chain::Chain;
use crate::lie::{Vec3, Wrench};
use crate::machine::{JointKind, Machine};

fn unit(k: usize) -> Vec3<f64> {
    Vec3(std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }))
}

/// Commands of one kind of joint, machine order.
pub(super) fn commands_of(machine: &Machine, kind: JointKind) -> Vec<usize> {
    (0..machine.commands().len()).filter(|c| machine.command_joint(*c).kind == kind).collect()
}

/// Moves the commands `linear` in `q` until the point `point_t` stands at `target_w`, the others held: the point is linear in
/// them, so that one least-squares step of minimum length is exact. What is left of the gap, m.
pub(crate) fn follow(
    chain: &Chain<f64>,
    machine: &Machine,
    linear: &[usize],
    point_t: Vec3<f64>,
    target_w: Vec3<f64>,
    q: &mut [f64],
) -> f64 {
    let mut left = f64::INFINITY;
    // Further steps take away rounding.
    for _ in 0..4 {
        let sweep = chain.sweep(q);
        let p = sweep.w_from_t().transform(point_t);
        let gap = target_w - p;
        if gap.norm() < 1e-15 || gap.norm() >= left || linear.is_empty() {
            return left.min(gap.norm());
        }
        left = gap.norm();
        let mut matrix = DMatrix::zeros(3, linear.len());
        let mut row = vec![0.0; q.len()];
        for k in 0..3 {
            sweep.command_row(machine, Wrench::at_point(unit(k), p), &mut row);
            linear.iter().enumerate().for_each(|(i, c)| matrix[(k, i)] = row[*c]);
        }
        let Ok(step) = SVD::new(matrix, true, true).solve(&Vector3::from(gap.0), 1e-9) else { return left };
        linear.iter().zip(step.iter()).for_each(|(c, s)| q[*c] += s);
    }
    let p = chain.w_from_t(q).transform(point_t);
    (target_w - p).norm()
}

/// Turns the two commands `rotary` in `q` until the tool's axis (z of frame `t`) points along the unit vector `axis_w`;
/// whether it does.
pub(super) fn aim(
    chain: &Chain<f64>,
    machine: &Machine,
    rotary: [usize; 2],
    axis_w: Vec3<f64>,
    q: &mut [f64],
) -> bool {
    let mut row = vec![0.0; q.len()];
    let mut rows = [Vec3([0.0; 3]); 2];
    for _ in 0..40 {
        let sweep = chain.sweep(q);
        let axis = sweep.w_from_t().rotation.column(2);
        let turn = axis.cross(axis_w);
        if turn.norm() < 1e-14 && axis.dot(axis_w) > 0.0 {
            return true;
        }
        for k in 0..3 {
            sweep.command_row(machine, Wrench::couple(unit(k)), &mut row);
            (0..2).for_each(|i| rows[i].0[k] = row[rotary[i]]);
        }
        // Turns about the tool's own axis do not aim it.
        let [a, b] = rows.map(|w| w - axis.times(axis.dot(w)));
        let (aa, ab, bb) = (a.dot(a), a.dot(b), b.dot(b));
        let determinant = aa * bb - ab * ab;
        if determinant <= 1e-12 * aa.max(bb).powi(2) {
            return turn.norm() < 1e-12 && axis.dot(axis_w) > 0.0;
        }
        let (ga, gb) = (a.dot(turn), b.dot(turn));
        let step = [(bb * ga - ab * gb) / determinant, (aa * gb - ab * ga) / determinant];
        let longest = step[0].abs().max(step[1].abs());
        let shorten = if longest > 0.5 { 0.5 / longest } else { 1.0 };
        (0..2).for_each(|i| q[rotary[i]] += step[i] * shorten);
        if longest < 1e-15 {
            return turn.norm() < 1e-12 && axis.dot(axis_w) > 0.0;
        }
    }
    let axis = chain.w_from_t(q).rotation.column(2);
    axis.cross(axis_w).norm() < 1e-12 && axis.dot(axis_w) > 0.0
}

/// Every way of the two commands `rotary` to aim the tool along `axis_w`, turned to the least displacements that travel allows;
/// least displacements first, and of two equal ones that with the first command positive.
pub(super) fn every_aim(
    chain: &Chain<f64>,
    machine: &Machine,
    rotary: [usize; 2],
    axis_w: Vec3<f64>,
    held: &[f64],
) -> Vec<Vec<f64>> {
    use std::f64::consts::{PI, TAU};
    const GRID: usize = 16;
    let mut found: Vec<Vec<f64>> = Vec::new();
    for i in 0..GRID * GRID {
        let mut q = held.to_vec();
        let start = |k: usize| -PI + TAU * (k as f64 + 0.5) / GRID as f64;
        (q[rotary[0]], q[rotary[1]]) = (start(i / GRID), start(i % GRID));
        if !aim(chain, machine, rotary, axis_w, &mut q) {
            continue;
        }
        for c in rotary {
            let near = q[c] - TAU * (q[c] / TAU).round();
            let (from, to) = machine.travel(c);
            let turns = [near, near - TAU, near + TAU];
            q[c] = turns.into_iter().find(|x| (from - 1e-9..=to + 1e-9).contains(x)).unwrap_or(near);
        }
        let same = |other: &Vec<f64>| rotary.iter().all(|c| (other[*c] - q[*c]).abs() < 1e-6);
        if !found.iter().any(same) {
            found.push(q);
        }
    }
    let size = |q: &Vec<f64>| {
        let sum: f64 = rotary.iter().map(|c| q[*c] * q[*c]).sum();
        (sum * 1e6).round()
    };
    found.sort_by(|a, b| size(a).total_cmp(&size(b)).then(b[rotary[0]].total_cmp(&a[rotary[0]])));
    found
}
