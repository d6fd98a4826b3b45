//! MJCF, the models of MuJoCo: bodies in one another, each with the joints that move it.

mod defaults;
mod include;
mod orientation;
mod settings;

use std::collections::{HashMap, HashSet};
use std::path::Path;

use roxmltree::Node;

use super::Reader;
use super::step::{Link, Mass, Motion, Move, Robot, Step};
use super::xml::{Source, child};
use crate::error::{Error, Result};
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::JointKind;
use defaults::Defaults;
use settings::Settings;

/// Elements that make bodies of their own, which are not read.
const MAKERS: [&str; 4] = ["replicate", "attach", "composite", "flexcomp"];

pub(super) fn read(file: &Path, text: &str, files: Reader) -> Result<Robot> {
    let whole = include::expanded(file, text, files)?;
    let source = Source::of_pieces(file, &whole.text, whole.lines.clone())?;
    let document = source.document()?;
    let root = document.root_element();
    if root.tag_name().name() != "mujoco" {
        let what = format!("the file begins with <{}>, MJCF with <mujoco>", root.tag_name().name());
        return Err(source.fault(root, what, "name the model itself, not a part that it includes"));
    }
    let settings = Settings::read(&source, root)?;
    let defaults = Defaults::read(&source, root)?;
    let line = source.line(root);
    let name = root.attribute("model").filter(|name| !name.trim().is_empty()).unwrap_or("mujoco_model");
    let world = Link { name: "world".into(), line, mass: None, is_part: true };
    let mut reader = Bodies {
        source: &source,
        settings: &settings,
        defaults,
        robot: Robot {
            file: file.to_path_buf(),
            name: name.to_string(),
            noun: "body",
            lines: whole.lines,
            units: settings.units,
            links: vec![world],
            steps: Vec::new(),
            told: settings.told.clone(),
        },
        sites: Vec::new(),
        named: HashMap::new(),
        joints: HashSet::new(),
        unweighed: 0,
    };
    for section in root.children().filter(|n| n.has_tag_name("worldbody")) {
        reader.tree(section)?;
    }
    reader.finish(root)
}

/// Where the walk through the bodies is: what an element's children stand in.
#[derive(Clone)]
struct Here {
    /// The body, as a link.
    link: usize,
    /// From the body to where the children are placed.
    body_from_here: Pose<f64>,
    /// Class of defaults of all that names none.
    class: Option<String>,
}

struct Bodies<'a> {
    source: &'a Source<'a>,
    settings: &'a Settings,
    defaults: Defaults<'a>,
    robot: Robot,
    /// Steps of sites, which come behind all bodies.
    sites: Vec<(Step, Link)>,
    /// Lines of bodies by name.
    named: HashMap<String, usize>,
    joints: HashSet<String>,
    /// Bodies whose masses would follow from their geoms.
    unweighed: usize,
}

/// A joint as MuJoCo has it, in the frame of its body.
struct Joint {
    name: String,
    line: usize,
    at: Vec3<f64>,
    /// What its position at rest takes away.
    rest: Option<Pose<f64>>,
    motion: Motion,
}

impl<'a> Bodies<'a> {
    /// All bodies of a section. The list of what is still to be read takes the place of recursion: models may be nested deeply.
    fn tree(&mut self, section: Node<'a, 'a>) -> Result<()> {
        let class = section.attribute("childclass").map(str::to_string);
        let world = Here { link: 0, body_from_here: Pose::identity(0.0), class };
        let mut waiting: Vec<(Node<'a, 'a>, Here)> = vec![(section, world)];
        while let Some((node, here)) = waiting.pop() {
            let mut inner = Vec::new();
            for element in node.children().filter(Node::is_element) {
                match element.tag_name().name() {
                    "body" => inner.push((element, self.body(element, &here)?)),
                    "frame" => inner.push((element, self.frame(element, &here)?)),
                    "site" => self.site(element, &here)?,
                    "joint" | "freejoint" if here.link == 0 => {
                        let what = "the world has a joint";
                        return Err(self.source.fault(element, what, "put it into a body"));
                    }
                    name if MAKERS.contains(&name) => {
                        let line = self.robot.line(self.source.line(element));
                        self.robot
                            .told
                            .push(format!("<{name}> ({line}) is not read, nor the bodies that it makes"));
                    }
                    _ => {}
                }
            }
            waiting.extend(inner.into_iter().rev());
        }
        Ok(())
    }

