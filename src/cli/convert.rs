//! `kincal convert`

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::convert::{Nominal, Request, Written, files_of, open_counted};
use crate::machine::Machine;
use serde_json::json;

use super::Common;
use super::files::{Files, Output};
use super::output::{Failure, Outcome, count, open_machine, write_recording, write_whole};
use super::simulate;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Table of another program: text with any separator, .npy, .parquet, .arrow, .rtl, .rta, .rtx; a bag of ROS 2, its folder, or all its
    /// files; or a recording
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Machine whose joints are in the table; what is written is read back with it
    #[arg(long, value_name = "MACHINE.ron")]
    machine: Option<PathBuf>,
    /// Which column is what, instead of a guess from the headings; see docs/convert.md
    #[arg(long, value_name = "MAP.ron")]
    map: Option<PathBuf>,
    /// Where to write the map that was found
    #[arg(long, value_name = "MAP.ron")]
    write_map: Option<Output>,
    /// What was measured: position, pose, joint, distance or displacement; r-test: a ball that linear axes followed while rotary ones turned
    #[arg(long, value_name = "KIND", conflicts_with = "map")]
    measurement: Option<String>,
    /// A column of the recording and the heading (or `#3`, the number) of its column in the table; `q*=Axis *` for all joints
    #[arg(long, value_name = "NAME=COLUMN", value_parser = pair, conflicts_with = "map")]
    column: Vec<(String, String)>,
    /// Unit of a column, or of all columns of `length`, `angle` or `time` whose heading names none
    #[arg(long, value_name = "COLUMN=UNIT", value_parser = pair, conflicts_with = "map")]
    unit: Vec<(String, String)>,
    /// A line for the head of the recording, such as 'workpiece_frame: unknown'
    #[arg(long, value_name = "KEY: VALUE", conflicts_with = "map")]
    head: Vec<String>,
    /// Takes only the rows that have this text in this column
    #[arg(long = "where", value_name = "COLUMN=TEXT", value_parser = pair, conflicts_with = "map")]
    rows: Vec<(String, String)>,
    /// Names of all columns with their units, where the table has no headings
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', conflicts_with = "map")]
    names: Vec<String>,
    /// Takes only this marker, where a row has several
    #[arg(long, value_name = "NAME", conflicts_with = "map")]
    marker: Vec<String>,
    /// Convention of Euler angles: zyx-intrinsic, xyz-fixed, ..., rpy, kuka, fanuc
    #[arg(long, value_name = "CONVENTION", conflicts_with = "map")]
    euler: Option<String>,
    /// Columns rx, ry, rz are a rotation vector and no Euler angles
    #[arg(long, conflicts_with_all = ["map", "euler"])]
    rotation_vector: bool,
    /// Order of a matrix that does not tell it: row-major or column-major
    #[arg(long, value_name = "ORDER", value_parser = ["row-major", "column-major"], conflicts_with = "map")]
    matrix: Option<String>,
    /// Time stamp at which t is 0; the first one where stamps count from 1970 or are dates
    #[arg(long, value_name = "STAMP", conflicts_with = "map")]
    time_zero: Option<String>,
    /// The path that ran, where the table has readings alone: a test with its options as `kincal simulate` has them, 'BK4 --length 100mm
    /// --feed 500mm/min', or an NC program, 'part.nc --length 100mm'
    #[arg(long, value_name = "TEST ...|PROGRAM.nc", requires = "machine")]
    path: Option<String>,
    /// Readings a second, where such a table has no column of time; found by the path's feed
    #[arg(long, value_name = "RATE", value_parser = rate, requires = "path")]
    sample_rate: Option<f64>,
    /// Topic of a bag of ROS 2 with the positions of the joints; found where only one has them
    #[arg(long, value_name = "TOPIC")]
    joint_topic: Option<String>,
    /// Topic of a bag with the poses; found where only one has them
    #[arg(long, value_name = "TOPIC", conflicts_with = "frames")]
    pose_topic: Option<String>,
    /// Poses of frame CHILD in frame PARENT of TF, over the frames between them
    #[arg(long, value_name = "PARENT,CHILD", value_parser = frames)]
    frames: Option<(String, String)>,
    /// Longest time between joint states of a bag over which a line is drawn, such as 50ms; three of their usual intervals
    #[arg(long, value_name = "TIME", value_parser = simulate::time)]
    longest_gap: Option<f64>,
    /// The joint that a file of a laser or a table of deviations at targets is about
    #[arg(long, value_name = "JOINT")]
    joint: Option<String>,
    /// From which side the targets of a laser were approached, where the file does not tell
    #[arg(long, value_name = "HOW", value_parser = ["alternating", "rising", "falling"])]
    approach: Option<String>,
    /// What deviations are: of a laser or at targets the first two, of an R-test the others
    #[arg(long, value_name = "SENSE", value_parser = ["laser-minus-target", "target-minus-laser", "ball-minus-tool", "tool-minus-ball"])]
    deviation: Option<String>,
    /// Along which axes an R-test was read: of the tool, in which the nest stands, of the machine's base, or of the workpiece
    #[arg(long, value_name = "AXES", value_parser = ["tool", "machine", "workpiece"])]
    axes: Option<String>,
    /// What separates columns: comma, semicolon, tab or blanks; found by itself
    #[arg(long, value_name = "WORD", conflicts_with = "map")]
    separator: Option<String>,
    /// Decimal sign: point or comma; found by itself
    #[arg(long, value_name = "WORD", conflicts_with = "map")]
    decimal: Option<String>,
    /// Where to write the recording, as a table in columns where it ends in .parquet or .arrow; of several markers each gets its name: REC_MARKER.csv
    #[arg(short, long, value_name = "REC.csv")]
    output: Output,
    #[command(flatten)]
    common: Common,
}

