//! The chain between two links of a description, as dyads.

use super::Ends;
use super::names::{Names, usable};
use super::step::{Mass, Mimic, Motion, Move, Robot, Step};
use crate::error::{Error, Result};
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::{FileUnits, JointKind};

/// One entry of a machine file.
pub(super) struct Entry {
    pub frame: String,
    /// What stands before the joint: moves from left to right.
    pub moves: Vec<Move>,
    /// A turn or shift by a mimic's offset, which no elementary move need say; behind the moves.
    pub offset: Option<Pose<f64>>,
    pub joint: Option<JointEntry>,
    pub mass: Option<Mass>,
    /// The joints of the description, fixed ones included, whose origins are in it, by index.
    pub steps: Vec<usize>,
    /// Where it comes from.
    pub note: String,
}

pub(super) struct JointEntry {
    pub kind: JointKind,
    pub axis: Vec3<f64>,
    pub travel: Option<(f64, f64)>,
    /// Leaders with their factors; nothing where the joint has a command of its own alone.
    pub follows: Vec<(String, f64)>,
    /// Address in NC programs, where it is not the name in capitals.
    pub nc: Option<String>,
}

pub(super) struct Chain {
    pub name: String,
    pub about: String,
    /// Units of the machine file.
    pub units: FileUnits,
    pub workpiece: Vec<Entry>,
    pub tool: Vec<Entry>,
    pub told: Vec<String>,
}

/// The chain from one end to the other; where they stand on two arms, each has a list from the link that carries both.
pub(super) fn cut(robot: &Robot, ends: &Ends) -> Result<Chain> {
    let mut told = robot.told.clone();
    let above = parents(robot)?;
    let base = match &ends.base {
        Some(name) => link(robot, name, "--base")?,
        None => root(robot, &above, &mut told)?,
    };
    let tip = match &ends.tip {
        Some(name) => link(robot, name, "--tip")?,
        None => only_end(robot, &above, base, &mut told)?,
    };
    let (up, down) = (path(robot, &above, base)?, path(robot, &above, tip)?);
    let top = |steps: &[&Step], own: usize| steps.first().map_or(own, |s| s.parent);
    if top(&up, base) != top(&down, tip) {
        let what = format!(
            "no joints lead from {} \"{}\" to \"{}\"",
            robot.noun, robot.links[base].name, robot.links[tip].name
        );
        let mend = format!("name two {}s of one tree by --base and --tip", robot.noun);
        return Err(Error::mistake(robot.place(robot.links[tip].line), what, mend));
    }
    let shared = up.iter().zip(&down).take_while(|(a, b)| std::ptr::eq(**a, **b)).count();
    if up[..shared].iter().any(|step| step.motion != Motion::Fixed || !step.moves.is_empty()) {
        told.push(format!("the base stands on other {0}s of the description; gravity is taken along -z of the {0} that carries both ends", robot.noun));
    }
    let (up, down) = (&up[shared..], &down[shared..]);
    let mut names = Names::default();
    let given: Vec<(&str, String)> = (up.iter().chain(down))
        .filter(|step| step.motion != Motion::Fixed)
        .map(|step| (step.name.as_str(), names.give(&step.name)))
        .collect();
    for (own, name) in given.iter().filter(|(own, name)| own != name) {
        told.push(format!(
            "joint \"{}\" is called {name}: machine files do not take its own name",
            own.escape_debug()
        ));
    }
    let mut maker = Maker { robot, given: &given, next: 0, told: &mut told };
    let workpiece = maker.entries(up, "w", base)?;
    let tool = maker.entries(down, "t", tip)?;
    let about = format!(
        "{}, {} to {}",
        one_line(&robot.name),
        one_line(&robot.links[base].name),
        one_line(&robot.links[tip].name)
    );
    let units = robot.units;
    Ok(Chain { name: usable(&robot.name, "robot_"), about, units, workpiece, tool, told })
}

/// A text of the description where a line must stay one, in quotes or as a comment.
pub(super) fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() || matches!(c, '"' | '\\') { ' ' } else { c }).collect()
}

