//! Inverse kinematics: every machine goes where it can, quickly, and says what it cannot.

use crate::common;
use kincal::chain::Chain;
use kincal::inverse::{Goal, Inverse, InverseOptions, Mode, Outcome, Solution, foresee};
use kincal::lie::{Pose, Twist, Vec3};
use kincal::machine::JointKind;
use kincal::simulate::{random_commands, random_deviations};
use kincal::{CalibratedMachine, Machine};

use crate::common::{machine, machines};

fn rotary(machine: &Machine) -> usize {
    (0..machine.commands().len()).filter(|c| machine.command_joint(*c).kind == JointKind::Revolute).count()
}

/// Machines with three linear and two rotary joints.
fn five_axis() -> Vec<(String, Machine)> {
    machines().into_iter().filter(|(_, m)| m.commands().len() == 5 && rotary(m) == 2).collect()
}

/// The goal that the nominal machine reaches at `q`, with the tip 80 mm beyond frame `t`.
fn goal(machine: &Machine, q: &[f64]) -> Goal {
    let t_from_tip = Pose::translation(Vec3([0.0, 0.0, -0.08]));
    Goal { t_from_tip, w_from_tip: Chain::nominal(machine).w_from_t(q) * t_from_tip }
}

fn erroneous(machine: &Machine, size: f64, seed: u64) -> Chain<f64> {
    CalibratedMachine::nominal(machine.clone())
        .with_deviations(random_deviations(machine, size, seed))
        .chain()
}

fn all_free(machine: &Machine) -> Vec<bool> {
    vec![true; machine.commands().len()]
}

/// Commands well inside the travel.
fn inside(machine: &Machine, q: &[f64]) -> bool {
    (0..q.len()).all(|c| {
        let (low, high) = machine.travel(c);
        q[c] > low + 0.05 && q[c] < high - 0.05
    })
}

fn correct(machine: &Machine, chain: &Chain<f64>, q: &[f64]) -> Solution {
    Inverse::new(machine).solve(chain, &goal(machine, q), q, &all_free(machine))
}

#[test]
fn errors_beyond_all_numbers_leave_the_goal_out_of_reach() {
    let machine = machine("ac_table_tilting");
    let q = &random_commands(&machine, 1, 11)[0];
    for turns in [false, true] {
        let mut deviations = random_deviations(&machine, 1.0, 4);
        let number = if turns { &mut deviations[0].w.0[0] } else { &mut deviations[0].v.0[0] };
        *number = f64::INFINITY;
        let chain = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations).chain();
        let solution = correct(&machine, &chain, q);
        assert_eq!(solution.outcome, Outcome::Unreachable);
        assert_eq!(&solution.commands, q);
    }
}

#[test]
fn every_five_axis_machine_corrects_its_errors_in_three_steps() {
    let found = five_axis();
    assert!(found.len() >= 7, "{}", found.len());
    for (name, machine) in found {
        let inverse = Inverse::new(&machine);
        assert_eq!((inverse.mode(), inverse.freedoms()), (Mode::PositionAndAxis, (2, 3)), "{name}");
        let chain = erroneous(&machine, 1.0, 4);
        let (mut reached, mut all) = (0, 0);
        for q in random_commands(&machine, 300, 11).into_iter().filter(|q| inside(&machine, q)) {
            let three = inverse.with_options(InverseOptions::default().with_steps(3));
            let solution = three.solve(&chain, &goal(&machine, &q), &q, &all_free(&machine));
            assert!(solution.position_left_m < 1e-9, "{name}: {solution:?}");
            match solution.outcome {
                Outcome::Reached => reached += 1,
                Outcome::Singular { lost_w } => assert!((lost_w.w.norm() - 1.0).abs() < 1e-9),
                other => panic!("{name} at {q:?}: {other:?}"),
            }
            all += 1;
            // What is said of the tip is so.
            let tip = chain.w_from_t(&solution.commands) * goal(&machine, &q).t_from_tip;
            assert!((tip.translation - goal(&machine, &q).w_from_tip.translation).norm() < 1e-9);
        }
        assert!(all > 150 && reached * 20 > all * 19, "{name}: {reached} of {all}");
    }
}

