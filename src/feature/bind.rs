//! From an expression to a feature of one machine.

use super::node::{Column, Function, Node};
use super::{Expression, weights};
use crate::machine::Machine;
use crate::units::Unit;

/// An expression bound to a machine, to a place on it and to the travel seen: a number for each sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    pub(super) node: Node,
    /// How many parts have history.
    pub(super) memories: usize,
}

/// What an expression is bound to.
#[derive(Clone, Debug)]
pub struct Binding<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// Dyad of the own joint.
    pub own: Option<usize>,
    /// Dyad of the other joint of a pair.
    pub partner: Option<usize>,
    /// Range of every dyad's displacement over all recordings, m or rad.
    pub travel: &'a [Option<(f64, f64)>],
    /// First and last time over all recordings, s.
    pub time: Option<(f64, f64)>,
    /// Names of the recordings in their order, and how many samples come before each.
    pub begins: &'a [(String, f64)],
    /// Names of the parameters, in their order.
    pub parameters: &'a [String],
}

/// What an expression refers to and is not there.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unbound {
    /// Own joint where there is none.
    #[error("there is no joint at this place")]
    NoJoint,
    /// A joint that the machine does not have.
    #[error("the machine has no joint \"{0}\"")]
    UnknownJoint(String),
    /// A frame that the machine does not have.
    #[error("the machine has no frame \"{0}\"")]
    UnknownFrame(String),
    /// No range of travel is known.
    #[error("the joint does not move")]
    NoTravel,
    /// No range of time is known.
    #[error("the recordings have no time column `t`")]
    NoTime,
    /// No joint stands there to bear it.
    #[error("the joint has no such joint beyond it")]
    NoLever,
    /// A parameter that is not declared.
    #[error("parameter \"{0}\" is not declared")]
    Parameter(String),
    /// A number that is not finite, or a range from more to less.
    #[error("a number in it is not finite, or a range ends before it begins")]
    Number,
    /// A unit that is none.
    #[error("\"{0}\" is no unit")]
    Unit(String),
}

impl Feature {
    /// Binds an expression.
    ///
    /// # Errors
    /// What it refers to and is not there.
    pub fn bind(expression: &Expression, binding: &Binding) -> Result<Self, Unbound> {
        let mut memories = 0;
        let node = bind(expression, binding, &mut memories)?;
        Ok(Feature { node, memories })
    }

    fn of(node: Node) -> Self {
        Feature { node, memories: 0 }
    }

    /// 1 everywhere.
    pub fn one() -> Self {
        Self::of(Node::Number(1.0))
    }

    /// Displacement of the joint of a dyad, m or rad.
    pub fn position(dyad: usize) -> Self {
        Self::of(Node::Joint(dyad, Column::Position))
    }

    /// Half the direction of travel of the joint of a dyad: ±½, so that its coefficient is the whole difference between directions.
    pub fn half_direction(dyad: usize) -> Self {
        Self::of(Node::Product(vec![Node::Number(0.5), Node::Joint(dyad, Column::Direction)]))
    }

    /// 1 where the joint of a dyad travels in this direction (-1 or 1), else 0.
    pub fn travels(dyad: usize, direction: i8) -> Self {
        let along =
            Node::Product(vec![Node::Number(f64::from(direction)), Node::Joint(dyad, Column::Direction)]);
        // A joint that never moves has direction 0 and travels in none.
        let beyond = Node::Sum(vec![along, Node::Number(-0.5)]);
        Self::of(Node::Function(Function::Step, Box::new(beyond)))
    }

    /// Product of features without history; with history, of which at most one factor may have some.
    pub fn times(self, other: Feature) -> Self {
        let memories = self.memories + other.memories;
        let mut node = other.node;
        renumber(&mut node, self.memories);
        Feature { node: Node::Product(vec![self.node, node]), memories }
    }

    /// The feature in recordings of these names, 0 in others.
    pub fn only_in(&self, recordings: &[String]) -> Self {
        let node = Node::Only(recordings.to_vec(), Box::new(self.node.clone()));
        Feature { node, memories: self.memories }
    }

    /// Whether it says anything in a recording of this name.
    pub fn is_of(&self, recording: &str) -> bool {
        !any(
            &self.node,
            &|n| matches!(n, Node::Only(names, _) if !names.iter().any(|name| name == recording)),
        )
    }

    /// The feature with its parameters replaced by numbers, in SI.
    ///
    /// # Panics
    /// If there are fewer numbers than parameters.
    pub fn with(&self, parameters: &[f64]) -> Self {
        let mut feature = self.clone();
        replace(&mut feature.node, parameters);
        feature
    }

