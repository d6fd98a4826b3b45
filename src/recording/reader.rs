//! From rows to chunks: one pass over the data, bounded memory, SI.

use std::sync::Arc;

use super::Recording;
use super::RecordingFault as Fault;
use super::column::{Column, Layout, Role};
use super::header::{Measurement, known_key};
use super::lines::{Line, Lines};
use super::text::{self, Fail, LARGEST, LARGEST_OTHER};
use crate::error::Result;

/// Most samples that a chunk holds.
pub(super) const CHUNK: usize = 4096;

/// Consecutive samples of a recording, drop-outs left out; m, rad, s, K.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chunk {
    /// How many samples there are, at most 4096; 0 only where nothing but drop-outs was left.
    pub len: usize,
    /// Line of each sample in the file, from 1.
    pub lines: Vec<u64>,
    /// Time of each sample, s, if the recording has a column `t`.
    pub time: Option<Vec<f64>>,
    /// Commanded displacements, m or rad: `len` rows of [`Machine::commands`](crate::Machine::commands).
    pub commands: Vec<f64>,
    /// Measured numbers, m or rad: `len` rows of [`Measurement::value_count`]; a pose is `px py pz rx ry rz`.
    pub values: Vec<f64>,
    /// Per command its direction of approach (-1, 0, +1) for each sample, if the recording has such a column.
    pub directions: Vec<Option<Vec<f64>>>,
    /// Per extra channel its value for each sample, SI; NaN where the cell is empty.
    pub channels: Vec<Vec<f64>>,
    /// Rows left out while this chunk was read.
    pub dropped: u64,
}

impl Chunk {
    /// Bytes that its numbers take up.
    pub(super) fn bytes(&self) -> usize {
        let optional = self.time.iter().chain(self.directions.iter().flatten()).map(Vec::len).sum::<usize>();
        let channels = self.channels.iter().map(Vec::len).sum::<usize>();
        8 * (self.lines.len() + self.commands.len() + self.values.len() + optional + channels)
    }

    /// These samples alone, by their index; the count of dropped rows is left behind.
    pub fn chosen(&self, samples: &[usize]) -> Chunk {
        let rows = |all: &[f64]| -> Vec<f64> {
            let width = all.len() / self.len.max(1);
            samples.iter().flat_map(|k| all[k * width..(k + 1) * width].iter().copied()).collect()
        };
        Chunk {
            len: samples.len(),
            lines: samples.iter().filter_map(|k| self.lines.get(*k).copied()).collect(),
            time: self.time.as_deref().map(rows),
            commands: rows(&self.commands),
            values: rows(&self.values),
            directions: self.directions.iter().map(|d| d.as_deref().map(rows)).collect(),
            channels: self.channels.iter().map(|c| rows(c)).collect(),
            dropped: 0,
        }
    }
}

/// Samples of one pass, in chunks; see [`Recording::chunks`].
pub struct Chunks<'a>(Origin<'a>);

enum Origin<'a> {
    Memory(std::slice::Iter<'a, Arc<Chunk>>),
    File(Box<Read<'a>>),
}

impl<'a> Chunks<'a> {
    pub(super) fn kept(chunks: &'a [Arc<Chunk>]) -> Self {
        Chunks(Origin::Memory(chunks.iter()))
    }
}

impl Iterator for Chunks<'_> {
    type Item = Result<Chunk>;

    fn next(&mut self) -> Option<Self::Item> {
        match &mut self.0 {
            Origin::Memory(chunks) => chunks.next().map(|chunk| Ok(Chunk::clone(chunk))),
            Origin::File(read) => read.next(),
        }
    }
}

/// Samples as they are read.
pub(super) struct Read<'a> {
    pub pass: Pass<'a>,
    ended: bool,
}

impl Iterator for Read<'_> {
    type Item = Result<Chunk>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let mut chunk = self.pass.empty();
        while chunk.len < CHUNK {
            match self.pass.row(&mut chunk) {
                Ok(Some(_)) => {}
                Ok(None) => {
                    self.ended = true;
                    return (chunk.len > 0 || chunk.dropped > 0).then_some(Ok(chunk));
                }
                Err(error) => {
                    self.ended = true;
                    return Some(Err(error));
                }
            }
        }
        Some(Ok(chunk))
    }
}

/// Rows of one pass with their text, in blocks; see [`Recording::rows_with_text`].
pub struct Rows<'a> {
    pass: Pass<'a>,
    ended: bool,
}