    fn class(&self, node: Node<'a, 'a>, here: &Here) -> Result<Option<String>> {
        match node.attribute("childclass") {
            Some(name) => {
                self.defaults.known(self.source, node, name)?;
                Ok(Some(name.to_string()))
            }
            None => Ok(here.class.clone()),
        }
    }

    fn placed(&self, node: Node, which: &[Node]) -> Result<Vec<Move>> {
        let at = first(which, |n| self.source.finite::<3>(n, "pos"))?.unwrap_or_default();
        let mut moves = Move::shifts(Vec3(at)).to_vec();
        moves.extend(orientation::moves(self.source, self.settings, node, which)?);
        moves.retain(|m| !m.is_none());
        Ok(moves)
    }

    fn frame(&mut self, node: Node<'a, 'a>, here: &Here) -> Result<Here> {
        let own = Move::all(&self.placed(node, &[node])?);
        Ok(Here {
            link: here.link,
            body_from_here: here.body_from_here * own,
            class: self.class(node, here)?,
        })
    }

    fn body(&mut self, node: Node<'a, 'a>, here: &Here) -> Result<Here> {
        let class = self.class(node, here)?;
        let line = self.source.line(node);
        let name = match node.attribute("name").filter(|name| !name.is_empty()) {
            Some(name) => name.to_string(),
            None => {
                let name = format!("body_of_line_{line}");
                match self.named.contains_key(&name) {
                    true => format!("{name}_{}", self.robot.links.len()),
                    false => name,
                }
            }
        };
        if let Some(first) = self.named.insert(name.clone(), line) {
            let what = format!("body \"{name}\" stands twice, first in {}", self.robot.line(first));
            return Err(self.source.fault(node, what, "give one of them another name"));
        }
        let mut moves = self.placed(node, &[node])?;
        if here.body_from_here != Pose::identity(0.0) {
            moves.insert(0, Move::Pose(here.body_from_here));
        }
        let joints = self.joints(node, &name, &class)?;
        let mass = self.mass(node, &name)?;
        let mut parent = here.link;
        let mut back = Vec3([0.0; 3]);
        let count = joints.len();
        for (i, joint) in joints.into_iter().enumerate() {
            moves.extend(Move::shifts(joint.at - back));
            moves.extend(joint.rest.map(Move::Pose));
            moves.retain(|m| !m.is_none());
            back = joint.at;
            // The body itself stands behind its last joint, where that passes through its origin.
            let is_last = i + 1 == count && back.0 == [0.0; 3];
            let link = if is_last { name.clone() } else { format!("{name} behind {}", joint.name) };
            let child = self.link(link, line, mass.filter(|_| is_last));
            let moves = std::mem::take(&mut moves);
            self.robot.steps.push(Step {
                name: joint.name,
                line: joint.line,
                parent,
                child,
                moves,
                motion: joint.motion,
            });
            parent = child;
        }
        let link = if count > 0 && back.0 == [0.0; 3] {
            parent
        } else {
            moves.extend(Move::shifts(-back));
            moves.retain(|m| !m.is_none());
            let child = self.link(name.clone(), line, mass);
            self.robot.steps.push(Step { name, line, parent, child, moves, motion: Motion::Fixed });
            child
        };
        Ok(Here { link, body_from_here: Pose::identity(0.0), class })
    }

    fn link(&mut self, name: String, line: usize, mass: Option<Mass>) -> usize {
        self.robot.links.push(Link { name, line, mass, is_part: true });
        self.robot.links.len() - 1
    }

