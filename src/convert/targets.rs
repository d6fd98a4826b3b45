//! Tables of deviations at targets, as reports after ISO 230-2 print them: a target a row with a column for each run, a run a row with a
//! column for each target, or a reading a row.

use std::collections::BTreeMap;
use std::path::Path;

use super::Request;
use super::cell;
use super::deviations::{Deviations, Measured, is_reversed, joint, senses};
use super::form::Separator;
use super::heading::{Heading, Stated};
use super::positioning::Reading;
use super::table::{Row, Table, Told};
use super::text::decoded;
use super::unit::{Spelled, spelled};
use crate::error::{Error, Place, Result};
use crate::machine::Machine;
use crate::meter::Meter;
use crate::units::Quantity;
use crate::wording::shown;

/// Words for where the axis was sent.
const TARGETS: [&str; 12] = [
    "target",
    "targets",
    "nominal",
    "soll",
    "sollposition",
    "sollwert",
    "position",
    "positions",
    "pos",
    "pi",
    "p",
    "zielposition",
];
/// Words for how far it was off.
const DEVIATION: [&str; 8] = ["deviation", "dev", "error", "err", "abweichung", "fehler", "xij", "x"];
/// Words for a pass over all targets.
const RUN: [&str; 11] = ["run", "runs", "lauf", "cycle", "zyklus", "pass", "no", "nr", "j", "n", "messung"];
/// Words for the sense of approach, and signs for it.
const SENSE: [&str; 7] = ["direction", "dir", "approach", "sense", "richtung", "anfahrrichtung", "way"];
const UP: [&str; 13] = [
    "up",
    "fwd",
    "forward",
    "forwards",
    "forw",
    "pos",
    "positive",
    "plus",
    "vor",
    "vorwaerts",
    "auf",
    "rising",
    "hin",
];
const DOWN: [&str; 15] = [
    "down",
    "bwd",
    "backward",
    "backwards",
    "back",
    "rev",
    "reverse",
    "neg",
    "negative",
    "minus",
    "zurueck",
    "rueck",
    "ab",
    "falling",
    "return",
];
/// Lines that are looked at for headings.
const LOOKED_AT: usize = 200;
/// Readings off by more than this part of the stretch of targets are positions and no deviations.
const FAR: f64 = 0.02;

/// Which run a column or a row is of, as far as its name says.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Run {
    number: Option<usize>,
    from_below: Option<bool>,
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Column {
    Target,
    /// Deviations of a run.
    Of(Run),
    /// Deviations at a target, mm or deg.
    At(f64),
    Run,
    Sense,
    Deviation,
    /// Numbers of rows, means and the like.
    Other,
}

/// Headings of such a table.
pub(super) struct Head {
    columns: Vec<Column>,
    names: Vec<String>,
    separator: Separator,
    /// Index of the line.
    line: usize,
}

/// The headings of a table of deviations, if it is one.
pub(super) fn head(bytes: &[u8], told: &Told) -> Option<Head> {
    let text = decoded(bytes);
    let lines: Vec<&str> = text.lines().take(LOOKED_AT).collect();
    let separators = [b'\t', b';', b','].map(Separator::Byte).into_iter().chain([Separator::Blanks]);
    for separator in separators.filter(|s| told.separator.is_none_or(|own| own == *s)) {
        for (line, content) in lines.iter().enumerate() {
            let content = content.trim_start().trim_start_matches(['#', '%']);
            let mut names = separator.fields(content);
            while names.last().is_some_and(|name| name.trim().is_empty()) {
                names.pop();
            }
            let Some(columns) = columns(&names) else { continue };
            // A line of units below.
            let units = lines.get(line + 1).map_or(Vec::new(), |below| separator.fields(below));
            let unit = |text: &String| spelled(text.trim().trim_matches(['[', ']', '(', ')']).trim());
            let is_units = units.len() >= names.len().saturating_sub(1)
                && units.iter().any(|text| unit(text).is_some())
                && units
                    .iter()
                    .all(|text| text.trim().is_empty() || text.trim() == "-" || unit(text).is_some());
            if is_units {
                for (name, own) in names.iter_mut().zip(&units).filter(|(_, own)| unit(own).is_some()) {
                    *name = format!("{name} [{}]", own.trim().trim_matches(['[', ']', '(', ')']).trim());
                }
            }
            return Some(Head { columns, names, separator, line: line + usize::from(is_units) });
        }
    }
    None
}

