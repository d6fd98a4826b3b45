//! Kinds of input, the sound texts that are damaged, and what is done with what comes of them.

use std::path::{Path, PathBuf};

use kincal::compensate::{CompensateOptions, Dialect, Setup, compensate_text};
use kincal::describe::describe;
use kincal::effects::{Identified, Library, RecordingFacts};
use kincal::identify::{CalibrateOptions, calibrate};
use kincal::nc::{Program, State};
use kincal::predict::predict;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Faults, Instrument, Plant, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Error, Machine};
use rand::RngExt;
use rand::rngs::StdRng;

use super::tally::{Fate, Flaw};
use super::words::words;

/// What a text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Machine,
    Calibrated,
    Effects,
    Recording,
    Setup,
    Faults,
    Program(Dialect),
}

impl Kind {
    pub const ALL: [Kind; 9] = [
        Kind::Machine,
        Kind::Calibrated,
        Kind::Effects,
        Kind::Recording,
        Kind::Setup,
        Kind::Faults,
        Kind::Program(Dialect::Rs274),
        Kind::Program(Dialect::Siemens),
        Kind::Program(Dialect::Heidenhain),
    ];

    pub fn name(self) -> &'static str {
        match self {
            Kind::Machine => "machine",
            Kind::Calibrated => "calibrated machine",
            Kind::Effects => "effects",
            Kind::Recording => "recording",
            Kind::Setup => "set-up",
            Kind::Faults => "faults",
            Kind::Program(Dialect::Rs274) => "program, RS-274",
            Kind::Program(Dialect::Siemens) => "program, Siemens",
            Kind::Program(Dialect::Heidenhain) => "program, Heidenhain",
            Kind::Program(other) => unreachable!("{other:?} is not among the kinds"),
        }
    }

    /// Every how many cases what was read goes through the slower of what the program does with it.
    fn seldom(self) -> u64 {
        match self {
            Kind::Recording => 64,
            _ => 16,
        }
    }
}

/// One kind with its texts, and what they are tried on.
pub struct Input {
    kind: Kind,
    /// Sound ones first.
    texts: Vec<Vec<u8>>,
    /// How many are sound: read as they are.
    sound: usize,
    machine: Machine,
    /// The same with errors.
    actual: CalibratedMachine,
    recording: Recording,
    facts: RecordingFacts,
    setup: Setup,
    /// Subdivides straight moves, m. A coordinate of millions of metres makes that last for seconds.
    split: Option<f64>,
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Files of a folder with one of these endings, sorted.
fn texts(name: &str, endings: &[&str]) -> Vec<Vec<u8>> {
    let Ok(entries) = std::fs::read_dir(folder(name)) else { return Vec::new() };
    let fits = |path: &PathBuf| path.extension().is_some_and(|e| endings.iter().any(|ending| e == *ending));
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).filter(fits).collect();
    paths.sort();
    // What is long is long for a reason of its own, and would only take the time of other cases.
    let all =
        paths.iter().map(|path| std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())));
    all.filter(|text| text.len() < 1 << 15).collect()
}

/// Play in every form of its width, and deviations.
const FAULTS: &str = "Faults(\n    units: (length: um, angle: urad),\n    deviations: [(frame: \"a\", v: (1, -2, 3), w: (0, 10, 0)), (frame: \"x\", v: (5, 0, 0))],\n    backlash: [\n        (joint: \"x\", width: 3),\n        (joint: \"y\", by_position: Points([(0, 1), (100, 4)])),\n        (joint: \"a\", by_position: Harmonics(mean: 5, cos: [2])),\n        (joint: \"c\", by_position: Polynomial([1, 0.01])),\n    ],\n)\n";

const PROGRAM: &str = "G90 G21 G54\nG0 X0. Y0. Z50. A20. C10.\nT1 M6\nG43.4 H1\nG1 X10. Y-5. A22. F500\nG2 X20. I5. J0.\nC30.\nG49\nM30\n";

