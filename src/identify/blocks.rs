//! Sums over samples of a [`Gauge`], block by block on SIMD lanes, `docs/model.md` (20).

use nalgebra::{DMatrix, DVector};
use pulp::{Arch, Simd, WithSimd};

use super::gauge::Gauge;
use super::loss::Loss;
use super::stretch::Stretch;
use super::tally::{COUNTS, Tally};
use crate::chain::{Moved, Row};
use crate::scalar::{Lanes, MOST_LANES, Scalar};
use crate::sensor::MOST_READINGS;
use crate::units::Quantity;

/// Lanes of a block: its columns stay in a core's nearest cache.
const GROUPS: usize = 12;
/// Columns that are multiplied with as many others at a time: the sums of such a tile are all in registers.
const TILE: usize = 3;

/// Some samples of a stretch, read by a gauge.
#[derive(Clone, Copy)]
pub(crate) struct Samples<'a> {
    pub gauge: &'a Gauge<'a>,
    pub stretch: &'a Stretch,
    /// Which samples.
    pub members: &'a [usize],
}

/// Samples and how they are judged.
pub(crate) struct Block<'a> {
    pub samples: Samples<'a>,
    pub sigmas: &'a [f64],
    pub loss: Loss,
    /// Features over which sums are taken.
    pub features: &'a [usize],
}

/// What a [`Block`] adds.
pub(crate) struct Sum {
    pub matrix: DMatrix<f64>,
    pub gradient: DVector<f64>,
    pub loss: f64,
    pub tally: Tally,
}

impl Samples<'_> {
    /// The residuals, measured minus model, m: those of a sample one after the other.
    pub fn residuals(self) -> Vec<f64> {
        Arch::new().dispatch(self)
    }

    /// From sample `from` on, of rows of so many numbers, columns of a height; what is behind the last sample repeats it.
    fn columns(&self, from: usize, rows: &[f64], width: usize, height: usize, to: &mut [f64]) {
        let members = &self.members[from..];
        // Neighbours are the rule, and rows whose width is known are taken apart at several times the speed.
        if members.len() >= height && members[height - 1] - members[0] == height - 1 {
            let rows = &rows[width * members[0]..][..width * height];
            match width {
                1 => return to.copy_from_slice(rows),
                2 => return apart::<2>(rows, to),
                3 => return apart::<3>(rows, to),
                4 => return apart::<4>(rows, to),
                5 => return apart::<5>(rows, to),
                6 => return apart::<6>(rows, to),
                7 => return apart::<7>(rows, to),
                8 => return apart::<8>(rows, to),
                _ => {}
            }
        }
        let last = self.members.len() - 1;
        for k in 0..height {
            let row = &rows[width * self.members[(from + k).min(last)]..][..width];
            for (c, number) in row.iter().enumerate() {
                to[height * c + k] = *number;
            }
        }
    }
}

/// Columns of equal height from rows of `W` numbers.
fn apart<const W: usize>(rows: &[f64], to: &mut [f64]) {
    let height = to.len() / W;
    for (k, row) in rows.as_chunks::<W>().0.iter().enumerate() {
        for (c, number) in row.iter().enumerate() {
            to[height * c + k] = *number;
        }
    }
}

/// Of columns of equal height, the lanes from row `from` on.
#[inline(always)]
fn take<S: Simd>(simd: S, columns: &[f64], height: usize, from: usize, to: &mut [Lanes<S>]) {
    for (column, to) in columns.chunks_exact(height).zip(to) {
        *to = Lanes::load(simd, &column[from..]);
    }
}

/// The features that count, each at its place among them.
struct Chosen<'a, S: Simd> {
    /// Place of each feature; beyond the end where it does not count.
    places: &'a [usize],
    own: &'a mut [Lanes<S>],
}

impl<S: Simd> Row<Lanes<S>> for Chosen<'_, S> {
    #[inline(always)]
    fn take<const N: usize>(&mut self, first: usize, numbers: [Lanes<S>; N]) {
        let mut k = 0;
        while k < N {
            if let Some(to) = self.own.get_mut(self.places[first + k]) {
                *to = numbers[k];
            }
            k += 1;
        }
    }
}

