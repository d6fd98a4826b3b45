//! R-tests: a ball on the table stands where the tool should be while rotary axes turn, and a nest in the spindle reads by how much it does not.
//!
//! The table has positions of rotary axes and deviations of the ball. Linear axes follow, so that they are where the nominal machine needs
//! them; what the recording holds is where the tool point stood in frame `w`:
//!
//! ```text
//! p_w = ball_w - e_w          e_w: ball less tool point, along the axes of frame w
//! e_w = R_w_from_t e_t = R_w_from_b e_b
//! ```
//!
//! A nest reads along the axes of frame t, in which it stands; a control or an evaluation may write the same along the axes of the machine's
//! base or of the workpiece, which turn with the table. Headings do not tell these apart, so it is asked.

use super::Request;
use super::deviations::Measured;
use super::draft::Draft;
use super::guess;
use super::heading::Heading;
use super::joints;
use super::map::{Known, Map, MappedColumn};
use super::plan::Plan;
use super::table::{Row, Table};
use crate::chain::{Chain, Sweep};
use crate::error::{Error, Place, Result};
use crate::lie::Vec3;
use crate::machine::{JointKind, Machine};
use crate::simulate::follow;
use crate::units::{Quantity, Unit};

/// Words of a deviation besides its axis.
const DEVIATION: [&str; 14] = [
    "d",
    "delta",
    "\u{3b4}",
    "dev",
    "deviation",
    "error",
    "err",
    "e",
    "abw",
    "abweichung",
    "diff",
    "offset",
    "ball",
    "sphere",
];
/// Axes along which deviations were read, as `--axes` calls them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axes {
    Tool,
    Machine,
    Workpiece,
}

impl Axes {
    fn named(word: &str) -> Option<Axes> {
        Some(match word {
            "tool" => Axes::Tool,
            "machine" => Axes::Machine,
            "workpiece" => Axes::Workpiece,
            _ => return None,
        })
    }

    /// A deviation along these axes, along those of frame w.
    fn to_w(self, sweep: &Sweep<f64>, e: Vec3<f64>) -> Vec3<f64> {
        match self {
            Axes::Tool => sweep.w_from_t().rotation * e,
            Axes::Machine => sweep.b_from_w().rotation.transpose() * e,
            Axes::Workpiece => e,
        }
    }

    fn told(self) -> &'static str {
        match self {
            Axes::Tool => "deviations are taken along the axes of frame t, in which the nest stands",
            Axes::Machine => "deviations are taken along the axes of the machine's base",
            Axes::Workpiece => {
                "deviations are taken along the axes of frame w, which turn with the workpiece"
            }
        }
    }
}

/// What linear axes may leave between tool and ball, m.
const CLOSED: f64 = 1e-9;

