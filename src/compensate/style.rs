//! How a program writes its numbers.

use std::borrow::Cow;

use super::control::Control;
use crate::nc::{Block, Dialect, Motion, Number, Units, Value, Word};

/// Most digits behind the point that are taken over from a program.
const MOST_DECIMALS: usize = 6;

/// The habits of a program as far as it has been read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Style {
    /// Digits behind the point as the user wants them.
    wanted: Option<usize>,
    /// Most digits behind the point so far, of lengths and of angles.
    decimals: [usize; 2],
    /// Whether the program writes decimal commas.
    comma: bool,
}

/// The number of a word.
pub(super) fn plain(word: &Word) -> Option<Number> {
    match word.value {
        Value::Number(number) => Some(number),
        Value::Expression => None,
    }
}

/// The number of the first axis word of a block: new words are written as it is.
pub(super) fn model_of(block: &Block, words: &[Option<usize>]) -> Option<Number> {
    words.iter().flatten().next().and_then(|w| plain(&block.words()[*w]))
}

impl Style {
    /// Nothing has been read. `wanted`: digits behind the point, where the user has said how many.
    pub fn new(wanted: Option<usize>) -> Self {
        Style { wanted, decimals: [0, 0], comma: false }
    }

    /// Takes the words of a block that moves into account.
    pub fn read(&mut self, block: &Block, motion: &Motion, control: &Control, dialect: Dialect) {
        self.comma |= dialect == Dialect::Heidenhain
            && block.words().iter().any(|word| block.text(&word.value_span).contains(','));
        for (axis, word) in control.axes().iter().zip(&motion.words) {
            if let Some(number) = word.and_then(|w| plain(&block.words()[w])) {
                let seen = &mut self.decimals[usize::from(axis.is_rotary())];
                *seen = (*seen).max(number.decimals.min(MOST_DECIMALS));
            }
        }
    }

    /// Lengths are written in another unit from here on.
    pub fn forget_lengths(&mut self) {
        self.decimals[0] = 0;
    }

    /// Digits behind the point for an axis.
    pub fn places(&self, control: &Control, axis: usize) -> usize {
        let rotary = control.axes()[axis].is_rotary();
        let least = if !rotary && control.units() == Units::Inch { 4 } else { 3 };
        self.wanted.unwrap_or_else(|| self.decimals[usize::from(rotary)].max(least))
    }

    /// With the decimal comma where the program has it.
    pub fn pointed<'t>(&self, text: &'t str) -> Cow<'t, str> {
        if self.comma { Cow::Owned(text.replace('.', ",")) } else { Cow::Borrowed(text) }
    }

    /// As [`Style::pointed`].
    pub fn pointed_ascii<'t>(&self, text: &'t [u8]) -> Cow<'t, [u8]> {
        let comma = |b: &u8| if *b == b'.' { b',' } else { *b };
        if self.comma { Cow::Owned(text.iter().map(comma).collect()) } else { Cow::Borrowed(text) }
    }

    /// A number for an axis as its neighbour `model` is written.
    pub fn like(&self, text: &str, model: Option<Number>, control: &Control, axis: usize) -> String {
        match (model, text.parse::<f64>()) {
            (Some(model), Ok(value)) => model.write_like(value, Some(self.places(control, axis))),
            _ => text.to_string(),
        }
    }
}
