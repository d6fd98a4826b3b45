//! A table without positions of the joints gets them from the path that ran.

use serde::{Deserialize, Serialize};

use super::align::{self, Found, Readings, SETTLED};
use super::cell;
use super::heading::Heading;
use super::map::{Known, MappedColumn};
use super::moment;
use super::nominal::Nominal;
use super::plan::{Kind, Plan, Source};
use super::shapes::{Shapes, instrument};
use super::table::{Row, Table};
use crate::error::{Error, Place, Result};
use crate::lie::Twist;
use crate::machine::{JointKind, Machine};
use crate::recording::{Recording, ToolPoint};

/// Fewer readings than these say nothing of where a path begins.
const FEWEST: usize = 60;
/// Largest standard uncertainty of an end, as part of the path.
const UNSURE: f64 = 0.02;
/// What the path may leave of the readings that is neither noise nor explained, as part of their variance.
const UNEXPLAINED: f64 = 0.5;
/// Readings that a bar cannot have made: it ends at about a millimetre. Larger ones are a wrong path or a wrong unit, m.
const FURTHEST: f64 = 0.5;

/// Where a path lies in readings that came without positions, and how sure that is.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// When the path begins, from the first reading, s.
    pub start_s: f64,
    /// Its standard uncertainty, s.
    pub start_error_s: f64,
    /// When it ends, from the first reading, s.
    pub end_s: f64,
    /// Its standard uncertainty, s.
    pub end_error_s: f64,
    /// Readings a second, as told or as found.
    pub sample_rate: f64,
    /// What a shift by these uncertainties changes in the readings, m RMS: errors of the machine below it may be the alignment's.
    pub hides_m: f64,
    /// RMS of the readings about their mean, m.
    pub spread_m: f64,
    /// RMS of what constant errors, play and lag along this path leave of them, m.
    pub left_m: f64,
    /// Noise of a reading, m.
    pub noise_m: f64,
    /// Readings before and behind the path; they are left out.
    pub outside: usize,
}

/// The table with the columns of all joints, and the map that takes them.
pub(super) struct Followed {
    pub table: Table,
    pub known: Known,
    pub alignment: Alignment,
    pub told: Vec<String>,
}

