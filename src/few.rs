//! Columns that are short: a value for each joint, axis or command of one machine.

use smallvec::SmallVec;

/// As many as most machines have need no memory of their own.
pub(crate) type Few<T> = SmallVec<[T; 8]>;