impl Input {
    pub fn new(kind: Kind) -> Input {
        let machine =
            Machine::open(folder("machines/ac_table_tilting.ron")).unwrap_or_else(|e| panic!("{e}"));
        let deviations = random_deviations(&machine, 1.0, 42);
        let actual = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
        let recorded = |sensor: Sensor| {
            let commands = random_commands(&machine, 40, 5);
            recording(&actual, &Instrument::new(sensor, 1e-6, 1e-6), &commands, &[], 6).into_bytes()
        };
        let recording = Recording::from_bytes("rec.csv", recorded(Sensor::Position), &machine)
            .unwrap_or_else(|e| panic!("{e}"));
        let facts =
            RecordingFacts::of(&machine, std::slice::from_ref(&recording)).unwrap_or_else(|e| panic!("{e}"));
        let setup =
            Setup::parse("setup.ron", "Setup(tools: {\"1\": 50}, work_offsets: {\"G54\": {\"X\": 3}})")
                .unwrap_or_else(|e| panic!("{e}"));
        let texts = match kind {
            Kind::Machine => texts("machines", &["ron"]),
            Kind::Calibrated => {
                let mut all =
                    vec![actual.to_ron().into_bytes(), with_effects(&machine, &facts).to_ron().into_bytes()];
                all.extend(
                    texts("tests/bad/machines", &["ron"])
                        .into_iter()
                        .filter(|text| holds(text, b"calibration")),
                );
                all
            }
            Kind::Effects => {
                let library =
                    std::fs::read_to_string(folder("src/effects/library.ron")).expect("part of the project");
                let mut all = texts("tests/effects", &["ron"]);
                all.extend(texts("tests/bad/effects", &["ron"]));
                all.push(library.into_bytes());
                all
            }
            Kind::Recording => {
                let distance = Sensor::Distance { absolute: false };
                let mut all: Vec<Vec<u8>> = [Sensor::Position, Sensor::Pose, distance].map(recorded).to_vec();
                all.extend(texts("tests/bad/recordings", &["csv"]));
                all
            }
            Kind::Setup => {
                let page =
                    std::fs::read_to_string(folder("docs/compensate.md")).expect("part of the project");
                let blocks = page.split("```ron\n").skip(1).filter_map(|rest| rest.split("```").next());
                blocks
                    .filter(|block| block.contains("Setup("))
                    .map(|block| block.as_bytes().to_vec())
                    .collect()
            }
            Kind::Faults => {
                let mut all = texts("tests/bad/faults", &["ron"]);
                all.push(FAULTS.into());
                all
            }
            Kind::Program(dialect) => {
                let (ending, own) = match dialect {
                    Dialect::Rs274 => ("nc", "tests/nc/rs274"),
                    Dialect::Siemens => ("mpf", "tests/nc/siemens"),
                    Dialect::Heidenhain => ("h", "tests/nc/heidenhain"),
                    other => unreachable!("{other:?} is not among the kinds"),
                };
                let folders = ["tests/mutated/seeds", "tests/bad/programs", own];
                folders.iter().flat_map(|folder| texts(folder, &[ending])).collect()
            }
        };
        let mut input = Input {
            kind,
            texts: Vec::new(),
            sound: 0,
            machine,
            actual,
            recording,
            facts,
            setup,
            split: None,
        };
        let (sound, bad): (Vec<_>, Vec<_>) =
            texts.into_iter().partition(|text| matches!(input.used(text, 1), Fate::Accepted));
        assert!(!sound.is_empty(), "{} has nothing sound to be damaged", kind.name());
        input.sound = sound.len();
        input.texts = [sound, bad].concat();
        input
    }

    /// With straight moves of programs subdivided where their middle would be off by more than 10 um.
    pub fn subdividing(self) -> Input {
        Input { split: Some(1e-5), ..self }
    }

