//! The peers' workloads (W1 to W5b) on this library, in lines that join the peers' table:
//!
//! ```text
//! RAYON_NUM_THREADS=1 PEERS_WORKLOADS=folder cargo bench --bench peers
//! ```
//!
//! or, with `-- --table`, as a table. The folder holds the `.bin` files that the peers' generator writes. Times are of the wall clock, so
//! that the machine should be quiet.

mod workload;

use kincal::Machine;
use kincal::chain::Batch;
use kincal::identify::{CalibrateOptions, Loss, Solver, calibrate};
use kincal::lie::Vec3;
use kincal::nalgebra::DMatrix;
use kincal::recording::Recording;

use workload::{Folder, MACHINE_ORDER, Results, ac_machine, by_column, by_row, largest_difference, time};

fn main() {
    let Some(folder) = Folder::given() else {
        println!("0 of 6 workloads: PEERS_WORKLOADS names no folder");
        return;
    };
    let (machine, results) = (ac_machine(), Results::asked());
    forward_kinematics(&folder, &machine, &results);
    distance_rows(&folder, &machine, &results);
    arm_jacobian(&folder, &results);
    for (name, file) in [("W3", "w3_samples"), ("W4", "w4_samples")] {
        let samples = folder.numbers(file);
        identification(&machine, name, (workload::distances(&samples), samples.len() / 6), &results);
    }
    let samples = folder.numbers("w5_samples");
    let positions = (workload::positions(&samples), samples.len() / 9);
    identification(&folder.nominal_arm(), "W5b", positions, &results);
}

/// W1: where the tool of the nominal machine is at 100 000 random commands.
fn forward_kinematics(folder: &Folder, machine: &Machine, results: &Results) {
    let chain = folder.chain(machine, "poses_nominal");
    let (joints, reference) = (folder.numbers("w1_joints"), folder.numbers("w1.ref"));
    let q = by_column(&joints, &MACHINE_ORDER);
    let (batch, units) = (Batch::new(&chain), q.nrows());
    let mut poses = DMatrix::zeros(units, 12);
    let seconds = time(21, || batch.w_from_t_into(&q, &mut poses));
    results.tell("W1", "batch", &seconds, units, largest_difference(&by_row(&poses), &reference), "");
    for (name, by_chain) in [("one at a time", false), ("one at a time, by the chain", true)] {
        let mut found = vec![0.0; reference.len()];
        let seconds = time(21, || {
            for (q, pose) in joints.chunks_exact(5).zip(found.chunks_exact_mut(12)) {
                let q = MACHINE_ORDER.map(|k| q[k]);
                let w_from_t = if by_chain { chain.w_from_t(&q) } else { batch.pose(&q) };
                for row in 0..3 {
                    pose[4 * row..4 * row + 3].copy_from_slice(&w_from_t.rotation.0[row]);
                    pose[4 * row + 3] = w_from_t.translation.0[row];
                }
            }
        });
        results.tell("W1", name, &seconds, units, largest_difference(&found, &reference), "");
    }
}

/// W2: a distance and its row of 42 at 100 000 samples of a machine with errors.
fn distance_rows(folder: &Folder, machine: &Machine, results: &Results) {
    let batch = Batch::new(&folder.chain(machine, "poses_general"));
    let (joints, reference) = (folder.numbers("w2_joints"), folder.numbers("w2.ref"));
    let q = by_column(&joints, &MACHINE_ORDER);
    let (units, origin) = (q.nrows(), Vec3([0.0; 3]));
    let mut rows = DMatrix::zeros(units, 43);
    let seconds = time(21, || batch.distance_rows_into(&q, origin, origin, &mut rows));
    let check = largest_difference(&folder.rows_of_left_increments("poses_general", &rows), &reference);
    results.tell("W2", "batch", &seconds, units, check, "rows of increments behind exp(dh); turned untimed");
    for (height, name) in [(96, "batch; L1-resident output"), (20_000, "batch; L3-resident output")] {
        let few = q.rows(0, height).into_owned();
        let mut rows = DMatrix::zeros(height, 43);
        let seconds = time(21, || {
            for _ in 0..units / height {
                batch.distance_rows_into(&few, origin, origin, &mut rows);
            }
        });
        results.tell("W2", name, &seconds, units / height * height, f64::NAN, "");
    }
    let mut all = vec![0.0; 43 * units];
    let seconds = time(21, || {
        for (q, numbers) in joints.chunks_exact(5).zip(all.chunks_exact_mut(43)) {
            if let Some((distance, row)) = numbers.split_first_mut() {
                *distance = batch.distance_row(&MACHINE_ORDER.map(|k| q[k]), origin, origin, row);
            }
        }
    });
    let rows = DMatrix::from_row_slice(units, 43, &all);
    let check = largest_difference(&folder.rows_of_left_increments("poses_general", &rows), &reference);
    results.tell("W2", "one at a time", &seconds, units, check, "");
}

/// W5a: the geometric Jacobian of a six-joint arm at 100 000 random commands.
fn arm_jacobian(folder: &Folder, results: &Results) {
    let (joints, reference) = (folder.numbers("w5_joints"), folder.numbers("w5.ref"));
    let batch = Batch::new(&folder.arm(&workload::arm_machine()));
    let q = by_column(&joints, &[0, 1, 2, 3, 4, 5]);
    let units = q.nrows();
    let mut velocities = DMatrix::zeros(units, 36);
    let seconds = time(21, || batch.velocities_into(&q, Vec3([0.0; 3]), &mut velocities));
    // Theirs is row by row, ours command by command.
    let theirs = DMatrix::from_fn(units, 36, |k, i| velocities[(k, 6 * (i % 6) + i / 6)]);
    results.tell("W5a", "batch", &seconds, units, largest_difference(&by_row(&theirs), &reference), "");
}

/// W3, W4 and W5b: parameters from the samples of a recording, by passes of fixed damping and to the solution.
fn identification(machine: &Machine, name: &str, (text, units): (String, usize), results: &Results) {
    let recordings = [Recording::from_bytes("samples.csv", text.into_bytes(), machine).expect("a recording")];
    recordings[0].scan().expect("readable rows");
    let options = |solver| CalibrateOptions::default().with_loss(Loss::Squares).with_solver(solver);
    let runs = if units > 20_000 { 3 } else { 11 };
    let after = |steps| {
        time(runs, || {
            calibrate(machine, &recordings, options(Solver::FixedDamping { tau: 1e-8, steps }))
                .expect("a fit");
        })
    };
    // What is not a pass is the same in both.
    let (few, many) = (after(10), after(30));
    let passes: Vec<f64> = few.iter().zip(&many).map(|(few, many)| (many - few) / 20.0).collect();
    results.tell(name, "pass", &passes, units, f64::NAN, "one pass over the samples");
    let seconds = time(runs, || {
        calibrate(machine, &recordings, options(Solver::default())).expect("a fit");
    });
    results.tell(name, "to the solution", &seconds, units, f64::NAN, "whole call; tolerances as prior");
}
