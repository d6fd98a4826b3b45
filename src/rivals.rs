//! Identification by other schemes, on the same recordings and the same machine description, and how they compare.
//!
//! Every [`Rival`] answers with the same thing, a [`CalibratedMachine`]: a product of exponentials with twists in the base frame is a
//! chain too, so that one harness, [`Arena`], judges all of them on recordings that they have not seen and, where the truth is
//! known, against it. `docs/rivals.md` says what they are and what the figures mean.
//!
//! ```
//! use kincal::Machine;
//! use kincal::recording::Recording;
//! use kincal::rivals::{Arena, Form, Rival, Scheme, Step};
//!
//! let machine = Machine::parse("slide.ron", r#"Machine(
//!     name: "slide", units: (length: mm, angle: deg),
//!     workpiece: [(frame: "w")],
//!     tool: [(frame: "x", joint: Prismatic(axis: "x", travel: (0, 500))), (frame: "t", at: (0, 0, 80))],
//! )"#)?;
//! let csv = "# measurement: position\nx[mm],px[mm],py[mm],pz[mm]\n\
//!            0,0.001,0.000,80.000\n200,200.001,0.001,79.980\n400,399.999,0.000,79.960\n";
//! let recordings = [Recording::from_bytes("slide.csv", csv.as_bytes(), &machine)?];
//! let arena =
//!     Arena { machine: &machine, fit_on: &recordings, judge_on: &[], truth: None, fit_setup: false };
//! let scheme = |step| Rival::Scheme(Scheme { form: Form::Tangent, step, steps: 20 });
//! let truncated = arena.judge("tangent", &scheme(Step::Truncated { cut: 1e-6, unit_m: 1.0 }))?;
//! assert!(truncated.judged.and_then(|r| r.mean.m).expect("it was fitted") < 2e-6);
//! // A position sees 5 of the 18 numbers of this model: plain normal equations cannot be solved.
//! assert!(arena.judge("tangent, plain", &scheme(Step::GaussNewton))?.failed.is_some());
//! # Ok::<(), kincal::Error>(())
//! ```

mod compare;
mod form;
mod judge;
mod kalman;
mod scheme;
mod state;
mod step;

pub use compare::{Arena, Verdict, split};
pub use form::Form;
pub use judge::{AgainstTruth, Residuals, against_truth, residuals};
pub use kalman::{Kalman, KalmanOptions, Stream, Update};
pub use scheme::Scheme;
pub use step::Step;

use crate::calibration::CalibratedMachine;
use crate::error::Result;
use crate::feature::Feature;
use crate::identify::{CalibrateOptions, ErrorModel, Loss, Solver, Stop, calibrate, calibrate_model};
use crate::lie::Twist;
use crate::machine::{JointKind, Machine};
use crate::recording::Recording;
use crate::variation::{Directions, MOST_AXES, Part, Slot, Term, Varying};

/// A way to identify a machine.
#[derive(Clone, Copy, Debug)]
pub enum Rival {
    /// The machine as declared; nothing is fitted.
    Declared,
    /// The local model with one of its own solvers, as `kincal calibrate` runs it.
    Local(CalibrateOptions),
    /// A scheme of the literature.
    Scheme(Scheme),
    /// The local model with explicit backlash of every rotary axis: one coefficient along its joint, flipping with its direction.
    Backlash(CalibrateOptions),
    /// A local model for each pattern of directions of the rotary axes.
    Pieces(CalibrateOptions),
    /// The local model by an extended Kalman filter, sample by sample in the order of the recordings.
    Kalman(KalmanOptions),
}

/// What a rival found.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The machine.
    pub calibrated: CalibratedMachine,
    /// Steps taken; of a filter, samples.
    pub steps: usize,
    /// Why it stopped.
    pub stop: Stop,
}

/// Numbers that the named rivals take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Of fixed damping, relative to the largest diagonal element.
    pub tau: f64,
    /// Of truncation, relative to the largest singular value.
    pub cut: f64,
    /// Steps at most.
    pub steps: usize,
}

impl Default for Tuning {
    fn default() -> Self {
        Tuning { tau: 1e-3, cut: 1e-3, steps: 30 }
    }
}

