//! Terms of an effect along its own joint, as what a drive can be made of.

use super::weight::lever;
use crate::effects::{StoredEffect, StoredSlot, StoredTerm};
use crate::feature::Expression;
use crate::lie::Vec3;
use crate::machine::{Joint, Machine};

/// What a joint's displacement less its command is; SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Term {
    /// So many seconds times the velocity, behind it.
    Lag(f64),
    /// So many s² times the acceleration, behind it.
    Inertia(f64),
    /// Half of `width` behind the direction of travel, taken up along `take_up` as an exponential.
    Friction { width: f64, take_up: f64 },
    /// So many rad/Nm times the pull of the masses that the machine file states, or of 1 kg at every frame beyond.
    Compliance(f64),
    /// So many times the pull of 1 kg at the end of the branch.
    Load(f64),
    /// So many times the pull of a first moment of 1 kg m, fixed to what a dyad moves, along a direction in its frame.
    Lever(f64, usize, Vec3<f64>),
}

/// All of an effect, where every part of it is of this kind.
pub(super) fn terms(machine: &Machine, j: usize, joint: &Joint, effect: &StoredEffect) -> Option<Vec<Term>> {
    let terms = effect.terms.iter().filter(|term| term.value != 0.0);
    let terms: Option<Vec<Term>> = terms.map(|term| of(machine, j, joint, term)).collect();
    terms.filter(|terms| !terms.is_empty())
}

fn of(machine: &Machine, j: usize, joint: &Joint, term: &StoredTerm) -> Option<Term> {
    let [part] = &term.parts[..] else { return None };
    let twist = joint.twist();
    let triple = |v: (f64, f64, f64)| [v.0, v.1, v.2];
    let along = triple(part.v) == twist.v.0 && triple(part.w) == twist.w.0;
    let frame = &machine.dyads()[j].frame;
    let here = matches!(&part.slot, StoredSlot::Before(own) | StoredSlot::After(own) if own == frame);
    let (factor, feature) = factored(&part.feature);
    let Expression::Of(of, feature) = feature else { return None };
    if !along || !here || *of != joint.name {
        return None;
    }
    let size = factor * term.value;
    match &**feature {
        Expression::Velocity => Some(Term::Lag(-size)),
        Expression::Acceleration => Some(Term::Inertia(-size)),
        Expression::TakeUp(along) => match **along {
            Expression::Number(take_up) if take_up > 0.0 => {
                Some(Term::Friction { width: -2.0 * size, take_up })
            }
            _ => None,
        },
        // The model holds the chain from w to t, and no weights beside it.
        Expression::Gravity if machine.side_branches().is_empty() => Some(Term::Compliance(size)),
        Expression::Load if machine.side_branches().is_empty() => Some(Term::Load(size)),
        Expression::Lever(beyond, direction) if machine.side_branches().is_empty() => {
            lever(machine, j, *beyond, *direction).map(|(dyad, direction)| Term::Lever(size, dyad, direction))
        }
        _ => None,
    }
}

/// A number and what it multiplies.
fn factored(expression: &Expression) -> (f64, &Expression) {
    if let Expression::Product(parts) = expression {
        let mut factor = 1.0;
        let mut others = parts.iter().filter(|part| match part {
            Expression::Number(number) => {
                factor *= number;
                false
            }
            _ => true,
        });
        if let (Some(one), None) = (others.next(), others.next()) {
            return (factor, one);
        }
    }
    (1.0, expression)
}
