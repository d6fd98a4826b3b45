//! No drive is rigid: what every joint in motion does a little, beside whatever is found, `docs/diagnosis-method.md` (72a).

use nalgebra::DMatrix;

use super::coarse::Coarse;
use super::linear::Linear;
use super::score::Rows;
use super::whitener::Whitener;
use crate::effects::{Candidate, Library};

/// Drives give way by about this part of what a family that is said by name usually does, before readings are asked.
const GIVE_WAY: f64 = 0.02;

/// Families with `of_every_drive`, at all joints: geometry in motion is never alone.
#[derive(Default)]
pub(super) struct Drives {
    /// Columns as they are, m and rad, each times what is expected of it.
    raw: DMatrix<f64>,
}

impl Drives {
    /// Of what follows a path.
    pub fn of(linear: &Linear, coarse: &Coarse, candidates: &[Candidate], library: &Library) -> Self {
        let count = linear.residual.len();
        let (none, white) = (Drives::default(), Whitener::new(count, &[], &[], vec![false; count]));
        let rows = Rows::new(linear, &none, coarse, white);
        let stand = |c: &&Candidate| library.families()[c.family].of_every_drive && c.parameters.is_empty();
        let own = candidates.iter().filter(stand).filter_map(|candidate| rows.raw(candidate, &[]));
        let raw = own.fold(DMatrix::zeros(count, 0), |all, own| joined(all, &(own * GIVE_WAY)));
        Drives { raw }
    }

    /// These columns behind others of the same rows.
    pub fn behind(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        if self.raw.ncols() == 0 { columns.clone() } else { joined(columns.clone(), &self.raw) }
    }
}

fn joined(first: DMatrix<f64>, second: &DMatrix<f64>) -> DMatrix<f64> {
    let at = first.ncols();
    let mut all = first.insert_columns(at, second.ncols(), 0.0);
    all.columns_mut(at, second.ncols()).copy_from(second);
    all
}
