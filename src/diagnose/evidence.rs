//! Evidence of columns whose coefficients are normal with the sizes usual on machines, `docs/diagnosis.md` (63).

use nalgebra::{Cholesky, DMatrix, DVector};

/// Usual sizes are known to within a factor of so many, either way.
const SIZES: [f64; 3] = [0.25, 1.0, 4.0];

/// Logarithm of the evidence of the first `length` columns, whose coefficients are normal with the sizes usual on machines, and half
/// the energy that they take away.
pub(super) fn evidence(gram: &DMatrix<f64>, g: &DVector<f64>, length: usize, heat: f64) -> (f64, f64) {
    let (gram, g) = (gram.view((0, 0), (length, length)), g.rows(0, length));
    let mut gain = 0.0;
    let logs = SIZES.map(|size| {
        let s2 = size * size / heat;
        let mut inner = gram * s2;
        (0..length).for_each(|i| inner[(i, i)] += 1.0);
        let Some(cholesky) = Cholesky::new(inner) else { return f64::NEG_INFINITY };
        let solved = cholesky.solve(&g.into_owned()) * s2;
        let explained = 0.5 * g.dot(&solved) / heat;
        gain = f64::max(gain, explained * heat);
        let log_det: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        explained - log_det
    });
    (log_mean_exp(&logs), gain)
}

/// `ln` of the mean of exponentials.
pub(super) fn log_mean_exp(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return f64::NEG_INFINITY;
    }
    most + (logs.iter().map(|l| (l - most).exp()).sum::<f64>() / logs.len() as f64).ln()
}
