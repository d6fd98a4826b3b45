//! The harness's own kinematics: only the nominal numbers come from the library's reading of the machine file.

use kincal::Machine;
use kincal::machine::{Branch, JointKind};

pub type V3 = [f64; 3];

pub fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scaled(a: V3, k: f64) -> V3 {
    a.map(|x| x * k)
}

pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn norm(a: V3) -> f64 {
    dot(a, a).sqrt()
}

/// Two unit vectors that stand on `n` and on one another.
pub fn across(n: V3) -> [V3; 2] {
    let seed = if n[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let u = sub(seed, scaled(n, dot(seed, n)));
    let u = scaled(u, 1.0 / norm(u));
    [u, cross(n, u)]
}

/// A rigid displacement: rotation matrix by rows, translation in m.
#[derive(Clone, Copy, Debug)]
pub struct Rigid {
    pub r: [V3; 3],
    pub p: V3,
}

impl Rigid {
    pub const IDENTITY: Rigid = Rigid { r: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], p: [0.0; 3] };

    pub fn shift(p: V3) -> Self {
        Rigid { p, ..Rigid::IDENTITY }
    }

    /// Turn by the rotation vector `w` (Rodrigues).
    pub fn turn(w: V3) -> Self {
        let angle = norm(w);
        if angle < 1e-14 {
            let r = [[1.0, -w[2], w[1]], [w[2], 1.0, -w[0]], [-w[1], w[0], 1.0]];
            return Rigid { r, p: [0.0; 3] };
        }
        let n = scaled(w, 1.0 / angle);
        let (s, c) = angle.sin_cos();
        let half = (angle / 2.0).sin();
        let k = 2.0 * half * half;
        let mut r = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                r[i][j] = k * n[i] * n[j] + if i == j { c } else { 0.0 };
            }
        }
        r[0][1] -= s * n[2];
        r[0][2] += s * n[1];
        r[1][0] += s * n[2];
        r[1][2] -= s * n[0];
        r[2][0] -= s * n[1];
        r[2][1] += s * n[0];
        Rigid { r, p: [0.0; 3] }
    }

    /// A small error twist (v; w): turned about its own origin, shifted by v (equal to exp up to v times w).
    pub fn small(e: &[f64; 6]) -> Self {
        Rigid { p: [e[0], e[1], e[2]], ..Rigid::turn([e[3], e[4], e[5]]) }
    }

    pub fn rotate(&self, x: V3) -> V3 {
        [dot(self.r[0], x), dot(self.r[1], x), dot(self.r[2], x)]
    }

    pub fn apply(&self, x: V3) -> V3 {
        add(self.rotate(x), self.p)
    }

    pub fn then(&self, b: &Rigid) -> Rigid {
        let mut r = [[0.0; 3]; 3];
        for (row, a) in r.iter_mut().zip(&self.r) {
            for (j, cell) in row.iter_mut().enumerate() {
                *cell = a[0] * b.r[0][j] + a[1] * b.r[1][j] + a[2] * b.r[2][j];
            }
        }
        Rigid { r, p: self.apply(b.p) }
    }

    pub fn inverse(&self) -> Rigid {
        let r = [0, 1, 2].map(|i| [self.r[0][i], self.r[1][i], self.r[2][i]]);
        let turned = Rigid { r, p: [0.0; 3] };
        Rigid { r, p: scaled(turned.rotate(self.p), -1.0) }
    }

    /// Rotation vector, for angles below a half turn by a margin.
    pub fn vector(&self) -> V3 {
        let w = [self.r[2][1] - self.r[1][2], self.r[0][2] - self.r[2][0], self.r[1][0] - self.r[0][1]];
        let sine = norm(w) / 2.0;
        let cosine = (self.r[0][0] + self.r[1][1] + self.r[2][2] - 1.0) / 2.0;
        let angle = sine.atan2(cosine);
        if sine < 1e-12 { scaled(w, 0.5) } else { scaled(w, angle / (2.0 * sine)) }
    }

    /// Unit quaternion (w, x, y, z), Shepperd's choice of the largest component.
    pub fn quaternion(&self) -> [f64; 4] {
        let r = &self.r;
        let squares = [
            1.0 + r[0][0] + r[1][1] + r[2][2],
            1.0 + r[0][0] - r[1][1] - r[2][2],
            1.0 - r[0][0] + r[1][1] - r[2][2],
            1.0 - r[0][0] - r[1][1] + r[2][2],
        ];
        let largest = (0..4).max_by(|a, b| squares[*a].total_cmp(&squares[*b])).unwrap_or(0);
        let s = 2.0 * squares[largest].sqrt();
        match largest {
            0 => [s / 4.0, (r[2][1] - r[1][2]) / s, (r[0][2] - r[2][0]) / s, (r[1][0] - r[0][1]) / s],
            1 => [(r[2][1] - r[1][2]) / s, s / 4.0, (r[0][1] + r[1][0]) / s, (r[0][2] + r[2][0]) / s],
            2 => [(r[0][2] - r[2][0]) / s, (r[0][1] + r[1][0]) / s, s / 4.0, (r[1][2] + r[2][1]) / s],
            _ => [(r[1][0] - r[0][1]) / s, (r[0][2] + r[2][0]) / s, (r[1][2] + r[2][1]) / s, s / 4.0],
        }
    }
}

