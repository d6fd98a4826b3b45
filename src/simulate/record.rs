//! A recording as it is written: header, header row, rows; streamed.

use std::fmt::Write as _;
use std::io::Write;

use rand::rngs::StdRng;

use super::course::{Sample, within_travel};
use super::instrument::Instrument;
use super::plant::{Plant, State};
use crate::error::{Error, Result};
use crate::lie::Vec3;
use crate::machine::{FileUnits, JointKind, Machine};
use crate::sensor::Sensor;
use crate::units::{Quantity, Unit};

/// Resolution that the written digits must keep, m or rad.
const FINEST: f64 = 1e-10;

/// How a recording is written.
#[derive(Clone, Debug, PartialEq)]
pub struct Style {
    /// Units of commands.
    pub commands: FileUnits,
    /// Units of what is measured.
    pub measured: FileUnits,
    /// Whether there is a column `t`.
    pub time: bool,
    /// What a drop-out is written as: nothing, or `NaN`.
    pub drop_out: &'static str,
}

impl Style {
    /// m and rad everywhere, with a column `t`.
    pub fn si() -> Self {
        Style { commands: FileUnits::si(), measured: FileUnits::si(), time: true, drop_out: "" }
    }
}

/// What the header says of values that the instrument's user does not know, and of the set-up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Claims {
    /// `# setup:`.
    pub setup: Option<String>,
    /// `# workpiece_frame: unknown`.
    pub frame_unknown: bool,
    /// `# tool_point: unknown NAME`.
    pub tool_point_unknown: Option<String>,
    /// `# nominal_length: unknown`.
    pub length_unknown: bool,
    /// `# zero: unknown`.
    pub zero_unknown: bool,
    /// The length that the header gives, where it is not the true one, m.
    pub length: Option<f64>,
    /// `# sigma`: of lengths, m, or of angles, rad.
    pub sigma: Option<f64>,
    /// Further lines, without `# `.
    pub lines: Vec<String>,
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Written {
    /// Rows, drop-outs included.
    pub rows: u64,
    /// Drop-outs.
    pub dropped: u64,
    /// Time from the first row to the last, s.
    pub seconds: f64,
    /// Range of each command over all samples, recorded or not, m or rad.
    pub travel: Vec<(f64, f64)>,
}

/// Writes the recording of one course.
pub struct Recorder<'a> {
    machine: &'a Machine,
    instrument: &'a Instrument,
    style: &'a Style,
    directions: bool,
    line: String,
    first_time: Option<f64>,
    written: Written,
}

impl<'a> Recorder<'a> {
    /// `directions`: whether there are columns of the directions of approach.
    pub fn new(machine: &'a Machine, instrument: &'a Instrument, style: &'a Style, directions: bool) -> Self {
        let nothing = (f64::INFINITY, f64::NEG_INFINITY);
        let written = Written { travel: vec![nothing; machine.commands().len()], ..Written::default() };
        Recorder { machine, instrument, style, directions, line: String::new(), first_time: None, written }
    }

    /// Header lines and header row.
    pub fn head(&self, claims: &Claims) -> String {
        let (machine, state) = (self.machine, &self.instrument.state);
        let length = self.style.commands.length;
        let mut text =
            format!("# machine: {}\n# measurement: {}\n", machine.name(), self.instrument.sensor.name());
        let mut line = |text_of: String| {
            let _ = writeln!(text, "# {text_of}");
        };
        if let Some(setup) = &claims.setup {
            line(format!("setup: {setup}"));
        }
        if claims.frame_unknown {
            line("workpiece_frame: unknown".into());
        }
        if let Sensor::Distance { absolute: false } = self.instrument.sensor {
            line(match claims.length_unknown {
                true => "nominal_length: unknown".into(),
                false => format!(
                    "nominal_length[{length}]: {}",
                    length.write_si(claims.length.unwrap_or(state.length))
                ),
            });
        }
        if let Sensor::Displacement { direction_w: Vec3([x, y, z]) } = self.instrument.sensor {
            line(format!("direction: {x}, {y}, {z}"));
        }
        if claims.zero_unknown {
            line("zero: unknown".into());
        }
        let point = |p: Vec3<f64>| {
            let [x, y, z] = p.0.map(|x| length.write_si(x));
            format!("{x}, {y}, {z}")
        };
        let measures_point = !matches!(self.instrument.sensor, Sensor::Joint { .. });
        match &claims.tool_point_unknown {
            Some(name) => line(format!("tool_point: unknown {name}")),
            None if measures_point && state.tool_point_t.0 != [0.0; 3] => {
                line(format!("tool_point[{length}]: {}", point(state.tool_point_t)));
            }
            None => {}
        }
        if matches!(self.instrument.sensor, Sensor::Distance { .. }) && state.workpiece_point_w.0 != [0.0; 3]
        {
            line(format!("workpiece_point[{length}]: {}", point(state.workpiece_point_w)));
        }
        if let Some(sigma) = claims.sigma {
            let angle = self.instrument.quantity(machine, 0) == Quantity::Angle;
            let unit = if angle { self.style.measured.angle } else { self.style.measured.length };
            line(format!("sigma[{unit}]: {}", unit.write_si(sigma)));
        }
        claims.lines.iter().for_each(|extra| line(extra.clone()));
        text + &self.columns() + "\n"
    }

