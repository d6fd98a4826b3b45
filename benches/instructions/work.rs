//! The workloads, made up without files: those of the peers in a size that an emulator gets through.

use std::fmt::Write;

use kincal::Machine;
use kincal::chain::{Batch, Chain};
use kincal::identify::{CalibrateOptions, Loss, Solver, calibrate};
use kincal::lie::{Twist, Vec3};
use kincal::nalgebra::DMatrix;
use kincal::recording::Recording;

/// Of all workloads.
pub const NAMES: [&str; 4] = ["W1", "W2", "W3", "W4"];

/// Samples of W1 and W2, of W3, of W4.
const BATCH: usize = 4_800;
const FEW: usize = 3_602;
const MANY: usize = 14_408;
/// How often W1 and W2 go over theirs, and passes of W3 and W4.
const TIMES: [usize; 2] = [1, 4];
const PASSES: [usize; 2] = [2, 5];

/// One workload.
pub enum Work {
    /// W1: where the tool of the nominal machine is.
    Poses,
    /// W2: a distance and its row of 42.
    Rows,
    /// W3 and W4: passes over so many distances, 42 parameters.
    Passes(usize),
}

impl Work {
    pub fn named(name: &str) -> Option<Work> {
        Some(match name {
            "W1" => Work::Poses,
            "W2" => Work::Rows,
            "W3" => Work::Passes(FEW),
            "W4" => Work::Passes(MANY),
            _ => return None,
        })
    }

    /// How often the samples are gone over in the two runs between which the difference is taken.
    pub fn times(&self) -> [usize; 2] {
        match self {
            Work::Poses | Work::Rows => TIMES,
            Work::Passes(_) => PASSES,
        }
    }

    /// What that difference is, in samples.
    pub fn samples(&self) -> f64 {
        let [few, many] = self.times().map(|times| times as f64);
        let samples = if let Work::Passes(samples) = self { *samples } else { BATCH };
        (many - few) * samples as f64
    }

    /// Goes over the samples so often.
    pub fn run(&self, times: usize) {
        let text = include_str!("../../machines/ac_table_tilting.ron");
        let machine =
            Machine::parse("ac_table_tilting.ron", text).expect("a machine that comes with the crate");
        match self {
            Work::Poses => {
                let (batch, q) = (Batch::new(&Chain::nominal(&machine)), commands(BATCH));
                let mut poses = DMatrix::zeros(BATCH, 12);
                (0..times).for_each(|_| batch.w_from_t_into(&q, &mut poses));
                assert!(poses.iter().all(|x| x.is_finite()));
            }
            Work::Rows => {
                let (batch, q) = (Batch::new(&general(&machine)), commands(BATCH));
                let (mut rows, origin) = (DMatrix::zeros(BATCH, 43), Vec3([0.0; 3]));
                (0..times).for_each(|_| batch.distance_rows_into(&q, origin, origin, &mut rows));
                assert!(rows.iter().all(|x| x.is_finite()));
            }
            Work::Passes(samples) => {
                let text = distances(&general(&machine), *samples);
                let recording = Recording::from_bytes("distances.csv", text.into_bytes(), &machine);
                let recordings = [recording.expect("a recording")];
                let solver = Solver::FixedDamping { tau: 1e-8, steps: times };
                let options = CalibrateOptions::default().with_loss(Loss::Squares).with_solver(solver);
                calibrate(&machine, &recordings, options).expect("a fit");
            }
        }
    }
}

/// Commands a, c, y, x, z that never repeat, one row for each sample, m and rad.
fn commands(samples: usize) -> DMatrix<f64> {
    const SIZES: [(f64, f64); 5] = [(1.2, 0.0), (3.0, 0.0), (0.12, 0.0), (0.15, 0.0), (0.1, 0.05)];
    DMatrix::from_fn(samples, 5, |k, c| {
        let (size, middle) = SIZES[c];
        middle + size * (0.37 * (c + 1) as f64 * k as f64).sin()
    })
}

/// The machine with errors everywhere, so that no product can be left out.
fn general(machine: &Machine) -> Chain<f64> {
    let off = |j: usize, k: usize| (1.0 + (6 * j + k) as f64).sin();
    let dh = |j| Twist::from_array(std::array::from_fn(|k| if k < 3 { 1e-4 } else { 1e-3 } * off(j, k)));
    Chain::new(machine, &(0..machine.dyads().len()).map(dh).collect::<Vec<_>>())
}

/// Distances of the tool from the workpiece's origin.
fn distances(chain: &Chain<f64>, samples: usize) -> String {
    let mut text =
        String::from("# measurement: distance\n# sigma[um]: 2.9\na[rad],c[rad],y[m],x[m],z[m],r[m]\n");
    for q in commands(samples).row_iter() {
        let q: Vec<f64> = q.iter().copied().collect();
        let r = chain.w_from_t(&q).translation.norm();
        let _ = writeln!(text, "{},{},{},{},{},{r}", q[0], q[1], q[2], q[3], q[4]);
    }
    text
}
