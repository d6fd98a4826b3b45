//! URDF: links, and joints between them, in m and rad.

use std::collections::HashMap;
use std::path::Path;

use roxmltree::Node;

use super::step::{Link, Mass, Mimic, Motion, Move, Robot, Step};
use super::xml::{Source, child};
use crate::error::Result;
use crate::lie::Vec3;
use crate::machine::{FileUnits, JointKind};

pub(super) fn read(file: &Path, text: &str) -> Result<Robot> {
    let source = Source::new(file, text)?;
    let document = source.document()?;
    let root = document.root_element();
    let is_xacro = |node: &Node| {
        let space = node.tag_name().namespace().unwrap_or_default();
        space.contains("xacro")
    };
    if let Some(node) = document.descendants().filter(Node::is_element).find(is_xacro) {
        let what = format!("<xacro:{}> is not URDF yet", node.tag_name().name());
        return Err(source.fault(node, what, "expand the file first: `xacro robot.urdf.xacro > robot.urdf`"));
    }
    if root.tag_name().name() != "robot" {
        let what = format!("the file begins with <{}>, URDF with <robot>", root.tag_name().name());
        return Err(source.fault(root, what, "name a URDF or MJCF file; SDF is not read"));
    }
    let mut robot = Robot {
        file: file.to_path_buf(),
        name: root.attribute("name").unwrap_or("robot").to_string(),
        noun: "link",
        lines: Vec::new(),
        units: FileUnits::si(),
        links: Vec::new(),
        steps: Vec::new(),
        told: Vec::new(),
    };
    let mut index = HashMap::new();
    for node in root.children().filter(|n| n.is_element() && n.tag_name().name() == "link") {
        let name = required(&source, node, "name")?.to_string();
        if let Some(first) = index.insert(name.clone(), robot.links.len()) {
            let first: &Link = &robot.links[first];
            let what = format!("link \"{name}\" stands twice, first in line {}", first.line);
            return Err(source.fault(node, what, "give one of them another name"));
        }
        let mass = mass(&source, node, &name, &mut robot.told);
        robot.links.push(Link { name, line: source.line(node), mass, is_part: true });
    }
    for node in root.children().filter(|n| n.is_element() && n.tag_name().name() == "joint") {
        robot.steps.push(step(&source, node, &index, &mut robot.told)?);
    }
    if robot.links.is_empty() {
        return Err(source.fault(
            root,
            "the robot has no link",
            "name a URDF file with <link> and <joint> in it",
        ));
    }
    Ok(robot)
}

fn required<'a>(source: &Source, node: Node<'a, '_>, name: &str) -> Result<&'a str> {
    node.attribute(name).filter(|text| !text.trim().is_empty()).ok_or_else(|| {
        let element = node.tag_name().name();
        source.fault(
            node,
            format!("<{element}> has no `{name}`"),
            format!("write <{element} {name}=\"...\">"),
        )
    })
}

fn step(source: &Source, node: Node, index: &HashMap<String, usize>, told: &mut Vec<String>) -> Result<Step> {
    let name = required(source, node, "name")?.to_string();
    let end = |which: &str| -> Result<usize> {
        let Some(element) = child(node, which) else {
            let what = format!("joint \"{name}\" has no <{which}>");
            return Err(source.fault(node, what, format!("write <{which} link=\"...\"/> into it")));
        };
        let link = required(source, element, "link")?;
        index.get(link).copied().ok_or_else(|| {
            let what = format!("joint \"{name}\" names link \"{link}\" as its {which}, which the file lacks");
            source.fault(element, what, "write the name of one of the links of this file")
        })
    };
    let (parent, child_link) = (end("parent")?, end("child")?);
    let moves = child(node, "origin").map_or(Ok(Vec::new()), |origin| moves(source, origin))?;
    let motion = motion(source, node, &name, told)?;
    Ok(Step { name, line: source.line(node), parent, child: child_link, moves, motion })
}

