//! Recordings of machines whose errors are known.
//!
//! | room | noun |
//! | --- | --- |
//! | [`Faults`] | what is wrong with a machine, from RON |
//! | [`Plant`] | the machine with all that, and the deviations that hold at a sample |
//! | [`Course`] | what it is commanded to do: [`Turning`] (tests over an angle), [`RandomPoses`], [`PartProgram`], [`CommandTable`] |
//! | [`Instrument`] | what is read, with noise, resolution and drop-outs |
//! | [`Recorder`] | the recording as it is written |
//!
//! A [`Session`] puts them together; `docs/simulate.md` teaches `kincal simulate`.

mod all_axes;
mod commands;
mod cone;
mod course;
mod faults;
mod follow;
mod instrument;
mod part_program;
mod plant;
mod poses;
mod profile;
mod program_out;
mod record;
mod segment;
mod standard;
mod turning;
mod turns;

use std::fmt::Write as _;
use std::io::Write;

use rand::SeedableRng;
use rand::rngs::StdRng;

use crate::calibration::CalibratedMachine;
use crate::check::random_command;
use crate::error::Result;
use crate::lie::Twist;
use crate::machine::Machine;

inner! {
    use commands::CommandTable;
    use cone::cone;
    use course::{At, Course, Sample, Samples};
    use faults::Width;
    use instrument::noise_of;
    use part_program::{Drive, PartProgram};
    use plant::State;
    use poses::RandomPoses;
    use profile::{Leg, Pace, Profile, ticks};
    use program_out::write_program;
    use record::{Claims, Recorder, Style, Written};
    use standard::{Family, Standard};
    use turning::{Balls, Figure, Pointing, Rounding, Turning, Wave};
    use turns::{Sense, Turns, plane_across, plane_of_axes, rest, usual_range};
}
pub use faults::Faults;
pub use instrument::{Instrument, Scatter};
pub use plant::Plant;

use instrument::normal;

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
    pub fn beginning_at(mut self, seconds: f64) -> Self {
        self.later = seconds;
        self
    }

    /// Writes the next recording; `None` behind the last one. `each` is told of every sample.
    ///
    /// # Errors
    /// Those of the course, [`Error::Motion`](crate::Error::Motion) beyond travel, those of the output.
    pub fn record(&mut self, out: &mut dyn Write, mut each: impl FnMut(&Sample)) -> Result<Option<Written>> {
        let Some(run) = self.runs.get(self.next) else { return Ok(None) };
        let mut recorder = Recorder::new(self.plant.machine(), &run.instrument, self.style, run.directions);
        out.write_all(recorder.head(&run.claims).as_bytes()).map_err(|e| crate::error::Error::file("", e))?;
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

/// Deviations of every dyad drawn from the machine's tolerances (normal), times `size`.
pub fn random_deviations(machine: &Machine, size: f64, seed: u64) -> Vec<Twist<f64>> {
    let mut rng = StdRng::seed_from_u64(seed);
    (0..machine.dyads().len())
        .map(|j| Twist::from_array(machine.tolerance(j).to_array().map(|t| size * t * normal(&mut rng))))
        .collect()
}

/// Random commands within the limits of every joint.
pub fn random_commands(machine: &Machine, count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = StdRng::seed_from_u64(seed);
    let one =
        |rng: &mut StdRng| (0..machine.commands().len()).map(|c| random_command(machine, c, rng)).collect();
    (0..count).map(|_| one(&mut rng)).collect()
}

/// A recording of `machine` in the form that kincal reads, in m and rad; `extra_header` goes in as it is, one line each.
///
/// The short way for tests: the header says nothing of the instrument but its kind, and samples follow each other by 10 ms.
pub fn recording(
    machine: &CalibratedMachine,
    instrument: &Instrument,
    commands: &[Vec<f64>],
    extra_header: &[String],
    seed: u64,
) -> String {
    recording_of(&Plant::new(machine), instrument, commands, extra_header, seed)
}

/// As [`recording`], of a machine with all that is wrong with it: play remembers from sample to sample.
pub fn recording_of(
    plant: &Plant,
    instrument: &Instrument,
    commands: &[Vec<f64>],
    extra_header: &[String],
    seed: u64,
) -> String {
    let (nominal, style) = (plant.machine(), Style::si());
    let at = |(k, q): (usize, &Vec<f64>)| Sample {
        time: k as f64 * 0.01,
        q: q.clone(),
        directions: None,
        recorded: true,
        at: At::Pose(k + 1),
    };
    let first = plant.first_directions(commands.iter().enumerate().map(at).map(Ok));
    let mut state = plant.start(first.unwrap_or_default());
    let mut rng = StdRng::seed_from_u64(seed);
    // The points are the caller's to tell.
    let silent = Instrument::new(instrument.sensor.clone(), 0.0, 0.0);
    let head = Recorder::new(nominal, &silent, &style, false).head(&Claims::default());
    let mut text = String::new();
    for line in head.lines().filter(|line| !line.starts_with("# nominal_length")) {
        if !line.starts_with('#') {
            extra_header.iter().for_each(|extra| {
                let _ = writeln!(text, "# {extra}");
            });
        }
        let _ = writeln!(text, "{line}");
    }
    for (k, q) in commands.iter().enumerate() {
        let sample = at((k, q));
        plant.advance(&mut state, &sample);
        let _ = write!(text, "{:.3}", sample.time);
        q.iter().for_each(|x| {
            let _ = write!(text, ",{x:.17}");
        });
        match instrument.read(nominal, &state, q, &mut rng) {
            Some(values) => values.iter().for_each(|x| {
                let _ = write!(text, ",{x:.17}");
            }),
            None => text.push_str(&",".repeat(instrument.sensor.reading_count())),
        }
        text.push('\n');
    }
    text
}