impl WithSimd for Samples<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Vec<f64> {
        let none = Lanes::splat(simd, 0.0);
        let (count, gauge) = (self.gauge.reading_count(), self.gauge);
        let mut residuals = vec![0.0; self.members.len() * count];
        let mut q = vec![none; self.stretch.commands];
        let mut moved = vec![Moved::none(none); gauge.joint_count().max(1)];
        let mut measured = [none; MOST_READINGS];
        let state = gauge.state(none);
        let mut lanes = [0.0; MOST_LANES];
        let height = GROUPS * S::F64_LANES;
        let mut commands = vec![0.0; q.len() * height];
        let mut values = vec![0.0; count * height];
        for (group, residuals) in residuals.chunks_mut(count * S::F64_LANES).enumerate() {
            let slot = group % GROUPS * S::F64_LANES;
            if slot == 0 {
                let chunk = &self.stretch.chunk;
                self.columns(group * S::F64_LANES, &chunk.commands, q.len(), height, &mut commands);
                self.columns(group * S::F64_LANES, &chunk.values, count, height, &mut values);
            }
            take(simd, &commands, height, slot, &mut q);
            take(simd, &values, height, slot, &mut measured[..count]);
            let p_w = gauge.go_to(&q, &state, &mut moved);
            for i in 0..count {
                (measured[i] - gauge.reading(i, p_w, &state).0).store(&mut lanes[..S::F64_LANES]);
                for (residuals, lane) in residuals.chunks_exact_mut(count).zip(lanes) {
                    residuals[i] = lane;
                }
            }
        }
        residuals
    }
}

impl Block<'_> {
    /// Takes the sums.
    pub fn sum(self) -> Sum {
        Arch::new().dispatch(self)
    }

    /// Judges the residuals of the lanes from sample `from` on, in standard deviations, one by one: counts them, and returns by what rows
    /// and residuals of each lane are multiplied.
    fn judge(
        &self,
        from: usize,
        lanes: usize,
        readings: &[[f64; MOST_LANES]],
        sum: &mut Sum,
    ) -> [f64; MOST_LANES] {
        let mut factors = [0.0; MOST_LANES];
        let open = self.samples.members.len() - from;
        for (l, factor) in factors[..lanes.min(open)].iter_mut().enumerate() {
            let squares: f64 = readings.iter().map(|reading| reading[l] * reading[l]).sum();
            let (rho, weight) = self.loss.at(squares / readings.len() as f64);
            sum.loss += readings.len() as f64 * rho;
            sum.tally.down_weighted += u64::from(weight < 0.5);
            let sums = &mut sum.tally.residuals[Quantity::Length];
            for (reading, sigma) in readings.iter().zip(self.sigmas) {
                let own = (reading[l] * sigma) * (reading[l] * sigma);
                sums.rows += 1;
                sums.squares += own;
                if weight > COUNTS {
                    sums.inliers += 1;
                    sums.inlier_squares += own;
                }
            }
            *factor = weight.sqrt();
        }
        factors
    }
}