    /// Where positions of a joint stand in it: as they are when that joint follows its command so many seconds late.
    pub(crate) fn late(&self, joint: usize, by: f64) -> Self {
        let mut feature = self.clone();
        delay(&mut feature.node, joint, by);
        feature
    }

    /// The joint of which it is the velocity, turned round: what a lag is multiplied with.
    pub(crate) fn lags(&self) -> Option<usize> {
        match &self.node {
            Node::Product(list) => match list.as_slice() {
                [Node::Number(sign), Node::Joint(j, Column::Velocity)] if *sign == -1.0 => Some(*j),
                _ => None,
            },
            _ => None,
        }
    }

    /// What it is the sine (`false`) or cosine (`true`) of, if it is one and has no history.
    pub fn wave(&self) -> Option<(bool, Feature)> {
        let (cosine, inner) = match &self.node {
            Node::Function(Function::Sin, inner) => (false, inner),
            Node::Function(Function::Cos, inner) => (true, inner),
            _ => return None,
        };
        (self.memories == 0).then(|| (cosine, Feature::of((**inner).clone())))
    }

    /// Whether its value depends on the samples before.
    pub fn remembers(&self) -> bool {
        self.memories > 0
    }

    /// Whether its derivative by parameter `index` says how it changes: not where that parameter stands inside a step or sign.
    pub fn is_smooth_in(&self, index: usize) -> bool {
        smooth(&self.node, index)
    }

    /// Whether it takes part in this parameter at all.
    pub fn takes(&self, index: usize) -> bool {
        any(&self.node, &|n| *n == Node::Parameter(index))
    }

    /// Whether it needs the time of each sample.
    pub fn needs_time(&self) -> bool {
        any(&self.node, &|n| matches!(n, Node::Time(_) | Node::Lag { .. }))
    }

    /// Whether it needs to know when, by time or by the order of samples.
    pub fn needs_moment(&self) -> bool {
        self.needs_time() || any(&self.node, &|n| matches!(n, Node::Order(..)))
    }

    /// Whether it needs velocities or accelerations.
    pub fn needs_rates(&self) -> bool {
        any(&self.node, &|n| matches!(n, Node::Joint(_, Column::Velocity | Column::Acceleration)))
    }

    /// Whether it needs gravity's columns.
    pub fn needs_gravity(&self) -> bool {
        any(&self.node, &|n| matches!(n, Node::Joint(_, Column::Gravity | Column::Load | Column::Weight(_))))
    }

    /// Whether it depends on which way a joint has come.
    pub fn needs_history(&self) -> bool {
        let history = |n: &Node| {
            matches!(n, Node::Joint(_, Column::Direction | Column::SinceReversal | Column::Travelled))
                || matches!(
                    n,
                    Node::Play { .. } | Node::PlayOf { .. } | Node::TakeUp { .. } | Node::Lag { .. }
                )
        };
        any(&self.node, &history)
    }

    /// The extra channels that it needs, by name and unit.
    pub fn channels(&self) -> Vec<(String, String)> {
        let mut names = Vec::new();
        each(&self.node, &mut |n| match n {
            Node::Channel(name, unit) => names.push((name.clone(), unit.clone())),
            Node::Needing(columns, _) => names.extend_from_slice(columns),
            _ => {}
        });
        names.sort();
        names.dedup();
        names
    }

    /// Dyads of the joints that it depends on.
    pub fn joints(&self) -> Vec<usize> {
        let mut joints = Vec::new();
        each(&self.node, &mut |n| match n {
            Node::Joint(j, _)
            | Node::Late(j, _)
            | Node::Play { joint: j, .. }
            | Node::TakeUp { joint: j, .. } => joints.push(*j),
            _ => {}
        });
        joints.sort_unstable();
        joints.dedup();
        joints
    }
}

