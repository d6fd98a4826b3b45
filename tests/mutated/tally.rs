//! What became of mutated inputs.

use std::time::Duration;

/// What became of one case.
pub enum Fate {
    /// It was read, and used.
    Accepted,
    /// It was refused with a message and a mend.
    Refused,
    /// It broke a promise.
    Broken(Flaw),
}

/// Which promise.
pub enum Flaw {
    Panic(String),
    /// Refused without a message or a mend, not read back as it was written, a number that is none in an output.
    Other(String),
}

/// Something that is to be mended: the case and how to have it again.
pub struct Finding {
    pub input: &'static str,
    pub number: u64,
    pub says: String,
    pub text: Vec<u8>,
}

/// Counts of one kind of input.
#[derive(Default)]
pub struct Tally {
    pub cases: u64,
    pub accepted: u64,
    pub refused: u64,
    pub panics: u64,
    pub over_long: u64,
    pub other: u64,
    pub slowest: Duration,
}

impl Tally {
    /// Counts a case; what there is to say of it, where it broke a promise.
    pub fn count(&mut self, fate: Fate, lasted: Duration, over_long: bool) -> Option<String> {
        self.cases += 1;
        self.slowest = self.slowest.max(lasted);
        self.over_long += u64::from(over_long);
        let late = over_long.then(|| format!("lasts {:.1} s", lasted.as_secs_f64()));
        match fate {
            Fate::Accepted => self.accepted += 1,
            Fate::Refused => self.refused += 1,
            Fate::Broken(Flaw::Panic(says)) => {
                self.panics += 1;
                return Some(format!("panics: {says}"));
            }
            Fate::Broken(Flaw::Other(says)) => {
                self.other += 1;
                return Some(says);
            }
        }
        late
    }

    pub fn add(&mut self, other: &Tally) {
        self.cases += other.cases;
        self.accepted += other.accepted;
        self.refused += other.refused;
        self.panics += other.panics;
        self.over_long += other.over_long;
        self.other += other.other;
        self.slowest = self.slowest.max(other.slowest);
    }

    /// Cases that broke a promise.
    pub fn broken(&self) -> u64 {
        self.panics + self.over_long + self.other
    }
}
