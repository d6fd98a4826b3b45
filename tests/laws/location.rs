//! Location errors as people say them.

use kincal::Machine;
use kincal::lie::{Twist, Vec3};
use kincal::location::location_errors;

/// The words agree with where the axes go: turned by 50 urad about each direction.
#[test]
fn words_say_where_the_axes_go() {
    let machine = Machine::parse(
        "m.ron",
        r#"Machine(name: "m", units: (length: mm, angle: deg),
        workpiece: [(frame: "c", joint: Revolute(axis: "z")), (frame: "w")],
        tool: [(frame: "x", joint: Prismatic(axis: "x")), (frame: "y", joint: Prismatic(axis: "y")),
               (frame: "z", joint: Prismatic(axis: "z")), (frame: "t")])"#,
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let words = |frame: &str, component: usize, value: f64, name: &str| {
        let mut dh = vec![Twist::zero(0.0); machine.dyads().len()];
        let mut all = dh[0].to_array();
        all[component] = value;
        dh[machine.frame_index(frame).expect("a frame")] = Twist::from_array(all);
        let mut found = location_errors(&machine, &dh, Vec3([0.0; 3]), None);
        // As if it had been measured without noise.
        found.errors.iter_mut().for_each(|error| (error.identified, error.std_error) = (true, 0.0));
        found.in_words().into_iter().find(|said| said.name == name).expect("a plain name").what
    };
    // Y goes towards -X.
    assert_eq!(
        words("y", 5, 5e-5, "EC0Y"),
        "X and Y are 50.0 um/m out of square: more than 90 deg between them"
    );
    // Z goes towards +X.
    assert_eq!(
        words("z", 4, 5e-5, "EB0Z"),
        "X and Z are 50.0 um/m out of square: less than 90 deg between them"
    );
    // Z goes towards -Y.
    assert_eq!(
        words("z", 3, 5e-5, "EA0Z"),
        "Y and Z are 50.0 um/m out of square: more than 90 deg between them"
    );
    assert_eq!(words("c", 4, 5e-5, "EB0C"), "the axis of C leans by 50.0 um/m towards +X");
    assert_eq!(words("c", 0, 2e-6, "EX0C"), "the axis of C lies 2.00 um towards +X of where it is declared");
}
