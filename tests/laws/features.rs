//! Laws of features: history, rates, derivatives, units.

use crate::common;
use kincal::Machine;
use kincal::feature::{Binding, Expression, Feature, Memory, Samples, samples_of};
use kincal::recording::Recording;

/// A linear axis x along a path of positions in mm, one sample each 10 ms.
fn along(path: &[f64]) -> (Machine, Vec<Samples>) {
    let machine = common::machine("linear_axis");
    let name = machine.commands()[0].clone();
    let mut text = format!("# measurement: joint\nt[s],{name}[mm],{name}_meas[mm]\n");
    for (k, q) in path.iter().enumerate() {
        text += &format!("{},{q},{q}\n", k as f64 * 0.01);
    }
    let recording = Recording::from_bytes("path.csv", text.into_bytes(), &machine).expect("a recording");
    let samples = samples_of(&recording, &machine, &vec![1e-9; machine.dyads().len()]).expect("samples");
    (machine, samples)
}

fn joint(machine: &Machine) -> usize {
    machine.joints().next().expect("a joint").0
}

fn feature(machine: &Machine, text: &str, parameters: &[&str]) -> Feature {
    let options =
        ron::Options::default().with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    let expression: Expression = options.from_str(text).unwrap_or_else(|e| panic!("{text}: {e}"));
    let parameters: Vec<String> = parameters.iter().map(|p| p.to_string()).collect();
    let travel: Vec<_> = machine.dyads().iter().map(|d| d.joint.as_ref().map(|_| (0.0, 0.1))).collect();
    let binding = Binding {
        machine,
        own: Some(joint(machine)),
        partner: None,
        travel: &travel,
        time: Some((0.0, 1.0)),
        begins: &[],
        parameters: &parameters,
    };
    Feature::bind(&expression, &binding).unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn close(got: &[f64], expected: &[f64], to: f64) {
    assert_eq!(got.len(), expected.len());
    for (g, e) in got.iter().zip(expected) {
        assert!((g - e).abs() <= to, "{got:?}\n{expected:?}");
    }
}

#[test]
fn play_of_a_width_trails_the_drive_and_crosses_at_a_reversal() {
    let (machine, samples) = along(&[0.0, 1.0, 0.9, 0.8, 0.5, 0.6]);
    let play = feature(&machine, "Play(Parameter(\"width\"))", &["width"]);
    close(&play.over(&samples, &[0.2e-3]), &[-1e-4, -1e-4, 0.0, 1e-4, 1e-4, 0.0], 1e-12);
    // What an expression drives begins in the middle. The drive moves twice as far as the joint here.
    let twice = "PlayOf(Product([Number(2), Position]), Product([Number(2), Parameter(\"width\")]))";
    let play = feature(&machine, twice, &["width"]);
    close(&play.over(&samples, &[0.2e-3]), &[0.0, -2e-4, 0.0, 2e-4, 2e-4, 0.0], 1e-12);
    assert!(play.needs_history() && play.remembers());
}

#[test]
fn take_up_remembers_where_an_interrupted_loop_stood() {
    let (machine, samples) = along(&[0.0, 5.0, 4.0, 5.0, 50.0]);
    let take_up = feature(&machine, "TakeUp(Parameter(\"length\"))", &["length"]);
    let left = (-1.0f64).exp();
    let turned = -1.0 + 2.0 * left;
    let back = 1.0 + (turned - 1.0) * left;
    close(&take_up.over(&samples, &[1e-3]), &[1.0, 1.0, turned, back, 1.0], 1e-12);
}

#[test]
fn a_late_axis_is_where_it_was_a_moment_ago_and_where_it_was_sent_when_nobody_knows_the_time() {
    // 10 mm/s from rest to rest; what is 20 ms late is 0.2 mm behind, whatever it is a function of.
    let path: Vec<f64> = (0..60).map(|k| 0.1 * f64::from((k - 10i32).clamp(0, 40))).collect();
    let (machine, mut samples) = along(&path);
    let (sent, late) =
        (feature(&machine, "Power(Position, 2)", &[]), feature(&machine, "Power(Late(0.02), 2)", &[]));
    let (at, by_then) = (sent.over(&samples, &[]), late.over(&samples, &[]));
    let behind: Vec<f64> = at.iter().zip(&by_then).map(|(x, y)| x.sqrt() - y.sqrt()).collect();
    close(&behind[20..40], &[0.2e-3; 20], 1e-9);
    close(&behind[..5], &[0.0; 5], 1e-12);
    for joint in samples.iter_mut().flat_map(|s| s.joints.iter_mut().flatten()) {
        joint.velocity.clear();
    }
    close(&late.over(&samples, &[]), &at, 0.0);
}

#[test]
fn history_goes_on_across_stretches() {
    let (machine, samples) = along(&[0.0, 5.0, 4.0, 5.0, 50.0, 49.0]);
    let take_up = feature(&machine, "TakeUp(Value(1, \"mm\"))", &[]);
    let whole = take_up.over(&samples, &[]);
    let (mut memory, mut pieces) = (Memory::new(&take_up), Vec::new());
    for k in 0..samples[0].len {
        let mut piece = samples[0].clone();
        let joint = piece.joints[joint(&machine)].as_mut().expect("a joint");
        joint.position = vec![joint.position[k]];
        joint.direction = vec![joint.direction[k]];
        (piece.len, piece.first) = (1, k == 0);
        pieces.extend(take_up.column(&piece, &[], 1.0, &mut memory));
    }
    assert_eq!(whole, pieces);
}

#[test]
fn derivatives_by_parameters_are_those_of_central_differences() {
    let path: Vec<f64> =
        (0..200).map(|k| 40.0 + 30.0 * (k as f64 * 0.05).sin() + 3.0 * (k as f64 * 0.21).cos()).collect();
    let (machine, samples) = along(&path);
    for (text, p) in [
        ("Play(Parameter(\"p\"))", 1.234e-3),
        ("PlayOf(Product([Position, Sum([Number(1), Parameter(\"p\")])]), Value(1.3, \"mm\"))", 0.2),
        ("TakeUp(Parameter(\"p\"))", 2e-3),
        ("Lag(Abs(Velocity), Parameter(\"p\"))", 0.3),
        ("Sin(Quotient(Position, Parameter(\"p\")))", 5e-3),
        ("Product([Direction, Exp(Quotient(Product([Number(-1), SinceReversal]), Parameter(\"p\")))])", 2e-3),
        ("Bump(Quotient(Difference(Position, Parameter(\"p\")), Value(5, \"mm\")))", 0.05),
        ("Chebyshev(5, Between(Sum([Position, Parameter(\"p\")]), 0.0, 0.1))", 0.01),
        ("Power(Positive(Difference(Position, Parameter(\"p\"))), 2)", 0.0333),
    ] {
        let feature = feature(&machine, text, &["p"]);
        let (values, derivatives) = feature.with_derivatives(&samples, &[p]);
        common::are_the_same_but_for_rounding(&values, &feature.over(&samples, &[p]));
        let h = 1e-6 * p;
        let (up, down) = (feature.over(&samples, &[p + h]), feature.over(&samples, &[p - h]));
        let differences: Vec<f64> = up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * h)).collect();
        let scale = differences.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        assert!(scale > 0.0, "{text} does not depend on its parameter");
        close(&derivatives[0], &differences, 1e-6 * scale);
    }
}

#[test]
fn a_feature_in_words_binds_to_itself_again() {
    let (machine, samples) = along(&[0.0, 5.0, 4.0, 5.0, 50.0, 49.0]);
    let text = "Product([TakeUp(Parameter(\"p\")), PlayOf(Position, Value(2, \"mm\")), Chebyshev(3, Stroke), Exp(Difference(Number(0), Quotient(Time, Value(2, \"s\"))))])";
    let one = feature(&machine, text, &["p"]).with(&[1e-3]);
    let stored = ron::to_string(&one.to_expression(&machine, &[])).expect("RON");
    let again = feature(&machine, &stored, &[]);
    assert_eq!(one.over(&samples, &[]), again.over(&samples, &[]));
}
