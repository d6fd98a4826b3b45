//! Partial normal equations: an identification whose recordings stay where they are. Each place sums its own samples at a stated state,
//! and what is merged takes the next step, until none is left; `docs/scale.md`.

use std::path::Path;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::noise::Noise;
use super::plausible::{Plausibility, plausibility_of};
use super::replay::{Answer, PartForm, Replay, Request, Spread};
use super::source::Sources;
use super::unknowns::{Layout, Unknowns};
use super::{CalibrateOptions, ErrorModel, Fit, identify, normal, thin, upright};
use crate::calibration::CalibratedMachine;
use crate::error::{Error, Place, Result};
use crate::machine::Machine;
use crate::recording::{Recording, Summary};
use crate::variation::{CONSTANT, Varying};
use crate::wording::count;

/// The first words of both kinds of files.
const PART: &str = "kincal partial normal equations 2";
const ROUND: &str = "kincal round 2";

/// What some recordings add to an identification: what they say of themselves, and the sums of their samples in every round so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "Part", deny_unknown_fields)]
pub struct PartialEquations {
    kind: String,
    /// As RON: another machine's sums are refused.
    machine: String,
    /// How many rounds it has been through, and recordings all parts have together; none before the first.
    rounds: usize,
    of: Option<usize>,
    recordings: Vec<Entry>,
}

/// What all recordings are asked for next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Round {
    kind: String,
    machine: String,
    recordings: Vec<Entry>,
    request: Request,
}

/// One recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Its place among all; as long as nobody has merged, among those of its part.
    number: usize,
    name: String,
    preamble: String,
    summary: Summary,
    /// Commands and readings of a few samples, m and rad: set-ups are found from them.
    thin: Spread,
    answers: Vec<Answer>,
}

/// What comes of merging.
#[derive(Debug)]
pub enum Merged {
    /// The machine, as one identification of all recordings gives it.
    Found(Box<(CalibratedMachine, Fit)>),
    /// Sums at another state are needed first.
    Another(Box<Round>),
}

impl PartialEquations {
    /// What recordings say of themselves, before the first round; after that, their sums at the state that the round asks for.
    ///
    /// # Errors
    /// If a recording cannot be read; with a round, if it is of another machine, or of other recordings.
    pub fn of(machine: &Machine, recordings: &[Recording], at: Option<&Round>) -> Result<PartialEquations> {
        let text = machine.to_ron();
        let Some(round) = at else {
            return Ok(PartialEquations {
                kind: PART.into(),
                machine: text,
                rounds: 0,
                of: None,
                recordings: entries(machine, recordings)?,
            });
        };
        if round.machine != text {
            return Err(refused(
                format!(
                    "the round is of another machine than \"{}\", or of another state of its file",
                    machine.name()
                ),
                "name the machine file that the first parts were made with, unchanged",
            ));
        }
        let mut own = round.recordings.clone();
        let mut all = stubs(machine, &round.recordings)?;
        let mut numbers = Vec::new();
        for recording in recordings {
            let summary = recording.scan()?;
            let is_it = |entry: &Entry| {
                (&entry.name, &entry.preamble, &entry.summary)
                    == (&recording.name().to_string(), &recording.preamble().to_string(), &summary)
            };
            let free = |entry: &&Entry| is_it(entry) && !numbers.contains(&entry.number);
            let Some(entry) = round.recordings.iter().find(free) else {
                return Err(refused(
                    format!("{} is none of the recordings of this round, or has changed", recording.name()),
                    "begin anew without `--at`: every recording has to be there from the first round on",
                ));
            };
            numbers.push(entry.number);
            all[entry.number] = recording.clone();
        }
        let summaries = round.recordings.iter().map(|entry| entry.summary.clone()).collect();
        let sources = Sources::of(&all, summaries, machine, &CONSTANT, &[]);
        let answers = answers(machine, &sources, &round.request)?;
        for (entry, answer) in own.iter_mut().zip(answers) {
            entry.answers.push(answer);
        }
        let rounds = own.first().map_or(0, |entry| entry.answers.len());
        let of = Some(own.len());
        own.retain(|entry| numbers.contains(&entry.number));
        Ok(PartialEquations { kind: PART.into(), machine: text, rounds, of, recordings: own })
    }

