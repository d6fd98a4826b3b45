//! How much of recordings a command keeps in memory.

use crate::recording::{Memory, Recording};

#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Keep {
    /// Keep so much of recordings in memory; samples beyond it go to a file in the system's folder for temporary files until the end
    #[arg(long, value_name = "MB", default_value_t = 128)]
    memory: usize,
}

impl Keep {
    /// Recordings of one call share the room.
    pub fn within(&self, recordings: Vec<Recording>) -> Vec<Recording> {
        let memory = Memory::of_megabytes(self.memory);
        recordings.into_iter().map(|recording| recording.within(&memory)).collect()
    }
}
