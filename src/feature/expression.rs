//! The language in which features are written, as RON and as a value; `docs/effects.md` teaches it.

use serde::{Deserialize, Serialize};

/// What a deviation depends on, in words. An own joint is that of the place where the effect sits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Expression {
    /// A pure number.
    Number(f64),
    /// A number with a unit of the borders, `Value(20, "degC")`.
    Value(f64, String),
    /// A parameter of the family, in SI.
    Parameter(String),

    /// Displacement of the own joint, m or rad.
    Position,
    /// Where the own joint stands within the travel seen, from -1 to 1; beyond it, at its ends.
    Stroke,
    /// Direction of travel or approach of the own joint, -1 or 1 (0 if it never moves).
    Direction,
    /// Velocity of the own joint.
    Velocity,
    /// Acceleration of the own joint.
    Acceleration,
    /// Distance of the own joint from its last reversal, 1e6 before the first one.
    SinceReversal,
    /// Path that the own joint has travelled since the first sample of the recording.
    Travelled,
    /// Torque (revolute) or force (prismatic) by gravity on the own joint of the masses beyond it; of 1 kg at every frame beyond where
    /// the machine file states no mass.
    Gravity,
    /// The same of 1 kg at the end of the branch.
    Load,
    /// Moment by gravity of what `Gravity` counts, about the origin of the own joint's frame as it stands before the joint: about the
    /// first (0) or second (1) direction across the joint's axis, or about the axis (2).
    Moment(u8),
    /// How `Moment` of that number changes with each metre by which its point is moved along the joint's axis.
    Shear(u8),
    /// Torque on the own joint by a first moment of mass of 1 kg m, fixed to what a joint beyond moves: of the first number, counted
    /// from the own joint 0, along the first (0) or second (1) direction across its axis. Of a linear joint beyond, that of 1 kg which it
    /// moves away (0). Masses that nobody knows add to a torque by such numbers alone.
    Lever(u8, u8),
    /// Time since the first sample of all, s.
    Time,
    /// Where the time stands within the time seen, from -1 to 1.
    Clock,
    /// By how much the time is beyond the time seen, in halves of it; 0 until then.
    Beyond,
    /// Number of samples before this one, in all recordings in their order.
    Order,
    /// The same of the first sample of its recording.
    Beginning,
    /// An extra column of the recording by name and unit, `Channel("temperature", "degC")`; in SI, whatever that unit.
    Channel(String, String),

    /// An expression seen from another joint of the machine.
    Of(String, Box<Expression>),
    /// An expression seen from the other joint of a family that takes pairs.
    Partner(Box<Expression>),

    /// Sum.
    Sum(Vec<Expression>),
    /// First less second.
    Difference(Box<Expression>, Box<Expression>),
    /// Product.
    Product(Vec<Expression>),
    /// First over second.
    Quotient(Box<Expression>, Box<Expression>),
    /// To a whole power.
    Power(Box<Expression>, i8),
    /// Sine of an angle or a pure number.
    Sin(Box<Expression>),
    /// Cosine of an angle or a pure number.
    Cos(Box<Expression>),
    /// A pure number of turns as an angle.
    Turns(Box<Expression>),
    /// e to the power of a pure number.
    Exp(Box<Expression>),
    /// Absolute value.
    Abs(Box<Expression>),
    /// -1, 0 or 1.
    Sign(Box<Expression>),
    /// The value where it is positive, else 0.
    Positive(Box<Expression>),
    /// 1 where the value is 0 or more, else 0.
    Step(Box<Expression>),
    /// `u/√(1+u²)` of a pure number: -1 to 1, a sign that turns gradually.
    Saturate(Box<Expression>),
    /// `exp(-u²/2)` of a pure number.
    Bump(Box<Expression>),
    /// Chebyshev polynomial of this order of a pure number, meant for -1 to 1.
    Chebyshev(u8, Box<Expression>),
    /// From -1 to 1 while the expression runs from one number to another, in SI; beyond them it stays at -1 and 1.
    Between(Box<Expression>, f64, f64),

    /// Deviation of what hangs behind the own joint with play of this width (total).
    Play(Box<Expression>),
    /// The same of what is driven by the first expression, such as a cable that runs over two joints, with the second as width; it begins in
    /// the middle of its play.
    PlayOf(Box<Expression>, Box<Expression>),
    /// Runs from its present value to the direction of travel, -1 or 1, as `1 - exp(-d/length)` of the path `d`.
    TakeUp(Box<Expression>),
    /// First, low-passed with the second as time constant.
    Lag(Box<Expression>, Box<Expression>),
    /// Time since this moment on the recordings' clock, s. What `Time` becomes in a calibrated file.
    TimeSince(f64),
    /// Where the own joint is when it follows its command so many seconds late, `x - τ v`; where its velocity is not known, it stands
    /// where it was sent. What positions become in a calibrated file with a large lag.
    Late(f64),
    /// Number of samples before this one where recordings of these names begin with these numbers; far beyond all of them in another
    /// recording. What `Order` becomes in a calibrated file.
    OrderIn(Vec<(String, f64)>),
    /// The same of the first sample of its recording: what `Beginning` becomes.
    BeginningIn(Vec<(String, f64)>),
    /// The value in recordings of these names, 0 in others. What features of a family with `each_setup` become.
    Only(Vec<String>, Box<Expression>),
}

impl Expression {
    /// The expressions that it is made of, in the order in which they are written, each with its index among the values in brackets.
    pub fn parts(&self) -> Vec<(&Expression, String)> {
        use Expression::*;
        match self {
            Sum(list) | Product(list) => {
                list.iter().enumerate().map(|(i, e)| (e, format!("[0][{i}]"))).collect()
            }
            Difference(a, b) | Quotient(a, b) | PlayOf(a, b) | Lag(a, b) => {
                vec![(&**a, "[0]".into()), (&**b, "[1]".into())]
            }
            Of(_, e) | Chebyshev(_, e) | Only(_, e) => vec![(&**e, "[1]".into())],
            Partner(e)
            | Power(e, _)
            | Sin(e)
            | Turns(e)
            | Cos(e)
            | Exp(e)
            | Abs(e)
            | Sign(e)
            | Positive(e)
            | Step(e)
            | Saturate(e)
            | Bump(e)
            | Between(e, ..)
            | Play(e)
            | TakeUp(e) => vec![(&**e, "[0]".into())],
            Number(_) | Value(..) | Parameter(_) | Position | Stroke | Direction | Velocity
            | Acceleration | SinceReversal | Travelled | Gravity | Load | Moment(_) | Shear(_)
            | Lever(..) | Time | Clock | Beyond | Order | Beginning | Channel(..) | TimeSince(_)
            | Late(_) | OrderIn(_) | BeginningIn(_) => Vec::new(),
        }
    }

    /// Highest order of a polynomial in where the own joint stands within its travel; 0 where there is none.
    pub(crate) fn degree(&self) -> u8 {
        match self {
            Expression::Stroke => 1,
            Expression::Chebyshev(order, e) => order.saturating_mul(e.degree()),
            _ => self.parts().iter().map(|(part, _)| part.degree()).max().unwrap_or(0),
        }
    }

    /// Whether this or any part fulfils a condition.
    pub fn any(&self, condition: &dyn Fn(&Expression) -> bool) -> bool {
        condition(self) || self.parts().iter().any(|(part, _)| part.any(condition))
    }
}
