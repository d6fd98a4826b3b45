//! No drive is rigid: what every joint in motion does a little, beside whatever is found, `docs/diagnosis-method.md` (67).

use nalgebra::DMatrix;

use super::coarse::Coarse;
use super::linear::Linear;
use super::score::{Rows, joined};
use super::whitener::Whitener;
use crate::effects::{Candidate, Library, Place};

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

    /// The families with `of_every_drive` at all joints of what follows a path.
    pub fn new(linear: &Linear, coarse: &Coarse, candidates: &[Candidate], library: &Library) -> Self {
        let count = linear.residual.len();
        let none = Drives::none(count);
        let rows = Rows::new(linear, &none, coarse, Whitener::new(count, &[], &[], vec![false; count]));
        let mut all = Drives::none(count);
        for candidate in candidates {
            if library.families()[candidate.family].of_every_drive
                && candidate.parameters.is_empty()
                && let Some(own) = rows.raw(candidate, &[])
            {
                all.of.extend(vec![(candidate.effect.clone(), candidate.place); own.ncols()]);
                all.columns = joined(all.columns, &(own * GIVE_WAY));
            }
        }
        all
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
