//! The header row: which column plays which part, in which unit.

use super::RecordingFault as Fault;
use super::entry::example_unit;
use super::header::{Draft, Measurement, NominalLength};
use super::text::{self, Fail};
use crate::machine::Drive;
use crate::machine::Machine;
use crate::units::{Quantity, Unit};

/// A column as written in the header row.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name without unit.
    pub name: String,
    /// Unit in which the file states it.
    pub unit: Unit,
    /// What it is for.
    pub role: Role,
}

/// What a column is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Time `t`.
    Time,
    /// Commanded displacement; index in [`Machine::commands`].
    Command(usize),
    /// Displacement of a joint that only follows others; index of its dyad. Compared with the coupling, not used.
    Follower(usize),
    /// Measured number; index in the order of the contract: `px py pz` are 0 1 2, `rx ry rz` 3 4 5, `qw qx qy qz` 3 4 5 6.
    Value(usize),
    /// Direction of approach of a command; index in [`Machine::commands`].
    Direction(usize),
    /// Extra channel; index in [`Recording::extra_channels`](super::Recording::extra_channels).
    Channel(usize),
}

/// A column that is neither time, joint nor measured: something that effects may use.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name without unit.
    pub name: String,
    /// Unit in which the file states it; chunks hold SI (temperatures in K).
    pub unit: Unit,
}

/// The columns of a recording, resolved against machine and header.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub columns: Vec<Column>,
    pub channels: Vec<Channel>,
    /// Column of `t`.
    pub time: Option<usize>,
    /// Per command its column; `None` where the header fixes it.
    pub commands: Vec<Option<usize>>,
    /// Columns of the measured numbers, in the order of [`Role::Value`].
    pub values: Vec<usize>,
    /// Per command the column of its direction.
    pub directions: Vec<Option<usize>>,
    /// Columns of followers with the coupling that they should obey.
    pub followers: Vec<(usize, Drive)>,
}

const POSITION: [&str; 3] = ["px", "py", "pz"];
const ROTATION: [&str; 3] = ["rx", "ry", "rz"];
const QUATERNION: [&str; 4] = ["qw", "qx", "qy", "qz"];

/// A name of the header row before its unit is known to be right.
pub(super) struct Cell {
    pub name: String,
    unit: Option<String>,
}

impl Cell {
    fn cut(field: &[u8]) -> Result<Cell, Box<Fault>> {
        let shown = || text::shown(text::bare(field));
        let bad = || Box::new(Fault::BadColumn { text: shown() });
        let written = std::str::from_utf8(text::bare(field)).map_err(|_| Box::new(Fault::NotUtf8))?;
        let (name, unit) = match written.split_once('[') {
            Some((name, rest)) => (name.trim(), Some(rest.strip_suffix(']').ok_or_else(bad)?.trim())),
            None => (written, None),
        };
        if name.is_empty() || name.contains([']', ',', '"']) || name.chars().any(char::is_control) {
            return Err(bad());
        }
        Ok(Cell { name: name.to_string(), unit: unit.map(str::to_string) })
    }
}

/// What a name means, before channels are numbered: its role, and what it must measure.
pub(super) type Meaning = Option<(Role, Quantity)>;

fn meaning(machine: &Machine, measured: Measurement, name: &str) -> Meaning {
    // A joint's name comes first: a machine may call its joints `r` and `d`.
    if let Some((dyad, joint)) = machine.joints().find(|(_, joint)| joint.name == name) {
        let command = machine.commands().iter().position(|c| c == name);
        return Some((command.map_or(Role::Follower(dyad), Role::Command), joint.kind.quantity()));
    }
    // Of the joints of a side branch the number follows.
    if let Some(joint) = machine.side_joint(name) {
        return Some((Role::Channel(0), joint.kind.quantity()));
    }
    if name == "t" {
        return Some((Role::Time, Quantity::Time));
    }
    if let Some(command) = name.strip_suffix("_direction")
        && let Some(command) = machine.commands().iter().position(|c| c == command)
    {
        return Some((Role::Direction(command), Quantity::One));
    }
    let at = |names: &[&str], from: usize, quantity| {
        names.iter().position(|n| *n == name).map(|k| (Role::Value(from + k), quantity))
    };
    match measured {
        Measurement::Distance { .. } => at(&["d"], 0, Quantity::Length).or(at(&["r"], 0, Quantity::Length)),
        Measurement::Position => at(&POSITION, 0, Quantity::Length),
        Measurement::Pose => at(&POSITION, 0, Quantity::Length).or(at(&ROTATION, 3, Quantity::Angle)).or(at(
            &QUATERNION,
            3,
            Quantity::One,
        )),
        Measurement::Displacement => at(&["s"], 0, Quantity::Length),
        Measurement::Joint { .. } => {
            let joint = name.strip_suffix("_meas")?;
            let (_, joint) = machine.joints().find(|(_, j)| j.name == joint)?;
            Some((Role::Value(0), joint.kind.quantity()))
        }
    }
}