    /// Reads what [`PartialEquations::text`] has written.
    ///
    /// # Errors
    /// If the file cannot be read, or is none of these.
    pub fn open(path: impl AsRef<Path>) -> Result<PartialEquations> {
        read(
            path.as_ref(),
            PART,
            |part: &PartialEquations| &part.kind,
            "a part, as `kincal normal` writes it",
        )
    }

    /// As a file holds it.
    pub fn text(&self) -> String {
        written(self)
    }

    /// How many recordings it is of.
    pub fn recordings(&self) -> usize {
        self.recordings.len()
    }

    /// How many rounds of sums are in it.
    pub fn rounds(&self) -> usize {
        self.rounds
    }
}

impl Round {
    /// Reads what [`Round::text`] has written.
    ///
    /// # Errors
    /// If the file cannot be read, or is none of these: a calibrated machine needs no further round.
    pub fn open(path: impl AsRef<Path>) -> Result<Round> {
        read(
            path.as_ref(),
            ROUND,
            |round: &Round| &round.kind,
            "a round, as `kincal merge` writes it before the machine is found",
        )
    }

    /// As a file holds it.
    pub fn text(&self) -> String {
        written(self)
    }

    /// Which round it is, from 1.
    pub fn number(&self) -> usize {
        1 + self.recordings.first().map_or(0, |entry| entry.answers.len())
    }
}

/// Takes parts together: the machine, if they hold all that an identification asks of its samples, else the next round. Its steps are those of
/// [`calibrate`](super::calibrate()) with the same recordings in the same order, and so is what it finds; single samples it does not see, so
/// that [`Fit`] tells neither suspects nor outliers.
///
/// # Errors
/// As [`calibrate`](super::calibrate()); if parts are of several machines or rounds, or some are missing.
pub fn merge(parts: &[PartialEquations], options: CalibrateOptions) -> Result<Merged> {
    let Some(first) = parts.first() else {
        return Err(refused("no part is given".into(), "name the files that `kincal normal` has written"));
    };
    if !options.solver.uses_prior() {
        return Err(refused("parts are merged by the default solver alone".into(), "leave the solver out"));
    }
    if let Some(other) = parts.iter().position(|part| part.machine != first.machine) {
        return Err(refused(
            format!(
                "part {} is of another machine than the first, or of another state of its file",
                other + 1
            ),
            "merge parts that were made with one machine file",
        ));
    }
    if let Some(other) = parts.iter().find(|part| (part.rounds, part.of) != (first.rounds, first.of)) {
        return Err(refused(
            format!(
                "one part has been through {}, another through {}",
                rounds(first.rounds),
                rounds(other.rounds)
            ),
            "merge the parts of one round",
        ));
    }
    let mut entries: Vec<Entry> = parts.iter().flat_map(|part| part.recordings.iter().cloned()).collect();
    match first.of {
        None => entries.iter_mut().enumerate().for_each(|(number, entry)| entry.number = number),
        Some(all) => {
            entries.sort_by_key(|entry| entry.number);
            if let Some(pair) = entries.windows(2).find(|pair| pair[0].number == pair[1].number) {
                return Err(refused(format!("{} is in two parts", pair[0].name), "merge every part once"));
            }
            if entries.len() != all {
                return Err(refused(
                    format!("the parts hold {} of {all} recordings", entries.len()),
                    "add the parts that are missing; every recording takes part in every round",
                ));
            }
        }
    }
    let machine = Machine::parse("the machine of the parts", &first.machine)?;
    let recordings = stubs(&machine, &entries)?;
    let summaries: Vec<Summary> = entries.iter().map(|entry| entry.summary.clone()).collect();
    let replay = Arc::new(Replay::new(
        entries.iter().map(|entry| entry.thin.clone()).collect(),
        entries.iter().map(|entry| entry.answers.clone()).collect(),
    ));
    let model = ErrorModel::default();
    let found = upright(|frames| {
        let mut sources = Sources::of(&recordings, summaries.clone(), &machine, &model.varying, &[]);
        sources.replay = Some(replay.clone());
        identify(&machine, sources, &model, options, frames, &|_| {})
    });
    match (found, replay.wanted()) {
        (Ok(found), _) => Ok(Merged::Found(Box::new(found))),
        (Err(_), Some(request)) => {
            let (kind, machine) = (ROUND.into(), first.machine.clone());
            Ok(Merged::Another(Box::new(Round { kind, machine, recordings: entries, request })))
        }
        (Err(error), None) => Err(error),
    }
}

