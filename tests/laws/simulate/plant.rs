//! The machine that errs, and the instrument that reads it.

use super::*;

/// What a joint with play does to `s` along positions of one command, the others at rest.
fn play(plant: &Plant, command: usize, path: &[f64], directions: Option<&[i8]>) -> Vec<f64> {
    let machine = plant.machine();
    let (j, joint) =
        machine.joints().find(|(_, joint)| joint.name == machine.commands()[command]).expect("a joint");
    let sample = |k: usize| {
        let mut q = rest(machine);
        q[command] = path[k];
        let directions = directions.map(|d| {
            let mut all = vec![0; q.len()];
            all[command] = d[k];
            all
        });
        Sample { time: k as f64, q, directions, recorded: true, at: At::Pose(k + 1) }
    };
    let all: Vec<Sample> = (0..path.len()).map(sample).collect();
    let first = plant.first_directions(all.iter().cloned().map(Ok)).expect("samples");
    let mut state = plant.start(first);
    let xi = joint.twist();
    let mut error = |sample: &Sample| {
        plant.advance(&mut state, sample);
        let dh = state.deviations()[j] - plant.constant()[j];
        xi.v.dot(dh.v) + xi.w.dot(dh.w)
    };
    all.iter().map(&mut error).collect()
}

#[test]
fn play_on_a_loop_is_the_analytic_one() {
    let machine = common::machine("linear_axis");
    let plant =
        plant(&machine, "Faults(units: (length: um, angle: urad), backlash: [(joint: \"x\", width: 10)])");
    let path: Vec<f64> = (0..=400).map(|k| 1e-6 * f64::from(200 - (k - 200i32).abs())).collect();
    let got = play(&plant, 0, &path, None);
    for (k, (error, q)) in got.iter().zip(&path).enumerate() {
        // Trails by half the width; behind the turning point at 200 um the play is crossed first.
        let expected = if k <= 200 { -5e-6 } else { (-5e-6 + (200e-6 - q)).min(5e-6) };
        assert!((error - expected).abs() < 1e-15, "{k}: {error} for {expected}");
    }
}

#[test]
fn play_by_position_is_half_its_width_once_it_is_crossed() {
    let machine = common::machine("rotary_axis");
    let text = "Faults(units: (length: um, angle: urad), backlash: [(joint: \"c\", by_position: Harmonics(mean: 60, cos: [24]))])";
    let plant = plant(&machine, text);
    let path: Vec<f64> = (0..=720).map(|k| f64::from(360 - (k - 360i32).abs()).to_radians()).collect();
    for (k, (error, q)) in play(&plant, 0, &path, None).iter().zip(&path).enumerate() {
        let half = 0.5 * (60e-6 + 24e-6 * q.cos());
        let expected = if k <= 360 { -half } else { half };
        assert!((error - expected).abs() < 1e-15, "{k}: {error} for {expected}");
    }
}

#[test]
fn before_the_first_motion_play_lies_on_its_side_and_settled_positions_on_that_of_their_approach() {
    let machine = common::machine("linear_axis");
    let plant =
        plant(&machine, "Faults(units: (length: um, angle: urad), backlash: [(joint: \"x\", width: 10)])");
    let close = |got: Vec<f64>, expected: &[f64]| {
        let same = got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15);
        assert!(same, "{got:?} for {expected:?}");
    };
    close(play(&plant, 0, &[0.0, 0.0, -0.1, -0.2], None), &[5e-6; 4]);
    close(play(&plant, 0, &[0.0, 0.1, 0.2, 0.3], Some(&[1, -1, -1, 1])), &[-5e-6, 5e-6, 5e-6, -5e-6]);
    // Without a motion and without a side there is no play to be seen.
    close(play(&plant, 0, &[0.0, 0.0], None), &[0.0; 2]);
}

#[test]
fn a_joint_that_follows_others_has_its_own_play() {
    let machine = common::machine("dlr_justin_left");
    let joint = machine.joints().find(|(_, joint)| joint.name == "torso4").expect("it follows").0;
    let plant = plant(
        &machine,
        "Faults(units: (length: um, angle: urad), backlash: [(joint: \"torso4\", width: 100)])",
    );
    let command = machine.commands().iter().position(|c| c == "torso2").expect("it leads");
    let sample = |q2: f64| {
        let mut q = rest(&machine);
        q[command] = q2;
        Sample { time: 0.0, q, directions: None, recorded: true, at: At::Pose(1) }
    };
    let samples = [0.0, 0.1, 0.2].map(sample);
    let mut state = plant.start(plant.first_directions(samples.iter().cloned().map(Ok)).expect("samples"));
    for sample in &samples {
        plant.advance(&mut state, sample);
        // torso2 moves up, torso4 therefore down: what trails lies above.
        assert!((state.deviations()[joint].w.0[2] - 50e-6).abs() < 1e-15);
    }
}