fn bind(expression: &Expression, b: &Binding, memories: &mut usize) -> Result<Node, Unbound> {
    use Expression as E;
    let own = || b.own.ok_or(Unbound::NoJoint);
    let column = |column| own().map(|j| Node::Joint(j, column));
    // Side branches weigh on it too, and stand where the recording says.
    let weight = |column| {
        own().map(|j| {
            let (node, needs) = (Node::Joint(j, column), weights::columns(b.machine, j));
            if needs.is_empty() { node } else { Node::Needing(needs, Box::new(node)) }
        })
    };
    let mut next = || {
        *memories += 1;
        *memories - 1
    };
    let function = |f, e: &Expression, m: &mut usize| Ok(Node::Function(f, Box::new(bind(e, b, m)?)));
    let named = |name: &str| {
        let found = b.machine.joints().find(|(_, joint)| joint.name == name);
        found.map(|(j, _)| j).ok_or_else(|| Unbound::UnknownJoint(name.into()))
    };
    Ok(match expression {
        E::Number(value) => Node::Number(*value),
        E::Value(value, symbol) => {
            Node::Number(Unit::named(symbol).ok_or_else(|| Unbound::Unit(symbol.clone()))?.to_si(*value))
        }
        E::Parameter(name) => {
            let index = b.parameters.iter().position(|p| p == name);
            Node::Parameter(index.ok_or_else(|| Unbound::Parameter(name.clone()))?)
        }
        E::Position => column(Column::Position)?,
        E::Direction => column(Column::Direction)?,
        E::Velocity => column(Column::Velocity)?,
        E::Acceleration => column(Column::Acceleration)?,
        E::SinceReversal => column(Column::SinceReversal)?,
        E::Travelled => column(Column::Travelled)?,
        E::Gravity => weight(Column::Gravity)?,
        E::Load => column(Column::Load)?,
        E::Moment(n) => weight(Column::Weight(weights::moment(*n)))?,
        E::Shear(n) => weight(Column::Weight(weights::shear(*n)))?,
        E::Lever(k, n) => {
            let index = weights::lever(b.machine, own()?, *k, *n).ok_or(Unbound::NoLever)?;
            weight(Column::Weight(index))?
        }
        E::Stroke => {
            let j = own()?;
            let (from, to) = b.travel[j].filter(|(from, to)| to > from).ok_or(Unbound::NoTravel)?;
            Node::Between(Box::new(Node::Joint(j, Column::Position)), from, to)
        }
        E::Time => Node::Time(b.time.ok_or(Unbound::NoTime)?.0),
        E::Late(by) => Node::Late(own()?, *by),
        E::TimeSince(since) => Node::Time(*since),
        E::Order => Node::Order(b.begins.to_vec(), false),
        E::Beginning => Node::Order(b.begins.to_vec(), true),
        E::OrderIn(begins) => Node::Order(begins.clone(), false),
        E::BeginningIn(begins) => Node::Order(begins.clone(), true),
        E::Clock => {
            let (from, to) = b.time.filter(|(from, to)| to > from).ok_or(Unbound::NoTime)?;
            Node::Between(Box::new(Node::Time(from)), 0.0, to - from)
        }
        E::Beyond => {
            let (from, to) = b.time.filter(|(from, to)| to > from).ok_or(Unbound::NoTime)?;
            let halves = Node::Quotient(Box::new([Node::Time(to), Node::Number(0.5 * (to - from))]));
            Node::Function(Function::Positive, Box::new(halves))
        }
        E::Channel(name, unit) => {
            let joint = b.own.and_then(|j| b.machine.dyads()[j].joint.as_ref());
            if name.contains("{at}") && joint.is_none() {
                return Err(Unbound::NoJoint);
            }
            Node::Channel(name.replace("{at}", joint.map_or("", |joint| &joint.name)), unit.clone())
        }
        E::Only(recordings, e) => Node::Only(recordings.clone(), Box::new(bind(e, b, memories)?)),
        E::Of(name, e) => bind(e, &Binding { own: Some(named(name)?), ..b.clone() }, memories)?,
        E::Partner(e) => {
            let own = Some(b.partner.ok_or(Unbound::NoJoint)?);
            bind(e, &Binding { own, ..b.clone() }, memories)?
        }
        E::Sum(list) => Node::Sum(list.iter().map(|e| bind(e, b, memories)).collect::<Result<_, _>>()?),
        E::Product(list) => {
            Node::Product(list.iter().map(|e| bind(e, b, memories)).collect::<Result<_, _>>()?)
        }
        E::Difference(first, second) => {
            let minus = Node::Product(vec![Node::Number(-1.0), bind(second, b, memories)?]);
            Node::Sum(vec![bind(first, b, memories)?, minus])
        }
        E::Quotient(above, below) => {
            Node::Quotient(Box::new([bind(above, b, memories)?, bind(below, b, memories)?]))
        }
        E::Power(e, n) => Node::Power(Box::new(bind(e, b, memories)?), *n),
        E::Sin(e) => function(Function::Sin, e, memories)?,
        E::Cos(e) => function(Function::Cos, e, memories)?,
        E::Turns(e) => Node::Product(vec![Node::Number(std::f64::consts::TAU), bind(e, b, memories)?]),
        E::Exp(e) => function(Function::Exp, e, memories)?,
        E::Abs(e) => function(Function::Abs, e, memories)?,
        E::Sign(e) => function(Function::Sign, e, memories)?,
        E::Positive(e) => function(Function::Positive, e, memories)?,
        E::Step(e) => function(Function::Step, e, memories)?,
        E::Saturate(e) => function(Function::Saturate, e, memories)?,
        E::Bump(e) => function(Function::Bump, e, memories)?,
        E::Chebyshev(order, e) => Node::Chebyshev(*order, Box::new(bind(e, b, memories)?)),
        E::Between(e, from, to) => Node::Between(Box::new(bind(e, b, memories)?), *from, *to),
        E::Play(width) => {
            let (joint, memory) = (own()?, next());
            Node::Play { joint, width: Box::new(bind(width, b, memories)?), memory }
        }
        E::PlayOf(of, width) => {
            let memory = next();
            let (of, width) = (Box::new(bind(of, b, memories)?), Box::new(bind(width, b, memories)?));
            Node::PlayOf { of, width, memory }
        }
        E::TakeUp(length) => {
            let (joint, memory) = (own()?, next());
            Node::TakeUp { joint, length: Box::new(bind(length, b, memories)?), memory }
        }
        E::Lag(of, time) => {
            let memory = next();
            let (of, time) = (Box::new(bind(of, b, memories)?), Box::new(bind(time, b, memories)?));
            Node::Lag { of, time, memory }
        }
    })
}

