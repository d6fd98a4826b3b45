//! Robust losses, `docs/model.md` (27).

use serde::Serialize;

/// How a standardised residual `e` (in standard deviations of the noise) counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
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

    /// `E[w e²] / E[w]` on clean normal noise of unit size, with `readings` readings a sample: weights take away from the tails of
    /// clean data too, and noise taken from weighted squares must be set right by this.
    pub(crate) fn consistency(self, readings: usize) -> f64 {
        if self == Loss::Squares || readings == 0 {
            return 1.0;
        }
        // The norm of a sample's readings has the density r^(n-1) exp(-r²/2) up to a factor, which cancels.
        const STEP: f64 = 0.01;
        let (mut weighted, mut weights) = (0.0, 0.0);
        for i in 0..1200 {
            let r = STEP * (f64::from(i) + 0.5);
            let e2 = r * r / readings as f64;
            let share = self.at(e2).1 * r.powi(readings as i32 - 1) * (-0.5 * r * r).exp();
            weighted += share * e2;
            weights += share;
        }
        weighted / weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consistency_agrees_with_closed_forms() {
        // Tukey's weight is a polynomial inside c, and moments of the normal are 1, 3, 15 (readings 1) as long as c is far out.
        let c: f64 = 12.0;
        let (c2, c4) = (c.powi(2), c.powi(4));
        let closed = (1.0 - 6.0 / c2 + 15.0 / c4) / (1.0 - 2.0 / c2 + 3.0 / c4);
        assert!((Loss::Tukey { c }.consistency(1) - closed).abs() < 1e-9);
        // A far corner takes nothing away, however many readings.
        for readings in [1, 3, 6] {
            assert!((Loss::Huber { k: 9.0 }.consistency(readings) - 1.0).abs() < 1e-9);
        }
        // Huber, one reading: E[w e²] is what the normal has inside the corner, 0.82138 at 1.345, and E[w] lies between that and 1.
        let huber = Loss::Huber { k: 1.345 }.consistency(1);
        assert!((0.82138..1.0).contains(&huber), "{huber}");
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
