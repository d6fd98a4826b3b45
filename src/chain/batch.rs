//! A chain at many commands at a time.

use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};

use super::{Chain, Moved, Path, Row};
use crate::few::Few;
use crate::lie::{Pose, Twist, Vec3, Wrench};
use crate::scalar::{Lanes, MOST_LANES, Scalar};

/// A chain that is laid out for many samples, which are computed as many at a time as the machine has SIMD lanes. Commands and results
/// are matrices with one row for each sample. Turns beyond 2e9 rad give no numbers (NaN).
///
/// ```
/// use kincal::chain::{Batch, Chain};
/// use kincal::nalgebra::dmatrix;
/// use kincal::Machine;
///
/// let machine = Machine::parse("table.ron", r#"Machine(
///     name: "table", units: (length: mm, angle: deg),
///     workpiece: [(frame: "c", joint: Revolute(axis: "z")), (frame: "w")],
///     tool: [(frame: "x", joint: Prismatic(axis: "x")), (frame: "t", at: (0, 0, 80))],
/// )"#)?;
/// let chain = Chain::nominal(&machine);
/// // C in rad, X in m.
/// let poses = Batch::new(&chain).w_from_t(&dmatrix![0.0, 0.0; 0.1, 0.05; 0.2, 0.1]);
/// assert_eq!(poses.shape(), (3, 12));
/// let third = chain.w_from_t(&[0.2, 0.1]);
/// assert!((poses[(2, 3)] - third.translation.0[0]).abs() < 1e-15);
/// # Ok::<(), kincal::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Batch {
    path: Path,
}

impl Batch {
    /// Lays out a chain.
    pub fn new(chain: &Chain<f64>) -> Self {
        Batch { path: chain.path().clone() }
    }

    /// `w_from_t`, `docs/model.md` (10), at every row of `commands`, m or rad: twelve columns, the first three rows of the 4 × 4 matrix one
    /// after the other; the fourth, eighth and twelfth are the translation, m.
    ///
    /// # Panics
    /// If there are fewer columns than commands.
    pub fn w_from_t(&self, commands: &DMatrix<f64>) -> DMatrix<f64> {
        let mut poses = DMatrix::zeros(commands.nrows(), 12);
        self.w_from_t_into(commands, &mut poses);
        poses
    }

    /// As [`Batch::w_from_t`], into a matrix of that size.
    ///
    /// # Panics
    /// As [`Batch::w_from_t`], and if the matrix has another size.
    pub fn w_from_t_into(&self, commands: &DMatrix<f64>, poses: &mut DMatrix<f64>) {
        self.walk(commands, poses, 12, Want::Poses);
    }

    /// `w_from_t` at one row of commands, m or rad: what takes the least time where samples come one by one.
    ///
    /// # Panics
    /// If there are fewer numbers than commands.
    pub fn pose(&self, q: &[f64]) -> Pose<f64> {
        self.path.pose_of_one(q)
    }

    /// As [`Batch::distance_rows_into`] at one row of commands: the length, m, and in `row` the numbers behind it.
    ///
    /// # Panics
    /// If there are fewer numbers than commands, or the row has not six numbers for each dyad.
    pub fn distance_row(
        &self,
        q: &[f64],
        workpiece_point_w: Vec3<f64>,
        tool_point_t: Vec3<f64>,
        row: &mut [f64],
    ) -> f64 {
        assert_eq!(row.len(), 6 * self.path.dyad_count(), "numbers of a row");
        self.path.distance_of_one(q, workpiece_point_w, tool_point_t, row)
    }

    /// The length of a bar from the point `workpiece_point_w` to the point `tool_point_t`, m, and behind it its row over all deviations, six
    /// columns for each dyad in the machine's order, `docs/model.md` (14), (16): derivatives by increments behind `exp(dh)`, m/m and m/rad.
    ///
    /// # Panics
    /// As [`Batch::w_from_t`], and if the matrix has another size.
    pub fn distance_rows_into(
        &self,
        commands: &DMatrix<f64>,
        workpiece_point_w: Vec3<f64>,
        tool_point_t: Vec3<f64>,
        rows: &mut DMatrix<f64>,
    ) {
        let width = 1 + 6 * self.path.dyad_count();
        self.walk(commands, rows, width, Want::Distances { workpiece_point_w, tool_point_t });
    }

    /// Velocity of the point `tool_point_t` and angular velocity of the tool, both seen from `w`, by the speed of each command: six columns
    /// `vx vy vz wx wy wz` for each, `docs/model.md` (13).
    ///
    /// # Panics
    /// As [`Batch::w_from_t`], and if the matrix has another size.
    pub fn velocities_into(
        &self,
        commands: &DMatrix<f64>,
        tool_point_t: Vec3<f64>,
        velocities: &mut DMatrix<f64>,
    ) {
        self.walk(commands, velocities, 6 * commands.ncols(), Want::Velocities { tool_point_t });
    }

