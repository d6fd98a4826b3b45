//! Denavit-Hartenberg tables, standard and modified: a row for each joint, the poses of base and tool in comments above.

mod columns;

use std::path::Path;

use super::Form;
use super::cell::{self, Term, Value};
use super::chain::{Chain, Entry, JointEntry, one_line};
use super::names::{Names, usable};
use super::sheet::{Row, Sheet};
use super::step::Move;
use crate::error::Result;
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::{DhParameters, FileUnits, JointKind, MoveForm, dh_moves};
use crate::units::{Quantity, Unit};
use columns::Columns;

/// Whether a text that is no XML has the headings of such a table.
pub(super) fn is_table(text: &str) -> bool {
    let headings = text.trim_start_matches('\u{feff}').lines().map(str::trim);
    let headings = headings.filter(|line| !line.is_empty()).find(|line| !line.starts_with(['#', '%']));
    headings.is_some_and(|line| {
        let line = line.to_lowercase();
        ["alpha", "\u{3b1}"].iter().any(|name| line.contains(name))
    })
}

/// One joint as the table has it, m and rad.
struct Link {
    name: String,
    line: usize,
    kind: JointKind,
    parameters: DhParameters,
    sign: f64,
    travel: Option<(f64, f64)>,
    follows: Vec<Term>,
}

pub(super) fn read(file: &Path, text: &str, form: Option<Form>) -> Result<Chain> {
    let sheet = Sheet::read(file, text)?;
    let modified = is_modified(&sheet, form)?;
    let columns = Columns::of(&sheet)?;
    let mut told = vec![
        format!("{} Denavit-Hartenberg parameters", if modified { "modified (Craig)" } else { "standard" }),
        "w stands at the base, t at the tool; all joints carry the tool".to_string(),
    ];
    let names = names(&sheet, &columns, &mut told)?;
    let mut links = Vec::new();
    for (row, name) in sheet.rows.iter().zip(&names) {
        links.push(link(&sheet, &columns, row, name, &names)?);
    }
    if links.is_empty() {
        return Err(sheet.fault_of_headings("the table has no joints", "write a row for each joint below it"));
    }
    if columns.kind.is_none() {
        told.push("no column says which joints are linear: all are taken as rotary".into());
    }
    let (base, tool) = (placed(&sheet, "base")?, placed(&sheet, "tool")?);
    let mut entries = Vec::new();
    let parameters: Vec<DhParameters> = links.iter().map(|link| link.parameters).collect();
    let mut moves = dh_moves(&parameters, modified).into_iter();
    let mut before: Option<Pose<f64>> = base;
    for (link, moves) in links.iter().zip(moves.by_ref()) {
        let axis = Vec3([0.0, 0.0, link.sign]);
        let joint = JointEntry {
            kind: link.kind,
            axis,
            travel: link.travel,
            nc: None,
            follows: link.follows.iter().map(|term| (term.name.clone(), term.factor)).collect(),
        };
        entries.push(entry(&link.name, before.take(), moves, Some(joint), link.line));
    }
    let line = links.last().map_or(0, |link| link.line);
    let mut end = entry("t", before, moves.next().unwrap_or_default(), None, line);
    end.note = "tool".into();
    if let Some(tool) = tool {
        end.offset = Some(end.offset.unwrap_or(Pose::identity(0.0)) * tool);
    }
    entries.push(end);
    let mut start = entry("w", None, Vec::new(), None, 0);
    start.note = "base".into();
    let stem = file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let stated = sheet.comments.iter().find_map(|(_, text)| text.strip_prefix("machine:"));
    let name = stated.map_or(stem, |name| name.trim().to_string());
    Ok(Chain {
        name: usable(&name, "machine_"),
        about: format!("{}, from a DH table", one_line(&name)),
        units: columns.units(&sheet),
        workpiece: vec![start],
        tool: entries,
        told,
    })
}

