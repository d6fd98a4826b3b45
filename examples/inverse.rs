//! Brings the tool of a calibrated arm to a pose, and tells where a joint would have to leave its travel.
//!
//! The arm does not stand where its drawing says. The commands of the drawing miss the goal by tenths of a millimetre; those of the
//! calibrated chain reach it.
//!
//!     cargo run --release --example inverse

use kincal::inverse::{Goal, Inverse, Mode, Outcome};
use kincal::lie::Pose;
use kincal::nalgebra::{Isometry3, Translation3, UnitQuaternion};
use kincal::simulate::random_deviations;
use kincal::{CalibratedMachine, Machine, Result};

fn main() -> Result<()> {
    let machine = Machine::parse("six_r_arm.ron", include_str!("../machines/six_r_arm.ron"))?;
    // Of an arm that was measured: `CalibratedMachine::open("calibrated.ron")?`.
    let calibrated =
        CalibratedMachine::nominal(machine.clone()).with_deviations(random_deviations(&machine, 0.5, 4));
    let chain = calibrated.chain();

    // Six joints: the whole pose counts.
    let inverse = Inverse::new(&machine);
    assert_eq!(inverse.mode(), Mode::Pose);
    let all_free = vec![true; machine.commands().len()];

    // 500 mm in front, 150 mm to the left, 450 mm up; the tool looks down.
    let position = Translation3::new(0.5, 0.15, 0.45);
    let w_from_tip = Isometry3::from_parts(position, UnitQuaternion::from_euler_angles(0.0, 1.5, 0.2));
    let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: w_from_tip.into() };
    let start: Vec<f64> = [10.0, 10.0, 20.0, 0.0, 50.0, 0.0].map(f64::to_radians).to_vec();

    let nominal =
        inverse.solve(&CalibratedMachine::nominal(machine.clone()).chain(), &goal, &start, &all_free);
    let found = inverse.solve(&chain, &goal, &nominal.commands, &all_free);
    assert_eq!(found.outcome, Outcome::Reached);
    for (name, (drawn, real)) in machine.commands().iter().zip(nominal.commands.iter().zip(&found.commands)) {
        println!(
            "{name}: {:9.4} deg by the drawing, {:9.4} deg calibrated",
            drawn.to_degrees(),
            real.to_degrees()
        );
    }
    let miss = |commands: &[f64]| {
        let there: Isometry3<f64> = chain.w_from_t(commands).into();
        (there.translation.vector - w_from_tip.translation.vector).norm()
    };
    println!(
        "missed by {:.3} mm and by {:.1e} mm",
        1e3 * miss(&nominal.commands),
        1e3 * miss(&found.commands)
    );
    assert!(miss(&nominal.commands) > 1e-4 && miss(&found.commands) < 1e-9);

    // A goal that only q1 at 175 deg reaches from here, and q1 ends at 170 deg.
    let beyond: Vec<f64> = [175.0, 10.0, 20.0, 0.0, 50.0, 0.0].map(f64::to_radians).to_vec();
    let near: Vec<f64> = [165.0, 10.0, 20.0, 0.0, 50.0, 0.0].map(f64::to_radians).to_vec();
    let goal = Goal { t_from_tip: Pose::identity(0.0), w_from_tip: chain.w_from_t(&beyond) };
    match inverse.solve(&chain, &goal, &near, &all_free).outcome {
        Outcome::OutOfTravel { command, by } => {
            println!(
                "{} would have to go {:.2} deg beyond its travel",
                machine.commands()[command],
                by.to_degrees()
            );
            assert_eq!(machine.commands()[command], "q1");
            assert!((by - 5f64.to_radians()).abs() < 1e-6);
        }
        other => panic!("q1 ends before the goal, but the outcome is {other:?}"),
    }
    Ok(())
}
