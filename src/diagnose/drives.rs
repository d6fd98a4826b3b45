//! No drive is rigid: what every joint in motion does a little, beside whatever is found, `docs/diagnosis-method.md` (67).

use nalgebra::DMatrix;

use super::coarse::Coarse;
use super::linear::Linear;
use super::score::{Rows, joined};
use super::whitener::Whitener;
use crate::effects::{Candidate, Library};

/// Drives give way by about this part of what a family that is said by name usually does, before readings are asked.
const GIVE_WAY: f64 = 0.02;

/// Columns of the families with `of_every_drive` at all joints of what follows a path, m and rad, each times what is expected of it.
pub(super) fn drives(
    linear: &Linear,
    coarse: &Coarse,
    candidates: &[Candidate],
    library: &Library,
) -> DMatrix<f64> {
    let count = linear.residual.len();
    let none = DMatrix::zeros(count, 0);
    let rows = Rows::new(linear, &none, coarse, Whitener::new(count, &[], &[], vec![false; count]));
    let stand = |c: &&Candidate| library.families()[c.family].of_every_drive && c.parameters.is_empty();
    let own = candidates.iter().filter(stand).filter_map(|candidate| rows.raw(candidate, &[]));
    own.fold(none.clone(), |all, own| joined(all, &(own * GIVE_WAY)))
}
