//! An identification whose samples are elsewhere: what its passes have brought is laid before it again, in order, until it asks for more.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::loss::Loss;
use crate::error::{Error, Result};
use crate::lie::{Mat3, Pose, Twist, Vec3};

/// A state that sums are asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct State {
    pub dh: Vec<Twist<f64>>,
    /// Pose of `w` in the frame before it, its deviation, whether it is found from nothing.
    pub setups: Vec<(Pose<f64>, Twist<f64>, bool)>,
    pub tool_points: Vec<Vec3<f64>>,
    pub zeros: Vec<f64>,
    pub lengths: Vec<f64>,
    pub tool_rotations: Vec<Mat3<f64>>,
}

/// What the next pass over the samples is for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Request {
    /// Normal equations, with the noise of each recording: of lengths, m, and of angles, rad.
    Sums { at: State, noise: Vec<[f64; 2]>, loss: Loss },
    /// How large residuals are beside what could be true.
    Plausibility { at: State },
}

/// What the samples of one recording answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Answer {
    Sums(Option<PartForm>),
    Plausibility(Vec<Size>),
}

/// A recording's name, whether it is about angles, and what is left, foretold and moved, m or rad.
pub(crate) type Size = (String, bool, [f64; 3]);

/// Sums as they are written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct PartForm {
    /// By piece the matrix on and below the diagonal, row by row, and the gradient.
    pub pieces: Vec<Option<(Vec<f64>, Vec<f64>)>>,
    pub loss: f64,
    pub samples: u64,
    pub down_weighted: u64,
    /// Of lengths and of angles: rows, their squares, the same of those that count.
    pub residuals: [(u64, f64, u64, f64); 2],
}

/// Commands and readings of a few samples spread over a recording, m and rad.
pub(crate) type Spread = Vec<(Vec<f64>, Vec<f64>)>;

/// The answers of all recordings, in the order in which they were asked for.
#[derive(Debug)]
pub(crate) struct Replay {
    /// By recording commands and readings of a few samples.
    pub thin: Vec<Spread>,
    /// By recording.
    answers: Vec<Vec<Answer>>,
    next: AtomicUsize,
    wanted: Mutex<Option<Request>>,
}

impl Replay {
    pub(super) fn new(thin: Vec<Spread>, answers: Vec<Vec<Answer>>) -> Self {
        Replay { thin, answers, next: AtomicUsize::new(0), wanted: Mutex::new(None) }
    }

    /// What has been asked for in vain.
    pub(super) fn wanted(&self) -> Option<Request> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The next answer of every recording; without one the identification ends here.
    fn next<T>(&self, request: Request, of: impl Fn(&Answer) -> Option<T>) -> Result<Vec<T>> {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        let answers = self.answers.iter().map(|own| own.get(number).and_then(&of));
        answers.collect::<Option<Vec<T>>>().ok_or_else(|| {
            *self.wanted.lock().unwrap_or_else(PoisonError::into_inner) = Some(request);
            Error::Undetermined { what: "another round is needed".into(), mend: String::new() }
        })
    }

    pub fn sums(&self, at: State, noise: Vec<[f64; 2]>, loss: Loss) -> Result<Vec<Option<PartForm>>> {
        self.next(Request::Sums { at, noise, loss }, |answer| match answer {
            Answer::Sums(form) => Some(form.clone()),
            Answer::Plausibility(_) => None,
        })
    }

    pub fn plausibility(&self, at: State) -> Result<Vec<Size>> {
        let of = |answer: &Answer| match answer {
            Answer::Plausibility(own) => Some(own.clone()),
            Answer::Sums(_) => None,
        };
        Ok(self.next(Request::Plausibility { at }, of)?.into_iter().flatten().collect())
    }
}
