//! Recordings of real machines and tables of other programs, which stand beside the project and not in it.

#[path = "../common/mod.rs"]
mod common;

mod data_sets;
