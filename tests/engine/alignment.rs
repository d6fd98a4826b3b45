//! Set-ups found from nothing: frames, tool points, lengths and zeros, whatever the machine file says of frame `w`.

use crate::common;
use kincal::identify::{CalibrateOptions, Fit, calibrate, fit_setup};
use kincal::lie::{Pose, Twist, Vec3};
use kincal::machine::Placement;
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine};

const NOISE: f64 = 2e-5;

fn machine_with_w(machine: &Machine, m_from_w: Pose<f64>) -> Machine {
    let mut dyads = machine.dyads().to_vec();
    dyads[machine.w_index()].placement = Placement::from(m_from_w);
    let tool = dyads.split_off(machine.workpiece_count());
    Machine::new(machine.name(), machine.units(), dyads, tool)
        .and_then(|m| m.with_tolerance(machine.default_tolerance()))
        .expect("as sound as before")
}

fn pose(v: [f64; 3], w: [f64; 3]) -> Pose<f64> {
    Pose { rotation: Pose::exp(Twist::new(Vec3([0.0; 3]), Vec3(w))).rotation, translation: Vec3(v) }
}

/// A recording made where `w` stands somewhere else than the machine file says, and the machine as declared.
fn foreign(sensor: Sensor, header: &[&str], noise_free: bool, seed: u64) -> (Machine, String, Pose<f64>) {
    let declared = common::machine("six_r_arm");
    let m_from_w = pose([1.3, -0.7, 0.4], [0.4, -2.1, 1.9]);
    let there = machine_with_w(&declared, m_from_w);
    let size = if noise_free { 0.0 } else { 1.0 };
    let mut deviations = random_deviations(&there, size, seed);
    deviations[there.w_index()] = Twist::zero(0.0);
    let truth = CalibratedMachine::nominal(there).with_deviations(deviations);
    let noise = if noise_free { 0.0 } else { NOISE };
    let mut instrument = Instrument::new(sensor, noise, noise);
    instrument.state.tool_point_t = Vec3([0.05, 0.02, 0.11]);
    instrument.state.workpiece_point_w = Vec3([0.2, 0.1, 0.05]);
    instrument.state.length = 0.3;
    instrument.state.zero = 0.004;
    let lines: Vec<String> = header.iter().map(|h| h.to_string()).collect();
    let csv = recording(&truth, &instrument, &random_commands(&declared, 400, seed + 1), &lines, seed + 2);
    (declared, csv, m_from_w)
}