    /// Joints of a body, those in its frames included, in their order.
    fn joints(&mut self, body: Node<'a, 'a>, name: &str, class: &Option<String>) -> Result<Vec<Joint>> {
        let mut joints = Vec::new();
        let start = Here { link: 0, body_from_here: Pose::identity(0.0), class: class.clone() };
        let mut waiting = vec![(body.first_element_child(), start)];
        // Depth first and in order: behind a frame come the elements that follow it.
        while let Some((next, here)) = waiting.pop() {
            let Some(node) = next else { continue };
            waiting.push((node.next_sibling_element(), here.clone()));
            match node.tag_name().name() {
                "joint" | "freejoint" => {
                    let own = self.joint(node, name, joints.len(), &here)?;
                    joints.push(own);
                }
                "frame" => {
                    let inner = self.frame(node, &here)?;
                    waiting.push((node.first_element_child(), inner));
                }
                _ => {}
            }
        }
        Ok(joints)
    }

    fn joint(&mut self, node: Node<'a, 'a>, body: &str, count: usize, here: &Here) -> Result<Joint> {
        let line = self.source.line(node);
        let own = node.attribute("name").filter(|name| !name.is_empty()).map(str::to_string);
        let number = if count > 0 { format!("_{}", count + 1) } else { String::new() };
        let name = own.unwrap_or_else(|| format!("{body}_joint{number}"));
        if !self.joints.insert(name.clone()) {
            let what = format!("joint \"{name}\" stands twice");
            return Err(self.source.fault(node, what, "give one of them another name"));
        }
        let zero = Vec3([0.0; 3]);
        let is_free = node.has_tag_name("freejoint");
        let which =
            if is_free { vec![node] } else { self.defaults.of(self.source, node, "joint", &here.class)? };
        let word = |attribute: &str| which.iter().find_map(|n| n.attribute(attribute)).map(str::trim);
        let kind = if is_free { "free" } else { word("type").unwrap_or("hinge") };
        let kind = match kind {
            "hinge" => JointKind::Revolute,
            "slide" => JointKind::Prismatic,
            "free" | "ball" => {
                let degrees = if kind == "free" { "six" } else { "three" };
                let what =
                    format!("joint \"{name}\" is of type {kind}, which has {degrees} degrees of freedom");
                let mend = match kind {
                    "free" => format!("begin the chain behind it, by --base {body} or a body beyond"),
                    _ => "begin or end the chain beside it by --base and --tip, or write it as three hinges"
                        .into(),
                };
                let motion = Motion::Refused { what, mend };
                return Ok(Joint { name, line, at: zero, rest: None, motion });
            }
            other => {
                let what = format!("joint \"{name}\" is of type `{other}`");
                return Err(self.source.fault(node, what, "write hinge or slide"));
            }
        };
        let at = first(&which, |n| self.source.finite::<3>(n, "pos"))?.unwrap_or_default();
        let axis = first(&which, |n| self.source.finite::<3>(n, "axis"))?.unwrap_or([0.0, 0.0, 1.0]);
        let at = here.body_from_here.transform(Vec3(at));
        let Some(axis) = orientation::unit(Vec3(axis)) else {
            let what = format!("axis of joint \"{name}\" is zero");
            let mend = "write the direction in which it moves, such as axis=\"0 0 1\"".into();
            return Ok(Joint { name, line, at, rest: None, motion: Motion::Refused { what, mend } });
        };
        let axis = here.body_from_here.rotation * axis;
        let position = |x: f64| if kind == JointKind::Revolute { self.settings.angle(x) } else { x };
        let rest = first(&which, |n| self.source.finite::<1>(n, "ref"))?.map_or(0.0, |[x]| position(x));
        let range = first(&which, |n| self.source.numbers::<2>(n, "range"))?;
        let limited = match word("limited").unwrap_or("auto") {
            "true" => true,
            "false" => false,
            _ => self.settings.autolimits,
        };
        let travel = range.map(|[lower, upper]| (position(lower), position(upper)));
        let sound = |(lower, upper): &(f64, f64)| lower < upper && lower.abs() < 1e9 && upper.abs() < 1e9;
        let travel = travel.filter(|range| limited && sound(range));
        let back = match kind {
            JointKind::Revolute => Twist::new(zero, axis.times(-rest)),
            JointKind::Prismatic => Twist::new(axis.times(-rest), zero),
        };
        let rest = (rest != 0.0).then(|| Pose::exp(back));
        Ok(Joint { name, line, at, rest, motion: Motion::Moving { kind, axis, travel, mimic: None } })
    }

