//! The solvers: Levenberg-Marquardt by gain ratio, and the named rivals, `docs/model.md` (21).

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

use super::information::open_directions;
use super::loss::Loss;
use super::noise::Noise;
use super::normal::{Normal, accumulate, set_up_geometry};
use super::source::Sources;
use super::thin::Thin;
use super::unknowns::{Block, Layout, Unknowns};
use crate::error::{Error, Result};
use crate::error_motion::Motions;
use crate::machine::Machine;
use crate::variation::Varying;

/// How the identification walks to its optimum.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "name", rename_all = "snake_case")]
pub enum Solver {
    /// Damped by gain ratio (Nielsen), in coordinates scaled by the tolerances; directions that the data do not see stay where they are.
    #[default]
    LevenbergMarquardt,
    /// The paper's scheme: `mu = tau · max diag(JᵀJ)` in every step, in plain m and rad, no prior.
    FixedDamping {
        /// The factor.
        tau: f64,
        /// Steps at most; the paper's regularisation is in this number too.
        steps: usize,
    },
    /// No damping, no prior, plain m and rad: fails where the normal matrix is singular.
    GaussNewton,
    /// Minimum-norm steps in the directions whose singular value, in coordinates scaled by the tolerances, exceeds `cut` times the largest; no prior.
    RankTruncation {
        /// The relative cut.
        cut: f64,
    },
}

impl Solver {
    /// Whether this scheme uses the prior on the total deviation.
    pub fn uses_prior(self) -> bool {
        matches!(self, Solver::LevenbergMarquardt)
    }
}

/// Why an identification stopped.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// The next step promises a decrease of the objective that changes nothing, or is below rounding.
    Converged,
    /// The number of steps asked for is used up.
    Steps,
    /// No damping makes the objective fall any more: its rounding is reached.
    NoDescent,
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Stop::Converged => "converged",
            Stop::Steps => "number of steps used up",
            Stop::NoDescent => "no further descent (rounding reached)",
        })
    }
}

/// A least-squares problem with everything but the state fixed.
pub(crate) struct Problem<'a> {
    pub machine: &'a Machine,
    pub sources: &'a Sources<'a>,
    pub layout: &'a Layout,
    /// What deviations depend on.
    pub varying: &'a Varying,
    pub loss: Loss,
    /// Whether the prior of the blocks that have one counts.
    pub prior: bool,
    /// Which parameters may move.
    pub free: Vec<bool>,
    /// Error motions that room is left for.
    pub motions: Motions,
    /// Directions in the scaled parameter vector along which nothing moves: the data leave them open, and would only fit noise there.
    pub frozen: Vec<DVector<f64>>,
    /// Told what the solver is at, before every pass over the data.
    pub progress: &'a dyn Fn(&str),
}

/// Where a solver ended.
pub(crate) struct Solution {
    pub unknowns: Unknowns,
    pub normal: Normal,
    pub stop: Stop,
    pub steps: usize,
}

/// More steps are never needed: problems of this kind take five.
const MOST_STEPS: usize = 200;
/// Relative decrease of the objective that counts as rounding.
const SETTLED: f64 = 1e-13;
/// Decrease of the objective, half of chi-square, that no longer moves any parameter by a ten-thousandth of its standard error.
const NOTHING: f64 = 1e-9;
/// Damping of the first step, where a tolerance has a weight of 1: it must not outweigh the prior, however many samples there are.
const FIRST_DAMPING: f64 = 1e-3;
/// Part of the largest eigenvalue up to which those of directions that nothing sees may come by rounding.
const ROUNDING: f64 = 1e-13;
/// Eigenvalues below this part of the largest are not seen by the data.
const UNSEEN: f64 = 1e-14;

impl<'a> Problem<'a> {
    /// With the default loss and the prior; `free` says which blocks may move.
    pub fn new(
        machine: &'a Machine,
        sources: &'a Sources<'a>,
        layout: &'a Layout,
        varying: &'a Varying,
        free: impl Fn(&Block) -> bool,
    ) -> Self {
        Problem {
            machine,
            sources,
            layout,
            varying,
            loss: Loss::default(),
            prior: true,
            free: layout.mask(free),
            motions: Motions::default(),
            frozen: Vec::new(),
            progress: &|_| {},
        }
    }

    pub fn normal(&self, unknowns: &Unknowns, noise: &[Noise]) -> Result<Normal> {
        accumulate(self.machine, self.sources, self.layout, unknowns, noise, self.loss, &self.motions)
    }

    /// What the data leave open of the set-ups; `least` is the information that counts.
    pub fn open(&self, unknowns: &Unknowns, noise: &[Noise], thin: &[Thin], least: f64) -> Vec<DVector<f64>> {
        let geometry = set_up_geometry(self.machine, self.sources, self.layout, unknowns, noise, thin);
        open_directions(&geometry, self.layout, least)
    }