impl WithSimd for Block<'_> {
    type Output = Sum;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Sum {
        let none = Lanes::splat(simd, 0.0);
        let Samples { gauge, stretch, members } = self.samples;
        let (count, width) = (gauge.reading_count(), self.features.len() + 1);
        let (tiles, depth) = (width.div_ceil(TILE), GROUPS * count);
        let mut sum = Sum {
            matrix: DMatrix::zeros(width - 1, width - 1),
            gradient: DVector::zeros(width - 1),
            loss: 0.0,
            tally: Tally { samples: members.len() as u64, ..Tally::default() },
        };
        // Row by row of lanes; the last column that counts is that of the residuals.
        let mut rows = vec![[none; TILE]; depth * tiles];
        let mut squares = vec![[[none; TILE]; TILE]; tiles * (tiles + 1) / 2];
        let mut q = vec![none; stretch.commands];
        let mut moved = vec![Moved::none(none); gauge.joint_count().max(1)];
        let mut places = vec![usize::MAX; gauge.feature_count()];
        self.features.iter().enumerate().for_each(|(place, feature)| places[*feature] = place);
        let height = GROUPS * S::F64_LANES;
        let (mut commands, mut values) = (vec![0.0; q.len() * height], vec![0.0; count * height]);
        let (mut measured, mut standardised) = ([none; MOST_READINGS], [none; MOST_READINGS]);
        // What is plain is summed over lanes: squared standardised readings, by reading.
        let (mut plain, mut plain_groups) = ([none; MOST_READINGS], 0u64);
        let state = gauge.state(none);
        let mut factors = [1.0; MOST_READINGS];
        for (factor, sigma) in factors.iter_mut().zip(self.sigmas) {
            *factor = sigma.recip();
        }
        // Up to here the loss is half of the square, summed over the readings of a sample.
        let plain_below = count as f64 * self.loss.plain_below();
        for from in (0..members.len()).step_by(height) {
            let filled = (members.len() - from).min(height).div_ceil(S::F64_LANES);
            self.samples.columns(from, &stretch.chunk.commands, q.len(), height, &mut commands);
            self.samples.columns(from, &stretch.chunk.values, count, height, &mut values);
            for group in 0..filled {
                let first = from + group * S::F64_LANES;
                take(simd, &commands, height, group * S::F64_LANES, &mut q);
                take(simd, &values, height, group * S::F64_LANES, &mut measured[..count]);
                let p_w = gauge.go_to(&q, &state, &mut moved);
                let mut square = none;
                for i in 0..count {
                    let (value, n_w) = gauge.reading(i, p_w, &state);
                    standardised[i] = (measured[i] - value).scale(factors[i]);
                    square = standardised[i].mul_add(standardised[i], square);
                    let own = rows[(group * count + i) * tiles..][..tiles].as_flattened_mut();
                    let mut chosen = Chosen { places: &places, own: &mut own[..width - 1] };
                    gauge.features(n_w, p_w, factors[i], &moved, &mut chosen);
                    own[width - 1] = standardised[i];
                }
                if first + S::F64_LANES <= members.len() && square.all_below(plain_below) {
                    plain_groups += 1;
                    for (sum, own) in plain.iter_mut().zip(standardised) {
                        *sum = own.mul_add(own, *sum);
                    }
                    continue;
                }
                let mut readings = [[0.0; MOST_LANES]; MOST_READINGS];
                for (lanes, reading) in standardised.iter().zip(&mut readings) {
                    lanes.store(&mut reading[..S::F64_LANES]);
                }
                let factors = self.judge(first, S::F64_LANES, &readings[..count], &mut sum);
                let factor = Lanes::load(simd, &factors[..S::F64_LANES]);
                for number in rows[group * count * tiles..][..count * tiles].as_flattened_mut() {
                    *number = *number * factor;
                }
            }
            add_squares(&rows[..filled * count * tiles], tiles, &mut squares);
        }
        let sums = &mut sum.tally.residuals[Quantity::Length];
        sums.rows += plain_groups * (S::F64_LANES * count) as u64;
        sums.inliers += plain_groups * (S::F64_LANES * count) as u64;
        for (squares, sigma) in plain.iter().zip(self.sigmas) {
            sum.loss += 0.5 * squares.sum();
            sums.squares += squares.sum() * sigma * sigma;
            sums.inlier_squares += squares.sum() * sigma * sigma;
        }
        let mut tile = 0;
        for a in 0..tiles {
            for b in 0..=a {
                for (i, row) in squares[tile].iter().enumerate() {
                    for (j, lanes) in row.iter().enumerate() {
                        let (i, j, number) = (TILE * a + i, TILE * b + j, lanes.sum());
                        if i + 1 < width && j + 1 < width {
                            sum.matrix[(i, j)] = number;
                            sum.matrix[(j, i)] = number;
                        } else if i + 1 == width && j + 1 < width {
                            sum.gradient[j] = number;
                        }
                    }
                }
                tile += 1;
            }
        }
        sum
    }
}

/// Adds the products of all columns, tile by tile on and below the diagonal.
#[inline(always)]
fn add_squares<S: Simd>(rows: &[[Lanes<S>; TILE]], tiles: usize, squares: &mut [[[Lanes<S>; TILE]; TILE]]) {
    let mut squares = squares.iter_mut();
    for a in 0..tiles {
        for b in 0..=a {
            let Some(square) = squares.next() else { return };
            let [[mut s00, mut s01, mut s02], [mut s10, mut s11, mut s12], [mut s20, mut s21, mut s22]] =
                *square;
            for row in rows.chunks_exact(tiles) {
                let ([x0, x1, x2], [y0, y1, y2]) = (row[a], row[b]);
                (s00, s01, s02) = (x0.mul_add(y0, s00), x0.mul_add(y1, s01), x0.mul_add(y2, s02));
                (s10, s11, s12) = (x1.mul_add(y0, s10), x1.mul_add(y1, s11), x1.mul_add(y2, s12));
                (s20, s21, s22) = (x2.mul_add(y0, s20), x2.mul_add(y1, s21), x2.mul_add(y2, s22));
            }
            *square = [[s00, s01, s02], [s10, s11, s12], [s20, s21, s22]];
        }
    }
}
