//! The paper's machine, path and errors, as `../shared/paper/facts.md` has them.
#![allow(dead_code)]

use std::f64::consts::TAU;

use crate::common::random::Random;
use kincal::lie::{Pose, Twist, Vec3};
use kincal::recording::Recording;
use kincal::rivals::{Form, Rival, Scheme, Step, against_truth};
use kincal::{CalibratedMachine, Chain, Machine};
use nalgebra::DMatrix;

/// Seeds of the noise; every figure is a median over them.
pub const SEEDS: u64 = 20;

/// The machine with the pivots and senses behind the printed NC rows.
pub fn machine() -> Machine {
    crate::common::machine("ac_table_tilting_paper")
}

/// Evenly spread cone angles over a full turn, the end left out.
pub fn full_turn(count: usize) -> Vec<f64> {
    (0..count).map(|k| k as f64 / count as f64 * TAU).collect()
}

/// Angles of the bar and the tool on the cone of radius `length`: bar vector (m), A and C of the program (rad; C as in the print, 0 to
/// 360 deg).
pub fn cone(length: f64, phi: f64, before: f64) -> (Vec3<f64>, f64, f64) {
    let (e, n) = (Vec3([0.0, -0.5, 0.75f64.sqrt()]), Vec3([0.0, 0.75f64.sqrt(), 0.5]));
    let m = n.times(phi.cos()) + Vec3([phi.sin(), 0.0, 0.0]);
    let half = 0.5f64.sqrt();
    let (bar, tool) = ((e + m).times(length * half), (e - m).times(half));
    let a = tool.0[2].clamp(-1.0, 1.0).acos();
    let c = (-tool.0[0]).atan2(-tool.0[1]);
    // C goes on where the arc tangent jumps.
    (bar, a, c + TAU * ((before - c) / TAU).round())
}

/// Commands of the printed programs, tables 7 and 9: `XYZ = d + T_bw(A, -C) origin`, the bar vector not turned with the table; with
/// `turned`, in the machine coordinates that give the cone in frame `w`. `senses` of A and C against the machine's own.
pub fn path(machine: &Machine, length: f64, phis: &[f64], senses: [f64; 2], turned: bool) -> Vec<Vec<f64>> {
    let chain = Chain::nominal(machine);
    let index = |name: &str| machine.commands().iter().position(|c| c == name).expect("a joint");
    let mut before = 0.0;
    phis.iter()
        .map(|phi| {
            let (bar, a, c) = cone(length, *phi, before);
            before = c;
            let mut q = vec![0.0; machine.commands().len()];
            q[index("a")] = senses[0] * a;
            q[index("c")] = senses[1] * c;
            let b_from_w = chain.sweep(&q).b_from_w();
            let bar = if turned { b_from_w.rotation * bar } else { bar };
            for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
                q[index(name)] = bar.0[k] + b_from_w.translation.0[k];
            }
            q
        })
        .collect()
}

/// The path of table 7 at these cone angles.
pub fn table_7_path(machine: &Machine, phis: &[f64]) -> Vec<Vec<f64>> {
    path(machine, 0.1, phis, [1.0, 1.0], false)
}

/// Which of the preset errors a true machine has.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Table 2: twists of the joints.
    pub twists: bool,
    /// Table 3: initial poses.
    pub poses: bool,
    /// Table 3: displacements of the joints.
    pub displacements: bool,
}

impl Preset {
    pub const TWISTS: Preset = Preset { twists: true, poses: false, displacements: false };
    pub const ALL: Preset = Preset { twists: true, poses: true, displacements: true };
    pub const POSES: Preset = Preset { twists: false, poses: true, displacements: false };
}

/// Table 2 as small displacements of the joint's axis line in its own frame, um and urad.
fn twist_error(frame: &str) -> [f64; 6] {
    match frame {
        "y" => [0.0, 0.0, 0.0, 0.0, 0.0, 63.0],
        "z" => [0.0, 0.0, 0.0, -21.0, 39.0, 0.0],
        "a" => [0.0, 0.0, 0.0, 0.0, 45.0, 43.0],
        "c" => [0.0, 6.2, 0.0, 72.0, -67.0, 0.0],
        _ => [0.0; 6],
    }
}

