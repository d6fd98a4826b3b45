//! Columns that belong together: the coordinates of a point, the numbers of a rotation, the elements of a matrix.

use super::draft::{Draft, fits};
use super::heading::{Heading, Stated};
use super::joints::is_commanded;
use crate::units::Quantity;

/// Columns of one body: `marker_x marker_y marker_z`, with its rotation if it has one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Group {
    /// Words that its columns share.
    stem: String,
    /// The same as people write it.
    pub name: String,
    pub position: [Option<usize>; 3],
    /// `qw qx qy qz`.
    pub quaternion: [Option<usize>; 4],
    /// `rx ry rz`: a rotation vector, or angles about these axes.
    pub about: [Option<usize>; 3],
    /// Roll, pitch and yaw; A, B and C; W, P and R: as they stand in such a list.
    pub angles: Option<(Angles, [Option<usize>; 3])>,
}

/// A list of three angles by its letters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Angles {
    RollPitchYaw,
    Abc,
    Wpr,
}

impl Group {
    pub fn point(&self) -> Option<[usize; 3]> {
        let [Some(x), Some(y), Some(z)] = self.position else { return None };
        Some([x, y, z])
    }

    pub fn is_turned(&self) -> bool {
        let angles = self.angles.is_some_and(|(_, list)| list.iter().all(Option::is_some));
        self.quaternion.iter().all(Option::is_some) || self.about.iter().all(Option::is_some) || angles
    }
}

/// Words that say only that it is a position or a rotation.
const POSITION: [&str; 7] = ["pos", "position", "p", "point", "translation", "trans", "coord"];
const ROTATION: [&str; 8] = ["quat", "quaternion", "q", "rot", "rotation", "orientation", "ori", "euler"];

/// What the last or first word of a heading says of its place in a group.
#[derive(Clone, Copy, PartialEq)]
enum Leaf {
    Axis(usize),
    Quaternion(usize),
    About(usize),
    Angle(Angles, usize),
}

fn leaf(word: &str) -> Option<Leaf> {
    Some(match word {
        "x" | "px" | "tx" => Leaf::Axis(0),
        "y" | "py" | "ty" => Leaf::Axis(1),
        "z" | "pz" | "tz" => Leaf::Axis(2),
        "qw" | "w" => Leaf::Quaternion(0),
        "qx" => Leaf::Quaternion(1),
        "qy" => Leaf::Quaternion(2),
        "qz" => Leaf::Quaternion(3),
        "rx" => Leaf::About(0),
        "ry" => Leaf::About(1),
        "rz" => Leaf::About(2),
        "roll" => Leaf::Angle(Angles::RollPitchYaw, 0),
        "pitch" => Leaf::Angle(Angles::RollPitchYaw, 1),
        "yaw" => Leaf::Angle(Angles::RollPitchYaw, 2),
        "a" => Leaf::Angle(Angles::Abc, 0),
        "b" => Leaf::Angle(Angles::Abc, 1),
        "c" => Leaf::Angle(Angles::Abc, 2),
        "p" => Leaf::Angle(Angles::Wpr, 1),
        "r" => Leaf::Angle(Angles::Wpr, 2),
        _ => return None,
    })
}

/// Groups among the columns that have no part yet, in the order of the table.
pub(super) fn find(draft: &Draft) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for column in draft.free(None) {
        let heading = &draft.table.headings[column];
        if is_commanded(heading) || matches!(heading.unit, Stated::Other(_)) {
            continue;
        }
        let Some((leaf, stem, name)) = cut(heading) else { continue };
        let k = groups.iter().position(|group| group.stem == stem).unwrap_or(groups.len());
        if k == groups.len() {
            groups.push(Group { stem, name, ..Group::default() });
        }
        put(&mut groups[k], leaf, column, heading);
    }
    groups.retain(|group| group.point().is_some() || group.is_turned());
    // One position and one rotation are one body where only one of them bears a name.
    if let [a, b] = &groups[..]
        && a.point().is_some() != b.point().is_some()
        && (a.stem.is_empty() || b.stem.is_empty())
    {
        let (point, turn) = if a.point().is_some() { (a, b) } else { (b, a) };
        if !point.is_turned() {
            return vec![Group {
                position: point.position,
                name: point.name.clone(),
                stem: point.stem.clone(),
                ..turn.clone()
            }];
        }
    }
    groups
}

fn put(group: &mut Group, leaf: Leaf, column: usize, heading: &Heading) {
    let length = fits(heading, Quantity::Length);
    let angle = fits(heading, Quantity::Angle);
    let pure = heading.unit == Stated::Nothing || fits(heading, Quantity::One);
    let slot = match leaf {
        Leaf::Axis(k) if length => &mut group.position[k],
        Leaf::Quaternion(k) if pure => &mut group.quaternion[k],
        Leaf::About(k) if angle => &mut group.about[k],
        Leaf::Angle(angles, k) if angle => {
            let (known, list) = group.angles.get_or_insert((angles, [None; 3]));
            if *known != angles {
                return;
            }
            &mut list[k]
        }
        _ => return,
    };
    slot.get_or_insert(column);
}

/// The place of a heading in a group, the group's stem, and the stem as written.
fn cut(heading: &Heading) -> Option<(Leaf, String, String)> {
    let words = &heading.words;
    let (last, first) = (words.last()?, words.first()?);
    let (place, mut leaf_found) = match (leaf(last), leaf(first)) {
        (Some(found), _) => (words.len() - 1, found),
        (None, Some(found)) => (0, found),
        (None, None) => return None,
    };
    let mut rest: Vec<&str> = Vec::new();
    let mut turned = false;
    for (i, word) in words.iter().enumerate().filter(|(i, _)| *i != place) {
        turned |= ROTATION.contains(&word.as_str());
        if !POSITION.contains(&word.as_str()) && !ROTATION.contains(&word.as_str()) {
            rest.push(&words[i]);
        }
    }
    if turned {
        leaf_found = match leaf_found {
            Leaf::Axis(k) if heading.stated().is_some_and(|u| u.quantity() == Quantity::Angle) => {
                Leaf::About(k)
            }
            Leaf::Axis(k) => Leaf::Quaternion(k + 1),
            other => other,
        };
    } else if leaf_found == Leaf::Quaternion(0) && last == "w" && heading.stated().is_some() {
        leaf_found = Leaf::Angle(Angles::Wpr, 0);
    }
    // As written: the raw name without its last or first word.
    let name = if place == 0 {
        let skip =
            heading.name.char_indices().nth(words[0].chars().count()).map_or(heading.name.len(), |(i, _)| i);
        heading.name[skip..].to_string()
    } else {
        let count = heading.name.chars().count().saturating_sub(words[place].chars().count());
        heading.name.chars().take(count).collect()
    };
    let name = name.trim_matches(|c: char| !c.is_alphanumeric()).to_string();
    Some((leaf_found, rest.concat(), if rest.is_empty() { String::new() } else { name }))
}