pub(super) fn follow(
    table: &Table,
    mut known: Known,
    machine: &Machine,
    path: &Nominal,
    sample_rate: Option<f64>,
) -> Result<Followed> {
    let mut table = table.clone();
    let file = table.file.clone();
    let fault = |what: String, mend: &str| Error::mistake(Place::file(&file), what, mend);
    if path.commands[0].len() != machine.commands().len() {
        return Err(fault("the path is of another machine".into(), "make it of the machine of this table"));
    }
    let head = |key: &str| {
        known.map.head.iter().any(|line| {
            let line = line.trim_start_matches(['#', ' ']);
            line.split([':', '[']).next().is_some_and(|own| own.trim() == key)
        })
    };
    let own: Vec<String> = path.head.iter().filter(|line| !head(key_of(line))).cloned().collect();
    known.map.head.extend(own);
    let plan = Plan::new(&known, &table, Some(machine))?;
    if let Some(joint) = plan.columns.iter().find(|c| machine.commands().contains(&c.name)) {
        let what = format!("the table has positions of joint `{}`: no path is needed", joint.name);
        return Err(fault(what, "leave `--path` out, or the column"));
    }
    let measured: Vec<&Source> = measured(&plan);
    let clock = plan.columns.iter().find(|c| matches!(c.kind, Kind::Time)).map(|c| &c.source);
    if clock.is_some() && sample_rate.is_some() {
        return Err(fault(
            "the table has a column of time: no rate is needed".into(),
            "leave `--sample-rate` out",
        ));
    }
    table
        .rows
        .retain(|row| plan.rows.iter().all(|(column, text)| row.fields.get(*column) == Some(text.as_str())));
    let (readings, clocks) = readings(&table, &measured, clock, sample_rate)?;

    let header = sample(&known, &plan, machine, &table)?;
    let header = header.header();
    if header.workpiece_frame_unknown || !matches!(header.tool_point, ToolPoint::Known(_)) {
        let what =
            "where the measured points stand is not known: the path cannot be laid beside the readings";
        let mend = "say roughly where: `tool_point`, `workpiece_point` in the head, in place of `unknown`";
        return Err(fault(what.into(), mend));
    }
    let Some((sensor, state)) = instrument(header) else {
        let what = format!("readings of `{}` cannot be laid beside a path", header.measurement.word());
        return Err(fault(
            what,
            "give a distance, a displacement or a position, or the positions of the joints",
        ));
    };
    let m = sensor.reading_count();
    if measured.len() != m {
        return Err(fault(
            "the map does not take all that was measured".into(),
            "take `d`, `r`, `s`, or `px py pz`",
        ));
    }
    let count = readings.clock.len();
    if count < FEWEST {
        let what = format!("{count} readings, expected at least {FEWEST}: too few to find a path in them");
        return Err(fault(what, "capture the whole path, with a moment of standstill before and behind it"));
    }
    let noise = align::noise(&readings.values, m);
    let unlike = |k: usize| (readings.values[k] - readings.values[k % m]).abs() > 0.0;
    if noise == 0.0 || !(0..readings.values.len()).any(unlike) {
        let what = "all readings are the same: there is nothing to find the path by";
        return Err(fault(what.into(), "is it the right column? export the readings with all their digits"));
    }
    let noise = noise.max(1e-9);
    let in_seconds = clock.is_some() || sample_rate.is_some();
    let told = in_seconds.then_some(path.duration());
    let lasts = readings.clock[count - 1] - readings.clock[0];
    if let Some(told) = told.filter(|told| lasts < 0.9 * told) {
        let what = format!("readings last {lasts:.3} s, the path {told:.3} s: they are not of all of it");
        let mend = "give the path that was captured, its true feed, and its stops (`--dwell`)";
        return Err(fault(what, mend));
    }
    let free =
        header.zero_unknown || !matches!(header.nominal_length, crate::recording::NominalLength::Known(_));
    let instrument = (sensor, state);
    let shapes_about =
        |dh: &[Twist<f64>], gaps: &[f64]| Shapes::new(machine, (dh, gaps), path, &instrument, free, noise);
    let shapes =
        shapes_about(&vec![Twist::zero(0.0); machine.dyads().len()], &vec![0.0; machine.commands().len()]);
    let far = readings
        .values
        .iter()
        .zip(shapes.nominal.iter().cycle())
        .fold(0.0f64, |m, (y, h)| m.max((y - h).abs()));
    if far > FURTHEST && path_is_level(&shapes) {
        let what = format!("a reading is {:.3} m from what the path has", far);
        return Err(fault(what, "check the unit of the readings, and `nominal_length` in the head"));
    }
    let found = align::align(
        &shapes,
        |at, amounts| shapes_about(&at.deviations(amounts), &at.gaps(amounts)),
        &readings,
        noise,
        told,
    )
    .ok_or_else(|| {
        fault(
            "no beginning and end of the path can be found: the readings look alike wherever it is laid"
                .into(),
            "capture both senses of travel, with a stop between and a standstill before and behind",
        )
    })?;
    judge(&found, path, &readings, noise, in_seconds).map_err(|(what, mend)| fault(what, mend))?;

    let per_clock = path.duration() / (found.ends[1] - found.ends[0]);
    // Numbers of samples become seconds by the path, which knows its feed.
    let to_seconds = |x: f64| if in_seconds { x } else { x * per_clock };
    let step = lasts / (count - 1) as f64;
    let alignment_of = |outside: usize| Alignment {
        start_s: to_seconds(found.ends[0] - readings.clock[0]),
        start_error_s: to_seconds(found.errors[0]),
        end_s: to_seconds(found.ends[1] - readings.clock[0]),
        end_error_s: to_seconds(found.errors[1]),
        sample_rate: to_seconds(step).recip(),
        hides_m: found.hides,
        spread_m: found.spread,
        left_m: found.left,
        noise_m: noise,
        outside,
    };
    let time = clock.is_none();
    let slack = 0.5 * step;
    let all = table.rows.len();
    let mut rows = Vec::with_capacity(all);
    for (row, x) in table.rows.iter().zip(&clocks) {
        let Some(x) = x.filter(|x| *x >= found.ends[0] - slack && *x <= found.ends[1] + slack) else {
            continue;
        };
        let mut fields = row.fields.clone();
        let q = path.at((x - found.ends[0]) * per_clock);
        let mut push = |number: String| {
            fields.push_field(&if table.decimal_comma { number.replace('.', ",") } else { number });
        };
        if time {
            push(format!("{:.6}", to_seconds(x - readings.clock[0])));
        }
        for (c, q) in q.iter().enumerate() {
            push(format!("{:.7}", q * scale(machine, c).0 + 0.0));
        }
        rows.push(Row { line: row.line, fields });
    }
    let outside = all - rows.len();
    table.rows = rows;
    let mut parts = Vec::new();
    let mut heading = |to: &str, unit: &str| {
        table.headings.push(Heading::read(&format!("{to} of the path [{unit}]")));
        parts.push(MappedColumn {
            unit: Some(unit.into()),
            ..MappedColumn::new(to, format!("#{}", table.headings.len()))
        });
    };
    if time {
        heading("t", "s");
    }
    for (c, name) in machine.commands().iter().enumerate() {
        heading(name, scale(machine, c).1);
    }
    parts.append(&mut known.map.columns);
    known.map.columns = parts;
    let alignment = alignment_of(outside);
    let told = alignment.words(path, in_seconds);
    Ok(Followed { table, known, alignment, told })
}

