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
//! [`recording_of`] is the short way to a recording: an instrument reads a plant at given commands. Inside the crate a [`Session`] runs
//! courses on one clock. `docs/simulate.md` teaches `kincal simulate`, which has them all.

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
mod session;
mod standard;
mod turning;
mod turns;

use std::fmt::Write as _;

use rand::SeedableRng;
use rand::rngs::StdRng;

use crate::calibration::CalibratedMachine;
use crate::check::random_command;
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
    use session::{Run, Session, recordings};
    use standard::{Family, Standard};
    use turning::{Balls, Figure, Pointing, Rounding, Turning, Wave};
    use turns::{Sense, Turns, plane_across, plane_of_axes, rest, usual_range};
}
pub use faults::Faults;
pub(crate) use follow::follow;
pub use instrument::{Instrument, Scatter};
pub use plant::Plant;

use instrument::normal;

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
/// The header says nothing of the instrument but its kind, and samples follow each other by 10 ms.
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
