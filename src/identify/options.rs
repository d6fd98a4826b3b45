//! What is asked of an identification: how it walks, and which model it fits.

use super::{Loss, Solver};
use crate::error::{Error, Result};
use crate::machine::Machine;
use crate::variation::{Directions, MOST_AXES, Varying};
use crate::wording;

/// How to identify.
#[non_exhaustive]
#[derive(Clone, Copy, Debug)]
pub struct CalibrateOptions {
    /// The walk to the optimum.
    pub solver: Solver,
    /// How residuals count.
    pub loss: Loss,
    /// Whether the tolerances of the machine file act as a prior on the total deviation.
    pub prior: bool,
}

impl Default for CalibrateOptions {
    fn default() -> Self {
        CalibrateOptions { solver: Solver::default(), loss: Loss::default(), prior: true }
    }
}

impl CalibrateOptions {
    /// The same with another walk to the optimum.
    #[must_use]
    pub fn with_solver(mut self, solver: Solver) -> Self {
        self.solver = solver;
        self
    }

    /// The same with another loss.
    #[must_use]
    pub fn with_loss(mut self, loss: Loss) -> Self {
        self.loss = loss;
        self
    }

    /// The same with or without the tolerances as a prior.
    #[must_use]
    pub fn with_prior(mut self, prior: bool) -> Self {
        self.prior = prior;
        self
    }
}

/// What to identify besides constant deviations, and from which samples.
#[non_exhaustive]
#[derive(Clone, Debug, Default)]
pub struct ErrorModel {
    /// What deviations depend on.
    pub varying: Varying,
    /// Dead bands of the directions of travel by command, m or rad; where there is none, 1e-5 of the command's range.
    pub dead_bands: Vec<Option<f64>>,
    /// As many samples of each piece are used, evenly spread; the others judge the result.
    pub samples: Option<u64>,
    /// Room for smooth error motions of every joint, over the tolerance of its dyad, `docs/model.md` (32); 0 for none. The data weigh
    /// factors on it, (33). The motions do not bend the deviations, and are kept beside them.
    pub error_motions: f64,
    /// Sides of approach that the recordings do not show.
    pub approaches: Vec<Approach>,
}

impl ErrorModel {
    /// A model for each pattern of directions of travel of these axes, `docs/model.md` (29).
    ///
    /// # Errors
    /// [`Error::Undetermined`] where a name is no joint of its own command or comes twice, and where there is none or are too many.
    pub fn by_direction(machine: &Machine, axes: &[&str]) -> Result<Self> {
        let refused = |what: String, mend: String| Err(Error::Undetermined { what, mend });
        let mut commands = Vec::new();
        for axis in axes {
            match machine.commands().iter().position(|command| command == axis) {
                None => {
                    let what = format!("{} has no axis \"{axis}\" to key a model on", machine.name());
                    return refused(what, format!("name one of: {}", machine.commands().join(", ")));
                }
                Some(command) if commands.contains(&command) => {
                    return refused(format!("axis \"{axis}\" is named twice"), "name every axis once".into());
                }
                Some(command) => commands.push(command),
            }
        }
        if !(1..=MOST_AXES).contains(&commands.len()) {
            let what = format!(
                "a model cannot be keyed on {}",
                wording::count(commands.len() as u64, "axis", "axes")
            );
            return refused(what, format!("name 1 to {MOST_AXES} axes"));
        }
        let directions = Some(Directions::new(commands));
        Ok(ErrorModel { varying: Varying { directions, terms: Vec::new() }, ..ErrorModel::default() })
    }

    /// The same with what deviations depend on besides being constant.
    #[must_use]
    pub fn with_varying(mut self, varying: Varying) -> Self {
        self.varying = varying;
        self
    }

    /// The same with dead bands of the directions of travel by command, m or rad; `None`: 1e-5 of the command's range.
    #[must_use]
    pub fn with_dead_bands(mut self, dead_bands: Vec<Option<f64>>) -> Self {
        self.dead_bands = dead_bands;
        self
    }

    /// The same with so many samples of each piece, evenly spread; the others judge the result.
    #[must_use]
    pub fn with_samples(mut self, samples: u64) -> Self {
        self.samples = Some(samples);
        self
    }

    /// The same with room for smooth error motions of every joint, over the tolerance of its dyad.
    #[must_use]
    pub fn with_error_motions(mut self, error_motions: f64) -> Self {
        self.error_motions = error_motions;
        self
    }

    /// The same with sides of approach that the recordings do not show.
    #[must_use]
    pub fn with_approaches(mut self, approaches: Vec<Approach>) -> Self {
        self.approaches = approaches;
        self
    }
}

/// From which side a joint came before it first moves in a recording, or that never does; where nobody says so, in the direction of its first motion.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Approach {
    /// Index of the recording.
    pub recording: usize,
    /// Index of the joint's dyad.
    pub dyad: usize,
    /// 1 rising, -1 falling.
    pub direction: i8,
}

impl Approach {
    /// The side from which the joint of this dyad came in this recording, both by index: 1 rising, -1 falling.
    pub fn new(recording: usize, dyad: usize, direction: i8) -> Self {
        Approach { recording, dyad, direction }
    }
}
