//! The files of the peers' workloads, and how results are printed.

use std::path::PathBuf;
use std::time::Instant;

use kincal::Machine;
use kincal::chain::Chain;
use kincal::lie::{Mat3, Pose, Vec3, Wrench};
use kincal::machine::{Dyad, FileUnits, Joint};
use kincal::nalgebra::DMatrix;

/// Commands of the files in the order x, y, z, a, c; of the machine: a, c, y, x, z.
pub const MACHINE_ORDER: [usize; 5] = [3, 4, 1, 0, 2];
/// Dyads of the machine among the poses of the files, which are in the order w, c, a, y, x, z, t.
const POSE_OF_DYAD: [usize; 7] = [2, 1, 0, 3, 4, 5, 6];

/// Where the workloads are.
pub struct Folder(PathBuf);

impl Folder {
    /// The folder that `PEERS_WORKLOADS` names.
    pub fn given() -> Option<Folder> {
        std::env::var_os("PEERS_WORKLOADS").map(|path| Folder(path.into()))
    }

    /// The numbers of one file.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        let path = self.0.join(format!("{name}.bin"));
        let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("eight bytes"))).collect()
    }

    /// Poses, each six numbers of its logarithm and then twelve of its matrix, row by row.
    pub fn poses(&self, name: &str) -> Vec<Pose<f64>> {
        let pose = |numbers: &[f64]| {
            let at = |row: usize, column: usize| numbers[6 + 4 * row + column];
            Pose {
                rotation: Mat3(std::array::from_fn(|row| std::array::from_fn(|column| at(row, column)))),
                translation: Vec3(std::array::from_fn(|row| at(row, 3))),
            }
        };
        self.numbers(name).chunks_exact(18).map(pose).collect()
    }

    /// The machine's chain with the poses of one file.
    pub fn chain(&self, machine: &Machine, name: &str) -> Chain<f64> {
        let poses = self.poses(name);
        let mut chain = Chain::nominal(machine);
        for (dyad, pose) in POSE_OF_DYAD.into_iter().enumerate() {
            chain.set_previous_from_frame(dyad, poses[pose]);
        }
        chain
    }

    /// The arm's chain: its base, six joints and its tool.
    pub fn arm(&self, machine: &Machine) -> Chain<f64> {
        let poses = self.poses("arm_true");
        let mut chain = Chain::nominal(machine);
        chain.set_previous_from_frame(1, poses[0] * poses[1]);
        for (frame, pose) in poses.iter().enumerate().skip(2) {
            chain.set_previous_from_frame(frame, *pose);
        }
        chain
    }

    /// The arm as it is meant: its base is the pose of the workpiece, seen from there.
    pub fn nominal_arm(&self) -> Machine {
        let poses = self.poses("arm_nominal");
        let joint = |k: usize| {
            let name = format!("q{k}");
            let joint = Joint::revolute(name.clone(), [0.0, 0.0, 1.0]);
            Dyad::new(name).placed(poses[k]).with_joint(joint)
        };
        let tool = (1..=6).map(joint).chain([Dyad::new("t").placed(poses[7])]).collect();
        let workpiece = vec![Dyad::new("w").placed(poses[0].inverse())];
        Machine::new("arm", FileUnits::si(), workpiece, tool).expect("a machine")
    }

    /// Distances with their rows as the workloads have them: by increments in front of each pose, in the order of the files.
    pub fn rows_of_left_increments(&self, poses: &str, rows: &DMatrix<f64>) -> Vec<f64> {
        let poses = self.poses(poses);
        let mut all = Vec::with_capacity(rows.len());
        for row in rows.row_iter() {
            all.push(row[0]);
            for (pose, before_from_frame) in poses.iter().enumerate() {
                let dyad = POSE_OF_DYAD.iter().position(|own| *own == pose).expect("a dyad");
                let own = |i: usize| row[1 + 6 * dyad + i];
                let y = Wrench { f: Vec3([own(0), own(1), own(2)]), m: Vec3([own(3), own(4), own(5)]) };
                all.extend(before_from_frame.inverse().carry_wrench(y).to_array());
            }
        }
        all
    }
}

