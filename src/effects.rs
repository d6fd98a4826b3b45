//! Effects: the physics that a kinematic model leaves out, as data, `docs/effects.md`.
//!
//! A [`Family`] is what the field has a name for: where it sits, in which directions of se(3) it moves things, and on which
//! features of the recording that depends. Families are entries of a RON text; [`Library::standard`] is the one that comes with the
//! crate, `src/effects/library.ron`, and [`Library::with_file`] adds or replaces families without any code. On a machine with
//! given recordings every family becomes [`Candidate`]s, one for each place: columns of a regression with everything resolved. A
//! candidate with its numbers is an [`Identified`] effect: sizes with their names and units, a sentence, and a RON text that needs no
//! library.

mod candidate;
mod directions;
mod facts;
mod family;
mod grid;
mod identified;
mod library;
mod place;
mod quantity;
mod scan;
mod soundness;
mod wave;
mod window;

inner! {
    use candidate::{Candidate, Candidates, Coefficient, Parameter, Skipped};
    use facts::RecordingFacts;
    use family::{Clock, Directions, Family, Grid, Less, LookAlike, Meaning, Output, ParameterForm, Partner, Pivot, Range, Seat, Size, Which};
    use identified::Identified;
    use place::Place;
    use quantity::in_words;
}
pub(crate) use facts::by_setup;
pub(crate) use grid::NO_TIME;
pub use identified::{SizeOf, StoredEffect, StoredPart, StoredSlot, StoredTerm};
pub use library::Library;
pub use soundness::LibraryFault;