fn key_of(line: &str) -> &str {
    line.split([':', '[']).next().unwrap_or_default().trim()
}

fn scale(machine: &Machine, command: usize) -> (f64, &'static str) {
    match machine.command_joint(command).kind {
        JointKind::Prismatic => (1e3, "mm"),
        JointKind::Revolute => (1f64.to_degrees(), "deg"),
    }
}

/// Whether nominal readings are about the same all along.
fn path_is_level(shapes: &Shapes) -> bool {
    let first = &shapes.nominal[..shapes.readings];
    shapes.nominal.chunks(shapes.readings).all(|h| h.iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-3))
}

/// Sources of what was measured, in the order of the instrument's readings.
fn measured(plan: &Plan) -> Vec<&Source> {
    let names = ["d", "r", "s", "px", "py", "pz"];
    names.iter().filter_map(|name| plan.columns.iter().find(|c| c.name == *name)).map(|c| &c.source).collect()
}

/// Readings without drop-outs, and the clock of every row.
fn readings(
    table: &Table,
    measured: &[&Source],
    clock: Option<&Source>,
    rate: Option<f64>,
) -> Result<(Readings, Vec<Option<f64>>)> {
    let mut readings = Readings { clock: Vec::new(), values: Vec::new() };
    let (mut clocks, mut zero) = (Vec::with_capacity(table.rows.len()), None);
    for (k, row) in table.rows.iter().enumerate() {
        let x = match clock {
            None => Some(k as f64 / rate.unwrap_or(1.0)),
            Some(source) => {
                let field = row.fields.get(source.column).unwrap_or_default();
                if cell::is_drop_out(field) {
                    None
                } else if let Some(moment) = super::write::stamp(field, table.decimal_comma).filter(|_| {
                    moment::read(field).is_some() || cell::plain(field, table.decimal_comma).is_some()
                }) {
                    let zero = *zero.get_or_insert(moment);
                    let date = moment::read(field).is_some();
                    let since = moment.since(zero);
                    Some(if date { since } else { source.si(since) - source.si(0.0) })
                } else {
                    return Err(table.fault(
                        row,
                        source.column,
                        "no time stamp",
                        "write it as the rows above have it",
                    ));
                }
            }
        };
        if let (Some(x), Some(last)) = (x, readings.clock.last())
            && x < *last
        {
            let column = clock.map_or(0, |source| source.column);
            let mend = "give one capture a file, or take one by `--where`";
            return Err(table.fault(row, column, "time goes backwards", mend));
        }
        let mut values = Vec::with_capacity(measured.len());
        for source in measured {
            values.extend(table.number(row, source.column)?.map(|number| source.si(number)));
        }
        if let Some(x) = x.filter(|_| values.len() == measured.len()) {
            readings.clock.push(x);
            readings.values.extend(values);
        }
        clocks.push(x);
    }
    Ok((readings, clocks))
}

