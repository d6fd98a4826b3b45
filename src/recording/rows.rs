//! From text to samples: the rows of one piece of a recording, every cell checked, SI.

use std::ops::Range;

use super::Recording;
use super::RecordingFault as Fault;
use super::chunk::Chunk;
use super::column::{Column, Layout, Role};
use super::header::{Measurement, known_key};
use super::lines::LONGEST;
use super::text::{self, Fail, LARGEST, LARGEST_OTHER};
use crate::decimal;

/// Most samples that a chunk holds.
const CHUNK: usize = 4096;

/// How the rows of a recording are read.
pub(super) struct Reader<'a> {
    pub recording: &'a Recording,
    limits: Vec<f64>,
    /// Columns without which a row is a drop-out.
    needed: Vec<usize>,
    with_text: bool,
}

/// A row of a piece with its text.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RowAt {
    pub line: u64,
    /// Where in the piece.
    pub text: Range<usize>,
    pub sample: Option<usize>,
}

/// What a piece holds. Lines count from its beginning, the first is 1.
#[derive(Default)]
pub(super) struct Parsed {
    pub lines: u64,
    pub rows_read: u64,
    pub chunks: Vec<Chunk>,
    /// Where text is wanted, the piece and the rows of each chunk.
    pub text: String,
    pub rows: Vec<Vec<RowAt>>,
    /// Per column how many rows were dropped because of it.
    pub drops: Vec<u64>,
    /// Per follower the worst difference from its coupling (m or rad) and its line.
    pub worst: Vec<(f64, u64)>,
    /// The first time that a row states, with its line, and the last.
    pub first_time: Option<(u64, f64)>,
    pub last_time: Option<f64>,
    /// The first fault; nothing behind it is read.
    pub fault: Option<Fail>,
}

impl Parsed {
    /// Counts lines from so many before the piece.
    pub fn move_lines(&mut self, before: u64) {
        let chunks = self.chunks.iter_mut().flat_map(|chunk| &mut chunk.lines);
        let rows = self.rows.iter_mut().flatten().map(|row| &mut row.line);
        let worst = self.worst.iter_mut().map(|(_, line)| line);
        chunks.chain(rows).chain(worst).for_each(|line| *line += before);
    }
}

/// A piece while it is read.
struct Piece<'a> {
    text: &'a [u8],
    line: u64,
    /// The row at hand, SI, in the order of the columns.
    cells: Vec<f64>,
    chunk: Chunk,
    rows: Vec<RowAt>,
    parsed: Parsed,
}

impl<'a> Reader<'a> {
    pub fn new(recording: &'a Recording, with_text: bool) -> Self {
        let layout = &recording.layout;
        let other = |role| matches!(role, Role::Time | Role::Channel(_));
        let limits = layout.columns.iter().map(|c| if other(c.role) { LARGEST_OTHER } else { LARGEST });
        let idle = |c: &Column| match c.role {
            Role::Channel(_) => recording.machine.side_joint(&c.name).is_none(),
            role => matches!(role, Role::Follower(_)),
        };
        let needed = (0..layout.columns.len()).filter(|i| !idle(&layout.columns[*i])).collect();
        Reader { recording, limits: limits.collect(), needed, with_text }
    }

    /// Reads a piece to its end or its first fault.
    pub fn parse(&self, text: Vec<u8>) -> Parsed {
        let layout = &self.recording.layout;
        let mut piece = Piece {
            text: &text,
            line: 0,
            cells: vec![0.0; layout.columns.len()],
            chunk: self.empty(text.len()),
            rows: Vec::new(),
            parsed: Parsed {
                drops: vec![0; layout.columns.len()],
                worst: vec![(0.0, 0); layout.followers.len()],
                ..Parsed::default()
            },
        };
        let mut at = 0;
        while at < text.len() {
            match self.line(&mut piece, at) {
                Ok(next) => at = next,
                Err(fault) => {
                    piece.parsed.fault = Some(fault);
                    break;
                }
            }
        }
        if piece.chunk.len > 0 || piece.chunk.dropped > 0 {
            self.next_chunk(&mut piece, 0);
        }
        let Piece { mut parsed, line, .. } = piece;
        parsed.lines = line;
        if self.with_text && parsed.fault.is_none() {
            match String::from_utf8(text) {
                Ok(text) => parsed.text = text,
                // Every row and every comment has been looked at.
                Err(_) => parsed.fault = Some(Fail::at(line, 0, Fault::NotUtf8)),
            }
        }
        parsed
    }

