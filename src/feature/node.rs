//! What a bound expression is made of.

/// Joints are indices of dyads.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    Number(f64),
    Parameter(usize),
    Joint(usize, Column),
    /// Where a joint is when it is so many seconds late.
    Late(usize, f64),
    Time(f64),
    /// Names of recordings, and with which number they begin; whether the number of the own recording's beginning is meant.
    Order(Vec<(String, f64)>, bool),
    /// Name and unit.
    Channel(String, String),
    /// What needs further columns, by name and unit.
    Needing(Vec<(String, String)>, Box<Node>),
    /// Names of recordings.
    Only(Vec<String>, Box<Node>),
    Sum(Vec<Node>),
    Product(Vec<Node>),
    Quotient(Box<[Node; 2]>),
    Power(Box<Node>, i8),
    Function(Function, Box<Node>),
    Chebyshev(u8, Box<Node>),
    Between(Box<Node>, f64, f64),
    Play {
        joint: usize,
        width: Box<Node>,
        memory: usize,
    },
    PlayOf {
        of: Box<Node>,
        width: Box<Node>,
        memory: usize,
    },
    TakeUp {
        joint: usize,
        length: Box<Node>,
        memory: usize,
    },
    Lag {
        of: Box<Node>,
        time: Box<Node>,
        memory: usize,
    },
}

/// A column of [`super::JointSamples`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
    Position,
    Direction,
    Velocity,
    Acceleration,
    SinceReversal,
    Travelled,
    Gravity,
    Load,
    /// A column of `JointSamples::weights`.
    Weight(usize),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Sin,
    Cos,
    Exp,
    Abs,
    Sign,
    Positive,
    Step,
    Saturate,
    Bump,
}
