//! Equations over the commands, and the directions in which these move them, `docs/compensate.md` (C2).

use smallvec::SmallVec;

/// Most equations of a task: those of a pose.
pub(super) const MOST: usize = 6;

/// Sweeps until the rows are square to each other; three or four do, whatever the numbers are.
const SWEEPS: usize = 30;
/// Rows whose cosine is smaller are square to each other.
const SQUARE: f64 = 1e-15;
/// Singular values below this part of the largest are rounding.
const NOTHING: f64 = 1e-14;

/// Equations over the commands, a row each; at most [`MOST`].
#[derive(Clone, Debug)]
pub(super) struct Equations {
    count: usize,
    columns: usize,
    values: SmallVec<[f64; 64]>,
}

impl Equations {
    pub fn new(count: usize, columns: usize) -> Self {
        Equations { count, columns, values: SmallVec::from_elem(0.0, count * columns) }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    pub fn row(&self, k: usize) -> &[f64] {
        &self.values[k * self.columns..][..self.columns]
    }

    pub fn row_mut(&mut self, k: usize) -> &mut [f64] {
        &mut self.values[k * self.columns..][..self.columns]
    }

    /// Both, these first.
    pub fn and(mut self, others: &Equations) -> Self {
        self.count += others.count;
        self.values.extend_from_slice(&others.values);
        self
    }

    /// Those commands alone; the columns of the others are zero.
    pub fn only(mut self, counts: impl Fn(usize) -> bool) -> Self {
        for c in (0..self.columns).filter(|c| !counts(*c)) {
            (0..self.count).for_each(|k| self.row_mut(k)[c] = 0.0);
        }
        self
    }

    /// What a step of the commands does to each.
    pub fn times(&self, step: &[f64]) -> [f64; MOST] {
        let mut by = [0.0; MOST];
        by.iter_mut().zip(0..self.count).for_each(|(by, k)| *by = dot(self.row(k), step));
        by
    }

    /// Without what the commands do along a unit vector of theirs.
    pub fn forget(&mut self, along: &[f64]) {
        for k in 0..self.count {
            let row = self.row_mut(k);
            let used = dot(row, along);
            row.iter_mut().zip(along).for_each(|(x, v)| *x -= used * v);
        }
    }

    /// Adds the smallest step that closes the error, if every direction is stronger than this part of the largest and than this size:
    /// `Aᵀ (A Aᵀ)⁻¹ e`, which is what [`Directions::step`] comes to there. Otherwise the step stays as it is, and it takes directions to
    /// say more.
    pub fn step_if_strong(&self, error: &[f64; MOST], (part, size): (f64, f64), step: &mut [f64]) -> bool {
        let n = self.count;
        // `A Aᵀ = L Lᵀ`, and `L⁻¹`: the squares of its elements add up to the inverse squares of all singular values.
        let (mut lower, mut inverse, mut trace, mut weakest) =
            ([[0.0; MOST]; MOST], [[0.0; MOST]; MOST], 0.0, 0.0);
        for i in 0..n {
            for j in 0..=i {
                let known = dot(&lower[i][..j], &lower[j][..j]);
                let square = dot(self.row(i), self.row(j)) - known;
                if i > j {
                    lower[i][j] = square * inverse[j][j];
                } else if square > 0.0 {
                    trace += square + known;
                    lower[i][i] = square.sqrt();
                    inverse[i][i] = lower[i][i].recip();
                } else {
                    return false;
                }
            }
            for j in 0..i {
                let sum: f64 = (j..i).map(|k| lower[i][k] * inverse[k][j]).sum();
                inverse[i][j] = -sum * inverse[i][i];
            }
            weakest += dot(&inverse[i][..=i], &inverse[i][..=i]);
        }
        let least = (part * part * trace).max(size * size);
        // Not a number is not strong.
        let is_strong = weakest * least < 1.0;
        if !is_strong {
            return false;
        }
        let mut by = [0.0; MOST];
        for i in 0..n {
            let y = dot(&inverse[i][..=i], &error[..=i]);
            (0..=i).for_each(|j| by[j] += inverse[i][j] * y);
        }
        for (k, by) in by.iter().enumerate().take(n) {
            step.iter_mut().zip(self.row(k)).for_each(|(step, x)| *step += by * x);
        }
        true
    }

    /// Singular values and vectors, by rotations that make the rows square to each other (one-sided Jacobi).
    pub fn directions(mut self) -> Directions {
        // Errors beyond all numbers, as a damaged file may state them, leave no direction: the goal is out of reach.
        if !self.values.iter().all(|x| x.is_finite()) {
            return Directions { parts: Vec::new() };
        }
        let mut left = [[0.0; MOST]; MOST];
        (0..self.count).for_each(|k| left[k][k] = 1.0);
        for _ in 0..SWEEPS {
            let mut turned = false;
            for p in 0..self.count {
                for q in p + 1..self.count {
                    turned |= self.make_square(p, q, &mut left);
                }
            }
            if !turned {
                break;
            }
        }
        let mut parts: Vec<Direction> = (0..self.count)
            .map(|k| Direction { moves: left[k], size: norm(self.row(k)), by: self.row(k).to_vec() })
            .collect();
        let largest = parts.iter().map(|part| part.size).fold(0.0, f64::max);
        parts.sort_by(|a, b| b.size.total_cmp(&a.size));
        let told = parts.iter().take_while(|part| part.size > NOTHING * largest).count();
        for part in &mut parts[..told] {
            part.by.iter_mut().for_each(|x| *x /= part.size);
        }
        // There are no more directions than commands; those that nothing moves take what commands are left.
        parts.truncate(self.columns);
        for k in told..parts.len() {
            let by = square_to_all(&parts[..k], self.columns);
            (parts[k].size, parts[k].by) = (0.0, by);
        }
        Directions { parts }
    }

    /// Turns two rows against each other until they are square; whether they were not.
    fn make_square(&mut self, p: usize, q: usize, left: &mut [[f64; MOST]; MOST]) -> bool {
        let (upper, lower) = self.values.split_at_mut(q * self.columns);
        let (a, b) = (&mut upper[p * self.columns..][..self.columns], &mut lower[..self.columns]);
        let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
        if ab.abs() <= SQUARE * (aa * bb).sqrt() {
            return false;
        }
        let zeta = (bb - aa) / (2.0 * ab);
        let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
        let cosine = tangent.hypot(1.0).recip();
        let sine = tangent * cosine;
        let turn = |a: &mut f64, b: &mut f64| (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
        a.iter_mut().zip(b).for_each(|(a, b)| turn(a, b));
        let (upper, lower) = left.split_at_mut(q);
        upper[p].iter_mut().zip(&mut lower[0]).for_each(|(a, b)| turn(a, b));
        true
    }
}

/// A unit vector of commands that is square to all of these.
fn square_to_all(parts: &[Direction], columns: usize) -> Vec<f64> {
    let taken = |c: usize| parts.iter().map(|part| part.by[c] * part.by[c]).sum::<f64>();
    let freest = (0..columns).min_by(|a, b| taken(*a).total_cmp(&taken(*b))).unwrap_or(0);
    let mut by = vec![0.0; columns];
    by[freest] = 1.0;
    // Once more for what rounding has left.
    for part in parts.iter().chain(parts) {
        let along = dot(&by, &part.by);
        by.iter_mut().zip(&part.by).for_each(|(x, v)| *x -= along * v);
    }
    let size = norm(&by);
    by.iter_mut().for_each(|x| *x /= size);
    by
}

/// A direction of a task.
#[derive(Clone, Debug)]
pub(super) struct Direction {
    /// Unit vector over the equations: what moves.
    pub moves: [f64; MOST],
    /// Unit vector over the commands: by which it moves.
    pub by: Vec<f64>,
    /// Singular value.
    pub size: f64,
}

/// Directions of a task, those that the commands move most first.
#[derive(Clone, Debug)]
pub(super) struct Directions {
    pub parts: Vec<Direction>,
}

impl Directions {
    pub fn largest(&self) -> f64 {
        self.parts.first().map_or(0.0, |part| part.size)
    }

    /// Adds (C3) to a step: along each direction what closes the error; a weak one is drawn back by `from_start`.
    pub fn step(&self, error: &[f64; MOST], from_start: &[f64], weak: f64, step: &mut [f64]) {
        for Direction { moves, by, size } in &self.parts {
            let hold = if *size < weak { 0.25 * weak * weak * (1.0 - (size / weak).powi(2)) } else { 0.0 };
            let scale = size * size + hold;
            if scale > 1e-24 {
                let far = (size * dot(moves, error) - hold * dot(by, from_start)) / scale;
                step.iter_mut().zip(by).for_each(|(step, v)| *step += far * v);
            }
        }
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    fn of(count: usize, columns: usize, at: impl Fn(usize, usize) -> f64) -> Equations {
        let mut equations = Equations::new(count, columns);
        for k in 0..count {
            equations.row_mut(k).iter_mut().enumerate().for_each(|(c, x)| *x = at(k, c));
        }
        equations
    }

    #[test]
    fn directions_put_the_equations_together_again_and_are_square_to_each_other() {
        let full = |k: usize, c: usize| (1.3 * (k as f64 + 1.0) * (c as f64 + 1.7)).sin();
        let lost = |k: usize, c: usize| if c == 1 { 0.0 } else { full(k.min(1), c) };
        let steep = |k: usize, c: usize| full(k, c) * 10f64.powi(-3 * k as i32);
        for (count, columns) in [(2, 5), (3, 3), (6, 6), (6, 9), (3, 2), (1, 1), (0, 4), (6, 4)] {
            for at in [&full as &dyn Fn(usize, usize) -> f64, &lost, &steep] {
                let directions = of(count, columns, at).directions();
                assert_eq!(directions.parts.len(), count.min(columns));
                let exact = DMatrix::from_fn(count, columns, at);
                let mut sum = DMatrix::zeros(count, columns);
                for (i, one) in directions.parts.iter().enumerate() {
                    sum += DMatrix::from_fn(count, columns, |k, c| one.size * one.moves[k] * one.by[c]);
                    for (j, other) in directions.parts.iter().enumerate() {
                        let same = f64::from(u8::from(i == j));
                        assert!((dot(&one.by, &other.by) - same).abs() < 1e-13);
                        assert!((dot(&one.moves, &other.moves) - same).abs() < 1e-13);
                    }
                }
                assert!((sum - exact).amax() < 1e-14, "{count} x {columns}");
            }
        }
        assert!(of(2, 2, |_, _| f64::NAN).directions().parts.is_empty());
    }

    #[test]
    fn strong_equations_are_solved_as_their_directions_solve_them_and_weak_ones_are_left() {
        let full = |k: usize, c: usize| (1.3 * (k as f64 + 1.0) * (c as f64 + 1.7)).sin();
        let lost = |k: usize, c: usize| if k == 1 { 2.0 * full(0, c) } else { full(k, c) };
        let error = [0.3, -0.2, 0.5, 0.1, -0.7, 0.4];
        for (count, columns) in [(2, 5), (3, 3), (6, 9), (1, 1), (0, 4)] {
            let directions = of(count, columns, full).directions();
            let weakest = directions.parts.last().map_or(1.0, |part| part.size);
            let mut by_directions = vec![0.0; columns];
            directions.step(&error, &vec![0.0; columns], 0.0, &mut by_directions);
            let mut at_once = vec![0.0; columns];
            assert!(of(count, columns, full).step_if_strong(&error, (0.0, 0.3 * weakest), &mut at_once));
            // What `A Aᵀ` loses to rounding.
            let rounding = 1e-14 * (directions.largest() / weakest).powi(2);
            for (a, b) in at_once.iter().zip(&by_directions) {
                assert!((a - b).abs() <= rounding * norm(&by_directions), "{count} x {columns}");
            }
            let mut step = vec![0.0; columns];
            let too_much = (0.0, 1.01 * weakest);
            assert!(count == 0 || !of(count, columns, full).step_if_strong(&error, too_much, &mut step));
            assert!(count < 2 || !of(count, columns, lost).step_if_strong(&error, (1e-6, 0.0), &mut step));
            assert!(step.iter().all(|x| *x == 0.0));
        }
        assert!(!of(2, 2, |_, _| f64::NAN).step_if_strong(&error, (0.0, 0.0), &mut [0.0; 2]));
    }
}