    pub fn name(&self) -> &'static str {
        self.kind.name()
    }

    pub fn words(&self) -> &'static [&'static str] {
        words(self.kind)
    }

    /// A text to be damaged, mostly a sound one, and any other to take from.
    pub fn drawn(&self, random: &mut StdRng) -> (Vec<u8>, Vec<u8>) {
        let among = if random.random_range(0..4) > 0 { self.sound } else { self.texts.len() };
        let mut one = |among: usize| self.texts[random.random_range(0..among)].clone();
        (one(among), one(self.texts.len()))
    }

    /// Reads a text and does with it what the program does.
    pub fn used(&self, bytes: &[u8], number: u64) -> Fate {
        let seldom = number.is_multiple_of(self.kind.seldom());
        let fate = match self.kind {
            Kind::Recording => self.recording(bytes, seldom),
            Kind::Program(dialect) => self.program(bytes, dialect),
            // Other texts are UTF-8, or refused as such before they are read.
            _ => self.ron(&String::from_utf8_lossy(bytes), seldom),
        };
        fate.unwrap_or_else(|broken| broken)
    }

    fn ron(&self, text: &str, seldom: bool) -> Result<Fate, Fate> {
        match self.kind {
            Kind::Machine => {
                let Some(machine) = refused(Machine::parse("any.ron", text))? else {
                    return Ok(Fate::Refused);
                };
                let again = refused(Machine::parse("again.ron", &machine.to_ron()))?;
                holds_that(
                    again.is_some_and(|again| again == machine),
                    "is not read back as it was written",
                )?;
                if seldom {
                    describe(&machine);
                }
            }
            Kind::Calibrated => {
                let Some(read) = refused(CalibratedMachine::parse("any.ron", text))? else {
                    return Ok(Fate::Refused);
                };
                let again = refused(CalibratedMachine::parse("again.ron", &read.to_ron()))?;
                holds_that(again.is_some_and(|again| again == read), "is not read back as it was written")?;
                self.corrected(&read, PROGRAM.as_bytes(), &self.setup, Dialect::Rs274)?;
                if read.machine().commands() == self.machine.commands() {
                    refused(predict(&read, &self.recording, Some(&mut std::io::sink())))?;
                }
            }
            Kind::Effects => {
                let Some(library) = refused(Library::standard().with_text("any.ron", text))? else {
                    return Ok(Fate::Refused);
                };
                if seldom {
                    library.candidates(&self.machine, &self.facts);
                }
            }
            Kind::Setup => {
                let Some(setup) = refused(Setup::parse("any.ron", text))? else { return Ok(Fate::Refused) };
                self.corrected(&self.actual, PROGRAM.as_bytes(), &setup, Dialect::Rs274)?;
            }
            Kind::Faults | Kind::Recording | Kind::Program(_) => {
                let Some(faults) = refused(Faults::parse("any.ron", text, &self.machine))? else {
                    return Ok(Fate::Refused);
                };
                // That it comes to an end.
                let _ = Plant::new(&self.actual).with_faults(&faults);
            }
        }
        Ok(Fate::Accepted)
    }

    fn recording(&self, bytes: &[u8], seldom: bool) -> Result<Fate, Fate> {
        let Some(read) = refused(Recording::from_bytes("any.csv", bytes, &self.machine))? else {
            return Ok(Fate::Refused);
        };
        let Some(summary) = refused(read.scan())? else { return Ok(Fate::Refused) };
        let mut rows = 0;
        for block in read.rows_with_text().map_err(|e| broken(&e.to_string()))? {
            let Some(block) = refused(block)? else { return Ok(Fate::Refused) };
            rows += block.rows().count() as u64;
        }
        holds_that(rows == summary.rows, "has another number of rows when it is read again")?;
        refused(predict(&self.actual, &read, Some(&mut std::io::sink())))?;
        if seldom {
            refused(calibrate(&self.machine, &[read], CalibrateOptions::default()))?;
        }
        Ok(Fate::Accepted)
    }

    fn program(&self, bytes: &[u8], dialect: Dialect) -> Result<Fate, Fate> {
        let mut program = Program::with_dialect("any.nc", bytes, dialect);
        let mut state = State::new(dialect, self.machine.commands().iter().map(|name| name.to_uppercase()));
        let mut written = Vec::with_capacity(bytes.len());
        while let Some(block) = refused(program.next_block())?.flatten() {
            block.write_to(&mut written).map_err(|e| broken(&e.to_string()))?;
            refused(state.apply(&block))?;
        }
        // A line that cannot be read ends the program.
        holds_that(bytes.starts_with(&written), "is not written back byte for byte")?;
        self.corrected(&self.actual, bytes, &self.setup, dialect)
    }

    /// Corrects a program; what comes of it can be read again.
    fn corrected(
        &self,
        machine: &CalibratedMachine,
        program: &[u8],
        setup: &Setup,
        dialect: Dialect,
    ) -> Result<Fate, Fate> {
        let mut options = CompensateOptions::default().with_arcs(1e-5).with_dialect(dialect);
        options.split = self.split;
        let done = refused(compensate_text(machine, "any.nc", program, setup, &options))?;
        let Some((text, _)) = done else { return Ok(Fate::Refused) };
        let count = |text: &[u8], word: &[u8]| {
            text.windows(word.len()).filter(|bytes| bytes.eq_ignore_ascii_case(word)).count()
        };
        for word in [&b"NaN"[..], b"inf"] {
            holds_that(count(text.as_bytes(), word) <= count(program, word), "writes a number that is none")?;
        }
        let mut again = Program::with_dialect("again.nc", text.as_bytes(), dialect);
        while again.next_block().map_err(|e| broken(&format!("writes what cannot be read: {e}")))?.is_some() {
        }
        Ok(Fate::Accepted)
    }
}

