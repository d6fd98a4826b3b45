//! What of a number the recordings have determined, as the calibrated file tells it.

use super::travel::poses;
use crate::calibration::CalibratedMachine;
use crate::chain::Chain;
use crate::lie::Twist;
use crate::location::{Functional, IDENTIFIED, Knowledge, LISTED, LocationError, UNSEEN};
use crate::machine::Machine;

/// No more than this part of the variance that the tolerances allow may lie along what the file lists as unseen: with what it need not
/// list, [`LISTED`], the data's share is still [`IDENTIFIED`]. A tenth of the tolerances as a standard deviation.
const OPEN: f64 = 1.0 - IDENTIFIED - LISTED;

/// What a number changes by less is rounding, in its own unit.
const ROUNDING: f64 = 1e-11;

/// What the file says of what its recordings have not seen.
pub(super) struct Known<'a> {
    calibrated: &'a CalibratedMachine,
    /// Patterns that the recordings do not see at all.
    unseen_at_all: Vec<&'a [Twist<f64>]>,
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
        // Of a pattern that is one standard deviation long, its length in tolerances says how much the data bring.
        let is_whole = |pattern: &[Twist<f64>]| {
            scaled(calibrated.machine(), pattern).map(|x| x * x).sum::<f64>() >= 1.0 - UNSEEN
        };
        let told = calibrated.unseen().unwrap_or_default().iter().map(Vec::as_slice);
        let unseen_at_all = match &calibrated.unseen_at_all {
            Some(listed) => listed.iter().map(Vec::as_slice).collect(),
            None => told.filter(|pattern| is_whole(pattern)).collect(),
        };
        Known { calibrated, unseen_at_all }
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
        let change = |pattern: &[Twist<f64>]| {
            let mut by = pattern.to_vec();
            by[machine.w_index()] = Twist::zero(0.0);
            half_change(&by)
        };
        let open: Vec<Vec<f64>> = self.patterns().map(change).collect();
        let at_all: Vec<Vec<f64>> = self.unseen_at_all.iter().map(|pattern| change(pattern)).collect();
        let verdict = |(i, allowed): (usize, f64)| {
            let of = |changes: &[Vec<f64>]| changes.iter().map(|changes| changes[i].powi(2)).sum();
            let known = functional(allowed, of(&open), of(&at_all));
            let open = known.posterior_variance;
            let may = || may_be_entered(known.is_identified(), known.share());
            Verdict { open: open.sqrt(), determined: open <= ROUNDING * ROUNDING || may() }
        };
        allowed.into_iter().enumerate().map(verdict).collect()
    }

    /// Patterns that the recordings left open.
    fn patterns(&self) -> impl Iterator<Item = &'a [Twist<f64>]> {
        self.calibrated.unseen().unwrap_or_default().iter().map(Vec::as_slice)
    }
}

/// What is known of a function, from its variances along what the recordings left open and along what they do not see at all.
fn functional(prior_variance: f64, open: f64, at_all: f64) -> Functional {
    let unseen = if prior_variance > 0.0 { at_all / prior_variance } else { 0.0 };
    Functional { prior_variance, posterior_variance: open, unseen }
}

/// The components of a pattern in units of their tolerances.
fn scaled(machine: &Machine, pattern: &[Twist<f64>]) -> impl Iterator<Item = f64> {
    pattern.iter().enumerate().flat_map(move |(j, dh)| {
        let tolerances = machine.tolerance(j).to_array();
        dh.to_array().into_iter().zip(tolerances).map(|(x, tolerance)| x / tolerance)
    })
}

impl Knowledge for Known<'_> {
    fn of_deviations(&self, by_dyad_scaled: &[f64]) -> Functional {
        let square = |pattern: &[Twist<f64>]| -> f64 {
            let parts = scaled(self.calibrated.machine(), pattern).zip(by_dyad_scaled);
            parts.map(|(x, g)| x * g).sum::<f64>().powi(2)
        };
        let prior_variance: f64 = by_dyad_scaled.iter().map(|g| g * g).sum();
        let at_all = self.unseen_at_all.iter().map(|pattern| square(pattern)).sum();
        functional(prior_variance, self.patterns().map(square).sum(), at_all)
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
