//! The path and the preset errors of the paper, as its tables print them.

use super::random::Random;
use kincal::lie::{Twist, Vec3};
use kincal::machine::JointKind;
use kincal::simulate::{Balls, Faults, Figure, Pace, Plant, Rounding, Sense, Turning, Turns, Width, rest};
use kincal::{CalibratedMachine, Machine, Result};

/// The executed path of the paper (tables 7 and 9) with a bar of `length` (m): the cone without tool centre point function, both
/// rotary axes against the sense that aims the tool, a stop after each half turn, to 360° and back, a position every `step` (rad;
/// the paper has 0.1°), rounded as the tables are. `docs/simulate.md` says how that was found out.
///
/// # Errors
/// `Error::Motion` where the machine has not two rotary axes, or does not reach the path.
pub fn paper_path(machine: &Machine, length: f64, step: f64) -> Result<Turning> {
    use std::f64::consts::{FRAC_PI_4, FRAC_PI_6};
    let figure = Figure::Cone {
        half_apex: FRAC_PI_4,
        inclination: FRAC_PI_6,
        lead: 0.0,
        tool_centre_point: false,
        reversed: true,
    };
    let origin = Vec3([0.0; 3]);
    let balls = Balls { workpiece_point_w: origin, tool_point_t: origin, length };
    let turns = Turns {
        from: 0.0,
        to: std::f64::consts::TAU,
        senses: vec![Sense::Positive, Sense::Negative],
        parts: 2,
        repeat: 1,
        overshoot: 0.0,
        dwell: 0.0,
        paces: vec![Pace::Steps(step)],
    };
    let rounding = Rounding { direction_decimals: Some(5), rotary_step: Some(1e-3f64.to_radians()) };
    Turning::new(machine, figure, balls, &rest(machine), turns.legs(), 100.0, rounding)
}

/// A machine as in the experiments on piecewise models: random deviations of every frame (normal, 50 um and 100 urad), play of 60 (1 +
/// 0.4 cos q) urad on the first rotary axis and 40 urad on the second, 20 urad of the first that gravity turns it by (as the sine of
/// its angle), and 2.5 um at the tool that no model has (harmonics of both angles with random phases).
pub fn paper_plant(machine: &Machine, seed: u64) -> Plant {
    let mut rng = Random::new(seed);
    let mut random = |size: [f64; 6]| Twist::from_array(size.map(|s| s * rng.normal()));
    let (um, urad) = (1e-6, 1e-6);
    let size = [50.0 * um, 50.0 * um, 50.0 * um, 100.0 * urad, 100.0 * urad, 100.0 * urad];
    let deviations = (0..machine.dyads().len()).map(|j| (j, random(size))).collect();
    let dyad = |command: &usize| {
        let name = &machine.commands()[*command];
        machine.joints().find(|(_, joint)| joint.name == *name).map(|(j, joint)| (j, joint.twist()))
    };
    let rotary: Vec<(usize, Twist<f64>)> = rotary_commands(machine).iter().filter_map(dyad).take(2).collect();
    let by_angle = Width::Harmonics {
        mean: 60.0 * urad,
        cos: vec![24.0 * urad],
        sin: Vec::new(),
        period: std::f64::consts::TAU,
    };
    let backlash = rotary.iter().map(|(j, _)| *j).zip([by_angle, Width::Constant(40.0 * urad)]).collect();
    let mut faults = Faults::default();
    (faults.deviations, faults.backlash) = (deviations, backlash);
    let phases = random([std::f64::consts::PI; 6]).to_array();
    let mut plant = Plant::new(&CalibratedMachine::nominal(machine.clone())).with_faults(&faults);
    if let Some((j, xi)) = rotary.first().copied() {
        plant = plant.with_varying(j, move |s| xi.times(20.0 * urad * s[j].sin()));
    }
    let angles: Vec<usize> = rotary.iter().map(|(j, _)| *j).collect();
    plant.with_varying(machine.t_index(), move |s| {
        let of = |i: usize| angles.get(i).map_or(0.0, |j| s[*j]);
        let (a, c) = (of(0), of(1));
        let wave = |k: usize| (3.0 * c + phases[k]).cos() + (5.0 * a + phases[3 + k]).sin();
        Twist::new(Vec3([0, 1, 2].map(|k| 2.5 * um * wave(k) / 3f64.sqrt())), Vec3([0.0; 3]))
    })
}

fn rotary_commands(machine: &Machine) -> Vec<usize> {
    let commands = 0..machine.commands().len();
    commands.filter(|c| machine.command_joint(*c).kind == JointKind::Revolute).collect()
}
