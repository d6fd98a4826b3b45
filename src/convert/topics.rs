//! Which topics of a bag hold the joints and the poses of a recording. Where only one may be it, it is taken and told; where several may,
//! the message lists them with the command that takes one.

use std::path::Path;

use super::Request;
use crate::error::{Error, Place, Result};
use crate::machine::Machine;
use crate::rosbag::{Bag, Fault, Holds, Joints, Poses, Step, Topic};
use crate::wording::{count, shown};

/// Topics and links of a list are as many as a person reads.
const SHOWN: usize = 40;

/// Where poses come from.
pub(super) enum Source<'a> {
    Topic(&'a Topic, &'a Poses),
    /// The links from the parent to the child, one after the other.
    Frames {
        parent: &'a str,
        child: &'a str,
        way: Vec<Step<'a>>,
    },
}

/// What is taken of a bag.
pub(super) struct Chosen<'a> {
    pub joints: (&'a Topic, &'a Joints),
    pub poses: Source<'a>,
    pub told: Vec<String>,
}

/// What may be taken, the flag that takes it, and what it is called.
type Candidate<T> = (T, String, String);

pub(super) fn choose<'a>(
    file: &Path,
    bag: &'a Bag,
    machine: Option<&Machine>,
    request: &'a Request,
) -> Result<Chosen<'a>> {
    let (mut told, mut open, mut flags): (Vec<String>, Vec<String>, Vec<String>) = Default::default();
    let joints = match one(joints(bag, machine, request), request.joint_topic.is_some()) {
        Ok((joints, guess)) => {
            told.extend(guess.map(|name| format!("joints are those of {name}")));
            flags.extend(request.joint_topic.as_ref().map(|topic| format!("--joint-topic {topic}")));
            Some(joints)
        }
        Err(several) => {
            open.push(asked("positions of joints", "sensor_msgs/JointState", &several, &request.joint_topic));
            let any = self::joints(bag, machine, &Request::default());
            flags.extend(any.first().map(|(_, flag, _)| flag.clone()));
            None
        }
    };
    let is_told = request.pose_topic.is_some() || request.frames.is_some();
    let poses = match &request.frames {
        Some((parent, child)) => {
            let way = bag.frames.way(parent, child);
            match way {
                Ok(way) if !way.is_empty() => {
                    flags.push(format!("--frames {parent},{child}"));
                    Some(Pose::Way(parent, child, way))
                }
                Ok(_) => {
                    open.push(format!("frames: `{}` is told twice", shown(parent)));
                    None
                }
                Err(what) => {
                    let names: Vec<&str> = bag.frames.names().into_iter().take(SHOWN).collect();
                    let names = if names.is_empty() { "none".into() } else { names.join(", ") };
                    open.push(format!("frames: {what}; frames of TF in the bag: {names}"));
                    None
                }
            }
        }
        None => match one(poses(bag, request), is_told) {
            Ok((pose, guess)) => {
                told.extend(guess.map(|name| format!("poses are those of {name}")));
                flags.extend(request.pose_topic.as_ref().map(|topic| format!("--pose-topic {topic}")));
                Some(pose)
            }
            Err(several) => {
                let types = "geometry_msgs/PoseStamped, geometry_msgs/TransformStamped, nav_msgs/Odometry or tf2_msgs/TFMessage";
                open.push(asked("poses", types, &several, &request.pose_topic));
                let any = self::poses(bag, &Request::default());
                flags.extend(any.first().map(|(_, flag, _)| flag.clone()));
                None
            }
        },
    };
    if request.frames.is_some() && poses.is_none() {
        let any = self::poses(bag, &Request::default());
        flags.extend(any.first().map(|(_, flag, _)| flag.clone()));
    }
    let (Some(joints), Some(poses)) = (joints, poses) else {
        let call = request
            .call
            .clone()
            .unwrap_or_else(|| format!("kincal convert {} --machine MACHINE.ron -o REC.csv", file.display()));
        open.extend(bag.lost.clone());
        let what = format!("{}\n  topics of the bag:\n{}", open.join("\n  "), listed(bag));
        let mend = match flags.is_empty() || bag.topics.is_empty() {
            true => "record joints and poses in one bag: `ros2 bag record --storage mcap TOPIC TOPIC`".into(),
            false => format!("say which, for example: {call} {}", flags.join(" ")),
        };
        return Err(Error::mistake(Place::file(file), what, mend));
    };
    let sound = |topic: &Topic| match &topic.fault {
        Some(Fault { what, mend }) => {
            let what = format!("topic `{}`: {what}", shown(&topic.name));
            Err(Error::mistake(Place::file(file), what, mend.clone()))
        }
        None => Ok(()),
    };
    sound(joints.0)?;
    let poses = match poses {
        Pose::Topic(topic, poses) => {
            sound(topic)?;
            Source::Topic(topic, poses)
        }
        Pose::Way(parent, child, way) => {
            bag.topics.iter().filter(|topic| matches!(topic.holds, Holds::Frames)).try_for_each(sound)?;
            Source::Frames { parent, child, way }
        }
    };
    Ok(Chosen { joints, poses, told })
}

