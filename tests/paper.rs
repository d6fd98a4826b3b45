//! The numbers of the paper and of the checks made of it (`docs/paper.md`): what holds, to a stated band, and what does not.
//!
//! Twenty seeds everywhere; `cargo test --release --test paper -- --nocapture` prints every table beside theirs. Positions and distance
//! rows of the golden files are compared in `peers.rs`.

mod common;

#[path = "paper/columns.rs"]
mod columns;
#[path = "paper/reference.rs"]
mod reference;
#[path = "paper/sight.rs"]
mod sight;
#[path = "paper/solvers.rs"]
mod solvers;
#[path = "paper/tables.rs"]
mod tables;
