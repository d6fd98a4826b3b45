//! Commands from a table: a CSV with joint columns, or any recording, whose commands are run again.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::course::{At, Course, Sample, Samples};
use crate::error::{Error, Place, Result};
use crate::machine::{JointKind, Machine};
use crate::units::{Quantity, Unit};
use crate::wording::count;

/// Longest line that is read, bytes.
const LONGEST: u64 = 1 << 20;

/// A table of commands, read line by line.
///
/// Lines `# fixed JOINT[unit]: value`, one header row `JOINT[unit]`, then numbers. `t[s]` and `JOINT_direction[1]` are used where they are
/// there, other columns are not looked at; rows with an empty command are left out.
#[derive(Clone, Debug)]
pub struct CommandTable {
    path: PathBuf,
    commands: usize,
    columns: Vec<(usize, Use)>,
    /// Per command what `# fixed` says.
    fixed: Vec<Option<f64>>,
    width: usize,
    data_from: usize,
    rate: f64,
    has_directions: bool,
}

/// What a column is for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Use {
    Time(Unit),
    Command(usize, Unit),
    Direction(usize),
}

impl CommandTable {
    /// Opens a table and reads its header. `rate`: samples a second where there is no column `t`.
    ///
    /// # Errors
    /// [`Error::File`], or [`Error::Input`] with line and column for a column that cannot be used or a joint without one.
    pub fn open(path: impl AsRef<Path>, machine: &Machine, rate: f64) -> Result<CommandTable> {
        let path = path.as_ref().to_path_buf();
        let mut table = CommandTable {
            path,
            commands: machine.commands().len(),
            columns: Vec::new(),
            fixed: vec![None; machine.commands().len()],
            width: 0,
            data_from: 0,
            rate,
            has_directions: false,
        };
        for line in table.lines()? {
            let (number, line) = line?;
            let text = line.trim().trim_start_matches('\u{feff}');
            if let Some(comment) = text.strip_prefix('#') {
                table.fix(machine, number, comment)?;
            } else if !text.is_empty() {
                table.header(machine, number, text)?;
                table.data_from = number;
                break;
            }
        }
        if table.data_from == 0 {
            return Err(table.wrong(
                0,
                0,
                "no header row names the columns",
                "write one: x[mm],y[mm],c[deg]",
            ));
        }
        for (c, name) in machine.commands().iter().enumerate() {
            let found = table.columns.iter().any(|(_, u)| matches!(u, Use::Command(i, _) if *i == c));
            if !found && table.fixed[c].is_none() {
                let unit = if machine.command_joint(c).kind == JointKind::Prismatic { "mm" } else { "deg" };
                let mend = format!("add a column `{name}[{unit}]`, or a line `# fixed {name}[{unit}]: 0`");
                return Err(table.wrong(table.data_from, 0, format!("joint \"{name}\" has no column"), mend));
            }
        }
        Ok(table)
    }

    /// Whether there are columns of the directions of approach.
    pub fn has_directions(&self) -> bool {
        self.has_directions
    }

    fn wrong(
        &self,
        line: usize,
        column: usize,
        message: impl Into<String>,
        mend: impl Into<String>,
    ) -> Error {
        Error::mistake(Place::at(&self.path, line, column), message, mend)
    }

    fn lines(&self) -> Result<impl Iterator<Item = Result<(usize, String)>> + Send + use<>> {
        let path = self.path.clone();
        let mut file = BufReader::new(File::open(&path).map_err(|e| Error::file(&path, e))?);
        let mut number = 0;
        Ok(std::iter::from_fn(move || {
            let mut bytes = Vec::new();
            number += 1;
            match std::io::Read::take(&mut file, LONGEST).read_until(b'\n', &mut bytes) {
                Ok(0) => None,
                Ok(_) => match String::from_utf8(bytes) {
                    Ok(text) => Some(Ok((number, text))),
                    Err(_) => Some(Err(Error::mistake(
                        Place::at(&path, number, 0),
                        "text is not UTF-8",
                        "save the table as plain text in UTF-8",
                    ))),
                },
                Err(e) => Some(Err(Error::file(&path, e))),
            }
        }))
    }

    fn unit(&self, at: (usize, usize), name: &str, symbol: Option<&str>, quantity: Quantity) -> Result<Unit> {
        let fits = format!("write one of: {}", Unit::symbols_of(quantity));
        let Some(symbol) = symbol else {
            return Err(self.wrong(at.0, at.1, format!("column `{name}` has no unit"), fits));
        };
        match Unit::named(symbol) {
            Some(unit) if unit.quantity == quantity => Ok(unit),
            Some(unit) => {
                let what = format!("column `{name}` has unit `{symbol}`, a unit of {}", unit.quantity);
                Err(self.wrong(at.0, at.1, what, fits))
            }
            None => Err(self.wrong(
                at.0,
                at.1,
                format!("column `{name}` has unit `{symbol}`, which is not known"),
                fits,
            )),
        }
    }

    fn quantity(machine: &Machine, c: usize) -> Quantity {
        machine.command_joint(c).kind.quantity()
    }

