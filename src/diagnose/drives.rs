//! No drive is rigid: what every joint in motion does a little, beside whatever is found, `docs/diagnosis-method.md` (67).

use nalgebra::DMatrix;

use super::terms::joined;
use crate::effects::{Candidate, Place};

/// Drives give way by about this part of what a family that is said by name usually does, before readings are asked.
const GIVE_WAY: f64 = 0.02;

/// How drives give way.
pub(super) struct Drives {
    /// A column for each, m and rad, times what is expected of it.
    columns: DMatrix<f64>,
    /// Effect and place of each.
    of: Vec<(String, Place)>,
}

impl Drives {
    /// Rigid ones, of so many readings.
    pub fn none(readings: usize) -> Self {
        Drives { columns: DMatrix::zeros(readings, 0), of: Vec::new() }
    }

    /// With one more, as its columns are at the size that is usual for it.
    pub fn and(mut self, candidate: &Candidate, columns: &DMatrix<f64>) -> Self {
        self.of.extend(vec![(candidate.effect.clone(), candidate.place); columns.ncols()]);
        self.columns = joined(self.columns, &(columns * GIVE_WAY));
        self
    }

    /// Whether a name stands for one.
    pub fn is_any(&self, is_named: impl Fn(&str, Place) -> bool) -> bool {
        self.of.iter().any(|(effect, place)| is_named(effect, *place))
    }

    /// Columns of those that no name stands for.
    pub fn beside(&self, is_named: impl Fn(&str, Place) -> bool) -> DMatrix<f64> {
        let unnamed = self.of.iter().enumerate().filter(|(_, (effect, place))| !is_named(effect, *place));
        self.columns.select_columns(&unnamed.map(|(column, _)| column).collect::<Vec<_>>())
    }
}
