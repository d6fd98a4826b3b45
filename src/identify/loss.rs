//! Robust losses, `docs/model.md` (27).

use serde::{Deserialize, Serialize};

/// How a standardised residual `e` (in standard deviations of the noise) counts.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "name", rename_all = "snake_case")]
pub enum Loss {
    /// `e²/2`: least squares.
    Squares,
    /// Quadratic up to `k`, linear beyond. `k = 3`, the default, leaves clean data untouched; `1.345` is the textbook's.
    Huber {
        /// Where the straight part begins, standard deviations.
        k: f64,
    },
    /// Tukey's biweight: beyond `c` a sample no longer counts at all. The textbook's `c` is 4.685.
    Tukey {
        /// Where influence ends, standard deviations.
        c: f64,
    },
}

impl Default for Loss {
    fn default() -> Self {
        Loss::Huber { k: 3.0 }
    }
}

impl Loss {
    /// Squared standardised residual up to which the loss is half of it and the weight is 1.
    pub(super) fn plain_below(self) -> f64 {
        match self {
            Loss::Squares => f64::INFINITY,
            Loss::Huber { k } => k * k,
            Loss::Tukey { .. } => 0.0,
        }
    }

    /// Loss and weight (`loss' / e`) at the squared standardised residual `e2`.
    pub fn at(self, e2: f64) -> (f64, f64) {
        match self {
            Loss::Squares => (0.5 * e2, 1.0),
            Loss::Huber { k } if e2 <= k * k => (0.5 * e2, 1.0),
            Loss::Huber { k } => {
                let e = e2.sqrt();
                (k * e - 0.5 * k * k, k / e)
            }
            Loss::Tukey { c } => {
                let inside = (1.0 - e2 / (c * c)).max(0.0);
                (c * c / 6.0 * (1.0 - inside.powi(3)), inside * inside)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_plain_has_a_weight_of_one() {
        for loss in [Loss::Squares, Loss::Huber { k: 1.345 }, Loss::Tukey { c: 4.685 }] {
            let e2 = 0.999 * loss.plain_below().min(1e9);
            assert_eq!(loss.at(e2).1, 1.0);
            assert!((loss.at(e2).0 - 0.5 * e2).abs() <= 1e-15 * e2);
        }
    }

    #[test]
    fn weight_is_the_derivative_of_the_loss_by_half_the_square() {
        for loss in [Loss::Squares, Loss::Huber { k: 1.345 }, Loss::Tukey { c: 4.685 }] {
            for e2 in [0.01, 1.0, 1.8, 9.0, 21.0, 30.0, 1e4] {
                let h = 1e-5 * e2;
                let slope = 2.0 * (loss.at(e2 + h).0 - loss.at(e2 - h).0) / (2.0 * h);
                let weight = loss.at(e2).1;
                assert!((slope - weight).abs() < 1e-6, "{loss:?} at {e2}: {slope} against {weight}");
            }
        }
    }
}