impl Layout {
    /// Resolves the header row, and settles in the draft what hangs on it: the kind of distance, the measured joint.
    pub fn resolve(machine: &Machine, draft: &mut Draft, line: u64, row: &[u8]) -> Result<Layout, Fail> {
        let cells = cells(line, row)?;
        let Some(measured) = draft.measurement else {
            return Err(Fail::at(0, 0, Fault::NoMeasurement));
        };
        let mut columns: Vec<Column> = Vec::with_capacity(cells.len());
        let mut channels = Vec::new();
        for (i, cell) in cells.into_iter().enumerate() {
            let fail = |fault: Box<Fault>| Fail::at(line, i + 1, fault);
            if let Some(first) = columns.iter().position(|c| c.name == cell.name) {
                return Err(fail(Fault::DuplicateColumn { name: cell.name, first: first + 1 }.into()));
            }
            let meaning = meaning(machine, measured, &cell.name);
            let unit = unit(&cell, meaning).map_err(fail)?;
            if meaning.is_none() && unit.quantity == Quantity::One && cell.name.ends_with("_direction") {
                let known = machine.commands().to_vec();
                return Err(fail(Fault::DirectionOfNothing { name: cell.name, known }.into()));
            }
            let mut role = meaning.map_or(Role::Channel(0), |(role, _)| role);
            if let Role::Channel(number) = &mut role {
                *number = channels.len();
                channels.push(Channel { name: cell.name.clone(), unit });
            }
            columns.push(Column { name: cell.name, unit, role });
        }
        let find = |role| columns.iter().position(|c| c.role == role);
        let commands = 0..machine.commands().len();
        let layout = Layout {
            time: find(Role::Time),
            commands: commands.clone().map(|c| find(Role::Command(c))).collect(),
            values: values(machine, measured, &columns).map_err(|(column, f)| Fail::at(line, column, f))?,
            directions: commands.map(|c| find(Role::Direction(c))).collect(),
            followers: followers(machine, &columns),
            columns,
            channels,
        };
        layout.check_commands(machine, draft, line)?;
        layout.settle(machine, draft, measured, line)?;
        Ok(layout)
    }