/// What the columns are, if all of them make such a table.
fn columns(names: &[String]) -> Option<Vec<Column>> {
    let headings: Vec<Heading> = names.iter().map(|name| Heading::read(name)).collect();
    let only = |heading: &Heading, lists: &[&[&str]]| {
        let known = |word: &String| lists.iter().any(|list| list.contains(&word.as_str()));
        !heading.words.is_empty() && heading.words.iter().all(known)
    };
    let number = |name: &String| cell::number(name, true).or_else(|| cell::number(name, false));
    let targets = |heading: &Heading| {
        only(heading, &[&TARGETS, &["i", "nr", "no"]])
            && heading.words.iter().any(|w| TARGETS.contains(&w.as_str()))
    };
    let long = |heading: &Heading| {
        if targets(heading) {
            Column::Target
        } else if only(heading, &[&SENSE]) {
            Column::Sense
        } else if only(heading, &[&RUN]) {
            Column::Run
        } else if only(heading, &[&DEVIATION]) && heading.name.to_lowercase() != "x" {
            Column::Deviation
        } else {
            Column::Other
        }
    };
    let kinds: Vec<Column> = headings.iter().map(long).collect();
    let has = |kind: Column| kinds.iter().filter(|own| **own == kind).count();
    // A reading a row: nothing but these, since a log of a machine has more.
    let told = has(Column::Run) + has(Column::Sense) > 0;
    if has(Column::Target) == 1 && has(Column::Deviation) == 1 && told && has(Column::Other) == 0 {
        return Some(kinds);
    }
    // A target a row.
    if has(Column::Target) == 1 {
        let own = |(kind, heading): (&Column, &Heading)| match kind {
            Column::Target => Column::Target,
            _ => run(heading).map_or(Column::Other, Column::Of),
        };
        let wide: Vec<Column> = kinds.iter().zip(&headings).map(own).collect();
        let runs = wide.iter().filter(|own| matches!(own, Column::Of(_))).count();
        // Numbers of rows before, means behind.
        let others = wide.iter().filter(|own| **own == Column::Other).count();
        if runs >= 2 && others <= 1 + runs / 2 {
            return Some(wide);
        }
    }
    // A run a row: the first heading says what it is, the others are targets.
    headings.first().filter(|first| only(first, &[&TARGETS, &RUN, &SENSE]))?;
    let own = |(i, name): (usize, &String)| match number(name) {
        Some(at) => Column::At(at),
        None if i == 0 => Column::Run,
        None if i == 1
            && (name.trim().is_empty() || kinds[1] == Column::Sense || kinds[1] == Column::Run) =>
        {
            Column::Sense
        }
        None => Column::Other,
    };
    let across: Vec<Column> = names.iter().enumerate().map(own).collect();
    let at = across.iter().filter(|own| matches!(own, Column::At(_))).count();
    (at >= 3 && !across.contains(&Column::Other)).then_some(across)
}

