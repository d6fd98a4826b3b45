//! Joint axes as lines with all axes at zero: the global product of exponentials from the workpiece to the tool.

use crate::chain::Chain;
use crate::lie::{Mat3, Pose, Twist, Vec3};
use crate::machine::{JointKind, Machine};

/// A joint as a line.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub dyad: usize,
    pub kind: JointKind,
    /// Whether it carries the workpiece.
    pub on_part: bool,
    /// Direction in which the tool moves, or about which it turns, as the workpiece sees it when the joint's displacement grows.
    pub u: Vec3<f64>,
    /// A point of the line: the origin of the joint's frame, m.
    pub p: Vec3<f64>,
    /// The displacement as factors on commands.
    pub terms: Vec<(usize, f64)>,
}

/// All lines from the workpiece to the tool, in a frame m that stands still.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    pub lines: Vec<Line>,
    pub m_from_w: Pose<f64>,
    pub m_from_t: Pose<f64>,
}

impl Lines {
    /// Of a chain, in the frame that `m_from_b` says.
    pub fn new(machine: &Machine, chain: &Chain<f64>, m_from_b: Pose<f64>) -> Lines {
        let sweep = chain.sweep(&vec![0.0; machine.commands().len()]);
        let line = |j: usize| {
            let joint = machine.dyads()[j].joint.as_ref()?;
            let m_from_frame = m_from_b * sweep.b_from_frame(j);
            let on_part = j < machine.workpiece_count();
            let u = m_from_frame.rotation * joint.axis;
            Some(Line {
                dyad: j,
                kind: joint.kind,
                on_part,
                u: if on_part { -u } else { u },
                p: m_from_frame.translation,
                terms: machine.drive(j).map(|drive| drive.terms.clone()).unwrap_or_default(),
            })
        };
        let part = (0..machine.workpiece_count()).rev();
        Lines {
            lines: part.chain(machine.workpiece_count()..machine.dyads().len()).filter_map(line).collect(),
            m_from_w: m_from_b * sweep.b_from_w(),
            m_from_t: m_from_b * sweep.b_from_t(),
        }
    }

    /// Seen from frame w as it stands with all axes at zero.
    pub fn from_w(machine: &Machine, chain: &Chain<f64>) -> Lines {
        let sweep = chain.sweep(&vec![0.0; machine.commands().len()]);
        Lines::new(machine, chain, sweep.b_from_w().inverse())
    }

    /// Pose of the tool in the workpiece frame, as [`Chain::w_from_t`].
    pub fn w_from_t(&self, q: &[f64]) -> Pose<f64> {
        let through = self.lines.iter().fold(self.m_from_w.inverse(), |pose, line| {
            let s: f64 = line.terms.iter().map(|(c, factor)| factor * q[*c]).sum();
            pose * line.moved(s)
        });
        through * self.m_from_t
    }

    /// The tip of the tool in the workpiece frame, m.
    pub fn tip(&self, q: &[f64]) -> Vec3<f64> {
        self.w_from_t(q).translation
    }
}

impl Line {
    /// What the joint does to all behind it.
    pub fn moved(&self, s: f64) -> Pose<f64> {
        match self.kind {
            JointKind::Prismatic => Pose::translation(self.u.times(s)),
            JointKind::Revolute => {
                let turn = Pose::turn(self.u, s);
                Pose { rotation: turn.rotation, translation: self.p - turn.rotation * self.p }
            }
        }
    }
}

/// The rigid motion of one list of points that brings it next to another one, and what is left: largest and root mean square, m.
pub(super) fn aligned(goal: &[Vec3<f64>], points: &[Vec3<f64>]) -> (f64, f64) {
    let count = goal.len().max(1) as f64;
    let mut moved = points.to_vec();
    for _ in 0..6 {
        let centre = moved.iter().fold(Vec3([0.0; 3]), |sum, p| sum + *p).times(1.0 / count);
        let mut matrix = nalgebra::Matrix6::<f64>::zeros();
        let mut right = nalgebra::Vector6::<f64>::zeros();
        for (goal, p) in goal.iter().zip(&moved) {
            let hat = Mat3::hat(*p - centre).0;
            let gap = *goal - *p;
            for (i, hat) in hat.iter().enumerate() {
                let row = nalgebra::RowVector6::from_fn(|_, k| match k {
                    0..3 => f64::from(u8::from(i == k)),
                    _ => -hat[k - 3],
                });
                matrix += row.transpose() * row;
                right += row.transpose() * gap.0[i];
            }
        }
        let Ok(step) = matrix.svd(true, true).solve(&right, 1e-12) else { break };
        let turn = Pose::exp(Twist::new(Vec3([0.0; 3]), Vec3([step[3], step[4], step[5]])));
        let shift = Vec3([step[0], step[1], step[2]]);
        moved.iter_mut().for_each(|p| *p = turn.rotation * (*p - centre) + centre + shift);
        if step.amax() < 1e-15 {
            break;
        }
    }
    let gaps: Vec<f64> = goal.iter().zip(&moved).map(|(a, b)| (*a - *b).norm()).collect();
    let max = gaps.iter().copied().fold(0.0, f64::max);
    (max, (gaps.iter().map(|g| g * g).sum::<f64>() / count).sqrt())
}
