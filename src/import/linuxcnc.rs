//! Machines of LinuxCNC: the INI file says which kinematics module and which limits, HAL files set the pins of the module.

mod hal;
mod ini;
mod module;

use std::path::{Path, PathBuf};

use super::Reader;
use super::chain::{Chain, Entry, JointEntry, one_line};
use super::names::{Names, usable};
use super::step::Move;
use crate::error::{Error, Place, Result};
use crate::lie::Vec3;
use crate::machine::{FileUnits, JointKind};
use crate::units::Unit;
use hal::Pins;
use ini::Ini;
use module::{Frame, MODULES, Module};

/// Joints of genserkins.
const SERIAL: usize = 6;

/// Whether a text is such an INI file.
pub(super) fn is_ini(text: &str) -> bool {
    text.lines().any(|line| line.trim() == "[KINS]")
}

/// A machine of LinuxCNC as its files tell it.
struct Config<'a> {
    ini: Ini,
    pins: Pins,
    units: FileUnits,
    /// The line that names the kinematics.
    line: usize,
    /// What stands behind the module's name there.
    parameters: Vec<&'a str>,
    told: Vec<String>,
}

pub(super) fn read(
    file: &Path,
    text: &str,
    hal: &[PathBuf],
    tool_length: f64,
    files: Reader,
) -> Result<Chain> {
    let ini = Ini::read(file, text)?;
    let Some(kinematics) = ini.get("KINS", "KINEMATICS") else {
        let mend = "name the INI file of the machine, or write KINEMATICS into its section [KINS]";
        return Err(ini.fault(0, "the file has no KINEMATICS in a section [KINS]", mend));
    };
    let (line, words) = (kinematics.line, kinematics.value.clone());
    let mut words = words.split_whitespace();
    let name = words.next().unwrap_or_default();
    let mut told = Vec::new();
    let pins = pins(&ini, hal, files, &mut told)?;
    let units = units(&ini)?;
    let mut config = Config { ini, pins, units, line, parameters: words.collect(), told };
    let (workpiece, tool) = match MODULES.iter().find(|module| module.name == name) {
        Some(module) => config.machine_tool(module, tool_length)?,
        None if name == "genserkins" => config.serial(tool_length)?,
        None => {
            let known = MODULES.iter().map(|m| m.name).chain(["genserkins"]).collect::<Vec<_>>().join(", ");
            let what = format!("kinematics module \"{}\" is not known", one_line(name));
            let mend = format!("known are {known}; write the machine file by hand for others");
            return Err(config.ini.fault(line, what, mend));
        }
    };
    let own = config.ini.get("EMC", "MACHINE").map(|entry| entry.value.clone());
    let stem = || file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let machine = own.unwrap_or_else(stem);
    Ok(Chain {
        name: usable(&machine, "machine_"),
        about: format!("{}, LinuxCNC with {}", one_line(&machine), one_line(name)),
        units,
        workpiece,
        tool,
        told: config.told,
    })
}

/// Pins that the HAL files of the INI file set, and after them those that are named besides.
fn pins(ini: &Ini, hal: &[PathBuf], files: Reader, told: &mut Vec<String>) -> Result<Pins> {
    let mut pins = Pins::default();
    let folder = ini.file.parent().unwrap_or(Path::new(""));
    for entry in ini.all("HAL", "HALFILE").chain(ini.all("HAL", "POSTGUI_HALFILE")) {
        let name = entry.value.split_whitespace().next().unwrap_or_default();
        let library = name.starts_with("LIB:") || !name.ends_with(".hal");
        match (!library).then(|| files(&folder.join(name))) {
            Some(Ok(text)) => pins.read(&folder.join(name), &text),
            _ => told.push(format!("{} (line {}) is not read", one_line(name), entry.line)),
        }
    }
    for file in hal {
        pins.read(file, &files(file)?);
    }
    Ok(pins)
}

/// Units of the machine: lengths as the INI file has them, degrees.
fn units(ini: &Ini) -> Result<FileUnits> {
    let word = |key: &str| ini.get("TRAJ", key).map(|e| (e.line, e.value.to_lowercase()));
    let unit = |symbol: &str| Unit::named(symbol).unwrap_or(FileUnits::si().length);
    let length = match word("LINEAR_UNITS") {
        None => {
            let mend = "write LINEAR_UNITS = mm, or inch, into the section [TRAJ]";
            return Err(ini.fault(0, "nothing says in which unit lengths are", mend));
        }
        Some((line, text)) => match text.split_whitespace().next().unwrap_or_default() {
            "mm" | "metric" => unit("mm"),
            "in" | "inch" | "imperial" => unit("in"),
            other => {
                let what = format!("LINEAR_UNITS is `{}`", one_line(other));
                return Err(ini.fault(line, what, "write mm or inch"));
            }
        },
    };
    if let Some((line, text)) = word("ANGULAR_UNITS")
        && !text.starts_with("deg")
    {
        let what = format!("ANGULAR_UNITS is `{}`", one_line(&text));
        return Err(ini.fault(line, what, "write degree: kinematics modules count so"));
    }
    Ok(FileUnits { length, angle: unit("deg") })
}

