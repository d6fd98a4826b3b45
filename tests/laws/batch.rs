//! Many samples at a time are what one after the other is, on every shipped machine.

use crate::common;
use crate::common::random::Random;
use kincal::Machine;
use kincal::chain::{Batch, Chain};
use kincal::lie::{Pose, Twist, Vec3, Wrench};
use kincal::nalgebra::DMatrix;

/// A machine with deviations in front of its joints and behind some, and commands within a turn or a metre.
fn drawn(machine: &Machine, samples: usize, seed: u64) -> (Chain<f64>, DMatrix<f64>) {
    let mut random = Random::new(seed);
    let mut twist = || Twist::from_array(std::array::from_fn(|_| random.between(-0.02, 0.02)));
    let deviations: Vec<Twist<f64>> = machine.dyads().iter().map(|_| twist()).collect();
    let mut chain = Chain::new(machine, &deviations);
    for j in (0..machine.dyads().len()).step_by(2) {
        chain.set_carried(j, Pose::exp(twist()));
    }
    let commands = DMatrix::from_fn(samples, machine.commands().len(), |_, _| random.between(-4.0, 4.0));
    (chain, commands)
}

/// Fewer samples than lanes, full lanes, and some beyond.
const SAMPLES: [usize; 4] = [1, 3, 8, 21];

#[test]
fn poses_of_a_batch_are_those_of_the_chain() {
    for (name, machine) in common::machines() {
        for samples in SAMPLES {
            let (chain, commands) = drawn(&machine, samples, samples as u64);
            let poses = Batch::new(&chain).w_from_t(&commands);
            for k in 0..samples {
                let q: Vec<f64> = commands.row(k).iter().copied().collect();
                let one = chain.w_from_t(&q);
                for row in 0..3 {
                    let size = one.translation.norm().max(1.0);
                    let found = poses[(k, 4 * row + 3)];
                    assert!((found - one.translation.0[row]).abs() < 1e-14 * size, "{name}, sample {k}");
                    for column in 0..3 {
                        let found = poses[(k, 4 * row + column)];
                        assert!((found - one.rotation.0[row][column]).abs() < 1e-14, "{name}, sample {k}");
                    }
                }
            }
        }
    }
}

#[test]
fn one_sample_is_what_it_is_among_many() {
    let (point_w, point_t) = (Vec3([0.3, -0.2, 0.1]), Vec3([0.01, 0.02, 0.15]));
    for (name, machine) in common::machines() {
        let (chain, commands) = drawn(&machine, 21, 21);
        let (batch, width) = (Batch::new(&chain), 6 * machine.dyads().len());
        let mut rows = DMatrix::zeros(21, 1 + width);
        batch.distance_rows_into(&commands, point_w, point_t, &mut rows);
        for k in 0..21 {
            let q: Vec<f64> = commands.row(k).iter().copied().collect();
            let (pose, one) = (batch.pose(&q), chain.w_from_t(&q));
            let size = one.translation.norm().max(1.0);
            let off = (pose.translation - one.translation).norm() / size;
            let turned = (pose.inverse() * one).rotation_vector().norm();
            assert!(off < 1e-14 && turned < 1e-14, "{name}, sample {k}: {off} {turned}");
            let mut row = vec![0.0; width];
            let distance = batch.distance_row(&q, point_w, point_t, &mut row);
            let size = row.iter().fold(1.0f64, |most, x| most.max(x.abs()));
            for (i, found) in [distance].iter().chain(&row).enumerate() {
                assert!((rows[(k, i)] - found).abs() < 1e-13 * size, "{name}, sample {k}, column {i}");
            }
        }
    }
}

#[test]
fn distance_rows_of_a_batch_are_those_of_the_chain() {
    let (point_w, point_t) = (Vec3([0.3, -0.2, 0.1]), Vec3([0.01, 0.02, 0.15]));
    for (name, machine) in common::machines() {
        for samples in SAMPLES {
            let (chain, commands) = drawn(&machine, samples, 40 + samples as u64);
            let width = 6 * machine.dyads().len();
            let mut rows = DMatrix::zeros(samples, 1 + width);
            Batch::new(&chain).distance_rows_into(&commands, point_w, point_t, &mut rows);
            for k in 0..samples {
                let q: Vec<f64> = commands.row(k).iter().copied().collect();
                let sweep = chain.sweep(&q);
                let p_w = sweep.w_from_t().transform(point_t);
                let bar = p_w - point_w;
                let mut row = vec![0.0; width];
                sweep.error_row(Wrench::at_point(bar.times(bar.norm().recip()), p_w), &mut row);
                let size = row.iter().fold(1.0f64, |most, x| most.max(x.abs()));
                assert!((rows[(k, 0)] - bar.norm()).abs() < 1e-14 * size, "{name}, sample {k}");
                for (i, one) in row.iter().enumerate() {
                    assert!((rows[(k, 1 + i)] - one).abs() < 1e-13 * size, "{name}, sample {k}, column {i}");
                }
            }
        }
    }
}

#[test]
fn velocities_of_a_batch_are_the_rows_of_the_chain_by_commands() {
    let point_t = Vec3([0.01, 0.02, 0.15]);
    for (name, machine) in common::machines() {
        for samples in SAMPLES {
            let (chain, commands) = drawn(&machine, samples, 80 + samples as u64);
            let width = machine.commands().len();
            let mut velocities = DMatrix::zeros(samples, 6 * width);
            Batch::new(&chain).velocities_into(&commands, point_t, &mut velocities);
            for k in 0..samples {
                let q: Vec<f64> = commands.row(k).iter().copied().collect();
                let sweep = chain.sweep(&q);
                let p_w = sweep.w_from_t().transform(point_t);
                for component in 0..6 {
                    let unit = Vec3(std::array::from_fn(|i| f64::from(u8::from(i == component % 3))));
                    let y_w = if component < 3 { Wrench::at_point(unit, p_w) } else { Wrench::couple(unit) };
                    let mut row = vec![0.0; width];
                    sweep.command_row(&machine, y_w, &mut row);
                    let size = row.iter().fold(1.0f64, |most, x| most.max(x.abs()));
                    for (command, one) in row.iter().enumerate() {
                        let found = velocities[(k, 6 * command + component)];
                        assert!((found - one).abs() < 1e-13 * size, "{name}, sample {k}, command {command}");
                    }
                }
            }
        }
    }
}
