//! The machine file of a chain, with where its numbers come from.

use std::fmt::Write;

use super::chain::{Chain, Entry, JointEntry};
use super::step::Move;
use crate::lie::{Pose, Vec3};
use crate::machine::{FileUnits, JointKind};
use crate::units::Unit;

pub(super) fn ron(made: &str, chain: &Chain) -> String {
    let units = chain.units;
    let mut text = format!("{made}\n");
    for line in &chain.told {
        let _ = writeln!(text, "// {}", line.replace(char::is_control, " "));
    }
    text.push_str("// Tolerances are those of a machine about which nothing is known; state yours: `tolerance: (translation: .., rotation: ..)`.\n");
    let _ = writeln!(
        text,
        "Machine(\n    name: \"{}\",\n    about: \"{}\",\n    units: (length: {}, angle: {}),",
        chain.name, chain.about, units.length, units.angle
    );
    for (field, entries) in [("workpiece", &chain.workpiece), ("tool", &chain.tool)] {
        let _ = writeln!(text, "    {field}: [");
        for e in entries {
            let _ = writeln!(text, "        {}, // {}", entry(e, units), e.note);
        }
        text.push_str("    ],\n");
    }
    text.push_str(")\n");
    text
}

fn entry(entry: &Entry, units: FileUnits) -> String {
    let mut text = format!("(frame: \"{}\"", entry.frame);
    let elementary = |m: &Move| match *m {
        Move::Turn(axis, by) => Some(("R", axis, units.angle, by)),
        Move::Shift(axis, by) => Some(("T", axis, units.length, by)),
        Move::Pose(_) => None,
    };
    let moves: Option<Vec<_>> = entry.moves.iter().map(elementary).collect();
    match moves.filter(|_| entry.offset.is_none()) {
        None => {
            let pose = Move::all(&entry.moves) * entry.offset.unwrap_or(Pose::identity(0.0));
            let (at, turn) = (pose.translation, pose.rotation_vector());
            if at.0 != [0.0; 3] {
                let _ = write!(text, ", at: {}", triple(at, units.length));
            }
            if turn.0 != [0.0; 3] {
                let _ = write!(text, ", rotation: {}", triple(turn, units.angle));
            }
        }
        Some(moves) if moves.iter().all(|(word, ..)| *word == "T") => {
            let mut at = Vec3([0.0; 3]);
            moves.iter().for_each(|(_, axis, _, by)| at.0[*axis] += by);
            if at.0 != [0.0; 3] {
                let _ = write!(text, ", at: {}", triple(at, units.length));
            }
        }
        Some(moves) => {
            let moves = moves.iter().map(|(word, axis, unit, by)| {
                format!("{word}{}({})", ["x", "y", "z"][*axis], number(unit.write_si(*by)))
            });
            let _ = write!(text, ", moves: [{}]", moves.collect::<Vec<_>>().join(", "));
        }
    }
    if let Some(joint) = &entry.joint {
        let _ = write!(text, ", joint: {}", joint_text(joint, units));
    }
    if let Some((kg, centre)) = entry.mass {
        let _ = write!(text, ", mass: {}, centre_of_mass: {}", number(kg), triple(centre, units.length));
    }
    text.push(')');
    text
}

fn joint_text(joint: &JointEntry, units: FileUnits) -> String {
    let kind = if joint.kind == JointKind::Revolute { "Revolute" } else { "Prismatic" };
    let unit = units.of(joint.kind);
    let words = ["x", "y", "z"]
        .iter()
        .enumerate()
        .flat_map(|(i, w)| [(i, 1.0, (*w).to_string()), (i, -1.0, format!("-{w}"))]);
    let word = words
        .into_iter()
        .find(|(i, sign, _)| (0..3).all(|k| joint.axis.0[k] == if k == *i { *sign } else { 0.0 }));
    let plain = || format!("({})", joint.axis.0.map(number).join(", "));
    let axis = word.map_or_else(plain, |(_, _, w)| format!("\"{w}\""));
    let mut text = format!("{kind}(axis: {axis}");
    if let Some((lower, upper)) = joint.travel {
        let [lower, upper] = [lower, upper].map(|x| number(unit.write_si(x)));
        let _ = write!(text, ", travel: ({lower}, {upper})");
    }
    if !joint.follows.is_empty() {
        let leaders =
            joint.follows.iter().map(|(leader, factor)| format!("\"{leader}\": {}", number(*factor)));
        let _ = write!(text, ", follows: {{{}}}", leaders.collect::<Vec<_>>().join(", "));
    }
    if let Some(address) = &joint.nc {
        let _ = write!(text, ", nc: (address: \"{address}\", sign: 1)");
    }
    text.push(')');
    text
}

fn triple(v: Vec3<f64>, unit: Unit) -> String {
    format!("({})", v.0.map(|x| number(unit.write_si(x))).join(", "))
}

/// As short as it reads back.
fn number(x: f64) -> String {
    let text = format!("{x:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_string)
}