/// The recording of such a table.
pub(super) fn read(table: &Table, machine: &Machine, request: &Request) -> Result<Measured> {
    let mut draft = Draft::new(table, machine, request);
    draft.map.names.clone_from(&request.names);
    draft.map.rows.clone_from(&request.rows);
    draft.map.head.clone_from(&request.head);
    draft.map.measurement = "position".into();
    guess::named(&mut draft)?;
    guess::time(&mut draft);
    let missing = joints::found(&mut draft);
    let is_linear = |joint: &String| {
        let own = machine.commands().iter().position(|name| name == joint);
        own.is_some_and(|c| machine.command_joint(c).kind == JointKind::Prismatic)
    };
    let linear: Vec<String> = machine.commands().iter().filter(|joint| is_linear(joint)).cloned().collect();
    let (followed, open): (Vec<String>, Vec<String>) = missing.into_iter().partition(is_linear);
    joints::ask(&mut draft, &open);
    if !followed.is_empty() && followed.len() < linear.len() {
        // Some of them were recorded: nobody knows why the others were not.
        joints::ask(&mut draft, &followed);
    }
    for (to, axis) in ["px", "py", "pz"].into_iter().zip(["x", "y", "z"]) {
        deviation(&mut draft, to, axis);
    }
    let ball = point(&mut draft, "workpiece_point", None);
    let tool_t = point(&mut draft, "tool_point", Some(Vec3([0.0; 3])));
    let sign = match request.deviation.as_deref() {
        Some("ball-minus-tool") => 1.0,
        Some("tool-minus-ball") => -1.0,
        _ => {
            draft.ask(
                "what the deviations are: the ball as seen from the tool, or the tool as seen from the ball",
                "--deviation ball-minus-tool|tool-minus-ball",
            );
            1.0
        }
    };
    let axes = request.axes.as_deref().and_then(Axes::named);
    if axes.is_none() {
        draft.ask(
            "along which axes the deviations were read: of frame t, in which the nest stands, of the machine's base, or of the workpiece, which turn with the table",
            "--axes tool|machine|workpiece",
        );
    }
    let (map, mut told) = draft.closed()?;
    let axes = axes.unwrap_or(Axes::Tool);
    told.push(axes.told().into());
    let (Some(ball), Some(tool_t)) = (ball, tool_t) else {
        return Err(Error::mistake(
            Place::file(&table.file),
            "no place of the ball",
            "--head 'workpiece_point[mm]: X,Y,Z'",
        ));
    };
    let known = Known::guessed(map, &table.file);
    let plan = Plan::new(&known, table, Some(machine))?;
    let solve: Vec<usize> =
        (0..machine.commands().len()).filter(|c| followed.contains(&machine.commands()[*c])).collect();
    let mut still = Vec::new();
    for (c, joint) in machine.commands().iter().enumerate() {
        let linear = machine.command_joint(c).kind == JointKind::Prismatic;
        let (quantity, unit) = if linear { (Quantity::Length, "mm") } else { (Quantity::Angle, "deg") };
        still.push(fixed(&known.map.head, joint, quantity).ok_or_else(|| {
            let what = format!("where joint `{joint}` stands still is no number with its unit");
            Error::mistake(Place::file(&table.file), what, format!("--head 'fixed {joint}[{unit}]: 0'"))
        })?);
    }
    let still = &still;
    let written =
        Sheet { table, machine, plan: &plan, solve: &solve, ball, tool_t, sign, axes, still }.written()?;
    Ok(finished(table, &known.map, machine, written, &solve, told))
}

/// Takes the column of the deviation along an axis.
fn deviation(draft: &mut Draft, to: &str, axis: &str) {
    if draft.has(to) {
        return;
    }
    let names = |i: &usize| {
        let words = &draft.table.headings[*i].words;
        let joined = |word: &String| {
            ["d", "e", "\u{3b4}", "delta"].iter().any(|before| *word == format!("{before}{axis}"))
        };
        let own = words.iter().filter(|word| *word == axis).count();
        let rest = words.iter().filter(|word| *word != axis);
        let said = rest.clone().count() > 0 && rest.clone().all(|word| DEVIATION.contains(&word.as_str()));
        (own == 1 && said)
            || (words.iter().any(joined)
                && words.iter().all(|w| joined(w) || DEVIATION.contains(&w.as_str())))
    };
    let found: Vec<usize> = draft.free(Some(Quantity::Length)).into_iter().filter(names).collect();
    match found[..] {
        [column] => draft.take(to, column, None),
        _ => {
            let free = draft.free(Some(Quantity::Length));
            let what = format!(
                "column of the deviation along {axis}; columns without a part: {}",
                draft.named(&free)
            );
            draft.ask(what, format!("--column '{to}=NAME'"));
        }
    }
}

/// A point of the head, m; asked where nobody says it and nothing stands for it.
fn point(draft: &mut Draft, key: &str, otherwise: Option<Vec3<f64>>) -> Option<Vec3<f64>> {
    let line = draft.map.head.iter().find(|line| {
        line.trim_start_matches(['#', ' ']).split([':', '[']).next().is_some_and(|own| own.trim() == key)
    });
    let read = |line: &String| -> Option<Vec3<f64>> {
        let three: [f64; 3] = stated(line, Quantity::Length)?.try_into().ok()?;
        Some(Vec3(three))
    };
    match line {
        Some(line) => {
            let found = read(line);
            if found.is_none() {
                let what =
                    format!("`{}` is no point whose coordinates are known", crate::wording::shown(line));
                draft.ask(what, format!("--head '{key}[mm]: X,Y,Z'"));
            }
            found
        }
        None if otherwise.is_some() => otherwise,
        None => {
            draft.ask("where the ball stands on the table, in frame w", format!("--head '{key}[mm]: X,Y,Z'"));
            None
        }
    }
}

