//! What combinations of deviations that no recording has shown would do to the moves of a program,
//! `docs/compensate.md` (C13).

use pulp::{Arch, Simd, WithSimd};

use super::control::Control;
use super::report::{Unseen, UnseenPattern};
use crate::chain::{Moved, Path};
use crate::few::Few;
use crate::identify::COMPONENTS;
use crate::lie::{Pose, Twist, Vec3, Wrench};
use crate::machine::Machine;
use crate::scalar::{Lanes, MOST_LANES, Scalar};

/// Sums of squares over the moves.
#[derive(Clone, Debug, Default)]
pub(super) struct UnseenSums {
    /// By pattern: of the tip, m^2, and of the tool axis, rad^2.
    sums: Vec<(f64, f64)>,
    moves: u64,
    /// The ends of moves that are not in the sums yet.
    waiting: Waiting,
}

/// The ends of some moves of one tool: what makes up a register is looked at together.
#[derive(Clone, Debug, Default)]
struct Waiting {
    t_from_tip: Option<Pose<f64>>,
    /// By command, m or rad.
    q: Vec<[f64; MOST_LANES]>,
    count: usize,
}

impl UnseenSums {
    /// One more move, which ends with the joints at `q`.
    pub fn add(&mut self, control: &Control, patterns: &[Vec<Twist<f64>>], q: &[f64]) {
        let t_from_tip = Some(control.tip());
        if self.waiting.t_from_tip != t_from_tip {
            self.settle(control, patterns);
            self.waiting.t_from_tip = t_from_tip;
        }
        let at = self.waiting.count;
        self.waiting.q.resize(q.len(), [0.0; MOST_LANES]);
        self.waiting.q.iter_mut().zip(q).for_each(|(column, q)| column[at] = *q);
        self.waiting.count += 1;
        if self.waiting.count == MOST_LANES {
            self.settle(control, patterns);
        }
    }

    /// Takes those that wait into the sums.
    pub fn settle(&mut self, control: &Control, patterns: &[Vec<Twist<f64>>]) {
        let count = std::mem::take(&mut self.waiting.count);
        let Some(t_from_tip) = self.waiting.t_from_tip.filter(|_| count > 0) else { return };
        self.sums.resize(patterns.len(), (0.0, 0.0));
        self.moves += count as u64;
        let path = control.nominal().path();
        Arch::new().dispatch(Shifts {
            path,
            patterns,
            t_from_tip,
            q: &self.waiting.q,
            count,
            sums: &mut self.sums,
        });
    }

    /// Takes up the moves that follow.
    pub fn absorb(&mut self, next: &UnseenSums) {
        self.sums.resize(self.sums.len().max(next.sums.len()), (0.0, 0.0));
        self.moves += next.moves;
        for (sum, next) in self.sums.iter_mut().zip(&next.sums) {
            *sum = (sum.0 + next.0, sum.1 + next.1);
        }
    }

    /// What the patterns did over all moves, largest first.
    pub fn report(&self, machine: &Machine, patterns: &[Vec<Twist<f64>>]) -> Unseen {
        let mean = |sum: f64| (sum / self.moves.max(1) as f64).sqrt();
        let mut listed: Vec<UnseenPattern> = (self.sums.iter().zip(patterns))
            .map(|((m2, rad2), pattern)| UnseenPattern {
                mostly: mostly(machine, pattern),
                tip_m: mean(*m2),
                axis_rad: mean(*rad2),
            })
            .collect();
        // A turn counts with a lever of 0.1 m.
        let size = |p: &UnseenPattern| p.tip_m.hypot(0.1 * p.axis_rad);
        listed.sort_by(|a, b| size(b).total_cmp(&size(a)));
        Unseen {
            tip_m: mean(self.sums.iter().map(|s| s.0).sum()),
            axis_rad: mean(self.sums.iter().map(|s| s.1).sum()),
            patterns: listed,
        }
    }
}

