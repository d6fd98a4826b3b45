//! Recordings of one call, made one after the other.

use std::io::Write;

use super::course::{Course, Sample};
use super::instrument::{Instrument, noise_of};
use super::plant::{Plant, State};
use super::record::{Claims, Recorder, Style, Written};
use crate::error::{Error, Result};

/// One recording of a call: what is run, and what is read meanwhile.
pub struct Run {
    /// The motion.
    pub course: Box<dyn Course>,
    /// The instrument.
    pub instrument: Instrument,
    /// What the header says.
    pub claims: Claims,
    /// Whether the course has settled positions with directions of approach.
    pub directions: bool,
}

/// Recordings of one call, made one after the other on one clock: play remembers across them.
pub struct Session<'a> {
    plant: &'a Plant,
    runs: &'a [Run],
    style: &'a Style,
    pause: f64,
    seed: u64,
    state: State,
    next: usize,
    later: f64,
}

impl<'a> Session<'a> {
    /// Looks where every joint moves first that has play or is keyed on its direction. `pause`: time between two recordings, s; `seed`: of the noise.
    ///
    /// # Errors
    /// Those of the courses and of [`Plant::first_directions`].
    pub fn new(plant: &'a Plant, runs: &'a [Run], style: &'a Style, pause: f64, seed: u64) -> Result<Self> {
        let all = runs.iter().map(|run| run.course.samples()).collect::<Result<Vec<_>>>()?;
        let state = plant.start(plant.first_directions(all.into_iter().flatten())?);
        Ok(Session { plant, runs, style, pause, seed, state, next: 0, later: 0.0 })
    }

    /// The same with a clock that begins so many seconds later.
    #[must_use]
    pub fn beginning_at(mut self, seconds: f64) -> Self {
        self.later = seconds;
        self
    }

    /// Writes the next recording; `None` behind the last one. `each` is told of every sample.
    ///
    /// # Errors
    /// Those of the course, [`Error::Motion`] beyond travel, those of the output.
    pub fn record(&mut self, out: &mut dyn Write, mut each: impl FnMut(&Sample)) -> Result<Option<Written>> {
        let Some(run) = self.runs.get(self.next) else { return Ok(None) };
        let mut recorder = Recorder::new(self.plant.machine(), &run.instrument, self.style, run.directions);
        out.write_all(recorder.head(&run.claims).as_bytes()).map_err(|e| Error::file("", e))?;
        let mut rng = noise_of(self.seed, self.next as u64);
        let mut last = 0.0;
        for sample in run.course.samples()? {
            let sample = sample?;
            recorder.take(self.plant, &mut self.state, &sample, self.later, &mut rng, out)?;
            each(&sample);
            last = sample.time;
        }
        // Each recording starts on a whole second.
        self.later = (self.later + last + self.pause).ceil();
        self.next += 1;
        Ok(Some(recorder.written().clone()))
    }
}

/// Recordings of one call as texts, a minute apart.
///
/// # Errors
/// As [`Session::record`].
pub fn recordings(plant: &Plant, runs: &[Run], style: &Style, seed: u64) -> Result<Vec<String>> {
    let mut session = Session::new(plant, runs, style, 60.0, seed)?;
    let mut texts = Vec::new();
    loop {
        let mut text = Vec::new();
        if session.record(&mut text, |_| ())?.is_none() {
            return Ok(texts);
        }
        texts.push(String::from_utf8_lossy(&text).into_owned());
    }
}