/// A calibrated machine with one effect of each family that has a place on it.
fn with_effects(machine: &Machine, facts: &RecordingFacts) -> CalibratedMachine {
    let library = Library::standard();
    let mut effects = Vec::new();
    let candidates = library.candidates(machine, facts);
    for candidate in candidates.all.iter().filter(|candidate| !candidate.coefficients.is_empty()) {
        if effects.len() >= 12 || effects.iter().any(|(family, _)| *family == candidate.family) {
            continue;
        }
        let found = Identified {
            family: &library.families()[candidate.family],
            candidate,
            coefficients: (0..candidate.coefficients.len()).map(|i| 3e-5 / (1.7 + i as f64)).collect(),
            parameters: candidate.grid[candidate.grid.len() / 2].clone(),
            covariance: None,
        };
        effects.push((candidate.family, found.stored(machine, &[])));
    }
    let stored = effects.into_iter().map(|(_, stored)| stored).collect();
    let dead_bands = vec![1e-9; machine.commands().len()];
    CalibratedMachine::nominal(machine.clone())
        .with_effects(stored, dead_bands)
        .unwrap_or_else(|e| panic!("{e}"))
}

/// What was read; nothing where it was refused as it should be.
fn refused<T>(outcome: Result<T, Error>) -> Result<Option<T>, Fate> {
    match outcome {
        Ok(read) => Ok(Some(read)),
        Err(error) if error.to_string().is_empty() => Err(broken("is refused without a message")),
        Err(error) if error.mend().is_empty() => Err(broken(&format!("is refused without a mend: {error}"))),
        Err(_) => Ok(None),
    }
}

fn holds_that(holds: bool, otherwise: &str) -> Result<(), Fate> {
    if holds { Ok(()) } else { Err(broken(otherwise)) }
}

fn broken(says: &str) -> Fate {
    Fate::Broken(Flaw::Other(says.into()))
}

fn holds(text: &[u8], word: &[u8]) -> bool {
    text.windows(word.len()).any(|bytes| bytes == word)
}
