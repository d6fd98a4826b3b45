//! The dialects, a file each: what is followed of them. Codes are in tenths, the underscore is their point: `54_1` is `G54.1`.

#![allow(clippy::inconsistent_digit_grouping)]

mod heidenhain;
mod rs274;
mod siemens;

use super::dialect::Dialect;
use super::vocabulary::Vocabulary;

/// The words of a dialect.
pub(super) fn vocabulary(dialect: Dialect) -> &'static Vocabulary {
    match dialect {
        Dialect::Rs274 => &rs274::VOCABULARY,
        Dialect::Siemens => &siemens::VOCABULARY,
        Dialect::Heidenhain => &heidenhain::VOCABULARY,
    }
}
