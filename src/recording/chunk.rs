//! Samples, column by column.

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

    /// Gives back the room that it does not need.
    pub(super) fn fit(&mut self) {
        self.lines.shrink_to_fit();
        let optional = self.time.iter_mut().chain(self.directions.iter_mut().flatten());
        let all = optional.chain(&mut self.channels).chain([&mut self.commands, &mut self.values]);
        all.for_each(Vec::shrink_to_fit);
    }

    /// These samples alone, by their index; the count of dropped rows is left behind.
    #[must_use]
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