/// At most 4096 rows as written, and the samples that are in them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Block {
    /// The samples; its `len` is smaller than the number of rows where there are drop-outs, and may be 0.
    pub chunk: Chunk,
    text: String,
    rows: Vec<(u64, usize, Option<usize>)>,
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
        let mut from = 0;
        self.rows.iter().map(move |(line, to, sample)| {
            let text = &self.text[from..*to];
            from = *to;
            Row { line: *line, text, sample: *sample }
        })
    }
}

impl Iterator for Rows<'_> {
    type Item = Result<Block>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let mut block = Block { chunk: self.pass.empty(), text: String::new(), rows: Vec::new() };
        while block.rows.len() < CHUNK {
            let before = block.chunk.len;
            let row = self.pass.row(&mut block.chunk).and_then(|line| {
                let text = line.map(|line| self.pass.text(line)).transpose()?;
                Ok(text.map(|text| block.text.push_str(text)))
            });
            match row {
                Ok(Some(())) => {
                    let sample = (block.chunk.len > before).then_some(before);
                    block.rows.push((self.pass.lines.number, block.text.len(), sample));
                }
                Ok(None) => {
                    self.ended = true;
                    return (!block.rows.is_empty()).then_some(Ok(block));
                }
                Err(error) => {
                    self.ended = true;
                    return Some(Err(error));
                }
            }
        }
        Some(Ok(block))
    }
}

/// One pass over the rows of a recording.
pub(super) struct Pass<'a> {
    recording: &'a Recording,
    lines: Lines,
    /// The row at hand, SI, in the order of the columns.
    cells: Vec<f64>,
    limits: Vec<f64>,
    /// Columns without which a row is a drop-out.
    needed: Vec<usize>,
    previous_time: Option<f64>,
    /// Rows so far.
    pub rows: u64,
    /// Per column how many rows were dropped because of it.
    pub drops: Vec<u64>,
    /// Per follower the worst difference from its coupling (m or rad) and its line.
    pub worst: Vec<(f64, u64)>,
}

impl<'a> Pass<'a> {
    pub fn start(recording: &'a Recording) -> Result<Self> {
        let layout = &recording.layout;
        let other = |role| matches!(role, Role::Time | Role::Channel(_));
        let limits = layout.columns.iter().map(|c| if other(c.role) { LARGEST_OTHER } else { LARGEST });
        let idle = |c: &Column| match c.role {
            Role::Channel(_) => recording.machine.side_joint(&c.name).is_none(),
            role => matches!(role, Role::Follower(_)),
        };
        let width = layout.columns.len();
        Ok(Pass {
            recording,
            lines: recording.data_lines()?,
            cells: vec![0.0; width],
            limits: limits.collect(),
            needed: (0..width).filter(|i| !idle(&layout.columns[*i])).collect(),
            previous_time: None,
            rows: 0,
            drops: vec![0; width],
            worst: vec![(0.0, 0); layout.followers.len()],
        })
    }