    /// `½ Σ (total / tolerance)²` over the blocks with a prior.
    fn penalty(&self, unknowns: &Unknowns) -> f64 {
        if !self.prior {
            return 0.0;
        }
        0.5 * self.pulls(unknowns).norm_squared()
    }

    /// Totals in units of their tolerances; zero where there is no prior.
    fn pulls(&self, unknowns: &Unknowns) -> DVector<f64> {
        let mut pulls = DVector::zeros(self.layout.len);
        for block in self.layout.blocks.iter().filter(|b| b.prior && self.prior) {
            for (k, total) in unknowns.total(block).into_iter().take(block.len).enumerate() {
                pulls[block.offset + k] = total / block.scale[k];
            }
        }
        pulls
    }

    /// The largest total in units of its tolerance.
    pub fn farthest(&self, unknowns: &Unknowns) -> f64 {
        self.pulls(unknowns).amax()
    }

    /// Matrix and gradient of the free parameters scaled by `scales`, prior included.
    fn scaled(
        &self,
        normal: &Normal,
        unknowns: &Unknowns,
        scales: &DVector<f64>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let free: Vec<usize> = (0..self.layout.len).filter(|i| self.free[*i]).collect();
        let has_prior = self.layout.mask(|b| b.prior && self.prior);
        let pulls = self.pulls(unknowns);
        let mut matrix = DMatrix::from_fn(free.len(), free.len(), |a, b| {
            normal.matrix[(free[a], free[b])] * scales[free[a]] * scales[free[b]]
        });
        let mut gradient = DVector::from_fn(free.len(), |a, _| normal.gradient[free[a]] * scales[free[a]]);
        for (a, i) in free.iter().enumerate() {
            if has_prior[*i] {
                matrix[(a, a)] += 1.0;
                gradient[a] -= pulls[*i];
            }
        }
        let tolerances = self.layout.scales();
        for direction in &self.frozen {
            if free.iter().map(|i| direction[*i].powi(2)).sum::<f64>() < 0.5 {
                continue; // not among the free parameters
            }
            let own = free.iter().map(|i| direction[*i] * tolerances[*i] / scales[*i]);
            let along = DVector::from_iterator(free.len(), own);
            let length2 = along.norm_squared();
            // P A P and P g with P = I - d dᵀ / |d|²: the direction gets an eigenvalue of zero and no step.
            let pushed = &matrix * &along / length2;
            let within = along.dot(&pushed) / length2;
            matrix -= &pushed * along.transpose() + &along * pushed.transpose();
            matrix += within * &along * along.transpose();
            let pull = along.dot(&gradient) / length2;
            gradient -= pull * along;
        }
        (matrix, gradient)
    }

    /// A step of the free scaled parameters as a step of all, m and rad.
    fn full(&self, step: &DVector<f64>, scales: &DVector<f64>) -> DVector<f64> {
        let mut full = DVector::zeros(self.layout.len);
        let free = (0..self.layout.len).filter(|i| self.free[*i]);
        for (a, i) in free.enumerate() {
            full[i] = step[a] * scales[i];
        }
        full
    }

    /// Runs the solver from `start`.
    ///
    /// # Errors
    /// If a recording cannot be read again, or [`Solver::GaussNewton`] meets a singular matrix.
    pub fn solve(&self, solver: Solver, start: Unknowns, noise: &[Noise]) -> Result<Solution> {
        self.solve_on(solver, start, None, noise)
    }

    /// As [`Problem::solve`]; `at_start` are the sums at the start with this noise, where they are at hand.
    pub fn solve_on(
        &self,
        solver: Solver,
        start: Unknowns,
        at_start: Option<Normal>,
        noise: &[Noise],
    ) -> Result<Solution> {
        let normal = match at_start {
            Some(normal) => normal,
            None => self.normal(&start, noise)?,
        };
        match solver {
            Solver::LevenbergMarquardt => self.levenberg_marquardt(start, normal, noise),
            _ => self.without_control(solver, start, normal, noise),
        }
    }