#[test]
fn displaced_axes_and_offsets_are_exact() {
    let machine = common::machine("bc_head_table");
    let faults = "Faults(units: (length: um, angle: urad),
        twists: [(joint: \"c\", v: (300, -200, 5), w: (400, 100, 0)), (joint: \"z\", w: (500, -300, 0)), (joint: \"b\", v: (0, 0, 70))],
        displacements: [(joint: \"y\", offset: 90), (joint: \"b\", offset: -250)])";
    let plant = plant(&machine, faults);
    let actual = Chain::new(&machine, plant.constant());
    let micro = |v: [f64; 3], w: [f64; 3]| Twist::new(Vec3(v), Vec3(w)).times(1e-6);
    let nothing = Twist::zero(0.0);
    for (k, q) in kincal::simulate::random_commands(&machine, 20, 5).into_iter().enumerate() {
        let branch = |frames: std::ops::Range<usize>| {
            frames.fold(Pose::identity(0.0), |behind, j| {
                let dyad = &machine.dyads()[j];
                let Some(joint) = &dyad.joint else { return behind * dyad.placement.pose() };
                let (d, offset) = match joint.name.as_str() {
                    "c" => (micro([300.0, -200.0, 5.0], [400.0, 100.0, 0.0]), 0.0),
                    "z" => (micro([0.0; 3], [500.0, -300.0, 0.0]), 0.0),
                    "b" => (micro([0.0, 0.0, 70.0], [0.0; 3]), -250e-6),
                    "y" => (nothing, 90e-6),
                    _ => (nothing, 0.0),
                };
                // exp(Ad(exp d) xi (q + offset))
                let xi = Pose::exp(d).carry_twist(joint.twist());
                behind * dyad.placement.pose() * Pose::exp(xi.times(machine.displacements(&q)[j] + offset))
            })
        };
        let w = machine.workpiece_count();
        let expected = branch(0..w).inverse() * branch(w..machine.dyads().len());
        let off = (expected.inverse() * actual.w_from_t(&q)).log().to_array();
        assert!(off.iter().all(|x| x.abs() < 1e-13), "pose {k}: {off:?}");
    }
}

#[test]
fn noise_has_the_statistics_that_it_is_said_to_have() {
    let machine = common::machine("linear_axis");
    let plant = Plant::new(&CalibratedMachine::nominal(machine.clone()));
    let state = plant.start(Vec::new());
    let draw = |instrument: &Instrument, n: usize| -> Vec<Option<f64>> {
        let mut rng = noise_of(7, 0);
        (0..n).map(|_| instrument.read(&machine, &state, &[0.0], &mut rng).map(|v| v[0])).collect()
    };
    let n = 100_000;
    let mean_and_deviation = |values: &[Option<f64>]| {
        let mean = values.iter().flatten().sum::<f64>() / n as f64;
        let square = values.iter().flatten().map(|x| (x - mean).powi(2)).sum::<f64>();
        (mean * 1e6, (square / n as f64).sqrt() * 1e6)
    };
    for (scatter, mean, deviation, largest) in [
        (Scatter::Normal, 0.0, 10.0, f64::INFINITY),
        (Scatter::Uniform, 5.0, 10.0 / 12f64.sqrt(), 10.0),
        (Scatter::Symmetric, 0.0, 20.0 / 12f64.sqrt(), 10.0),
    ] {
        let mut instrument =
            Instrument::new(Sensor::Displacement { direction_w: Vec3([1.0, 0.0, 0.0]) }, 1e-5, 0.0);
        instrument.scatter = scatter;
        let values = draw(&instrument, n);
        let (m, s) = mean_and_deviation(&values);
        // Four standard errors.
        assert!((m - mean).abs() < 4.0 * deviation / (n as f64).sqrt(), "{scatter:?}: mean {m}");
        assert!(
            (s - deviation).abs() < 4.0 * deviation / (2.0 * n as f64).sqrt(),
            "{scatter:?}: deviation {s}"
        );
        assert!(values.iter().flatten().all(|x| x.abs() * 1e6 <= largest));
    }
    let mut coarse = Instrument::new(Sensor::Displacement { direction_w: Vec3([1.0, 0.0, 0.0]) }, 1e-5, 0.0);
    (coarse.resolution.m, coarse.drop_outs, coarse.outliers, coarse.outlier.m) = (4e-6, 0.1, 0.01, 1e-2);
    let values = draw(&coarse, n);
    assert!(values.iter().flatten().all(|x| (x / 4e-6 - (x / 4e-6).round()).abs() < 1e-6));
    let dropped = values.iter().filter(|v| v.is_none()).count() as f64 / n as f64;
    assert!((dropped - 0.1).abs() < 4.0 * (0.09 / n as f64).sqrt(), "{dropped}");
    let far = values.iter().flatten().filter(|x| x.abs() > 1e-4).count() as f64 / n as f64;
    assert!((far - 0.009).abs() < 1e-3, "{far}");
}
