//! What the data see: rank, combinations, and how much of each value comes from the data, `docs/model.md` (23), (24), (28).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::unknowns::{Layout, Role};
use crate::location::{Functional, Knowledge};

/// Eigenvalues of the scaled information below this part of the largest are rounding: not seen.
pub(crate) const SEEN: f64 = 1e-12;
/// An unknown without prior whose information is below this, in units of its tolerance, is open: its standard error exceeds thirty
/// tolerances.
pub(crate) const OPEN: f64 = 1e-3;
/// Below this part of the largest, information about a set-up is exactly none.
const EXACT: f64 = 1e-9;
/// Part of a function's variance along unseen directions that is taken for rounding.
const ROUNDING: f64 = 1e-6;

/// The information of the data in coordinates scaled by the tolerances, and what follows from it together with the prior.
#[derive(Clone, Debug, Default)]
pub struct Information {
    /// How many independent combinations of all unknowns the data see at all.
    pub rank: usize,
    /// Combinations of the unknowns that have a prior, in units of their tolerances, one a column, best seen first. What a set-up
    /// brings along (frame, tool point, zero) is eliminated.
    pub directions: DMatrix<f64>,
    /// Information of each combination in units of the prior's: `(standard deviation of the prior / that of the data)²`.
    pub strength: DVector<f64>,
    /// Positions of those unknowns in the parameter vector.
    pub positions: Vec<usize>,
    /// Posterior variance of every unknown in units of its tolerance squared; infinite where nothing determines it.
    pub variance: DVector<f64>,
    /// Unknowns without prior that the data leave open: unit vectors over the parameter vector, in scaled units.
    pub open: Vec<DVector<f64>>,
    /// Sum of the data's shares: how many parameters the fit has used up.
    pub used: f64,
    /// Whether the tolerances acted as a prior.
    pub prior: bool,
    /// Where the deviation of a dyad starts in the parameter vector, machine order; `None` for `w`, which belongs to the set-ups.
    pub dyads: Vec<Option<usize>>,
}

impl Information {
    /// Share of combination `i` that comes from the data, `1 - posterior variance / prior variance`.
    pub fn share(&self, i: usize) -> f64 {
        self.strength[i] / (1.0 + self.strength[i])
    }

    /// What is known of a function of the unknowns that have a prior. `gradient_scaled`: its derivatives over the whole parameter
    /// vector at the estimate, each times its unknown's tolerance; what belongs to a set-up without prior is not looked at.
    ///
    /// # Panics
    /// If the gradient is shorter than the parameter vector.
    pub fn of_functional(&self, gradient_scaled: &[f64]) -> Functional {
        let inner = DVector::from_iterator(
            self.positions.len(),
            self.positions.iter().map(|at| gradient_scaled[*at]),
        );
        let prior_variance = inner.norm_squared();
        let (mut posterior_variance, mut unseen) = (0.0, 0.0);
        for (direction, strength) in self.directions.column_iter().zip(self.strength.iter()) {
            let square = direction.dot(&inner).powi(2);
            if *strength == 0.0 {
                unseen += square;
            }
            if self.prior {
                posterior_variance += square / (1.0 + strength);
            } else if *strength > 0.0 {
                posterior_variance += square / strength;
            }
        }
        let unseen = if prior_variance > 0.0 { unseen / prior_variance } else { 0.0 };
        if !self.prior && unseen > ROUNDING {
            posterior_variance = f64::INFINITY;
        }
        Functional { prior_variance, posterior_variance, unseen }
    }

