//! From pieces to chunks: one pass over the data, piece by piece on all cores, bounded memory, SI.

use std::sync::Arc;

use rayon::prelude::*;

use super::Recording;
use super::chunk::Chunk;
use super::kept::{Kept, Stored};
use super::pieces::Pieces;
use super::rows::{Parsed, Reader, RowAt};
use super::text::Fail;
use crate::error::{Error, Result};

/// Samples of one pass, in chunks; see [`Recording::chunks`].
pub struct Chunks<'a>(Origin<'a>);

enum Origin<'a> {
    Kept { stored: &'a Stored, next: usize },
    File { reading: Box<Reading<'a>>, ready: std::vec::IntoIter<Chunk> },
}

impl<'a> Chunks<'a> {
    pub(super) fn kept(kept: &'a Kept) -> Self {
        let stored: &'a Stored = &kept.stored;
        Chunks(Origin::Kept { stored, next: 0 })
    }

    pub(super) fn of(reading: Reading<'a>) -> Self {
        Chunks(Origin::File { reading: Box::new(reading), ready: Vec::new().into_iter() })
    }

    /// The next chunk; what is in memory is not copied.
    pub(super) fn shared(&mut self) -> Option<Result<Arc<Chunk>>> {
        match &mut self.0 {
            Origin::Kept { stored, next } => {
                let i = std::mem::replace(next, *next + 1);
                (i < stored.len()).then(|| stored.chunk(i))
            }
            Origin::File { reading, ready } => loop {
                if let Some(chunk) = ready.next() {
                    return Some(Ok(Arc::new(chunk)));
                }
                match reading.next()? {
                    Ok(parsed) => *ready = parsed.chunks.into_iter(),
                    Err(error) => return Some(Err(error)),
                }
            },
        }
    }
}

impl Iterator for Chunks<'_> {
    type Item = Result<Chunk>;

    fn next(&mut self) -> Option<Self::Item> {
        Some(self.shared()?.map(Arc::unwrap_or_clone))
    }
}

/// Rows of one pass with their text, in blocks; see [`Recording::rows_with_text`].
pub struct Rows<'a> {
    reading: Reading<'a>,
    ready: std::vec::IntoIter<Block>,
}

impl<'a> Rows<'a> {
    pub(super) fn of(reading: Reading<'a>) -> Self {
        Rows { reading, ready: Vec::new().into_iter() }
    }
}

/// At most 4096 rows as written, and the samples that are in them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    /// The samples; its `len` is smaller than the number of rows where there are drop-outs, and may be 0.
    pub chunk: Chunk,
    text: Arc<String>,
    rows: Vec<RowAt>,
}

/// A row as written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row<'a> {
    /// Line in the file, from 1.
    pub line: u64,
    /// The row without its line end.
    pub text: &'a str,
    /// Index of its sample in [`Block::chunk`]; `None` for a drop-out.
    pub sample: Option<usize>,
}

impl Block {
    /// The rows in the order of the file; comments and blank lines between them are left out.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(|row| {
            let text = self.text.get(row.text.clone()).unwrap_or_default();
            Row { line: row.line, text, sample: row.sample }
        })
    }
}

impl Iterator for Rows<'_> {
    type Item = Result<Block>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(block) = self.ready.next() {
                return Some(Ok(block));
            }
            match self.reading.next()? {
                Ok(Parsed { chunks, rows, text, .. }) => {
                    let text = Arc::new(text);
                    let blocks = chunks.into_iter().zip(rows);
                    let blocks: Vec<Block> =
                        blocks.map(|(chunk, rows)| Block { chunk, text: text.clone(), rows }).collect();
                    self.ready = blocks.into_iter();
                }
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

/// One pass over the rows of a recording, piece by piece in the order of the file.
pub(super) struct Reading<'a> {
    reader: Reader<'a>,
    pieces: Pieces,
    /// Pieces that are read and not yet parsed.
    ahead: Vec<Vec<u8>>,
    begun: bool,
    /// Why no further piece comes, where that is a fault.
    stopped: Option<Error>,
    ready: std::vec::IntoIter<Result<Parsed>>,
    /// Lines before the next piece.
    lines: u64,
    previous_time: Option<f64>,
}

impl<'a> Reading<'a> {
    pub fn start(recording: &'a Recording, with_text: bool) -> Result<Self> {
        let (lines, offset) = recording.data_from;
        let (meter, alone) = &recording.meter;
        if *alone {
            meter.begin(recording.bytes());
        }
        Ok(Reading {
            reader: Reader::new(recording, with_text),
            pieces: Pieces::new(Box::new(
                meter.counting(recording.source.read_from(&recording.path, offset)?),
            )),
            ahead: Vec::new(),
            begun: false,
            stopped: None,
            ready: Vec::new().into_iter(),
            lines,
            previous_time: None,
        })
    }