/// One link: where it stands in the one before, and how it moves.
#[derive(Clone, Debug)]
pub struct Link {
    pub frame: String,
    pub placement: Rigid,
    pub on_workpiece: bool,
    pub joint: Option<Axis>,
    /// Mass and its centre behind the joint, kg and m.
    pub mass: Option<(f64, V3)>,
}

/// A joint: name, direction, and its displacement as a sum over commands.
#[derive(Clone, Debug)]
pub struct Axis {
    pub name: String,
    pub revolute: bool,
    pub n: V3,
    pub terms: Vec<(usize, f64)>,
}

/// A machine as the harness sees it.
#[derive(Clone, Debug)]
pub struct Body {
    pub name: String,
    pub links: Vec<Link>,
    pub commands: Vec<String>,
    /// Limits of the commands, m or rad.
    pub travel: Vec<(f64, f64)>,
    pub revolute: Vec<bool>,
    pub gravity: V3,
}

/// Deviations at one sample: for each link before its joint, of its displacement, and behind its joint.
#[derive(Clone, Debug)]
pub struct Errors {
    pub before: Vec<[f64; 6]>,
    pub joint: Vec<f64>,
    pub after: Vec<[f64; 6]>,
}

impl Errors {
    pub fn none(links: usize) -> Self {
        Errors { before: vec![[0.0; 6]; links], joint: vec![0.0; links], after: vec![[0.0; 6]; links] }
    }
}

impl Body {
    pub fn of(machine: &Machine) -> Self {
        let links = machine.dyads().iter().enumerate().map(|(j, d)| {
            let terms = machine.drive(j).map(|drive| drive.terms.clone()).unwrap_or_default();
            Link {
                frame: d.frame.clone(),
                placement: Rigid { p: d.placement.at.0, ..Rigid::turn(d.placement.rotation.0) },
                on_workpiece: machine.branch(j) == Branch::Workpiece,
                joint: d.joint.as_ref().map(|joint| Axis {
                    name: joint.name.clone(),
                    revolute: joint.kind == JointKind::Revolute,
                    n: joint.axis.0,
                    terms,
                }),
                mass: d.mass.map(|m| (m.mass, m.centre.0)),
            }
        });
        let count = machine.commands().len();
        Body {
            name: machine.name().to_string(),
            links: links.collect(),
            commands: machine.commands().to_vec(),
            travel: (0..count).map(|c| machine.travel(c)).collect(),
            revolute: (0..count).map(|c| machine.command_joint(c).kind == JointKind::Revolute).collect(),
            gravity: machine.gravity_b().0,
        }
    }

    /// Displacement of every link's joint, 0 where there is none.
    pub fn displacements(&self, commands: &[f64]) -> Vec<f64> {
        let of = |a: &Axis| a.terms.iter().map(|(c, f)| f * commands[*c]).sum();
        self.links.iter().map(|l| l.joint.as_ref().map_or(0.0, of)).collect()
    }

    /// Poses in the base of every link before and behind its joint.
    pub fn poses(&self, commands: &[f64], errors: Option<&Errors>) -> Vec<(Rigid, Rigid)> {
        self.moved(&self.displacements(commands), errors)
    }

    /// The same for displacements of the links' joints.
    pub fn poses_at(&self, q: &[f64]) -> Vec<(Rigid, Rigid)> {
        self.moved(q, None)
    }

    fn moved(&self, q: &[f64], errors: Option<&Errors>) -> Vec<(Rigid, Rigid)> {
        let mut at = Rigid::IDENTITY;
        let mut on_workpiece = true;
        let mut all = Vec::with_capacity(self.links.len());
        for (j, link) in self.links.iter().enumerate() {
            if link.on_workpiece != on_workpiece {
                (at, on_workpiece) = (Rigid::IDENTITY, link.on_workpiece);
            }
            at = at.then(&link.placement);
            if let Some(e) = errors {
                at = at.then(&Rigid::small(&e.before[j]));
            }
            let before = at;
            if let Some(joint) = &link.joint {
                let moved = q[j] + errors.map_or(0.0, |e| e.joint[j]);
                let by = scaled(joint.n, moved);
                at = at.then(&if joint.revolute { Rigid::turn(by) } else { Rigid::shift(by) });
            }
            if let Some(e) = errors {
                at = at.then(&Rigid::small(&e.after[j]));
            }
            all.push((before, at));
        }
        all
    }

    pub fn w_index(&self) -> usize {
        self.links.iter().rposition(|l| l.on_workpiece).unwrap_or(0)
    }

    /// Tool frame in the workpiece frame.
    pub fn tool(&self, commands: &[f64], errors: Option<&Errors>) -> Rigid {
        let poses = self.poses(commands, errors);
        poses[self.w_index()].1.inverse().then(&poses[self.links.len() - 1].1)
    }
}
