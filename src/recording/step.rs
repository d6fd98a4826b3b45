//! The step to which an instrument rounds its readings.

/// Readings nearer to each other than this part of their size are the same number, written twice.
const SAME: f64 = 1e-12;
/// Gaps of at most so many steps tell the step, if there are so many of them.
const NEAR: f64 = 12.0;
const MANY: usize = 30;
/// A gap is so many steps, to this part of one.
const EXACT: f64 = 0.05;
/// Part of the gaps that have to be.
const NEARLY_ALL: f64 = 0.98;

/// The step of which all differences of `readings` are multiples, in their unit; 0 where there is none, or too few readings to tell.
///
/// The resolution of the instrument, or of the file where that is coarser.
pub(crate) fn step_of(readings: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = readings.iter().copied().filter(|x| x.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let same = SAME * sorted.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    let gaps: Vec<f64> = sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > same).collect();
    let Some(least) = gaps.iter().copied().min_by(f64::total_cmp) else { return 0.0 };
    let near: Vec<f64> = gaps.into_iter().filter(|gap| *gap < NEAR * least).collect();
    let steps: f64 = near.iter().map(|gap| (gap / least).round()).sum();
    let step = near.iter().sum::<f64>() / steps;
    let whole = near.iter().filter(|gap| (*gap / step - (*gap / step).round()).abs() < EXACT).count();
    if near.len() >= MANY && whole as f64 > NEARLY_ALL * near.len() as f64 { step } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::step_of;
    use rand::{RngExt, SeedableRng};

    fn readings(step: f64) -> Vec<f64> {
        let mut random = rand::rngs::StdRng::seed_from_u64(7);
        (0..4000)
            .map(|k| 0.1 + 1e-3 * (0.01 * f64::from(k)).sin() + 1e-6 * random.random_range(-1.0..1.0))
            .map(|x: f64| if step > 0.0 { (x / step).round() * step } else { x })
            .collect()
    }

    #[test]
    fn a_step_is_found_to_a_thousandth_whatever_its_decimals() {
        for step in [1e-8, 1e-7, 5.7e-7, 1.3e-6] {
            assert!((step_of(&readings(step)) / step - 1.0).abs() < 1e-3, "{step}");
        }
    }

    #[test]
    fn what_is_not_rounded_has_no_step() {
        assert_eq!(step_of(&readings(0.0)), 0.0);
        assert_eq!(step_of(&[]), 0.0);
        assert_eq!(step_of(&[1.0, 1.0, 2.0]), 0.0);
    }
}
