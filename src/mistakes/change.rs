//! What a recording would be without a mistake.

use super::thinned::{Sample, Thinned};
use crate::lie::{Pose, Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::recording::Measurement;
use crate::units::{Quantity, Unit};

/// Something that is done to recordings so that they read as they would without a mistake. Commands are indices of
/// [`Machine::commands`], readings of [`crate::recording::Measurement::value_count`].
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// Commands the other way round.
    Sign(usize),
    /// Two commands in each other's place.
    Swapped(usize, usize),
    /// Commands of one quantity are in another unit than the recording says: written, meant.
    Units(Vec<usize>, Unit, Unit),
    /// A command's zero lies elsewhere, by so many rad.
    Zero(usize, f64),
    /// Readings of one quantity are in another unit than the recording says: written, meant.
    ReadingUnits(Unit, Unit),
    /// Two axes of the measured frame in each other's place.
    AxesSwapped(usize, usize),
    /// A measured axis, or the only reading, the other way round.
    Mirrored(usize),
    /// Rotation vectors are of the opposite turn.
    Turn,
    /// Quaternions have their scalar part last where the columns say first, or the other way round.
    Quaternion {
        /// Whether the scalar part was written last.
        scalar_last: bool,
    },
    /// What was measured is the pose of `w` in `t`.
    Inverse,
    /// Commands were read before the machine had settled, each short of where it came to rest by so large a part of its move.
    Unsettled(Vec<f64>),
    /// Where the target sits on the tool, or how it is turned there, is not what the recordings say, and new in every set-up.
    Target {
        /// Where it sits.
        place: bool,
        /// How it is turned.
        rotation: bool,
    },
    /// Where the instrument stands is not what the recordings say.
    Frame,
    /// Readings are in the opposite order of the commands.
    Backwards,
    /// Readings belong to commands so many rows further on.
    Rows(isize),
    /// One command belongs to the rest of its row so many rows further on.
    CommandRows(usize, isize),
}

impl Change {
    /// The samples without the mistake.
    pub(super) fn applied(&self, thinned: &Thinned) -> Vec<Sample> {
        let mut samples = thinned.samples.clone();
        let lengths = |i: usize| thinned.quantity(i) == Quantity::Length;
        match self {
            Change::Target { .. } | Change::Frame => {}
            Change::Unsettled(parts) => {
                for (sample, before) in samples.iter_mut().zip(thinned.commands_before()) {
                    for ((command, before), part) in sample.commands.iter_mut().zip(before).zip(parts) {
                        *command += part * (*command - before);
                    }
                }
            }
            Change::Sign(c) => samples.iter_mut().for_each(|s| s.commands[*c] *= -1.0),
            Change::Swapped(a, b) => samples.iter_mut().for_each(|s| s.commands.swap(*a, *b)),
            Change::Units(commands, written, meant) => {
                for sample in &mut samples {
                    for c in commands {
                        sample.commands[*c] = meant.to_si(written.from_si(sample.commands[*c]));
                    }
                }
            }
            Change::Zero(c, by) => samples.iter_mut().for_each(|s| s.commands[*c] += by),
            Change::ReadingUnits(written, meant) => {
                for sample in &mut samples {
                    for (i, value) in sample.values.iter_mut().enumerate() {
                        if lengths(i) == (written.quantity == Quantity::Length) {
                            *value = meant.to_si(written.from_si(*value));
                        }
                    }
                }
            }
            Change::AxesSwapped(a, b) => samples.iter_mut().for_each(|s| s.values.swap(*a, *b)),
            Change::Mirrored(i) => samples.iter_mut().for_each(|s| s.values[*i] *= -1.0),
            Change::Turn => {
                samples.iter_mut().for_each(|s| s.values[3..6].iter_mut().for_each(|x| *x *= -1.0));
            }
            Change::Quaternion { scalar_last } => {
                samples.iter_mut().for_each(|s| reorder(&mut s.values, *scalar_last));
            }
            Change::Inverse => samples.iter_mut().for_each(|s| invert(&mut s.values)),
            Change::Backwards => {
                for (sample, own) in samples.iter_mut().rev().zip(&thinned.samples) {
                    sample.values.clone_from(&own.values);
                }
            }
            Change::Rows(rows) => {
                for (sample, other) in samples.iter_mut().zip(thinned.neighbours(*rows)) {
                    sample.values.clone_from(&other.values);
                }
            }
            Change::CommandRows(c, rows) => {
                for (sample, other) in samples.iter_mut().zip(thinned.neighbours(*rows)) {
                    sample.commands[*c] = other.commands[*c];
                }
            }
        }
        samples
    }

