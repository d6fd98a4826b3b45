//! NC programs: read block by block, followed through their modal state, written back with other numbers in some words.
//!
//! A program is a stream of lines ([`Program`]); memory does not grow with it. A line is a [`Block`] of [`Token`]s, each with
//! its bytes in the line, so that a replaced number leaves every other byte as it was, and a program without a replacement
//! is written byte for byte. [`State`] follows what stays in force from block to block and tells where a block moves.
//!
//! **Units.** Every number here is in programmed units (mm or inch, deg), absolute or incremental as the program says.
//! Nothing is converted: [`Modes::units`] and [`Modes::distance`] say what is in force.
//!
//! **What is not done.** Nothing is evaluated: variables, macros, loops, sub-programs, cycles, frames. What depends on them is
//! told as such ([`Value::Expression`], [`Coordinate::Lost`], [`Step`]) and never guessed.
//!
//! ```
//! use kincal::nc::{Program, State};
//!
//! let source = "N10 G1 X-1.5 Z-.009 (down) F200\nN20 Y=2.\n";
//! let mut program = Program::new("part.nc", source.as_bytes())?;
//! let mut state = State::new(program.dialect(), ["X", "Y", "Z"]);
//! let mut out = Vec::new();
//! while let Some(mut block) = program.next_block()? {
//!     let step = state.apply(&block)?;
//!     let motion = step.motion.expect("both blocks move");
//!     if let Some(word) = motion.words[2] {
//!         let text = block.words()[word].write_like(-0.0123, Some(4));
//!         block.replace(word, &text)?;
//!     }
//!     block.write_to(&mut out)?;
//! }
//! assert_eq!(out, b"N10 G1 X-1.5 Z-.0123 (down) F200\nN20 Y=2.\n");
//! assert_eq!(state.target(), [Some(-1.5), Some(2.0), Some(-0.009)]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

// In the order in which they are imported, earliest first; a paragraph is a layer whose files do not import each other.

mod dialect;
mod fault;
mod modes;
mod token;

mod vocabulary;

mod dialects;

// A line and its pieces.
mod address;
mod codes;
mod number;

mod line;
mod words;

mod cut;

mod block;

// A program as a stream of lines.
mod signature;

mod program;

// What stays in force from block to block.
mod axes;
mod unfollowed;

mod motion;

mod effects;

mod state;

pub use address::Address;
pub use block::Block;
pub use dialect::Dialect;
pub use fault::NcFault;
pub use modes::{Coordinate, Distance, Feed, Modes, MotionKind, Plane, Units, Why};
pub use motion::{Motion, Step};
pub use number::Number;
pub use program::{LONGEST_LINE, Program};
pub use state::State;
pub use token::{Kind, Token};
pub use unfollowed::{Unfollowed, Unknown};
pub use words::{How, Value, Word};