fn run(machine: &Machine, csv: &str) -> (CalibratedMachine, Fit) {
    let recordings =
        [Recording::from_bytes("r.csv", csv.as_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))];
    calibrate(machine, &recordings, CalibrateOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn distance(a: Pose<f64>, b: Pose<f64>) -> (f64, f64) {
    let gap = (a.inverse() * b).log();
    (gap.v.norm(), gap.w.norm())
}

#[test]
fn unknown_frame_is_found_from_positions_poses_and_unknown_tool_points() {
    let known = "tool_point[m]: 0.05, 0.02, 0.11";
    for (sensor, point) in [
        (Sensor::Position, known),
        (Sensor::Pose, known),
        (Sensor::Position, "tool_point: unknown prism"),
        (Sensor::Pose, "tool_point: unknown prism"),
    ] {
        let (machine, csv, m_from_w) =
            foreign(sensor.clone(), &["workpiece_frame: unknown", point], true, 11);
        let (calibrated, fit) = run(&machine, &csv);
        let rms = fit.rms.m.expect("lengths");
        assert!(rms.nominal < 1e-9 && rms.geometric < 1e-9, "{sensor:?} {point}: {rms:?}");
        let found = calibrated.chain_of_setup("").expect("the set-up").previous_from_frame(machine.w_index());
        let (far, turned) = distance(found, m_from_w);
        assert!(far < 1e-6 && turned < 1e-6, "{sensor:?} {point}: {far:e} m, {turned:e} rad off");
    }
}

#[test]
fn unknown_frame_is_found_whatever_the_machine_file_says_of_it() {
    // The declared frame is right, half a turn wrong about each axis, or anywhere.
    let pi = std::f64::consts::PI;
    let (declared, csv, m_from_w) =
        foreign(Sensor::Position, &["workpiece_frame: unknown", "tool_point: unknown ball"], false, 23);
    let starts = [[0.0; 3], [pi, 0.0, 0.0], [0.0, pi, 0.0], [0.0, 0.0, pi], [0.3, -1.2, 2.2]];
    let mut figures = Vec::new();
    for start in starts {
        let machine = machine_with_w(&declared, m_from_w * pose([0.1, 2.0, -5.0], start));
        let (_, fit) = run(&machine, &csv);
        figures.push(fit.rms.m.expect("lengths").geometric);
    }
    for figure in &figures {
        assert!((figure / figures[0] - 1.0).abs() < 1e-3, "{figures:?}");
        assert!(*figure < 1.9 * NOISE, "{figures:?}");
    }
}

#[test]
fn unknown_frame_zero_and_length_are_found_from_distances_and_displacements() {
    let point = "tool_point[m]: 0.05, 0.02, 0.11";
    let centre = "workpiece_point[m]: 0.2, 0.1, 0.05";
    let unknown = "workpiece_frame: unknown";
    for (sensor, header) in [
        (Sensor::Distance { absolute: true }, vec![unknown, point, centre]),
        (Sensor::Distance { absolute: false }, vec![unknown, point, centre, "nominal_length[m]: 0.3"]),
        (Sensor::Distance { absolute: false }, vec![unknown, point, centre, "nominal_length: unknown"]),
        (Sensor::Displacement { direction_w: Vec3([0.6, 0.0, 0.8]) }, vec![unknown, point, "zero: unknown"]),
    ] {
        let (machine, csv, _) = foreign(sensor.clone(), &header, true, 31);
        let (calibrated, fit) = run(&machine, &csv);
        let rms = fit.rms.m.expect("lengths");
        assert!(rms.nominal < 1e-8, "{header:?}: {rms:?}");
        // One centre, or one direction, cannot show how `w` is turned: that is told.
        assert!(fit.warnings.iter().any(|w| w.contains("not seen")), "{:?}", fit.warnings);
        let recordings =
            [Recording::from_bytes("r.csv", csv.as_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"))];
        let error = predict(&calibrated, &recordings[0], None).unwrap_or_else(|e| panic!("{e}"));
        assert!(error.rms.m.expect("lengths") < 1e-8, "{header:?}: {error:?}");
    }
}

#[test]
fn two_socket_points_leave_the_turn_about_their_line_and_that_is_told() {
    let machine = common::machine("six_r_arm");
    let truth =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 1.0, 3));
    let chain = truth.chain();
    let m_from_w = pose([0.6, 0.1, 0.3], [0.2, 0.1, -0.4]);
    // Poses that bring the tool point into one of two sockets, with the tool turned every way.
    let mut csv = String::from(
        "# measurement: position\n# workpiece_frame: unknown\nq1[rad],q2[rad],q3[rad],q4[rad],q5[rad],q6[rad],px[m],py[m],pz[m]\n",
    );
    let mut made = 0;
    for (k, start) in random_commands(&machine, 600, 4).iter().enumerate() {
        let socket = Vec3([0.05 * (k % 2) as f64, 0.0, 0.0]);
        // The ball has play in its socket.
        let play = Vec3([0.0, 1.0, 2.0].map(|c| NOISE * (12.9898 * (3.0 * k as f64 + c)).sin()));
        let target = m_from_w.transform(socket + play);
        let axis = Vec3([(k as f64).sin(), (k as f64).cos(), 0.7]);
        let axis = axis.times(1.0 / axis.norm());
        let Some(q) = common::aimed(&chain, &machine, target, axis, start) else { continue };
        let q: Vec<String> = q.iter().map(|x| format!("{x:.12}")).collect();
        csv.push_str(&format!("{},{},0,0\n", q.join(","), socket.0[0]));
        made += 1;
    }
    assert!(made > 100, "only {made} poses reached");
    let (_, fit) = run(&machine, &csv);
    let rms = fit.rms.m.expect("lengths");
    assert!(rms.geometric < 0.05 * rms.nominal, "{rms:?}");
    assert_eq!(fit.open.len(), 1, "{:?}", fit.open);
    assert_eq!(fit.open[0], "the turn of w about its x axis");
}

#[test]
fn gross_outliers_do_not_mislead_the_alignment() {
    let (machine, csv, m_from_w) =
        foreign(Sensor::Position, &["workpiece_frame: unknown", "tool_point: unknown ball"], true, 41);
    let mut row = 0;
    let spoilt: Vec<String> = csv
        .lines()
        .map(|line| {
            let data = !line.starts_with(['#', 't']);
            row += usize::from(data);
            if !data || row % 12 != 0 {
                return line.to_string();
            }
            let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
            cells[8] = "3.5".into();
            cells.join(",")
        })
        .collect();
    let (calibrated, fit) = run(&machine, &spoilt.join("\n"));
    let found = calibrated.chain_of_setup("").expect("the set-up").previous_from_frame(machine.w_index());
    let (far, turned) = distance(found, m_from_w);
    assert!(far < 1e-5 && turned < 1e-5, "{far:e} m, {turned:e} rad off");
    assert_eq!(fit.down_weighted, 33);
}

#[test]
fn recordings_of_several_set_ups_share_the_machine_but_not_the_frame() {
    let declared = common::machine("six_r_arm");
    let deviations = {
        let mut all = random_deviations(&declared, 1.0, 8);
        all[declared.w_index()] = Twist::zero(0.0);
        all
    };
    let frames = [pose([1.0, 0.2, 0.0], [0.0, 0.1, 1.0]), pose([-0.5, 0.9, 0.3], [2.0, 0.1, 0.0])];
    let record = |n: usize, seed: u64| {
        let there = machine_with_w(&declared, frames[n]);
        let truth = CalibratedMachine::nominal(there).with_deviations(deviations.clone());
        let instrument = Instrument::new(Sensor::Position, NOISE, 0.0);
        let header = [format!("setup: place {n}"), "workpiece_frame: unknown".into()];
        recording(&truth, &instrument, &random_commands(&declared, 200, seed), &header, seed + 1)
    };
    let texts = [record(0, 50), record(1, 60)];
    let open = |text: &String| {
        Recording::from_bytes("r.csv", text.as_bytes(), &declared).unwrap_or_else(|e| panic!("{e}"))
    };
    let recordings: Vec<_> = texts.iter().map(open).collect();
    let (calibrated, fit) =
        calibrate(&declared, &recordings, CalibrateOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(fit.setups.len(), 2);
    assert!(fit.rms.m.expect("lengths").geometric < 1.8 * NOISE);
    // A third place, which the calibration has not seen: only the set-up is found again.
    let new = [open(&record(1, 70).replace("place 1", "place 7"))];
    let error = predict(&calibrated, &new[0], None).expect_err("an unknown set-up");
    assert!(error.mend().contains("--fit-setup"), "{}", error.mend());
    let fitted = fit_setup(&calibrated, &new, Default::default()).unwrap_or_else(|e| panic!("{e}"));
    let prediction = predict(&fitted, &new[0], None).unwrap_or_else(|e| panic!("{e}"));
    assert!(prediction.rms.m.expect("lengths") < 1.9 * NOISE, "{prediction:?}");
}
