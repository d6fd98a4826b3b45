//! What a feature depends on, in words.

use super::bind::{Feature, each, parts};
use super::node::{Column, Node};

/// Something that a feature depends on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Dependence {
    /// What of the joint of a dyad: its `position`, `direction`, `velocity`, `acceleration`, or the `weight` on it.
    Joint(&'static str, usize),
    /// The time, the order of samples, or a channel by name.
    Other(String),
}

impl Feature {
    /// What it depends on, in the order in which it is written; each once.
    pub(crate) fn depends_on(&self) -> Vec<Dependence> {
        let mut all: Vec<Dependence> = Vec::new();
        gather(&self.node, false, &mut |on| {
            if !all.contains(&on) {
                all.push(on);
            }
        });
        all
    }

    /// The joints on whose position it depends, and whether it matters from which side each came; `None` where it depends on anything else.
    pub(crate) fn stands_on(&self) -> Option<Vec<(usize, bool)>> {
        let (mut joints, mut is_more) = (Vec::new(), false);
        each(&self.node, &mut |node| match node {
            Node::Joint(j, Column::Position) => joints.push((*j, false)),
            Node::Joint(j, Column::Direction) => joints.push((*j, true)),
            Node::Joint(..) | Node::Late(..) | Node::Time(_) | Node::Order(..) | Node::Channel(..) => {
                is_more = true
            }
            Node::Needing(..) | Node::Only(..) => is_more = true,
            Node::Play { .. } | Node::PlayOf { .. } | Node::TakeUp { .. } | Node::Lag { .. } => {
                is_more = true
            }
            Node::Number(_) | Node::Parameter(_) | Node::Sum(_) | Node::Product(_) | Node::Quotient(_) => {}
            Node::Power(..) | Node::Function(..) | Node::Chebyshev(..) | Node::Between(..) => {}
        });
        (!is_more).then_some(joints)
    }
}

/// Everything that a node depends on. Where something stands between its stops, or how far it has been taken up, follows from which way the
/// joints came: of what is `driven`, positions say no more than that.
fn gather(node: &Node, driven: bool, take: &mut dyn FnMut(Dependence)) {
    match node {
        Node::Joint(j, Column::Position) | Node::Late(j, _) if driven => {
            take(Dependence::Joint("direction", *j));
        }
        Node::Joint(j, column) => take(Dependence::Joint(of_column(*column), *j)),
        Node::Late(j, _) => take(Dependence::Joint("position", *j)),
        Node::Play { joint, .. } | Node::TakeUp { joint, .. } => {
            take(Dependence::Joint("direction", *joint));
        }
        Node::Time(_) | Node::Lag { .. } => take(Dependence::Other("time".into())),
        Node::Order(..) => take(Dependence::Other("order of samples".into())),
        Node::Channel(name, _) => take(Dependence::Other(name.clone())),
        _ => {}
    }
    let driven = driven || matches!(node, Node::PlayOf { .. });
    parts(node).into_iter().for_each(|part| gather(part, driven, take));
}

fn of_column(column: Column) -> &'static str {
    match column {
        Column::Position => "position",
        Column::Direction | Column::SinceReversal | Column::Travelled => "direction",
        Column::Velocity => "velocity",
        Column::Acceleration => "acceleration",
        Column::Gravity | Column::Load | Column::Weight(_) => "weight",
    }
}
