//! Where in a URDF text the origins of a chain's joints stand, so that they can be written anew and all other bytes stay.

use std::ops::Range;
use std::path::Path;

use roxmltree::Node;

use super::chain::{Chain, Entry, cut};
use super::step::Move;
use super::xml::{Source, child};
use super::{Ends, Imported, machine_of, urdf};
use crate::error::Result;
use crate::lie::Pose;

/// A joint of the file, fixed or not, on the way from the frame before to a frame of the machine.
#[derive(Clone, Debug)]
pub(crate) struct Origin {
    /// Name of the joint as it stands in the file.
    pub joint: String,
    /// Line of the joint.
    pub line: usize,
    /// The pose that it states.
    pub parent_from_joint: Pose<f64>,
    /// What of the text is replaced to state another pose.
    pub edit: Edit,
}

/// How a text states the origin of a joint.
#[derive(Clone, Debug)]
pub(crate) enum Edit {
    /// Values of the attributes `xyz` and `rpy` of an element `<origin>`: the bytes between the quotes; where one is missing, it goes
    /// to this place.
    Values { xyz: Option<Range<usize>>, rpy: Option<Range<usize>>, missing: usize },
    /// There is no such element; it goes to this place, behind the name of the joint's last attribute and `>`.
    Whole(usize),
}

/// What leads to one frame of the machine.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    /// Its joints in the file, from the frame before outwards; the last of them carries the frame.
    pub origins: Vec<Origin>,
    /// The offset of a mimic joint, behind all of them.
    pub offset: Pose<f64>,
}

/// The machine of a URDF text with the places of its origins, frames in machine order.
///
/// # Errors
/// As [`super::read`].
pub(crate) fn origins(file: &Path, text: &str, ends: &Ends) -> Result<(Imported, Vec<Held>)> {
    let robot = urdf::read(file, text)?;
    let chain = cut(&robot, ends)?;
    let source = Source::new(file, text)?;
    let document = source.document()?;
    let joints: Vec<Node> = (document.root_element().children())
        .filter(|node| node.is_element() && node.tag_name().name() == "joint")
        .collect();
    let held = |entry: &Entry| -> Held {
        let origins = entry.steps.iter().filter_map(|s| {
            let step = &robot.steps[*s];
            // Steps are the joints of the document in its order.
            let node = joints.get(*s)?;
            let pose = Move::all(&step.moves);
            let edit = edit(&source, *node)?;
            Some(Origin { joint: step.name.clone(), line: step.line, parent_from_joint: pose, edit })
        });
        Held { origins: origins.collect(), offset: entry.offset.unwrap_or(Pose::identity(0.0)) }
    };
    let all = frames(&chain).map(held).collect();
    Ok((machine_of(file, chain)?, all))
}

fn frames(chain: &Chain) -> impl Iterator<Item = &Entry> {
    chain.workpiece.iter().chain(&chain.tool)
}

fn edit(source: &Source, joint: Node) -> Option<Edit> {
    let Some(origin) = child(joint, "origin") else {
        // Before the first child: a joint without any has no links and was refused.
        return Some(Edit::Whole(source.original(joint.first_child()?.range().start)));
    };
    let value = |name: &str| {
        let attribute = origin.attributes().find(|a| a.name() == name && a.namespace().is_none())?;
        let range = attribute.range_value();
        Some(source.original(range.start)..source.original(range.end))
    };
    let missing = source.original(origin.range().start) + "<origin".len();
    Some(Edit::Values { xyz: value("xyz"), rpy: value("rpy"), missing })
}
