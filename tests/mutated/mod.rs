//! Mutated inputs: texts that users write, damaged at random, read and used as the program does. Each is accepted or refused with a message
//! and a mend, in time, and nothing panics. The same seed gives the same cases. Shared by a test and by `examples/mutated.rs`.
#![allow(dead_code)]

pub mod drive;
pub mod input;
pub mod mutation;
pub mod table;
pub mod tally;
pub mod words;