/// Table 3: deviation of the initial pose (um, urad) and of the joint's displacement (um or urad, in the program's sense).
fn pose_error(frame: &str) -> ([f64; 6], f64) {
    match frame {
        "w" => ([0.0, 2.0, 2.0, -20.0, 0.0, 0.0], 0.0),
        "c" => ([0.0, 2.0, 2.0, -20.0, 0.0, 0.0], 35.0),
        "a" => ([2.0, 0.0, 2.0, 20.0, 20.0, 20.0], 35.0),
        "y" => ([2.0, 2.0, 2.0, 20.0, 20.0, 20.0], 2.0),
        "x" => ([2.0, 0.0, 2.0, 20.0, 20.0, 20.0], 1.0),
        "z" => ([2.0, 2.0, 2.0, 20.0, 20.0, 20.0], 2.0),
        _ => ([2.0, 2.0, 2.0, 20.0, 20.0, -20.0], 0.0),
    }
}

/// The machine with the preset errors of tables 2 and 3. A joint whose axis line lies elsewhere by `e` moves by
/// `e exp(xi q) e⁻¹`, so `e` belongs to the frame before the joint and `e⁻¹` to the next.
pub fn true_machine(machine: &Machine, preset: Preset) -> CalibratedMachine {
    let small =
        |x: [f64; 6], on: bool| Pose::exp(Twist::from_array(x.map(|c| if on { c * 1e-6 } else { 0.0 })));
    let mut behind = Pose::identity(0.0);
    let mut deviations = Vec::new();
    for (j, dyad) in machine.dyads().iter().enumerate() {
        if j == machine.workpiece_count() {
            behind = Pose::identity(0.0);
        }
        let declared = dyad.placement.pose();
        let (pose, displacement) = pose_error(&dyad.frame);
        let axis = dyad.joint.as_ref().map_or([0.0; 6], |joint| joint.twist().to_array());
        let shift = small(axis.map(|x| x * displacement), preset.displacements);
        let line = small(twist_error(&dyad.frame), preset.twists);
        let actual = behind.inverse() * declared * small(pose, preset.poses) * line * shift;
        behind = line;
        deviations.push((declared.inverse() * actual).log());
    }
    CalibratedMachine::nominal(machine.clone()).with_deviations(deviations)
}

/// What was measured.
#[derive(Clone, Copy, PartialEq)]
pub enum Kind {
    /// Distance from the workpiece origin.
    Distance,
    /// All three coordinates.
    Position,
}

/// A recording of a machine with noise uniform in `[0, noise]` m.
pub fn record(machine: &CalibratedMachine, qs: &[Vec<f64>], kind: Kind, noise: f64, seed: u64) -> Recording {
    let (chain, declared) = (machine.chain(), machine.machine());
    let mut random = Random::new(seed);
    let unit = |joint: &str| if ["a", "c"].contains(&joint) { "rad" } else { "m" };
    let names: Vec<String> = declared.commands().iter().map(|c| format!("{c}[{}]", unit(c))).collect();
    let (word, columns) = match kind {
        Kind::Distance => ("distance", "r[m]"),
        Kind::Position => ("position", "px[m],py[m],pz[m]"),
    };
    let mut text = format!("# measurement: {word}\n{},{columns}\n", names.join(","));
    for q in qs {
        let p = chain.w_from_t(q).translation;
        let values = if kind == Kind::Position { p.0.to_vec() } else { vec![p.norm()] };
        let noisy = values.into_iter().map(|v| if noise > 0.0 { v + random.between(0.0, noise) } else { v });
        let cells: Vec<String> = q.iter().copied().chain(noisy).map(|x| format!("{x:.17}")).collect();
        text.push_str(&cells.join(","));
        text.push('\n');
    }
    Recording::from_bytes("path.csv", text.into_bytes(), declared).unwrap_or_else(|e| panic!("{e}"))
}

/// A scheme over all seeds, judged at the poses that it was fitted to; one entry a seed: radial error against the truth and dp (m), tilt
/// of the tool axis (rad), largest component of a deviation (m or rad), steps.
pub fn runs(
    truth: &CalibratedMachine,
    qs: &[Vec<f64>],
    noise: f64,
    kind: Kind,
    scheme: Scheme,
) -> Vec<[f64; 5]> {
    runs_judged(truth, qs, qs, noise, kind, scheme)
}