/// A recording without rows that has the head and the columns of the one to come.
fn sample(known: &Known, plan: &Plan, machine: &Machine, table: &Table) -> Result<Recording> {
    let map = &known.map;
    let mut text = format!("# measurement: {}\n", map.measurement);
    for line in &map.head {
        text.push_str(&format!("# {}\n", line.trim_start_matches(['#', ' ']).replace(['\n', '\r'], " ")));
    }
    let joints =
        machine.commands().iter().enumerate().map(|(c, name)| format!("{name}[{}]", scale(machine, c).1));
    let others = plan.columns.iter().map(|c| format!("{}[{}]", c.name, c.source.unit.unit));
    text.push_str(&format!("{}\n", joints.chain(others).collect::<Vec<_>>().join(",")));
    Recording::from_bytes(&table.file.to_string_lossy(), text.into_bytes(), machine).map_err(|error| {
        match error {
            Error::Input { place, fault } => {
                let line = place.line;
                let what = format!("what was found makes no recording (line {line} of its head): {fault}");
                known.fault("", what, fault.mend())
            }
            other => other,
        }
    })
}

/// Refuses an alignment that is not sure.
fn judge(
    found: &Found,
    path: &Nominal,
    readings: &Readings,
    noise: f64,
    in_seconds: bool,
) -> std::result::Result<(), (String, &'static str)> {
    let duration = found.ends[1] - found.ends[0];
    let clock = |x: f64| match in_seconds {
        true => format!("{:.3} s", x - readings.clock[0]),
        false => format!("reading {:.0}", x - readings.clock[0]),
    };
    if found.followed < SETTLED {
        let what = format!(
            "the readings do not follow the path: {:.3} um RMS, noise {:.3} um",
            found.spread * 1e6,
            noise * 1e6
        );
        return Err((
            what,
            "a machine without visible errors cannot be aligned; read positions beside the bar",
        ));
    }
    let unexplained = found.left.powi(2) - noise.powi(2);
    if unexplained > UNEXPLAINED * (found.spread.powi(2) - noise.powi(2)).max(0.0) {
        let what = format!(
            "the path does not explain the readings: of {:.3} um RMS it leaves {:.3} um",
            found.spread * 1e6,
            found.left * 1e6
        );
        let mend = "check that this path ran: plane, senses, start, feed, stops, the order of turns; and the unit of the readings";
        return Err((what, mend));
    }
    if let Some((other, worse)) = found.rival.filter(|(_, worse)| *worse < SETTLED) {
        let what = format!(
            "two alignments are about as good ({worse:.1} apart, expected at least {SETTLED}): from {} to {}, and from {} to {}",
            clock(found.ends[0]),
            clock(found.ends[1]),
            clock(other[0]),
            clock(other[1])
        );
        let mend = "check that this path ran; capture both senses of travel with a stop between, and a standstill before and behind; tell the rate by `--sample-rate`";
        return Err((what, mend));
    }
    if found.errors.iter().any(|e| e.is_nan() || *e >= UNSURE * duration) {
        let part = found.errors[0].max(found.errors[1]) / duration * path.duration();
        let what =
            format!("the path can be shifted by {:.1} ms without a difference that is seen", part * 1e3);
        let mend = "capture both senses of travel with a stop between, and a standstill before and behind";
        return Err((what, mend));
    }
    Ok(())
}

impl Alignment {
    fn words(&self, path: &Nominal, in_seconds: bool) -> Vec<String> {
        let samples = |s: f64| s * self.sample_rate;
        let tempo = (self.end_s - self.start_s) / path.duration();
        let rate = match in_seconds {
            true => format!("it took {:.2} % of the time that feed and stops make", tempo * 100.0),
            false => format!("readings are taken as {:.3} a second, by the path's feed", self.sample_rate),
        };
        let mut told = vec![
            format!(
                "the path begins {:.4} s behind the first reading (+-{:.2} ms, {:.2} samples) and ends at {:.4} s (+-{:.2} ms); {rate}",
                self.start_s,
                self.start_error_s * 1e3,
                samples(self.start_error_s),
                self.end_s,
                self.end_error_s * 1e3
            ),
            format!(
                "a shift of that size changes the readings by {:.3} um RMS; errors of the machine below that may be the alignment's",
                self.hides_m * 1e6
            ),
            format!(
                "of {:.3} um RMS about their mean, {:.3} um are left along this path (noise {:.3} um)",
                self.spread_m * 1e6,
                self.left_m * 1e6,
                self.noise_m * 1e6
            ),
            "a lag that all axes share cannot be told from a later start; the path is taken as it was told: a wrong plane or sense may fit as well"
                .into(),
        ];
        if self.outside > 0 {
            told.push(format!(
                "{} before and behind the path are left out",
                crate::wording::count(self.outside as u64, "reading", "readings")
            ));
        }
        told
    }
}
