//! Recordings from tables of other programs: trackers, controls, loggers, spreadsheets.
//!
//! [`open`] reads a table, finds out from its headings what its columns are, and writes a recording of each marker in it. What headings do
//! not say is not guessed: an error lists what has to be told. A [`Map`] says all of it; `docs/convert.md`.

mod align;
#[cfg(feature = "rosbag")]
mod bag;
mod capture;
mod cell;
mod columns;
mod deviations;
mod draft;
mod follow;
mod form;
mod groups;
mod guess;
mod heading;
mod joints;
mod map;
mod matrix;
mod measured;
mod moment;
#[cfg(not(feature = "rosbag"))]
mod no_bag;
mod nominal;
mod npy;
mod parts;
mod plan;
mod positioning;
mod r_test;
mod recorded;
mod renishaw;
mod request;
mod rotation;
mod shapes;
mod table;
mod target;
mod targets;
mod text;
mod told;
#[cfg(feature = "rosbag")]
mod topics;
mod unit;
mod write;

use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

#[cfg(not(feature = "rosbag"))]
use no_bag as bag;

pub(crate) use cell::plain;
pub use follow::Alignment;
pub(crate) use form::Separator;
pub(crate) use heading::{Heading, Stated};
pub use map::{Map, MappedColumn};
pub use nominal::Nominal;
pub use positioning::{BothWays, OneWay, Positioning};
pub use request::Request;
pub(crate) use text::decoded;
pub use write::Written;

use serde::{Deserialize, Serialize};

use crate::columnar::Form;
use crate::error::{Error, Place, Result};
use crate::foreign::{self, Foreign, MCAP, NUMPY, START};
use crate::machine::Machine;
use crate::meter::Meter;
use map::Known;
use parts::Parts;
use table::{Table, Told};

/// Recordings that were made of a table.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Converted {
    /// One for each marker.
    pub recordings: Vec<Written>,
    /// The map that made them, as a file; empty where the table was not read column by column: deviations at targets, an R-test, what is a
    /// recording already.
    pub map: String,
    /// What was guessed or left out, one sentence each.
    pub told: Vec<String>,
    /// Where the path lies in the readings, where one was told.
    pub alignment: Option<Alignment>,
    /// How well the axis comes to its targets, where the table is of that.
    pub positioning: Option<Positioning>,
}

/// Reads the table at `path`, which may be a folder with a bag of ROS 2.
///
/// # Errors
/// As [`read`], and [`Error::File`].
pub fn open(path: impl AsRef<Path>, machine: Option<&Machine>, request: &Request) -> Result<Converted> {
    open_parts(&[path.as_ref().to_path_buf()], machine, request)
}

/// Reads several files as one recording: those of a bag of ROS 2 that its recorder has split, each named, or as the folder that they are in.
///
/// # Errors
/// As [`open`], and where several are no bag.
pub fn open_parts(paths: &[PathBuf], machine: Option<&Machine>, request: &Request) -> Result<Converted> {
    open_counted(paths, machine, request, &Meter::default())
}

/// [`open_parts`]; `meter` counts what is read, and each pass over it.
pub(crate) fn open_counted(
    paths: &[PathBuf],
    machine: Option<&Machine>,
    request: &Request,
    meter: &Meter,
) -> Result<Converted> {
    let Parts { files, told } = Parts::of(paths)?;
    let mut parts: Vec<Part> = Vec::new();
    let length = |path: &PathBuf| path.metadata().ok().filter(|own| own.is_file()).map(|own| own.len());
    meter.begin(files.iter().map(length).sum());
    for path in &files {
        let fault = |source| Error::file(path, source);
        let mut file = meter.counting(File::open(path).map_err(fault)?);
        let mut bytes = Vec::new();
        (&mut file).take(START as u64).read_to_end(&mut bytes).map_err(fault)?;
        // A recorder that was stopped may have begun a file and written nothing.
        let is_bag = bytes.starts_with(MCAP) || (files.len() > 1 && bytes.is_empty());
        match (is_bag, files.len()) {
            // Bags have cameras in them, and are larger than memory.
            (true, _) => parts.push((path, Box::new(Cursor::new(bytes).chain(BufReader::new(file))))),
            (false, 1) => {
                file.read_to_end(&mut bytes).map_err(fault)?;
                return read_counted(path, &bytes, machine, request, meter);
            }
            (false, _) => {
                let what = "this is no bag of ROS 2 (MCAP): of other files each is a recording of its own";
                return Err(Error::mistake(Place::file(path), what, "convert them one by one"));
            }
        }
    }
    let Some(file) = paths.first() else {
        return Err(Error::mistake(Place::file(""), "no file is named", "name a table, or a bag"));
    };
    let mut converted = of_bag(file, parts, machine, request, meter)?;
    converted.told.splice(..0, told);
    Ok(converted)
}

