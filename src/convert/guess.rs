//! A map from what headings say, and from what the user says besides. Units, signs and conventions are never guessed.

use super::Request;
use super::draft::Draft;
use super::joints;
use super::map::Map;
use super::measured;
use super::moment::{self, Moment};
use super::plan::is_clock;
use super::table::{Found, Table};
use super::told;
use crate::error::{Error, Place, Result};
use crate::machine::Machine;
use crate::units::Quantity;

/// Numbers of this size, in s, count from 1970: the years 2001 to 2100.
const SINCE_1970: std::ops::Range<f64> = 9.7e8..4.2e9;

/// The map of a table and what was guessed; an error names all that has to be told.
pub(super) fn map(table: &Table, machine: &Machine, request: &Request) -> Result<(Map, Vec<String>)> {
    let mut draft = Draft::new(table, machine, request);
    draft.map.head.clone_from(&request.head);
    draft.map.rows.clone_from(&request.rows);
    draft.map.names.clone_from(&request.names);
    named(&mut draft)?;
    time(&mut draft);
    if request.path.is_none() {
        joints::commands(&mut draft);
    }
    measured::take(&mut draft);
    draft.map.euler = draft.map.euler.take().or_else(|| {
        let turned = draft.map.columns.iter().any(|part| part.to.starts_with("euler"));
        request.euler.clone().filter(|_| turned)
    });
    measured::channels(&mut draft);
    told::foreign(&mut draft);
    told::rotations(&mut draft);
    if table.separator.is_some() {
        draft.map.separator = table.separator.map(|s| s.word().to_string());
        draft.map.decimal = Some(if table.decimal_comma { "comma" } else { "point" }.into());
    }
    draft.told.push("signs and zeros are those of the table; `times` and `plus` in a map change them".into());
    draft.closed()
}

/// Columns that the user has named; a star stands for what differs between joints.
pub(super) fn named(draft: &mut Draft) -> Result<()> {
    for (to, from) in &draft.request.columns {
        let pairs: Vec<(String, String)> = match to.split_once('*') {
            Some((before, behind)) => {
                let part = |joint: &String| {
                    let inner = joint.strip_prefix(before)?.strip_suffix(behind)?.to_string();
                    Some((joint.clone(), from.replace('*', &inner)))
                };
                draft.machine.commands().iter().filter_map(part).collect()
            }
            None => vec![(to.clone(), from.clone())],
        };
        if pairs.is_empty() {
            let what = format!("--column '{to}={from}': no joint of the machine is called so");
            let mend = format!("name one of: {}", draft.machine.commands().join(", "));
            return Err(Error::mistake(Place::file(&draft.table.file), what, mend));
        }
        for (to, from) in pairs {
            match draft.table.column(&from) {
                Found::One(column) => draft.take(&to, column, None),
                found => {
                    let all: Vec<usize> = match found {
                        Found::Several(all) => all,
                        _ => (0..draft.table.headings.len()).collect(),
                    };
                    let what = format!("--column '{to}={from}': no column, or not one alone, is called so");
                    let numbers = all.iter().map(|i| format!("#{} `{}`", i + 1, draft.table.called(*i)));
                    let mend = format!("name one of: {}", numbers.take(40).collect::<Vec<_>>().join(", "));
                    return Err(Error::mistake(
                        Place::at(&draft.table.file, draft.table.line, 0),
                        what,
                        mend,
                    ));
                }
            }
        }
    }
    Ok(())
}

/// The column of time, and its zero where it counts from 1970 or is a date.
pub(super) fn time(draft: &mut Draft) {
    let words = ["t", "time", "timestamp", "stamp", "zeit", "datetime", "clock"];
    if !draft.has("t") {
        let named = |i: &usize| {
            let own = &draft.table.headings[*i].words;
            let numbered = own.get(1).is_some_and(|w| w.bytes().all(|b| b.is_ascii_digit()));
            own.first().is_some_and(|w| words.contains(&w.as_str())) && own.len() <= 2 && !numbered
        };
        let found: Vec<usize> = draft.free(Some(Quantity::Time)).into_iter().filter(named).collect();
        match found[..] {
            [column] => draft.take("t", column, None),
            [] => {}
            _ => {
                let what = format!("column of time: {} may be it", draft.named(&found));
                draft.ask(what, "--column 't=COLUMN'");
            }
        }
    }
    let Some(part) = draft.map.columns.iter().find(|part| part.to == "t") else { return };
    let Found::One(column) = draft.table.column(&part.from) else { return };
    if let Some(zero) = &draft.request.time_zero {
        draft.map.time_zero = Some(zero.clone());
        return;
    }
    let first = draft.table.rows.iter().find_map(|row| {
        let field = row.fields.get(column)?;
        (!super::cell::is_drop_out(field)).then(|| field.to_string())
    });
    let Some(first) = first else { return };
    let seconds = || {
        let unit = super::unit::spelled(part.unit.as_deref()?)?;
        let count = super::cell::number(&first, draft.table.decimal_comma)?;
        Some(unit.unit.to_si(count * unit.times / unit.over))
    };
    let counted = Moment::decimal(&first).is_some() && seconds().is_some_and(|s| SINCE_1970.contains(&s));
    if is_clock(draft.table, column) && moment::read(&first).is_some() || counted {
        draft.told.push(format!(
            "t is 0 at {first}, the first row; where several files share one clock, give all the same `--time-zero`"
        ));
        draft.map.time_zero = Some(first);
    }
}