    fn walk(&self, commands: &DMatrix<f64>, results: &mut DMatrix<f64>, width: usize, want: Want) {
        let samples = commands.nrows();
        assert_eq!(results.shape(), (samples, width), "samples and columns of the results");
        if samples >= MOST_LANES {
            Arch::new().dispatch(Walk { path: &self.path, commands, results, want });
        } else if samples > 0 {
            // Fewer than the lanes: the last sample once more.
            let last = |k: usize| k.min(samples - 1);
            let more = DMatrix::from_fn(MOST_LANES, commands.ncols(), |k, c| commands[(last(k), c)]);
            let mut wider = DMatrix::zeros(MOST_LANES, width);
            Arch::new().dispatch(Walk { path: &self.path, commands: &more, results: &mut wider, want });
            results.copy_from(&wider.rows(0, samples));
        }
    }
}

/// What is computed at each sample.
#[derive(Clone, Copy)]
enum Want {
    Poses,
    Distances { workpiece_point_w: Vec3<f64>, tool_point_t: Vec3<f64> },
    Velocities { tool_point_t: Vec3<f64> },
}

/// At least as many samples as there are lanes.
struct Walk<'a> {
    path: &'a Path,
    commands: &'a DMatrix<f64>,
    results: &'a mut DMatrix<f64>,
    want: Want,
}

impl WithSimd for Walk<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (samples, none) = (self.commands.nrows(), Lanes::splat(simd, 0.0));
        let (commands, results) = (self.commands.as_slice(), self.results.as_mut_slice());
        let mut q: Few<Lanes<S>> = Few::from_elem(none, self.commands.ncols());
        let mut moved: Few<Moved<Lanes<S>>> =
            Few::from_elem(Moved::none(none), self.path.joint_count().max(1));
        let mut velocities: Few<Twist<Lanes<S>>> = match self.want {
            Want::Velocities { .. } => Few::from_elem(Twist::zero(none), self.path.joint_count()),
            _ => Few::new(),
        };
        let (q, moved, velocities) = (&mut q[..], &mut moved[..], &mut velocities[..]);
        // Lanes that lie across two lines of the cache are written at half the speed or less: behind the first they begin where lines do,
        // if all columns can.
        let to_line = results.as_ptr().align_offset(size_of::<S::f64s>());
        let second = if to_line > 0 && samples % S::F64_LANES == 0 { to_line } else { S::F64_LANES };
        let mut from = 0;
        while from < samples {
            // The last samples are those of full lanes, some of them once more.
            let k = from.min(samples - S::F64_LANES);
            let mut at = k;
            for q in &mut *q {
                *q = Lanes::load(simd, &commands[at..at + S::F64_LANES]);
                at += samples;
            }
            self.path.go_to(q, moved);
            let mut to = Columns { results: &mut *results, from: k, samples };
            match self.want {
                Want::Poses => {
                    let pose = self.path.w_from_t(moved, none);
                    let ([x, y, z], [px, py, pz]) = (pose.rotation.0, pose.translation.0);
                    to.put(0, [x[0], x[1], x[2], px, y[0], y[1]]);
                    to.put(6, [y[2], py, z[0], z[1], z[2], pz]);
                }
                Want::Distances { workpiece_point_w, tool_point_t } => {
                    let p_w = self.path.point_w(tool_point_t.lift(none), moved);
                    let bar = p_w - workpiece_point_w.lift(none);
                    let distance = bar.norm();
                    to.put(0, [distance]);
                    let along_w = bar.times(distance.recip());
                    self.path.row(Wrench::at_point(along_w, p_w), moved, &mut to);
                }
                Want::Velocities { tool_point_t } => {
                    self.path.velocities(tool_point_t.lift(none), moved, velocities);
                    for command in 0..q.len() {
                        to.put(6 * command, self.path.of_command(command, velocities, none).to_array());
                    }
                }
            }
            from = if from == 0 { second } else { from + S::F64_LANES };
        }
    }
}

/// Results column by column, from one sample on.
struct Columns<'a> {
    results: &'a mut [f64],
    from: usize,
    samples: usize,
}

impl Columns<'_> {
    /// Neighbouring columns.
    #[inline(always)]
    fn put<S: Simd, const N: usize>(&mut self, first: usize, numbers: [Lanes<S>; N]) {
        let mut at = first * self.samples + self.from;
        for number in numbers {
            number.store(&mut self.results[at..at + S::F64_LANES]);
            at += self.samples;
        }
    }
}

impl<S: Simd> Row<Lanes<S>> for Columns<'_> {
    /// Behind the distance.
    #[inline(always)]
    fn take<const N: usize>(&mut self, first: usize, numbers: [Lanes<S>; N]) {
        self.put(1 + first, numbers);
    }
}
