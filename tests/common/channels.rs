//! A recording in which all moves and every channel is there, so that no family of effects lacks what it asks for.

use kincal::Machine;
use kincal::effects::RecordingFacts;
use kincal::feature::{Samples, samples_of};
use kincal::machine::JointKind;
use kincal::recording::Recording;

/// A recording in which every joint moves to and fro within its travel, with time and every channel that families ask for.
pub fn recording(machine: &Machine, samples: usize, with_time: bool) -> Recording {
    let mut text =
        format!("# machine: {}\n# measurement: distance\n# nominal_length[mm]: 100\n", machine.name());
    let names = machine.commands();
    let mut header: Vec<String> = if with_time { vec!["t[s]".into()] } else { Vec::new() };
    let unit = |c: usize| if machine.command_joint(c).kind == JointKind::Prismatic { "mm" } else { "deg" };
    header.extend(names.iter().enumerate().map(|(c, name)| format!("{name}[{}]", unit(c))));
    header.extend(["temperature[degC]", "clamped[1]", "payload[N]", "spindle[1]"].map(String::from));
    header.extend(machine.joints().map(|(_, joint)| format!("{}_current[A]", joint.name)));
    text += &header.join(",");
    text += ",d[mm]\n";
    for k in 0..samples {
        let u = k as f64 / samples as f64;
        let mut row: Vec<String> =
            if with_time { vec![format!("{:.4}", 12.0 + 0.02 * k as f64)] } else { Vec::new() };
        for (c, _) in names.iter().enumerate() {
            let (from, to) = machine.travel(c);
            let (from, to) = (from.max(-1.5), to.min(1.5));
            let (middle, half) = (0.5 * (from + to), 0.4 * (to - from));
            let turns = 1.5 + 0.7 * c as f64;
            let q = middle + half * (std::f64::consts::TAU * turns * u).sin();
            let shown = if unit(c) == "mm" { q * 1e3 } else { q.to_degrees() };
            row.push(format!("{shown:.6}"));
        }
        row.push(format!("{:.3}", 20.0 + 3.0 * u + (9.0 * u).sin()));
        row.push(format!("{}", usize::from(u > 0.4 && u < 0.6)));
        row.push("50".into());
        row.push(format!("{}", usize::from(u > 0.3)));
        row.extend(machine.joints().enumerate().map(|(i, _)| format!("{:.3}", (11.0 * u + i as f64).cos())));
        row.push("0.001".into());
        text += &row.join(",");
        text.push('\n');
    }
    Recording::from_bytes("all.csv", text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// What is known of such a recording, and its samples.
pub fn prepared(machine: &Machine, samples: usize) -> (RecordingFacts, Vec<Samples>) {
    let recordings = [recording(machine, samples, true)];
    let facts = RecordingFacts::of(machine, &recordings).expect("facts");
    let columns = samples_of(&recordings[0], machine, &facts.dead_bands).expect("samples");
    (facts, columns)
}
