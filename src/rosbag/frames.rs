//! Frames of TF: who is seen in whom, and the way from one to another over those between.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::message::Posed;
use super::track::{Around, Track};

/// How one frame stands in its parent.
#[derive(Clone, Debug, Default)]
pub(crate) struct Link {
    /// Poses of the child in the parent; the last one holds for ever where it is fixed.
    pub poses: Track<Posed>,
    /// Whether it was sent once, for all times (`/tf_static`).
    pub is_fixed: bool,
    /// Poses that say nothing, and are left out.
    pub blank: u64,
}

/// All frames of a bag.
#[derive(Clone, Debug, Default)]
pub(crate) struct Frames {
    /// By child and parent.
    links: BTreeMap<(String, String), Link>,
}

/// One link of a way, and whether it is gone from child to parent.
pub(crate) struct Step<'a> {
    pub parent: &'a str,
    pub child: &'a str,
    pub link: &'a Link,
    pub is_up: bool,
}

impl Frames {
    pub fn push(&mut self, parent: &str, child: &str, is_fixed: bool, at: i64, pose: Posed) {
        let link = self.links.entry((child.into(), parent.into())).or_default();
        link.is_fixed |= is_fixed;
        match pose.is_given() {
            true => link.poses.push(at, pose),
            false => link.blank += 1,
        }
    }

    pub fn settle(&mut self) {
        self.links.values_mut().for_each(|link| link.poses.settle());
    }

    /// Parent, child and link of all that move.
    pub fn moving(&self) -> impl Iterator<Item = (&str, &str, &Link)> {
        let moving = self.links.iter().filter(|(_, link)| !link.is_fixed);
        moving.map(|((child, parent), link)| (&**parent, &**child, link))
    }

    pub fn names(&self) -> BTreeSet<&str> {
        self.links.keys().flat_map(|(child, parent)| [&**child, &**parent]).collect()
    }

    fn parents<'a>(&'a self, child: &'a str) -> impl Iterator<Item = (&'a str, &'a Link)> {
        let own = self.links.iter().filter(move |((own, _), _)| own == child);
        own.map(|((_, parent), link)| (&**parent, link))
    }

    /// From a frame to the one that nobody has a parent of; what is wrong where a frame has two parents or is its own ancestor.
    fn ancestors<'a>(&'a self, frame: &'a str) -> Result<Vec<Step<'a>>, String> {
        let (mut way, mut child): (Vec<Step>, &str) = (Vec::new(), frame);
        loop {
            let mut parents = self.parents(child);
            let Some((parent, link)) = parents.next() else { return Ok(way) };
            if let Some((other, _)) = parents.next() {
                return Err(format!("frame `{child}` has two parents, `{parent}` and `{other}`"));
            }
            if parent == frame || way.iter().any(|step| step.child == parent) {
                return Err(format!("frame `{parent}` is its own ancestor"));
            }
            way.push(Step { parent, child, link, is_up: false });
            child = parent;
        }
    }

    /// The links whose poses, one after the other, are the pose of `child` in `parent`.
    pub fn way<'a>(&'a self, parent: &'a str, child: &'a str) -> Result<Vec<Step<'a>>, String> {
        let (mut up, mut down) = (self.ancestors(parent)?, self.ancestors(child)?);
        // What both have in common is gone twice, and falls away.
        while let (Some(a), Some(b)) = (up.last(), down.last()) {
            if a.child != b.child {
                break;
            }
            up.pop();
            down.pop();
        }
        let top = |way: &[Step<'a>], frame: &'a str| way.last().map_or(frame, |step| step.parent);
        if top(&up, parent) != top(&down, child) {
            return Err(format!("no chain of frames joins `{parent}` and `{child}`"));
        }
        down.reverse();
        Ok(up.into_iter().map(|step| Step { is_up: true, ..step }).chain(down).collect())
    }
}

impl Link {
    /// The pose at a moment, between two that are no further apart than `longest`, ns.
    pub fn at(&self, at: i64, longest: i64) -> Option<Isometry3<f64>> {
        let points = self.poses.points();
        if self.is_fixed {
            return Some(isometry(points.last()?.1));
        }
        match self.poses.around(at) {
            Around::At(i) => Some(isometry(points[i].1)),
            Around::Between(i) if self.poses.interval(i) <= longest => {
                let (a, b) = (isometry(points[i].1), isometry(points[i + 1].1));
                a.try_lerp_slerp(&b, self.poses.part(i, at), 1e-9)
            }
            _ => None,
        }
    }
}

fn isometry(pose: Posed) -> Isometry3<f64> {
    let ([x, y, z], [w, i, j, k]) = (pose.position, pose.quaternion);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), turn)
}

/// The pose at the end of a way at a moment; `None` where a link has none.
pub(crate) fn along(way: &[Step], at: i64, longest: impl Fn(&Link) -> i64) -> Option<Posed> {
    let mut pose = Isometry3::identity();
    for step in way {
        let own = step.link.at(at, longest(step.link))?;
        pose *= if step.is_up { own.inverse() } else { own };
    }
    let (p, q) = (pose.translation.vector, pose.rotation.into_inner());
    Some(Posed { position: [p.x, p.y, p.z], quaternion: [q.w, q.i, q.j, q.k] })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(x: f64, about_z: f64) -> Posed {
        Posed {
            position: [x, 0.0, 0.0],
            quaternion: [(about_z / 2.0).cos(), 0.0, 0.0, (about_z / 2.0).sin()],
        }
    }

    #[test]
    fn a_way_goes_up_to_what_both_have_in_common_and_down_again() {
        let mut frames = Frames::default();
        frames.push("world", "tracker", true, 0, pose(1.0, 0.0));
        frames.push("tracker", "ball", false, 0, pose(2.0, 0.0));
        frames.push("tracker", "ball", false, 10, pose(4.0, 1.0));
        frames.push("world", "base", true, 0, pose(-1.0, std::f64::consts::FRAC_PI_2));
        frames.push("base", "tool", false, 0, pose(0.5, 0.0));
        frames.push("island", "palm", true, 0, pose(0.0, 0.0));
        frames.settle();
        let way = frames.way("base", "ball").expect("joined");
        let names: Vec<_> = way.iter().map(|step| (step.parent, step.child, step.is_up)).collect();
        assert_eq!(names, [("world", "base", true), ("world", "tracker", false), ("tracker", "ball", false)]);
        // The ball is at 1 + 3 half-way, 5 from the base, whose x is the world's y.
        let found = along(&way, 5, |_| 10).expect("within");
        assert!((found.position[0]).abs() < 1e-15 && (found.position[1] + 5.0).abs() < 1e-15);
        let turned: f64 = 0.5 - std::f64::consts::FRAC_PI_2;
        assert!((found.quaternion[3] - (turned / 2.0).sin()).abs() < 1e-15);
        assert!(along(&way, 5, |_| 9).is_none() && along(&way, 11, |_| 10).is_none());
        assert!(frames.way("base", "palm").is_err_and(|what| what.contains("no chain")));
        assert!(frames.way("base", "nobody").is_err());
        assert_eq!(frames.way("tracker", "ball").expect("direct").len(), 1);
        frames.push("base", "ball", false, 0, pose(0.0, 0.0));
        assert!(
            frames.way("base", "ball").is_err_and(|what| what.contains("two parents, `base` and `tracker`"))
        );
        frames.push("ball", "tracker", false, 0, pose(0.0, 0.0));
        assert!(frames.way("world", "ball").is_err());
    }
}
