//! A machine with an instrument on a path: what is read, and how readings answer to small errors anywhere.

use nalgebra::{DMatrix, DVector};

use super::body::{Body, Errors, Rigid, V3, add, cross, dot, norm, scaled, sub};
use super::effect::Profile;
use super::path::Run;
use super::track::Track;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Instrument {
    /// Distance from the workpiece point, less the run's nominal length unless `absolute`.
    Distance {
        absolute: bool,
    },
    Position,
    Pose,
    /// Along this direction of the workpiece frame.
    Displacement(V3),
    /// The joint of this link by itself.
    Joint(usize),
}

/// Everything of a case but its secret.
pub struct World {
    pub body: Body,
    pub instrument: Instrument,
    pub tool_point: V3,
    pub workpiece_point: V3,
    /// Noise of lengths, m, and of angles, rad.
    pub sigma: (f64, f64),
    /// The recordings, and last the judge's path.
    pub runs: Vec<Run>,
    pub track: Track,
}

impl World {
    /// Run and sample within it of a sample of the track.
    pub fn locate(&self, k: usize) -> (usize, usize) {
        let run = self.track.starts.partition_point(|s| *s <= k) - 1;
        (run, k - self.track.starts[run])
    }

    pub fn commands(&self, k: usize) -> &[f64] {
        let (run, i) = self.locate(k);
        &self.runs[run].commands[i]
    }

    /// Readings with the tool at `t` in the workpiece frame: lengths, then the rotation vector of a pose.
    fn read(&self, t: &Rigid, length: f64) -> Vec<f64> {
        let p = t.apply(self.tool_point);
        match self.instrument {
            Instrument::Distance { absolute } => {
                vec![norm(sub(p, self.workpiece_point)) - if absolute { 0.0 } else { length }]
            }
            Instrument::Position | Instrument::Pose => p.to_vec(),
            Instrument::Displacement(n) => vec![dot(n, p)],
            Instrument::Joint(_) => vec![],
        }
    }

    /// Exact readings and the tool's pose at sample `k` of the track.
    pub fn measure(&self, k: usize, errors: &Errors) -> (Vec<f64>, Rigid) {
        let (run, i) = self.locate(k);
        if let Instrument::Joint(j) = self.instrument {
            let Some(joint) = &self.body.links[j].joint else { return (vec![], Rigid::IDENTITY) };
            let e = &errors.before[j];
            let along = if joint.revolute {
                dot(joint.n, [e[3], e[4], e[5]])
            } else {
                dot(joint.n, [e[0], e[1], e[2]])
            };
            let q = self.track.joints[j].as_ref().map_or(0.0, |t| t.q[k]);
            return (vec![q + errors.joint[j] + along], Rigid::IDENTITY);
        }
        let tool = self.body.tool(&self.runs[run].commands[i], Some(errors));
        (self.read(&tool, self.runs[run].length), tool)
    }

    /// How many rows a sample has.
    pub fn width(&self) -> usize {
        match self.instrument {
            Instrument::Pose => 6,
            Instrument::Position => 3,
            _ => 1,
        }
    }

    /// Whether its one reading is an angle.
    pub fn reads_angle(&self) -> bool {
        matches!(self.instrument, Instrument::Joint(j)
            if self.body.links[j].joint.as_ref().is_some_and(|a| a.revolute))
    }
}

/// How the readings of chosen samples answer to small errors, in units of the noise.
pub struct Answers<'a> {
    pub world: &'a World,
    pub samples: Vec<usize>,
    /// Per sample: rows of readings by twists of the tool seen from the workpiece.
    by_twist: Vec<Vec<[f64; 6]>>,
    /// Per sample and link: pose in the workpiece frame before and behind the joint.
    frames: Vec<Vec<(Rigid, Rigid)>>,
    /// Orthonormal columns that span what constant geometry does to these readings.
    geometry: DMatrix<f64>,
}