impl Config<'_> {
    /// Letters of the joints by number.
    fn letters(&self, module: &Module) -> String {
        let stated = self.parameters.iter().find_map(|word| word.strip_prefix("coordinates="));
        let letters: String = stated.unwrap_or(module.coordinates).to_uppercase();
        letters.chars().filter(char::is_ascii_alphabetic).collect()
    }

    /// Letters that the machine has; all of them where nothing is said.
    fn has(&self, letter: char) -> bool {
        let stated = self.ini.get("TRAJ", "COORDINATES").map(|e| e.value.to_uppercase());
        stated.is_none_or(|stated| stated.contains(letter))
    }

    fn machine_tool(&mut self, module: &Module, tool_length: f64) -> Result<(Vec<Entry>, Vec<Entry>)> {
        let letters: String = self.letters(module).chars().filter(|l| self.has(*l)).collect();
        let pins = self.values(module)?;
        let tool_length = self.tool_length(module, tool_length)?;
        let pin = format!("{}.conventional-directions", module.name);
        let conventional = module.may_be_conventional() && self.is_on(&pin)?;
        let mut frames = module.frames(&pins, conventional, &letters);
        // The tip is that much below the gauge line, and so is what it stands at with all joints at zero.
        if module.tool_pin.is_some() || module.name == "trivkins" {
            for list in [&mut frames.workpiece, &mut frames.tool] {
                list.iter_mut().rev().take(1).for_each(|end| end.at.0[2] -= tool_length);
            }
        }
        let is_there = |frame: &Frame| frame.letter.is_none_or(|letter| letters.contains(letter));
        let trivial = module.name == "trivkins";
        let mut used: Vec<char> = Vec::new();
        for list in [&mut frames.workpiece, &mut frames.tool] {
            if let Some(missing) = list.iter().filter(|f| !trivial && !is_there(f)).find_map(|f| f.letter) {
                let what = format!("{} needs the axis {missing}, which COORDINATES lacks", module.name);
                return Err(self.ini.fault(
                    self.line,
                    what,
                    "name all axes of the module in COORDINATES of [TRAJ]",
                ));
            }
            list.retain(is_there);
            used.extend(list.iter().filter_map(|frame| frame.letter));
        }
        if used.is_empty() {
            let what = "none of X, Y and Z is an axis of this machine";
            let mend = "trivkins says nothing of where rotary axes stand: write the machine file by hand";
            return Err(self.ini.fault(self.line, what, mend));
        }
        self.say(module, &letters, &used);
        let mut names = Names::default();
        let mut entries = |frames: &[Frame], end: &str| -> Result<Vec<Entry>> {
            frames.iter().map(|frame| self.entry(module, frame, end, &mut names)).collect()
        };
        Ok((entries(&frames.workpiece, "w")?, entries(&frames.tool, "t")?))
    }

    /// What the files leave open.
    fn say(&mut self, module: &Module, letters: &str, used: &[char]) {
        let left: Vec<String> = letters.chars().filter(|l| !used.contains(l)).map(String::from).collect();
        if !left.is_empty() {
            let where_ = if module.name == "trivkins" {
                "trivkins says nothing of where they stand"
            } else {
                "they stay at 0 here"
            };
            self.told.push(format!("left out: {}; {where_}", left.join(", ")));
        }
        self.told.push(
            "LinuxCNC does not say which of X, Y and Z carries which: all carry the tool here, in this order. Where the table moves, write the axis into `workpiece`, with the other sign".into(),
        );
    }

    fn entry(&self, module: &Module, frame: &Frame, end: &str, names: &mut Names) -> Result<Entry> {
        let at = Vec3(frame.at.0.map(|x| self.units.length.to_si(x)));
        let moves: Vec<Move> = Move::shifts(at).into_iter().filter(|m| !m.is_none()).collect();
        let Some(letter) = frame.letter else {
            let note = if end == "w" { "workpiece" } else { "tool tip" };
            return Ok(plain(end, moves, None, note.into()));
        };
        let kind = if "ABC".contains(letter) { JointKind::Revolute } else { JointKind::Prismatic };
        let number = self.letters(module).find(letter).unwrap_or(0);
        let word = letter.to_ascii_lowercase().to_string();
        let name = names.give(&word);
        let nc = (name != word).then(|| letter.to_string());
        let joint = JointEntry {
            kind,
            axis: frame.axis,
            travel: self.travel(number, kind)?,
            follows: Vec::new(),
            nc,
        };
        Ok(plain(&name, moves, Some(joint), format!("joint {number}")))
    }

    /// Limits of a joint by its number.
    fn travel(&self, number: usize, kind: JointKind) -> Result<Option<(f64, f64)>> {
        let section = format!("JOINT_{number}");
        let unit = if kind == JointKind::Revolute { self.units.angle } else { self.units.length };
        let limit = |key: &str| -> Result<Option<f64>> {
            // Such as 1e99, the limit of what has none.
            Ok(self.ini.number(&section, key)?.map(|x| unit.to_si(x)).filter(|x| x.abs() < 1e9))
        };
        let (lower, upper) = (limit("MIN_LIMIT")?, limit("MAX_LIMIT")?);
        Ok(lower.zip(upper).filter(|(lower, upper)| lower < upper))
    }

    /// Values of a module's pins, machine units.
    fn values(&mut self, module: &Module) -> Result<Vec<f64>> {
        let mut values = Vec::new();
        let mut unset = Vec::new();
        for (name, needed) in module.pins {
            let pin = format!("{}.{name}", module.name);
            match self.pins.value(&self.ini, &pin)? {
                Some(value) => values.push(value),
                None if *needed => return Err(self.not_set(&pin)),
                None => {
                    unset.push(*name);
                    values.push(0.0);
                }
            }
        }
        let has = |pin: &str| {
            let own = module.pins.iter().any(|(name, _)| *name == pin) || module.tool_pin == Some(pin);
            own || pin == "conventional-directions"
        };
        for (pin, line) in self.pins.of(module.name).filter(|(pin, _)| !has(pin)) {
            let names: Vec<&str> = module.pins.iter().map(|(name, _)| *name).collect();
            self.told.push(format!(
                "pin {}.{} (line {line} of a HAL file) is none of {} and is not read",
                module.name,
                one_line(pin),
                names.join(", ")
            ));
        }
        if !unset.is_empty() {
            self.told.push(format!("no HAL file sets {} of {}: 0 is taken", unset.join(", "), module.name));
        }
        Ok(values)
    }

    fn not_set(&self, pin: &str) -> Error {
        let what = format!("no HAL file sets {pin}");
        Error::mistake(Place::file(&self.ini.file), what, "name the HAL file that does by --hal")
    }

    /// Length of the tool whose tip is `t`, machine units.
    fn tool_length(&self, module: &Module, given: f64) -> Result<f64> {
        let given = self.units.length.from_si(given);
        let Some(name) = module.tool_pin.filter(|_| given == 0.0) else { return Ok(given) };
        let pin = format!("{}.{name}", module.name);
        // The tool table drives it as a rule.
        if self.pins.is_driven(&pin) {
            return Ok(0.0);
        }
        Ok(self.pins.value(&self.ini, &pin)?.unwrap_or(0.0))
    }

    fn is_on(&self, pin: &str) -> Result<bool> {
        Ok(self.pins.value(&self.ini, pin)?.is_some_and(|x| x != 0.0))
    }

    /// T = product of Rx(ALPHA) Tx(A) Rz(joint) Tz(D).
    fn serial(&mut self, tool_length: f64) -> Result<(Vec<Entry>, Vec<Entry>)> {
        let mut tool = Vec::new();
        let mut last = 0.0;
        for i in 0..SERIAL {
            let value = |name: &str| -> Result<f64> {
                let pin = format!("genserkins.{name}-{i}");
                self.pins.value(&self.ini, &pin)?.ok_or_else(|| self.not_set(&pin))
            };
            let length = |x: f64| self.units.length.to_si(x);
            let (a, alpha, d) = (length(value("A")?), value("ALPHA")?, length(value("D")?));
            let moves =
                [Move::Shift(2, std::mem::replace(&mut last, d)), Move::Turn(0, alpha), Move::Shift(0, a)];
            let moves = moves.into_iter().filter(|m| !m.is_none()).collect();
            let axis = Vec3([0.0, 0.0, 1.0]);
            let travel = self.travel(i, JointKind::Revolute)?;
            let joint = JointEntry { kind: JointKind::Revolute, axis, travel, follows: Vec::new(), nc: None };
            tool.push(plain(&format!("j{i}"), moves, Some(joint), format!("joint {i}")));
        }
        let moves = [Move::Shift(2, last + tool_length)].into_iter().filter(|m| !m.is_none()).collect();
        tool.push(plain("t", moves, None, "flange".into()));
        Ok((vec![plain("w", Vec::new(), None, "base".into())], tool))
    }
}

fn plain(frame: &str, moves: Vec<Move>, joint: Option<JointEntry>, note: String) -> Entry {
    Entry { frame: frame.into(), moves, offset: None, joint, mass: None, steps: Vec::new(), note }
}