impl Rival {
    /// Every rival that has a name, in the order in which `kincal compare` lists them.
    pub fn named(tuning: Tuning) -> Vec<(&'static str, Rival)> {
        let Tuning { tau, cut, steps } = tuning;
        let local = |solver| Rival::Local(CalibrateOptions { solver, loss: Loss::Squares, prior: false });
        let scheme = |form, step| Rival::Scheme(Scheme { form, step, steps });
        let (damped, truncated) = (Step::Damped { tau }, Step::Truncated { cut, unit_m: 1.0 });
        vec![
            ("declared", Rival::Declared),
            ("local", Rival::Local(CalibrateOptions::default())),
            ("local-gauss-newton", local(Solver::GaussNewton)),
            ("local-damped", local(Solver::FixedDamping { tau, steps })),
            ("local-truncated", local(Solver::RankTruncation { cut })),
            ("factors-damped", scheme(Form::Factors, damped)),
            ("factors-truncated", scheme(Form::Factors, truncated)),
            ("tangent-damped", scheme(Form::Tangent, damped)),
            ("tangent-truncated", scheme(Form::Tangent, truncated)),
            ("free-damped", scheme(Form::Free, damped)),
            ("free-truncated", scheme(Form::Free, truncated)),
            ("backlash", Rival::Backlash(CalibrateOptions::default())),
            ("pieces", Rival::Pieces(CalibrateOptions::default())),
            ("kalman", Rival::Kalman(KalmanOptions::default())),
        ]
    }

    /// Identifies `machine` from recordings.
    ///
    /// # Errors
    /// If a recording cannot be read; [`crate::Error::Undetermined`] where the scheme fails on these data.
    pub fn fit(&self, machine: &Machine, recordings: &[Recording]) -> Result<Fitted> {
        match self {
            Rival::Declared => {
                let calibrated = state::declared(machine, recordings)?;
                Ok(Fitted { calibrated, steps: 0, stop: Stop::Converged })
            }
            Rival::Local(options) => {
                let (calibrated, fit) = calibrate(machine, recordings, *options)?;
                Ok(Fitted { calibrated, steps: fit.steps, stop: fit.stop })
            }
            Rival::Backlash(options) => varying(machine, recordings, backlash(machine), *options),
            Rival::Pieces(options) => varying(machine, recordings, pieces(machine), *options),
            Rival::Scheme(scheme) => scheme.fit(machine, recordings),
            Rival::Kalman(options) => kalman::fit(machine, recordings, *options),
        }
    }
}

fn varying(
    machine: &Machine,
    recordings: &[Recording],
    varying: Varying,
    options: CalibrateOptions,
) -> Result<Fitted> {
    let model = ErrorModel { varying, ..ErrorModel::default() };
    let (calibrated, fit) = calibrate_model(machine, recordings, &model, options, &|_| {})?;
    Ok(Fitted { calibrated, steps: fit.steps, stop: fit.stop })
}

/// Dyads of the rotary joints that have a command of their own, with that command.
fn rotary(machine: &Machine) -> Vec<(usize, usize)> {
    let command = |name: &str| machine.commands().iter().position(|c| c == name);
    let joints = machine.joints().filter(|(_, joint)| joint.kind == JointKind::Revolute);
    joints.filter_map(|(j, joint)| Some((j, command(&joint.name)?))).collect()
}

fn backlash(machine: &Machine) -> Varying {
    let term = |(j, _): (usize, usize)| {
        let direction = machine.dyads()[j].joint.as_ref().map_or(Twist::zero(0.0), |joint| joint.twist());
        let part = Part { slot: Slot::Before(j), direction, feature: Feature::half_direction(j) };
        Term { parts: vec![part], scale: machine.tolerance(j).rotation, prior: true, of_setup: false }
    };
    Varying { directions: None, terms: rotary(machine).into_iter().map(term).collect() }
}

fn pieces(machine: &Machine) -> Varying {
    let axes: Vec<usize> = rotary(machine).into_iter().map(|(_, c)| c).take(MOST_AXES).collect();
    Varying { directions: (!axes.is_empty()).then(|| Directions::new(axes)), terms: Vec::new() }
}
