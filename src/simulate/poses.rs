//! Random poses within travel.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

use super::course::{At, Course, Sample, Samples};
use crate::check::random_command;
use crate::error::Result;
use crate::machine::Machine;

/// Settled positions: every command anywhere within its travel, approached from a random side.
#[derive(Clone, Debug)]
pub struct RandomPoses {
    /// The machine.
    pub machine: Machine,
    /// How many.
    pub count: u64,
    /// Seed of positions and sides.
    pub seed: u64,
    /// Poses a second.
    pub rate: f64,
}

impl Course for RandomPoses {
    fn samples(&self) -> Result<Samples<'_>> {
        let mut rng = StdRng::seed_from_u64(self.seed);
        let commands = self.machine.commands().len();
        Ok(Box::new((0..self.count).map(move |k| {
            let q = (0..commands).map(|c| random_command(&self.machine, c, &mut rng)).collect();
            let directions =
                (0..commands).map(|_| if rng.random_range(0..2) == 0 { -1 } else { 1 }).collect();
            let at = At::Pose(usize::try_from(k + 1).unwrap_or(usize::MAX));
            Ok(Sample { time: k as f64 / self.rate, q, directions: Some(directions), recorded: true, at })
        })))
    }
}
