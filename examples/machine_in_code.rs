//! Builds a machine in code, without a file, and asks it where its tool is.
//!
//! A turntable carries the workpiece; a slide, a lift and a swivel head carry the tool.
//!
//!     cargo run --release --example machine_in_code

use std::f64::consts::FRAC_PI_2;

use kincal::describe::describe;
use kincal::lie::Vec3;
use kincal::machine::{Dyad, FileUnits, Joint, MachineFault, Tolerance};
use kincal::nalgebra::Isometry3;
use kincal::{Chain, Machine, Result};

/// Both lists run from the base outwards. A dyad is a frame at a place in the one before it, with the joint that moves what follows.
fn dyads() -> (Vec<Dyad>, Vec<Dyad>) {
    let c = Joint::revolute("c", [0.0, 0.0, 1.0]).with_travel(-6.3, 6.3);
    let x = Joint::prismatic("x", [1.0, 0.0, 0.0]).with_travel(-0.4, 0.4);
    let z = Joint::prismatic("z", [0.0, 0.0, 1.0]).with_travel(0.0, 0.6);
    let b = Joint::revolute("b", [0.0, 1.0, 0.0]).with_travel(-FRAC_PI_2, FRAC_PI_2);
    // The bearing of the swivel is known to 10 um and 20 urad, better than the rest.
    let bearing = Tolerance { translation: 1e-5, rotation: 2e-5 };
    let workpiece = vec![Dyad::new("c").with_joint(c), Dyad::new("w").at([0.0, 0.0, 0.1])];
    let tool = vec![
        Dyad::new("x").at([0.0, -0.3, 0.0]).with_joint(x),
        Dyad::new("z").with_joint(z),
        Dyad::new("b").at([0.0, 0.3, 0.5]).with_joint(b).with_tolerance(bearing),
        Dyad::new("t").at([0.0, 0.0, -0.15]),
    ];
    (workpiece, tool)
}

fn main() -> Result<()> {
    let (workpiece, tool) = dyads();
    let machine = Machine::new("turn_swivel", FileUnits::si(), workpiece, tool)?
        .with_tolerance(Tolerance { translation: 5e-5, rotation: 1e-4 })?
        .with_about(Some("a turntable under a swivel head".into()));
    assert_eq!(machine.commands(), ["c", "x", "z", "b"]);
    println!("{}\n{}", machine.name(), describe(&machine).topology.join("\n"));

    // The pose of the tool in the workpiece frame. C at a right angle turns what the slide does along X into -Y of the workpiece.
    let chain = Chain::nominal(&machine);
    let w_from_t: Isometry3<f64> = chain.w_from_t(&[FRAC_PI_2, 0.2, 0.1, 0.0]).into();
    println!("tool at {:.3?} m", w_from_t.translation.vector.as_slice());
    let expected = Vec3([0.0, -0.2, 0.35]);
    assert!((Vec3::from(w_from_t.translation.vector) - expected).norm() < 1e-12);

    // It is written as a machine file, and reads back as the same machine.
    let ron = machine.to_ron();
    println!("{ron}");
    assert_eq!(Machine::parse("turn_swivel.ron", &ron)?, machine);

    // What cannot be is refused, with the value and the mend.
    let (workpiece, mut tool) = dyads();
    tool[0].joint = Some(Joint::prismatic("x", [1.0, 0.1, 0.0]));
    let error = Machine::new("crooked", FileUnits::si(), workpiece, tool).unwrap_err();
    println!("{error}; {}", error.mend());
    assert!(matches!(error.fault(), Some(MachineFault::AxisLength { .. })));
    Ok(())
}