    /// The next pieces, parsed on all cores while those behind them are read; empty at the end. Behind an error nothing comes.
    pub fn batch(&mut self) -> Vec<Result<Parsed>> {
        let recording = self.reader.recording;
        let Reading { reader, pieces, .. } = self;
        let mut read = |most: usize| {
            let mut read = Vec::new();
            while read.len() < most {
                match pieces.next() {
                    Ok(Some(piece)) => read.push(piece),
                    Ok(None) => break,
                    Err(error) => return (read, Some(Error::file(&recording.path, error))),
                }
            }
            (read, None)
        };
        if !std::mem::replace(&mut self.begun, true) {
            // Of many recordings one piece is all there is, or all that is asked for.
            (self.ahead, self.stopped) = read(1);
        }
        let present = std::mem::take(&mut self.ahead);
        if present.is_empty() {
            return self.stopped.take().map(Err).into_iter().collect();
        }
        let is_over = self.stopped.is_some();
        let parse = || present.into_par_iter().map(|piece| reader.parse(piece)).collect::<Vec<_>>();
        let further = || if is_over { (Vec::new(), None) } else { read(2 * rayon::current_num_threads()) };
        let (parsed, (ahead, stopped)) = rayon::join(parse, further);
        self.ahead = ahead;
        self.stopped = self.stopped.take().or(stopped);
        let mut batch = Vec::with_capacity(parsed.len());
        for parsed in parsed {
            batch.push(self.in_place(parsed).map_err(|fail| recording.error(fail)));
            if matches!(batch.last(), Some(Err(_))) {
                (self.ahead, self.stopped) = (Vec::new(), None);
                self.pieces.end();
                break;
            }
        }
        batch
    }

    /// What a piece holds, its lines counted from the beginning of the file; its first fault, or that of where it joins the one before.
    fn in_place(&mut self, mut parsed: Parsed) -> std::result::Result<Parsed, Fail> {
        let before = self.lines;
        if let (Some((line, t)), Some(from)) = (parsed.first_time, self.previous_time)
            && t <= from
        {
            return Err(self.reader.time_fault(before + line, from, t));
        }
        if let Some(Fail { line, column, fault }) = parsed.fault {
            return Err(Fail { line: before + line, column, fault });
        }
        self.lines += parsed.lines;
        self.previous_time = parsed.last_time.or(self.previous_time);
        parsed.move_lines(before);
        Ok(parsed)
    }
}