    fn check_commands(&self, machine: &Machine, draft: &Draft, line: u64) -> Result<(), Fail> {
        for (c, name) in machine.commands().iter().enumerate() {
            let joint = name.clone();
            match (self.commands[c], draft.fixed[c]) {
                (Some(column), Some(_)) => {
                    return Err(Fail::at(line, column + 1, Fault::BothWays { joint }));
                }
                (None, None) => {
                    let unit = example_unit(machine.command_joint(c).kind.quantity());
                    let similar = similar(&self.columns, &[name]).map(|(number, name, _)| (number, name));
                    return Err(Fail::at(line, 0, Fault::MissingJoint { joint, unit, similar }));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// What of the header depends on the columns, and header keys that this measurement needs or ignores.
    fn settle(
        &self,
        machine: &Machine,
        draft: &mut Draft,
        measured: Measurement,
        line: u64,
    ) -> Result<(), Fail> {
        let name = &self.columns[self.values[0]].name;
        let measurement = match measured {
            Measurement::Distance { .. } => Measurement::Distance { absolute: name == "r" },
            Measurement::Joint { .. } => {
                let joint = name.strip_suffix("_meas").unwrap_or(name);
                let dyad = machine.joints().find(|(_, j)| j.name == joint).map_or(0, |(dyad, _)| dyad);
                Measurement::Joint { dyad }
            }
            other => other,
        };
        let header = &mut draft.header;
        header.measurement = measurement;
        let missing = |key: &str, example: &str| {
            let (measurement, key) = (measurement.word().to_string(), key.to_string());
            Fail::at(line, 0, Fault::MissingKey { measurement, key, example: example.into() })
        };
        if measurement == (Measurement::Distance { absolute: false })
            && header.nominal_length == NominalLength::NotGiven
        {
            return Err(missing(
                "nominal_length",
                "`# nominal_length[mm]: 100`, or `# nominal_length: unknown`",
            ));
        }
        if measurement == Measurement::Displacement && header.direction_w.is_none() {
            return Err(missing("direction", "`# direction: 0,0,1`, the direction of movement in frame w"));
        }
        let quantity = self.columns[self.values[0]].unit.quantity;
        if let Some(sigma) = header.sigma
            && sigma.quantity != quantity
            && measurement != Measurement::Pose
        {
            let (line, column, unit) = draft.sigma_at;
            let what = "header key `sigma`".to_string();
            let unit = unit.to_string();
            let known = Unit::symbols_of(quantity);
            return Err(Fail::at(
                line,
                column,
                Fault::WrongUnit { what, unit, found: sigma.quantity, known },
            ));
        }
        let (distance, joint) = (measured == Measurement::Distance { absolute: false }, measurement);
        let displacement = measured == Measurement::Displacement;
        for (key, has_meaning) in [
            ("zero", displacement || matches!(joint, Measurement::Joint { .. })),
            ("nominal_length", distance),
            ("direction", displacement),
            ("tool_rotation", measured == Measurement::Pose),
        ] {
            if let Some(line) = draft.line_of(key).filter(|_| !has_meaning) {
                let word = measurement.word();
                let warning =
                    format!("line {line}: header key `{key}` has no meaning for measurement `{word}`");
                draft.warnings.push(warning);
            }
        }
        Ok(())
    }
}

pub(super) fn cells(line: u64, row: &[u8]) -> Result<Vec<Cell>, Fail> {
    let mut fields = Vec::new();
    text::split(row, |field| fields.push(field));
    if fields.len() == 1 {
        for (separator, found) in [(b';', "semicolons"), (b'\t', "tabs")] {
            if row.trim_ascii().contains(&separator) {
                return Err(Fail::at(line, 0, Fault::Separator { found }));
            }
        }
    }
    if fields.iter().all(|f| text::number(f).is_some()) {
        return Err(Fail::at(line, 0, Fault::NoHeaderRow));
    }
    let cut = |(i, field)| Cell::cut(field).map_err(|fault| Fail::at(line, i + 1, fault));
    fields.into_iter().enumerate().map(cut).collect()
}

pub(super) fn unit(cell: &Cell, meaning: Meaning) -> Result<Unit, Box<Fault>> {
    let what = format!("column `{}`", text::shown(cell.name.as_bytes()));
    let expected = meaning.map(|(_, quantity)| quantity);
    let Some(symbol) = &cell.unit else {
        let example = expected.map_or("1", example_unit);
        let example = format!("`{}[{example}]`", text::shown(cell.name.as_bytes()));
        return Err(Fault::NoUnit { what, example, expected }.into());
    };
    let Some(unit) = Unit::named(symbol) else {
        return Err(Fault::UnknownUnit { what, unit: text::shown(symbol.as_bytes()), expected }.into());
    };
    match expected {
        Some(quantity) if quantity != unit.quantity => Err(Fault::WrongUnit {
            what,
            unit: symbol.clone(),
            found: unit.quantity,
            known: Unit::symbols_of(quantity),
        }
        .into()),
        _ => Ok(unit),
    }
}

/// A column that differs from one of the names only in case: its number, its name, the name expected.
fn similar(columns: &[Column], names: &[&String]) -> Option<(usize, String, String)> {
    columns.iter().enumerate().filter(|(_, c)| matches!(c.role, Role::Channel(_))).find_map(|(i, column)| {
        let name = names.iter().find(|n| n.eq_ignore_ascii_case(&column.name))?;
        Some((i + 1, column.name.clone(), name.to_string()))
    })
}

fn followers(machine: &Machine, columns: &[Column]) -> Vec<(usize, Drive)> {
    let drive = |(i, column): (usize, &Column)| match column.role {
        Role::Follower(dyad) => machine.drive(dyad).map(|drive| (i, drive.clone())),
        _ => None,
    };
    columns.iter().enumerate().filter_map(drive).collect()
}

/// Columns of the measured numbers in the order of the contract, or the fault with its column.
fn values(
    machine: &Machine,
    measured: Measurement,
    columns: &[Column],
) -> Result<Vec<usize>, (usize, Box<Fault>)> {
    let is_value = |c: &Column| matches!(c.role, Role::Value(_));
    let find = |name: &str| columns.iter().position(|c| is_value(c) && c.name == name);
    let both = |first: usize, second: usize| {
        let name = |i: usize| columns[i].name.clone();
        let (first, second) = (first.min(second), first.max(second));
        (second + 1, Box::new(Fault::TwoValues { first: name(first), second: name(second) }))
    };
    let lack = |names: &[String], example: &str| {
        let names: Vec<&String> = names.iter().collect();
        let missing = names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>();
        let either = matches!(measured, Measurement::Distance { .. });
        let missing = missing.join(if either { " or " } else { " " });
        let (measurement, example) = (measured.word().to_string(), example.to_string());
        let similar = similar(columns, &names);
        (0, Box::new(Fault::MissingValue { measurement, missing, example, similar }))
    };
    // All of these names, or the fault that says which of them are missing.
    let all = |names: &[&str], example: &str| {
        let missing: Vec<String> =
            names.iter().filter(|n| find(n).is_none()).map(|n| n.to_string()).collect();
        if !missing.is_empty() {
            return Err(lack(&missing, example));
        }
        Ok(names.iter().filter_map(|n| find(n)).collect::<Vec<_>>())
    };
    match measured {
        Measurement::Distance { .. } => match (find("d"), find("r")) {
            (Some(d), Some(r)) => Err(both(d, r)),
            (Some(only), None) | (None, Some(only)) => Ok(vec![only]),
            (None, None) => {
                let names = ["d".to_string(), "r".to_string()];
                let example = "`d[um]` (distance minus nominal length) or `r[mm]` (the distance itself)";
                Err(lack(&names, example))
            }
        },
        Measurement::Position => all(&POSITION, "`px[mm],py[mm],pz[mm]`"),
        Measurement::Displacement => all(&["s"], "`s[um]`"),
        Measurement::Pose => {
            let example = "`px[mm],py[mm],pz[mm]` and `rx[rad],ry[rad],rz[rad]` or `qw[1],qx[1],qy[1],qz[1]`";
            let mut found = all(&POSITION, example)?;
            let vector = ROTATION.iter().find_map(|n| find(n));
            let quaternion = QUATERNION.iter().find_map(|n| find(n));
            if let (Some(r), Some(q)) = (vector, quaternion) {
                return Err(both(r, q));
            }
            found.extend(if quaternion.is_some() {
                all(&QUATERNION, example)
            } else {
                all(&ROTATION, example)
            }?);
            Ok(found)
        }
        Measurement::Joint { .. } => {
            let found: Vec<usize> = (0..columns.len()).filter(|i| is_value(&columns[*i])).collect();
            match found[..] {
                [only] => Ok(vec![only]),
                [first, second, ..] => Err(both(first, second)),
                [] => {
                    let joints: Vec<_> = machine.joints().map(|(_, j)| format!("{}_meas", j.name)).collect();
                    let (_, joint) = machine.joints().next().unzip();
                    let unit = joint.map_or("mm", |j| example_unit(j.kind.quantity()));
                    let first = joints.first().map_or("x_meas", String::as_str);
                    let example = format!("after a joint: `{first}[{unit}]`");
                    let (column, fault) = lack(&joints, &example);
                    Err((column, Box::new(with_missing(*fault, "`JOINT_meas`"))))
                }
            }
        }
    }
}

fn with_missing(fault: Fault, text: &str) -> Fault {
    match fault {
        Fault::MissingValue { measurement, example, similar, .. } => {
            Fault::MissingValue { measurement, missing: text.into(), example, similar }
        }
        other => other,
    }
}
