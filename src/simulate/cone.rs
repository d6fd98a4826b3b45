//! The cone of the demonstration, on any machine that reaches it with any of its axes.

use super::all_axes::AllAxes;
use super::random_commands;
use crate::chain::Chain;
use crate::lie::Vec3;
use crate::machine::Machine;

/// A cone in the workpiece, ISO 10791-6 BK4 with a bar of `length` (m) from the workpiece origin to the tool point: half apex angle
/// 45°, axis inclined by `inclination` (rad); the tool's axis runs on the opposite side of the same cone, 60° ahead. `count` poses
/// in each sense of travel; `None` where the machine does not reach them.
pub fn cone(machine: &Machine, length: f64, inclination: f64, count: usize) -> Option<Vec<Vec<f64>>> {
    let chain = Chain::nominal(machine);
    let half = 0.5f64;
    let (sin, cos) = inclination.sin_cos();
    let (e, n) = (Vec3([0.0, -sin, cos]), Vec3([0.0, cos, sin]));
    // Where bar and tool turn in step, the bar stands still as the tool sees it and a good part of the errors with it: the tool
    // leads by 60°.
    let lead = std::f64::consts::FRAC_PI_3;
    let generator = |phi: f64| n.times(phi.cos()) + Vec3([phi.sin(), 0.0, 0.0]);
    let target = |phi: f64| {
        let (bar, tool) = (e + generator(phi), e - generator(phi + lead));
        (bar.times(length * half.sqrt()), tool.times(half.sqrt()))
    };
    let (p_w, axis_w) = target(0.0);
    let inside = |q: &[f64]| {
        (0..q.len()).all(|c| {
            let (from, to) = machine.travel(c);
            (from..=to).contains(&q[c])
        })
    };
    let axes = AllAxes::new(machine);
    let starts = random_commands(machine, 200, 1);
    let first = starts.iter().filter_map(|start| axes.at(&chain, p_w, axis_w, start)).find(|q| inside(q))?;
    let mut path = vec![first];
    for k in 1..2 * count {
        let turn = if k < count { k as f64 } else { (2 * count - 1 - k) as f64 } / (count - 1) as f64;
        let (p_w, axis_w) = target(turn * std::f64::consts::TAU);
        let next = axes.at(&chain, p_w, axis_w, path.last()?)?;
        path.push(next);
    }
    Some(path)
}