    /// Room for a chunk, in so many bytes of text.
    fn empty(&self, bytes: usize) -> Chunk {
        let Recording { layout, fixed, header, .. } = self.recording;
        // A cell takes two bytes at least.
        let rows = CHUNK.min(bytes / (2 * layout.columns.len()) + 1);
        let room = |width: usize| Vec::with_capacity(width * rows);
        Chunk {
            lines: Vec::with_capacity(rows),
            time: layout.time.map(|_| room(1)),
            commands: room(fixed.len()),
            values: room(header.measurement.value_count()),
            directions: layout.directions.iter().map(|d| d.map(|_| room(1))).collect(),
            channels: layout.channels.iter().map(|_| room(1)).collect(),
            ..Chunk::default()
        }
    }

    /// Puts the chunk at hand away and begins the next, for so many bytes of text.
    fn next_chunk(&self, piece: &mut Piece, bytes: usize) {
        let mut chunk = std::mem::replace(&mut piece.chunk, self.empty(bytes));
        chunk.fit();
        piece.parsed.chunks.push(chunk);
        piece.parsed.rows.push(std::mem::take(&mut piece.rows));
    }

    /// Reads the line that begins at a byte; returns where the next one begins.
    fn line(&self, piece: &mut Piece, at: usize) -> Result<usize, Fail> {
        piece.line += 1;
        let (content, next) = match self.plain_row(piece, at) {
            Some(ends) => ends,
            None => {
                let end = piece.text[at..].iter().position(|b| *b == b'\n');
                let next = end.map_or(piece.text.len(), |end| at + end + 1);
                if next - at > LONGEST {
                    return Err(Fail::at(piece.line, 0, Fault::LineTooLong { limit: LONGEST }));
                }
                let line = &piece.text[at..next];
                let line = line.strip_suffix(b"\n").unwrap_or(line);
                let line = line.strip_suffix(b"\r").unwrap_or(line);
                if !self.any_row(piece, line)? {
                    return Ok(next);
                }
                (at + line.len(), next)
            }
        };
        piece.parsed.rows_read += 1;
        self.check_time(piece)?;
        let row = &piece.text[at..content];
        let sample = match self.needed.iter().find(|i| piece.cells[**i].is_nan()) {
            Some(column) => {
                piece.parsed.drops[*column] += 1;
                piece.chunk.dropped += 1;
                None
            }
            None => {
                self.push(piece, row)?;
                Some(piece.chunk.len - 1)
            }
        };
        let mut is_full = piece.chunk.len == CHUNK;
        if self.with_text {
            piece.rows.push(RowAt { line: piece.line, text: at..content, sample });
            is_full = piece.rows.len() == CHUNK;
        }
        if is_full {
            self.next_chunk(piece, piece.text.len() - next);
        }
        Ok(next)
    }

    /// The cells of a row of plain numbers, all of them usable; where it ends without and with its line end.
    #[inline]
    fn plain_row(&self, piece: &mut Piece, at: usize) -> Option<(usize, usize)> {
        let (columns, text) = (&self.recording.layout.columns, piece.text);
        let (mut at, last) = (at, columns.len() - 1);
        for (i, ((column, cell), limit)) in columns.iter().zip(&mut piece.cells).zip(&self.limits).enumerate()
        {
            let (value, end) = decimal::read(text, at)?;
            *cell = column.unit.to_si(value);
            if cell.abs() > *limit {
                return None;
            }
            at = end + 1;
            match text.get(end) {
                Some(b',') if i < last => {}
                Some(b'\n') if i == last => return Some((end, end + 1)),
                Some(b'\r') if i == last && text.get(end + 1) == Some(&b'\n') => return Some((end, end + 2)),
                None if i == last => return Some((end, end)),
                _ => return None,
            }
        }
        None
    }

