//! What a path has done up to each sample: directions of travel, distance since the last reversal, and play.
//!
//! History is followed sample by sample in fixed memory ([`Tracker`]), across pauses and chunks, and comes out as columns
//! beside a chunk ([`Motion`]). A dwell keeps the last direction, the samples before the first motion take that motion's, and a
//! dead band keeps jitter from counting as a reversal.

mod rates;

pub(crate) use rates::{LOOK_AHEAD, Rates};

use crate::recording::Chunk;

/// Columns of history beside a [`Chunk`], `len` rows of one number a command.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Direction of travel or of approach: -1, +1; 0 only for a command that never moves.
    pub directions: Vec<i8>,
    /// Distance travelled since the last reversal (since the start before the first one), m or rad.
    pub since_reversal: Vec<f64>,
}

impl Motion {
    /// The rows of these samples.
    pub fn chosen(&self, commands: usize, samples: &[usize]) -> Motion {
        fn rows<T: Copy>(all: &[T], width: usize, samples: &[usize]) -> Vec<T> {
            if all.is_empty() {
                return Vec::new();
            }
            samples.iter().flat_map(|k| all[k * width..(k + 1) * width].iter().copied()).collect()
        }
        Motion {
            directions: rows(&self.directions, commands, samples),
            since_reversal: rows(&self.since_reversal, commands, samples),
        }
    }
}

/// Where one command stands in its history.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    /// 0 before the first motion.
    pub direction: i8,
    /// Furthest point in the present direction; the first position before the first motion.
    furthest: f64,
    /// Where the present direction began.
    pub turned_at: f64,
}

/// Follows the directions of travel of all commands.
#[derive(Clone, Debug)]
pub struct Tracker {
    /// Per command: motion against the direction that counts as a reversal only beyond this, m or rad.
    dead_bands: Vec<f64>,
    /// Per command: direction of its first motion; 0 if it never moves.
    first: Vec<i8>,
    axes: Vec<Option<Axis>>,
}

impl Tracker {
    /// Nothing seen yet. `first`: the direction of each command's first motion, from [`FirstDirections`]; it holds before
    /// that motion.
    ///
    /// # Panics
    /// If the two lists differ in length.
    pub fn new(dead_bands: Vec<f64>, first: Vec<i8>) -> Self {
        assert_eq!(dead_bands.len(), first.len(), "one dead band and one first direction per command");
        let axes = vec![None; first.len()];
        Tracker { dead_bands, first, axes }
    }

    /// Directions of travel after the last sample.
    pub fn directions(&self) -> Vec<i8> {
        let now = |(axis, first): (&Option<Axis>, &i8)| match axis {
            Some(axis) if axis.direction != 0 => axis.direction,
            _ => *first,
        };
        self.axes.iter().zip(&self.first).map(now).collect()
    }

    /// Forgets where command `c` stands, as when it has gone a way that is not known. What held before its first motion still does; later
    /// it has no direction until it moves again.
    pub fn lose(&mut self, c: usize) {
        if self.axes[c].is_some_and(|axis| axis.direction != 0) {
            self.first[c] = 0;
        }
        self.axes[c] = None;
    }

    /// Moves on to the commands `q` (m or rad). `stated`: directions of approach from `<joint>_direction` columns; 0 and
    /// `None` leave the direction to the motion.
    pub fn advance(&mut self, q: &[f64], stated: impl Fn(usize) -> Option<i8>) {
        for (c, (axis, q)) in self.axes.iter_mut().zip(q).enumerate() {
            let axis = axis.get_or_insert_with(|| Axis::at(*q));
            axis.advance(*q, stated(c), self.dead_bands[c]);
        }
    }

    /// Distance of command `c` from its last reversal, m or rad.
    pub fn since_reversal(&self, c: usize, q: f64) -> f64 {
        self.axes[c].map_or(0.0, |axis| (q - axis.turned_at).abs())
    }

    /// The columns beside a chunk; the history goes on.
    pub fn follow(&mut self, chunk: &Chunk) -> Motion {
        let commands = self.first.len();
        let mut motion = Motion {
            directions: Vec::with_capacity(chunk.len * commands),
            since_reversal: Vec::with_capacity(chunk.len * commands),
        };
        for (k, q) in chunk.commands.chunks_exact(commands).enumerate() {
            self.advance(q, |c| stated(chunk, c, k));
            motion.directions.extend(self.directions());
            motion.since_reversal.extend((0..commands).map(|c| self.since_reversal(c, q[c])));
        }
        motion
    }
}

impl Axis {
    /// Before the first motion.
    pub fn at(q: f64) -> Self {
        Axis { direction: 0, furthest: q, turned_at: q }
    }

    /// Moves on to `q`; `stated` is a direction of approach from a column, where there is one.
    pub fn advance(&mut self, q: f64, stated: Option<i8>, band: f64) {
        match stated {
            Some(direction) if direction != 0 => {
                if direction != self.direction {
                    *self = Axis { direction, furthest: q, turned_at: self.furthest };
                }
                self.furthest = q;
            }
            // With a column, what it leaves open is no motion.
            Some(_) => {}
            None => self.follow(q, band),
        }
    }

    fn follow(&mut self, q: f64, band: f64) {
        let gone = q - self.furthest;
        let sign = if gone > 0.0 { 1 } else { -1 };
        if gone.abs() > band && sign != self.direction {
            *self = Axis { direction: sign, furthest: q, turned_at: self.furthest };
        } else if sign == self.direction && gone != 0.0 {
            self.furthest = q;
        }
    }
}

/// Direction of approach that a recording states for a sample.
pub(crate) fn stated(chunk: &Chunk, command: usize, sample: usize) -> Option<i8> {
    let column = chunk.directions.get(command)?.as_ref()?;
    Some(if column[sample] == 0.0 { 0 } else { column[sample].signum() as i8 })
}

