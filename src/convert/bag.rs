//! Bags of ROS 2 as tables: a row for each pose, with the positions of the joints at its stamp.
//!
//! Joints and poses are published by themselves, each with the moment in its header. Where the joints were at the moment `t` of a pose lies on
//! the straight line between the joint states before and behind it,
//!
//! ```text
//! q(t) = q_i + (q_j - q_i) (t - t_i) / (t_j - t_i)        t_i <= t <= t_j,  t_j - t_i <= the longest gap
//! ```
//!
//! and nothing is said of moments before the first, behind the last, or in a longer gap: such rows are dropped, counted and told.

use std::io::Read;
use std::path::Path;

use csv::StringRecord;

use super::Request;
use super::heading::{Heading, Stated, words};
use super::map::Map;
use super::table::{Found, Row, Table};
use super::target::quantity;
use super::topics::{self, Source};
use crate::error::{Error, Place, Result};
use crate::machine::Machine;
use crate::rosbag::{self, Around, Bag, Joints, Link, Posed, Track};
use crate::units::Quantity;
use crate::wording::{count, shown};

/// The longest gap over which a line is drawn is so many usual intervals, where nobody tells it.
const GAP: i64 = 3;
/// Stamps above this, ns, count from 1970, and not from the start of a simulation.
const SINCE_1970: i64 = 970_000_000_000_000_000;
/// A bend that is told, rad or m: what is below is rounding.
const LEAST_BEND: f64 = 1e-9;
/// Columns before those of joints: `t px py pz qw qx qy qz`.
const POSE: [&str; 8] = ["t", "px", "py", "pz", "qw", "qx", "qy", "qz"];

/// The table of a bag.
pub(super) struct Bagged {
    pub table: Table,
    /// What was told of it, and what the bag tells.
    pub request: Request,
    /// ns, one for each row.
    stamps: Vec<i64>,
    joints: Joints,
    topic: String,
    /// Where `t` is 0, if nobody has told it.
    zero: Option<String>,
    told: Vec<String>,
}

/// Why a row has no position of a joint.
#[derive(Clone, Copy, PartialEq)]
enum Without {
    Outside,
    Gap,
    Turn,
}