    /// From the data's matrix in m and rad; `prior` says whether the blocks' priors count, `open` what the data leave open.
    pub(crate) fn new(matrix: &DMatrix<f64>, layout: &Layout, prior: bool, open: Vec<DVector<f64>>) -> Self {
        let scales = layout.scales();
        let scaled = DMatrix::from_fn(layout.len, layout.len, |a, b| matrix[(a, b)] * scales[a] * scales[b]);
        let has_prior = layout.mask(|b| b.prior);
        let eigenvalues = scaled.symmetric_eigenvalues();
        let largest = eigenvalues.amax();
        let rank = eigenvalues.iter().filter(|v| **v > SEEN * largest).count();

        let positions: Vec<usize> = (0..layout.len).filter(|i| has_prior[*i]).collect();
        let rest: Vec<usize> = (0..layout.len).filter(|i| !has_prior[*i]).collect();
        let pick = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |a, b| scaled[(rows[a], columns[b])])
        };
        let inner = pick(&positions, &positions);
        let cross = pick(&rest, &positions);
        let outer = pick(&rest, &rest);
        // (24): what a set-up brings along is eliminated.
        let reduced = &inner - cross.transpose() * pseudo_inverse(&outer, largest) * &cross;
        let eigen = SymmetricEigen::new(reduced);
        let mut order: Vec<usize> = (0..positions.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let floor = SEEN * largest;
        let strength = DVector::from_iterator(
            order.len(),
            order.iter().map(|i| if eigen.eigenvalues[*i] > floor { eigen.eigenvalues[*i] } else { 0.0 }),
        );
        let directions = DMatrix::from_fn(order.len(), order.len(), |a, i| eigen.eigenvectors[(a, order[i])]);

        // (28): posterior covariance, infinite along what neither data nor prior hold.
        let mut full = scaled;
        if prior {
            positions.iter().for_each(|i| full[(*i, *i)] += 1.0);
        }
        let eigen = SymmetricEigen::new(full);
        let mut variance = DVector::zeros(layout.len);
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let is_open = open.iter().map(|o| o.dot(&vector).powi(2)).sum::<f64>() > 0.5;
            let unheld = is_open || !prior && *value <= floor;
            for (a, x) in vector.iter().enumerate() {
                if !unheld {
                    // The prior's own information is a floor that rounding must not undercut.
                    variance[a] += x * x / if prior { value.max(1.0) } else { *value };
                } else if x.abs() > 1e-4 {
                    variance[a] = f64::INFINITY;
                }
            }
        }
        let used =
            strength.iter().map(|s| if prior { s / (1.0 + s) } else { f64::from(*s > 0.0) }).sum::<f64>()
                + (rest.len() as f64);
        let used = used - open.len() as f64;
        let dyads =
            (0..layout.dyad_count()).map(|j| layout.block(Role::Dyad(j)).map(|block| block.offset)).collect();
        Information { rank, directions, strength, positions, variance, open, used, prior, dyads }
    }
}

impl Knowledge for Information {
    fn of_deviations(&self, by_dyad_scaled: &[f64]) -> Functional {
        let mut gradient = vec![0.0; self.variance.len()];
        for (own, at) in by_dyad_scaled.chunks_exact(6).zip(&self.dyads) {
            if let Some(at) = at {
                gradient[*at..*at + 6].copy_from_slice(own);
            }
        }
        self.of_functional(&gradient)
    }
}

/// Moore-Penrose inverse of a symmetric matrix; `largest` sets the size below which an eigenvalue is rounding.
fn pseudo_inverse(matrix: &DMatrix<f64>, largest: f64) -> DMatrix<f64> {
    if matrix.is_empty() {
        return matrix.clone();
    }
    let eigen = SymmetricEigen::new(matrix.clone());
    let inverse = eigen.eigenvalues.map(|v| if v > SEEN * largest { 1.0 / v } else { 0.0 });
    &eigen.eigenvectors * DMatrix::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// Directions among the unknowns without prior that the data would not show even on a machine without any deviation: unit vectors
/// over the scaled parameter vector. `geometry` is the data's matrix with measured points in place of modelled ones.
pub(crate) fn open_directions(geometry: &DMatrix<f64>, layout: &Layout, least: f64) -> Vec<DVector<f64>> {
    let scales = layout.scales();
    // Coefficients of terms are the machine's, not the set-up's.
    let of_setup = layout.mask(|b| !b.prior && !matches!(b.role, Role::Term(_)));
    let rest: Vec<usize> = (0..layout.len).filter(|i| of_setup[*i]).collect();
    if rest.is_empty() {
        return Vec::new();
    }
    let eigen = SymmetricEigen::new(DMatrix::from_fn(rest.len(), rest.len(), |a, b| {
        geometry[(rest[a], rest[b])] * scales[rest[a]] * scales[rest[b]]
    }));
    let limit = least.max(EXACT * eigen.eigenvalues.amax());
    let directions = eigen.eigenvectors.column_iter().zip(eigen.eigenvalues.iter());
    directions
        .filter(|(_, value)| **value <= limit)
        .map(|(direction, _)| {
            let mut vector = DVector::zeros(layout.len);
            rest.iter().zip(direction.iter()).for_each(|(at, x)| vector[*at] = *x);
            vector
        })
        .collect()
}