    fn columns(&self) -> String {
        let machine = self.machine;
        let mut names: Vec<String> = Vec::new();
        if self.style.time {
            names.push("t[s]".into());
        }
        let of =
            |units: FileUnits, kind| if kind == JointKind::Prismatic { units.length } else { units.angle };
        for (c, name) in machine.commands().iter().enumerate() {
            names.push(format!("{name}[{}]", of(self.style.commands, machine.command_joint(c).kind)));
        }
        if self.directions {
            names.extend(machine.commands().iter().map(|name| format!("{name}_direction[1]")));
        }
        let (length, angle) = (self.style.measured.length, self.style.measured.angle);
        let position = ["px", "py", "pz"].map(|name| format!("{name}[{length}]"));
        match &self.instrument.sensor {
            Sensor::Distance { absolute: true } => names.push(format!("r[{length}]")),
            Sensor::Distance { absolute: false } => names.push(format!("d[{length}]")),
            Sensor::Position => names.extend(position),
            Sensor::Pose => {
                names.extend(position);
                names.extend(["rx", "ry", "rz"].map(|name| format!("{name}[{angle}]")));
            }
            Sensor::Displacement { .. } => names.push(format!("s[{length}]")),
            Sensor::Joint { dyad } => {
                if let Some(joint) = &machine.dyads()[*dyad].joint {
                    names.push(format!("{}_meas[{}]", joint.name, of(self.style.measured, joint.kind)));
                }
            }
        }
        names.join(",")
    }

    /// Moves the plant on by one sample, and writes its row if it is recorded. `later`: what the clock of the call is ahead of
    /// the course, s.
    ///
    /// # Errors
    /// [`Error::Motion`] beyond the machine's travel; [`Error::File`] where the row cannot be written.
    pub fn take(
        &mut self,
        plant: &Plant,
        state: &mut State,
        sample: &Sample,
        later: f64,
        rng: &mut StdRng,
        out: &mut dyn Write,
    ) -> Result<()> {
        within_travel(self.machine, &sample.q, sample.at)?;
        for (range, q) in self.written.travel.iter_mut().zip(&sample.q) {
            *range = (range.0.min(*q), range.1.max(*q));
        }
        state.later = later;
        plant.advance(state, sample);
        if !sample.recorded {
            return Ok(());
        }
        let values = self.instrument.read(self.machine, state, &sample.q, rng);
        let time = sample.time + later;
        let first = *self.first_time.get_or_insert(time);
        self.written.seconds = time - first;
        self.written.rows += 1;
        self.written.dropped += u64::from(values.is_none());
        self.row(time, sample, values);
        out.write_all(self.line.as_bytes()).map_err(|e| Error::file("", e))
    }

    fn row(&mut self, time: f64, sample: &Sample, values: Option<Vec<f64>>) {
        let mut line = std::mem::take(&mut self.line);
        line.clear();
        if self.style.time {
            let _ = write!(line, "{time:.6},");
        }
        let of = |units: FileUnits, angle: bool| if angle { units.angle } else { units.length };
        for (c, q) in sample.q.iter().enumerate() {
            let angle = self.machine.command_joint(c).kind == JointKind::Revolute;
            number(&mut line, *q, of(self.style.commands, angle));
            line.push(',');
        }
        if self.directions {
            let nothing = vec![0; sample.q.len()];
            for direction in sample.directions.as_ref().unwrap_or(&nothing) {
                let _ = write!(line, "{direction},");
            }
        }
        for i in 0..self.instrument.sensor.reading_count() {
            match &values {
                Some(values) => {
                    number(
                        &mut line,
                        values[i],
                        of(self.style.measured, self.instrument.quantity(self.machine, i) == Quantity::Angle),
                    );
                }
                None => line.push_str(self.style.drop_out),
            }
            line.push(',');
        }
        line.pop();
        line.push('\n');
        self.line = line;
    }

    /// What was written so far.
    pub fn written(&self) -> &Written {
        &self.written
    }
}

/// A number in its unit with as many digits as the finest step needs; `-0.000` is written as zero.
fn number(line: &mut String, si: f64, unit: Unit) {
    let places = (unit.to_si(1.0) / FINEST).log10().ceil().max(0.0) as usize;
    let start = line.len();
    let _ = write!(line, "{:.places$}", unit.from_si(si));
    let written = &line[start..];
    if written.starts_with('-') && written[1..].bytes().all(|b| b == b'0' || b == b'.') {
        line.remove(start);
    }
}