#[test]
fn position_alone_takes_the_smallest_step() {
    let machine = machine("six_r_arm");
    let chain = erroneous(&machine, 1.0, 2);
    let inverse = Inverse::new(&machine).with_mode(Mode::Position);
    let (nominal, mut smaller) = (Chain::nominal(&machine), 0);
    for q in random_commands(&machine, 40, 3) {
        let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: nominal.w_from_t(&q) };
        let position = inverse.solve(&chain, &goal, &q, &all_free(&machine));
        let pose = inverse.with_mode(Mode::Pose).solve(&chain, &goal, &q, &all_free(&machine));
        if position.outcome != Outcome::Reached || pose.outcome != Outcome::Reached {
            continue;
        }
        let length = |s: &Solution| s.commands.iter().zip(&q).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        assert!(length(&position) <= length(&pose) * 1.0001, "{position:?} {pose:?}");
        smaller += 1;
    }
    assert!(smaller > 20, "{smaller}");
}

#[test]
fn arms_correct_the_whole_pose() {
    for (name, machine) in machines() {
        let inverse = Inverse::new(&machine);
        if inverse.mode() != Mode::Pose {
            continue;
        }
        // A tenth: the tolerances of light arms are for joints that nobody has mastered.
        let chain = erroneous(&machine, 0.1, 8);
        let mut missed = 0;
        let poses: Vec<_> =
            random_commands(&machine, 100, 2).into_iter().filter(|q| inside(&machine, q)).collect();
        for q in &poses {
            let solution = correct(&machine, &chain, q);
            match solution.outcome {
                Outcome::Reached => assert!(solution.angle_left_rad < 1e-10),
                _ => missed += 1,
            }
        }
        // Near-singular poses of these arms are rare, and are told.
        assert!(missed * 10 <= poses.len(), "{name}: {missed} of {}", poses.len());
    }
}

#[test]
fn machines_with_fewer_axes_reach_the_position_and_tell_what_is_left() {
    for (stem, mode) in [("xyz_mill", Mode::Position), ("four_axis_horizontal", Mode::PositionAndAxis)] {
        let machine = machine(stem);
        let inverse = Inverse::new(&machine);
        assert_eq!(inverse.mode(), mode, "{stem}");
        let chain = erroneous(&machine, 1.0, 5);
        let five = inverse.with_mode(Mode::PositionAndAxis);
        for q in random_commands(&machine, 30, 9).into_iter().filter(|q| inside(&machine, q)) {
            let solution = five.solve(&chain, &goal(&machine, &q), &q, &all_free(&machine));
            assert!(solution.position_left_m < 1e-9, "{stem}: {solution:?}");
            assert!(solution.angle_left_rad > 1e-7, "{stem}: {solution:?}");
            assert_eq!(solution.outcome, Outcome::Unreachable, "{stem}");
        }
    }
}

#[test]
fn a_lost_direction_is_named_and_the_correction_stays_small() {
    // With A at zero the tool stands along C: no joint tilts it about y.
    let machine = machine("ac_table_tilting");
    let c = machine.frame_index("c").expect("a frame");
    let mut deviations = vec![Twist::zero(0.0); machine.dyads().len()];
    deviations[c] = Twist::from_array([0.0, 0.0, 0.0, 0.0, 5e-5, 0.0]);
    let chain = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations).chain();
    let mut last = 0.0;
    for tenths in 0..40 {
        let q = [f64::from(tenths) * 1e-2, 0.2, 0.01, 0.02, 0.0];
        let solution = correct(&machine, &chain, &q);
        let turn = (solution.commands[1] - q[1]).abs();
        assert!(turn < 58.0 * 5e-5, "{turn}");
        assert!((turn - last).abs() < 5e-3, "no jump: {last} to {turn}");
        assert!(solution.position_left_m < 1e-9);
        last = turn;
        match &solution.outcome {
            Outcome::Singular { lost_w } => {
                assert!(tenths < 3, "{tenths}");
                assert!(lost_w.v.norm() < 1e-12 && lost_w.w.norm() > 0.99);
            }
            other => assert!(tenths >= 2 && *other == Outcome::Reached, "{tenths}: {other:?}"),
        }
    }
}

