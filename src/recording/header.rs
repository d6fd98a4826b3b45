//! The lines `# key[unit]: value` above the header row.

use super::RecordingFault as Fault;
use super::entry::Entry;
use super::text::{self, Fail};
use crate::lie::Vec3;
use crate::machine::Machine;
use crate::units::Quantity;
use crate::wording::nearly;

/// What a recording says of itself, in m and rad.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Name of the machine, if the file says it; it is then that of the machine it is read for.
    pub machine: Option<String>,
    /// What was measured.
    pub measurement: Measurement,
    /// Name of the set-up, empty where none is given. Recordings of one set-up share frame `w` and its unknowns.
    pub setup: String,
    /// Whether frame `w` is to be found from nothing.
    pub workpiece_frame_unknown: bool,
    /// The measured point in frame `t`.
    pub tool_point: ToolPoint,
    /// Name under which the rotation of a pose's target in frame `t` is to be found; recordings that give the same name share it. `None`:
    /// the target is turned as frame `t`.
    pub tool_rotation_unknown: Option<String>,
    /// The fixed point (socket, second ball) in frame `w`, m.
    pub workpiece_point: Vec3<f64>,
    /// Whether the zero of the reference is arbitrary (`joint`, `displacement`).
    pub zero_unknown: bool,
    /// Length that was subtracted from the distance before `d` was written.
    pub nominal_length: NominalLength,
    /// Unit vector of gravity in frame `w`, if it differs from the machine file's.
    pub gravity_w: Option<Vec3<f64>>,
    /// Known standard uncertainty of the instrument.
    pub sigma: Option<Sigma>,
    /// Unit vector of the measured direction in frame `w` (`displacement`).
    pub direction_w: Option<Vec3<f64>>,
    /// Name of the instrument, as the file says it.
    pub instrument: Option<String>,
}

/// What was measured.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measurement {
    /// Distance of the measured point from the workpiece point, m.
    Distance {
        /// `true`: column `r`, the distance itself; `false`: column `d`, the distance minus the nominal length.
        absolute: bool,
    },
    /// Position of the measured point in frame `w`, m.
    Position,
    /// Position and rotation vector of frame `t` in frame `w`, m and rad.
    Pose,
    /// Movement of the measured point along a direction of frame `w`, m.
    Displacement,
    /// Displacement of one joint, m or rad.
    Joint {
        /// Index in [`Machine::dyads`] of the dyad whose joint is measured.
        dyad: usize,
    },
}

impl Measurement {
    /// The word behind `# measurement:`.
    pub fn word(self) -> &'static str {
        match self {
            Measurement::Distance { .. } => "distance",
            Measurement::Position => "position",
            Measurement::Pose => "pose",
            Measurement::Displacement => "displacement",
            Measurement::Joint { .. } => "joint",
        }
    }

    /// How many measured numbers a sample of [`Chunk::values`](super::Chunk::values) has: 1, for a position 3, for a pose 6.
    pub fn value_count(self) -> usize {
        match self {
            Measurement::Position => 3,
            Measurement::Pose => 6,
            Measurement::Distance { .. } | Measurement::Displacement | Measurement::Joint { .. } => 1,
        }
    }
}

/// The measured point in frame `t`.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub enum ToolPoint {
    /// Its coordinates, m.
    Known(Vec3<f64>),
    /// To be found; recordings that give the same name share it.
    Unknown(String),
}

/// Length that a ballbar's reading refers to.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NominalLength {
    /// m.
    Known(f64),
    /// To be found with the rest.
    Unknown,
    /// The header does not say.
    NotGiven,
}

/// Standard uncertainty of the instrument.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigma {
    /// In m or rad.
    pub value: f64,
    /// Length or angle; of a pose it says which of its two parts is meant.
    pub quantity: Quantity,
}

/// Every known key, in the order in which messages list them.
const KEYS: [&str; 14] = [
    "machine",
    "measurement",
    "setup",
    "nominal_length",
    "tool_point",
    "tool_rotation",
    "workpiece_point",
    "workpiece_frame",
    "zero",
    "gravity",
    "fixed",
    "direction",
    "sigma",
    "instrument",
];

/// Words behind `# measurement:`.
const MEASUREMENTS: [&str; 5] = ["distance", "position", "pose", "displacement", "joint"];