    /// The recording with the lines of its head as without the mistake.
    pub(super) fn applied_to_head(&self, thinned: &Thinned) -> Thinned {
        let mut other = thinned.clone();
        other.head = self.head(thinned);
        other
    }

    /// The lines of the head without the mistake.
    pub(super) fn head(&self, thinned: &Thinned) -> Vec<String> {
        let mut head = thinned.head.clone();
        let mut put = |key: &str, value: &str| {
            let is_own = |line: &String| {
                let rest = line.trim_start_matches('#').trim_start().strip_prefix(key);
                rest.is_some_and(|rest| rest.trim_start().starts_with([':', '[']))
            };
            head.retain(|line| !is_own(line));
            head.push(format!("# {key}: {value}"));
        };
        // A name that no recording has.
        let own = format!("unknown (mounted for {})", thinned.header.setup);
        match self {
            Change::Target { place, rotation } => {
                if *place {
                    put("tool_point", &own);
                }
                if *rotation {
                    put("tool_rotation", &own);
                }
            }
            Change::Frame => put("workpiece_frame", "unknown"),
            _ => {}
        }
        head
    }

    /// The mistake, as the part of a sentence that follows "with".
    pub fn in_words(&self, machine: &Machine) -> String {
        let name = |c: &usize| machine.commands()[*c].as_str();
        let axis = |i: &usize| ["x", "y", "z"].get(*i).copied().unwrap_or("reading");
        match self {
            Change::Sign(c) => format!("the sign of {} reversed", name(c)),
            Change::Swapped(a, b) => format!("{} and {} swapped", name(a), name(b)),
            Change::Units(all, written, meant) => {
                let names: Vec<&str> = all.iter().map(name).collect();
                format!("{} read in {meant} instead of {written}", names.join(", "))
            }
            Change::Zero(c, by) => format!("{:+.0} deg added to {}", by.to_degrees(), name(c)),
            Change::ReadingUnits(written, meant) => {
                format!("what was measured read in {meant} instead of {written}")
            }
            Change::AxesSwapped(a, b) => format!("the measured axes {} and {} swapped", axis(a), axis(b)),
            Change::Mirrored(i) => format!("the sign of measured {} reversed", axis(i)),
            Change::Turn => "the measured turn in the opposite sense".into(),
            Change::Quaternion { scalar_last: true } => "the scalar part of quaternions read last".into(),
            Change::Quaternion { scalar_last: false } => "the scalar part of quaternions read first".into(),
            Change::Inverse => "the measured pose inverted".into(),
            Change::Target { place, rotation } => {
                format!("{} unknown, one for each set-up,", target(*place, *rotation))
            }
            Change::Frame => "frame w unknown".into(),
            Change::Unsettled(parts) => {
                let all: Vec<String> = (machine.commands().iter().zip(parts))
                    .map(|(joint, part)| format!("{joint} {:+.1} %", 100.0 * part))
                    .collect();
                format!("joints moved on by a part of the move that led there ({})", all.join(", "))
            }
            Change::Backwards => "the readings in the opposite order".into(),
            Change::Rows(rows) => format!("the readings {}", shifted(*rows)),
            Change::CommandRows(c, rows) => format!("column {} {}", name(c), shifted(*rows)),
        }
    }

