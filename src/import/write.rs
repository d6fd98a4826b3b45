//! The machine file of a chain, with where its numbers come from.

use std::fmt::Write;
use std::path::Path;

use super::chain::{Chain, Entry, JointEntry, one_line};
use crate::lie::{Pose, Vec3};
use crate::machine::JointKind;

pub(super) fn ron(file: &Path, chain: &Chain) -> String {
    let name = file.file_name().map_or_else(String::new, |n| one_line(&n.to_string_lossy()));
    let mut text = format!(
        "// Made by `kincal import` from {name}; m and rad as there. Each frame bears the name of its joint.\n"
    );
    for line in &chain.told {
        let _ = writeln!(text, "// {}", line.replace(char::is_control, " "));
    }
    text.push_str("// Tolerances are those of a machine about which nothing is known; state yours: `tolerance: (translation: .., rotation: ..)`.\n");
    let _ = writeln!(
        text,
        "Machine(\n    name: \"{}\",\n    about: \"{}\",\n    units: (length: m, angle: rad),",
        chain.name, chain.about
    );
    for (field, entries) in [("workpiece", &chain.workpiece), ("tool", &chain.tool)] {
        let _ = writeln!(text, "    {field}: [");
        for e in entries {
            let _ = writeln!(text, "        {}, // {}", entry(e), e.note);
        }
        text.push_str("    ],\n");
    }
    text.push_str(")\n");
    text
}

fn entry(entry: &Entry) -> String {
    let mut text = format!("(frame: \"{}\"", entry.frame);
    if let Some(offset) = entry.offset {
        let pose = entry.moves.iter().fold(Pose::identity(0.0), |pose, m| pose * m.pose()) * offset;
        let _ =
            write!(text, ", at: {}, rotation: {}", triple(pose.translation), triple(pose.rotation_vector()));
    } else if entry.moves.iter().all(|m| !m.turn) {
        let mut at = Vec3([0.0; 3]);
        entry.moves.iter().for_each(|m| at.0[m.axis] += m.by);
        if at.0 != [0.0; 3] {
            let _ = write!(text, ", at: {}", triple(at));
        }
    } else {
        let word = |turn| if turn { 'R' } else { 'T' };
        let moves = entry
            .moves
            .iter()
            .map(|m| format!("{}{}({})", word(m.turn), ["x", "y", "z"][m.axis], number(m.by)));
        let _ = write!(text, ", moves: [{}]", moves.collect::<Vec<_>>().join(", "));
    }
    if let Some(joint) = &entry.joint {
        let _ = write!(text, ", joint: {}", joint_text(joint));
    }
    if let Some((kg, centre)) = entry.mass {
        let _ = write!(text, ", mass: {}, centre_of_mass: {}", number(kg), triple(centre));
    }
    text.push(')');
    text
}

fn joint_text(joint: &JointEntry) -> String {
    let kind = match joint.kind {
        JointKind::Prismatic => "Prismatic",
        JointKind::Revolute => "Revolute",
    };
    let words = ["x", "y", "z"]
        .iter()
        .enumerate()
        .flat_map(|(i, w)| [(i, 1.0, (*w).to_string()), (i, -1.0, format!("-{w}"))]);
    let word = words
        .into_iter()
        .find(|(i, sign, _)| (0..3).all(|k| joint.axis.0[k] == if k == *i { *sign } else { 0.0 }));
    let axis = word.map_or_else(|| triple(joint.axis), |(_, _, w)| format!("\"{w}\""));
    let mut text = format!("{kind}(axis: {axis}");
    if let Some((lower, upper)) = joint.travel {
        let _ = write!(text, ", travel: ({}, {})", number(lower), number(upper));
    }
    if let Some((leader, factor)) = &joint.follows {
        let _ = write!(text, ", follows: {{\"{leader}\": {}}}", number(*factor));
    }
    text.push(')');
    text
}

fn triple(v: Vec3<f64>) -> String {
    format!("({})", v.0.map(number).join(", "))
}

/// As short as it reads back.
fn number(x: f64) -> String {
    let text = format!("{x:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_string)
}
