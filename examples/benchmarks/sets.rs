//! Real recordings by set, and how a set is split into what is learnt from and what is judged.

use std::path::{Path, PathBuf};

use kincal::Machine;
use kincal::feature::as_seen_in;
use kincal::recording::{Recording, join};

use crate::outcome::{Failure, Outcome};

/// The folder of recordings, if one was given.
pub struct Data {
    folder: Option<PathBuf>,
}

impl Data {
    pub fn new(folder: Option<&Path>) -> Self {
        Data { folder: folder.map(Path::to_path_buf) }
    }

    fn file(&self, folder: &str, file: &str) -> Outcome<PathBuf> {
        let missing = |what: String| Failure::Missing(what);
        let data = self.folder.as_ref().ok_or_else(|| missing("no --data DIR".into()))?;
        let path = data.join(folder).join(format!("{file}.csv"));
        if path.is_file() { Ok(path) } else { Err(missing(format!("DIR/{folder}/{file}.csv is not there"))) }
    }
}

/// A shipped machine.
pub fn machine(stem: &str) -> Outcome<Machine> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines").join(format!("{stem}.ron"));
    Ok(Machine::open(file)?)
}

/// Every shipped machine with the stem of its file, sorted.
pub fn machines() -> Outcome<Vec<(String, Machine)>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("machines");
    let mut stems = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if let (Some(stem), true) = (path.file_stem(), path.extension().is_some_and(|e| e == "ron")) {
            stems.push(stem.to_string_lossy().into_owned());
        }
    }
    stems.sort();
    stems.into_iter().map(|stem| machine(&stem).map(|machine| (stem, machine))).collect()
}

/// A recording as text, so that parts of it can be taken and commands rewritten.
pub struct Text {
    pub name: String,
    /// Key lines and the header row.
    pub head: Vec<String>,
    pub rows: Vec<String>,
}

impl Text {
    fn read(path: &Path) -> Outcome<Text> {
        let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        Ok(Text::of(&name, &std::fs::read_to_string(path)?))
    }

    fn of(name: &str, text: &str) -> Text {
        let keys = text.lines().take_while(|line| line.starts_with('#')).count();
        let lines: Vec<String> = text.lines().map(str::to_string).collect();
        let (head, rows) = lines.split_at((keys + 1).min(lines.len()));
        Text { name: format!("{name}.csv"), head: head.to_vec(), rows: rows.to_vec() }
    }

    pub fn columns(&self) -> Vec<&str> {
        self.head.last().map_or_else(Vec::new, |header| header.split(',').collect())
    }

    /// The rows for which `keep` holds, as a recording.
    pub fn part(&self, machine: &Machine, keep: impl Fn(usize, &str) -> bool) -> Outcome<Recording> {
        let rows = self.rows.iter().enumerate().filter(|(i, row)| keep(*i, row)).map(|(_, row)| row);
        let lines: Vec<&str> = self.head.iter().chain(rows).map(String::as_str).collect();
        Ok(Recording::from_bytes(&self.name, lines.join("\n").into_bytes(), machine)?)
    }

    pub fn whole(&self, machine: &Machine) -> Outcome<Recording> {
        self.part(machine, |_, _| true)
    }

    /// The commands of a row, as written.
    fn pose<'a>(&self, row: &'a str) -> &'a str {
        let commands = self.columns().iter().take_while(|column| !column.starts_with("px[")).count();
        let end = row.match_indices(',').nth(commands.saturating_sub(1)).map_or(row.len(), |(at, _)| at);
        &row[..end]
    }
}

/// How a set is split.
#[derive(Clone, Copy, PartialEq)]
pub enum Split {
    /// Each place (file) is left out in turn; of it only the place's own pose is found again, from all its rows.
    Place,
    /// Each trial (file) is left out in turn; its set-up is found from every other row and judged on the rest, both ways.
    TrialHalves,
    /// Every `n`-th row of every file is left out in turn; nothing is found again.
    Rows(usize),
    /// Each pose (rows of one joint vector, in all files) is left out in turn; nothing is found again.
    Pose,
}

impl Split {
    /// What is left out, in words.
    pub fn words(self) -> String {
        match self {
            Split::Place => "a place, whose pose is found again".into(),
            Split::TrialHalves => {
                "a trial; every other row finds its set-up, the rest is judged, both ways".into()
            }
            Split::Rows(n) => format!("every {n}th row"),
            Split::Pose => "a pose".into(),
        }
    }
}