/// The run that a heading names: a number, a sense, or both, and no other word.
fn run(heading: &Heading) -> Option<Run> {
    let name = heading.name.trim();
    let mut found = Run { number: None, from_below: None };
    let arrows = |list: [char; 5]| name.contains(list);
    let end = name.trim_end_matches([')', ']', ' ']);
    match (
        arrows(['\u{2191}', '\u{25b2}', '\u{2192}', '\u{21d1}', '\u{2197}']) || end.ends_with('+'),
        arrows(['\u{2193}', '\u{25bc}', '\u{2190}', '\u{21d3}', '\u{2198}'])
            || end.ends_with(['-', '\u{2212}']),
    ) {
        (true, false) => found.from_below = Some(true),
        (false, true) => found.from_below = Some(false),
        _ => {}
    }
    for word in &heading.words {
        let word = word.replace('\u{fc}', "ue").replace('\u{e4}', "ae");
        match word.parse::<usize>() {
            Ok(number) if found.number.is_none() => found.number = Some(number),
            Err(_) if UP.contains(&word.as_str()) => found.from_below = Some(true),
            Err(_) if DOWN.contains(&word.as_str()) => found.from_below = Some(false),
            Err(_) if RUN.contains(&word.as_str()) || DEVIATION.contains(&word.as_str()) => {}
            _ => return None,
        }
    }
    (found.number.is_some() || found.from_below.is_some()).then_some(found)
}

/// One number of the table.
struct Entry {
    line: usize,
    column: usize,
    target: f64,
    run: Run,
    value: f64,
}

/// The recording of such a table.
pub(super) fn read(
    file: &Path,
    bytes: &[u8],
    head: &Head,
    machine: Option<&Machine>,
    request: &Request,
) -> Result<Measured> {
    let names = match request.names.is_empty() {
        true => head.names.clone(),
        false => request.names.clone(),
    };
    let comma = request.decimal.as_deref().map(|word| super::map::decimal(word).is_ok_and(|comma| comma));
    let told = Told { separator: Some(head.separator), decimal_comma: comma, names };
    let mut table = Table::read(file, bytes, &told, &Meter::default())?;
    table.line = head.line + 1;
    table.rows.retain(|row| row.line > head.line + 1);
    let units = Units::of(&table, head, request)?;
    let mut entries = entries(&table, head)?;
    if entries.is_empty() {
        let what = "no deviations are found";
        return Err(Error::mistake(
            Place::at(file, table.line, 0),
            what,
            "give a number for each target and run",
        ));
    }
    let angular = units.target.quantity() == Quantity::Angle;
    // Into mm or deg.
    let per_target =
        if angular { units.target.unit.to_si(1.0).to_degrees() } else { units.target.unit.to_si(1.0) * 1e3 };
    let per_target = per_target * units.target.times / units.target.over;
    entries.iter_mut().for_each(|entry| entry.target = rounded(entry.target * per_target));
    let (low, high) = entries
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), e| (low.min(e.target), high.max(e.target)));
    let per_value = units.value.unit.to_si(1.0) * units.value.times / units.value.over;
    let si = if angular { 1f64.to_radians() } else { 1e-3 };
    let furthest = entries.iter().map(|e| (e.value * per_value).abs()).fold(0.0, f64::max);
    let whole = |e: &Entry| e.value * per_value - e.target * si;
    let nearest = entries.iter().map(|e| whole(e).abs()).fold(0.0, f64::max);
    let stretch = (high - low) * si;
    let are_positions = furthest > FAR * stretch && nearest <= FAR * stretch;
    if furthest > FAR * stretch && !are_positions {
        let worst = entries.iter().max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()));
        let (line, column) = worst.map_or((table.line, 0), |e| (e.line, e.column + 1));
        let what = format!(
            "a deviation of {:.3} % of the stretch of the targets",
            100.0 * furthest / stretch.max(f64::MIN_POSITIVE)
        );
        let mend =
            "check the units: --unit target=..., --unit deviation=...; deviations are small against the way";
        return Err(Error::mistake(Place::at(file, line, column), what, mend));
    }
    let joint = joint(file, angular, None, machine, request)?;
    let entries = with_senses(file, entries, request)?;
    let sign = if is_reversed(request) { -1.0 } else { 1.0 };
    let reading = |(entry, from_below): &(Entry, bool)| Reading {
        line: entry.line,
        run: entry.run.number.unwrap_or(0),
        target: entry.target,
        from_below: *from_below,
        deviation: sign * if are_positions { whole(entry) } else { entry.value * per_value },
    };
    let mut readings: Vec<Reading> = entries.iter().map(reading).collect();
    // As they were measured: run by run, there and back.
    readings.sort_by(|a, b| {
        let way = |r: &Reading| if r.from_below { r.target } else { -r.target };
        a.run.cmp(&b.run).then(b.from_below.cmp(&a.from_below)).then(way(a).total_cmp(&way(b)))
    });
    let deviations = Deviations { file: file.to_path_buf(), angular, joint, readings };
    let mut measured = deviations.measured(machine, request);
    let what = match (are_positions, is_reversed(request)) {
        (true, _) => "what was read is taken as positions, since it is near the targets",
        (false, false) => {
            "deviations are taken as actual less target, as ISO 230-2 has them; `--deviation` says the other sense"
        }
        (false, true) => "deviations are taken as target less actual",
    };
    let order = "rows are put in the order of the measurement: run by run, in the positive sense and back";
    measured.is_rearranged = true;
    measured.told.splice(0..0, [what.to_string(), order.to_string()]);
    Ok(measured)
}