/// The files that [`open_parts`] reads, folders opened.
///
/// # Errors
/// [`Error::Input`]: a folder without a bag; [`Error::File`].
#[cfg(feature = "cli")]
pub(crate) fn files_of(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    Ok(Parts::of(paths)?.files)
}

/// A file of a bag, and what reads it from its beginning.
type Part<'a> = (&'a Path, Box<dyn Read + 'a>);

/// The recording of a bag, which messages call `file`.
fn of_bag(
    file: &Path,
    parts: Vec<Part>,
    machine: Option<&Machine>,
    request: &Request,
    meter: &Meter,
) -> Result<Converted> {
    let known = request.map.as_ref().map(|path| Known::open(path)).transpose()?;
    let mut bagged = bag::read(file, parts, machine, request)?;
    let (known, notes) = match (known, machine) {
        (Some(known), _) => (known, Vec::new()),
        (None, Some(machine)) => {
            let (mut map, notes) = guess::map(&bagged.table, machine, &bagged.request)?;
            bag::order(&mut map);
            (Known::guessed(map, file), notes)
        }
        (None, None) => return Err(no_machine(file)),
    };
    let mut told = bagged.settled(&known.map, machine)?;
    told.extend(notes);
    told.extend(machine.is_none().then(not_read_back));
    let recordings = write::all(&known, &bagged.table, machine, &mut told, meter)?;
    Ok(Converted { recordings, map: known.map.ron(&told), told, alignment: None, positioning: None })
}

fn no_machine(file: &Path) -> Error {
    let what = "neither a machine nor a map says what the columns are";
    let mend =
        "give the machine whose joints are in the table, `--machine MACHINE.ron`, or a map, `--map MAP.ron`";
    Error::mistake(Place::file(file), what, mend)
}

fn not_read_back() -> String {
    "not read back: `--machine` would say whether it is a recording of that machine".into()
}

/// Reads a table; `file` is only the name that messages use. Without a map the machine's joints say which columns are looked for; with a
/// machine what was written is read back.
///
/// ```
/// use kincal::Machine;
/// use kincal::convert::{Request, read};
///
/// let machine = Machine::parse("slide.ron", r#"Machine(
///     name: "slide", units: (length: mm, angle: deg), workpiece: [(frame: "w")],
///     tool: [(frame: "x", joint: Prismatic(axis: "x")), (frame: "t", at: (0, 0, 80))],
/// )"#)?;
/// let table = b"Time (ms);X_cmd (mm);X_act (mm)\n0;100,5;100,512\n10;200,5;200,498\n";
/// let converted = read("log.csv", table, Some(&machine), &Request::default())?;
/// assert_eq!(
///     converted.recordings[0].text,
///     "# machine: slide\n# measurement: joint\nt[ms],x[mm],x_meas[mm]\n0,100.5,100.512\n10,200.5,200.498\n"
/// );
/// # Ok::<(), kincal::Error>(())
/// ```
///
/// # Errors
/// [`Error::Input`] with line and column: a table without form, what is no number, all that has to be told.
pub fn read(
    file: impl AsRef<Path>,
    bytes: &[u8],
    machine: Option<&Machine>,
    request: &Request,
) -> Result<Converted> {
    read_counted(file.as_ref(), bytes, machine, request, &Meter::default())
}

