//! Values at moments.

/// Messages of one sender may come to the recorder in another order than they were stamped, but not by more than this, ns.
const OUT_OF_ORDER: i64 = 1_000_000_000;

/// Values with the moments at which they held, ns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Track<T> {
    /// In the order of time, once it is [settled](Track::settle).
    points: Vec<(i64, T)>,
    latest: i64,
    /// Number of the first value whose moment lies far before one that came earlier, and by how much, ns.
    set_back: Option<(usize, i64)>,
    /// Values that gave way to a later one of the same moment.
    repeated: u64,
}

/// Where a moment lies in a track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Around {
    /// Before the first or behind the last value.
    Outside,
    /// At this value.
    At(usize),
    /// Between this value and the next one.
    Between(usize),
}

impl<T> Default for Track<T> {
    fn default() -> Self {
        Track { points: Vec::new(), latest: i64::MIN, set_back: None, repeated: 0 }
    }
}

impl<T> Track<T> {
    pub fn push(&mut self, at: i64, value: T) {
        let back = self.latest.saturating_sub(at);
        if !self.points.is_empty() && back > OUT_OF_ORDER && self.set_back.is_none() {
            self.set_back = Some((self.points.len(), back));
        }
        self.latest = self.latest.max(at);
        self.points.push((at, value));
    }

    /// Brings values into the order of time; of several at one moment the last stands.
    pub fn settle(&mut self) {
        // Keeps the order of those at one moment.
        self.points.sort_by_key(|(at, _)| *at);
        let all = self.points.len();
        self.points.reverse();
        self.points.dedup_by_key(|(at, _)| *at);
        self.points.reverse();
        self.repeated += (all - self.points.len()) as u64;
    }

    pub fn points(&self) -> &[(i64, T)] {
        &self.points
    }

    pub fn set_back(&self) -> Option<(usize, i64)> {
        self.set_back
    }

    pub fn repeated(&self) -> u64 {
        self.repeated
    }

    /// First and last moment.
    pub fn span(&self) -> Option<(i64, i64)> {
        Some((self.points.first()?.0, self.points.last()?.0))
    }

    pub fn around(&self, at: i64) -> Around {
        match self.points.binary_search_by_key(&at, |(own, _)| *own) {
            Ok(i) => Around::At(i),
            Err(i) if i == 0 || i == self.points.len() => Around::Outside,
            Err(i) => Around::Between(i - 1),
        }
    }

    /// Time between a value and the next one, ns.
    pub fn interval(&self, i: usize) -> i64 {
        self.points[i + 1].0.saturating_sub(self.points[i].0)
    }

    /// The median of the times between values, ns.
    pub fn usual_interval(&self) -> Option<i64> {
        let mut all: Vec<i64> = (1..self.points.len()).map(|i| self.interval(i - 1)).collect();
        let middle = all.len() / 2;
        (!all.is_empty()).then(|| *all.select_nth_unstable(middle).1)
    }

    /// How far a moment is from one value to the next, 0 to 1.
    pub fn part(&self, i: usize, at: i64) -> f64 {
        at.saturating_sub(self.points[i].0) as f64 / self.interval(i) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(points: &[(i64, u8)]) -> Track<u8> {
        let mut track = Track::default();
        points.iter().for_each(|(at, value)| track.push(*at, *value));
        track.settle();
        track
    }

    #[test]
    fn values_come_into_order_and_the_last_of_a_moment_stands() {
        let found = track(&[(5, 0), (3, 1), (9, 2), (5, 3)]);
        assert_eq!(found.points(), [(3, 1), (5, 3), (9, 2)]);
        assert_eq!((found.repeated(), found.set_back(), found.span()), (1, None, Some((3, 9))));
        assert_eq!(found.usual_interval(), Some(4));
        let set_back = track(&[(0, 0), (3_000_000_000, 1), (1_000_000_000, 2)]);
        assert_eq!(set_back.set_back(), Some((2, 2_000_000_000)));
    }

    #[test]
    fn a_moment_lies_at_a_value_between_two_or_outside() {
        let found = track(&[(10, 0), (20, 1), (40, 2)]);
        let around = [9, 10, 11, 20, 39, 40, 41].map(|at| found.around(at));
        use Around::{At, Between, Outside};
        assert_eq!(around, [Outside, At(0), Between(0), At(1), Between(1), At(2), Outside]);
        assert!((found.part(1, 25) - 0.25).abs() < 1e-15);
        assert_eq!(track(&[]).around(0), Outside);
    }
}
