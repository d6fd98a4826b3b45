//! Units of expressions: what does not fit is refused before anything is evaluated.

use super::{Dimension, Expression};
use crate::machine::JointKind;
use crate::units::Unit;

/// Why an expression has no dimension, and where in it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what}")]
pub struct DimensionFault {
    /// Indices of values in brackets that lead to the part at fault, as in `[0][1]`.
    pub path: String,
    /// What is wrong.
    pub what: String,
    /// How to mend it.
    pub mend: String,
}

/// What an expression may refer to.
#[derive(Clone, Copy)]
pub struct Scope<'a> {
    /// Kind of the own joint; `None` on frames without joint and on the measurement.
    pub own: Option<JointKind>,
    /// Kind of the other joint of a pair.
    pub partner: Option<JointKind>,
    /// Kind of a joint by its name; `None` where no such joint is known. In a library no machine is known: any name has the kind that `own` has.
    pub named: &'a dyn Fn(&str) -> Option<JointKind>,
    /// Dimensions of the family's parameters.
    pub parameter: &'a dyn Fn(&str) -> Option<Dimension>,
}

/// The dimension of an expression, `docs/effects.md` (42).
///
/// # Errors
/// Where parts do not fit: a sum of unlike things, the sine of a length, a joint where there is none.
pub fn dimension_of(expression: &Expression, scope: &Scope) -> Result<Dimension, DimensionFault> {
    use Expression::*;
    let fault = |what: String, mend: &str| DimensionFault { path: String::new(), what, mend: mend.into() };
    let part = |e: &Expression, index: &str| {
        dimension_of(e, scope).map_err(|mut f| {
            f.path = format!("{index}{}", f.path);
            f
        })
    };
    let own = || {
        scope.own.ok_or_else(|| {
            fault(
                "there is no joint here whose motion could be meant".into(),
                "name a joint, Of(\"x\", Position), or let the family sit on joints",
            )
        })
    };
    let pure = |e: &Expression, index: &str, name: &str| {
        let d = part(e, index)?;
        if d == Dimension::ONE {
            return Ok(d);
        }
        let mut f = fault(
            format!("{name} takes a pure number, not something in {d}"),
            "divide by a parameter or a Value of the same unit",
        );
        f.path = index.into();
        Err(f)
    };
    let expect = |e: &Expression, index: &str, expected: Dimension, name: &str| {
        let d = part(e, index)?;
        if d == expected {
            return Ok(());
        }
        let mut f =
            fault(format!("{name} must be in {expected}, not in {d}"), "give it a parameter of that unit");
        f.path = index.into();
        Err(f)
    };
    match expression {
        Number(_) | Clock | Beyond | Order | Beginning | OrderIn(_) | BeginningIn(_) => Ok(Dimension::ONE),
        Value(_, symbol) | Channel(_, symbol) => match Unit::named(symbol) {
            Some(unit) => Ok(Dimension::of_quantity(unit.quantity)),
            None => Err(fault(format!("\"{symbol}\" is no unit"), "write a unit such as mm, deg, s, degC")),
        },
        Parameter(name) => (scope.parameter)(name).ok_or_else(|| {
            fault(format!("parameter \"{name}\" is not declared"), "add it to the family's `parameters`")
        }),
        Position | Late(_) | SinceReversal | Travelled => Ok(Dimension::of_joint(own()?)),
        Velocity => Ok(Dimension::of_joint(own()?).over(Dimension::TIME)),
        Acceleration => Ok(Dimension::of_joint(own()?).over(Dimension::TIME.power(2))),
        Stroke | Direction => own().map(|_| Dimension::ONE),
        Gravity | Load => Ok(match own()? {
            JointKind::Prismatic => Dimension::FORCE,
            JointKind::Revolute => Dimension::FORCE.times(Dimension::LENGTH),
        }),
        Moment(n) | Shear(n) if *n > 2 => {
            Err(fault(format!("direction {n} is none"), "write 0 or 1 for across the axis, 2 for about it"))
        }
        Lever(_, n) if *n > 1 => {
            Err(fault(format!("direction {n} is none"), "write 0 or 1 for the directions across the axis"))
        }
        Moment(_) => own().map(|_| Dimension::FORCE.times(Dimension::LENGTH)),
        Shear(_) => own().map(|_| Dimension::FORCE),
        Lever(..) => own().map(|_| Dimension::FORCE.times(Dimension::LENGTH)),
        Time | TimeSince(_) => Ok(Dimension::TIME),
        Only(_, e) => shift(dimension_of(e, scope), "[1]"),
        Of(name, e) => {
            let kind = (scope.named)(name).ok_or_else(|| {
                fault(format!("joint \"{name}\" is not one of the machine's"), "name a joint of the machine")
            })?;
            shift(dimension_of(e, &Scope { own: Some(kind), ..*scope }), "[1]")
        }
        Partner(e) => {
            let kind = scope.partner.ok_or_else(|| {
                fault(
                    "this family has no partner".into(),
                    "add partner: Prismatic, Revolute or Joint to the family",
                )
            })?;
            shift(dimension_of(e, &Scope { own: Some(kind), ..*scope }), "[0]")
        }
        Sum(list) => {
            let mut all = list.iter().enumerate().map(|(i, e)| Ok((i, part(e, &format!("[0][{i}]"))?)));
            let Some(first) = all.next() else {
                return Err(fault("a sum of nothing".into(), "put at least one term into the list"));
            };
            let (_, d) = first?;
            for next in all {
                let (i, other) = next?;
                if other != d {
                    let mut f = fault(format!("a term in {other} is added to one in {d}"), UNLIKE);
                    f.path = format!("[0][{i}]");
                    return Err(f);
                }
            }
            Ok(d)
        }
        Difference(a, b) => {
            let (da, db) = (part(a, "[0]")?, part(b, "[1]")?);
            if da == db {
                return Ok(da);
            }
            let mut f = fault(format!("a term in {db} is taken from one in {da}"), UNLIKE);
            f.path = "[1]".into();
            Err(f)
        }
        Product(list) => list
            .iter()
            .enumerate()
            .try_fold(Dimension::ONE, |d, (i, e)| Ok(d.times(part(e, &format!("[0][{i}]"))?))),
        Quotient(a, b) => Ok(part(a, "[0]")?.over(part(b, "[1]")?)),
        Power(e, n) if (-6..=6).contains(n) => Ok(part(e, "[0]")?.power(*n)),
        Power(_, n) => Err(fault(format!("power {n} is not between -6 and 6"), "use a smaller power")),
        Sin(e) | Cos(e) => {
            let d = part(e, "[0]")?;
            if d == Dimension::ANGLE || d == Dimension::ONE {
                return Ok(Dimension::ONE);
            }
            let mut f = fault(
                format!("the sine or cosine of something in {d}"),
                "divide by a parameter or a Value of the same unit",
            );
            f.path = "[0]".into();
            Err(f)
        }
        Turns(e) => pure(e, "[0]", "Turns").map(|_| Dimension::ANGLE),
        Exp(e) => pure(e, "[0]", "Exp"),
        Bump(e) => pure(e, "[0]", "Bump"),
        Saturate(e) => pure(e, "[0]", "Saturate"),
        Chebyshev(order, e) => {
            if *order > 30 {
                return Err(fault(format!("Chebyshev order {order} is above 30"), "use a lower order"));
            }
            pure(e, "[1]", "Chebyshev")
        }
        Abs(e) | Positive(e) => part(e, "[0]"),
        Sign(e) | Step(e) => part(e, "[0]").map(|_| Dimension::ONE),
        Between(e, from, to) => {
            part(e, "[0]")?;
            if to.partial_cmp(from) != Some(std::cmp::Ordering::Greater) {
                return Err(fault(
                    format!("Between runs from {from} to {to}"),
                    "write the smaller number first",
                ));
            }
            Ok(Dimension::ONE)
        }
        Play(width) => {
            let d = Dimension::of_joint(own()?);
            expect(width, "[0]", d, "the width of play").map(|()| d)
        }
        PlayOf(e, width) => {
            let d = part(e, "[0]")?;
            expect(width, "[1]", d, "the width of play").map(|()| d)
        }
        TakeUp(length) => expect(length, "[0]", Dimension::of_joint(own()?), "the length of take-up")
            .map(|()| Dimension::ONE),
        Lag(e, time) => {
            let d = part(e, "[0]")?;
            expect(time, "[1]", Dimension::TIME, "the time constant of Lag").map(|()| d)
        }
    }
}

const UNLIKE: &str = "terms of a sum must have one unit; give one of them a factor";

fn shift(result: Result<Dimension, DimensionFault>, index: &str) -> Result<Dimension, DimensionFault> {
    result.map_err(|mut f| {
        f.path = format!("{index}{}", f.path);
        f
    })
}