/// A word as a shell takes it.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+,:=\\".contains(c);
    match text.chars().all(plain) {
        true => text.into(),
        false => format!("'{}'", text.replace('\'', "'\\''")),
    }
}

/// `KEY=VALUE` at the first sign of equality.
fn pair(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("write it as NAME=VALUE")?;
    if key.trim().is_empty() || value.trim().is_empty() {
        return Err("nothing stands on one side of `=`".into());
    }
    Ok((key.trim().into(), value.trim().into()))
}

/// `tracker,tool`.
fn frames(text: &str) -> Result<(String, String), String> {
    let both = text.split_once(',').map(|(parent, child)| (parent.trim(), child.trim()));
    let both = both.filter(|(parent, child)| !parent.is_empty() && !child.is_empty() && !child.contains(','));
    let plain = |frame: &str| frame.strip_prefix('/').unwrap_or(frame).to_string();
    both.map(|(parent, child)| (plain(parent), plain(child))).ok_or("write it as PARENT,CHILD".into())
}

/// `250Hz`, `1kHz`, `250`.
fn rate(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let (number, times) = match (text.strip_suffix("kHz"), text.strip_suffix("Hz")) {
        (Some(number), _) => (number, 1e3),
        (None, Some(number)) => (number, 1.0),
        (None, None) => (text, 1.0),
    };
    let rate = number.trim().parse::<f64>().ok().map(|rate| rate * times);
    rate.filter(|rate| (1e-3..=1e9).contains(rate)).ok_or("write readings a second: 250Hz".into())
}

impl Args {
    fn request(&self, path: Option<Nominal>) -> Request {
        Request {
            path,
            sample_rate: self.sample_rate,
            map: self.map.clone(),
            measurement: self.measurement.clone(),
            columns: self.column.clone(),
            units: self.unit.clone(),
            head: self.head.clone(),
            rows: self.rows.iter().cloned().collect(),
            names: self.names.clone(),
            markers: self.marker.clone(),
            euler: self.euler.clone(),
            rotation_vector: self.rotation_vector,
            matrix: self.matrix.clone(),
            time_zero: self.time_zero.clone(),
            joint: self.joint.clone(),
            approach: self.approach.clone(),
            deviation: self.deviation.clone(),
            axes: self.axes.clone(),
            separator: self.separator.clone(),
            decimal: self.decimal.clone(),
            joint_topic: self.joint_topic.clone(),
            pose_topic: self.pose_topic.clone(),
            frames: self.frames.clone(),
            longest_gap: self.longest_gap,
            call: Some(self.call()),
        }
    }

    /// The command that this is, ready to be pasted, for a message about a bag: all that is told of one but its topics.
    fn call(&self) -> String {
        let mut words = vec!["kincal".to_string(), "convert".into()];
        words.extend(self.files.iter().map(|file| quoted(&file.to_string_lossy())));
        let mut flag = |name: &str, value: &str| words.extend([format!("--{name}"), quoted(value)]);
        let paths = [("machine", &self.machine), ("map", &self.map)];
        for (name, path) in paths.into_iter().filter_map(|(name, path)| Some((name, path.as_ref()?))) {
            flag(name, &path.to_string_lossy());
        }
        for (name, pairs) in [("column", &self.column), ("unit", &self.unit)] {
            pairs.iter().for_each(|(key, value)| flag(name, &format!("{key}={value}")));
        }
        self.head.iter().for_each(|line| flag("head", line));
        let told = [("measurement", &self.measurement), ("time-zero", &self.time_zero)];
        for (name, value) in told.into_iter().filter_map(|(name, value)| Some((name, value.as_ref()?))) {
            flag(name, value);
        }
        if let Some(gap) = self.longest_gap {
            flag("longest-gap", &format!("{gap}s"));
        }
        flag("output", &self.output.to_string_lossy());
        words.join(" ")
    }
}

