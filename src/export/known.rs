//! What of a number the recordings have determined, as the calibrated file tells it.

use super::travel::poses;
use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::lie::Twist;
use crate::location::{Functional, Knowledge};

/// A number is determined where no more than this part of the variance that the tolerances allow lies along what the recordings left
/// open: a tenth of the tolerances as a standard deviation.
const OPEN: f64 = 0.01;

/// What a number changes by less is rounding, in its own unit.
const ROUNDING: f64 = 1e-11;

/// What the file says of what its recordings have not seen.
pub(super) struct Known<'a> {
    calibrated: &'a CalibratedMachine,
}

/// How sure a number is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verdict {
    /// Standard deviation that the tolerances alone allow, in the number's own unit.
    pub allowed: f64,
    /// Standard deviation along what the recordings left open.
    pub open: f64,
}

impl Verdict {
    pub fn is_determined(self) -> bool {
        self.open * self.open <= OPEN * self.allowed * self.allowed + ROUNDING * ROUNDING
    }
}

impl<'a> Known<'a> {
    pub fn new(calibrated: &'a CalibratedMachine) -> Self {
        Known { calibrated }
    }

    /// Whether the file says anything of it at all.
    pub fn is_stated(&self) -> bool {
        self.calibrated.unseen().is_some()
    }

    /// What has to be known of a file that says nothing of what its recordings have seen.
    pub fn sentence(&self) -> Option<String> {
        let empty = self.calibrated.deviations().iter().all(|dh| dh.to_array() == [0.0; 6]);
        match (self.is_stated(), empty) {
            (true, _) => None,
            (false, true) => Some("the file holds no deviation: these are the numbers of the machine as it is declared".into()),
            (false, false) => Some(
                "the file does not say what its recordings have seen (`unseen`): its deviations are taken as they stand".into(),
            ),
        }
    }

    /// How sure functions of the deviations are; by central differences, so they must be smooth over a tolerance.
    pub fn judge(&self, functions: impl Fn(&[Twist<f64>]) -> Vec<f64>) -> Vec<Verdict> {
        let machine = self.calibrated.machine();
        let dh = self.calibrated.deviations();
        let half_change = |by: &[Twist<f64>]| -> Vec<f64> {
            let moved = |sign: f64| -> Vec<Twist<f64>> {
                dh.iter().zip(by).map(|(dh, by)| *dh + by.times(sign)).collect()
            };
            functions(&moved(1.0)).iter().zip(functions(&moved(-1.0))).map(|(a, b)| 0.5 * (a - b)).collect()
        };
        let count = functions(dh).len();
        let (mut allowed, mut open) = (vec![0.0; count], vec![0.0; count]);
        let add = |sums: &mut Vec<f64>, changes: Vec<f64>| {
            sums.iter_mut().zip(changes).for_each(|(sum, change)| *sum += change * change);
        };
        // Where the workpiece stands is no matter of the machine.
        for j in (0..dh.len()).filter(|j| *j != machine.w_index()) {
            for (k, tolerance) in machine.tolerance(j).to_array().into_iter().enumerate() {
                let mut by = vec![Twist::zero(0.0); dh.len()];
                by[j] = Twist::from_array(std::array::from_fn(|i| if i == k { tolerance } else { 0.0 }));
                add(&mut allowed, half_change(&by));
            }
        }
        for pattern in self.calibrated.unseen().unwrap_or_default() {
            let mut by = pattern.clone();
            by[machine.w_index()] = Twist::zero(0.0);
            add(&mut open, half_change(&by));
        }
        allowed.iter().zip(open).map(|(a, o)| Verdict { allowed: a.sqrt(), open: o.sqrt() }).collect()
    }
}

impl Knowledge for Known<'_> {
    fn of_deviations(&self, by_dyad_scaled: &[f64]) -> Functional {
        let machine = self.calibrated.machine();
        let along = |pattern: &Vec<Twist<f64>>| -> f64 {
            let scaled = pattern.iter().enumerate().flat_map(|(j, dh)| {
                dh.to_array()
                    .into_iter()
                    .zip(machine.tolerance(j).to_array())
                    .map(|(x, tolerance)| x / tolerance)
            });
            scaled.zip(by_dyad_scaled).map(|(x, g)| x * g).sum::<f64>().powi(2)
        };
        let prior_variance: f64 = by_dyad_scaled.iter().map(|g| g * g).sum();
        let open = self.calibrated.unseen().unwrap_or_default().iter().map(along).sum::<f64>();
        let unseen = if prior_variance > 0.0 { open / prior_variance } else { 0.0 };
        Functional { prior_variance, posterior_variance: open, unseen }
    }
}

/// What the recordings left open, as it may be at the tip of the tool.
pub(super) fn open_at_tool(calibrated: &CalibratedMachine) -> Option<String> {
    let patterns = calibrated.unseen().filter(|patterns| !patterns.is_empty())?;
    let machine = calibrated.machine();
    let chain = calibrated.chain();
    let (mut worst, mut turned): (f64, f64) = (0.0, 0.0);
    let moved: Vec<Chain<f64>> = patterns
        .iter()
        .map(|pattern| {
            let dh: Vec<_> = calibrated.deviations().iter().zip(pattern).map(|(dh, by)| *dh + *by).collect();
            Chain::new(machine, &dh)
        })
        .collect();
    for q in poses(calibrated, 50) {
        let t_from_w = chain.w_from_t(&q).inverse();
        let gaps: Vec<Twist<f64>> = moved.iter().map(|m| (t_from_w * m.w_from_t(&q)).log()).collect();
        let size = |of: fn(&Twist<f64>) -> f64| gaps.iter().map(|gap| of(gap).powi(2)).sum::<f64>().sqrt();
        worst = worst.max(size(|gap| gap.v.norm()));
        turned = turned.max(size(|gap| gap.w.norm()));
    }
    Some(format!(
        "the recordings left {} of the deviations open, which stand at what the tolerances make likely: up to {:.1} um at the tip and {:.1} urad of the tool over the travel (one standard deviation)",
        if patterns.len() == 1 {
            "one combination".to_string()
        } else {
            format!("{} combinations", patterns.len())
        },
        worst * 1e6,
        turned * 1e6
    ))
}
