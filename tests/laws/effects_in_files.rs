//! Named effects in calibrated files: they come back, they are used with their history, and what cannot be used is told.

use std::f64::consts::TAU;

use crate::common;
use kincal::effects::{Candidate, Identified, Library, RecordingFacts, StoredEffect};
use kincal::predict::{Prediction, predict};
use kincal::recording::Recording;
use kincal::{CalibratedMachine, Machine};

/// A recording in which every joint moves to and fro, with time, a temperature and readings that mean nothing.
fn path(machine: &Machine, measurement: &str, with_time: bool) -> Recording {
    let mut text =
        format!("# machine: {}\n# measurement: {measurement}\n# nominal_length[mm]: 100\n", machine.name());
    let unit = |c: usize| match machine.command_joint(c).kind {
        kincal::machine::JointKind::Prismatic => ("m", 1.0),
        kincal::machine::JointKind::Revolute => ("rad", 1.0),
    };
    let mut head: Vec<String> = if with_time { vec!["t[s]".into()] } else { Vec::new() };
    head.extend(machine.commands().iter().enumerate().map(|(c, name)| format!("{name}[{}]", unit(c).0)));
    head.push("temperature[degC]".into());
    let values = if measurement == "distance" { "d[mm]" } else { "px[mm],py[mm],pz[mm]" };
    head.push(values.into());
    text += &(head.join(",") + "\n");
    for k in 0..600 {
        let u = f64::from(k) / 600.0;
        let mut row = if with_time { vec![format!("{:.3}", 5.0 + 0.05 * f64::from(k))] } else { Vec::new() };
        for c in 0..machine.commands().len() {
            let (from, to) = machine.travel(c);
            let (from, to) = (from.max(-1.2), to.min(1.2));
            let turns = 1.5 + 0.7 * c as f64;
            row.push(format!("{}", 0.5 * (from + to) + 0.4 * (to - from) * (TAU * turns * u).sin()));
        }
        row.push(format!("{:.3}", 20.0 + 4.0 * u));
        row.push(values.split(',').map(|_| "0.001").collect::<Vec<_>>().join(","));
        text += &(row.join(",") + "\n");
    }
    Recording::from_bytes("path.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

fn facts(machine: &Machine) -> RecordingFacts {
    RecordingFacts::of(machine, &[path(machine, "distance", true)]).unwrap_or_else(|e| panic!("{e}"))
}

/// A candidate with numbers that differ from coefficient to coefficient.
fn stored(machine: &Machine, library: &Library, candidate: &Candidate, seed: f64) -> StoredEffect {
    let coefficient = |i: usize| 3e-5 * (seed + 1.7 * i as f64).cos() / 3.0;
    let found = Identified {
        family: &library.families()[candidate.family],
        candidate,
        coefficients: (0..candidate.coefficients.len()).map(coefficient).collect(),
        parameters: candidate.grid[candidate.grid.len() / 2].clone(),
        covariance: None,
    };
    found.stored(machine, &[])
}

fn dead_bands(machine: &Machine) -> Vec<f64> {
    vec![1e-9 / 3.0; machine.commands().len()]
}

fn with(machine: &Machine, effects: Vec<StoredEffect>) -> CalibratedMachine {
    CalibratedMachine::nominal(machine.clone())
        .with_effects(effects, dead_bands(machine))
        .unwrap_or_else(|e| panic!("{e}"))
}

fn predicted(machine: &CalibratedMachine, recording: &Recording) -> (Prediction, String) {
    let mut text = Vec::new();
    let figures = predict(machine, recording, Some(&mut text)).unwrap_or_else(|e| panic!("{e}"));
    (figures, String::from_utf8(text).expect("text"))
}

fn again(machine: &CalibratedMachine) -> CalibratedMachine {
    let text = machine.to_ron();
    CalibratedMachine::parse("again.ron", &text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

#[test]
fn every_family_of_the_library_comes_back_from_its_file_with_the_same_bits() {
    let library = Library::standard();
    for name in ["ac_table_tilting", "six_r_arm"] {
        let machine = common::machine(name);
        let (facts, recording) = (facts(&machine), path(&machine, "position", true));
        let candidates = library.candidates(&machine, &facts);
        assert!(candidates.all.len() > 30, "{name}: {}", candidates.all.len());
        let mut families = std::collections::BTreeSet::new();
        for (i, candidate) in candidates.all.iter().enumerate().filter(|(_, c)| !c.coefficients.is_empty()) {
            if !families.insert(candidate.effect.clone()) && i % 5 > 0 {
                continue;
            }
            let told = with(&machine, vec![stored(&machine, &library, candidate, i as f64)]);
            let back = again(&told);
            assert_eq!(back, told, "{name}: {} {:?}", candidate.effect, candidate.place);
            let (_, text) = predicted(&told, &recording);
            assert_eq!(predicted(&back, &recording).1, text, "{name}: {}", candidate.effect);
            let (_, plain) = predicted(&CalibratedMachine::nominal(machine.clone()), &recording);
            // Small things do not show everywhere, such as what acts at the first reversal of a joint; these do.
            if ["backlash", "cyclic_error", "sensor_drift", "vibration"].contains(&candidate.effect.as_str())
            {
                assert_ne!(plain, text, "{name}: {} {:?}", candidate.effect, candidate.place);
            }
        }
    }
}

#[test]
fn files_hold_effects_as_text_for_people_one_field_a_line() {
    let (machine, library) = (common::machine("ac_table_tilting"), Library::standard());
    let candidates = library.candidates(&machine, &facts(&machine));
    let pick = |effect: &str| candidates.all.iter().find(|c| c.effect == effect).expect(effect);
    let mut effect = stored(&machine, &library, pick("backlash"), 0.0);
    effect.says = "says \"(play), (more)\" \\ and [so, on]".into();
    let told = with(&machine, vec![effect, stored(&machine, &library, pick("straightness"), 1.0)]);
    let text = told.to_ron();
    assert!(
        text.contains("\n            (\n                effect: \"backlash\",\n                at: "),
        "{text}"
    );
    assert!(text.lines().filter(|line| line.trim_start().starts_with("(value: ")).count() > 5, "{text}");
    assert_eq!(again(&told), told);
}

#[test]
fn effects_that_do_not_fit_the_machine_are_refused_where_they_stand() {
    let (machine, library) = (common::machine("ac_table_tilting"), Library::standard());
    let candidates = library.candidates(&machine, &facts(&machine));
    let backlash = candidates.all.iter().find(|c| c.effect == "backlash").expect("backlash");
    let told = with(&machine, vec![stored(&machine, &library, backlash, 0.0)]).to_ron();
    for (from, to, says) in [
        ("Before(\"", "Before(\"no_", "no frame \"no_"),
        ("Of(\"", "Of(\"no_", "no joint \"no_"),
        ("Direction", "Stroke", "does not move"),
        ("Direction", "Parameter(\"p\")", "not declared"),
        ("Number(-0.5)", "Number(inf)", "not finite"),
        ("Number(-0.5)", "Between(Number(1.0), 2.0, 2.0)", "ends before"),
        ("value: ", "value: NaN, was: ", "was"),
    ] {
        assert!(told.contains(from), "{from}: {told}");
        let error = CalibratedMachine::parse("bad.ron", &told.replacen(from, to, 1)).expect_err(to);
        assert!(error.to_string().contains(says), "{to}: {error}");
        assert!(error.to_string().contains("bad.ron:"), "{to}: {error}");
    }
}

#[test]
fn what_a_recording_cannot_use_is_left_out_and_told() {
    let (machine, library) = (common::machine("ac_table_tilting"), Library::standard());
    let candidates = library.candidates(&machine, &facts(&machine));
    let of = |effect: &str| {
        let candidate = candidates.all.iter().find(|c| c.effect == effect).expect(effect);
        let mut stored = stored(&machine, &library, candidate, 0.3);
        stored.instrument = (stored.at == "measurement").then(|| "distance".into());
        stored
    };
    let names = ["backlash", "thermal_drift", "thermal_expansion", "sensor_drift"];
    let told = with(&machine, names.map(of).to_vec());
    let left = |recording: &Recording| -> Vec<String> {
        let figures = predicted(&told, recording).0;
        assert!(figures.rms.m.is_some_and(f64::is_finite));
        figures.left_out.into_iter().map(|l| l.effect).collect()
    };
    assert!(left(&path(&machine, "distance", true)).is_empty());
    assert_eq!(left(&path(&machine, "distance", false)), ["thermal_drift", "sensor_drift"]);
    assert_eq!(left(&path(&machine, "position", true)), ["sensor_drift"]);
    // Without those that cannot be used, the others still are.
    let (_, alone) = predicted(
        &with(&machine, names[..3].iter().map(|n| of(n)).collect()),
        &path(&machine, "position", true),
    );
    assert_eq!(predicted(&told, &path(&machine, "position", true)).1, alone);
}

#[test]
fn a_machine_that_leans_is_found_with_its_weights_hanging_plumb() {
    let (machine, library) = (common::machine("hilti_jaibot"), Library::standard());
    let (lean, turn) = (0.05f64, 0.3f64);
    // Readings of the machine where it stands upright in a frame that leans, then turned until that frame is plumb.
    let blank = path(&machine, "position", true);
    let header = |frame: &str, gravity: [f64; 3]| {
        let [x, y, z] = gravity;
        format!("# measurement: position\n# setup: here\n{frame}# gravity[w]: {x}, {y}, {z}\n")
    };
    let body = |text: &str| -> String {
        text.lines().filter(|line| !line.starts_with('#')).map(|line| format!("{line}\n")).collect()
    };
    let read = |text: String| Recording::from_bytes("lean.csv", text.into_bytes(), &machine).expect("reads");
    let upright = header("", [lean.sin(), 0.0, -lean.cos()]);
    let candidates = library.candidates(&machine, &RecordingFacts::of(&machine, &[blank]).expect("facts"));
    let bending = candidates.all.iter().find(|c| c.effect == "column_compliance").expect("a column");
    let told = with(&machine, vec![stored(&machine, &library, bending, 0.3)]);
    let (_, text) = predicted(&told, &path(&machine, "position", true));
    let blank = read(upright + &commands_and(&body(&text), |_| [0.0; 3]));
    let (_, text) = predicted(&told, &blank);
    let plumb = |p: [f64; 3]| {
        let (s, c) = lean.sin_cos();
        let [x, y, z] = [c * p[0] + s * p[2], p[1], -s * p[0] + c * p[2]];
        let (s, c) = turn.sin_cos();
        [c * x - s * y + 2.0, s * x + c * y - 1.0, z + 0.5]
    };
    let leaning =
        read(header("# workpiece_frame: unknown\n", [0.0, 0.0, -1.0]) + &commands_and(&body(&text), plumb));
    let found = kincal::identify::fit_setup(&told, std::slice::from_ref(&leaning), Default::default())
        .unwrap_or_else(|e| panic!("{e}"));
    let rms = predicted(&found, &leaning).0.rms.m.expect("positions");
    assert!(rms < 1e-7, "{rms} m are left of readings without noise");
}

/// A recording's columns, its readings replaced by what `read` makes of the model's, m.
fn commands_and(text: &str, read: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let model: Vec<usize> = (0..head.len()).filter(|i| head[*i].contains("_model")).collect();
    let kept: Vec<usize> = (0..head.len()).filter(|i| !head[*i].starts_with('p')).collect();
    let unit = if head[model[0]].ends_with("[mm]") { 1e-3 } else { 1.0 };
    let mut out =
        kept.iter().map(|i| head[*i]).chain(["px[m]", "py[m]", "pz[m]"]).collect::<Vec<_>>().join(",") + "\n";
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let p = read([0, 1, 2].map(|k| unit * cells[model[k]].parse::<f64>().expect("a number")));
        let commands = kept.iter().map(|i| cells[*i].to_string());
        out += &commands.chain(p.iter().map(|x| format!("{x:.12}"))).collect::<Vec<_>>().join(",");
        out += "\n";
    }
    out
}
