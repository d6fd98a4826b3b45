//! Lag, lost motion and compliance in an exported model of MuJoCo: what stands between a command and its joint, in numbers.

use kincal::CalibratedMachine;
use kincal::export::{ExportOptions, Exported, Format, export};

/// A slide with effects along it; each a value and what it multiplies.
fn model(effects: &[(&str, f64, &str)]) -> Exported {
    let effects: Vec<String> = effects
        .iter()
        .map(|(name, value, feature)| {
            format!(
                "(effect: \"{name}\", at: \"x\", terms: [(value: {value:e}, parts: [(slot: Before(\"x\"), v: (1, 0, 0), w: (0, 0, 0), feature: {feature})])])"
            )
        })
        .collect();
    let text = format!(
        "Machine(name: \"slide\", units: (length: mm, angle: deg), workpiece: [(frame: \"w\")],
        tool: [(frame: \"x\", joint: Prismatic(axis: \"x\", travel: (0, 500))), (frame: \"t\")],
        calibration: (deviations: [], unseen: [], effects: [{}]))",
        effects.join(", ")
    );
    let calibrated = CalibratedMachine::parse("slide.ron", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    export(&calibrated, Format::Mjcf, &ExportOptions::default()).expect("a model")
}

const LAG: &str = "Product([Number(-1), Of(\"x\", Velocity)])";
const INERTIA: &str = "Product([Number(-1), Of(\"x\", Acceleration)])";
const FRICTION: &str = "Product([Number(-0.5), Of(\"x\", TakeUp(Number(1e-3)))])";
const PLAY: &str = "Product([Number(-0.5), Of(\"x\", Direction)])";

/// A number that the export tells.
fn told(exported: &Exported, name: &str) -> f64 {
    let number = exported.numbers.iter().find(|number| number.name == name);
    number.and_then(|number| number.value).unwrap_or_else(|| panic!("{name}: {:?}", exported.numbers))
}

/// An attribute of the first line that holds a text.
fn attribute(exported: &Exported, line: &str, name: &str) -> f64 {
    let found = exported.text.lines().find(|own| own.contains(line)).unwrap_or_else(|| panic!("{line}"));
    let value = found.split(&format!(" {name}=\"")).nth(1).and_then(|rest| rest.split('"').next());
    value.and_then(|value| value.parse().ok()).unwrap_or_else(|| panic!("{name} in {found}"))
}

fn near(x: f64, y: f64) -> bool {
    (x - y).abs() <= 1e-9 * y.abs()
}

#[test]
fn a_lag_is_a_delay_of_both_actuators_and_a_lead_is_fed_forward() {
    let late = model(&[("servo_lag", 4e-3, LAG)]);
    assert!(late.left_out.is_empty(), "{:?}", late.left_out);
    assert!(near(told(&late, "delay of x"), 4e-3));
    for actuator in ["name=\"position of x\"", "name=\"velocity of x\""] {
        assert!(near(attribute(&late, actuator, "delay"), 4e-3));
        // As many steps as the delay is long, and those beside it.
        assert!(near(attribute(&late, actuator, "nsample"), 10.0));
    }
    let early = model(&[("servo_lag", -2e-3, LAG)]);
    assert!(early.left_out.is_empty() && !early.text.contains("delay="));
    // Fed forward in full, damping makes no lag; the surplus over stiffness leads.
    let (kv, kp) = (
        attribute(&early, "name=\"velocity of x\"", "gainprm"),
        attribute(&early, "name=\"position of x\"", "gainprm"),
    );
    let damping = kv / told(&early, "feed-forward of x");
    assert!(near((kv - damping) / kp, 2e-3));
}

#[test]
fn what_gives_way_to_acceleration_is_a_load_on_a_spring() {
    let soft = model(&[("inertial_error", 2e-4, INERTIA)]);
    assert!(soft.left_out.is_empty(), "{:?}", soft.left_out);
    let load = attribute(&soft, "<joint name=\"x\"", "armature");
    assert!(near(load / told(&soft, "stiffness of x"), 2e-4));
    // A delay of 20 ms alone rounds by 2e-4 s2; what is more is the spring's.
    let both = model(&[("inertial_error", 1e-4, INERTIA), ("servo_lag", 2e-2, LAG)]);
    let load = attribute(&both, "<joint name=\"x\"", "armature");
    assert!(near(load / told(&both, "stiffness of x"), 3e-4) && near(told(&both, "delay of x"), 2e-2));
    // It rounds by more than the delay: part of that is a low-pass.
    let round = model(&[("inertial_error", -3e-4, INERTIA), ("servo_lag", 2e-2, LAG)]);
    assert!(round.left_out.is_empty() && !round.text.contains("motor of x"));
    let (delay, low_pass) = (told(&round, "delay of x"), told(&round, "low-pass of x"));
    assert!(near(delay + low_pass, 2e-2));
    assert!(near(0.5 * delay * delay + delay * low_pass + low_pass * low_pass, 3e-4));
}

#[test]
fn lost_motion_is_friction_that_winds_a_spring_behind_the_play() {
    let lost = model(&[("hysteresis", 2e-5, FRICTION)]);
    assert!(lost.left_out.is_empty(), "{:?}", lost.left_out);
    let force = told(&lost, "friction of x");
    assert!(near(force / told(&lost, "stiffness of x"), 1e-5));
    assert!(near(told(&lost, "take-up of x"), 1e-3));
    // The stiffness of its bristles, no damping, and the same force at rest and in motion.
    let law = lost.text.lines().find_map(|line| line.split("lugre=\"").nth(1)).expect("friction");
    let law: Vec<f64> = law.split(['"', ' ']).take(4).map(|n| n.parse().expect("a number")).collect();
    assert!(near(law[0], force / 1e-3) && law[1].abs() < 1e-12 && near(law[2], force) && near(law[3], force));
    let both = model(&[("hysteresis", 2e-5, FRICTION), ("backlash", 1e-5, PLAY)]);
    assert!(both.left_out.is_empty());
    let line = |name: &str| both.text.lines().find(|line| line.contains(name)).expect("a tendon").to_string();
    let play = line("<fixed name=\"play of x\"");
    assert!(
        play.contains("<joint joint=\"gear of x\" coef=\"1\"/><joint joint=\"motor of x\" coef=\"-1\"/>")
    );
    let spring = line("<fixed name=\"compliance of x\"");
    assert!(spring.contains("<joint joint=\"x\" coef=\"1\"/><joint joint=\"gear of x\" coef=\"-1\"/>"));
    // What stands between them stays where it was left, against the spring.
    assert!(
        attribute(&both, "<body name=\"gear of x\"", "frictionloss") > 2.0 * told(&both, "friction of x")
    );
}

#[test]
fn what_no_drive_does_is_listed_with_the_reason() {
    for (effects, because) in [
        (&[("hysteresis", -2e-5, FRICTION)], "no friction does that"),
        (&[("inertial_error", -2e-4, INERTIA)], "no spring does that"),
        (&[("backlash", -2e-5, PLAY)], "no play does that"),
        (&[("positioning_error", 1e-6, "Of(\"x\", Position)")], "has no place for it"),
    ] {
        let exported = model(effects);
        let [left] = &exported.left_out[..] else { panic!("{effects:?}: {:?}", exported.left_out) };
        assert_eq!(left.what, format!("{} at x", effects[0].0));
        assert!(left.because.contains(because), "{}", left.because);
        assert!(exported.numbers.is_empty());
    }
}
