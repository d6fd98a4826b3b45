//! Consecutive samples with all that a model may depend on.

use std::sync::Arc;

use crate::error::Result;
use crate::feature::{Feature, Follow, FollowOptions, Memory, first_directions, gravity_of};
use crate::lie::Vec3;
use crate::machine::Machine;
use crate::motion::{FirstDirections, Motion, Tracker};
use crate::recording::{Chunk, Recording};
use crate::variation::Varying;

/// Samples, their directions of travel, and the values of all features.
#[derive(Debug)]
pub(crate) struct Stretch {
    pub chunk: Arc<Chunk>,
    /// Empty where nothing depends on directions.
    pub motion: Motion,
    /// One column for each part of each term, in their order.
    pub features: Vec<Vec<f64>>,
    /// Commands of a row.
    pub commands: usize,
}

impl Stretch {
    /// Samples of a model that nothing varies in.
    pub fn plain(chunk: Arc<Chunk>, commands: usize) -> Stretch {
        Stretch { chunk, motion: Motion::default(), features: Vec::new(), commands }
    }

    /// Directions of travel of all commands at sample `k`; empty where nothing depends on them.
    #[inline]
    pub fn directions(&self, k: usize) -> &[i8] {
        self.motion.directions.get(k * self.commands..(k + 1) * self.commands).unwrap_or_default()
    }

    /// Commands at sample `k`, m or rad.
    #[inline]
    pub fn q(&self, k: usize) -> &[f64] {
        &self.chunk.commands[k * self.commands..(k + 1) * self.commands]
    }

    /// Only the samples on these lines.
    pub fn chosen(&self, on: impl Fn(u64) -> bool) -> Stretch {
        let kept: Vec<usize> = (0..self.chunk.len).filter(|k| on(self.chunk.lines[*k])).collect();
        let column = |column: &Vec<f64>| kept.iter().map(|k| column[*k]).collect();
        Stretch {
            chunk: Arc::new(self.chunk.chosen(&kept)),
            motion: self.motion.chosen(self.commands, &kept),
            features: self.features.iter().map(column).collect(),
            commands: self.commands,
        }
    }
}

/// How the path of one recording begins, and in which direction things weigh.
#[derive(Clone, Debug)]
pub(crate) struct Beginning {
    /// Directions of the first motion by command.
    commands: Vec<i8>,
    /// By dyad, the directions in which joints came before they move: those of the first motion, if nobody says otherwise; empty where there
    /// are no features.
    dyads: Vec<i8>,
    /// Direction of gravity in the base frame, where it is not that of the machine file.
    pub gravity_b: Option<Vec3<f64>>,
}

impl Beginning {
    /// Looks into the recording until every joint has moved.
    pub fn of(
        recording: &Recording,
        machine: &Machine,
        varying: &Varying,
        dead_bands: &[f64],
    ) -> Result<Self> {
        let mut first = FirstDirections::new(dead_bands.to_vec());
        for chunk in recording.chunks()? {
            if first.look(&chunk?) {
                break;
            }
        }
        let dyads = if varying.terms.is_empty() {
            Vec::new()
        } else {
            first_directions(machine, &by_dyad(machine, dead_bands), recording.chunks()?)?
        };
        Ok(Beginning { commands: first.found(), dyads, gravity_b: gravity_of(recording, machine, None) })
    }

    /// Until the joint of dyad `j` moves, if ever, its features are those behind a motion in this direction.
    pub fn approach(&mut self, j: usize, direction: i8) {
        if let Some(came) = self.dyads.get_mut(j) {
            *came = direction;
        }
    }
}

/// Dead bands of the joints of all dyads from those of the commands.
pub(crate) fn by_dyad(machine: &Machine, dead_bands: &[f64]) -> Vec<f64> {
    let band = |j: usize| {
        let terms = machine.drive(j).map_or(&[][..], |drive| &drive.terms);
        terms.iter().map(|(c, factor)| factor.abs() * dead_bands[*c]).fold(0.0, f64::max)
    };
    (0..machine.dyads().len()).map(band).collect()
}

/// What features remember from stretch to stretch, and from recording to recording.
pub(crate) struct Memories(Vec<Memory<f64>>);

impl Memories {
    pub fn new(varying: &Varying) -> Self {
        Memories(varying.features().map(Memory::new).collect())
    }
}

/// The stretches of a recording in their order; where nothing varies, chunks alone.
pub(crate) fn stretches<'a>(
    recording: &'a Recording,
    machine: &'a Machine,
    varying: &'a Varying,
    dead_bands: &[f64],
    beginning: Option<&Beginning>,
    pause_after: Option<f64>,
    memories: &'a mut Memories,
) -> Result<Box<dyn Iterator<Item = Result<Stretch>> + 'a>> {
    let commands = machine.commands().len();
    let chunks = recording.shared_chunks()?;
    let Some(beginning) = beginning else {
        return Ok(Box::new(chunks.map(move |chunk| Ok(Stretch::plain(chunk?, commands)))));
    };
    let mut tracker = Tracker::new(dead_bands.to_vec(), beginning.commands.clone());
    if varying.terms.is_empty() {
        return Ok(Box::new(chunks.map(move |chunk| {
            chunk.map(|chunk| {
                let motion = tracker.follow(&chunk);
                Stretch { chunk, motion, features: Vec::new(), commands }
            })
        })));
    }
    let options = FollowOptions {
        recording: recording.name().to_string(),
        dead_bands: by_dyad(machine, dead_bands),
        first_directions: beginning.dyads.clone(),
        pause_after: pause_after.unwrap_or(f64::INFINITY),
        gravity_b: beginning.gravity_b,
        channels: recording.extra_channels().iter().map(|c| c.name.clone()).collect(),
        with_gravity: varying.features().any(Feature::needs_gravity),
    };
    Ok(Box::new(Follow::new(machine, recording.chunks()?, &options).map(move |item| {
        item.map(|(chunk, samples)| {
            let features = (varying.features().zip(&mut memories.0))
                .map(|(feature, memory)| feature.column(&samples, &[], 1.0, memory))
                .collect();
            Stretch { motion: tracker.follow(&chunk), chunk: Arc::new(chunk), features, commands }
        })
    })))
}
