//! Recordings and machines that do not belong together, and the mistake that would explain it, `docs/reliability.md`.
//!
//! A mistake is a [`Change`]: data that say what to do to a recording, so that it reads as it would have without the mistake. All of them
//! are tried on a thinned copy of the recordings with the machine as declared. One is named only if it makes them plausible, and is
//! better than all others by far.

mod apart;
mod change;
mod list;
mod moved;
mod nonsense;
mod odd;
mod others;
mod rows;
mod search;
mod thinned;
mod undone;
mod unsettled;

pub use change::Change;
pub use moved::Moved;
pub use nonsense::{Apart, LikelyMistake, Nonsense};
pub use odd::{Odd, odd};
pub use search::{nonsense, search};
pub use unsettled::Unsettled;