/// Index of the step above each link.
fn parents(robot: &Robot) -> Result<Vec<Option<usize>>> {
    let mut above = vec![None; robot.links.len()];
    for (s, step) in robot.steps.iter().enumerate() {
        if let Some(first) = above[step.child].replace(s) {
            let first: &Step = &robot.steps[first];
            let what = format!(
                "link \"{}\" hangs on joint \"{}\" and on \"{}\" (line {}): a closed loop",
                robot.links[step.child].name, step.name, first.name, first.line
            );
            return Err(Error::mistake(
                robot.place(step.line),
                what,
                "leave the joint out that closes the loop",
            ));
        }
    }
    Ok(above)
}

fn link(robot: &Robot, name: &str, option: &str) -> Result<usize> {
    robot.links.iter().position(|l| l.name == name).ok_or_else(|| {
        let known = listed(robot.links.iter().map(|l| l.name.as_str()));
        let what = format!("{option} {name}: there is no such {}", robot.noun);
        Error::mistake(robot.place(0), what, format!("name one of: {known}"))
    })
}

/// Names, as many as a message can bear.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let all: Vec<&str> = names.collect();
    let more = all.len().saturating_sub(40);
    let text = all[..all.len() - more].join(", ");
    if more > 0 { format!("{text} and {more} more") } else { text }
}

fn root(robot: &Robot, above: &[Option<usize>], told: &mut Vec<String>) -> Result<usize> {
    let roots: Vec<usize> = (0..robot.links.len()).filter(|l| above[*l].is_none()).collect();
    // Links that carry nothing are no robots.
    let carrying = |l: &&usize| robot.steps.iter().any(|step| step.parent == **l);
    let found: Vec<usize> =
        if roots.len() > 1 { roots.iter().filter(carrying).copied().collect() } else { roots };
    match found[..] {
        [root] => {
            told.push(format!("base is the root, {} \"{}\"", robot.noun, robot.links[root].name));
            Ok(root)
        }
        _ => {
            let names = listed(found.iter().map(|l| robot.links[*l].name.as_str()));
            let what = format!("{} {}s stand on no other one", found.len(), robot.noun);
            let mend = if found.is_empty() {
                "leave the joint out that closes the loop".into()
            } else {
                format!("name one by --base: {names}")
            };
            Err(Error::mistake(robot.place(0), what, mend))
        }
    }
}

/// The only link behind `base` that carries nothing and that a joint moves.
fn only_end(robot: &Robot, above: &[Option<usize>], base: usize, told: &mut Vec<String>) -> Result<usize> {
    let parts = |step: &&Step| robot.links[step.child].is_part;
    let carries = |l: usize| robot.steps.iter().filter(parts).any(|step| step.parent == l);
    let mut ends = Vec::new();
    for l in (0..robot.links.len()).filter(|l| robot.links[*l].is_part && !carries(*l)) {
        let steps = path(robot, above, l)?;
        let from = steps.iter().position(|step| step.parent == base);
        if from.is_some_and(|from| steps[from..].iter().any(|step| step.motion != Motion::Fixed)) {
            ends.push(l);
        }
    }
    match ends[..] {
        [end] => {
            told.push(format!("tip is the only end, {} \"{}\"", robot.noun, robot.links[end].name));
            Ok(end)
        }
        [] => {
            let what = format!("nothing moves behind {} \"{}\"", robot.noun, robot.links[base].name);
            let mend = format!("name another {} by --base", robot.noun);
            Err(Error::mistake(robot.place(robot.links[base].line), what, mend))
        }
        _ => {
            let what = format!("the robot has {} ends", ends.len());
            let mend = format!(
                "name the {} that is the tool by --tip, such as one of: {}",
                robot.noun,
                listed(ends.iter().map(|l| robot.links[*l].name.as_str()))
            );
            Err(Error::mistake(robot.place(0), what, mend))
        }
    }
}

/// Steps from the root to a link.
fn path<'a>(robot: &'a Robot, above: &[Option<usize>], link: usize) -> Result<Vec<&'a Step>> {
    let mut steps = Vec::new();
    let mut at = link;
    while let Some(s) = above[at] {
        let step = &robot.steps[s];
        steps.push(step);
        at = step.parent;
        if steps.len() > robot.steps.len() {
            let what = format!("joint \"{}\" stands in a ring of joints", step.name);
            return Err(Error::mistake(
                robot.place(step.line),
                what,
                "leave the joint out that closes the loop",
            ));
        }
    }
    steps.reverse();
    Ok(steps)
}

struct Maker<'a> {
    robot: &'a Robot,
    /// Names of the joints of the chain, in its order.
    given: &'a [(&'a str, String)],
    next: usize,
    told: &'a mut Vec<String>,
}