/// The header while its lines come in; what hangs on the columns is settled by [`Layout::resolve`](super::column::Layout).
#[derive(Debug)]
pub(super) struct Draft {
    pub header: Header,
    /// Set once `# measurement:` has come.
    pub measurement: Option<Measurement>,
    /// Displacement of each command that has no column, m or rad.
    pub fixed: Vec<Option<f64>>,
    pub warnings: Vec<String>,
    /// Keys with their lines; `fixed` with its joint.
    seen: Vec<(String, u64)>,
    /// Where the unit of sigma stands, and its symbol.
    pub sigma_at: (u64, usize, &'static str),
}

/// The known key of this comment line, if it is one.
pub(super) fn known_key(text: &str) -> Option<&'static str> {
    let entry = Entry::cut(0, text)?;
    let first = entry.key.split_whitespace().next()?;
    KEYS.into_iter().find(|key| *key == entry.key || (*key == "fixed" && first == "fixed"))
}

impl Draft {
    pub fn new(machine: &Machine) -> Self {
        let header = Header {
            machine: None,
            measurement: Measurement::Position,
            setup: String::new(),
            workpiece_frame_unknown: false,
            tool_point: ToolPoint::Known(Vec3([0.0; 3])),
            tool_rotation_unknown: None,
            workpiece_point: Vec3([0.0; 3]),
            zero_unknown: false,
            nominal_length: NominalLength::NotGiven,
            gravity_w: None,
            sigma: None,
            direction_w: None,
            instrument: None,
        };
        let fixed = vec![None; machine.commands().len()];
        Draft {
            header,
            measurement: None,
            fixed,
            warnings: Vec::new(),
            seen: Vec::new(),
            sigma_at: (0, 0, ""),
        }
    }

    /// Line of a key, if it has come.
    pub fn line_of(&self, key: &str) -> Option<u64> {
        self.seen.iter().find(|(seen, _)| seen == key).map(|(_, line)| *line)
    }

    /// Takes one line that starts with `#`.
    pub fn take(&mut self, machine: &Machine, line: u64, text: &str) -> Result<(), Fail> {
        let Some(entry) = Entry::cut(line, text) else {
            self.warn_of_missing_colon(line, text);
            return Ok(());
        };
        let Some(known) = known_key(text) else { return self.other(&entry) };
        if let Some(first) = self.line_of(entry.key) {
            return Err(entry.at_key(Fault::KeyTwice { key: entry.key.to_string(), first }));
        }
        self.seen.push((entry.key.to_string(), line));
        if entry.value.is_empty() {
            return Err(entry.at_key(Fault::EmptyValue { key: entry.key.to_string() }));
        }
        self.known(machine, known, &entry)
    }

    fn known(&mut self, machine: &Machine, key: &str, entry: &Entry) -> Result<(), Fail> {
        use Quantity::{Angle, Length};
        let header = &mut self.header;
        match key {
            "machine" => {
                entry.no_unit()?;
                if entry.value != machine.name() {
                    let found = text::shown(entry.value.as_bytes());
                    return Err(
                        entry.at_value(Fault::WrongMachine { found, expected: machine.name().to_string() })
                    );
                }
                header.machine = Some(entry.value.to_string());
            }
            "measurement" => {
                entry.no_unit()?;
                self.measurement = Some(measurement(entry)?);
            }
            "setup" => {
                entry.no_unit()?;
                header.setup = entry.value.to_string();
            }
            "nominal_length" if entry.value == "unknown" => header.nominal_length = NominalLength::Unknown,
            "nominal_length" => {
                header.nominal_length = NominalLength::Known(entry.positive(entry.unit(&[Length])?)?);
            }
            "tool_point" => header.tool_point = tool_point(entry)?,
            "tool_rotation" => {
                entry.no_unit()?;
                let name = unknown_name(entry).filter(|name| !name.is_empty());
                let name = name.ok_or_else(|| {
                    entry.bad_word("`unknown NAME`: recordings that give the same name share the rotation")
                })?;
                header.tool_rotation_unknown = Some(name.to_string());
            }
            "workpiece_point" => header.workpiece_point = entry.vector(Some(entry.unit(&[Length])?))?,
            "workpiece_frame" => header.workpiece_frame_unknown = entry.unknown()?,
            "zero" => header.zero_unknown = entry.unknown()?,
            "gravity" if entry.unit == Some("w") => header.gravity_w = Some(entry.unit_vector()?),
            "gravity" => {
                let frame = text::shown(entry.unit.unwrap_or("").as_bytes());
                return Err(entry.at_key(Fault::GravityFrame { frame }));
            }
            "fixed" => return self.fix(machine, entry),
            "direction" => {
                entry.no_unit()?;
                header.direction_w = Some(entry.unit_vector()?);
            }
            "instrument" => {
                entry.no_unit()?;
                header.instrument = Some(entry.value.to_string());
            }
            _ => {
                let unit = entry.unit(&[Length, Angle])?;
                header.sigma = Some(Sigma { value: entry.positive(unit)?, quantity: unit.quantity });
                self.sigma_at = (entry.line, entry.unit_column, unit.symbol);
            }
        }
        Ok(())
    }

