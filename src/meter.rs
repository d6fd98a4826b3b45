//! How much of a file a pass has read, for whoever shows it meanwhile. No clock is read here.

use std::io::{Read, Result};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Counts the bytes of one pass after another; shared by those who read and those who look.
#[derive(Clone, Debug, Default)]
pub(crate) struct Meter(Arc<Counts>);

#[derive(Debug, Default)]
struct Counts {
    passes: AtomicU64,
    read: AtomicU64,
    /// Bytes that the pass will read; 0 where that is not known.
    all: AtomicU64,
}

/// How far a pass is.
#[cfg(feature = "cli")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pass {
    /// From 1; 0 before the first.
    pub number: u64,
    pub read: u64,
    /// What it will have read, where that is known.
    pub all: Option<u64>,
}

impl Meter {
    /// A pass over so many bytes begins.
    pub fn begin(&self, all: Option<u64>) {
        self.0.read.store(0, Relaxed);
        self.0.all.store(all.unwrap_or(0), Relaxed);
        self.0.passes.fetch_add(1, Relaxed);
    }

    /// So many bytes are done of a pass that reads from no source.
    #[cfg(feature = "import")]
    pub fn count(&self, bytes: usize) {
        self.0.read.fetch_add(bytes as u64, Relaxed);
    }

    /// The same source; what is read from it is counted.
    pub fn counting<R: Read>(&self, source: R) -> Counted<R> {
        Counted { source, meter: self.clone() }
    }

    /// How far the pass is; what is read at the same time may be in it or not.
    #[cfg(feature = "cli")]
    pub fn pass(&self) -> Pass {
        let Counts { passes, read, all } = &*self.0;
        Pass {
            number: passes.load(Relaxed),
            read: read.load(Relaxed),
            all: Some(all.load(Relaxed)).filter(|all| *all > 0),
        }
    }
}

/// A source whose bytes are counted.
pub(crate) struct Counted<R> {
    source: R,
    meter: Meter,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        let read = self.source.read(bytes)?;
        self.meter.0.read.fetch_add(read as u64, Relaxed);
        Ok(read)
    }
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;

    #[test]
    fn a_pass_counts_what_it_reads_from_all_its_sources() {
        let meter = Meter::default();
        assert_eq!(meter.pass(), Pass { number: 0, read: 0, all: None });
        meter.begin(Some(8));
        let mut text = String::new();
        meter.counting(&b"hello"[..]).read_to_string(&mut text).expect("text");
        meter.clone().counting(&b"you"[..]).read_to_string(&mut text).expect("text");
        assert_eq!((text.as_str(), meter.pass()), ("helloyou", Pass { number: 1, read: 8, all: Some(8) }));
        meter.begin(None);
        assert_eq!(meter.pass(), Pass { number: 2, read: 0, all: None });
    }
}
