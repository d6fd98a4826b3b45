//! Recordings of real machines by set, and how a set is split into what is learnt from and what is judged.

use std::sync::LazyLock;

use kincal::Machine;
use kincal::feature::as_seen_in;
use kincal::recording::{Recording, join};

use crate::common::{data, machine};

/// A recording as text, so that parts of it can be taken.
pub struct Text {
    pub name: String,
    /// Key lines and the header row.
    pub head: Vec<String>,
    pub rows: Vec<String>,
}

impl Text {
    fn read(folder: &str, file: &str) -> Text {
        let path = data(&format!("recordings/{folder}/{file}.csv"));
        Text::of(file, &std::fs::read_to_string(path).expect("readable"))
    }

    fn of(file: &str, text: &str) -> Text {
        let (mut head, mut rows) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let of_head = line.starts_with('#') || head.last().is_none_or(|l: &String| l.starts_with('#'));
            if of_head { &mut head } else { &mut rows }.push(line.to_string());
        }
        Text { name: format!("{file}.csv"), head, rows }
    }

    /// The rows for which `keep` holds, as a recording.
    pub fn part(&self, machine: &Machine, keep: impl Fn(usize, &str) -> bool) -> Recording {
        let rows = self.rows.iter().enumerate().filter(|(i, row)| keep(*i, row)).map(|(_, row)| row);
        let lines: Vec<&str> = self.head.iter().chain(rows).map(String::as_str).collect();
        Recording::from_bytes(&self.name, lines.join("\n").into_bytes(), machine)
            .unwrap_or_else(|e| panic!("{e}"))
    }

    pub fn whole(&self, machine: &Machine) -> Recording {
        self.part(machine, |_, _| true)
    }

    /// The commands of a row, as written.
    pub fn pose<'a>(&self, row: &'a str) -> &'a str {
        let commands =
            self.head.last().expect("a header row").split(",px[").next().expect("joints come first");
        let commas = commands.matches(',').count() + 1;
        let end = row.match_indices(',').nth(commas - 1).map_or(row.len(), |(at, _)| at);
        &row[..end]
    }
}

/// How a set is split.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// What is learnt from, and what is judged with that.
pub struct Fold {
    pub train: Vec<Recording>,
    pub judged: Vec<Judged>,
}

/// What finds the set-up again (nothing: no need), and what is judged.
pub struct Judged {
    pub setup: Vec<Recording>,
    pub test: Vec<Recording>,
}

pub struct Set {
    pub name: String,
    pub machine: Machine,
    pub texts: Vec<Text>,
    pub split: Split,
}

impl Set {
    fn read(stem: &str, folder: &str, files: &[&str], split: Split) -> Set {
        let texts = files.iter().map(|file| Text::read(folder, file)).collect();
        let last = folder.rsplit('/').next().expect("a name").to_string();
        let name = if files.len() == 1 { format!("{last} {}", files[0]) } else { last };
        Set::of(name, stem, texts, split)
    }

    /// The machine as far as the recordings show it.
    fn of(name: String, stem: &str, texts: Vec<Text>, split: Split) -> Set {
        let whole = machine(stem);
        let recordings: Vec<Recording> = texts.iter().map(|text| text.whole(&whole)).collect();
        Set { name, machine: as_seen_in(&whole, &recordings), texts, split }
    }

    pub fn whole(&self) -> Vec<Recording> {
        self.texts.iter().map(|t| t.whole(&self.machine)).collect()
    }

    pub fn folds(&self) -> Vec<Fold> {
        let machine = &self.machine;
        let parts = |keep: &dyn Fn(usize, &Text, &str) -> bool| -> Vec<Recording> {
            self.texts.iter().map(|t| t.part(machine, |i, row| keep(i, t, row))).collect()
        };
        let others = |out: usize| -> Vec<Recording> {
            let kept = self.texts.iter().enumerate().filter(|(i, _)| *i != out);
            kept.map(|(_, t)| t.whole(machine)).collect()
        };
        let without = |out: usize, judged: Vec<Judged>| Fold { train: others(out), judged };
        let here = |train: Vec<Recording>, test: Vec<Recording>| Fold {
            train,
            judged: vec![Judged { setup: Vec::new(), test }],
        };
        let texts = self.texts.iter().enumerate();
        match self.split {
            Split::Place => {
                let placed = |text: &Text| Judged {
                    setup: vec![text.whole(machine)],
                    test: vec![text.whole(machine)],
                };
                texts.map(|(out, text)| without(out, vec![placed(text)])).collect()
            }
            Split::TrialHalves => {
                let half = |text: &Text, half: usize| Judged {
                    setup: vec![text.part(machine, |i, _| i % 2 == half)],
                    test: vec![text.part(machine, |i, _| i % 2 != half)],
                };
                texts.map(|(out, text)| without(out, vec![half(text, 0), half(text, 1)])).collect()
            }
            Split::Rows(n) => (0..n)
                .map(|fold| here(parts(&|i, _, _| i % n != fold), parts(&|i, _, _| i % n == fold)))
                .collect(),
            Split::Pose => {
                let mut poses: Vec<&str> =
                    self.texts.iter().flat_map(|t| t.rows.iter().map(|row| t.pose(row))).collect();
                poses.sort_unstable();
                poses.dedup();
                let fold = |pose: &&str| {
                    here(parts(&|_, t, row| t.pose(row) != *pose), parts(&|_, t, row| t.pose(row) == *pose))
                };
                poses.iter().map(fold).collect()
            }
        }
    }
}