/// What is learnt from, what finds the set-up again (nothing: no need), and what is judged.
pub struct Fold {
    pub train: Vec<Recording>,
    pub setup: Vec<Recording>,
    pub test: Vec<Recording>,
}

pub struct Set {
    pub name: String,
    /// The machine as far as the recordings show it.
    pub machine: Machine,
    pub texts: Vec<Text>,
    pub split: Split,
}

impl Set {
    fn read(data: &Data, name: &str, stem: &str, folder: &str, files: &[&str], split: Split) -> Outcome<Set> {
        let texts: Outcome<Vec<Text>> =
            files.iter().map(|file| Text::read(&data.file(folder, file)?)).collect();
        Set::of(name, stem, texts?, split)
    }

    fn of(name: &str, stem: &str, texts: Vec<Text>, split: Split) -> Outcome<Set> {
        let whole = machine(stem)?;
        let recordings: Outcome<Vec<Recording>> = texts.iter().map(|text| text.whole(&whole)).collect();
        let machine = as_seen_in(&whole, &recordings?);
        Ok(Set { name: name.into(), machine, texts, split })
    }

    pub fn whole(&self) -> Outcome<Vec<Recording>> {
        self.texts.iter().map(|text| text.whole(&self.machine)).collect()
    }

    fn parts(&self, keep: impl Fn(usize, &Text, &str) -> bool) -> Outcome<Vec<Recording>> {
        self.texts.iter().map(|text| text.part(&self.machine, |i, row| keep(i, text, row))).collect()
    }

    fn others(&self, out: usize) -> Outcome<Vec<Recording>> {
        let kept = self.texts.iter().enumerate().filter(|(i, _)| *i != out);
        kept.map(|(_, text)| text.whole(&self.machine)).collect()
    }

    pub fn folds(&self) -> Outcome<Vec<Fold>> {
        match self.split {
            Split::Place => (self.texts.iter().enumerate())
                .map(|(out, text)| {
                    let place = || -> Outcome<Vec<Recording>> { Ok(vec![text.whole(&self.machine)?]) };
                    Ok(Fold { train: self.others(out)?, setup: place()?, test: place()? })
                })
                .collect(),
            Split::TrialHalves => (self.texts.iter().enumerate())
                .flat_map(|(out, text)| [(out, text, 0), (out, text, 1)])
                .map(|(out, text, half)| {
                    let of = |own: bool| text.part(&self.machine, |i, _| (i % 2 == half) == own);
                    Ok(Fold { train: self.others(out)?, setup: vec![of(true)?], test: vec![of(false)?] })
                })
                .collect(),
            Split::Rows(n) => (0..n)
                .map(|fold| {
                    Ok(Fold {
                        train: self.parts(|i, _, _| i % n != fold)?,
                        setup: Vec::new(),
                        test: self.parts(|i, _, _| i % n == fold)?,
                    })
                })
                .collect(),
            Split::Pose => {
                let rows = self.texts.iter().flat_map(|text| text.rows.iter().map(|row| text.pose(row)));
                let mut poses: Vec<&str> = rows.collect();
                poses.sort_unstable();
                poses.dedup();
                poses
                    .into_iter()
                    .map(|pose| {
                        Ok(Fold {
                            train: self.parts(|_, text, row| text.pose(row) != pose)?,
                            setup: Vec::new(),
                            test: self.parts(|_, text, row| text.pose(row) == pose)?,
                        })
                    })
                    .collect()
            }
        }
    }
}

