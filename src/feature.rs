//! Features: what a deviation may depend on, as a number for each sample, `docs/model.md` (29).

use crate::motion::Motion;
use crate::recording::Chunk;

/// Consecutive samples with their history, as a feature sees them.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// The samples.
    pub chunk: &'a Chunk,
    /// Their history.
    pub motion: &'a Motion,
    /// How many commands a row of either has.
    pub commands: usize,
}

impl<'a> Samples<'a> {
    /// Directions of travel of all commands at sample `k`.
    #[inline]
    pub fn directions(&self, k: usize) -> &'a [i8] {
        &self.motion.directions[k * self.commands..(k + 1) * self.commands]
    }
}

/// A number for each sample, made of what was commanded and of the path so far.
#[derive(Clone, Debug, PartialEq)]
pub enum Feature {
    /// 1 everywhere.
    One,
    /// Half the direction of travel of a command: ±½, so that the coefficient is the whole difference between directions.
    HalfDirection(usize),
    /// Position of a command, m or rad.
    Position(usize),
    /// Product.
    Product(Vec<Feature>),
}

impl Feature {
    /// Its value at sample `k`.
    pub fn at(&self, samples: &Samples, k: usize) -> f64 {
        match self {
            Feature::One => 1.0,
            Feature::HalfDirection(c) => 0.5 * f64::from(samples.motion.directions[k * samples.commands + c]),
            Feature::Position(c) => samples.chunk.commands[k * samples.commands + c],
            Feature::Product(factors) => factors.iter().map(|f| f.at(samples, k)).product(),
        }
    }
}