/// Finds the direction of every command's first motion, chunk by chunk.
#[derive(Clone, Debug)]
pub struct FirstDirections {
    tracker: Tracker,
}

impl FirstDirections {
    /// As for [`Tracker::new`].
    pub fn new(dead_bands: Vec<f64>) -> Self {
        let first = vec![0; dead_bands.len()];
        FirstDirections { tracker: Tracker::new(dead_bands, first) }
    }

    /// Looks at a chunk; whether every command has moved by now.
    pub fn look(&mut self, chunk: &Chunk) -> bool {
        let commands = self.tracker.first.len();
        for (k, q) in chunk.commands.chunks_exact(commands).enumerate() {
            self.tracker.advance(q, |c| stated(chunk, c, k));
            for (first, now) in self.tracker.first.iter_mut().zip(&self.tracker.axes) {
                if *first == 0 {
                    *first = now.map_or(0, |axis| axis.direction);
                }
            }
            if !self.tracker.first.contains(&0) {
                return true;
            }
        }
        false
    }

    /// The directions found; 0 for a command that has not moved.
    pub fn found(self) -> Vec<i8> {
        self.tracker.first
    }
}

/// The play operator: what hangs behind a drive with play, `docs/model.md` (31).
///
/// The driven member stands still until the drive has crossed the play, then is carried along. The width may differ from
/// position to position.
#[derive(Clone, Copy, Debug)]
pub struct Play {
    /// Position of the driven member, m or rad.
    driven: f64,
}

impl Play {
    /// Before the first motion the play lies on the side of that motion: the driven member trails by half the width.
    pub fn new(q: f64, width: f64, first_direction: i8) -> Self {
        Play { driven: q - 0.5 * width * f64::from(first_direction) }
    }

    /// Moves the drive to `q`, where the play is `width` wide (total); the driven member's deviation from `q`.
    pub fn advance(&mut self, q: f64, width: f64) -> f64 {
        let half = 0.5 * width.max(0.0);
        self.driven = self.driven.clamp(q - half, q + half);
        self.driven - q
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directions(path: &[f64], band: f64) -> Vec<i8> {
        let chunk = Chunk { len: path.len(), commands: path.to_vec(), ..Chunk::default() };
        let mut first = FirstDirections::new(vec![band]);
        first.look(&chunk);
        Tracker::new(vec![band], first.found()).follow(&chunk).directions
    }

    #[test]
    fn a_dwell_keeps_the_last_direction_and_the_first_samples_take_the_first_motions() {
        assert_eq!(
            directions(&[0.0, 0.0, -1.0, -1.0, -2.0, -1.0, -1.0, 0.0], 0.0),
            [-1, -1, -1, -1, -1, 1, 1, 1]
        );
    }

    #[test]
    fn jitter_inside_the_dead_band_is_no_reversal() {
        assert_eq!(directions(&[0.0, 1.0, 0.95, 1.0, 0.96, 2.0, 1.95, 1.0], 0.1), [1, 1, 1, 1, 1, 1, 1, -1]);
    }

    #[test]
    fn an_axis_that_creeps_inside_the_dead_band_still_turns_in_the_end() {
        assert_eq!(directions(&[0.0, 1.0, 0.95, 0.92, 0.89], 0.1), [1, 1, 1, 1, -1]);
    }

    #[test]
    fn an_axis_that_never_moves_has_no_direction() {
        assert_eq!(directions(&[0.5, 0.5, 0.5], 0.0), [0, 0, 0]);
    }

    #[test]
    fn stated_directions_of_approach_count_instead_of_the_motion() {
        let chunk = Chunk {
            len: 4,
            commands: vec![0.0, 1.0, 2.0, 1.0],
            directions: vec![Some(vec![0.0, -1.0, 0.0, 1.0])],
            ..Chunk::default()
        };
        let mut first = FirstDirections::new(vec![0.0]);
        first.look(&chunk);
        let motion = Tracker::new(vec![0.0], first.found()).follow(&chunk);
        assert_eq!(motion.directions, [-1, -1, -1, 1]);
    }

    #[test]
    fn a_way_that_is_not_known_gives_no_direction() {
        let mut tracker = Tracker::new(vec![0.0], vec![-1]);
        let mut told = Vec::new();
        for (q, known) in [(5.0, true), (9.0, false), (8.0, true), (9.0, true), (0.0, false), (1.0, true)] {
            if !known {
                tracker.lose(0);
            }
            tracker.advance(&[q], |_| None);
            told.extend(tracker.directions());
        }
        assert_eq!(told, [-1, -1, -1, 1, 0, 1]);
    }

    #[test]
    fn distance_since_reversal_starts_at_the_turning_point() {
        let path = [0.0, 1.0, 3.0, 2.5, 1.0, 2.0];
        let chunk = Chunk { len: path.len(), commands: path.to_vec(), ..Chunk::default() };
        let motion = Tracker::new(vec![0.0], vec![1]).follow(&chunk);
        assert_eq!(motion.since_reversal, [0.0, 1.0, 3.0, 0.5, 2.0, 1.0]);
    }

    #[test]
    fn play_is_crossed_before_the_driven_member_follows() {
        let mut play = Play::new(0.0, 0.2, 1);
        let error = [0.0, 1.0, 0.9, 0.8, 0.5, 0.6].map(|q| play.advance(q, 0.2));
        for (got, expected) in error.iter().zip([-0.1, -0.1, 0.0, 0.1, 0.1, 0.0]) {
            assert!((got - expected).abs() < 1e-12, "{error:?}");
        }
    }
}
