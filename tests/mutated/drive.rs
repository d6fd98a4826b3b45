//! Runs cases on all cores, catches what panics, and tells what does not end.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand::rngs::StdRng;

use super::input::Input;
use super::mutation::mutate;
use super::tally::{Fate, Finding, Flaw, Tally};

/// Cases `from..from + cases` of a seed.
#[derive(Clone, Copy)]
pub struct Task {
    pub from: u64,
    pub cases: u64,
    pub seed: u64,
    /// What lasts longer is over-long.
    pub limit: Duration,
}

/// Findings that are kept; more say nothing more.
const KEPT: usize = 50;
/// What runs so many times longer than the limit does not end.
const ENDLESS: u32 = 20;

thread_local! {
    /// What the last panic of this thread said, where it is one that runs cases.
    static SAID: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Panics of cases are kept in place of being printed; those of other threads are printed as ever.
fn keep_panics() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let as_ever = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let ours = SAID.with_borrow_mut(|said| match said {
                Some(said) => {
                    *said = info.to_string().replace('\n', " ");
                    true
                }
                None => false,
            });
            if !ours {
                as_ever(info);
            }
        }));
    });
}

/// The text of a case: the same for the same seed.
pub fn text_of(input: &Input, seed: u64, number: u64) -> Vec<u8> {
    // Neighbours far apart: the golden ratio of 2^64.
    let mut random = StdRng::seed_from_u64(seed.wrapping_add(number.wrapping_mul(0x9E37_79B9_7F4A_7C15)));
    let (mut text, donor) = input.drawn(&mut random);
    mutate(&mut random, &mut text, &donor, input.words());
    text
}

/// What becomes of a text.
fn fate(input: &Input, text: &[u8], number: u64) -> Fate {
    SAID.set(Some(String::new()));
    let fate = catch_unwind(AssertUnwindSafe(|| input.used(text, number)))
        .unwrap_or_else(|_| Fate::Broken(Flaw::Panic(SAID.take().unwrap_or_default())));
    SAID.set(None);
    fate
}

/// What all workers share.
struct Shared {
    input: Input,
    task: Task,
    next: AtomicU64,
    tally: Mutex<Tally>,
    findings: Mutex<Vec<Finding>>,
    /// By worker: the case that it is at, and since when.
    at: Vec<Mutex<Option<(u64, Instant)>>>,
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    fn work(&self, worker: usize) {
        let Task { from, cases, seed, limit } = self.task;
        let mut tally = Tally::default();
        loop {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            if number >= from + cases {
                break;
            }
            let text = text_of(&self.input, seed, number);
            let begun = Instant::now();
            *lock(&self.at[worker]) = Some((number, begun));
            let fate = fate(&self.input, &text, number);
            let lasted = begun.elapsed();
            *lock(&self.at[worker]) = None;
            if let Some(says) = tally.count(fate, lasted, lasted > limit) {
                self.keep(number, says, text);
            }
        }
        lock(&self.tally).add(&tally);
    }

    fn keep(&self, number: u64, says: String, text: Vec<u8>) {
        let mut findings = lock(&self.findings);
        if findings.len() < KEPT {
            findings.push(Finding { input: self.input.name(), number, says, text });
        }
    }

    /// A case that has been running for too long.
    fn endless(&self) -> Option<u64> {
        let over = |at: &Mutex<Option<(u64, Instant)>>| {
            let (number, since) = (*lock(at))?;
            (since.elapsed() > self.task.limit * ENDLESS).then_some(number)
        };
        self.at.iter().find_map(over)
    }
}

/// Runs the cases of one input. What does not end is told, and the rest of that input left undone.
pub fn run(input: Input, task: Task) -> (Tally, Vec<Finding>) {
    keep_panics();
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let shared = Arc::new(Shared {
        input,
        task,
        next: AtomicU64::new(task.from),
        tally: Mutex::default(),
        findings: Mutex::default(),
        at: (0..workers).map(|_| Mutex::default()).collect(),
    });
    let handles: Vec<_> = (0..workers)
        .map(|worker| {
            let shared = shared.clone();
            thread::spawn(move || shared.work(worker))
        })
        .collect();
    while handles.iter().any(|handle| !handle.is_finished()) {
        thread::sleep(Duration::from_millis(5));
        if let Some(number) = shared.endless() {
            let text = text_of(&shared.input, task.seed, number);
            shared.keep(number, "does not end".into(), text);
            lock(&shared.tally).over_long += 1;
            // The others stop at their next case; the one that does not end is left behind.
            shared.next.store(u64::MAX / 2, Ordering::Relaxed);
            thread::sleep(task.limit);
            break;
        }
    }
    let mut findings = std::mem::take(&mut *lock(&shared.findings));
    findings.sort_by_key(|finding| finding.number);
    (std::mem::take(&mut *lock(&shared.tally)), findings)
}
