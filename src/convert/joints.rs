//! Which columns hold the commands of a machine's joints, and which what a reference reads of them.

use super::draft::Draft;
use super::heading::{Heading, Stated, words};
use super::target::quantity;
use crate::units::Quantity;

/// Words that say nothing about which joint it is.
const FILLING: [&str; 16] = [
    "q",
    "j",
    "joint",
    "joints",
    "axis",
    "ax",
    "achse",
    "theta",
    "pos",
    "position",
    "angle",
    "value",
    "state",
    "command",
    "coord",
    "coordinate",
];
/// Words for what was asked of a joint.
const COMMANDED: [&str; 14] = [
    "cmd",
    "command",
    "commanded",
    "target",
    "set",
    "setpoint",
    "soll",
    "nominal",
    "nom",
    "ref",
    "reference",
    "des",
    "desired",
    "demand",
];
/// Words for what was read of it.
const READ: [&str; 14] = [
    "act",
    "actual",
    "meas",
    "measured",
    "ist",
    "fbk",
    "feedback",
    "enc",
    "encoder",
    "resolver",
    "laser",
    "interferometer",
    "reading",
    "measurement",
];

pub(super) fn is_commanded(heading: &Heading) -> bool {
    heading.words.iter().any(|word| COMMANDED.contains(&word.as_str()))
}

pub(super) fn is_read(heading: &Heading) -> bool {
    heading.words.iter().any(|word| READ.contains(&word.as_str()))
}

/// What is left of a name without the words that say nothing.
fn kernel(words: &[String], without: &[&[&str]]) -> String {
    let filled = |word: &&String| !without.iter().any(|list| list.contains(&word.as_str()));
    words.iter().filter(filled).map(String::as_str).collect()
}

/// How well a heading names a joint: 0 by its very name, 1 by the words that count, 2 by the number of an axis.
fn rank(heading: &Heading, joint: &str, without: &[&[&str]]) -> Option<u8> {
    let own = words(joint);
    if heading.name == joint {
        return Some(0);
    }
    if heading.words.concat() == own.concat() {
        return Some(1);
    }
    let (found, wanted) = (kernel(&heading.words, without), kernel(&own, &[&FILLING]));
    if wanted.is_empty() || found.is_empty() {
        return None;
    }
    if found == wanted {
        return Some(2);
    }
    // `A1` is the first axis of a machine whose joints are numbered.
    let numbered = wanted.bytes().all(|b| b.is_ascii_digit());
    (numbered && found == format!("a{wanted}")).then_some(3)
}

/// Columns that name this joint best.
fn candidates(draft: &Draft, joint: &str, read: bool) -> Vec<usize> {
    let quantity = quantity(joint, Some(draft.machine));
    let without: &[&[&str]] = if read { &[&FILLING, &READ] } else { &[&FILLING, &COMMANDED] };
    let ranked: Vec<(u8, usize)> = draft
        .free(quantity)
        .into_iter()
        .filter(|i| is_read(&draft.table.headings[*i]) == read)
        .filter_map(|i| Some((rank(&draft.table.headings[i], joint, without)?, i)))
        .collect();
    let best = ranked.iter().map(|(rank, _)| *rank).min();
    if best.is_none() {
        // Its very name with a unit that does not fit is a question of the unit, and its number with one that nobody knows.
        let is_odd = |i: &usize| {
            let heading = &draft.table.headings[*i];
            let far = if matches!(heading.unit, Stated::Other(_)) { 3 } else { 2 };
            is_read(heading) == read && rank(heading, joint, without).is_some_and(|rank| rank < far)
        };
        let odd: Vec<usize> = draft.free(None).into_iter().filter(is_odd).collect();
        if odd.len() == 1 {
            return odd;
        }
    }
    if best.is_none() && draft.machine.commands().len() == 1 {
        // Of a machine with one joint, `target [mm]` and `resolver [mm]` need not say which.
        let of_none = |i: &usize| {
            let heading = &draft.table.headings[*i];
            let said = if read { is_read(heading) } else { is_commanded(heading) && !is_read(heading) };
            said && kernel(&heading.words, without).is_empty()
        };
        return draft.free(quantity).into_iter().filter(of_none).collect();
    }
    ranked.into_iter().filter(|(rank, _)| Some(*rank) == best).map(|(_, i)| i).collect()
}

