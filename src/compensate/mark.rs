//! The mark: a comment in which a compensated program says what it was written from, `docs/compensate.md`.

use std::io::Write;

use crate::calibration::CalibratedMachine;
use crate::nc::Dialect;

/// The FNV-1a hash of 64 bits, which takes what is written to it. It tells files apart that were mixed up, not ones that were forged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fingerprint(u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Fingerprint(0xcbf2_9ce4_8422_2325)
    }
}

impl std::fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl Fingerprint {
    pub fn of(text: &str) -> Self {
        let mut fingerprint = Fingerprint::default();
        fingerprint.take(text.as_bytes());
        fingerprint
    }

    pub fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

/// A machine and the model of its errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    machine: Fingerprint,
    model: Fingerprint,
}

impl Origin {
    /// Of what the machine file says, and of all that the calibration does; comments and layout do not count.
    pub fn of(calibrated: &CalibratedMachine) -> Self {
        let machine = Fingerprint::of(&calibrated.machine().to_ron());
        Origin { machine, model: Fingerprint::of(&calibrated.to_ron()) }
    }

    /// What a program of this origin was written for where `here` is at hand, as the end of a sentence.
    pub fn beside(self, here: Origin) -> &'static str {
        if self == here {
            "for this machine and with this model"
        } else if self.machine == here.machine {
            "for this machine and with another model"
        } else {
            "for another machine"
        }
    }
}

/// What a compensated program was written from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    /// The program as it was.
    pub program: Fingerprint,
    pub origin: Origin,
}

/// The word that a mark begins with. Upper case: not every control shows or takes other letters in a comment.
const NAME: &str = "KINCAL";

impl Mark {
    /// As a line of its own, without line end.
    pub fn line(&self, dialect: Dialect) -> String {
        let text = format!(
            "{NAME} {} PROGRAM {:016X} MACHINE {:016X} MODEL {:016X}",
            env!("CARGO_PKG_VERSION"),
            self.program.0,
            self.origin.machine.0,
            self.origin.model.0
        );
        match dialect {
            Dialect::Rs274 => format!("({text})"),
            Dialect::Siemens | Dialect::Heidenhain => format!("; {text}"),
        }
    }

    /// The mark that a line is, whatever version has written it.
    pub fn of_line(bytes: &[u8]) -> Option<Mark> {
        // A control may have put a line number before it.
        let text = std::str::from_utf8(bytes).ok().filter(|text| text.contains(NAME))?;
        let (_, text) = text.split_once(['(', ';'])?;
        let mut words = text.trim().trim_end_matches(')').split_whitespace();
        if words.next() != Some(NAME) {
            return None;
        }
        let words: Vec<&str> = words.skip(1).collect();
        let [a, program, b, machine, c, model] = words[..] else { return None };
        let hash = |word: &str| u64::from_str_radix(word, 16).ok().map(Fingerprint);
        let (program, machine, model) = (hash(program)?, hash(machine)?, hash(model)?);
        ([a, b, c] == ["PROGRAM", "MACHINE", "MODEL"])
            .then_some(Mark { program, origin: Origin { machine, model } })
    }
}

/// Where the mark of a program stands that has none yet: behind its blocks, so that every block keeps the number of its line.
#[derive(Clone, Debug, Default)]
pub(super) struct Foot {
    /// The line before which it stands: the end of the tape, `%`, or of the program, `END PGM`.
    before: Option<usize>,
    crlf: bool,
    /// Whether the last line has its line end.
    ends: bool,
}

impl Foot {
    /// Looks at a line of the program, in their order.
    pub fn look(&mut self, line: usize, bytes: &[u8]) {
        self.ends = bytes.ends_with(b"\n");
        self.crlf = bytes.ends_with(b"\r\n") || (self.crlf && !self.ends);
        let text = bytes.trim_ascii();
        // `25 END PGM NAME MM`
        let mut words = text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let ends_program = words.by_ref().take(2).any(|word| word.eq_ignore_ascii_case(b"END"))
            && words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"PGM"));
        if line > 1 && (text == b"%" || ends_program) {
            self.before = Some(line);
        } else if !text.is_empty() {
            self.before = None;
        }
    }

    /// Whether the mark comes before this line.
    pub fn is_before(&self, line: usize) -> bool {
        self.before == Some(line)
    }

    /// Whether the mark comes behind the last line.
    pub fn is_last(&self) -> bool {
        self.before.is_none()
    }

    /// Writes the mark there.
    pub fn write(&self, mark: &Mark, dialect: Dialect, out: &mut dyn Write) -> std::io::Result<()> {
        let (line, end) = (mark.line(dialect), if self.crlf { "\r\n" } else { "\n" });
        if self.is_last() && !self.ends { write!(out, "{end}{line}") } else { write!(out, "{line}{end}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test vectors of the authors of the hash.
    #[test]
    fn a_fingerprint_is_fnv_1a() {
        for (text, hash) in
            [("", 0xcbf2_9ce4_8422_2325), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            assert_eq!(Fingerprint::of(text), Fingerprint(hash));
        }
    }

    #[test]
    fn a_mark_is_read_as_it_is_written() {
        let origin = Origin { machine: Fingerprint::of("machine"), model: Fingerprint(7) };
        let mark = Mark { program: Fingerprint::of("program"), origin };
        for dialect in [Dialect::Rs274, Dialect::Siemens, Dialect::Heidenhain] {
            let line = mark.line(dialect);
            assert_eq!(Mark::of_line(line.as_bytes()), Some(mark));
            assert_eq!(Mark::of_line(format!("N120 {line}\r\n").as_bytes()), Some(mark));
        }
        for other in [
            "(KINCAL)",
            "(made for KINCAL 1 PROGRAM 1 MACHINE 2 MODEL 3)",
            "G1 X1",
            "; KINCAL 1 PROGRAM x MACHINE 2 MODEL 3",
        ] {
            assert_eq!(Mark::of_line(other.as_bytes()), None, "{other}");
        }
    }

    #[test]
    fn the_mark_stands_behind_the_last_block() {
        let placed = |program: &str| {
            let mut foot = Foot::default();
            let lines: Vec<&[u8]> = program.as_bytes().split_inclusive(|b| *b == b'\n').collect();
            (1..).zip(&lines).for_each(|(k, line)| foot.look(k, line));
            let mark = Mark {
                program: Fingerprint(1),
                origin: Origin { machine: Fingerprint(2), model: Fingerprint(3) },
            };
            let mut out = Vec::new();
            for (k, line) in (1..).zip(&lines) {
                if foot.is_before(k) {
                    foot.write(&mark, Dialect::Siemens, &mut out).expect("memory");
                }
                out.extend_from_slice(line);
            }
            if foot.is_last() {
                foot.write(&mark, Dialect::Siemens, &mut out).expect("memory");
            }
            String::from_utf8(out).expect("text").replace(&mark.line(Dialect::Siemens), "*")
        };
        assert_eq!(placed("%\nG1 X1\nM30\n%\n\n"), "%\nG1 X1\nM30\n*\n%\n\n");
        assert_eq!(placed("%\r\nG1 X1\r\nM30\r\n%"), "%\r\nG1 X1\r\nM30\r\n*\r\n%");
        assert_eq!(placed("0 BEGIN PGM A MM\n1 END PGM A MM\n"), "0 BEGIN PGM A MM\n*\n1 END PGM A MM\n");
        assert_eq!(placed("G1 X1\nM30"), "G1 X1\nM30\n*");
        assert_eq!(placed("%\nG1 X1\n"), "%\nG1 X1\n*\n");
        assert_eq!(placed("%"), "%\n*");
    }
}