/// An arm: name of the set, machine, folder, files, split.
type Row = (&'static str, &'static str, &'static str, &'static [&'static str], Split);

const ARMS: [Row; 13] = [
    ("kuka_14", "kuka_iiwa14", "mukca/kuka_14", &["front", "left_back"], Split::Place),
    ("panda_1", "franka_panda", "mukca/panda_1", &["back-high", "front"], Split::Place),
    (
        "panda_2",
        "franka_panda",
        "mukca/panda_2",
        &["back_left", "front_center", "front_left", "high", "mid_right"],
        Split::Place,
    ),
    (
        "panda_3",
        "franka_panda",
        "mukca/panda_3",
        &["backleft", "backright", "frontcenter", "frontright"],
        Split::Place,
    ),
    ("panda_4", "franka_panda", "mukca/panda_4", &["left", "very-front"], Split::Place),
    ("panda_6", "franka_panda", "mukca/panda_6", &["front", "right"], Split::Place),
    // Recorded at one place only.
    ("panda_7", "franka_panda", "mukca/panda_7", &["right"], Split::Rows(5)),
    ("dinova_1", "kinova_gen3_lite", "mukca/dinova_1", &["left", "raised_back"], Split::Place),
    ("dinova_2", "kinova_gen3_lite", "mukca/dinova_2", &["front", "left"], Split::Place),
    (
        "hilti_jaibot",
        "hilti_jaibot",
        "hilti_jaibot",
        &["diagonal_wood", "flat", "pallet", "seesaw"],
        Split::TrialHalves,
    ),
    ("dlr_justin right", "dlr_justin_right", "dlr_justin", &["right"], Split::Rows(5)),
    ("dlr_justin left", "dlr_justin_left", "dlr_justin", &["left"], Split::Rows(5)),
    ("fanuc_r2000ic", "fanuc_r2000ic_165f", "fanuc_r2000ic", &["mark_A", "mark_B", "mark_C"], Split::Pose),
];

/// Single axes: name of the set, machine and folder, files.
const AXES: [(&str, &str, &[&str]); 13] = [
    ("laser tracker", "rotary_axis", &["fat_repeatability_lasertracker"]),
    ("stroke", "rotary_axis", &["stroke_continuous"]),
    ("resolver, fourth harmonic", "rotary_axis", &["ResolverCiclicError2"]),
    ("resolver, second harmonic", "rotary_axis", &["VoltageDividerSineCosCoils"]),
    (
        "reversals",
        "rotary_axis",
        &[
            "backlash_0deg_back",
            "backlash_0deg_forw",
            "backlash_20deg_back",
            "backlash_20deg_forw",
            "backlash_40deg_back",
            "backlash_40deg_forw",
        ],
    ),
    ("resolver against motor", "linear_axis", &["resolver_vs_openloop"]),
    ("two measuring systems", "linear_axis", &["s840d_shift"]),
    ("axis 1, laser, 10.0 mm", "linear_axis", &["11360_230_2_slower_rate_ild2300"]),
    ("axis 1, resolver, 10.0 mm", "linear_axis", &["11360_230_2_slower_rate_resolver"]),
    ("axis 1, laser, 10.2 mm", "linear_axis", &["11360_230_2_step_10_2_ild2300"]),
    ("axis 1, resolver, 10.2 mm", "linear_axis", &["11360_230_2_step_10_2_resolver"]),
    ("axis 2, laser, 10.2 mm", "linear_axis", &["11360_axis2_230_2_step_10_2_ild2300"]),
    ("axis 2, resolver, 10.2 mm", "linear_axis", &["11360_axis2_230_2_step_10_2_resolver"]),
];

fn read(data: &Data, row: &Row) -> Outcome<Set> {
    let (name, stem, folder, files, split) = row;
    Set::read(data, name, stem, folder, files, *split)
}

pub fn arms(data: &Data) -> Outcome<Vec<Set>> {
    ARMS.iter().map(|row| read(data, row)).collect()
}

/// One arm.
pub fn arm(data: &Data, name: &str) -> Outcome<Set> {
    let row = ARMS.iter().find(|row| row.0 == name);
    read(data, row.ok_or_else(|| Failure::Broken(format!("no set `{name}`")))?)
}

/// Each arm of Justin with the joints of the other one beside its own.
pub fn justin_with_both_arms(data: &Data) -> Outcome<Vec<Set>> {
    let both = |own: &str, other: &str| {
        let joined = join(&data.file("dlr_justin", own)?, &data.file("dlr_justin", other)?, other)?;
        let texts = vec![Text::of(own, &joined.text)];
        let name = format!("dlr_justin {own}, with the joints of the {other} arm");
        Set::of(&name, &format!("dlr_justin_{own}"), texts, Split::Rows(5))
    };
    Ok(vec![both("left", "right")?, both("right", "left")?])
}

/// Single axes against an encoder, a tracker, a resolver or a second measuring system.
pub fn axes(data: &Data) -> Outcome<Vec<Set>> {
    // Five targets in turn: a fold of four never leaves out one target alone.
    let one = |(name, axis, files): &(&str, &str, &[&str])| {
        Set::read(data, name, axis, axis, files, Split::Rows(4))
    };
    AXES.iter().map(one).collect()
}
