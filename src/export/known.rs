//! What of a number the recordings have determined, as the calibrated file tells it.

use super::travel::poses;
use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::lie::Twist;
use crate::location::{Functional, IDENTIFIED, Knowledge, LISTED, LocationError};

/// No more than this part of the variance that the tolerances allow may lie along what the file lists as unseen: with what it need not
/// list, [`LISTED`], the data's share is still [`IDENTIFIED`]. A tenth of the tolerances as a standard deviation.
const OPEN: f64 = 1.0 - IDENTIFIED - LISTED;

/// A pattern of which the data bring no more than this part is one that they do not see at all.
const NOTHING: f64 = 1e-6;

/// What a number changes by less is rounding, in its own unit.
const ROUNDING: f64 = 1e-11;

/// What the file says of what its recordings have not seen.
pub(super) struct Known<'a> {
    calibrated: &'a CalibratedMachine,
}

/// How sure a number is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verdict {
    /// Standard deviation along what the recordings left open, in the number's own unit.
    pub open: f64,
    determined: bool,
}

impl Verdict {
    pub fn is_determined(self) -> bool {
        self.determined
    }
}

/// Whether a number that was judged by a calibrated file may be entered.
fn may_be_entered(identified: bool, share: f64) -> bool {
    identified && share >= 1.0 - OPEN
}

impl<'a> Known<'a> {
    pub fn new(calibrated: &'a CalibratedMachine) -> Self {
        Known { calibrated }
    }

    /// Whether the file says anything of it at all.
    pub fn is_stated(&self) -> bool {
        self.calibrated.unseen().is_some()
    }

    /// Whether a location error that was judged by it may be entered.
    pub fn determines(&self, error: &LocationError) -> bool {
        !self.is_stated() || may_be_entered(error.identified, error.share)
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
        let mut allowed = vec![0.0; functions(dh).len()];
        // Where the workpiece stands is no matter of the machine.
        for j in (0..dh.len()).filter(|j| *j != machine.w_index()) {
            for (k, tolerance) in machine.tolerance(j).to_array().into_iter().enumerate() {
                let mut by = vec![Twist::zero(0.0); dh.len()];
                by[j] = Twist::from_array(std::array::from_fn(|i| if i == k { tolerance } else { 0.0 }));
                let changes = half_change(&by);
                allowed.iter_mut().zip(changes).for_each(|(sum, change)| *sum += change * change);
            }
        }
        let patterns = self.calibrated.unseen().unwrap_or_default();
        let changes: Vec<Vec<f64>> = patterns
            .iter()
            .map(|pattern| {
                let mut by = pattern.clone();
                by[machine.w_index()] = Twist::zero(0.0);
                half_change(&by)
            })
            .collect();
        let verdict = |(i, allowed): (usize, f64)| {
            let known = self.functional(allowed, changes.iter().map(|changes| changes[i]));
            let open = known.posterior_variance;
            let may = || may_be_entered(known.is_identified(), known.share());
            Verdict { open: open.sqrt(), determined: open <= ROUNDING * ROUNDING || may() }
        };
        allowed.into_iter().enumerate().map(verdict).collect()
    }

    /// What is known of a function, from its changes by each pattern.
    fn functional(&self, prior_variance: f64, changes: impl Iterator<Item = f64>) -> Functional {
        let (mut open, mut unseen) = (0.0, 0.0);
        for (pattern, change) in self.calibrated.unseen().unwrap_or_default().iter().zip(changes) {
            let square = change * change;
            open += square;
            // Of a pattern that is one standard deviation long, its length in tolerances says how much the data bring.
            if self.scaled(pattern).map(|x| x * x).sum::<f64>() >= 1.0 - NOTHING {
                unseen += square;
            }
        }
        let unseen = if prior_variance > 0.0 { unseen / prior_variance } else { 0.0 };
        Functional { prior_variance, posterior_variance: open, unseen }
    }

    /// The components of a pattern in units of their tolerances.
    fn scaled<'p>(&'p self, pattern: &'p [Twist<f64>]) -> impl Iterator<Item = f64> + 'p {
        let machine = self.calibrated.machine();
        pattern.iter().enumerate().flat_map(move |(j, dh)| {
            let tolerances = machine.tolerance(j).to_array();
            dh.to_array().into_iter().zip(tolerances).map(|(x, tolerance)| x / tolerance)
        })
    }
}

impl Knowledge for Known<'_> {
    fn of_deviations(&self, by_dyad_scaled: &[f64]) -> Functional {
        let along = |pattern: &Vec<Twist<f64>>| -> f64 {
            self.scaled(pattern).zip(by_dyad_scaled).map(|(x, g)| x * g).sum()
        };
        let prior_variance: f64 = by_dyad_scaled.iter().map(|g| g * g).sum();
        self.functional(prior_variance, self.calibrated.unseen().unwrap_or_default().iter().map(along))
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