#[test]
fn a_joint_at_its_limit_is_named_with_the_overrun() {
    let machine = machine("ac_table_tilting");
    let z = machine.commands().iter().position(|c| c == "z").expect("z");
    let (low, _) = machine.travel(z);
    let t = machine.t_index();
    let mut deviations = vec![Twist::zero(0.0); machine.dyads().len()];
    deviations[t] = Twist::from_array([0.0, 0.0, 3e-5, 0.0, 0.0, 0.0]);
    let chain = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations).chain();
    let mut q = vec![0.5, 0.1, 0.0, 0.0, 0.0];
    q[z] = low + 1e-5;
    let solution = correct(&machine, &chain, &q);
    let Outcome::OutOfTravel { command, by } = solution.outcome else { panic!("{solution:?}") };
    assert_eq!(command, z);
    assert!((by - 2e-5).abs() < 1e-7, "{by}");
    assert_eq!(solution.commands[z], low);
}

#[test]
fn poses_out_of_reach_are_told_and_a_far_start_finds_the_way() {
    let machine = machine("six_r_arm");
    let nominal = Chain::nominal(&machine);
    let far = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: Pose::translation(Vec3([5.0, 0.0, 0.0])) };
    let solution = Inverse::new(&machine).with_mode(Mode::Position).solve(
        &nominal,
        &far,
        &[0.1; 6],
        &all_free(&machine),
    );
    assert!(solution.position_left_m > 1.0 && solution.outcome != Outcome::Reached, "{solution:?}");

    let machine = common::machine("bc_head_head");
    let nominal = Chain::nominal(&machine);
    let q = [0.1, -0.2, 0.05, 0.7, 0.9];
    let there = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: nominal.w_from_t(&q) };
    let solution = Inverse::new(&machine).solve(&nominal, &there, &[0.0; 5], &all_free(&machine));
    assert_eq!(solution.outcome, Outcome::Reached, "{solution:?}");
}

#[test]
fn many_goals_are_solved_as_one_at_a_time() {
    for stem in ["ac_table_tilting", "bc_head_head_nutating", "bc_head_table"] {
        let machine = machine(stem);
        let off = |j: usize| {
            let sizes = machine.tolerance(j).to_array().into_iter().enumerate();
            let values: Vec<f64> = sizes.map(|(k, t)| t * (1.0 + (3 * j + k) as f64).sin()).collect();
            Twist::from_array(std::array::from_fn(|k| values[k]))
        };
        let dh: Vec<Twist<f64>> = (0..machine.dyads().len()).map(off).collect();
        let (nominal, actual) = (Chain::nominal(&machine), Chain::new(&machine, &dh));
        let (inverse, count) = (Inverse::new(&machine), machine.commands().len());
        let t_from_tip = Pose::translation(Vec3([0.0, 0.0, -0.08]));
        let meant: Vec<_> =
            random_commands(&machine, 61, 8).into_iter().map(|q| q.into_iter().collect()).collect();
        let found = foresee(&inverse, (&nominal, &actual), t_from_tip, &meant);
        let apart = foresee(&inverse, (&nominal, &actual), t_from_tip, &meant[7..8]);
        let mut solved = 0;
        for found in &found {
            let goal = Goal { t_from_tip, w_from_tip: nominal.w_from_t(&found.meant) * t_from_tip };
            let single = inverse.solve(&actual, &goal, &found.meant, &vec![true; count]);
            assert_eq!(single.outcome, Outcome::Reached);
            for (a, b) in single.commands.iter().zip(&found.solution.commands) {
                assert!((a - b).abs() < 1e-12, "{}: {:?}: {a} {b}", machine.name(), found.meant);
            }
            // Neighbours do not matter.
            if let Some(apart) = apart.iter().find(|apart| apart.meant == found.meant) {
                assert_eq!(apart.solution.commands, found.solution.commands);
            }
            solved += 1;
        }
        assert!(solved > 40, "{}: {solved}", machine.name());
    }
}