enum Pose<'a> {
    Topic(&'a Topic, &'a Poses),
    Way(&'a str, &'a str, Vec<Step<'a>>),
}

/// The only candidate, with its name where nobody has told it; else all of them.
fn one<T>(
    mut all: Vec<Candidate<T>>,
    is_told: bool,
) -> std::result::Result<(T, Option<String>), Vec<Candidate<T>>> {
    match (all.len(), all.pop()) {
        (1, Some((own, flag, name))) => Ok((own, (!is_told).then(|| format!("{name} (`{flag}`)")))),
        (_, last) => {
            all.extend(last);
            Err(all)
        }
    }
}

fn asked<T>(what: &str, types: &str, several: &[Candidate<T>], told: &Option<String>) -> String {
    match (told, several.len()) {
        (Some(topic), _) => format!("no topic `{}` with {what} ({types})", shown(topic)),
        (None, 0) => format!("no topic has {what} ({types})"),
        (None, n) => {
            let names: Vec<&str> = several.iter().take(SHOWN).map(|(_, flag, _)| &**flag).collect();
            format!("which {what}: {n} may be it, {}", names.join(" or "))
        }
    }
}

fn joints<'a>(
    bag: &'a Bag,
    machine: Option<&Machine>,
    request: &Request,
) -> Vec<Candidate<(&'a Topic, &'a Joints)>> {
    let is_asked = |topic: &Topic| request.joint_topic.as_ref().is_none_or(|own| *own == topic.name);
    let all = bag.topics.iter().filter_map(|topic| match &topic.holds {
        Holds::Joints(joints) if topic.messages > 0 && is_asked(topic) => {
            let flag = format!("--joint-topic {}", topic.name);
            Some(((topic, joints), flag, format!("topic `{}`", topic.name)))
        }
        _ => None,
    });
    let all: Vec<_> = all.collect();
    let names_all = |((_, joints), _, _): &&Candidate<(&Topic, &Joints)>| {
        machine.is_some_and(|machine| machine.commands().iter().all(|own| joints.names.contains(own)))
    };
    // Grippers and wheels have topics of their own.
    let own: Vec<_> = all.iter().filter(names_all).collect();
    if all.len() > 1 && own.len() == 1 {
        return own
            .into_iter()
            .cloned()
            .map(|(own, flag, name)| (own, flag, format!("{name}, which alone names all joints")))
            .collect();
    }
    all
}

fn poses<'a>(bag: &'a Bag, request: &Request) -> Vec<Candidate<Pose<'a>>> {
    let is_asked = |topic: &Topic| request.pose_topic.as_ref().is_none_or(|own| *own == topic.name);
    let topics = bag.topics.iter().filter_map(|topic| match &topic.holds {
        Holds::Poses(poses) if topic.messages > 0 && is_asked(topic) => {
            let flag = format!("--pose-topic {}", topic.name);
            Some((Pose::Topic(topic, poses), flag, format!("topic `{}`", topic.name)))
        }
        _ => None,
    });
    let links =
        bag.frames.moving().filter(|_| request.pose_topic.is_none()).filter_map(|(parent, child, _)| {
            let way = bag.frames.way(parent, child).ok()?;
            let flag = format!("--frames {parent},{child}");
            Some((Pose::Way(parent, child, way), flag, format!("frame `{child}` in frame `{parent}` of TF")))
        });
    topics.chain(links).collect()
}

/// A line for each topic with its type, and for what moves in TF.
fn listed(bag: &Bag) -> String {
    let width = |of: fn(&Topic) -> &str| {
        bag.topics.iter().map(|topic| shown(of(topic)).chars().count()).max().unwrap_or(0)
    };
    let (names, kinds) = (width(|topic| &topic.name), width(|topic| &topic.kind));
    let mut lines: Vec<String> = Vec::new();
    for topic in bag.topics.iter().take(SHOWN) {
        let messages = count(topic.messages, "message", "messages");
        lines.push(format!("    {:names$}  {:kinds$}  {messages}", shown(&topic.name), shown(&topic.kind)));
    }
    if bag.topics.is_empty() {
        lines.push("    none".into());
    }
    if bag.topics.len() > SHOWN {
        lines.push(format!("    and {} more", bag.topics.len() - SHOWN));
    }
    for (parent, child, link) in bag.frames.moving().take(SHOWN) {
        let poses = count(link.poses.points().len() as u64, "pose", "poses");
        lines.push(format!("    TF: `{}` in `{}`, {poses}", shown(child), shown(parent)));
    }
    lines.join("\n")
}