/// Without the dust of factors.
fn rounded(x: f64) -> f64 {
    (x * 1e9).round() / 1e9
}

/// Units of targets and of what was read.
struct Units {
    target: Spelled,
    value: Spelled,
}

impl Units {
    /// As headings or the user say; what nobody says is asked.
    fn of(table: &Table, head: &Head, request: &Request) -> Result<Units> {
        let told = |key: &str| request.units.iter().find(|(own, _)| own == key).map(|(_, unit)| unit.clone());
        let mut open: Vec<String> = Vec::new();
        let mut find = |what: &str, of: &dyn Fn(&Column) -> bool, mend: &str| -> Result<Option<Spelled>> {
            if let Some(text) = told(what) {
                let found = spelled(&text)
                    .filter(|unit| matches!(unit.quantity(), Quantity::Length | Quantity::Angle));
                return found.map(Some).ok_or_else(|| {
                    let what = format!("--unit {what}={}: no unit of length or angle", shown(&text));
                    Error::mistake(Place::file(&table.file), what, format!("--unit {mend}"))
                });
            }
            let mut stated: Option<Spelled> = None;
            for (i, _) in head.columns.iter().enumerate().filter(|(_, column)| of(column)) {
                let Some(heading) = table.headings.get(i) else { continue };
                let own = match &heading.unit {
                    Stated::Unit(unit) => *unit,
                    _ => continue,
                };
                if stated.is_some_and(|known| known != own) {
                    let what = format!("column `{}` has another unit than those before it", table.called(i));
                    return Err(Error::mistake(
                        Place::at(&table.file, table.line, i + 1),
                        what,
                        "give all deviations in one unit",
                    ));
                }
                stated = Some(own);
            }
            if stated.is_none() {
                open.push(format!("unit of the {what}s\n    tell: --unit {mend}"));
            }
            Ok(stated)
        };
        let target = find("target", &|column| matches!(column, Column::Target), "target=mm|m|in|deg|rad")?;
        let value = find(
            "deviation",
            &|column| matches!(column, Column::Of(_) | Column::Deviation),
            "deviation=um|mm|arcsec|urad|mrad|deg",
        )?;
        let (Some(target), Some(value)) = (target, value) else {
            let things = if open.len() == 1 { "one thing has" } else { "two things have" };
            let lines: String = open.iter().map(|what| format!("\n  - {what}")).collect();
            let what = format!(
                "a table of deviations at targets; {things} to be told before it is a recording{lines}"
            );
            return Err(Error::mistake(
                Place::at(&table.file, table.line, 0),
                what,
                "say it by these flags, or in the headings: `target [mm]`, `1+ [um]`",
            ));
        };
        if target.quantity() != value.quantity() {
            let what = "targets and deviations have units of different kinds";
            let mend = "both are lengths or both are angles; `--unit target=...`, `--unit deviation=...` correct a heading";
            return Err(Error::mistake(Place::at(&table.file, table.line, 0), what, mend));
        }
        Ok(Units { target, value })
    }
}