    /// Reads whatever else a line may be; whether it is a row.
    #[cold]
    fn any_row(&self, piece: &mut Piece, line: &[u8]) -> Result<bool, Fail> {
        let not_utf8 = |_| Fail::at(piece.line, 0, Fault::NotUtf8);
        match line.trim_ascii_start().first() {
            None => return Ok(false),
            Some(b'#') => {
                return match known_key(std::str::from_utf8(line).map_err(not_utf8)?) {
                    Some(key) => Err(Fail::at(piece.line, 0, Fault::LateKey { key: key.into() })),
                    None => Ok(false),
                };
            }
            Some(_) => {}
        }
        self.cells(piece, line)?;
        if self.with_text {
            std::str::from_utf8(line).map_err(|_| Fail::at(piece.line, 0, Fault::NotUtf8))?;
        }
        Ok(true)
    }

    /// All cells of a row, in SI; NaN for an empty one.
    fn cells(&self, piece: &mut Piece, row: &[u8]) -> Result<(), Fail> {
        let columns = &self.recording.layout.columns;
        let (mut found, mut wrong) = (0, None);
        text::split(row, |field| {
            if let Some(cell) = piece.cells.get_mut(found) {
                match text::number(field) {
                    Some(value) => {
                        *cell = columns[found].unit.to_si(value);
                        // A NaN passes; an infinity does not.
                        if cell.abs() > self.limits[found] {
                            wrong.get_or_insert(found);
                        }
                    }
                    None => {
                        wrong.get_or_insert(found);
                    }
                }
            }
            found += 1;
        });
        if found != columns.len() {
            return Err(Fail::at(piece.line, 0, Fault::Ragged { found, expected: columns.len() }));
        }
        let Some(column) = wrong else { return Ok(()) };
        let field = field(row, column);
        let (what, text) = (self.what(column), text::shown(field));
        let fault = match text::number(field) {
            Some(_) => Fault::NotUsable { what, text },
            None if std::str::from_utf8(field).is_err() => Fault::NotUtf8,
            None => Fault::NotANumber { what, text },
        };
        Err(Fail::at(piece.line, column + 1, fault))
    }

    fn what(&self, column: usize) -> String {
        format!("column `{}`", text::shown(self.recording.layout.columns[column].name.as_bytes()))
    }

    /// Time must go forward, over drop-outs too.
    fn check_time(&self, piece: &mut Piece) -> Result<(), Fail> {
        let Some(column) = self.recording.layout.time else { return Ok(()) };
        let t = piece.cells[column];
        if t.is_nan() {
            return Ok(());
        }
        if let Some(from) = piece.parsed.last_time.filter(|from| t <= *from) {
            return Err(self.time_fault(piece.line, from, t));
        }
        piece.parsed.first_time.get_or_insert((piece.line, t));
        piece.parsed.last_time = Some(t);
        Ok(())
    }

    /// A time that is not behind the one before.
    pub fn time_fault(&self, line: u64, from: f64, to: f64) -> Fail {
        let fault = if to < from { Fault::TimeBackwards { from, to } } else { Fault::TimeRepeats { t: to } };
        Fail::at(line, self.recording.layout.time.map_or(0, |column| column + 1), fault)
    }