    fn fix(&mut self, machine: &Machine, entry: &Entry) -> Result<(), Fail> {
        let joint = entry.key.strip_prefix("fixed").unwrap_or("").trim();
        let Some(command) = machine.commands().iter().position(|c| c == joint) else {
            let (joint, known) = (text::shown(joint.as_bytes()), machine.commands().join(", "));
            return Err(entry.at_key(Fault::UnknownJoint { joint, known }));
        };
        let unit = entry.unit(&[machine.command_joint(command).kind.quantity()])?;
        self.fixed[command] = Some(entry.number(entry.value, Some(unit))?);
        Ok(())
    }

    /// A key that is none of the known ones: nearly one of them is a mistake, anything else a comment.
    fn other(&mut self, entry: &Entry) -> Result<(), Fail> {
        let shown = text::shown(entry.key.as_bytes());
        let (first, rest) = entry.key.split_once(char::is_whitespace).unwrap_or((entry.key, ""));
        let mut words = rest.split_whitespace();
        let fixed = words.next().is_some() && words.next().is_none() && nearly(first, "fixed");
        let near = KEYS.into_iter().find(|k| nearly(entry.key, k));
        if let Some(near) = near.or(fixed.then_some("fixed")) {
            return Err(entry.at_key(Fault::MisspeltKey { key: shown, near: near.into() }));
        }
        if rest.split_whitespace().count() < 2 && !shown.is_empty() {
            self.warnings.push(format!("line {}: ignored header key `{shown}`", entry.line));
        }
        Ok(())
    }

    /// `# zero unknown` was meant to be `# zero: unknown`.
    fn warn_of_missing_colon(&mut self, line: u64, text: &str) {
        let comment = text.trim_start().trim_start_matches('#').trim();
        let first = comment.split([' ', '[', '=']).next().unwrap_or("");
        if KEYS.contains(&first) {
            self.warnings.push(format!(
                "line {line} is read as a comment; a header key needs a colon, `# {first}: ...`"
            ));
        }
    }
}

fn measurement(entry: &Entry) -> Result<Measurement, Fail> {
    Ok(match entry.value {
        "distance" => Measurement::Distance { absolute: false },
        "position" => Measurement::Position,
        "pose" => Measurement::Pose,
        "displacement" => Measurement::Displacement,
        "joint" => Measurement::Joint { dyad: 0 },
        other => {
            let near = MEASUREMENTS.into_iter().find(|m| nearly(other, m));
            let found = text::shown(other.as_bytes());
            return Err(entry.at_value(Fault::UnknownMeasurement { found, near }));
        }
    })
}

/// What follows the word `unknown`.
fn unknown_name<'a>(entry: &Entry<'a>) -> Option<&'a str> {
    let rest = entry.value.strip_prefix("unknown").filter(|n| n.is_empty() || n.starts_with([' ', '\t']));
    rest.map(str::trim)
}

fn tool_point(entry: &Entry) -> Result<ToolPoint, Fail> {
    let Some(name) = unknown_name(entry) else {
        return Ok(ToolPoint::Known(entry.vector(Some(entry.unit(&[Quantity::Length])?))?));
    };
    match name {
        "" => Err(entry.bad_word("`unknown NAME`: recordings that give the same name share the point")),
        name => Ok(ToolPoint::Unknown(name.to_string())),
    }
}
