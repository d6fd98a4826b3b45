//! What the data see: rank, combinations, and how much of each value comes from the data, `docs/model.md` (23), (24), (28).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::unknowns::Layout;

/// Eigenvalues of the scaled information below this part of the largest are rounding: not seen.
pub(crate) const SEEN: f64 = 1e-12;

/// The information of the data in coordinates scaled by the tolerances, and what follows from it together with the prior.
#[derive(Clone, Debug)]
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
}

impl Information {
    /// Share of combination `i` that comes from the data, `1 - posterior variance / prior variance`.
    pub fn share(&self, i: usize) -> f64 {
        self.strength[i] / (1.0 + self.strength[i])
    }

    /// From the data's matrix in m and rad; `prior` says whether the blocks' priors count.
    pub(crate) fn new(matrix: &DMatrix<f64>, layout: &Layout, prior: bool) -> Self {
        let scales = layout.scales();
        let scaled = DMatrix::from_fn(layout.len, layout.len, |a, b| matrix[(a, b)] * scales[a] * scales[b]);
        let has_prior = layout.mask(|b| b.prior);
        let eigen = SymmetricEigen::new(scaled.clone());
        let largest = eigen.eigenvalues.amax();
        let rank = eigen.eigenvalues.iter().filter(|v| **v > SEEN * largest).count();

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

        // (28): posterior covariance; where no prior counts, only the seen part of the space has one.
        let mut full = scaled.clone();
        if prior {
            positions.iter().for_each(|i| full[(*i, *i)] += 1.0);
        }
        let eigen = SymmetricEigen::new(full);
        let mut variance = DVector::zeros(layout.len);
        for (i, value) in eigen.eigenvalues.iter().enumerate() {
            let vector = eigen.eigenvectors.column(i);
            for (a, x) in vector.iter().enumerate() {
                if *value > floor.max(1e-300) {
                    variance[a] += x * x / value;
                } else if x.abs() > 1e-4 {
                    variance[a] = f64::INFINITY;
                }
            }
        }
        let used =
            strength.iter().map(|s| if prior { s / (1.0 + s) } else { f64::from(*s > 0.0) }).sum::<f64>()
                + (rest.len() as f64);
        let open = open_directions(&outer, &cross, &inner, &rest, layout.len, floor);
        let used = used - open.len() as f64;
        Information { rank, directions, strength, positions, variance, open, used }
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

/// Directions among the unknowns without prior that no data see, even with everything else held by its prior.
fn open_directions(
    outer: &DMatrix<f64>,
    cross: &DMatrix<f64>,
    inner: &DMatrix<f64>,
    rest: &[usize],
    len: usize,
    floor: f64,
) -> Vec<DVector<f64>> {
    if rest.is_empty() {
        return Vec::new();
    }
    let held = inner + DMatrix::identity(inner.nrows(), inner.nrows());
    let Some(cholesky) = nalgebra::Cholesky::new(held) else { return Vec::new() };
    let eigen = SymmetricEigen::new(outer - cross * cholesky.solve(&cross.transpose()));
    let open = eigen.eigenvalues.iter().enumerate().filter(|(_, v)| **v <= floor);
    open.map(|(i, _)| {
        let mut vector = DVector::zeros(len);
        rest.iter().enumerate().for_each(|(a, at)| vector[*at] = eigen.eigenvectors[(a, i)]);
        vector
    })
    .collect()
}