/// The numbers of a line of the head, SI: `key[mm]: 1, 2, 3`.
fn stated(line: &str, quantity: Quantity) -> Option<Vec<f64>> {
    let (before, behind) = line.split_once(':')?;
    let unit = Unit::named(before.split_once('[')?.1.trim().strip_suffix(']')?)?;
    let numbers = behind.split(',').map(|x| x.trim().parse::<f64>().ok().filter(|x| x.is_finite()));
    let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
    (unit.quantity == quantity).then(|| numbers.into_iter().map(|x| unit.to_si(x)).collect())
}

/// Where a joint stands that the head says to stand still; 0 where it says nothing of it.
fn fixed(head: &[String], joint: &str, quantity: Quantity) -> Option<f64> {
    let key = |line: &&String| {
        let key = line.trim_start_matches(['#', ' ']).split(['[', ':']).next().unwrap_or_default().trim();
        key.strip_prefix("fixed").is_some_and(|name| name.trim() == joint)
    };
    match head.iter().find(key) {
        Some(line) => stated(line, quantity)?.first().copied(),
        None => Some(0.0),
    }
}

/// What makes rows of the recording of rows of the table.
struct Sheet<'a> {
    table: &'a Table,
    machine: &'a Machine,
    plan: &'a Plan,
    /// Commands of linear axes that follow.
    solve: &'a [usize],
    ball: Vec3<f64>,
    tool_t: Vec3<f64>,
    sign: f64,
    axes: Axes,
    /// Commands of what the head says to stand still; 0 of the others.
    still: &'a [f64],
}

impl Sheet<'_> {
    fn written(&self) -> Result<Vec<Row>> {
        let chain = Chain::nominal(self.machine);
        let taken = |row: &&Row| {
            self.plan.rows.iter().all(|(column, text)| row.fields.get(*column) == Some(text.as_str()))
        };
        self.table.rows.iter().filter(taken).map(|row| self.row(&chain, row)).collect()
    }

    /// Commands, then the measured point, mm and deg; columns of the table that are copied stand behind them.
    fn row(&self, chain: &Chain<f64>, row: &Row) -> Result<Row> {
        let commands = self.machine.commands();
        let value = |name: &str| -> Result<Option<f64>> {
            let Some(column) = self.plan.columns.iter().find(|own| own.name == name) else { return Ok(None) };
            Ok(self.table.number(row, column.source.column)?.map(|x| column.source.si(x)))
        };
        let mut q = self.still.to_vec();
        let mut whole = true;
        for (c, command) in commands.iter().enumerate().filter(|(c, _)| !self.solve.contains(c)) {
            match value(command)? {
                Some(own) => q[c] = own,
                None => whole &= self.plan.columns.iter().all(|own| own.name != *command),
            }
        }
        let e = ["px", "py", "pz"].map(&value);
        let mut fields: Vec<String> = Vec::new();
        let mut p = None;
        if whole {
            if !self.solve.is_empty() {
                let left = follow(chain, self.machine, self.solve, self.tool_t, self.ball, &mut q);
                if left > CLOSED {
                    let what = format!("the linear axes leave {:.3} mm between tool and ball", left * 1e3);
                    let mend = "compare the place of the ball and the machine file; a machine without three linear axes needs their columns";
                    return Err(self.table.fault(row, 0, what, mend));
                }
            }
            let [x, y, z] = e;
            if let (Some(x), Some(y), Some(z)) = (x?, y?, z?) {
                let e_w = self.axes.to_w(&chain.sweep(&q), Vec3([x, y, z]).times(self.sign));
                p = Some(self.ball - e_w);
            }
        }
        for (c, _) in commands.iter().enumerate().filter(|(_, name)| self.takes(name)) {
            let linear = self.machine.command_joint(c).kind == JointKind::Prismatic;
            fields.push(if whole {
                decimal(if linear { q[c] * 1e3 } else { q[c].to_degrees() })
            } else {
                String::new()
            });
        }
        for k in 0..3 {
            fields.push(p.map_or(String::new(), |p| decimal(p.0[k] * 1e3)));
        }
        for column in self.plan.columns.iter().filter(|own| is_kept(own, commands)) {
            fields.push(row.fields.get(column.source.column).unwrap_or_default().to_string());
        }
        Ok(Row { line: row.line, fields: fields.iter().collect() })
    }

    /// Whether a command has a column of the recording: the others are fixed in its head.
    fn takes(&self, command: &String) -> bool {
        let solved = self.solve.iter().any(|c| self.machine.commands()[*c] == *command);
        solved || self.plan.columns.iter().any(|own| own.name == *command)
    }
}