/// Every number that was read, with its target and its run.
fn entries(table: &Table, head: &Head) -> Result<Vec<Entry>> {
    let mut found = Vec::new();
    let place = |kind: Column| head.columns.iter().position(|column| *column == kind);
    for row in &table.rows {
        let own = own_run(table, row, place(Column::Run), place(Column::Sense))?;
        let target = match place(Column::Target) {
            Some(column) => match table.number(row, column)? {
                Some(target) => Some(target),
                None => continue,
            },
            None => None,
        };
        for (column, kind) in head.columns.iter().enumerate() {
            let (target, run) = match (kind, target) {
                (Column::Of(run), Some(target)) => (target, *run),
                (Column::Deviation, Some(target)) => (target, own),
                (Column::At(target), _) => (*target, own),
                _ => continue,
            };
            // A field that is empty was not read.
            if let Some(value) = table.number(row, column)? {
                found.push(Entry { line: row.line, column, target, run, value });
            }
        }
    }
    Ok(found)
}

/// The run that a row is of.
fn own_run(table: &Table, row: &Row, of_run: Option<usize>, of_sense: Option<usize>) -> Result<Run> {
    let mut own = Run { number: None, from_below: None };
    let field = |column: Option<usize>| {
        column.and_then(|c| row.fields.get(c)).map(str::trim).filter(|text| !text.is_empty())
    };
    if let Some(text) = field(of_run) {
        let known = run(&Heading::read(text));
        own = known.ok_or_else(|| {
            let what = format!("`{}` names no run", shown(text));
            table.fault(row, of_run.unwrap_or(0), what, "write its number, with + or - for the sense: 1+, 1-")
        })?;
    }
    if let Some(text) = field(of_sense) {
        let sense = cell::direction(text).map(|way| way > 0);
        own.from_below = match sense.or_else(|| run(&Heading::read(text)).and_then(|run| run.from_below)) {
            Some(way) => Some(way),
            None => {
                let what = format!("`{}` is no sense of approach", shown(text));
                return Err(table.fault(row, of_sense.unwrap_or(0), what, "write + or -, up or down"));
            }
        };
    }
    Ok(own)
}

/// Entries with their sense of approach, and a number for every run.
fn with_senses(file: &Path, mut entries: Vec<Entry>, request: &Request) -> Result<Vec<(Entry, bool)>> {
    // Runs without a number are counted by how often a target comes.
    let mut counted: BTreeMap<(i64, Option<bool>), usize> = BTreeMap::new();
    for entry in &mut entries {
        let times = counted.entry(((entry.target * 1e9).round() as i64, entry.run.from_below)).or_default();
        *times += 1;
        entry.run.number = entry.run.number.or(Some(*times));
    }
    if entries.iter().all(|entry| entry.run.from_below.is_some()) {
        return Ok(entries
            .into_iter()
            .map(|entry| {
                let way = entry.run.from_below == Some(true);
                (entry, way)
            })
            .collect());
    }
    let mut runs: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for entry in &entries {
        runs.entry(entry.run.number.unwrap_or(0)).or_default().push(entry.target);
    }
    let senses = senses(file, &runs, true, request)?;
    Ok(entries
        .into_iter()
        .map(|entry| {
            let told = senses.get(&entry.run.number.unwrap_or(0)).copied().unwrap_or(true);
            let way = entry.run.from_below.unwrap_or(told);
            (entry, way)
        })
        .collect())
}
