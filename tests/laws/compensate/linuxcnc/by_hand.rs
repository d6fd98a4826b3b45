//! Forward kinematics by hand: products of 4×4 matrices out of the machine's public data, (8) and (10) of `docs/model.md`. Nothing of the
//! library's own kinematics is in it.

use kincal::Machine;
use kincal::lie::Twist;
use kincal::machine::{Branch, JointKind};

type Matrix = [[f64; 4]; 4];

const UNIT: Matrix = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Of a rotation and a translation.
fn inverse(a: &Matrix) -> Matrix {
    let mut back = UNIT;
    for i in 0..3 {
        for j in 0..3 {
            back[i][j] = a[j][i];
        }
        back[i][3] = -(0..3).map(|k| a[k][i] * a[k][3]).sum::<f64>();
    }
    back
}

/// The exponential of a twist (v; w) as its power series.
fn exp(v: [f64; 3], w: [f64; 3]) -> Matrix {
    let x: Matrix = [[0.0, -w[2], w[1], v[0]], [w[2], 0.0, -w[0], v[1]], [-w[1], w[0], 0.0, v[2]], [0.0; 4]];
    let (mut sum, mut power) = (UNIT, UNIT);
    for k in 1..60 {
        power = times(&power, &x).map(|row| row.map(|a| a / f64::from(k)));
        sum = std::array::from_fn(|i| std::array::from_fn(|j| sum[i][j] + power[i][j]));
    }
    sum
}

/// A joint along or about a unit vector.
fn joint(kind: JointKind, n: [f64; 3], q: f64) -> Matrix {
    let mut m = UNIT;
    match kind {
        JointKind::Prismatic => (0..3).for_each(|i| m[i][3] = n[i] * q),
        JointKind::Revolute => {
            let (s, c) = q.sin_cos();
            let cross = [[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]];
            for i in 0..3 {
                for j in 0..3 {
                    m[i][j] = n[i] * n[j] * (1.0 - c) + cross[i][j] * s + if i == j { c } else { 0.0 };
                }
            }
        }
    }
    m
}

/// Where the tip is in frame `w`, m, and the direction of the tool axis there.
#[derive(Clone, Copy, Debug)]
pub struct Tip {
    pub at: [f64; 3],
    pub axis: [f64; 3],
}

impl Tip {
    /// Distance of two tips, m.
    pub fn gap(&self, other: &Tip) -> f64 {
        norm(sub(self.at, other.at))
    }

    /// Angle between two tool axes, rad.
    pub fn angle(&self, other: &Tip) -> f64 {
        let (a, b) = (self.axis, other.axis);
        norm([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    }
}

pub fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

struct Link {
    on_table: bool,
    fixed: Matrix,
    joint: Option<(usize, JointKind, [f64; 3])>,
}

/// A machine by its matrices.
pub struct ByHand(Vec<Link>);

impl ByHand {
    /// The machine with a deviation twist in every frame.
    pub fn new(machine: &Machine, deviations: &[Twist<f64>]) -> Self {
        let link = |(j, dyad): (usize, &kincal::machine::Dyad)| {
            let turn = exp([0.0; 3], dyad.placement.rotation.0);
            let mut placed = turn;
            (0..3).for_each(|i| placed[i][3] = dyad.placement.at.0[i]);
            let dh = deviations[j];
            let joint = dyad.joint.as_ref().map(|joint| {
                let command = machine.commands().iter().position(|c| *c == joint.name).expect("its own");
                (command, joint.kind, joint.axis.0)
            });
            Link {
                on_table: machine.branch(j) == Branch::Workpiece,
                fixed: times(&placed, &exp(dh.v.0, dh.w.0)),
                joint,
            }
        };
        ByHand(machine.dyads().iter().enumerate().map(link).collect())
    }

    /// With the joints at `q` (m and rad, by command) and the tip `beyond` (m) frame `t` along its z axis.
    pub fn tip(&self, q: &[f64], beyond: f64) -> Tip {
        let branch = |on_table: bool| {
            let links = self.0.iter().filter(|link| link.on_table == on_table);
            links.fold(UNIT, |pose, link| {
                let pose = times(&pose, &link.fixed);
                link.joint.map_or(pose, |(c, kind, n)| times(&pose, &joint(kind, n, q[c])))
            })
        };
        let m = times(&inverse(&branch(true)), &branch(false));
        let axis = [m[0][2], m[1][2], m[2][2]];
        Tip { at: std::array::from_fn(|i| m[i][3] + axis[i] * beyond), axis }
    }
}