/// A frame; a pose before its moves makes one pose of all.
fn entry(
    frame: &str,
    before: Option<Pose<f64>>,
    moves: Vec<MoveForm>,
    joint: Option<JointEntry>,
    line: usize,
) -> Entry {
    let moves: Vec<Move> = moves.into_iter().map(Move::from).filter(|m| !m.is_none()).collect();
    let (moves, offset) = match before {
        Some(pose) => (Vec::new(), Some(pose * Move::all(&moves))),
        None => (moves, None),
    };
    let note = format!("line {line}");
    Entry { frame: frame.into(), moves, offset, joint, mass: None, steps: Vec::new(), note }
}

/// The convention: what is asked for, or what a comment or a heading of the table says; both must agree.
fn is_modified(sheet: &Sheet, form: Option<Form>) -> Result<bool> {
    let said = sheet.comments.iter().find_map(|(line, text)| {
        let text = text.to_lowercase();
        let is = |words: &[&str]| words.iter().any(|word| text.contains(word));
        match (is(&["modified convention", "craig"]), is(&["standard convention"])) {
            (true, _) => Some((*line, true)),
            (_, true) => Some((*line, false)),
            _ => None,
        }
    });
    let of_link_before = || (!sheet.columns(&columns::BEFORE).is_empty()).then_some((sheet.line, true));
    let said = said.or_else(of_link_before);
    let asked = form.map(|form| form == Form::Mdh);
    match (asked, said) {
        (Some(asked), Some((line, said))) if asked != said => {
            let word = |modified| if modified { "--mdh" } else { "--dh" };
            let what = format!("the table says that it is of {}, not of {}", word(said), word(asked));
            Err(sheet.fault_at(line, what, format!("say {}, or mend this line", word(said))))
        }
        (Some(modified), _) | (None, Some((_, modified))) => Ok(modified),
        (None, None) => {
            let what = "nothing says whether these Denavit-Hartenberg parameters are standard or modified";
            let mend = "say --dh (link: Rz(theta) Tz(d) Tx(a) Rx(alpha)) or --mdh (Craig; Rx(alpha) Tx(a) Rz(theta) Tz(d))";
            Err(sheet.fault_of_headings(what, mend))
        }
    }
}

/// Usable names of all joints, none twice.
fn names(sheet: &Sheet, columns: &Columns, told: &mut Vec<String>) -> Result<Vec<String>> {
    let mut given = Names::default();
    let mut names = Vec::new();
    let mut own: Vec<(&str, usize)> = Vec::new();
    for (i, row) in sheet.rows.iter().enumerate() {
        let written = columns.name.map_or("", |column| sheet.text(row, column));
        let written = if written.is_empty() { format!("q{}", i + 1) } else { written.to_string() };
        if let Some(column) = columns.name {
            let text = sheet.text(row, column);
            if let Some((_, first)) = own.iter().find(|(name, _)| *name == text && !text.is_empty()) {
                let what = format!("joint \"{}\" stands twice, first in line {first}", one_line(text));
                return Err(sheet.fault(row, column, what, "give one of them another name"));
            }
            own.push((text, row.line));
        }
        // A joint that is called by its number alone is one that the table does not name.
        let wanted =
            if written.bytes().all(|b| b.is_ascii_digit()) { format!("q{written}") } else { written };
        let name = given.give(&wanted);
        if name != wanted {
            told.push(format!(
                "joint \"{}\" is called {name}: machine files do not take its own name",
                wanted.escape_debug()
            ));
        }
        names.push(name);
    }
    if columns.name.is_none() {
        told.push(format!("the table names no joints: they are called {}", names.join(", ")));
    }
    Ok(names)
}