/// The recording of W3 and W4: commands in m and rad, distances from the workpiece's origin, and how exact they are.
pub fn distances(samples: &[f64]) -> String {
    let mut text =
        String::from("# measurement: distance\n# sigma[um]: 2.9\nx[m],y[m],z[m],a[rad],c[rad],r[m]\n");
    for row in samples.chunks_exact(6) {
        let [x, y, z, a, c, r] = row else { unreachable!("six numbers") };
        text.push_str(&format!("{x},{y},{z},{a},{c},{r}\n"));
    }
    text
}

/// The recording of W5b: commands in rad, positions of the tool in the workpiece frame, and how exact they are.
pub fn positions(samples: &[f64]) -> String {
    let joints: String = (1..=6).map(|k| format!("q{k}[rad],")).collect();
    let mut text = format!("# measurement: position\n# sigma[um]: 50\n{joints}px[m],py[m],pz[m]\n");
    for row in samples.chunks_exact(9) {
        let row: Vec<String> = row.iter().map(f64::to_string).collect();
        text.push_str(&(row.join(",") + "\n"));
    }
    text
}

/// The arm of W5, with its joints alone.
pub fn arm_machine() -> Machine {
    let joints: String =
        (1..=6).map(|k| format!("(frame: \"q{k}\", joint: Revolute(axis: \"z\")), ")).collect();
    let text = format!(
        "Machine(name: \"arm\", units: (length: mm, angle: deg), workpiece: [(frame: \"w\")], tool: [{joints}(frame: \"t\")])"
    );
    Machine::parse("arm.ron", &text).expect("a machine")
}

/// The machine of W1 to W4, with its joints alone: poses come from the files.
pub fn ac_machine() -> Machine {
    let text = include_str!("../../machines/ac_table_tilting.ron");
    Machine::parse("ac_table_tilting.ron", text).expect("a machine that comes with the crate")
}

/// Commands that stand row by row, in this order of columns.
pub fn by_column(rows: &[f64], order: &[usize]) -> DMatrix<f64> {
    let width = order.len();
    DMatrix::from_fn(rows.len() / width, width, |k, c| rows[width * k + order[c]])
}

/// The numbers of a matrix row by row.
pub fn by_row(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// Seconds of the wall clock, all runs in order of length; the first is not counted.
pub fn time(runs: usize, mut work: impl FnMut()) -> Vec<f64> {
    work();
    let mut seconds: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    seconds
}

/// Largest difference of two lists.
pub fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "as many numbers as the reference has");
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Where results go: lines that join the peers' table, or rows of the table in `docs/performance.md`.
pub struct Results {
    as_table: bool,
}

impl Results {
    /// As `--table` asks.
    pub fn asked() -> Results {
        let as_table = std::env::args().any(|argument| argument == "--table");
        if as_table {
            println!("| workload | ns a sample, median | the quickest run | from the reference |");
            println!("| --- | --- | --- | --- |");
        }
        Results { as_table }
    }

    /// One result: `seconds` of all runs in order of length, for so many `units`, `check` away from the reference where there is one.
    pub fn tell(&self, workload: &str, name: &str, seconds: &[f64], units: usize, check: f64, note: &str) {
        let (median, least) = (seconds[seconds.len() / 2], seconds[0]);
        let ns = 1e9 / units as f64;
        if self.as_table {
            let check = if check.is_nan() { String::new() } else { format!("{check:.0e}") };
            println!("| {workload}: {name} | {} | {} | {check} |", three(median * ns), three(least * ns));
        } else {
            println!(
                "RESULT,{workload},kincal {name},{median:.6e},{:.4},{:.4},1.00,{check:.2e},{note}",
                median * ns,
                least * ns
            );
        }
    }
}

/// Three significant digits.
fn three(value: f64) -> String {
    let decimals = (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}