/// [`read`]; `meter` counts each pass.
fn read_counted(
    file: &Path,
    bytes: &[u8],
    machine: Option<&Machine>,
    request: &Request,
    meter: &Meter,
) -> Result<Converted> {
    told::heads(file, request)?;
    let flag = |name: &str, (what, mend): (String, String)| {
        Error::mistake(Place::file(file), format!("--{name}: {what}"), mend)
    };
    if bytes.starts_with(MCAP) {
        return of_bag(file, vec![(file, Box::new(bytes))], machine, request, meter);
    }
    let start = &bytes[..bytes.len().min(START)];
    let form = Form::of_file(file, start)?;
    if let Some(Foreign { what, mend: Some(mend) }) = foreign::of(file, start).filter(|_| form.is_none()) {
        return Err(Error::mistake(Place::file(file), format!("this is {what}, which is not read"), mend));
    }
    if request.is_of_bag() {
        let what = "it tells what to take of a bag of ROS 2, and this is no such file";
        let mend = "leave --joint-topic, --pose-topic, --frames and --longest-gap out, or give a file .mcap";
        return Err(Error::mistake(Place::file(file), what, mend));
    }
    // Where something is told of it, a recording is a table as any other.
    if (Request { call: None, ..request.clone() }) == Request::default()
        && let Some(recording) = recorded::read(file, bytes, form, machine)?
    {
        let told = vec!["it is a recording already, and stays as it is".to_string()];
        let (map, recordings) = (String::new(), vec![recording]);
        return Ok(Converted { recordings, map, told, alignment: None, positioning: None });
    }
    let known = request.map.as_ref().map(|path| Known::open(path)).transpose()?;
    let told = match &known {
        Some(known) => {
            let (separator, decimal_comma) = known.form()?;
            Told { separator, decimal_comma, names: known.map.names.clone() }
        }
        None => Told {
            separator: (request.separator.as_deref())
                .map(|word| map::separator(word).map_err(|e| flag("separator", e)))
                .transpose()?,
            decimal_comma: (request.decimal.as_deref())
                .map(|word| map::decimal(word).map_err(|e| flag("decimal", e)))
                .transpose()?,
            names: request.names.clone(),
        },
    };
    let is_r_test = known.is_none() && request.measurement.as_deref() == Some(request::R_TEST);
    // A map says everything, and columns that are named make a table of their own.
    let is_free = known.is_none() && request.columns.is_empty() && request.path.is_none() && !is_r_test;
    let (table, measured) = if let Some(form) = form {
        let (table, text) = columns::read(file, bytes, form, &told)?;
        match targets::head(&text, &told).filter(|_| is_free) {
            Some(head) => (None, Some(targets::read(file, &text, &head, machine, request)?)),
            None => (Some(table), None),
        }
    } else if renishaw::is_one(file, bytes) {
        (None, Some(renishaw::read(file, bytes, machine, request)?))
    } else if capture::is_one(file, bytes) {
        (Some(capture::read(file, bytes, &told)?), None)
    } else if bytes.starts_with(NUMPY) {
        (Some(npy::read(file, bytes, &told)?), None)
    } else if let Some(head) = targets::head(bytes, &told).filter(|_| is_free) {
        (None, Some(targets::read(file, bytes, &head, machine, request)?))
    } else {
        (Some(Table::read(file, bytes, &told, meter)?), None)
    };
    let measured = match (&table, machine) {
        (Some(table), Some(machine)) if is_r_test => Some(r_test::read(table, machine, request)?),
        _ => measured,
    };
    let is_mapped = !is_r_test && !measured.as_ref().is_some_and(|own| own.is_rearranged);
    let mut positioning = None;
    let (table, laser) = match (measured, table) {
        (Some(measured), _) => {
            positioning = measured.positioning;
            (measured.table, Some((measured.map, measured.told)))
        }
        (None, Some(table)) => (table, None),
        (None, None) => return Err(flag("measurement", ("no table is found".into(), "give a table".into()))),
    };
    let (known, mut told) = match (known, machine) {
        (Some(known), _) => (known, Vec::new()),
        _ if laser.is_some() => {
            let (map, notes) = laser.unwrap_or_default();
            (Known::guessed(map, file), notes)
        }
        (None, Some(machine)) => {
            let (map, told) = guess::map(&table, machine, request)?;
            (Known::guessed(map, file), told)
        }
        (None, None) => return Err(no_machine(file)),
    };
    told.extend(machine.is_none().then(not_read_back));
    let Some(path) = &request.path else {
        let recordings = write::all(&known, &table, machine, &mut told, meter)?;
        let map = if is_mapped { known.map.ron(&told) } else { String::new() };
        return Ok(Converted { recordings, map, told, alignment: None, positioning });
    };
    let Some(machine) = machine else {
        let mend = "give the machine that ran it, `--machine MACHINE.ron`";
        return Err(Error::mistake(Place::file(file), "a path without its machine", mend));
    };
    let map = known.map.clone();
    let followed = follow::follow(&table, known, machine, path, request.sample_rate)?;
    told.extend(followed.told);
    let recordings = write::all(&followed.known, &followed.table, Some(machine), &mut told, meter)?;
    let alignment = Some(followed.alignment);
    Ok(Converted { recordings, map: map.ron(&told), told, alignment, positioning: None })
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;

    #[test]
    fn every_pass_over_a_table_is_counted_to_its_end() {
        let folder = std::env::temp_dir().join(format!("kincal-passes-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let slide = "Machine(name: \"slide\", units: (length: mm, angle: deg), workpiece: [(frame: \"w\")],
            tool: [(frame: \"x\", joint: Prismatic(axis: \"x\")), (frame: \"t\")])";
        let machine = Machine::parse("slide.ron", slide).expect("a machine");
        let file = folder.join("log.csv");
        std::fs::write(&file, "X_cmd (mm);X_act (mm)\n100,5;100,512\n200,5;200,498\n").expect("written");
        let meter = Meter::default();
        open_counted(&[file], Some(&machine), &Request::default(), &meter).expect("a recording");
        std::fs::remove_dir_all(&folder).expect("removed");
        // The file, its rows, the rows that are written, and what is read back of them.
        let pass = meter.pass();
        assert_eq!((pass.number, Some(pass.read)), (4, pass.all));
    }
}