/// `sum + effect * by`.
#[inline(always)]
fn gone_on<T: Scalar>(sum: Vec3<T>, [a, b, c]: [T; 3], by: T) -> Vec3<T> {
    let [x, y, z] = sum.0;
    Vec3([a.mul_add(by, x), b.mul_add(by, y), c.mul_add(by, z)])
}

/// What patterns do to tip and tool axis at the ends of some moves, a move on each lane.
struct Shifts<'a> {
    path: &'a Path,
    patterns: &'a [Vec<Twist<f64>>],
    t_from_tip: Pose<f64>,
    q: &'a [[f64; MOST_LANES]],
    count: usize,
    sums: &'a mut [(f64, f64)],
}

impl WithSimd for Shifts<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let none = Lanes::splat(simd, 0.0);
        let t_from_tip = self.t_from_tip.lift(none);
        let dyads = self.path.dyad_count();
        let mut moved: Few<Moved<Lanes<S>>> =
            Few::from_elem(Moved::none(none), self.path.joint_count().max(1));
        let mut row = vec![none; 6 * dyads];
        // (14): by deviation what it does to the tip along x, y, z of the workpiece, and how it turns the tool about them.
        let mut effects = vec![[none; 6]; 6 * dyads];
        let mut parts = [[0.0; MOST_LANES]; 2];
        for from in (0..self.count).step_by(S::F64_LANES) {
            let lanes = from..from + S::F64_LANES;
            let q: Few<Lanes<S>> = self.q.iter().map(|q| Lanes::load(simd, &q[lanes.clone()])).collect();
            self.path.go_to(&q, &mut moved);
            let w_from_tip = self.path.w_from_t(&moved, none) * t_from_tip;
            let (tip, axis) = (w_from_tip.translation, w_from_tip.rotation.column(2));
            for k in 0..6 {
                let mut along = Vec3([none; 3]);
                along.0[k % 3] = none.offset(1.0);
                let wrench = if k < 3 { Wrench::at_point(along, tip) } else { Wrench::couple(along) };
                self.path.row(wrench, &moved, &mut row[..]);
                effects.iter_mut().zip(&row).for_each(|(effect, x)| effect[k] = *x);
            }
            for (sum, pattern) in self.sums.iter_mut().zip(self.patterns) {
                let (mut v, mut w) = (Vec3([none; 3]), Vec3([none; 3]));
                for (dh, effects) in pattern.iter().zip(effects.chunks_exact(6)) {
                    let (shifts, turns) = effects.split_at(3);
                    for (by, effect) in dh.v.0.iter().zip(shifts) {
                        let by = none.lift(*by);
                        v = gone_on(v, [effect[0], effect[1], effect[2]], by);
                    }
                    for (by, effect) in dh.w.0.iter().zip(turns) {
                        let by = none.lift(*by);
                        v = gone_on(v, [effect[0], effect[1], effect[2]], by);
                        w = gone_on(w, [effect[3], effect[4], effect[5]], by);
                    }
                }
                let turned = w.cross(axis);
                v.dot(v).store(&mut parts[0][..S::F64_LANES]);
                turned.dot(turned).store(&mut parts[1][..S::F64_LANES]);
                let [shifts, turns] = &parts;
                for (shift, turn) in shifts.iter().zip(turns).take(S::F64_LANES.min(self.count - from)) {
                    *sum = (sum.0 + shift, sum.1 + turn);
                }
            }
        }
    }
}

/// The largest components of a pattern, in units of their tolerances.
fn mostly(machine: &Machine, pattern: &[Twist<f64>]) -> Vec<String> {
    let mut parts: Vec<(f64, String)> = Vec::new();
    for (j, twist) in pattern.iter().enumerate() {
        let sizes = twist.to_array().into_iter().zip(machine.tolerance(j).to_array());
        for (name, (value, tolerance)) in COMPONENTS.iter().zip(sizes) {
            parts.push(((value / tolerance).abs(), format!("{}.{name}", machine.dyads()[j].frame)));
        }
    }
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let least = 0.5 * parts.first().map_or(0.0, |p| p.0);
    parts.into_iter().take(3).filter(|p| p.0 > least).map(|p| p.1).collect()
}
