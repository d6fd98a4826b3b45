//! The numbers of the paper and of the checks made of it (`docs/paper.md`): what holds, to a stated band, and what does not.
//!
//! Twenty seeds everywhere; `cargo test --release --test engine paper -- --nocapture` prints every table beside theirs. Positions and distance
//! rows of the golden files are compared in `tests/real`.

mod columns;
mod reference;
mod sight;
mod solvers;
mod tables;