fn link(sheet: &Sheet, columns: &Columns, row: &Row, name: &str, names: &[String]) -> Result<Link> {
    let kind = columns.kind(sheet, row)?;
    let value = |column: Option<usize>, quantity: Quantity, moves: bool| -> Result<f64> {
        let Some(column) = column else { return Ok(0.0) };
        let unit = sheet.unit(column, quantity)?;
        let text = sheet.text(row, column);
        let number = match cell::value(text, unit, |text| sheet.number_in(text)) {
            Some(Value::Number(number)) => number,
            Some(Value::Variable(number)) if moves => number,
            Some(Value::Variable(_)) => {
                let what = format!(
                    "`{}` in column `{}` is the variable of a {} joint, which \"{name}\" is not",
                    one_line(text),
                    sheet.called(column),
                    if quantity == Quantity::Angle { "rotary" } else { "linear" }
                );
                let mend =
                    "mend the kind of the joint (column `kind`: revolute, prismatic), or write a number";
                return Err(sheet.fault(row, column, what, mend));
            }
            None => return Err(sheet.no_number(row, column)),
        };
        if number.abs() < 1e9 {
            Ok(number)
        } else {
            Err(sheet.fault(row, column, "the number is beyond 1e9 m or rad", "mend the number or the unit"))
        }
    };
    let turns = kind == JointKind::Revolute;
    let parameters = DhParameters {
        theta: value(columns.theta, Quantity::Angle, turns)?,
        d: value(columns.d, Quantity::Length, !turns)?,
        a: value(Some(columns.a), Quantity::Length, false)?,
        alpha: value(Some(columns.alpha), Quantity::Angle, false)?,
        beta: value(columns.beta, Quantity::Angle, false)?,
    };
    let mut link = Link {
        name: name.to_string(),
        line: row.line,
        kind,
        parameters,
        sign: columns.sign(sheet, row)?,
        travel: columns.travel(sheet, row, kind)?,
        follows: columns.follows(sheet, row, name, names)?,
    };
    link.parameters = parameters.moved(kind, columns.offset.value(sheet, row, kind)?.unwrap_or(0.0));
    Ok(link)
}

/// The pose behind `base[m,rad]:` or `tool[m,rad]:`: three lengths and a rotation vector.
fn placed(sheet: &Sheet, name: &str) -> Result<Option<Pose<f64>>> {
    let find = |(line, text): &(usize, String)| {
        let (head, numbers) = text.split_once(':')?;
        let units = head.trim().strip_prefix(name)?.trim();
        // `base: ...` of a person's comment is none, `base[mm,deg]: ...` is.
        let units = units.strip_prefix('[')?.strip_suffix(']')?;
        Some((*line, units.to_string(), numbers.to_string()))
    };
    let Some((line, units, numbers)) = sheet.comments.iter().find_map(find) else { return Ok(None) };
    let mend = format!("write `# {name}[m,rad]: x,y,z,rx,ry,rz`: a place, then a rotation vector");
    let fault = |what: String| sheet.fault_at(line, what, mend.clone());
    let named = |word: &str, quantity| Unit::named(word.trim()).filter(|unit| unit.quantity == quantity);
    let both = units.split_once(',').and_then(|(length, angle)| {
        Some(FileUnits { length: named(length, Quantity::Length)?, angle: named(angle, Quantity::Angle)? })
    });
    let units =
        both.ok_or_else(|| fault(format!("`{name}[...]` names no unit of length and one of angle")))?;
    let cells: Vec<Option<f64>> = numbers
        .split([',', ';'])
        .map(|text| text.trim().parse().ok().filter(|x: &f64| x.abs() < 1e9))
        .collect();
    let [Some(x), Some(y), Some(z), Some(rx), Some(ry), Some(rz)] = cells[..] else {
        return Err(fault(format!("`{name}` is not six numbers")));
    };
    let at = Vec3([x, y, z].map(|x| units.length.to_si(x)));
    let about = Vec3([rx, ry, rz].map(|x| units.angle.to_si(x)));
    let turned = Pose::exp(Twist::new(Vec3([0.0; 3]), about));
    let pose = Pose { rotation: turned.rotation, translation: at };
    Ok((at.0 != [0.0; 3] || about.0 != [0.0; 3]).then_some(pose))
}