    fn levenberg_marquardt(&self, start: Unknowns, mut normal: Normal, noise: &[Noise]) -> Result<Solution> {
        let scales = self.layout.scales();
        let mut unknowns = start;
        unknowns.motions.clone_from(&normal.motions);
        let mut objective = normal.loss + self.penalty(&unknowns);
        let (mut damping, mut growth) = (None, 2.0);
        let mut steps = 0;
        let stop = 'outer: loop {
            let (matrix, gradient) = self.scaled(&normal, &unknowns, &scales);
            if gradient.is_empty() {
                break Stop::Converged;
            }
            let eigen = SymmetricEigen::new(matrix);
            let largest = eigen.eigenvalues.amax();
            let along = eigen.eigenvectors.tr_mul(&gradient);
            let mut mu: f64 = damping.unwrap_or(FIRST_DAMPING.max(ROUNDING * largest));
            loop {
                // (21): one step, in the eigenvectors' coordinates; what the data do not see stays.
                let amounts = DVector::from_fn(along.len(), |i, _| {
                    let value = eigen.eigenvalues[i];
                    if value > UNSEEN * largest { along[i] / (value + mu) } else { 0.0 }
                });
                let promised: f64 = (0..along.len())
                    .map(|i| amounts[i] * (along[i] - 0.5 * eigen.eigenvalues[i] * amounts[i]))
                    .sum();
                if promised <= NOTHING.max(SETTLED * objective) || !promised.is_finite() {
                    break 'outer Stop::Converged;
                }
                if steps >= MOST_STEPS {
                    break 'outer Stop::Steps;
                }
                steps += 1;
                (self.progress)(&format!("step {steps}, loss {objective:.3e}"));
                let step = self.full(&(&eigen.eigenvectors * &amounts), &scales);
                let mut next = unknowns.stepped(self.layout, &step);
                let next_normal = self.normal(&next, noise)?;
                next.motions.clone_from(&next_normal.motions);
                let next_objective = next_normal.loss + self.penalty(&next);
                let gain = (objective - next_objective) / promised;
                if next_objective.is_finite() && gain > 0.0 {
                    (unknowns, normal, objective) = (next, next_normal, next_objective);
                    damping = Some(mu * (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(1.0 / 3.0, 2.0));
                    growth = 2.0;
                    break;
                }
                if promised <= 1e-9 * objective && mu > largest {
                    break 'outer Stop::NoDescent;
                }
                if mu > 1e16 * largest.max(f64::MIN_POSITIVE) {
                    break 'outer Stop::NoDescent;
                }
                mu = mu.max(1e-9 * largest) * growth;
                growth *= 2.0;
            }
        };
        Ok(Solution { unknowns, normal, stop, steps })
    }

    /// The schemes that take every step as it comes.
    fn without_control(
        &self,
        solver: Solver,
        start: Unknowns,
        mut normal: Normal,
        noise: &[Noise],
    ) -> Result<Solution> {
        let plain = DVector::from_element(self.layout.len, 1.0);
        let scales = match solver {
            Solver::RankTruncation { .. } => self.layout.scales(),
            _ => plain,
        };
        let most = match solver {
            Solver::FixedDamping { steps, .. } => steps,
            _ => 50,
        };
        let mut unknowns = start;
        unknowns.motions.clone_from(&normal.motions);
        for steps in 0..most {
            (self.progress)(&format!("step {}", steps + 1));
            let (matrix, gradient) = self.scaled(&normal, &unknowns, &scales);
            let step = one_step(solver, matrix, &gradient)?;
            unknowns = unknowns.stepped(self.layout, &self.full(&step, &scales));
            let before = normal.loss;
            normal = self.normal(&unknowns, noise)?;
            unknowns.motions.clone_from(&normal.motions);
            let settled = (before - normal.loss).abs() <= SETTLED * before;
            if settled && !matches!(solver, Solver::FixedDamping { .. }) {
                return Ok(Solution { unknowns, normal, stop: Stop::Converged, steps: steps + 1 });
            }
        }
        Ok(Solution { unknowns, normal, stop: Stop::Steps, steps: most })
    }
}

fn one_step(solver: Solver, mut matrix: DMatrix<f64>, gradient: &DVector<f64>) -> Result<DVector<f64>> {
    let largest = matrix.diagonal().amax();
    match solver {
        Solver::RankTruncation { cut } => {
            let eigen = SymmetricEigen::new(matrix);
            let largest = eigen.eigenvalues.amax();
            let along = eigen.eigenvectors.tr_mul(gradient);
            let amounts = DVector::from_fn(along.len(), |i, _| {
                let value = eigen.eigenvalues[i];
                if value > cut * cut * largest { along[i] / value } else { 0.0 }
            });
            return Ok(&eigen.eigenvectors * amounts);
        }
        Solver::FixedDamping { tau, .. } => {
            for i in 0..matrix.nrows() {
                matrix[(i, i)] += tau * largest;
            }
        }
        Solver::GaussNewton => {
            let smallest = matrix.symmetric_eigenvalues().min();
            if smallest <= UNSEEN * largest {
                return Err(singular(smallest / largest));
            }
        }
        Solver::LevenbergMarquardt => {}
    }
    let cholesky = Cholesky::new(matrix).ok_or_else(|| singular(0.0))?;
    Ok(cholesky.solve(gradient))
}

fn singular(ratio: f64) -> Error {
    Error::Undetermined {
        what: format!(
            "plain Gauss-Newton cannot take a step: the normal matrix is singular (smallest to largest eigenvalue {ratio:.1e})"
        ),
        mend: "use the default solver, or rank truncation: these data do not see every parameter".into(),
    }
}