pub fn kuka() -> Set {
    Set::read("kuka_iiwa14", "mukca/kuka_14", &["front", "left_back"], Split::Place)
}

pub fn pandas() -> Vec<Set> {
    let sets: [(&str, &[&str]); 5] = [
        ("panda_1", &["back-high", "front"]),
        ("panda_2", &["back_left", "front_center", "front_left", "high", "mid_right"]),
        ("panda_3", &["backleft", "backright", "frontcenter", "frontright"]),
        ("panda_4", &["left", "very-front"]),
        ("panda_6", &["front", "right"]),
    ];
    let read = |(arm, files): (&str, &[&str])| {
        Set::read("franka_panda", &format!("mukca/{arm}"), files, Split::Place)
    };
    // The seventh arm was recorded at one place only: rows are left out.
    let seventh = Set::read("franka_panda", "mukca/panda_7", &["right"], Split::Rows(5));
    sets.into_iter().map(read).chain([seventh]).collect()
}

pub fn gen3_lites() -> Vec<Set> {
    let sets: [(&str, &[&str]); 2] =
        [("dinova_1", &["left", "raised_back"]), ("dinova_2", &["front", "left"])];
    let read = |(arm, files): (&str, &[&str])| {
        Set::read("kinova_gen3_lite", &format!("mukca/{arm}"), files, Split::Place)
    };
    sets.into_iter().map(read).collect()
}

pub fn hilti() -> Set {
    Set::read(
        "hilti_jaibot",
        "hilti_jaibot",
        &["diagonal_wood", "flat", "pallet", "seesaw"],
        Split::TrialHalves,
    )
}

pub fn justin() -> Vec<Set> {
    let read = |arm: &str| Set::read(&format!("dlr_justin_{arm}"), "dlr_justin", &[arm], Split::Rows(5));
    ["right", "left"].into_iter().map(read).collect()
}

/// Each arm with the joints of the other one beside its own.
pub fn justin_with_both_arms() -> Vec<Set> {
    let both = |own: &str, other: &str| {
        let path = |arm: &str| data(&format!("recordings/dlr_justin/{arm}.csv"));
        let joined = join(&path(own), &path(other), other).unwrap_or_else(|e| panic!("{e}"));
        let texts = vec![Text::of(own, &joined.text)];
        Set::of(format!("dlr_justin {own} with {other}"), &format!("dlr_justin_{own}"), texts, Split::Rows(5))
    };
    [("right", "left"), ("left", "right")].into_iter().map(|(own, other)| both(own, other)).collect()
}

pub fn fanuc() -> Set {
    Set::read("fanuc_r2000ic_165f", "fanuc_r2000ic", &["mark_A", "mark_B", "mark_C"], Split::Pose)
}

/// Arms and single axes in which physics is looked for, each read once.
pub static SETS: LazyLock<Vec<Set>> = LazyLock::new(|| {
    let mut sets = vec![kuka(), hilti()];
    sets.extend(pandas());
    sets.extend(justin());
    sets.extend(justin_with_both_arms());
    sets.extend(axes());
    sets
});

/// Single axes against an encoder, a tracker, a resolver or a second measuring system, by their own names.
pub fn axes() -> Vec<Set> {
    let rotary: [(&str, &[&str]); 5] = [
        ("resolver_fourth", &["ResolverCiclicError2"]),
        ("resolver_second", &["VoltageDividerSineCosCoils"]),
        ("stroke", &["stroke_continuous"]),
        ("tracker", &["fat_repeatability_lasertracker"]),
        (
            "reversals",
            &[
                "backlash_0deg_back",
                "backlash_0deg_forw",
                "backlash_20deg_back",
                "backlash_20deg_forw",
                "backlash_40deg_back",
                "backlash_40deg_forw",
            ],
        ),
    ];
    let linear: [(&str, &[&str]); 8] = [
        ("open_loop", &["resolver_vs_openloop"]),
        ("s840d", &["s840d_shift"]),
        ("axis1_laser_10.0", &["11360_230_2_slower_rate_ild2300"]),
        ("axis1_resolver_10.0", &["11360_230_2_slower_rate_resolver"]),
        ("axis1_laser_10.2", &["11360_230_2_step_10_2_ild2300"]),
        ("axis1_resolver_10.2", &["11360_230_2_step_10_2_resolver"]),
        ("axis2_laser_10.2", &["11360_axis2_230_2_step_10_2_ild2300"]),
        ("axis2_resolver_10.2", &["11360_axis2_230_2_step_10_2_resolver"]),
    ];
    let read = |machine: &str, (name, files): &(&str, &[&str])| {
        // Five targets in turn: a fold of four never leaves out one target alone.
        let set = Set::read(machine, machine, files, Split::Rows(4));
        Set { name: name.to_string(), ..set }
    };
    let rotary = rotary.iter().map(|set| read("rotary_axis", set));
    rotary.chain(linear.iter().map(|set| read("linear_axis", set))).collect()
}