    /// What to do about it.
    pub fn mend(&self, machine: &Machine) -> String {
        let name = |c: &usize| machine.commands()[*c].as_str();
        match self {
            Change::Sign(c) => {
                let joint = name(c);
                format!("turn the axis of joint {joint} round in the machine file, or the sign of column `{joint}` in the recordings")
            }
            Change::Swapped(a, b) => format!("swap the names of the columns `{}` and `{}`", name(a), name(b)),
            Change::Units(all, _, meant) => {
                let names: Vec<String> = all.iter().map(|c| format!("`{}[{meant}]`", name(c))).collect();
                format!("name the unit of the numbers in the header row: {}", names.join(","))
            }
            Change::Zero(c, by) => {
                let (joint, degrees) = (name(c), by.to_degrees());
                format!("add {degrees:+.0} deg to column `{joint}`, or turn the frame of joint {joint} by it in the machine file")
            }
            Change::ReadingUnits(_, meant) => format!("write [{meant}] behind the names of the measured columns"),
            Change::AxesSwapped(a, b) => {
                let names = ["`px`", "`py`", "`pz`"];
                format!("swap the names of the columns {} and {}", names[*a], names[*b])
            }
            Change::Mirrored(_) => "turn the sign of that column in the recordings".into(),
            Change::Turn => "turn the signs of `rx`, `ry`, `rz` (of `qx`, `qy`, `qz`): the turn is that of t as seen from w".into(),
            Change::Quaternion { .. } => "name the columns of the quaternion by what they are: `qw` is the scalar part".into(),
            Change::Inverse => "write the pose of t in w, not that of w in t".into(),
            Change::Target { place, rotation } => {
                let keys = [(*place, "`# tool_point: unknown NAME`"), (*rotation, "`# tool_rotation: unknown NAME`")];
                let keys: Vec<&str> = keys.iter().filter(|(meant, _)| *meant).map(|(_, key)| *key).collect();
                format!("add {} to the head, a NAME for each mounting of the target", keys.join(" and "))
            }
            Change::Frame => "add `# workpiece_frame: unknown` to the head, and a name of its own with `# setup: NAME`".into(),
            Change::Unsettled(_) => "read joints and target at the same time, once the machine stands still".into(),
            Change::Backwards => "put the readings into the order of the commands".into(),
            Change::Rows(_) | Change::CommandRows(..) => "put what belongs together into one row".into(),
        }
    }
}

fn target(place: bool, rotation: bool) -> &'static str {
    match (place, rotation) {
        (true, true) => "place and rotation of the target",
        (true, false) => "the place of the target",
        _ => "the rotation of the target",
    }
}

fn shifted(rows: isize) -> String {
    let count = crate::wording::count(rows.unsigned_abs() as u64, "row", "rows");
    format!("taken {count} {}", if rows > 0 { "further down" } else { "further up" })
}

impl Thinned {
    /// What reading `i` measures.
    pub(super) fn quantity(&self, i: usize) -> Quantity {
        match self.measurement {
            Measurement::Joint { .. } => self.value_units.first().map_or(Quantity::Length, |u| u.quantity),
            _ if i < 3 => Quantity::Length,
            _ => Quantity::Angle,
        }
    }
}

fn turn(values: &[f64]) -> Pose<f64> {
    Pose::exp(Twist::new(Vec3([0.0; 3]), Vec3([values[0], values[1], values[2]])))
}

fn invert(values: &mut [f64]) {
    let w_from_t =
        Pose { rotation: turn(&values[3..6]).rotation, translation: Vec3([values[0], values[1], values[2]]) };
    let inverse = w_from_t.inverse();
    values[..3].copy_from_slice(&inverse.translation.0);
    values[3..6].copy_from_slice(&inverse.rotation_vector().0);
}

/// The rotation vector of the quaternion whose parts were taken for another's.
fn reorder(values: &mut [f64], scalar_last: bool) {
    let vector = [values[3], values[4], values[5]];
    let angle = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    let factor = if angle < 1e-12 { 0.5 } else { (angle / 2.0).sin() / angle };
    let [x, y, z] = vector.map(|part| part * factor);
    let read = [(angle / 2.0).cos(), x, y, z];
    let [w, x, y, z] = if scalar_last {
        // Numbers x y z w stood under the names w x y z.
        [read[3], read[0], read[1], read[2]]
    } else {
        [read[1], read[2], read[3], read[0]]
    };
    let sine = (x * x + y * y + z * z).sqrt();
    // Half a turn more or less is the same quaternion; atan2 takes care of the sign.
    let (w, sine) = if w < 0.0 { (-w, -sine) } else { (w, sine) };
    let factor = if sine.abs() < 1e-12 { 2.0 } else { 2.0 * sine.atan2(w) / sine.abs() };
    for (value, part) in values[3..6].iter_mut().zip([x, y, z]) {
        *value = factor * part;
    }
}

/// Whether a command turns.
pub(super) fn turns(machine: &Machine, command: usize) -> bool {
    machine.command_joint(command).kind == JointKind::Revolute
}