pub(super) fn read(
    file: &Path,
    parts: Vec<(&Path, Box<dyn Read + '_>)>,
    machine: Option<&Machine>,
    request: &Request,
) -> Result<Bagged> {
    let fault = |what: String, mend: &str| Error::mistake(Place::file(file), what, mend);
    if request.path.is_some() {
        let mend = "leave --path out: a bag has the positions of the joints";
        return Err(fault("--path: a bag is no table of readings".into(), mend));
    }
    if let Some(word) = request.measurement.as_deref().filter(|word| !["pose", "position"].contains(word)) {
        let mend = "write --measurement pose, or position, which leaves the rotation out";
        return Err(fault(format!("--measurement: a bag has poses, and no {}", shown(word)), mend));
    }
    let bag = Bag::read(parts)?;
    let chosen = topics::choose(file, &bag, machine, request)?;
    let mut told = chosen.told;
    told.extend(bag.lost.clone());
    let (topic, joints) = chosen.joints;
    let poses = poses_of(file, &chosen.poses, request, &mut told)?;
    if joints.without > 0 {
        told.push(format!(
            "{} without positions",
            count(joints.without, "joint state is", "joint states are")
        ));
    }
    let mut bagged = Bagged {
        table: Table {
            file: file.into(),
            headings: headings(joints),
            line: 0,
            rows: Vec::new(),
            separator: None,
            decimal_comma: false,
        },
        request: request.clone(),
        stamps: poses.iter().map(|(at, _)| *at).collect(),
        joints: joints.clone(),
        topic: topic.name.clone(),
        zero: None,
        told,
    };
    let gaps: Vec<i64> = (0..joints.names.len()).map(|k| bagged.gap(k)).collect();
    for (line, (at, pose)) in (1..).zip(&poses) {
        let mut fields: StringRecord = [seconds(*at)].iter().collect();
        pose.position.iter().chain(&pose.quaternion).for_each(|x| fields.push_field(&format!("{x:?}")));
        for (track, gap) in joints.tracks.iter().zip(&gaps) {
            let position = position(track, *at, *gap);
            fields.push_field(&position.map_or(String::new(), |(q, _)| format!("{q:?}")));
        }
        bagged.table.rows.push(Row { line, fields });
    }
    bagged.tell_columns();
    Ok(bagged)
}

impl Bagged {
    /// Says of the table's own columns what they are, where nobody has said otherwise. Messages of ROS are in m, rad and s.
    fn tell_columns(&mut self) {
        let request = &mut self.request;
        let is_position = request.measurement.as_deref() == Some("position");
        for (k, name) in POSE.into_iter().enumerate().filter(|(k, _)| !is_position || *k < 4) {
            if !request.columns.iter().any(|(to, _)| to == name) {
                request.columns.push((name.into(), format!("#{}", k + 1)));
            }
        }
        // The first pose may be dropped: its stamp is the zero all the same.
        let first = self.stamps.first().filter(|at| **at > SINCE_1970);
        if let Some(first) = first.filter(|_| request.time_zero.is_none() && request.map.is_none()) {
            request.time_zero = Some(seconds(*first));
            self.zero = Some(seconds(*first));
        }
        // Those that were told come before.
        for (kind, unit) in [("length", "m"), ("angle", "rad"), ("time", "s")] {
            request.units.push((kind.into(), unit.into()));
        }
    }

    /// The longest gap over which a line is drawn for a joint, ns.
    fn gap(&self, joint: usize) -> i64 {
        longest(&self.request, &self.joints.tracks[joint])
    }

    /// Drops the rows in which a joint that the map takes has no position, and tells what was taken and dropped.
    ///
    /// # Errors
    /// [`Error::Input`]: no row is left, or the clock of the joints was set back.
    pub fn settled(&mut self, map: &Map, machine: Option<&Machine>) -> Result<Vec<String>> {
        let file = self.table.file.clone();
        let fault = |what: String, mend: &str| Error::mistake(Place::file(&file), what, mend);
        // Places of joints, and whether they turn.
        let used: Vec<(usize, bool)> = (map.columns.iter())
            .filter_map(|part| match self.table.column(&part.from) {
                Found::One(column) => {
                    let joint = column.checked_sub(POSE.len())?;
                    Some((joint, quantity(&part.to, machine) == Some(Quantity::Angle)))
                }
                _ => None,
            })
            .collect();
        for (joint, _) in &used {
            let called =
                || format!("joint `{}` of topic `{}`", shown(&self.joints.names[*joint]), shown(&self.topic));
            check_clock(&file, &self.joints.tracks[*joint], called)?;
        }
        let (mut kept, mut dropped) = (Vec::new(), [0; 3]);
        // The most that the way bends off the lines, by kind of joint, with the joint.
        let mut bends: [Option<(f64, usize)>; 2] = [None; 2];
        for (i, at) in self.stamps.iter().enumerate() {
            let mut without = None;
            for (joint, turns) in &used {
                match position(&self.joints.tracks[*joint], *at, self.gap(*joint)) {
                    Err(why) => without = without.or(Some(why)),
                    Ok((_, bend)) => {
                        let most = &mut bends[usize::from(*turns)];
                        if most.is_none_or(|(own, _)| bend > own) {
                            *most = Some((bend, *joint));
                        }
                    }
                }
            }
            match without {
                None => kept.push(self.table.rows[i].clone()),
                Some(why) => dropped[why as usize] += 1,
            }
        }
        if kept.is_empty() {
            let tracks = used.iter().filter_map(|(joint, _)| self.joints.tracks[*joint].span());
            let spans = tracks.reduce(|a, b| (a.0.max(b.0), a.1.min(b.1)));
            let of = |span: Option<(i64, i64)>| {
                span.map_or("none".into(), |(a, b)| format!("{} s to {} s", seconds(a), seconds(b)))
            };
            let poses = self.stamps.first().zip(self.stamps.last()).map(|(a, b)| (*a, *b));
            let what = format!(
                "no pose lies between joint states: joint states are from {}, poses from {}",
                of(spans),
                of(poses)
            );
            let mend = "stamp both by one clock (chrony or PTP between computers, `use_sim_time` for all nodes or for none); a longer gap is allowed by `--longest-gap`";
            return Err(fault(what, mend));
        }
        self.table.rows = kept;
        let mut told = std::mem::take(&mut self.told);
        let repeated: u64 =
            used.iter().map(|(joint, _)| self.joints.tracks[*joint].repeated()).max().unwrap_or(0);
        tell_repeated(repeated, ("joint state", "joint states"), &mut told);
        let gap = used.iter().map(|(joint, _)| self.gap(*joint)).max().unwrap_or(0) as f64 * 1e-9;
        let mut line = format!(
            "joint positions at the stamps of poses lie on straight lines between joint states no more than {gap:.4} s apart"
        );
        if self.request.longest_gap.is_none() {
            line += &format!(", {GAP} of their usual intervals (`--longest-gap`)");
        }
        for (bend, turns) in bends.into_iter().zip([false, true]) {
            if let Some((bend, joint)) = bend.filter(|(bend, _)| *bend >= LEAST_BEND) {
                let unit = if turns { "urad" } else { "um" };
                line += &format!(
                    "; the way of `{}` bends off them by up to {:.3} {unit}",
                    shown(&self.joints.names[joint]),
                    bend * 1e6
                );
            }
        }
        told.push(line);
        let whys = [
            "before the first or behind the last joint state",
            "in a longer gap of the joint states",
            "where a joint counts anew from the other end of a turn",
        ];
        for (count_of, why) in dropped.into_iter().zip(whys).filter(|(n, _)| *n > 0) {
            told.push(format!("{} dropped {why}", count(count_of, "pose", "poses")));
        }
        told.push("joint states say where joints were read to be, not what was commanded: a lag of the drives does not show".into());
        told.extend(self.zero.iter().map(|zero| {
            format!("t is 0 at {zero}, the stamp of the first pose; where several files share one clock, give all the same `--time-zero`")
        }));
        Ok(told)
    }
}

/// Puts columns into the order in which recordings have them: time, joints, what was measured.
pub(super) fn order(map: &mut Map) {
    map.columns.sort_by_key(|part| match &*part.to {
        "t" => 0,
        name if POSE.contains(&name) => 2,
        _ => 1,
    });
}

/// The longest gap over which a line is drawn in a track, ns.
fn longest<T>(request: &Request, track: &Track<T>) -> i64 {
    match request.longest_gap {
        Some(seconds) => (seconds * 1e9).round() as i64,
        None => track.usual_interval().unwrap_or(0).saturating_mul(GAP),
    }
}

/// Where a joint is at a moment, and by how much its way bends off the straight line there.
fn position(track: &Track<f64>, at: i64, longest: i64) -> std::result::Result<(f64, f64), Without> {
    let points = track.points();
    match track.around(at) {
        Around::Outside => Err(Without::Outside),
        Around::At(i) => Ok((points[i].1, 0.0)),
        Around::Between(i) if track.interval(i) > longest => Err(Without::Gap),
        Around::Between(i) => {
            let (q, change) = (points[i].1, points[i + 1].1 - points[i].1);
            // Half a turn within an interval is no motion.
            if change.abs() > std::f64::consts::PI {
                return Err(Without::Turn);
            }
            let part = track.part(i, at);
            // Lines are off by p (1 - p) h^2 q''/2; half of q'' is the divided difference of three points.
            let of = |i: usize| -> Option<f64> {
                let [(a, x), (b, y), (c, z)] = points.get(i..i + 3)?.try_into().ok()?;
                let (h, k) = ((b - a) as f64, (c - b) as f64);
                Some(((z - y) / k - (y - x) / h) / (h + k))
            };
            let both = i.checked_sub(1).and_then(of).into_iter().chain(of(i));
            let (sum, n) = both.fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
            let curve = if n > 0.0 { f64::abs(sum / n) } else { 0.0 };
            let h = track.interval(i) as f64;
            Ok((q + change * part, part * (1.0 - part) * h * h * curve))
        }
    }
}

/// Poses in the order of time.
fn poses_of(
    file: &Path,
    source: &Source,
    request: &Request,
    told: &mut Vec<String>,
) -> Result<Vec<(i64, Posed)>> {
    let (all, of, frame, child) = match source {
        Source::Topic(topic, poses) => {
            let called = || format!("topic `{}`", shown(&topic.name));
            check_clock(file, &poses.track, called)?;
            tell_repeated(poses.track.repeated(), ("pose", "poses"), told);
            (poses.track.points().to_vec(), called(), poses.frame.clone(), poses.child.clone())
        }
        Source::Frames { parent, child, way } => {
            let all = poses_along(file, (parent, child), way, request, told)?;
            (all, "TF".to_string(), parent.to_string(), child.to_string())
        }
    };
    let total = all.len();
    let given: Vec<_> = all.into_iter().filter(|(_, pose)| pose.is_given()).collect();
    if given.len() < total {
        let lost = count((total - given.len()) as u64, "pose", "poses");
        told.push(format!("{lost} of {total} dropped that are zero or NaN: the target was not seen"));
    }
    if given.is_empty() {
        let what = format!("{of} has no pose that is given: all are zero or NaN");
        return Err(Error::mistake(Place::file(file), what, "record while the instrument sees its target"));
    }
    let child = if child.is_empty() { String::new() } else { format!(" of `{}`", shown(&child)) };
    told.push(format!(
            "poses{child} are in frame `{}`, which is taken as frame w of the machine; if nobody knows where that stands, say --head 'workpiece_frame: unknown'",
            shown(&frame)
        ));
    Ok(given)
}

/// Poses over a way of links, at the stamps of the moving one that comes least often.
fn poses_along(
    file: &Path,
    (parent, child): (&str, &str),
    way: &[rosbag::Step],
    request: &Request,
    told: &mut Vec<String>,
) -> Result<Vec<(i64, Posed)>> {
    let moving: Vec<&rosbag::Step> = way.iter().filter(|step| !step.link.is_fixed).collect();
    let Some(slowest) = moving.iter().min_by_key(|step| step.link.poses.points().len()) else {
        let what = format!(
            "frame `{}` does not move in frame `{}`: all between them is fixed",
            shown(child),
            shown(parent)
        );
        return Err(Error::mistake(
            Place::file(file),
            what,
            "name by --frames a frame that the instrument follows",
        ));
    };
    for step in &moving {
        check_clock(file, &step.link.poses, || format!("frame `{}` of TF", shown(step.child)))?;
        tell_repeated(step.link.poses.repeated(), ("pose", "poses"), told);
        if step.link.blank > 0 {
            let lost = count(step.link.blank, "pose", "poses");
            told.push(format!(
                "{lost} of frame `{}` dropped that are zero or NaN: the target was not seen",
                shown(step.child)
            ));
        }
    }
    let gap = |link: &Link| longest(request, &link.poses);
    let stamps: Vec<i64> = slowest.link.poses.points().iter().map(|(at, _)| *at).collect();
    let found: Vec<(i64, Posed)> =
        stamps.iter().filter_map(|at| Some((*at, rosbag::along(way, *at, gap)?))).collect();
    if way.len() > 1 {
        let chain: Vec<String> = way
            .iter()
            .map(|step| {
                format!(
                    "`{}` in `{}`{}",
                    shown(step.child),
                    shown(step.parent),
                    if step.is_up { ", reversed" } else { "" }
                )
            })
            .collect();
        told.push(format!("frames between: {}", chain.join("; ")));
    }
    if moving.len() > 1 {
        told.push(format!(
            "{} of these links move: poses have the stamps of `{}`, the others are interpolated there",
            moving.len(),
            shown(slowest.child)
        ));
    }
    if found.len() < stamps.len() {
        let lost = count((stamps.len() - found.len()) as u64, "pose", "poses");
        told.push(format!("{lost} dropped where another link of the chain has none, or a longer gap"));
    }
    if found.is_empty() {
        let what =
            format!("the links between `{}` and `{}` share no stretch of time", shown(parent), shown(child));
        return Err(Error::mistake(
            Place::file(file),
            what,
            "stamp them by one clock, or allow a longer gap by `--longest-gap`",
        ));
    }
    Ok(found)
}

fn tell_repeated(repeated: u64, (one, many): (&str, &str), told: &mut Vec<String>) {
    if repeated > 0 {
        told.push(format!("{} left out of a stamp that a later one has too", count(repeated, one, many)));
    }
}

/// Stamps that go back far are no order of arrival.
fn check_clock<T>(file: &Path, track: &Track<T>, called: impl Fn() -> String) -> Result<()> {
    let Some((number, back)) = track.set_back() else { return Ok(()) };
    let what = format!(
        "{}: stamps go back by {:.3} s at message {}: the clock was set, or two runs are in one bag",
        called(),
        back as f64 * 1e-9,
        number + 1
    );
    let mend = "cut the bag there: `mcap filter BAG.mcap -o PART.mcap --start ... --end ...`";
    Err(Error::mistake(Place::file(file), what, mend))
}

fn headings(joints: &Joints) -> Vec<Heading> {
    let units = ["s", "m", "m", "m", "", "", "", ""];
    let pose = POSE.into_iter().zip(units).map(|(name, unit)| Heading::read(name).with_unit(unit));
    // Names of joints are names, whatever they end in.
    let own = joints.names.iter().map(|name| Heading {
        raw: name.clone(),
        name: name.clone(),
        words: words(name),
        unit: Stated::Nothing,
    });
    pose.chain(own).collect()
}

/// Seconds of a stamp, to the nanosecond.
fn seconds(at: i64) -> String {
    let sign = if at < 0 { "-" } else { "" };
    let (whole, part) = (at.unsigned_abs() / 1_000_000_000, at.unsigned_abs() % 1_000_000_000);
    format!("{sign}{whole}.{part:09}")
}