/// The file of one recording: the marker's name before the ending.
fn path_of(output: &Path, recording: &Written) -> PathBuf {
    let Some(marker) = &recording.marker else { return output.to_path_buf() };
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let end = output.extension().map_or(String::new(), |e| format!(".{}", e.to_string_lossy()));
    let plain: String =
        marker.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
    output.with_file_name(format!("{stem}_{plain}{end}"))
}

pub(crate) fn run(args: &Args, files: &Files) -> Outcome {
    // A program that the path names is an input as any other.
    let ran = args.path.as_deref().and_then(simulate::input_of);
    let files = &files.with_inputs("--path", &ran.into_iter().collect::<Vec<_>>());
    let files = &files.with_inputs("FILE", &files_of(&args.files)?);
    files.check()?;
    let machine =
        (args.machine.as_ref()).map(|path| open_machine(path, |path| Machine::open(path))).transpose()?;
    let path = match (&args.path, &machine) {
        (Some(text), Some(machine)) => Some(simulate::path(machine, text)?),
        _ => None,
    };
    let progress = args.common.progress();
    if let Some(file) = args.files.first() {
        progress.say(&format!("reading {}", file.display()));
    }
    let converted = open_counted(&args.files, machine.as_ref(), &args.request(path), progress.meter())?;
    if args.write_map.is_some() && converted.map.is_empty() {
        return Err(Failure::Told {
            what: format!(
                "{}: no map holds how this table is read: it is a recording already, or rows and columns change their places",
                args.files[0].display()
            ),
            mend: "leave --write-map out; the flags of this call say all".into(),
        });
    }
    let paths: Vec<PathBuf> = converted.recordings.iter().map(|r| path_of(&args.output, r)).collect();
    // The names of several come from the markers, and are seen only now.
    files.with_outputs("--output", &paths).check()?;
    if let Some(twice) = (1..paths.len()).find(|i| paths[..*i].contains(&paths[*i])) {
        return Err(Failure::Told {
            what: format!("{}: two markers would be written into this file", paths[twice].display()),
            mend: "take one by `--marker`, or rename them in a map".into(),
        });
    }
    let put = |out: &mut dyn Write, text: &str| {
        // Watched: an error here is told of the output.
        let _ = out.write_all(text.as_bytes());
        Ok(())
    };
    for (path, recording) in paths.iter().zip(&converted.recordings) {
        progress.say(&format!("writing {}", path.display()));
        write_recording(path, |out| put(out, &recording.text))?;
    }
    if let Some(path) = &args.write_map {
        write_whole(path, |out| put(out, &converted.map))?;
    }
    drop(progress);
    let mut text = String::new();
    if args.map.is_none() && args.write_map.is_none() && !converted.map.is_empty() {
        text.push_str(&converted.map);
    } else {
        text.extend(converted.told.iter().map(|line| format!("{line}\n")));
    }
    if let Some(positioning) = &converted.positioning {
        text.extend(positioning.in_words().iter().map(|line| format!("{line}\n")));
    }
    for (path, recording) in paths.iter().zip(&converted.recordings) {
        let gaps = match recording.with_gaps {
            0 => String::new(),
            n => format!(", {n} with a field that is missing"),
        };
        text.push_str(&format!(
            "{}{gaps} written to {}\n",
            count(recording.rows, "row", "rows"),
            path.display()
        ));
    }
    args.common.say(&text)?;
    let recordings: Vec<_> = paths
        .iter()
        .zip(&converted.recordings)
        .map(|(path, r)| {
            json!({"file": path.to_string_lossy(), "marker": r.marker, "rows": r.rows, "with_gaps": r.with_gaps})
        })
        .collect();
    let mut result = json!({"recordings": recordings, "map": converted.map, "told": converted.told});
    if let Some(alignment) = &converted.alignment {
        result["alignment"] = json!(alignment);
    }
    if let Some(positioning) = &converted.positioning {
        result["positioning"] = json!(positioning);
    }
    args.common.write_json(&result)
}