impl Iterator for Reading<'_> {
    type Item = Result<Parsed>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(parsed) = self.ready.next() {
            return Some(parsed);
        }
        self.ready = self.batch().into_iter();
        self.ready.next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::recording::Memory;
    use std::fmt::Write;

    const ROWS: usize = 60_000;

    fn rig() -> Machine {
        let text = r#"Machine(
            name: "rig", units: (length: mm, angle: deg),
            workpiece: [(frame: "c", joint: Revolute(axis: "z")), (frame: "w")],
            tool: [
                (frame: "x", joint: Prismatic(axis: "x")), (frame: "m", joint: Prismatic(axis: "x", follows: {"x": -1})),
                (frame: "t", at: (0, 0, 100)),
            ],
        )"#;
        Machine::parse("rig.ron", text).expect("a machine")
    }

    /// Some megabytes of rows, drop-outs, comments and blank lines; what `change` makes of the line of a row.
    fn text(change: impl Fn(usize, String) -> String) -> String {
        let mut text =
            "# measurement: position\nt[s],x[mm],c[deg],m[mm],px[mm],py[mm],pz[mm],u[V]\n".to_string();
        for i in 0..ROWS {
            let x = 0.1234567890123 * i as f64;
            let py = if i % 97 == 0 { String::new() } else { format!("{}", 1.0 / (1.0 + i as f64)) };
            let c = if i % 1001 == 0 { "\" 1e-3\"".into() } else { format!("{}", i % 360) };
            let row = format!("{},{x},{c},{},{x},{py},-0.1,1", 1e-3 * i as f64, 1e-5 - x);
            let _ = writeln!(text, "{}", change(i, row));
            if i % 5000 == 7 {
                text += "# a word between\n\n";
            }
        }
        text
    }

    fn recording(text: &str) -> Recording {
        Recording::from_bytes("rec.csv", text.as_bytes(), &rig()).unwrap_or_else(|e| panic!("{e}"))
    }

    fn with_threads<T: Send>(count: usize, work: impl FnOnce() -> T + Send) -> T {
        rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads").install(work)
    }

    fn chunks(recording: &Recording) -> Result<Vec<Chunk>> {
        recording.chunks()?.collect()
    }

    /// What is in chunks, whatever their bounds.
    fn joined(chunks: Vec<Chunk>) -> Chunk {
        let mut all = Chunk { directions: vec![None; 2], channels: vec![Vec::new()], ..Chunk::default() };
        for chunk in chunks {
            all.len += chunk.len;
            all.dropped += chunk.dropped;
            all.lines.extend(chunk.lines);
            all.commands.extend(chunk.commands);
            all.values.extend(chunk.values);
            all.time.get_or_insert_default().extend(chunk.time.unwrap_or_default());
            all.channels[0].extend(&chunk.channels[0]);
        }
        all
    }

    #[test]
    fn pieces_hold_what_the_whole_holds_whatever_the_number_of_threads() {
        let text = text(|_, row| row);
        let whole = recording(&text);
        let (lines, offset) = whole.data_from;
        let mut parsed = Reader::new(&whole, false).parse(text.as_bytes()[offset as usize..].to_vec());
        assert!(parsed.fault.is_none() && parsed.chunks.iter().all(|chunk| chunk.len <= 4096));
        parsed.move_lines(lines);
        let expected = joined(parsed.chunks);
        assert_eq!(expected.len as u64 + expected.dropped, ROWS as u64);
        let summary = whole.scan().expect("rows");
        for threads in [1, 2, 5] {
            let again = recording(&text);
            let (read, scanned) = with_threads(threads, || (chunks(&again), again.scan()));
            let read = read.expect("rows");
            assert!(read.len() > ROWS / 4096, "more than one piece");
            assert_eq!(read, chunks(&whole).expect("rows"), "{threads} threads");
            assert_eq!(scanned.expect("rows"), summary);
            assert_eq!(joined(read), expected);
        }
        let rows: Vec<String> = whole
            .rows_with_text()
            .expect("memory")
            .flat_map(|block| block.expect("rows").rows().map(|row| row.text.to_string()).collect::<Vec<_>>())
            .collect();
        let written: Vec<&str> =
            text.lines().skip(2).filter(|line| !line.is_empty() && !line.starts_with('#')).collect();
        assert_eq!(rows, written);
    }

    #[test]
    fn the_first_fault_is_told_whatever_piece_it_is_in() {
        for at in [3usize, 20_000, 40_001, ROWS - 1] {
            for (wrong, fault) in [("1,2", "row has 2 fields"), ("0,1,2,3,4,5,6,7", "time runs backwards")] {
                let text = text(|i, row| {
                    // A later one, of another kind.
                    if i == at {
                        wrong.into()
                    } else if i > at + 10 && i % 9 == 0 {
                        row + ",x"
                    } else {
                        row
                    }
                });
                let line = 1 + text.lines().position(|line| line == wrong).expect("it is there");
                for threads in [1, 3] {
                    let recording = recording(&text);
                    let error = with_threads(threads, || recording.scan()).expect_err(fault).to_string();
                    assert!(
                        error.starts_with(&format!("rec.csv:{line}:")) && error.contains(fault),
                        "{error}"
                    );
                    let rows = with_threads(threads, || {
                        recording
                            .rows_with_text()
                            .and_then(|mut rows| rows.try_for_each(|rows| rows.map(drop)))
                    });
                    assert_eq!(rows.expect_err(fault).to_string(), error);
                }
            }
        }
    }

    #[test]
    fn time_goes_forward_from_piece_to_piece() {
        // All times but the first of a piece are empty, and the row a drop-out: only where pieces join could it run backwards.
        let bounds = {
            let text = text(|_, row| row);
            let whole = recording(&text);
            let mut reading = Reading::start(&whole, false).expect("memory");
            let first = reading.next().expect("a piece").expect("rows");
            first.lines
        };
        let text =
            text(|i, row| if i > 0 { row.replacen(&row[..row.find(',').unwrap_or(0)], "", 1) } else { row });
        let mut lines: Vec<String> = text.lines().map(String::from).collect();
        let at = 2 * bounds as usize + 100;
        let (_, rest) = lines[at].split_once(',').expect("cells");
        lines[at] = format!("-1,{rest}");
        let error = recording(&lines.join("\n")).scan().expect_err("backwards");
        assert!(
            error.to_string().starts_with(&format!("rec.csv:{}:1: time runs backwards", at + 1)),
            "{error}"
        );
    }

    #[test]
    fn samples_in_a_file_of_numbers_are_those_in_memory() {
        let text = text(|_, row| row);
        let kept = recording(&text);
        for megabytes in [0, 1, 3] {
            let memory = Memory::of_megabytes(megabytes);
            let spooled = recording(&text).within(&memory);
            assert_eq!(spooled.scan().expect("rows"), kept.scan().expect("rows"));
            assert!(spooled.stored().is_some_and(|stored| !stored.is_in_memory()));
            assert_eq!(chunks(&spooled).expect("numbers"), chunks(&kept).expect("rows"));
            let (stored, whole) = (spooled.stored().expect("a pass"), kept.stored().expect("a pass"));
            for samples in [vec![], vec![0], vec![1, 7, 2000], (0..900).collect()] {
                for i in [0, 1, whole.len() - 2] {
                    let chosen = stored.chosen(i, &samples).expect("numbers");
                    assert_eq!(chosen, whole.chosen(i, &samples).expect("rows"));
                }
            }
            let few = recording("# measurement: joint\n# fixed c[deg]: 0\nx[mm],x_meas[mm]\n1,1\n2,2\n")
                .within(&memory);
            few.scan().expect("rows");
            assert_eq!(few.stored().is_some_and(|stored| stored.is_in_memory()), megabytes > 0);
        }
    }
}
