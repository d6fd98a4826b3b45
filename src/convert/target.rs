//! What a column of a map becomes.

use crate::machine::{JointKind, Machine};
use crate::units::Quantity;

/// What the name of a column in a map stands for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Target {
    Time,
    /// Direction of approach: signs and words become -1, 0, 1.
    Direction,
    /// One of three angles, from 0.
    Euler(usize),
    /// Row and column of a homogeneous matrix, from 0.
    Matrix(usize, usize),
    /// `qw qx qy qz`, from 0.
    Quaternion(usize),
    /// A column as it is.
    Plain,
}

impl Target {
    pub fn of(name: &str, machine: Option<&Machine>) -> Target {
        // A joint's name comes first, as it does where recordings are read.
        if machine.is_some_and(|machine| kind_of(machine, name).is_some()) {
            return Target::Plain;
        }
        let digit = |text: &str| match text.as_bytes() {
            [d @ b'1'..=b'4'] => Some(usize::from(d - b'1')),
            _ => None,
        };
        match name {
            "t" => Target::Time,
            "qw" => Target::Quaternion(0),
            "qx" => Target::Quaternion(1),
            "qy" => Target::Quaternion(2),
            "qz" => Target::Quaternion(3),
            _ if name.ends_with("_direction") => Target::Direction,
            _ => {
                let euler = name.strip_prefix("euler").and_then(digit).filter(|k| *k < 3);
                let matrix = name.strip_prefix("matrix").filter(|n| n.len() == 2 && n.is_ascii());
                let matrix = matrix.and_then(|n| Some((digit(&n[..1])?, digit(&n[1..])?)));
                match (euler, matrix) {
                    (Some(k), _) => Target::Euler(k),
                    (_, Some((i, j))) => Target::Matrix(i, j),
                    _ => Target::Plain,
                }
            }
        }
    }
}

fn kind_of(machine: &Machine, joint: &str) -> Option<JointKind> {
    let own = machine.joints().find(|(_, known)| known.name == joint).map(|(_, known)| known.kind);
    own.or_else(|| machine.side_joint(joint).map(|known| known.kind))
}

/// What a column of this name must measure; nothing for an extra channel.
pub(super) fn quantity(name: &str, machine: Option<&Machine>) -> Option<Quantity> {
    let of_joint = |joint: &str| Some(kind_of(machine?, joint)?.quantity());
    of_joint(name).or_else(|| match Target::of(name, machine) {
        Target::Time => Some(Quantity::Time),
        Target::Direction | Target::Quaternion(_) => Some(Quantity::One),
        Target::Euler(_) => Some(Quantity::Angle),
        Target::Matrix(i, 3) if i < 3 => Some(Quantity::Length),
        Target::Matrix(..) => Some(Quantity::One),
        Target::Plain => match name {
            "px" | "py" | "pz" | "d" | "r" | "s" => Some(Quantity::Length),
            "rx" | "ry" | "rz" => Some(Quantity::Angle),
            _ => name.strip_suffix("_meas").and_then(of_joint),
        },
    })
}