/// Columns that stay as they are: time, directions, temperatures.
fn is_kept(column: &super::plan::Column, commands: &[String]) -> bool {
    !commands.contains(&column.name) && !["px", "py", "pz"].contains(&column.name.as_str())
}

/// To a tenth of a nanometre or a ten-millionth of a degree, without the dust of solving.
fn decimal(x: f64) -> String {
    format!("{:?}", (x * 1e7).round() / 1e7 + 0.0)
}

/// The new table with its map, and what is told of it.
fn finished(
    table: &Table,
    map: &Map,
    machine: &Machine,
    rows: Vec<Row>,
    solve: &[usize],
    mut told: Vec<String>,
) -> Measured {
    let commands = machine.commands();
    let taken = |name: &str| map.columns.iter().find(|part| part.to == name);
    let mut names: Vec<(String, String)> = Vec::new();
    for (c, command) in commands.iter().enumerate() {
        if solve.contains(&c) || taken(command).is_some() {
            let unit = if machine.command_joint(c).kind == JointKind::Prismatic { "mm" } else { "deg" };
            names.push((command.clone(), unit.into()));
        }
    }
    names.extend(["px", "py", "pz"].map(|name| (name.to_string(), "mm".to_string())));
    let mut columns: Vec<MappedColumn> = Vec::new();
    let mut headings: Vec<Heading> = Vec::new();
    for (name, unit) in &names {
        columns.push(MappedColumn {
            unit: Some(unit.clone()),
            ..MappedColumn::new(name, format!("#{}", headings.len() + 1))
        });
        headings.push(Heading::read(&format!("{name} [{unit}]")));
    }
    let kept = map
        .columns
        .iter()
        .filter(|part| !commands.contains(&part.to) && !["px", "py", "pz"].contains(&part.to.as_str()));
    // In the order of the plan: time first.
    let mut kept: Vec<&MappedColumn> = kept.collect();
    kept.sort_by_key(|part| part.to != "t");
    for part in kept {
        columns.push(MappedColumn { from: format!("#{}", headings.len() + 1), ..part.clone() });
        headings.push(Heading::read(&part.from));
    }
    let head =
        map.head.iter().filter(|line| !line.trim_start_matches(['#', ' ']).starts_with("workpiece_point"));
    let map = Map {
        head: head.cloned().collect(),
        columns,
        rows: Default::default(),
        names: Vec::new(),
        ..map.clone()
    };
    if !solve.is_empty() {
        let names: Vec<&str> = solve.iter().map(|c| commands[*c].as_str()).collect();
        told.push(format!(
            "{} are where the nominal machine needs them to keep the tool at the ball",
            names.join(", ")
        ));
    }
    if !map.head.iter().any(|line| line.trim_start_matches(['#', ' ']).starts_with("workpiece_frame")) {
        told.push("the place of the ball is taken as known; if it was not measured on the machine, say --head 'workpiece_frame: unknown'".into());
    }
    let table = Table {
        file: table.file.clone(),
        headings,
        line: 0,
        rows,
        separator: None,
        decimal_comma: table.decimal_comma,
    };
    Measured { table, map, told, positioning: None, is_rearranged: true }
}
