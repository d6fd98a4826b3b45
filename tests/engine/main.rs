//! Identification and diagnosis: what was simulated is found again, and said to be unknown where it cannot be.

#[path = "../common/mod.rs"]
mod common;
// Recordings of real machines and tables of other programs, which stand beside the project and not in it. One program with the others, since
// each is linked with the whole library.
#[path = "../real/mod.rs"]
mod data_sets;
#[path = "../blind/mod.rs"]
mod harness;

mod alignment;
mod alike;
mod bad_recordings;
mod blind;
mod concealment;
mod curves;
mod directions;
mod drives;
mod effects_compensated;
mod entered;
mod error_motions;
mod instrument_noise;
mod location;
mod machinist;
mod mistakes;
mod mounted;
mod names;
mod paper;
mod pieces;
mod proposals;
mod recovery;
mod resolvers;
mod rivals;
mod set_ups;
mod settled;
mod shown_by_one;
mod side_branches;
mod smooth_misfit;
mod standing_still;
mod table;
mod told_as_one;
mod waves;