    /// Mass of a body where the model states it.
    fn mass(&mut self, body: Node<'a, 'a>, name: &str) -> Result<Option<Mass>> {
        let geoms = body.children().any(|n| n.has_tag_name("geom"));
        let Some(inertial) = child(body, "inertial").filter(|_| !self.settings.masses_of_geoms) else {
            self.unweighed += usize::from(geoms);
            return Ok(None);
        };
        let kg = self.source.finite::<1>(inertial, "mass")?.map_or(0.0, |[kg]| kg);
        let centre = self.source.finite::<3>(inertial, "pos")?.unwrap_or_default();
        if kg < 0.0 {
            let line = self.robot.line(self.source.line(inertial));
            self.robot.told.push(format!("the mass of body \"{name}\" ({line}) is negative and is left out"));
        }
        Ok((kg > 0.0).then_some((kg, Vec3(centre))))
    }

    fn site(&mut self, node: Node<'a, 'a>, here: &Here) -> Result<()> {
        let Some(name) = node.attribute("name").filter(|name| !name.is_empty()) else { return Ok(()) };
        let which = self.defaults.of(self.source, node, "site", &here.class)?;
        let ends = first(&which, |n| self.source.finite::<6>(n, "fromto"))?;
        let mut moves = match ends {
            Some(ends) => orientation::between(ends),
            None => self.placed(node, &which)?,
        };
        if here.body_from_here != Pose::identity(0.0) {
            moves.insert(0, Move::Pose(here.body_from_here));
        }
        let line = self.source.line(node);
        let step = Step {
            name: format!("site {name}"),
            line,
            parent: here.link,
            child: 0,
            moves,
            motion: Motion::Fixed,
        };
        let link = Link { name: name.to_string(), line, mass: None, is_part: false };
        self.sites.push((step, link));
        Ok(())
    }

    /// Sites behind all bodies, and what is told of the whole.
    fn finish(mut self, root: Node) -> Result<Robot> {
        let mut sites = HashSet::new();
        for (mut step, mut link) in std::mem::take(&mut self.sites) {
            if !sites.insert(link.name.clone()) {
                let what = format!("site \"{}\" stands twice", link.name);
                return Err(Error::mistake(
                    self.robot.place(link.line),
                    what,
                    "give one of them another name",
                ));
            }
            // Bodies and sites have names of their own in MJCF.
            if link.name == "world" || self.named.contains_key(&link.name) {
                link.name = format!("site:{}", link.name);
            }
            step.child = self.robot.links.len();
            self.robot.links.push(link);
            self.robot.steps.push(step);
        }
        if self.unweighed > 0 {
            self.robot
                .told
                .push("masses that MuJoCo takes from geoms are not read, only those of <inertial>".into());
        }
        let constraints = root.children().filter(|n| n.has_tag_name("equality")).flat_map(|n| n.children());
        for joint in constraints.filter(|n| n.has_tag_name("joint")) {
            let name = joint.attribute("joint1").unwrap_or_default();
            if let Some(other) = joint.attribute("joint2") {
                let line = self.robot.line(self.source.line(joint));
                self.robot.told.push(format!(
                    "joint \"{name}\" is coupled to \"{other}\" by an equality ({line}), which is not read: each has a command of its own, unless you write `follows`"
                ));
            }
        }
        Ok(self.robot)
    }
}

/// The first value among an element and its defaults.
fn first<T>(which: &[Node], value: impl Fn(Node) -> Result<Option<T>>) -> Result<Option<T>> {
    for node in which {
        if let Some(found) = value(*node)? {
            return Ok(Some(found));
        }
    }
    Ok(None)
}
