//! What a command is at, on standard error while that is a terminal: the stage and the time that has passed, and where it is known how much
//! of a file there is to read, how much of it is done, how fast, and how long the rest takes.

use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use super::Common;
use super::width::len;
use crate::meter::{Meter, Pass};
use crate::recording::Recording;

/// Between two looks.
const TICK: Duration = Duration::from_millis(120);
/// Before so many seconds a pass says neither how fast it is nor how long the rest takes.
const SOON: f64 = 0.5;
/// Characters of the bar.
const BAR: usize = 16;
/// What the sign that turns takes up before the line.
const SIGN: usize = 2;
/// Characters of a stage that say something of it.
const LEAST: usize = 10;
/// Of a terminal that does not say how wide it is.
const USUAL: usize = 80;

/// Gone when it is dropped.
pub(crate) struct Progress {
    bar: Option<ProgressBar>,
    stage: Arc<Mutex<String>>,
    meter: Meter,
}

/// What is behind a lock; a thread that has panicked leaves nothing half done there.
fn held<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Common {
    /// Nothing, if standard error is no terminal or nobody wants to read.
    pub(crate) fn progress(&self) -> Progress {
        let (meter, stage) = (Meter::default(), Arc::<Mutex<String>>::default());
        if self.quiet || !std::io::stderr().is_terminal() {
            return Progress { bar: None, stage, meter };
        }
        let begun = Arc::new(Mutex::new(Begun { number: 0, at: Instant::now(), from: 0, read: 0 }));
        let shown = {
            let (meter, stage) = (meter.clone(), stage.clone());
            move |state: &ProgressState, out: &mut dyn Write| {
                let pass = held(&begun).under_way(meter.pass());
                let size = console::Term::stderr().size_checked();
                let room = size.map_or(USUAL, |(_, columns)| usize::from(columns)).saturating_sub(SIGN + 1);
                let _ = out.write_str(&line(&held(&stage), state.elapsed().as_secs_f64(), pass, room));
            }
        };
        let bar = ProgressBar::new_spinner();
        if let Ok(style) = ProgressStyle::with_template("{spinner} {line}") {
            bar.set_style(style.with_key("line", shown));
        }
        bar.enable_steady_tick(TICK);
        Progress { bar: Some(bar), stage, meter }
    }
}

impl Progress {
    /// The stage that begins.
    pub fn say(&self, text: &str) {
        *held(&self.stage) = text.to_string();
    }

    /// What counts the bytes that are read.
    pub fn meter(&self) -> &Meter {
        &self.meter
    }

    /// The recordings, and a pass over all of them that begins; how long it is is known where all say how long they are.
    pub fn reading(&self, recordings: Vec<Recording>) -> Vec<Recording> {
        self.meter.begin(recordings.iter().map(Recording::bytes).sum());
        recordings.into_iter().map(|recording| recording.counted_by(&self.meter, false)).collect()
    }

