//! Identification and diagnosis: what was simulated is found again, and said to be unknown where it cannot be.

#[path = "../common/mod.rs"]
mod common;
#[path = "../blind/mod.rs"]
mod harness;

mod alignment;
mod bad_recordings;
mod blind;
mod concealment;
mod curves;
mod directions;
mod effects_compensated;
mod error_motions;
mod instrument_noise;
mod location;
mod machinist;
mod mistakes;
mod mounted;
mod names;
mod paper;
mod pieces;
mod recovery;
mod resolvers;
mod rivals;
mod set_ups;
mod side_branches;
mod standing_still;
mod table;
mod told_as_one;
mod waves;