    fn fix(&mut self, machine: &Machine, line: usize, comment: &str) -> Result<()> {
        let Some((key, value)) = comment.split_once(':') else { return Ok(()) };
        let Some(joint) = key.trim().strip_prefix("fixed ") else { return Ok(()) };
        let (name, unit) = cut(joint);
        let Some(c) = machine.commands().iter().position(|command| command == name) else {
            let mend = format!("joints of this machine: {}", machine.commands().join(", "));
            return Err(self.wrong(
                line,
                0,
                format!("joint \"{name}\" is none that this machine commands"),
                mend,
            ));
        };
        let unit = self.unit((line, 0), name, unit, Self::quantity(machine, c))?;
        self.fixed[c] = Some(unit.to_si(self.number((line, 0), value.trim())?));
        Ok(())
    }

    fn header(&mut self, machine: &Machine, line: usize, row: &str) -> Result<()> {
        for (i, cell) in row.split(',').enumerate() {
            let (name, symbol) = cut(cell.trim().trim_matches('"'));
            let at = (line, i + 1);
            self.width = i + 1;
            let direction = name.strip_suffix("_direction").unwrap_or("");
            let command = |name: &str| machine.commands().iter().position(|command| command == name);
            let purpose = if let Some(c) = command(name) {
                Use::Command(c, self.unit(at, name, symbol, Self::quantity(machine, c))?)
            } else if name == "t" {
                Use::Time(self.unit(at, name, symbol, Quantity::Time)?)
            } else if let Some(c) = command(direction) {
                self.has_directions = true;
                Use::Direction(c)
            } else {
                continue;
            };
            let same = |(_, other): &(usize, Use)| match (other, &purpose) {
                (Use::Command(a, _), Use::Command(b, _)) | (Use::Direction(a), Use::Direction(b)) => a == b,
                (Use::Time(_), Use::Time(_)) => true,
                _ => false,
            };
            if self.columns.iter().any(same) {
                return Err(self.wrong(
                    line,
                    i + 1,
                    format!("column `{name}` stands twice"),
                    "keep one of them",
                ));
            }
            self.columns.push((i, purpose));
        }
        Ok(())
    }

    fn number(&self, (line, column): (usize, usize), text: &str) -> Result<f64> {
        let text = text.trim();
        if text.is_empty() || text.eq_ignore_ascii_case("nan") {
            return Ok(f64::NAN);
        }
        match text.parse::<f64>() {
            Ok(value) if value.abs() <= 1e15 => Ok(value),
            _ => Err(self.wrong(
                line,
                column,
                format!("`{}` is no usable number", text.escape_debug()),
                "write a plain number",
            )),
        }
    }

    /// The sample of a row; `None` where a command is missing.
    fn sample(&self, line: usize, row: &str) -> Result<Option<Sample>> {
        let fields: Vec<&str> = row.trim_end().split(',').collect();
        if fields.len() != self.width {
            let has = count(fields.len() as u64, "field", "fields");
            let what = format!("row has {has}, header row has {}", self.width);
            return Err(self.wrong(line, 0, what, "separate the fields by commas; decimals take a point"));
        }
        let mut q: Vec<f64> = self.fixed.iter().map(|fixed| fixed.unwrap_or(f64::NAN)).collect();
        let mut directions = self.has_directions.then(|| vec![0i8; self.commands]);
        let mut time = f64::NAN;
        for (i, purpose) in &self.columns {
            let value = self.number((line, i + 1), fields[*i])?;
            match purpose {
                Use::Time(unit) => time = unit.to_si(value),
                Use::Command(c, unit) => q[*c] = unit.to_si(value),
                Use::Direction(c) => {
                    let sign = if value > 0.0 { 1 } else { -i8::from(value < 0.0) };
                    directions.iter_mut().for_each(|d| d[*c] = sign);
                }
            }
        }
        let whole = q.iter().all(|x| x.is_finite());
        Ok(whole.then_some(Sample { time, q, directions, recorded: true, at: At::Line(line) }))
    }
}

/// `name[unit]`.
fn cut(cell: &str) -> (&str, Option<&str>) {
    match cell.split_once('[') {
        Some((name, rest)) => (name.trim(), Some(rest.trim_end().trim_end_matches(']').trim())),
        None => (cell.trim(), None),
    }
}

impl Course for CommandTable {
    fn samples(&self) -> Result<Samples<'_>> {
        let timed = self.columns.iter().any(|(_, purpose)| matches!(purpose, Use::Time(_)));
        let (mut count, mut start, mut last, mut failed) = (0u64, None, f64::NEG_INFINITY, false);
        let rows = self.lines()?.skip(self.data_from);
        Ok(Box::new(rows.filter_map(move |line| {
            if failed {
                return None;
            }
            let sample = line.and_then(|(number, row)| match row.trim() {
                "" => Ok(None),
                comment if comment.starts_with('#') => Ok(None),
                row => self.sample(number, row),
            });
            let sample = sample.and_then(|sample| {
                let Some(mut sample) = sample else { return Ok(None) };
                if timed {
                    sample.time -= *start.get_or_insert(sample.time);
                    if sample.time.is_nan() || sample.time <= last {
                        let At::Line(line) = sample.at else { return Ok(None) };
                        return Err(self.wrong(
                            line,
                            0,
                            "time does not rise",
                            "sort the rows, or leave `t` out",
                        ));
                    }
                    last = sample.time;
                } else {
                    sample.time = count as f64 / self.rate;
                }
                count += 1;
                Ok(Some(sample))
            });
            failed = sample.is_err();
            sample.transpose()
        })))
    }
}