impl<'a> Answers<'a> {
    pub fn of(world: &'a World, samples: Vec<usize>) -> Self {
        const H: f64 = 1e-6;
        let w = world.body.w_index();
        let mut by_twist = Vec::with_capacity(samples.len());
        let mut frames = Vec::with_capacity(samples.len());
        for k in &samples {
            let poses = world.body.poses(world.commands(*k), None);
            let w_from_base = poses[w].1.inverse();
            let tool = w_from_base.then(&poses[poses.len() - 1].1);
            let mut rows = vec![[0.0; 6]; world.width()];
            for c in 0..6 {
                let mut e = [0.0; 6];
                e[c] = H;
                let plus = Rigid::small(&e).then(&tool);
                e[c] = -H;
                let minus = Rigid::small(&e).then(&tool);
                let (plus_read, minus_read) = (world.read(&plus, 0.0), world.read(&minus, 0.0));
                for (row, (a, b)) in rows.iter_mut().zip(plus_read.iter().zip(&minus_read)) {
                    row[c] = (a - b) / (2.0 * H) / world.sigma.0;
                }
                if world.instrument == Instrument::Pose {
                    let turned = plus.then(&minus.inverse()).vector();
                    for (row, x) in rows.iter_mut().skip(3).zip(turned) {
                        row[c] = x / (2.0 * H) / world.sigma.1;
                    }
                }
            }
            by_twist.push(rows);
            let seen = |(a, b): &(Rigid, Rigid)| (w_from_base.then(a), w_from_base.then(b));
            frames.push(poses.iter().map(seen).collect());
        }
        let rows = samples.len() * world.width();
        let mut answers = Answers { world, samples, by_twist, frames, geometry: DMatrix::zeros(rows, 0) };
        answers.geometry = answers.span_of_geometry();
        answers
    }

    pub fn rows(&self) -> usize {
        self.samples.len() * self.world.width()
    }

    fn span_of_geometry(&self) -> DMatrix<f64> {
        let links = self.world.body.links.len();
        let mut columns = Vec::new();
        for j in 0..links {
            for c in 0..6 {
                let mut e = [0.0; 6];
                // Ten times what machines are given: what needs more than that, no calibration would believe.
                e[c] = if c < 3 { 150e-6 } else { 400e-6 };
                columns.push(self.before(j, |_| e));
            }
        }
        let matrix = DMatrix::from_columns(&columns);
        let eigen = (matrix.transpose() * &matrix).symmetric_eigen();
        // Combinations that all samples together see better than that are free, the others are not.
        let of_all = self.world.track.recorded as f64 / self.samples.len() as f64;
        let seen: Vec<DVector<f64>> = (0..columns.len())
            .filter(|i| eigen.eigenvalues[*i] * of_all > 1.0)
            .map(|i| &matrix * eigen.eigenvectors.column(i) / eigen.eigenvalues[i].sqrt())
            .collect();
        if seen.is_empty() { DMatrix::zeros(self.rows(), 0) } else { DMatrix::from_columns(&seen) }
    }

    fn twisted(&self, j: usize, behind: bool, at: impl Fn(usize) -> [f64; 6]) -> DVector<f64> {
        if let Instrument::Joint(joint) = self.world.instrument {
            let axis = self.world.body.links[joint].joint.as_ref();
            let value = |k: &usize| match axis {
                Some(axis) if j == joint && !behind => {
                    let e = at(*k);
                    let part = if axis.revolute { [e[3], e[4], e[5]] } else { [e[0], e[1], e[2]] };
                    dot(axis.n, part) / self.sigma_of_joint()
                }
                _ => 0.0,
            };
            return DVector::from_iterator(self.samples.len(), self.samples.iter().map(value));
        }
        let sign = if self.world.body.links[j].on_workpiece { -1.0 } else { 1.0 };
        let mut out = DVector::zeros(self.rows());
        let width = self.world.width();
        for (i, k) in self.samples.iter().enumerate() {
            let frame = if behind { &self.frames[i][j].1 } else { &self.frames[i][j].0 };
            let e = at(*k);
            let w = frame.rotate([e[3], e[4], e[5]]);
            let v = add(frame.rotate([e[0], e[1], e[2]]), cross(frame.p, w));
            for (r, row) in self.by_twist[i].iter().enumerate() {
                let value = dot([row[0], row[1], row[2]], v) + dot([row[3], row[4], row[5]], w);
                out[i * width + r] = sign * value;
            }
        }
        out
    }

    fn sigma_of_joint(&self) -> f64 {
        if self.world.reads_angle() { self.world.sigma.1 } else { self.world.sigma.0 }
    }

    /// Answer to twists before the joint of link `j`; `at`: the twist at a sample of the track.
    pub fn before(&self, j: usize, at: impl Fn(usize) -> [f64; 6]) -> DVector<f64> {
        self.twisted(j, false, at)
    }

    /// Answer to twists behind the joint of link `j`.
    pub fn after(&self, j: usize, at: impl Fn(usize) -> [f64; 6]) -> DVector<f64> {
        self.twisted(j, true, at)
    }

