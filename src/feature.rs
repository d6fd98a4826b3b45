//! Features: what a deviation depends on, as a number for each sample, `docs/effects.md`.
//!
//! | noun | is |
//! | --- | --- |
//! | [`Expression`] | the language, as it is written in RON; its units are checked by [`dimension_of`] |
//! | [`Feature`] | an expression bound to a machine and a place: what is evaluated |
//! | [`Samples`] | the columns that features see; [`Follow`] makes them beside the chunks of a recording |
//! | [`Memory`] | what features with history carry from one stretch of samples to the next |
//!
//! Features are evaluated column by column, over `f64` and over dual numbers, so that derivatives by their parameters come from
//! num-dual.

mod bind;
mod check;
mod dependence;
mod dimension;
mod evaluate;
mod express;
mod expression;
mod formula;
mod node;
mod samples;
mod walk;
mod weights;

pub use bind::{Binding, Feature, Unbound};
pub use check::{DimensionFault, Scope, dimension_of};
pub(crate) use dependence::Dependence;
pub use dimension::Dimension;
pub use evaluate::Memory;
pub use expression::Expression;
pub use samples::{Follow, FollowOptions, JointSamples, Samples, first_directions, samples_of};
pub(crate) use walk::Walk;
pub use weights::{as_seen_in, gravity_of};
