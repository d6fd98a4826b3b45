//! Ballbar recordings along circles and cones have the figures of ISO 230-4.

use kincal::circular::{CircularTest, SeenFrom, circular_tests};
use kincal::{CalibratedMachine, Machine, Recording};

const MILL: &str = r#"Machine(name: "mill", units: (length: mm, angle: deg), workpiece: [(frame: "w")],
    tool: [(frame: "x", joint: Prismatic(axis: "x")), (frame: "y", joint: Prismatic(axis: "y")),
           (frame: "z", joint: Prismatic(axis: "z")), (frame: "t")])"#;

/// A circle of 100 mm, once to and fro, with this reading at an angle and in a sense.
fn tested(elevation: f64, reading: impl Fn(f64, f64) -> f64) -> CircularTest {
    let machine = Machine::parse("mill.ron", MILL).unwrap_or_else(|e| panic!("{e}"));
    let mut text =
        String::from("# measurement: distance\n# nominal_length[mm]: 100\nx[mm],y[mm],z[mm],d[um]\n");
    for k in (0..=720).chain((0..720).rev()).enumerate() {
        let (order, step) = k;
        let angle = f64::from(step).to_radians() / 2.0;
        let sense = if order <= 720 { 1.0 } else { -1.0 };
        let (r, z) = (100.0 * elevation.cos(), 100.0 * elevation.sin());
        text += &format!("{},{},{z},{}\n", r * angle.cos(), r * angle.sin(), reading(angle, sense));
    }
    let recording =
        Recording::from_bytes("circle.csv", text.into_bytes(), &machine).unwrap_or_else(|e| panic!("{e}"));
    let nominal = CalibratedMachine::nominal(machine);
    let mut found = circular_tests(&nominal, &[recording]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(found.len(), 1);
    found.remove(0)
}

#[test]
fn an_eccentric_circle_with_play_has_the_figures_of_the_standard() {
    // 3 um too large, 5 um off in x, 20 um oval, 2 um between both senses.
    let test = tested(0.0, |a, sense| 3.0 + 5.0 * a.cos() + 10.0 * (2.0 * a).cos() + sense);
    assert!(test.is_circle() && test.seen_from == SeenFrom::Workpiece);
    assert_eq!(test.axis, [0.0, 0.0, 1.0]);
    let near = |found: Option<f64>, um: f64| {
        let found = found.expect("a figure");
        assert!((found - 1e-6 * um).abs() < 5e-8, "{found} {um}");
    };
    let ccw = test.counter_clockwise.expect("travelled");
    near(Some(ccw.g_m), 20.0);
    near(ccw.f_max_m, 19.0);
    near(test.clockwise.expect("travelled").f_max_m, 17.0);
    near(test.g_both_m, 22.0);
    near(test.h_m, 2.0);
    near(test.d_m, 3.0);
    near(Some(test.centre_m[0]), 5.0);
}

#[test]
fn an_inclined_bar_is_a_cone() {
    let test = tested(0.5, |_, _| 0.0);
    assert!(!test.is_circle());
    assert!((test.half_apex_rad - (std::f64::consts::FRAC_PI_2 - 0.5)).abs() < 1e-3);
}