    pub fn chunks(self) -> Chunks<'a> {
        Chunks(Origin::File(Box::new(self.read())))
    }

    pub fn read(self) -> Read<'a> {
        Read { pass: self, ended: false }
    }

    pub fn with_text(self) -> Rows<'a> {
        Rows { pass: self, ended: false }
    }

    fn empty(&self) -> Chunk {
        let layout = &self.recording.layout;
        Chunk {
            time: layout.time.map(|_| Vec::new()),
            directions: layout.directions.iter().map(|d| d.map(|_| Vec::new())).collect(),
            channels: vec![Vec::new(); layout.channels.len()],
            ..Chunk::default()
        }
    }

    fn text(&self, line: Line) -> Result<&str> {
        std::str::from_utf8(self.lines.bytes(line.content)).map_err(|_| self.fail(0, Fault::NotUtf8))
    }

    fn fail(&self, column: usize, fault: Fault) -> crate::error::Error {
        self.recording.error(Fail::at(self.lines.number, column, fault))
    }

    /// Reads the next row into the chunk, or counts it there as dropped; `None` at the end of the file.
    fn row(&mut self, chunk: &mut Chunk) -> Result<Option<Line>> {
        loop {
            let line = self.lines.next().map_err(|stop| self.recording.stopped(stop, self.lines.number))?;
            let Some(line) = line else { return Ok(None) };
            let content = self.lines.bytes(line.content.clone());
            match content.trim_ascii_start().first() {
                None => continue,
                Some(b'#') => {
                    let text = std::str::from_utf8(content).map_err(|_| self.fail(0, Fault::NotUtf8))?;
                    if let Some(key) = known_key(text) {
                        return Err(self.fail(0, Fault::LateKey { key: key.into() }));
                    }
                    continue;
                }
                Some(_) => {}
            }
            self.rows += 1;
            self.parse(&line)?;
            self.check_time()?;
            if let Some(column) = self.needed.iter().find(|i| self.cells[**i].is_nan()) {
                self.drops[*column] += 1;
                chunk.dropped += 1;
            } else {
                self.push(chunk, &line)?;
            }
            return Ok(Some(line));
        }
    }

    /// All cells of the row, in SI; NaN for an empty one.
    fn parse(&mut self, line: &Line) -> Result<()> {
        let columns = &self.recording.layout.columns;
        let (mut found, mut wrong) = (0, None);
        let content = self.lines.bytes(line.content.clone());
        text::split(content, |field| {
            if let Some(cell) = self.cells.get_mut(found) {
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
            return Err(self.fail(0, Fault::Ragged { found, expected: columns.len() }));
        }
        let Some(column) = wrong else { return Ok(()) };
        let field = self.field(line, column);
        let (what, text) = (self.what(column), text::shown(field));
        let fault = match text::number(field) {
            Some(_) => Fault::NotUsable { what, text },
            None if std::str::from_utf8(field).is_err() => Fault::NotUtf8,
            None => Fault::NotANumber { what, text },
        };
        Err(self.fail(column + 1, fault))
    }

    /// A field as written, for messages.
    fn field(&self, line: &Line, column: usize) -> &[u8] {
        let (mut n, mut found): (usize, &[u8]) = (0, b"");
        text::split(self.lines.bytes(line.content.clone()), |field| {
            if n == column {
                found = field;
            }
            n += 1;
        });
        found
    }

    fn what(&self, column: usize) -> String {
        format!("column `{}`", text::shown(self.recording.layout.columns[column].name.as_bytes()))
    }

    /// Time must go forward, over drop-outs too.
    fn check_time(&mut self) -> Result<()> {
        let Some(column) = self.recording.layout.time else { return Ok(()) };
        let t = self.cells[column];
        if t.is_nan() {
            return Ok(());
        }
        if let Some(from) = self.previous_time.filter(|from| t <= *from) {
            let fault =
                if t < from { Fault::TimeBackwards { from, to: t } } else { Fault::TimeRepeats { t } };
            return Err(self.fail(column + 1, fault));
        }
        self.previous_time = Some(t);
        Ok(())
    }

    fn push(&mut self, chunk: &mut Chunk, line: &Line) -> Result<()> {
        let Recording { layout, fixed, header, .. } = self.recording;
        let from = chunk.commands.len();
        for (column, fixed) in layout.commands.iter().zip(fixed) {
            chunk.commands.push(column.map_or(fixed.unwrap_or(0.0), |c| self.cells[c]));
        }
        self.push_values(layout, header.measurement, chunk)?;
        for (column, out) in layout.directions.iter().zip(&mut chunk.directions) {
            let (Some(column), Some(out)) = (column, out) else { continue };
            let direction = self.cells[*column];
            if direction != 0.0 && direction.abs() != 1.0 {
                let (what, text) = (self.what(*column), text::shown(self.field(line, *column)));
                return Err(self.fail(column + 1, Fault::BadDirection { what, text }));
            }
            out.push(direction);
        }
        for (i, column) in layout.columns.iter().enumerate() {
            if let Role::Channel(channel) = column.role {
                chunk.channels[channel].push(self.cells[i]);
            }
        }
        if let (Some(time), Some(column)) = (&mut chunk.time, layout.time) {
            time.push(self.cells[column]);
        }
        for ((column, drive), worst) in layout.followers.iter().zip(&mut self.worst) {
            let coupled: f64 = drive.terms.iter().map(|(c, factor)| factor * chunk.commands[from + c]).sum();
            let difference = (self.cells[*column] - coupled).abs();
            if difference > worst.0 {
                *worst = (difference, self.lines.number);
            }
        }
        chunk.lines.push(self.lines.number);
        chunk.len += 1;
        Ok(())
    }

    fn push_values(&self, layout: &Layout, measurement: Measurement, chunk: &mut Chunk) -> Result<()> {
        let cell = |k: usize| self.cells[layout.values[k]];
        if measurement != Measurement::Pose || layout.values.len() == 6 {
            chunk.values.extend(layout.values.iter().map(|c| self.cells[*c]));
            return Ok(());
        }
        let rotation = rotation_vector([cell(3), cell(4), cell(5), cell(6)])
            .map_err(|length| self.fail(layout.values[3] + 1, Fault::QuaternionLength { length }))?;
        chunk.values.extend([cell(0), cell(1), cell(2)]);
        chunk.values.extend(rotation);
        Ok(())
    }
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
