//! Evidence of columns whose coefficients are normal with the sizes usual on machines, `docs/diagnosis-method.md` (63).

use nalgebra::{Cholesky, DMatrix, DVector};

/// Usual sizes are known to within a factor of so many, either way.
const SIZES: [f64; 3] = [0.25, 1.0, 4.0];
/// Where coefficients are larger than that, sizes four times larger each are asked too, so often at most, and each is less likely
/// beforehand by this (logarithm): a wrong electrical signal exceeds what is usual on sound machines thousands of times.
const STEP: f64 = 4.0;
const MORE: usize = 9;
const RARER: f64 = 2.0;

/// Logarithm of how much rarer the larger size of this number is, where so many are usual.
pub(super) fn rarity(number: usize, usual: usize) -> f64 {
    -RARER * number.saturating_sub(usual) as f64
}

/// How many of the larger sizes reach up to so many usual ones.
pub(super) fn sizes_up_to(times: f64) -> usize {
    let steps = (times / SIZES[SIZES.len() - 1]).max(1.0).ln() / STEP.ln();
    (steps.ceil() as usize).min(MORE)
}

/// What columns are worth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Worth {
    /// Logarithm of their evidence.
    pub evidence: f64,
    /// Half the energy that they take away.
    pub gain: f64,
    /// The size of coefficients, over the usual one, that is likeliest among those beyond the usual; 1 where the usual will do.
    pub size: f64,
}

/// Evidence of the first `length` columns, whose coefficients are normal with the sizes usual on machines, or larger where the
/// recordings ask for that; so many of the larger sizes are usual too.
pub(super) fn evidence(
    gram: &DMatrix<f64>,
    g: &DVector<f64>,
    length: usize,
    overdispersion: f64,
    usual: usize,
) -> Worth {
    let (gram, g) = (gram.view((0, 0), (length, length)), g.rows(0, length).into_owned());
    // Logarithm, gain, root mean square of the coefficients over the size.
    let with = |size: f64| {
        let s2 = size * size / overdispersion;
        let mut inner = gram * s2;
        (0..length).for_each(|i| inner[(i, i)] += 1.0);
        let cholesky = Cholesky::new(inner)?;
        let solved = cholesky.solve(&g) * s2;
        let gain = 0.5 * g.dot(&solved);
        let log_det: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some((gain / overdispersion - log_det, gain, solved.norm() / (length as f64).sqrt() / size))
    };
    let mut worth = Worth { evidence: 0.0, gain: 0.0, size: 1.0 };
    let mut held = false;
    let logs = SIZES.map(|size| {
        let Some((log, gain, large)) = with(size) else { return f64::NEG_INFINITY };
        worth.gain = worth.gain.max(gain);
        held = large > 1.0;
        log
    });
    worth.evidence = log_mean_exp(&logs);
    let (mut size, mut best) = (SIZES[SIZES.len() - 1], logs.iter().copied().fold(f64::MIN, f64::max));
    let mut beyond = Vec::new();
    while held && beyond.len() < MORE {
        size *= STEP;
        let Some((log, gain, large)) = with(size) else { break };
        let log = log + rarity(beyond.len() + 1, usual);
        worth.gain = worth.gain.max(gain);
        held = large > 1.0;
        if log > best {
            (best, worth.size) = (log, size);
        }
        beyond.push(log - (SIZES.len() as f64).ln());
    }
    if !beyond.is_empty() {
        beyond.push(worth.evidence);
        worth.evidence = log_sum_exp(&beyond);
    }
    worth
}

/// Parts of the size that are asked for how large coefficients are, each half of the one before; what is told leaves this much room.
const PARTS: usize = 8;
const ROOM: f64 = 2.0;

/// Which part of the size that several coefficients may have is likely, as all of them together show it: what the readings hardly see
/// of an effect is then no larger than what they see. `gram`, `g`: of columns times that size.
pub(super) fn likely_part(gram: &DMatrix<f64>, g: &DVector<f64>, overdispersion: f64) -> f64 {
    let log = |part: f64| {
        let s2 = part * part / overdispersion;
        let mut inner = gram * s2;
        (0..g.len()).for_each(|i| inner[(i, i)] += 1.0);
        let Some(cholesky) = Cholesky::new(inner) else { return f64::NEG_INFINITY };
        let determinant = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        0.5 * s2 / overdispersion * g.dot(&cholesky.solve(g)) - determinant
    };
    let parts = (0..PARTS).map(|k| 0.5f64.powi(k as i32));
    let best = parts.max_by(|a, b| log(*a).total_cmp(&log(*b))).unwrap_or(1.0);
    (ROOM * best).min(1.0)
}

/// `ln` of the mean of exponentials.
pub(super) fn log_mean_exp(logs: &[f64]) -> f64 {
    log_sum_exp(logs) - (logs.len() as f64).ln()
}

/// `ln` of the sum of exponentials.
pub(super) fn log_sum_exp(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return f64::NEG_INFINITY;
    }
    most + logs.iter().map(|l| (l - most).exp()).sum::<f64>().ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_that_are_usual_cost_nothing() {
        // A thousand times the usual size, seen to a thousandth of it.
        let (gram, g) = (DMatrix::from_element(1, 1, 1e6), DVector::from_element(1, 1e9));
        let steps = sizes_up_to(1000.0);
        assert_eq!(steps, 4);
        let (rare, usual) = (evidence(&gram, &g, 1, 1.0, 0), evidence(&gram, &g, 1, 1.0, steps));
        let grown = usual.evidence - rare.evidence;
        assert!((grown - RARER * steps as f64).abs() < 1.5, "{grown}");
        // What is no larger than usual is worth the same.
        let g = DVector::from_element(1, 1e6);
        assert_eq!(evidence(&gram, &g, 1, 1.0, 0).evidence, evidence(&gram, &g, 1, 1.0, steps).evidence);
    }

    #[test]
    fn what_is_hardly_seen_is_no_larger_than_what_is_seen() {
        // Two combinations are seen to a thousandth of the size, and are a hundredth of it; the third is not seen at all.
        let gram = DMatrix::from_diagonal(&DVector::from_vec(vec![1e6, 1e6, 0.0]));
        let g = DVector::from_vec(vec![1e4, -1e4, 0.0]);
        let part = likely_part(&gram, &g, 1.0);
        assert!((0.01..0.04).contains(&part), "{part}");
        // Large ones keep the size that they have.
        assert_eq!(likely_part(&gram, &(100.0 * &g), 1.0), 1.0);
    }
}