/// Takes the commands; what is not found is asked.
pub(super) fn commands(draft: &mut Draft) {
    let missing = found(draft);
    ask(draft, &missing);
}

/// Takes the commands and their directions of approach; the joints that no column names.
pub(super) fn found(draft: &mut Draft) -> Vec<String> {
    let mut missing: Vec<String> = Vec::new();
    for joint in draft.machine.commands().to_vec() {
        let is_fixed = |line: &String| {
            let key = line.trim_start_matches(['#', ' ']).split(['[', ':']).next().unwrap_or_default().trim();
            key.strip_prefix("fixed").is_some_and(|name| name.trim() == joint)
        };
        if draft.has(&joint) || draft.map.head.iter().any(is_fixed) {
            continue;
        }
        let mut found = candidates(draft, &joint, false);
        if found.len() > 1 {
            // Recordings hold what was commanded: a column that says so stands before one that does not.
            let said: Vec<usize> =
                found.iter().copied().filter(|i| is_commanded(&draft.table.headings[*i])).collect();
            found = if said.len() == 1 { said } else { found };
        }
        match found[..] {
            [column] => draft.take(&joint, column, None),
            [] => missing.push(joint),
            _ => {
                let what = format!("column of joint `{joint}`: {} may be it", draft.named(&found));
                draft.ask(what, format!("--column '{joint}=NAME'"));
            }
        }
    }
    for joint in draft.machine.commands().to_vec() {
        let to = format!("{joint}_direction");
        let by_name = |i: &usize| {
            let of = &draft.table.headings[*i].words;
            let is_sense = ["direction", "dir", "approach"].iter().any(|w| of.iter().any(|own| own == w));
            let rest: Vec<String> = of
                .iter()
                .filter(|w| !["direction", "dir", "approach"].contains(&w.as_str()))
                .cloned()
                .collect();
            let alone = rest.is_empty() && draft.machine.commands().len() == 1;
            is_sense && (alone || kernel(&rest, &[&FILLING]) == kernel(&words(&joint), &[&FILLING]))
        };
        let found: Vec<usize> = draft.free(None).into_iter().filter(by_name).collect();
        if let ([column], false) = (&found[..], draft.has(&to)) {
            draft.take(&to, *column, None);
        }
    }
    missing
}

/// Asks for the joints whose names no column has.
pub(super) fn ask(draft: &mut Draft, missing: &[String]) {
    let Some(first) = missing.first() else { return };
    let kind = quantity(first, Some(draft.machine));
    let unit = if kind == Some(Quantity::Angle) { "deg" } else { "mm" };
    let stem = first.trim_end_matches(|c: char| c.is_ascii_digit());
    let numbered = missing.len() > 1 && missing.iter().all(|joint| joint.starts_with(stem));
    let all = if numbered { format!(", all at once --column '{stem}*=NAME*'") } else { String::new() };
    let names: Vec<String> = missing.iter().map(|joint| format!("`{joint}`")).collect();
    let (one, have) = if missing.len() == 1 {
        ("column of joint", "none has its name")
    } else {
        ("columns of joints", "none has their names")
    };
    let kinds = missing.iter().map(|joint| quantity(joint, Some(draft.machine)));
    let free: Vec<usize> = kinds
        .flat_map(|kind| draft.free(kind))
        .collect::<std::collections::BTreeSet<_>>()
        .into_iter()
        .collect();
    let what = format!("{one} {}: {have}; columns without a part: {}", names.join(", "), draft.named(&free));
    let tell =
        format!("--column '{first}=NAME'{all}, or of what stood still --head 'fixed {first}[{unit}]: 0'");
    draft.ask(what, tell);
}

/// Joints with the columns that a reference may have been read into.
pub(super) fn read(draft: &Draft) -> Vec<(String, Vec<usize>)> {
    let of = |joint: &String| (joint.clone(), candidates(draft, joint, true));
    draft.machine.commands().iter().map(of).filter(|(_, found)| !found.is_empty()).collect()
}
