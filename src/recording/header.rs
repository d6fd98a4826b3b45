//! The lines `# key[unit]: value` above the header row.

use super::RecordingFault as Fault;
use super::text::{self, Fail, LARGEST};
use crate::Machine;
use crate::lie::Vec3;
use crate::machine::JointKind;
use crate::units::{Quantity, Unit};

/// What a recording says of itself, in m and rad.
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
}

/// What was measured.
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
#[derive(Clone, Debug, PartialEq)]
pub enum ToolPoint {
    /// Its coordinates, m.
    Known(Vec3<f64>),
    /// To be found; recordings that give the same name share it.
    Unknown(String),
}

/// Length that a ballbar's reading refers to.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigma {
    /// In m or rad.
    pub value: f64,
    /// Length or angle; of a pose it says which of its two parts is meant.
    pub quantity: Quantity,
}

/// Every known key, in the order in which messages list them.
const KEYS: [&str; 12] = [
    "machine",
    "measurement",
    "setup",
    "nominal_length",
    "tool_point",
    "workpiece_point",
    "workpiece_frame",
    "zero",
    "gravity",
    "fixed",
    "direction",
    "sigma",
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

/// One line, cut into its parts; columns in characters from 1.
struct Entry<'a> {
    line: u64,
    key: &'a str,
    key_column: usize,
    unit: Option<&'a str>,
    unit_column: usize,
    value: &'a str,
    value_column: usize,
}

impl<'a> Entry<'a> {
    /// `None` for a comment that is no `key: value`.
    fn cut(line: u64, text: &'a str) -> Option<Self> {
        let column = |part: &str| {
            let bytes = (part.as_ptr() as usize).saturating_sub(text.as_ptr() as usize).min(text.len());
            text.char_indices().take_while(|(i, _)| *i < bytes).count() + 1
        };
        let (left, value) = text.trim_start().strip_prefix('#')?.split_once(':')?;
        let (left, value) = (left.trim(), value.trim());
        let (key, unit) = match left.split_once('[') {
            Some((key, rest)) => (key.trim_end(), Some(rest.strip_suffix(']')?.trim())),
            None => (left, None),
        };
        let unit_column = unit.map_or(0, column);
        Some(Entry {
            line,
            key,
            key_column: column(key),
            unit,
            unit_column,
            value,
            value_column: column(value),
        })
    }

    fn at_key(&self, fault: Fault) -> Fail {
        Fail::at(self.line, self.key_column, fault)
    }

    fn at_value(&self, fault: Fault) -> Fail {
        Fail::at(self.line, self.value_column, fault)
    }

    fn what(&self) -> String {
        format!("header key `{}`", self.key)
    }

    /// The unit, which must be one of `fits`; the first is the one that messages take as example.
    fn unit(&self, fits: &[Quantity]) -> Result<Unit, Fail> {
        let one = (fits.len() == 1).then(|| fits[0]);
        let Some(symbol) = self.unit else {
            let unit = example_unit(fits[0]);
            let example = format!("`# {}[{unit}]: {}`", self.key, text::shown(self.value.as_bytes()));
            return Err(self.at_key(Fault::NoUnit { what: self.what(), example, expected: one }));
        };
        let place = |fault| Fail::at(self.line, self.unit_column, fault);
        let Some(unit) = Unit::named(symbol) else {
            let unit = text::shown(symbol.as_bytes());
            return Err(place(Fault::UnknownUnit { what: self.what(), unit, expected: one }));
        };
        if fits.contains(&unit.quantity) {
            return Ok(unit);
        }
        let known = fits.iter().map(|q| Unit::symbols_of(*q)).collect::<Vec<_>>().join(" ");
        let (unit, found) = (symbol.to_string(), unit.quantity);
        Err(place(Fault::WrongUnit { what: self.what(), unit, found, known }))
    }

    fn no_unit(&self) -> Result<(), Fail> {
        match self.unit {
            None => Ok(()),
            Some(unit) => {
                let (key, unit) = (self.key.to_string(), text::shown(unit.as_bytes()));
                Err(Fail::at(self.line, self.unit_column, Fault::UnitNotWanted { key, unit }))
            }
        }
    }

