//! From a bound feature back to an expression: what calibrated files keep.

use super::bind::Feature;
use super::node::{Column, Function, Node};
use super::{Expression, weights};
use crate::machine::Machine;

impl Feature {
    /// The expression that binds to this feature on the same machine without knowing of any recording: what is stored in files.
    pub fn to_expression(&self, machine: &Machine, parameters: &[String]) -> Expression {
        express(&self.node, machine, parameters)
    }
}

/// What binds to this node on the same machine without knowing of any recording.
fn express(node: &Node, machine: &Machine, parameters: &[String]) -> Expression {
    use Expression as E;
    let inner = |e: &Node| Box::new(express(e, machine, parameters));
    let list = |nodes: &[Node]| nodes.iter().map(|e| express(e, machine, parameters)).collect();
    let of = |j: usize, e: Expression| {
        let name = machine.dyads()[j].joint.as_ref().map_or_else(String::new, |joint| joint.name.clone());
        E::Of(name, Box::new(e))
    };
    match node {
        Node::Number(value) => E::Number(*value),
        Node::Parameter(index) => E::Parameter(parameters.get(*index).cloned().unwrap_or_default()),
        Node::Joint(j, column) => of(
            *j,
            match column {
                Column::Position => E::Position,
                Column::Direction => E::Direction,
                Column::Velocity => E::Velocity,
                Column::Acceleration => E::Acceleration,
                Column::SinceReversal => E::SinceReversal,
                Column::Travelled => E::Travelled,
                Column::Gravity => E::Gravity,
                Column::Load => E::Load,
                Column::Weight(index) => weights::expression(machine, *j, *index),
            },
        ),
        Node::Late(j, by) => of(*j, E::Late(*by)),
        Node::Time(since) => E::TimeSince(*since),
        Node::Order(begins, false) => E::OrderIn(begins.clone()),
        Node::Order(begins, true) => E::BeginningIn(begins.clone()),
        Node::Channel(name, unit) => E::Channel(name.clone(), unit.clone()),
        Node::Needing(_, e) => express(e, machine, parameters),
        Node::Only(recordings, e) => E::Only(recordings.clone(), inner(e)),
        Node::Sum(nodes) => E::Sum(list(nodes)),
        Node::Product(nodes) => E::Product(list(nodes)),
        Node::Quotient(pair) => E::Quotient(inner(&pair[0]), inner(&pair[1])),
        Node::Power(e, n) => E::Power(inner(e), *n),
        Node::Function(f, e) => {
            let e = inner(e);
            match f {
                Function::Sin => E::Sin(e),
                Function::Cos => E::Cos(e),
                Function::Exp => E::Exp(e),
                Function::Abs => E::Abs(e),
                Function::Sign => E::Sign(e),
                Function::Positive => E::Positive(e),
                Function::Step => E::Step(e),
                Function::Saturate => E::Saturate(e),
                Function::Bump => E::Bump(e),
            }
        }
        Node::Chebyshev(order, e) => E::Chebyshev(*order, inner(e)),
        Node::Between(e, from, to) => E::Between(inner(e), *from, *to),
        Node::Play { joint, width, .. } => of(*joint, E::Play(inner(width))),
        Node::PlayOf { of, width, .. } => E::PlayOf(inner(of), inner(width)),
        Node::TakeUp { joint, length, .. } => of(*joint, E::TakeUp(inner(length))),
        Node::Lag { of, time, .. } => E::Lag(inner(of), inner(time)),
    }
}
