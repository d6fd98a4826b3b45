//! Joints of real arms: what a gear and an encoder do along a turn has no short law. It is modelled all the same, at several joints at once,
//! and holds for poses that nobody has seen.

use std::f64::consts::TAU;

use crate::common;
use crate::common::random::Random;
use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::Library;
use kincal::identify::CalibrateOptions;
use kincal::lie::Vec3;
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Chain, Machine};

/// Noise of a tracker, m.
const SIGMA: f64 = 20e-6;

/// Waves a turn, each with its amplitude (rad) and phase.
type Waves = Vec<(f64, f64, f64)>;

/// What may be of slow waves, of gear meshes and of an encoder's lines; in all about 0.2 mrad RMS.
fn waves(random: &mut Random) -> Waves {
    [1.0, 2.0, 3.0, 7.0, 18.0, 29.0, 36.0]
        .map(|order| (order, random.between(0.5, 1.5) * 100e-6, random.between(0.0, TAU)))
        .to_vec()
}

/// Settled positions of a mark that a tracker sees, each pose another one.
fn poses(machine: &Machine, count: usize, by_joint: &[(usize, Waves)], random: &mut Random) -> Recording {
    let chain: Chain<f64> = Chain::nominal(machine);
    let mut text = String::from(
        "# measurement: position\n# tool_point[mm]: 60, 0, 0\nq1[deg],q2[deg],q3[mm],q4[deg],px[mm],py[mm],pz[mm]\n",
    );
    for _ in 0..count {
        let q = [(-105.0, 105.0), (-150.0, 150.0), (0.0, 210.0), (-360.0, 360.0)]
            .map(|(from, to)| random.between(from, to));
        let mut at: Vec<f64> = q.iter().map(|q| q.to_radians()).collect();
        at[2] = 1e-3 * q[2];
        for (joint, waves) in by_joint {
            let error = |(order, size, phase): &(f64, f64, f64)| size * (order * at[*joint] + phase).sin();
            at[*joint] += waves.iter().map(error).sum::<f64>();
        }
        let p = chain.w_from_t(&at).transform(Vec3([0.06, 0.0, 0.0])).0;
        let read = p.map(|x| 1e3 * (x + SIGMA * random.normal()));
        let row: Vec<String> = q.iter().chain(&read).map(|x| format!("{x:.5}")).collect();
        text += &(row.join(",") + "\n");
    }
    Recording::from_bytes("poses.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn curves_along_a_turn_of_several_joints_are_modelled_and_hold_for_other_poses() {
    let machine = common::machine("scara");
    let mut random = Random::new(29);
    let by_joint = [(0, waves(&mut random)), (1, waves(&mut random))];
    let seen = [poses(&machine, 500, &by_joint, &mut random)];
    let other = poses(&machine, 150, &by_joint, &mut random);
    let library = Library::standard();
    let said = diagnose(&machine, &seen, &library, &DiagnoseOptions::default(), &|_| {});
    let mut said = said.unwrap_or_else(|e| panic!("{e}"));
    let parts = said.unexplained.iter().flat_map(|unexplained| &unexplained.parts);
    let of_findings = said.findings.iter().map(|finding| finding.at.clone());
    let mut at: Vec<String> =
        parts.filter(|part| part.modelled).map(|part| part.at.clone()).chain(of_findings).collect();
    at.sort_unstable();
    at.dedup();
    assert_eq!(at, ["q1", "q2"]);
    let model = said.model(&machine, &seen, CalibrateOptions::default(), &|_| {});
    let rms = |model: &CalibratedMachine| {
        let predicted = predict(model, &other, None).unwrap_or_else(|e| panic!("{e}"));
        predicted.rms.m.expect("lengths were read")
    };
    let (with, without) =
        (rms(&model.unwrap_or_else(|e| panic!("{e}"))), rms(&CalibratedMachine::nominal(machine.clone())));
    // Noise alone is 35 um in three components.
    assert!(without > 120e-6 && with < 1.15 * 3f64.sqrt() * SIGMA, "{without} -> {with}");
}