/// `xyz`, then `rpy` about fixed axes: Rz(yaw) Ry(pitch) Rx(roll).
fn moves(source: &Source, origin: Node) -> Result<Vec<Move>> {
    let xyz = source.finite::<3>(origin, "xyz")?.unwrap_or_default();
    let rpy = source.finite::<3>(origin, "rpy")?.unwrap_or_default();
    let about = (0..3).rev().map(|axis| Move::Turn(axis, rpy[axis]));
    Ok(Move::shifts(Vec3(xyz)).into_iter().chain(about).filter(|m| !m.is_none()).collect())
}

fn motion(source: &Source, node: Node, name: &str, told: &mut Vec<String>) -> Result<Motion> {
    let kind = match required(source, node, "type")?.trim() {
        "fixed" => return Ok(Motion::Fixed),
        "revolute" | "continuous" => JointKind::Revolute,
        "prismatic" => JointKind::Prismatic,
        other => {
            let what = format!(
                "joint \"{name}\" is of type {other}, which has more than one degree of freedom or none that is known"
            );
            let mend = "begin or end the chain beside it by --base and --tip, or write it as joints of one degree of freedom";
            return Ok(Motion::Refused { what, mend: mend.into() });
        }
    };
    let axis = match child(node, "axis") {
        Some(axis) => source.finite::<3>(axis, "xyz")?.unwrap_or([1.0, 0.0, 0.0]),
        None => [1.0, 0.0, 0.0],
    };
    let largest = axis.iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    if largest == 0.0 {
        let what = format!("axis of joint \"{name}\" is zero");
        return Ok(Motion::Refused {
            what,
            mend: "write the direction in which it moves, such as xyz=\"0 0 1\"".into(),
        });
    }
    // By the largest component first: squares of the smallest numbers vanish.
    let scaled = Vec3(axis).times(1.0 / largest);
    let axis = scaled.times(1.0 / scaled.norm());
    let travel = travel(source, node, name, told)?;
    Ok(Motion::Moving { kind, axis, travel, mimic: mimic(source, node)? })
}

/// Limits, where the file states some that are limits; those the wrong way round are told.
fn travel(source: &Source, node: Node, name: &str, told: &mut Vec<String>) -> Result<Option<(f64, f64)>> {
    let limit = child(node, "limit").filter(|_| node.attribute("type") != Some("continuous"));
    let Some(limit) = limit else { return Ok(None) };
    let end = |name| Ok(source.numbers::<1>(limit, name)?.map_or(0.0, |[x]| x));
    let (lower, upper) = (end("lower")?, end("upper")?);
    if lower > upper {
        let line = source.line(limit);
        told.push(format!(
            "the lower limit of joint \"{name}\" (line {line}) is above the upper one: both are left out"
        ));
    }
    Ok((lower < upper && lower.abs() < 1e9 && upper.abs() < 1e9).then_some((lower, upper)))
}

fn mimic(source: &Source, node: Node) -> Result<Option<Mimic>> {
    let Some(mimic) = child(node, "mimic") else { return Ok(None) };
    let number = |name, default| Ok(source.finite::<1>(mimic, name)?.map_or(default, |[x]| x));
    Ok(Some(Mimic {
        leader: required(source, mimic, "joint")?.to_string(),
        factor: number("multiplier", 1.0)?,
        offset: number("offset", 0.0)?,
    }))
}

/// Mass of a link; one that cannot be is left out and told, since geometry does not need it.
fn mass(source: &Source, link: Node, name: &str, told: &mut Vec<String>) -> Option<Mass> {
    let inertial = child(link, "inertial")?;
    let read = || -> Result<(f64, [f64; 3])> {
        let mass = child(inertial, "mass").map_or(Ok(None), |m| source.finite::<1>(m, "value"))?;
        let centre = child(inertial, "origin").map_or(Ok(None), |o| source.finite::<3>(o, "xyz"))?;
        Ok((mass.map_or(0.0, |[kg]| kg), centre.unwrap_or_default()))
    };
    match read() {
        Ok((kg, centre)) if kg > 0.0 => Some((kg, Vec3(centre))),
        Ok((0.0, _)) => None,
        _ => {
            let line = source.line(inertial);
            told.push(format!(
                "the mass of link \"{name}\" (line {line}) is no positive number and is left out"
            ));
            None
        }
    }
}
