//! Corrected numbers as words: in a block of the program, or on a line of their own.

use super::control::Control;
use super::corrector::AxisNumber;
use super::report::Report;
use super::style::{Style, model_of};
use crate::error::Result;
use crate::nc::{Block, Number};

/// Puts numbers into a block: in the place of those that stand there, as new words for axes that it does
/// not name. `words`: of the block, by axis.
pub(super) fn put_into(
    block: &mut Block,
    words: &[Option<usize>],
    numbers: &[AxisNumber],
    (style, control): (&Style, &Control),
    report: &mut Report,
) -> Result<()> {
    let model = model_of(block, words);
    for number in numbers {
        let axis = number.axis();
        if let Some(word) = words[axis] {
            block.replace_number(word, &style.pointed_ascii(number.ascii()))?;
            report.corrected_words += 1;
            continue;
        }
        let address = control.axes()[axis].address();
        let text = style.like(number.text(), model, control, axis);
        let text = style.pointed(&text);
        // Behind the nearest axis before it, else before the first one, else at the end.
        let before = words[..axis].iter().rev().flatten().next().copied();
        let behind = words[axis..].iter().flatten().next().copied();
        match (before, behind) {
            (Some(word), _) => block.insert(word, address, &text)?,
            (None, Some(word)) => block.insert_before(word, address, &text)?,
            (None, None) => match block.words().len().checked_sub(1) {
                Some(last) => block.insert(last, address, &text)?,
                None => continue,
            },
        }
        report.inserted_words += 1;
    }
    Ok(())
}

/// The words of a line of its own. `model`: how its neighbour is written.
pub(super) fn line(
    numbers: &[AxisNumber],
    model: Option<Number>,
    separator: &str,
    habits: (&Style, &Control),
) -> String {
    line_of(numbers, &vec![true; habits.1.axes().len()], model, separator, habits)
}

/// As [`line`], of these axes alone.
pub(super) fn line_of(
    numbers: &[AxisNumber],
    of: &[bool],
    model: Option<Number>,
    separator: &str,
    (style, control): (&Style, &Control),
) -> String {
    let mut sorted: Vec<&AxisNumber> = numbers.iter().filter(|n| of[n.axis()]).collect();
    sorted.sort_by_key(|n| n.axis());
    let words = sorted.into_iter().map(|number| {
        let address = control.axes()[number.axis()].address();
        let equals = if address.len() > 1 { "=" } else { "" };
        format!("{address}{equals}{}", style.like(number.text(), model, control, number.axis()))
    });
    words.collect::<Vec<_>>().join(separator)
}