    /// Answer to a change of the displacement of link `j`'s joint.
    pub fn joint(&self, j: usize, at: impl Fn(usize) -> f64) -> DVector<f64> {
        let Some(axis) = &self.world.body.links[j].joint else { return DVector::zeros(self.rows()) };
        let n = axis.n;
        self.before(j, |k| {
            let d = scaled(n, at(k));
            if axis.revolute { [0.0, 0.0, 0.0, d[0], d[1], d[2]] } else { [d[0], d[1], d[2], 0.0, 0.0, 0.0] }
        })
    }

    /// What is added to the reading itself: along a direction where it has three parts.
    pub fn reading(&self, direction: V3, at: impl Fn(usize) -> f64) -> DVector<f64> {
        let width = self.world.width();
        let sigma = if self.world.reads_angle() { self.world.sigma.1 } else { self.world.sigma.0 };
        let mut out = DVector::zeros(self.rows());
        for (i, k) in self.samples.iter().enumerate() {
            let parts: &[f64] = if width == 1 { &[1.0] } else { &direction };
            for (r, d) in parts.iter().enumerate() {
                out[i * width + r] = d * at(*k) / sigma;
            }
        }
        out
    }

    /// Answer to a reading that is 1 s late.
    pub fn late(&self) -> DVector<f64> {
        let mut out = DVector::zeros(self.rows());
        for (j, track) in self.world.track.joints.iter().enumerate() {
            if let Some(track) = track {
                out -= self.joint(j, |k| track.v[k]);
            }
        }
        out
    }

    /// Answer to an effect.
    pub fn to(&self, profile: &Profile) -> DVector<f64> {
        match profile {
            Profile::Joint(j, values) => self.joint(*j, |k| values[k]),
            Profile::Before(j, values) => self.before(*j, |k| values[k]),
            Profile::After(j, values) => self.after(*j, |k| values[k]),
            Profile::Reading(direction, values) => self.reading(*direction, |k| values[k]),
            Profile::Late(_) => self.late(),
        }
    }

    /// What geometry cannot absorb of it.
    pub fn beyond_geometry(&self, y: &DVector<f64>) -> DVector<f64> {
        y - &self.geometry * (self.geometry.transpose() * y)
    }

    /// Counts further columns among what geometry absorbs.
    pub fn absorb(&mut self, columns: &[DVector<f64>]) {
        let mut all: Vec<DVector<f64>> = self.geometry.column_iter().map(|c| c.into_owned()).collect();
        let beyond: Vec<DVector<f64>> = columns.iter().map(|c| self.beyond_geometry(c)).collect();
        all.extend(orthonormal(&beyond, 1e-10).column_iter().map(|c| c.into_owned()));
        self.geometry = DMatrix::from_columns(&all);
    }

    /// Share of `y` (already beyond geometry) that the span of these columns explains.
    pub fn share(&self, y: &DVector<f64>, columns: &[DVector<f64>]) -> f64 {
        let free: Vec<DVector<f64>> = columns
            .iter()
            .map(|c| {
                let beyond = self.beyond_geometry(c);
                // A column that geometry swallows but for rounding explains nothing.
                if beyond.norm() < 1e-6 * c.norm() { DVector::zeros(c.len()) } else { beyond }
            })
            .collect();
        let basis = orthonormal(&free, 1e-10);
        let seen = basis.transpose() * y;
        seen.norm_squared() / y.norm_squared().max(1e-300)
    }
}

/// Orthonormal basis of columns; directions below `least` of the strongest (in energy) are left out.
pub fn orthonormal(columns: &[DVector<f64>], least: f64) -> DMatrix<f64> {
    let rows = columns.first().map_or(0, |c| c.len());
    let kept: Vec<DVector<f64>> = columns.iter().filter(|c| c.norm() > 0.0).map(|c| c / c.norm()).collect();
    if kept.is_empty() {
        return DMatrix::zeros(rows, 0);
    }
    let matrix = DMatrix::from_columns(&kept);
    let eigen = (matrix.transpose() * &matrix).symmetric_eigen();
    let top = eigen.eigenvalues.max();
    let chosen: Vec<DVector<f64>> = (0..kept.len())
        .filter(|i| eigen.eigenvalues[*i] > least * top)
        .map(|i| &matrix * eigen.eigenvectors.column(i) / eigen.eigenvalues[i].sqrt())
        .collect();
    if chosen.is_empty() { DMatrix::zeros(rows, 0) } else { DMatrix::from_columns(&chosen) }
}