    fn push(&self, piece: &mut Piece, row: &[u8]) -> Result<(), Fail> {
        let Recording { layout, fixed, header, .. } = self.recording;
        let Piece { chunk, cells, parsed, line, .. } = piece;
        let from = chunk.commands.len();
        let commands = layout.commands.iter().zip(fixed);
        chunk
            .commands
            .extend(commands.map(|(column, fixed)| column.map_or(fixed.unwrap_or(0.0), |c| cells[c])));
        push_values(layout, header.measurement, cells, *line, chunk)?;
        for (column, out) in layout.directions.iter().zip(&mut chunk.directions) {
            let (Some(column), Some(out)) = (column, out) else { continue };
            let direction = cells[*column];
            if direction != 0.0 && direction.abs() != 1.0 {
                let (what, text) = (self.what(*column), text::shown(field(row, *column)));
                return Err(Fail::at(*line, column + 1, Fault::BadDirection { what, text }));
            }
            out.push(direction);
        }
        if !chunk.channels.is_empty() {
            for (column, cell) in layout.columns.iter().zip(cells.iter()) {
                if let Role::Channel(channel) = column.role {
                    chunk.channels[channel].push(*cell);
                }
            }
        }
        if let (Some(time), Some(column)) = (&mut chunk.time, layout.time) {
            time.push(cells[column]);
        }
        for ((column, drive), worst) in layout.followers.iter().zip(&mut parsed.worst) {
            let coupled: f64 = drive.terms.iter().map(|(c, factor)| factor * chunk.commands[from + c]).sum();
            let difference = (cells[*column] - coupled).abs();
            if difference > worst.0 {
                *worst = (difference, *line);
            }
        }
        chunk.lines.push(*line);
        chunk.len += 1;
        Ok(())
    }
}

/// A field as written, for messages.
fn field(row: &[u8], column: usize) -> &[u8] {
    let (mut n, mut found): (usize, &[u8]) = (0, b"");
    text::split(row, |field| {
        if n == column {
            found = field;
        }
        n += 1;
    });
    found
}

fn push_values(
    layout: &Layout,
    measurement: Measurement,
    cells: &[f64],
    line: u64,
    chunk: &mut Chunk,
) -> Result<(), Fail> {
    let cell = |k: usize| cells[layout.values[k]];
    if measurement != Measurement::Pose || layout.values.len() == 6 {
        chunk.values.extend(layout.values.iter().map(|c| cells[*c]));
        return Ok(());
    }
    let rotation = rotation_vector([cell(3), cell(4), cell(5), cell(6)])
        .map_err(|length| Fail::at(line, layout.values[3] + 1, Fault::QuaternionLength { length }))?;
    chunk.values.extend([cell(0), cell(1), cell(2)]);
    chunk.values.extend(rotation);
    Ok(())
}

/// Rotation vector (rad, angle in [0, pi]) of a quaternion, scalar part first; its length where that is off by more than 1e-3.
fn rotation_vector(q: [f64; 4]) -> std::result::Result<[f64; 3], f64> {
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    if (length - 1.0).abs() > 1e-3 {
        return Err(length);
    }
    let sign = if q[0] < 0.0 { -1.0 } else { 1.0 };
    let (w, u) = (sign * q[0], [sign * q[1], sign * q[2], sign * q[3]]);
    let sine = u.iter().map(|c| c * c).sum::<f64>().sqrt();
    // atan2 does not mind that the quaternion is not normalised.
    let factor = if sine < 1e-12 { 2.0 / w } else { 2.0 * sine.atan2(w) / sine };
    Ok(u.map(|c| c * factor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lie::{Pose, Twist};

    #[test]
    fn rotation_vector_of_a_quaternion_is_that_of_the_rotation() {
        for w in [[0.0, 0.0, 0.0], [1e-9, -2e-9, 0.0], [0.3, -0.2, 0.9], [0.0, 3.1, 0.0]] {
            let pose = Pose::exp(Twist::from_array([0.0, 0.0, 0.0, w[0], w[1], w[2]]));
            let q = nalgebra::Isometry3::from(pose).rotation.into_inner();
            for scale in [1.0, -1.0, 1.0005] {
                let q = [q.w, q.i, q.j, q.k].map(|c| c * scale);
                let back = rotation_vector(q).expect("a unit quaternion");
                for (a, b) in back.iter().zip(w) {
                    assert!((a - b).abs() < 1e-14, "{back:?} {w:?}");
                }
            }
        }
        assert!(rotation_vector([0.0; 4]).is_err());
        assert!(rotation_vector([1.0, 0.1, 0.0, 0.0]).is_err());
    }
}
