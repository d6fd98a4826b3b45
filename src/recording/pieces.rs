//! A source in pieces that end where lines end, so that each can be read apart from the others.

use std::io::{Read, Result};

use super::lines::LONGEST;

/// Bytes of a piece, but for what is added to its last line. Where pieces end depends on the text alone, and with it what is summed over
/// them.
const PIECE: usize = 1 << 20;

/// Cuts a source into pieces.
pub(super) struct Pieces {
    source: Box<dyn Read + Send>,
    /// The beginning of a line whose end has not been read.
    begun: Vec<u8>,
    ended: bool,
}

impl Pieces {
    pub fn new(source: Box<dyn Read + Send>) -> Self {
        Pieces { source, begun: Vec::new(), ended: false }
    }

    /// The next whole lines; the last one of the source need not have a line end. A line that is longer than any may be ends the pieces, cut
    /// short.
    pub fn next(&mut self) -> Result<Option<Vec<u8>>> {
        let mut piece = std::mem::take(&mut self.begun);
        while !self.ended {
            let from = piece.len();
            self.fill(&mut piece)?;
            let last = piece[from..].iter().rposition(|byte| *byte == b'\n');
            match last {
                _ if self.ended => {}
                Some(last) => {
                    self.begun = piece.split_off(from + last + 1);
                    return Ok(Some(piece));
                }
                None => self.ended = piece.len() > LONGEST,
            }
        }
        Ok((!piece.is_empty()).then_some(piece))
    }

    /// Nothing more comes.
    pub fn end(&mut self) {
        (self.ended, self.begun) = (true, Vec::new());
    }

    /// Reads on to the length of a piece, or as much again.
    fn fill(&mut self, piece: &mut Vec<u8>) -> Result<()> {
        let more = PIECE.max(2 * piece.len()) - piece.len();
        // With a byte to spare, or to ask for the end would take a longer buffer.
        piece.reserve(more + 1);
        let read = self.source.by_ref().take(more as u64).read_to_end(piece)?;
        self.ended = read < more;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn pieces(text: &str) -> Vec<String> {
        let mut pieces = Pieces::new(Box::new(Cursor::new(text.as_bytes().to_vec())));
        std::iter::from_fn(|| pieces.next().expect("memory"))
            .map(|piece| String::from_utf8(piece).expect("text"))
            .collect()
    }

    #[test]
    fn pieces_end_with_lines_and_make_up_the_source() {
        for line in [7, 1000, 99_991, LONGEST - 1] {
            let line = format!("{}\n", "x".repeat(line - 1));
            for end in ["", "rest"] {
                let text = line.repeat(5 * PIECE / line.len() + 1) + end;
                let cut = pieces(&text);
                assert_eq!(cut.concat(), text);
                assert!(cut[..cut.len() - 1].iter().all(|piece| piece.ends_with('\n')));
                assert!(cut.len() > 1 && cut.iter().all(|piece| piece.len() <= 2 * PIECE));
            }
        }
        assert!(pieces("").is_empty());
        assert_eq!(pieces("a\nb"), ["a\nb"]);
    }

    #[test]
    fn a_line_without_end_is_cut_short() {
        let cut = pieces(&"1".repeat(20 * PIECE));
        assert!(matches!(&cut[..], [only] if only.len() > LONGEST && only.len() < 4 * PIECE));
    }
}
