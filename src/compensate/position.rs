//! A position of a machine: its joints, and what a program calls it.

use crate::few::Few;

/// A position, as joints and as program coordinates in the frame in force; m or rad.
#[derive(Debug)]
pub(super) struct Position {
    q: Few<f64>,
    program: Few<f64>,
}

impl Clone for Position {
    /// As wholes, and not one number after the other.
    fn clone(&self) -> Self {
        Position { q: Few::from_slice(&self.q), program: Few::from_slice(&self.program) }
    }
}

impl Position {
    /// `q`: by command; `program`: by axis.
    pub fn new(q: Few<f64>, program: Few<f64>) -> Self {
        Position { q, program }
    }

    /// By command, machine order.
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    /// By axis, in the order of [`Control::axes`](super::control::Control::axes).
    pub fn program(&self) -> &[f64] {
        &self.program
    }

    /// Whether both are the same to the last bit.
    pub fn is_as(&self, other: &Position) -> bool {
        let same = |a: &[f64], b: &[f64]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
        };
        same(&self.q, &other.q) && same(&self.program, &other.program)
    }

    /// Another place of one joint; what the program calls it stays to be told.
    pub fn set_joint(&mut self, command: usize, q: f64) {
        self.q[command] = q;
    }

    /// The same place under other coordinates.
    pub fn rename(&mut self, program: Few<f64>) {
        self.program = program;
    }
}