/// The same, judged at other poses.
pub fn runs_judged(
    truth: &CalibratedMachine,
    qs: &[Vec<f64>],
    judged: &[Vec<f64>],
    noise: f64,
    kind: Kind,
    scheme: Scheme,
) -> Vec<[f64; 5]> {
    let machine = truth.machine();
    let judged = [record(truth, judged, kind, 0.0, 0)];
    (0..SEEDS)
        .map(|seed| {
            let recordings = [record(truth, qs, kind, noise, seed)];
            let fitted =
                Rival::Scheme(scheme).fit(machine, &recordings).unwrap_or_else(|e| panic!("{scheme:?}: {e}"));
            let off = against_truth(&fitted.calibrated, truth, &judged).unwrap_or_else(|e| panic!("{e}"));
            let off = off.expect("both frames are seen");
            let components = fitted.calibrated.deviations().iter().flat_map(|d| d.to_array());
            let largest = components.fold(0.0, |m: f64, x| m.max(x.abs()));
            [off.reading_m, off.dp_m, off.tilt_rad, largest, fitted.steps as f64]
        })
        .collect()
}

pub fn median_of(runs: &[[f64; 5]], k: usize) -> f64 {
    let mut values: Vec<f64> = runs.iter().map(|r| r[k]).collect();
    values.sort_by(f64::total_cmp);
    0.5 * (values[values.len() / 2] + values[(values.len() - 1) / 2])
}

pub fn scheme(form: Form, step: Step, steps: usize) -> Scheme {
    Scheme { form, step, steps }
}

/// Rows of distances (from `c_w`) or positions over increments of chain factors, form A: the paper's tables.
pub fn factor_rows(
    machine: &Machine,
    qs: &[Vec<f64>],
    sees: &dyn Fn(Vec3<f64>) -> Vec<Vec3<f64>>,
    points_t: &[Vec3<f64>],
) -> DMatrix<f64> {
    let chain = Chain::nominal(machine);
    let width = 6 * machine.dyads().len();
    let mut all = Vec::new();
    for q in qs {
        let sweep = chain.sweep(q);
        for point_t in points_t {
            let p = sweep.w_from_t().transform(*point_t);
            for along in sees(p) {
                let mut row = vec![0.0; width];
                sweep.error_row(kincal::lie::Wrench::at_point(along, p), &mut row);
                for j in 0..machine.workpiece_count() {
                    let block = &mut row[6 * j..6 * j + 6];
                    let y = kincal::lie::Wrench {
                        f: Vec3([block[0], block[1], block[2]]),
                        m: Vec3([block[3], block[4], block[5]]),
                    };
                    let factor = machine.dyads()[j].placement.pose().inverse().carry_wrench(y);
                    block.copy_from_slice(&factor.to_array().map(|c| -c));
                }
                all.extend(row);
            }
        }
    }
    DMatrix::from_row_slice(all.len() / width, width, &all)
}

/// What one fixed centre sees of a point.
pub fn from_centre(c_w: Vec3<f64>) -> impl Fn(Vec3<f64>) -> Vec<Vec3<f64>> {
    move |p| {
        let bar = p - c_w;
        vec![bar.times(bar.norm().recip())]
    }
}

/// All three coordinates of a point.
pub fn coordinates(_: Vec3<f64>) -> Vec<Vec3<f64>> {
    vec![Vec3([1.0, 0.0, 0.0]), Vec3([0.0, 1.0, 0.0]), Vec3([0.0, 0.0, 1.0])]
}

pub const ORIGIN: Vec3<f64> = Vec3([0.0; 3]);

/// Ours is theirs within a part `band`.
pub fn close(what: &str, ours: f64, theirs: f64, band: f64) {
    assert!(
        (ours / theirs - 1.0).abs() <= band,
        "{what}: {ours:.4} against {theirs} (band {:.0} %)",
        100.0 * band
    );
}

/// Singular values, largest first.
pub fn values(rows: &DMatrix<f64>) -> Vec<f64> {
    let mut values: Vec<f64> = rows.clone().singular_values().iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}
