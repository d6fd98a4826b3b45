//! What is known of where the axes are by the words of a program.

use super::modes::{Coordinate, Distance, Modes, Why};
use super::words::{How, Word};
use crate::few::Few;

/// The axes that are followed, and their programmed positions.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axes {
    addresses: Vec<String>,
    coordinates: Vec<Coordinate>,
}

impl Axes {
    /// Nothing programmed yet. `addresses`: in upper case.
    pub fn new(addresses: Vec<String>) -> Self {
        let coordinates = vec![Coordinate::Unprogrammed; addresses.len()];
        Axes { addresses, coordinates }
    }

    pub fn addresses(&self) -> &[String] {
        &self.addresses
    }

    /// The programmed position of each, in the frame in force.
    pub fn coordinates(&self) -> &[Coordinate] {
        &self.coordinates
    }

    /// Positions as they were.
    pub fn restore(&mut self, coordinates: Vec<Coordinate>) {
        self.coordinates = coordinates;
    }

    /// The programmed positions where they are known.
    pub fn target(&self) -> Few<Option<f64>> {
        self.coordinates.iter().map(|c| c.value()).collect()
    }

    /// The place of the axis gets this number, if it is one; it does not move.
    pub fn preset(&mut self, axis: usize, value: Option<f64>, line: usize) {
        self.coordinates[axis] =
            value.map_or_else(|| self.lost(axis, line, Why::Expression), Coordinate::Known);
    }

    /// Where a word takes its axis.
    pub fn go(&mut self, axis: usize, word: &Word, modes: &Modes, line: usize) {
        let incremental = match word.how {
            How::Modal => modes.distance == Some(Distance::Incremental),
            how => how == How::Incremental,
        };
        self.coordinates[axis] = match (word.number(), incremental, self.coordinates[axis]) {
            (Some(value), false, _) => Coordinate::Known(value),
            (Some(by), true, Coordinate::Known(from)) => Coordinate::Known(from + by),
            // An increment upon something lost: it stays lost since then.
            (Some(_), true, lost @ Coordinate::Lost { .. }) => lost,
            _ => self.lost(axis, line, Why::Expression),
        };
    }

    /// Where these axes are is not known from here on.
    pub fn lose(&mut self, line: usize, why: Why, which: impl Fn(&str) -> bool) {
        for axis in 0..self.coordinates.len() {
            if which(&self.addresses[axis]) {
                self.lose_one(axis, line, why);
            }
        }
    }

    /// Where this axis is is not known from here on. What was never programmed, or is lost already, stays as it is.
    pub fn lose_one(&mut self, axis: usize, line: usize, why: Why) {
        if let Coordinate::Known(_) = self.coordinates[axis] {
            self.coordinates[axis] = self.lost(axis, line, why);
        }
    }

    fn lost(&self, axis: usize, line: usize, why: Why) -> Coordinate {
        let last = match self.coordinates[axis] {
            Coordinate::Unprogrammed => None,
            Coordinate::Known(value) => Some(value),
            Coordinate::Lost { last, .. } => last,
        };
        Coordinate::Lost { line, why, last }
    }
}

/// Whether the address is that of a linear axis.
pub(super) fn is_linear(address: &str) -> bool {
    !address.starts_with(['A', 'B', 'C'])
}