pub(super) fn parts(node: &Node) -> Vec<&Node> {
    match node {
        Node::Number(_)
        | Node::Parameter(_)
        | Node::Joint(..)
        | Node::Late(..)
        | Node::Time(_)
        | Node::Order(..)
        | Node::Channel(..) => Vec::new(),
        Node::Sum(list) | Node::Product(list) => list.iter().collect(),
        Node::Quotient(pair) => pair.iter().collect(),
        Node::Power(e, _)
        | Node::Function(_, e)
        | Node::Chebyshev(_, e)
        | Node::Between(e, ..)
        | Node::Needing(_, e)
        | Node::Only(_, e) => {
            vec![e]
        }
        Node::Play { width: e, .. } | Node::TakeUp { length: e, .. } => vec![e],
        Node::PlayOf { of, width: with, .. } | Node::Lag { of, time: with, .. } => vec![of, with],
    }
}

fn parts_mut(node: &mut Node) -> Vec<&mut Node> {
    match node {
        Node::Number(_)
        | Node::Parameter(_)
        | Node::Joint(..)
        | Node::Late(..)
        | Node::Time(_)
        | Node::Order(..)
        | Node::Channel(..) => Vec::new(),
        Node::Sum(list) | Node::Product(list) => list.iter_mut().collect(),
        Node::Quotient(pair) => pair.iter_mut().collect(),
        Node::Power(e, _)
        | Node::Function(_, e)
        | Node::Chebyshev(_, e)
        | Node::Between(e, ..)
        | Node::Needing(_, e)
        | Node::Only(_, e) => {
            vec![e]
        }
        Node::Play { width: e, .. } | Node::TakeUp { length: e, .. } => vec![e],
        Node::PlayOf { of, width: with, .. } | Node::Lag { of, time: with, .. } => vec![of, with],
    }
}

fn any(node: &Node, condition: &dyn Fn(&Node) -> bool) -> bool {
    condition(node) || parts(node).into_iter().any(|part| any(part, condition))
}

pub(super) fn each(node: &Node, look: &mut dyn FnMut(&Node)) {
    look(node);
    parts(node).into_iter().for_each(|part| each(part, look));
}

fn replace(node: &mut Node, parameters: &[f64]) {
    if let Node::Parameter(index) = node {
        *node = Node::Number(parameters[*index]);
    }
    parts_mut(node).into_iter().for_each(|part| replace(part, parameters));
}

fn delay(node: &mut Node, joint: usize, by: f64) {
    if *node == Node::Joint(joint, Column::Position) {
        *node = Node::Late(joint, by);
    }
    parts_mut(node).into_iter().for_each(|part| delay(part, joint, by));
}

fn renumber(node: &mut Node, by: usize) {
    if let Node::Play { memory, .. }
    | Node::PlayOf { memory, .. }
    | Node::TakeUp { memory, .. }
    | Node::Lag { memory, .. } = node
    {
        *memory += by;
    }
    parts_mut(node).into_iter().for_each(|part| renumber(part, by));
}

fn smooth(node: &Node, index: usize) -> bool {
    let steps = matches!(node, Node::Function(Function::Step | Function::Sign, _));
    let inside = steps && any(node, &|n| *n == Node::Parameter(index));
    !inside && parts(node).into_iter().all(|part| smooth(part, index))
}