    /// A recording each of whose passes is shown by itself.
    pub fn passing(&self, recording: Recording) -> Recording {
        recording.counted_by(&self.meter, true)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// The pass that was seen last, when it was first seen and how much of it had been read then, and how much at the last look.
struct Begun {
    number: u64,
    at: Instant,
    from: u64,
    read: u64,
}

/// A pass, and what has been read of it in so many seconds.
struct UnderWay {
    pass: Pass,
    lately: u64,
    seconds: f64,
}

impl Begun {
    /// The pass, if anything of it is being read: of one whose length is not known, if more has been read than at the last look.
    fn under_way(&mut self, pass: Pass) -> Option<UnderWay> {
        if pass.number != self.number || self.read == 0 {
            (self.number, self.at, self.from) = (pass.number, Instant::now(), pass.read);
        }
        let is_at_it = match pass.all {
            Some(all) => (1..all).contains(&pass.read),
            None => pass.read > self.read,
        };
        self.read = pass.read;
        let lately = pass.read.saturating_sub(self.from);
        is_at_it.then(|| UnderWay { pass, lately, seconds: self.at.elapsed().as_secs_f64() })
    }
}

/// The line of this moment in so many columns; the stage gives way.
fn line(stage: &str, elapsed: f64, under_way: Option<UnderWay>, room: usize) -> String {
    let Some(UnderWay { pass: Pass { number, read, all }, lately, seconds }) = under_way else {
        // Before the first stage there is nothing to say.
        return if stage.is_empty() { String::new() } else { beside(stage, &time(elapsed), room) };
    };
    let rate = (seconds > SOON && lately > 0).then(|| lately as f64 / seconds);
    let mut told = String::new();
    if number > 1 {
        let _ = write!(told, "pass {number}, ");
    }
    match all {
        Some(all) => {
            let part = read as f64 / all as f64;
            let done = (part * BAR as f64) as usize;
            let _ = write!(
                told,
                "[{}{}] {:.0} %",
                "=".repeat(done),
                " ".repeat(BAR - done),
                (100.0 * part).floor()
            );
            if let Some(rate) = rate {
                let _ =
                    write!(told, ", {}/s, {} left", bytes(rate), time(((all - read) as f64 / rate).ceil()));
            }
        }
        None => {
            let _ = write!(told, "{} read", bytes(read as f64));
            if let Some(rate) = rate {
                let _ = write!(told, ", {}/s", bytes(rate));
            }
            let _ = write!(told, ", {}", time(elapsed));
        }
    }
    beside(stage, &told, room)
}

/// A stage, cut where it is too long and left out where little of it would stay, and what there is to say of it.
fn beside(stage: &str, told: &str, room: usize) -> String {
    let left = room.saturating_sub(len(told) + 2);
    let cut: String = match len(stage) > left {
        true if left < LEAST => String::new(),
        true => stage.chars().take(left - 3).chain("...".chars()).collect(),
        false => stage.into(),
    };
    let all = if cut.is_empty() { told.to_string() } else { format!("{cut}  {told}") };
    all.chars().take(room).collect()
}

/// `7 s`, `2 min 5 s`, `1 h 4 min`.
fn time(seconds: f64) -> String {
    match seconds.max(0.0) as u64 {
        s if s < 60 => format!("{s} s"),
        s if s < 3600 => format!("{} min {} s", s / 60, s % 60),
        s => format!("{} h {} min", s / 3600, s / 60 % 60),
    }
}

/// `312 MB`, three digits or so.
fn bytes(count: f64) -> String {
    let (unit, per) = match count {
        c if c < 1e6 => ("kB", 1e3),
        c if c < 1e9 => ("MB", 1e6),
        _ => ("GB", 1e9),
    };
    let value = count / per;
    let digits = if value < 10.0 { 1 } else { 0 };
    format!("{value:.digits$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn under_way(number: u64, read: u64, all: Option<u64>, seconds: f64) -> Option<UnderWay> {
        Some(UnderWay { pass: Pass { number, read, all }, lately: read, seconds })
    }

    #[test]
    fn what_has_no_known_end_says_its_stage_and_its_time_only() {
        assert_eq!(line("step 3", 65.0, None, 80), "step 3  1 min 5 s");
        let told = line("reading a.parquet", 3.0, under_way(1, 4_000_000, None, 2.0), 80);
        assert_eq!(told, "reading a.parquet  4.0 MB read, 2.0 MB/s, 3 s");
    }

    #[test]
    fn a_pass_of_known_length_says_rate_and_time_left() {
        let told = line("reading a.csv", 3.0, under_way(1, 300_000_000, Some(1_200_000_000), 1.0), 80);
        assert_eq!(told, "reading a.csv  [====            ] 25 %, 300 MB/s, 3 s left");
        let told = line("correcting p.nc", 3.0, under_way(2, 999, Some(1000), 0.1), 80);
        assert_eq!(told, "correcting p.nc  pass 2, [=============== ] 99 %");
        let told = line("reading a.csv", 3.0, under_way(1, 900, Some(1000), 1.0), 80);
        assert!(told.ends_with(", 0.9 kB/s, 1 s left"), "{told}");
    }

    #[test]
    fn of_a_stage_enough_is_shown_or_nothing() {
        let pass = || under_way(1, 300, Some(1000), 0.1);
        assert_eq!(line("reading big.csv", 3.0, pass(), 35), "reading...  [====            ] 30 %");
        assert_eq!(line("reading big.csv", 3.0, pass(), 32), "[====            ] 30 %");
        assert_eq!(line("", 0.1, None, 80), "");
    }

    #[test]
    fn a_line_fits_any_terminal() {
        for room in 0..90 {
            for pass in [None, under_way(2, 7, Some(1000), 9.0), under_way(1, 7, None, 9.0)] {
                let told = line("reading a_recording_with_quite_a_long_name.csv", 7200.0, pass, room);
                assert!(len(&told) <= room, "{told:?} in {room}");
            }
        }
    }

    #[test]
    fn a_pass_is_under_way_from_its_first_byte_to_its_last() {
        let mut begun = Begun { number: 0, at: Instant::now(), from: 0, read: 0 };
        let mut is_shown = |number, read, all| begun.under_way(Pass { number, read, all }).is_some();
        assert!(
            !is_shown(0, 0, None)
                && !is_shown(1, 0, Some(9))
                && is_shown(1, 5, Some(9))
                && is_shown(1, 5, Some(9))
        );
        assert!(!is_shown(1, 9, Some(9)));
        // Of unknown length, while more comes.
        assert!(
            !is_shown(2, 0, None) && is_shown(2, 5, None) && is_shown(2, 9, None) && !is_shown(2, 9, None)
        );
    }
}