fn rounds(n: usize) -> String {
    count(n as u64, "round", "rounds")
}

/// What recordings say of themselves.
fn entries(machine: &Machine, recordings: &[Recording]) -> Result<Vec<Entry>> {
    let sources = Sources::new(recordings, machine, &CONSTANT, &[], &|_| {})?;
    let mut entries: Vec<Entry> = (recordings.iter().zip(&sources.all).enumerate())
        .map(|(number, (recording, source))| Entry {
            number,
            name: recording.name().into(),
            preamble: recording.preamble().into(),
            summary: source.summary.clone(),
            thin: Vec::new(),
            answers: Vec::new(),
        })
        .collect();
    for sample in thin::thin(machine, &sources)? {
        entries[sample.source].thin.push((sample.q, sample.values));
    }
    Ok(entries)
}

/// Recordings without rows, in their order.
fn stubs(machine: &Machine, entries: &[Entry]) -> Result<Vec<Recording>> {
    let commands = machine.commands().len();
    let stub = |(i, e): (usize, &Entry)| {
        let stub = Recording::from_bytes(&e.name, e.preamble.as_bytes(), machine)?;
        let sample =
            |(q, values): &(Vec<f64>, Vec<f64>)| (q.len(), values.len()) == (commands, stub.value_count());
        let counts = (e.summary.commands.len(), e.summary.moving.len()) == (commands, commands);
        match e.number == i && counts && e.thin.iter().all(sample) {
            true => Ok(stub),
            false => Err(refused(format!("what is kept of {} is not sound", e.name), "make the parts anew")),
        }
    };
    entries.iter().enumerate().map(stub).collect()
}

/// What the samples that are here answer, by recording.
fn answers(machine: &Machine, sources: &Sources, request: &Request) -> Result<Vec<Answer>> {
    let like = Unknowns::nominal(machine, sources, &Varying::default());
    let (Request::Sums { at, .. } | Request::Plausibility { at }) = request;
    let Some(unknowns) = like.at(at) else {
        return Err(refused("the round does not fit its own recordings".into(), "merge the parts once more"));
    };
    match request {
        Request::Sums { noise, loss, .. } if noise.len() == sources.all.len() => {
            let noise: Vec<Noise> = noise.iter().map(|[m, rad]| Noise { m: *m, rad: *rad }).collect();
            let layout = Layout::new(machine, sources, &CONSTANT, 1.0);
            let sums = normal::sums_at(machine, sources, &layout, &unknowns, &noise, *loss)?;
            Ok(sums.into_iter().map(|sum| Answer::Sums(sum.map(PartForm::from))).collect())
        }
        Request::Sums { .. } => {
            Err(refused("the round does not fit its own recordings".into(), "merge the parts once more"))
        }
        Request::Plausibility { .. } => {
            let all = plausibility_of(machine, sources, &unknowns)?;
            let size = |p: &Plausibility| (p.recording.clone(), p.of_angles, [p.left, p.foretold, p.moved]);
            let own = |number| all.iter().filter(|(of, _)| *of == number).map(|(_, p)| size(p)).collect();
            Ok((0..sources.all.len()).map(|number| Answer::Plausibility(own(number))).collect())
        }
    }
}

fn refused(what: String, mend: &str) -> Error {
    Error::Undetermined { what, mend: mend.into() }
}

fn written(value: &impl Serialize) -> String {
    // Neither maps nor foreign types are in it: nothing there can fail.
    ron::to_string(value).unwrap_or_default()
}

fn read<T: DeserializeOwned>(path: &Path, kind: &str, of: impl Fn(&T) -> &String, what: &str) -> Result<T> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
    let wrong = || {
        Error::mistake(
            Place::file(path),
            format!("this is not {what}"),
            "check which file goes where; files of another version of kincal have to be made anew",
        )
    };
    ron::from_str(&text).ok().filter(|value| of(value) == kind).ok_or_else(wrong)
}
