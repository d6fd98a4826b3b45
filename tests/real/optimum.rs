//! The solver reaches the optimum on 42 redundant parameters, on a workload where two popular solvers stop at 3 and 11 times it.

use crate::common;
use kincal::identify::{CalibrateOptions, Loss, Solver, calibrate};
use kincal::recording::Recording;

/// Sum of squares at the optimum, m²: minimum-norm Gauss-Newton steps of a dense SVD in another language, repeated until the sum no
/// longer changed in its eleventh digit.
const OPTIMUM: f64 = 6.035_210_959_203e-8;

#[test]
#[ignore = "needs the data sets"]
fn optimum_of_42_redundant_parameters_is_reached() {
    let path = common::data("peers/speed/workloads/w3_samples.csv");
    let samples = std::fs::read_to_string(path).expect("readable");
    let rows = samples.split_once('\n').expect("a header row").1;
    let csv = format!("# measurement: distance\nx[m],y[m],z[m],a[rad],c[rad],r[m]\n{rows}");
    let machine = common::machine("ac_table_tilting");
    let recordings =
        [Recording::from_bytes("w3.csv", csv.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))];
    for solver in [Solver::LevenbergMarquardt, Solver::RankTruncation { cut: 1e-8 }] {
        let options =
            CalibrateOptions::default().with_solver(solver).with_loss(Loss::Squares).with_prior(false);
        let (_, fit) = calibrate(&machine, &recordings, options).unwrap_or_else(|e| panic!("{e}"));
        let rms = fit.rms.m.expect("lengths").geometric;
        let sum = rms * rms * fit.samples as f64;
        println!(
            "{solver:?}: {sum:.12e} m², {:+.1e} of the optimum, {} steps",
            sum / OPTIMUM - 1.0,
            fit.steps
        );
        assert!((sum / OPTIMUM - 1.0).abs() < 1e-9, "{solver:?}: {sum:e}");
    }
}