impl Maker<'_> {
    fn entries(&mut self, steps: &[&Step], end: &str, end_link: usize) -> Result<Vec<Entry>> {
        let mut entries: Vec<Entry> = Vec::new();
        let (mut moves, mut notes, mut passed) = (Vec::new(), Vec::new(), Vec::new());
        for step in steps {
            moves.extend(&step.moves);
            passed.extend(self.robot.steps.iter().position(|own| std::ptr::eq(own, *step)));
            let (kind, axis, travel, mimic) = match &step.motion {
                Motion::Refused { what, mend } => {
                    return Err(Error::mistake(self.robot.place(step.line), what, mend));
                }
                Motion::Fixed => {
                    notes.push(format!("{} (fixed, {})", one_line(&step.name), self.robot.line(step.line)));
                    continue;
                }
                Motion::Moving { kind, axis, travel, mimic } => (*kind, *axis, *travel, mimic),
            };
            notes.push(format!("{} ({})", one_line(&step.name), self.robot.line(step.line)));
            let frame = self.given[self.next].1.clone();
            self.next += 1;
            let (follows, offset) = match mimic {
                Some(mimic) => self.follow(step, mimic),
                None => (Vec::new(), 0.0),
            };
            let twist = match kind {
                JointKind::Prismatic => Twist::new(axis.times(offset), Vec3([0.0; 3])),
                JointKind::Revolute => Twist::new(Vec3([0.0; 3]), axis.times(offset)),
            };
            let mut entry = Entry {
                frame,
                moves: std::mem::take(&mut moves),
                offset: (offset != 0.0).then(|| Pose::exp(twist)),
                joint: Some(JointEntry { kind, axis, travel, follows, nc: None }),
                mass: None,
                steps: std::mem::take(&mut passed),
                note: std::mem::take(&mut notes).join(", "),
            };
            self.weigh(&mut entry, step.child);
            entries.push(entry);
        }
        let link = &self.robot.links[end_link];
        // What only marks a place is the last step itself.
        notes.extend(link.is_part.then(|| format!("{} {}", self.robot.noun, one_line(&link.name))));
        let note = notes.join(", ");
        entries.push(Entry {
            frame: end.into(),
            moves,
            offset: None,
            joint: None,
            mass: None,
            steps: passed,
            note,
        });
        Ok(entries)
    }

    /// Adds the masses of a link and of all that is bolted to it, in the chain or beside it.
    fn weigh(&self, entry: &mut Entry, carried: usize) {
        let mut waiting = vec![(carried, Pose::identity(0.0))];
        while let Some((link, joint_from_link)) = waiting.pop() {
            let bolted = self.robot.steps.iter().filter(|s| s.parent == link && s.motion == Motion::Fixed);
            waiting.extend(bolted.map(|s| (s.child, joint_from_link * Move::all(&s.moves))));
            let Some((kg, centre)) = self.robot.links[link].mass else { continue };
            let centre = joint_from_link.transform(centre);
            entry.mass = Some(match entry.mass {
                None => (kg, centre),
                Some((had, at)) => (had + kg, at.times(had / (had + kg)) + centre.times(kg / (had + kg))),
            });
        }
    }

    /// What a mimic joint follows in the chain, and by what offset. Leaders that follow others are followed to the first.
    fn follow(&mut self, step: &Step, mimic: &Mimic) -> (Vec<(String, f64)>, f64) {
        let mut total = mimic.clone();
        for _ in 0..self.robot.steps.len() {
            let leader = self.robot.steps.iter().find(|s| s.name == total.leader);
            let Some(Motion::Moving { mimic: Some(next), .. }) = leader.map(|s| &s.motion) else { break };
            total.offset += total.factor * next.offset;
            total.factor *= next.factor;
            total.leader.clone_from(&next.leader);
        }
        let name = one_line(&step.name);
        match self.given.iter().find(|(own, _)| *own == total.leader && *own != step.name) {
            Some((_, given)) => (vec![(given.clone(), total.factor)], total.offset),
            None => {
                let leader = one_line(&total.leader);
                self.told.push(format!(
                    "joint \"{name}\" follows \"{leader}\", which is not in the chain: it has a command of its own"
                ));
                (Vec::new(), 0.0)
            }
        }
    }
}