    fn number(&self, part: &str, unit: Option<Unit>) -> Result<f64, Fail> {
        let shown = text::shown(part.as_bytes());
        let value = part.trim().parse::<f64>().ok().filter(|v| !v.is_nan());
        let Some(value) = value else {
            return Err(self.at_value(Fault::NotANumber { what: self.what(), text: shown }));
        };
        let value = unit.map_or(value, |u| u.to_si(value));
        if value.abs() > LARGEST {
            return Err(self.at_value(Fault::NotUsable { what: self.what(), text: shown }));
        }
        Ok(value)
    }

    fn positive(&self, unit: Unit) -> Result<f64, Fail> {
        let value = self.number(self.value, Some(unit))?;
        if value > 0.0 {
            return Ok(value);
        }
        let text = format!("{} {unit}", self.value);
        Err(self.at_value(Fault::NotPositive { what: self.what(), text }))
    }

    fn vector(&self, unit: Option<Unit>) -> Result<Vec3<f64>, Fail> {
        let found = self.value.split(',').count();
        if found != 3 {
            return Err(self.at_value(Fault::NotThree { key: self.key.to_string(), found }));
        }
        let mut vector = [0.0; 3];
        for (component, part) in vector.iter_mut().zip(self.value.split(',')) {
            *component = self.number(part, unit)?;
        }
        Ok(Vec3(vector))
    }

    fn unit_vector(&self) -> Result<Vec3<f64>, Fail> {
        let vector = self.vector(None)?;
        let length = vector.norm();
        if length < 1e-9 {
            return Err(self.at_value(Fault::ZeroVector { what: self.what() }));
        }
        Ok(if (length - 1.0).abs() < 1e-15 { vector } else { vector.times(length.recip()) })
    }

    fn unknown(&self) -> Result<bool, Fail> {
        self.no_unit()?;
        match self.value {
            "unknown" => Ok(true),
            "known" => Ok(false),
            _ => Err(self.bad_word("`unknown`, or leave the line out")),
        }
    }

    fn bad_word(&self, expected: &str) -> Fail {
        let (key, found) = (self.key.to_string(), text::shown(self.value.as_bytes()));
        self.at_value(Fault::BadWord { key, found, expected: expected.into() })
    }
}

/// The unit that examples in messages bear.
pub(super) fn example_unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "s",
        Quantity::Length => "mm",
        Quantity::Angle => "deg",
        Quantity::Temperature => "degC",
        Quantity::Force => "N",
        Quantity::Torque => "Nm",
        Quantity::Current => "A",
        Quantity::Voltage => "V",
        Quantity::One => "1",
    }
}

/// What the displacement of a joint measures.
pub(super) fn quantity_of(kind: JointKind) -> Quantity {
    match kind {
        JointKind::Prismatic => Quantity::Length,
        JointKind::Revolute => Quantity::Angle,
    }
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
            workpiece_point: Vec3([0.0; 3]),
            zero_unknown: false,
            nominal_length: NominalLength::NotGiven,
            gravity_w: None,
            sigma: None,
            direction_w: None,
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
        let unit = entry.unit(&[quantity_of(machine.command_joint(command).kind)])?;
        self.fixed[command] = Some(entry.number(entry.value, Some(unit))?);
        Ok(())
    }

    /// A key that is none of the known ones: nearly one of them is a mistake, anything else a comment.
    fn other(&mut self, entry: &Entry) -> Result<(), Fail> {
        let shown = text::shown(entry.key.as_bytes());
        let (first, rest) = entry.key.split_once(char::is_whitespace).unwrap_or((entry.key, ""));
        let mut words = rest.split_whitespace();
        let fixed = words.next().is_some() && words.next().is_none() && text::nearly(first, "fixed");
        let near = KEYS.into_iter().find(|k| text::nearly(entry.key, k));
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
            let near = MEASUREMENTS.into_iter().find(|m| text::nearly(other, m));
            let found = text::shown(other.as_bytes());
            return Err(entry.at_value(Fault::UnknownMeasurement { found, near }));
        }
    })
}

fn tool_point(entry: &Entry) -> Result<ToolPoint, Fail> {
    let Some(name) =
        entry.value.strip_prefix("unknown").filter(|n| n.is_empty() || n.starts_with([' ', '\t']))
    else {
        return Ok(ToolPoint::Known(entry.vector(Some(entry.unit(&[Quantity::Length])?))?));
    };
    match name.trim() {
        "" => Err(entry.bad_word("`unknown NAME`: recordings that give the same name share the point")),
        name => Ok(ToolPoint::Unknown(name.to_string())),
    }
}
