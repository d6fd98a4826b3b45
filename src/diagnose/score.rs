//! How well a candidate explains what is left: its evidence against chance, over its whole grid, `docs/diagnosis.md` (63) to (64).

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use nalgebra::{Cholesky, DMatrix, DVector};

use super::noise::Whitener;
use super::space::Space;
use super::spectrum::Spectrum;
use crate::effects::{Candidate, Slot};
use crate::feature::Samples;
use crate::identify::Linear;
use crate::lie::Twist;

/// Rows of the recordings and what turns them white.
pub(super) struct Rows<'a> {
    pub linear: &'a Linear,
    pub whitener: Whitener,
    /// Whitened residuals of the constant model.
    pub residual: DVector<f64>,
    /// Samples put together in blocks, for features that change little within one.
    coarse: Coarse,
    columns: Mutex<HashMap<Key, Arc<Vec<f64>>>>,
    coarse_columns: Mutex<HashMap<Key, Arc<Vec<f64>>>>,
}

/// Blocks of samples that stand for themselves.
struct Coarse {
    /// Samples of a block; 1 where there are few.
    size: usize,
    /// Coarse row of each row.
    row: Vec<usize>,
    /// One over the root of how many rows a coarse row has.
    weight: Vec<f64>,
    /// Coarse sample of each coarse row.
    sample: Vec<usize>,
    /// What features see of the samples in the middle of the blocks.
    samples: Vec<Samples>,
    /// Sample in the middle of the block, for every sample.
    middle: Vec<usize>,
}

/// About so many coarse rows are kept.
const COARSE: usize = 2500;

impl Coarse {
    fn new(linear: &Linear) -> Self {
        let size = (linear.residual.len() / COARSE).clamp(1, 8);
        let mut coarse = Coarse {
            size,
            row: Vec::new(),
            weight: Vec::new(),
            sample: Vec::new(),
            samples: Vec::new(),
            middle: Vec::new(),
        };
        let mut samples = 0;
        for (s, span) in linear.spans.iter().enumerate() {
            let count = span.samples.1 - span.samples.0;
            let blocks: Vec<(usize, usize)> =
                (0..count).step_by(size).map(|from| (from, (from + size).min(count))).collect();
            let middles: Vec<usize> = blocks.iter().map(|(from, to)| (from + to - 1) / 2).collect();
            for ((from, to), middle) in blocks.iter().zip(&middles) {
                let first = coarse.weight.len();
                for _ in *from..*to {
                    coarse.row.extend(first..first + span.readings);
                    coarse.middle.push(span.samples.0 + middle);
                }
                coarse.weight.extend(vec![((to - from) as f64).sqrt().recip(); span.readings]);
                coarse.sample.extend(vec![samples; span.readings]);
                samples += 1;
            }
            coarse.samples.push(linear.samples[s].chosen(&middles));
        }
        coarse
    }

    /// Sums over blocks; white noise keeps its variance.
    fn reduce(&self, column: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.weight.len()];
        column.iter().zip(&self.row).for_each(|(x, row)| sums[*row] += x * self.weight[*row]);
        sums
    }

    fn reduce_all(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.weight.len(), columns.ncols());
        for (c, column) in columns.column_iter().enumerate() {
            let column: Vec<f64> = column.iter().copied().collect();
            out.column_mut(c).copy_from_slice(&self.reduce(&column));
        }
        out
    }
}

/// What all candidates are judged against: the space, and the residuals beside it, fine and coarse.
pub(super) struct Field {
    space: Space,
    /// `M r`.
    left: DVector<f64>,
    coarse_space: Space,
    coarse_left: DVector<f64>,
}

type Key = (usize, usize, [u64; 6]);

/// A candidate at its best.
#[derive(Clone, Debug)]
pub(super) struct Score {
    /// Logarithm of its evidence over that of nothing, averaged over grid, sizes and lengths.
    pub evidence: f64,
    /// The same at the best point alone.
    pub at_best: f64,
    /// Where on its grid it is best.
    pub parameters: Vec<f64>,
    /// How many of its coefficients take part, from the first.
    pub coefficients: usize,
    /// Half the misfit energy that it takes away there.
    pub gain: f64,
}

/// Usual sizes are known to within a factor of so many, either way.
const SIZES: [f64; 3] = [0.25, 1.0, 4.0];
/// Columns that are built at a time.
const BATCH: usize = 48;

impl<'a> Rows<'a> {
    pub fn new(linear: &'a Linear, whitener: Whitener) -> Self {
        let mut residual = DVector::zeros(linear.residual.len());
        whitener.apply(&linear.residual, residual.as_mut_slice());
        let empty = || Mutex::new(HashMap::new());
        Rows {
            linear,
            whitener,
            residual,
            coarse: Coarse::new(linear),
            columns: empty(),
            coarse_columns: empty(),
        }
    }

    /// What candidates are judged against beside a space.
    pub fn field(&self, space: Space) -> Field {
        let left = space.apply(&self.residual);
        if self.coarse.size == 1 {
            return Field { coarse_space: space.clone(), coarse_left: left.clone(), space, left };
        }
        let coarse_space = Space::of_factor(self.coarse.reduce_all(space.factor()));
        let coarse_left = DVector::from_vec(self.coarse.reduce(left.as_slice()));
        Field { space, left, coarse_space, coarse_left }
    }

    /// Everything constant, marginalised.
    pub fn constant(&self) -> Space {
        let mut columns = self.linear.constant.clone();
        self.whiten(&mut columns);
        Space::new(columns)
    }

    pub fn whiten(&self, columns: &mut DMatrix<f64>) {
        let mut white = vec![0.0; columns.nrows()];
        for c in 0..columns.ncols() {
            let mut column = columns.column_mut(c);
            self.whitener.apply(column.as_slice(), &mut white);
            column.copy_from_slice(&white);
        }
    }

    /// How the readings answer to a twist in a slot, not whitened.
    fn answer(&self, slot: Slot, direction: Twist<f64>) -> Arc<Vec<f64>> {
        let (d, key) = (direction.to_array(), key(slot, direction));
        if let Some(known) = self.columns.lock().ok().and_then(|map| map.get(&key).cloned()) {
            return known;
        }
        let n = self.linear.residual.len();
        let mut column = vec![0.0; n];
        match slot {
            Slot::Reading => (0..n).for_each(|row| column[row] = d[self.linear.reading[row]]),
            Slot::Before(j) | Slot::After(j) => {
                let blocks =
                    if matches!(slot, Slot::Before(_)) { &self.linear.before } else { &self.linear.carried };
                for (k, x) in d.iter().enumerate().filter(|(_, x)| **x != 0.0) {
                    let part = blocks.column(6 * j + k);
                    column.iter_mut().zip(part.iter()).for_each(|(sum, b)| *sum += x * b);
                }
            }
        }
        let column = Arc::new(column);
        if let Ok(mut map) = self.columns.lock() {
            map.insert(key, column.clone());
        }
        column
    }

    /// A feature at every sample.
    fn feature(&self, candidate: &Candidate, feature: usize, parameters: &[f64]) -> Vec<f64> {
        candidate.features[feature].over(&self.linear.samples, parameters)
    }

    /// Whitened columns of a candidate, one per coefficient, times the size usual on machines; `None` if a feature is not there.
    pub fn of(&self, candidate: &Candidate, parameters: &[f64]) -> Option<DMatrix<f64>> {
        let mut raw = self.raw(candidate, parameters)?;
        self.whiten(&mut raw);
        Some(raw)
    }

    /// The same before whitening, m and rad.
    pub fn raw(&self, candidate: &Candidate, parameters: &[f64]) -> Option<DMatrix<f64>> {
        self.raw_with_units(candidate, parameters, &self.units(candidate, parameters))
    }

    /// The same, each column times a unit of its own.
    pub fn raw_with_units(
        &self,
        candidate: &Candidate,
        parameters: &[f64],
        units: &[f64],
    ) -> Option<DMatrix<f64>> {
        let features: Vec<Vec<f64>> =
            (0..candidate.features.len()).map(|f| self.feature(candidate, f, parameters)).collect();
        if features.iter().any(|f| f.iter().any(|x| !x.is_finite())) {
            return None;
        }
        let mut out = DMatrix::zeros(self.linear.residual.len(), candidate.coefficients.len());
        for (c, coefficient) in candidate.coefficients.iter().enumerate() {
            let mut column = out.column_mut(c);
            let column = column.as_mut_slice();
            for part in &coefficient.parts {
                let (answer, feature) = (self.answer(part.slot, part.direction), &features[part.feature]);
                for (row, x) in column.iter_mut().enumerate() {
                    *x += answer[row] * feature[self.linear.sample[row]];
                }
            }
            column.iter_mut().for_each(|x| *x *= units[c]);
        }
        Some(out)
    }

    /// What each coefficient is scaled by: the usual size over the root mean square of its feature.
    pub fn units(&self, candidate: &Candidate, parameters: &[f64]) -> Vec<f64> {
        let features: Vec<Vec<f64>> =
            (0..candidate.features.len()).map(|f| self.feature(candidate, f, parameters)).collect();
        candidate.coefficients.iter().map(|c| unit_size(c, &features)).collect()
    }

    /// The best of a candidate over its grid. `heat`: by how much chance is larger than the noise says.
    pub fn score(&self, candidate: &Candidate, field: &Field, heat: f64) -> Option<Score> {
        if candidate.coefficients.is_empty() {
            return None;
        }
        let lengths = lengths(candidate);
        let mut table: Vec<Option<Best>> = vec![None; candidate.grid.len()];
        // Coarsely over the whole grid, finely at the best points.
        let coarse = self.coarse.size > 1 && candidate.grid.len() > 2;
        let harmonics =
            if candidate.grid.len() > HARMONICS { self.harmonics(candidate, field) } else { None };
        let mut promising: Vec<usize> = (0..candidate.grid.len()).collect();
        if let Some(gains) = harmonics {
            // Far from a line there is next to nothing: evidence of no gain.
            promising = peaks(&gains);
            let none = -(candidate.coefficients.len() as f64);
            table.iter_mut().zip(&gains).for_each(|(best, gain)| {
                *best = Some(Best { evidence: 0.5 * gain / heat + none, length: lengths[0], gain: *gain });
            });
            promising.iter().for_each(|i| table[*i] = None);
        } else if coarse && self.is_smooth(candidate) {
            let all: Vec<usize> = promising;
            self.table(candidate, field, true, &lengths, heat, &all, &mut table);
            let gains: Vec<f64> =
                table.iter().map(|b| b.as_ref().map_or(f64::NEG_INFINITY, |b| b.evidence)).collect();
            promising = peaks(&gains);
        }
        self.table(candidate, field, false, &lengths, heat, &promising, &mut table);
        let fine = promising.iter().filter_map(|i| Some((*i, table[*i].clone()?)));
        let (at, best) = fine.max_by(|a, b| a.1.evidence.total_cmp(&b.1.evidence))?;
        let all: Vec<f64> = table.iter().flatten().map(|b| b.evidence).collect();
        // What could not be built counts as tried.
        let tried = (all.len() as f64 / table.len() as f64).ln();
        Some(Score {
            evidence: log_mean_exp(&all) + tried,
            at_best: best.evidence,
            parameters: candidate.grid[at].clone(),
            coefficients: best.length,
            gain: best.gain,
        })
    }

    /// Evidence at a single point, finely.
    pub fn score_at(
        &self,
        candidate: &Candidate,
        parameters: &[f64],
        field: &Field,
        heat: f64,
    ) -> Option<Score> {
        let single = Candidate { grid: vec![parameters.to_vec()], ..candidate.clone() };
        self.score(&single, field, heat)
    }

    /// Fills the table at these points of the grid.
    #[allow(clippy::too_many_arguments)]
    fn table(
        &self,
        candidate: &Candidate,
        field: &Field,
        coarse: bool,
        lengths: &[usize],
        heat: f64,
        points: &[usize],
        table: &mut [Option<Best>],
    ) {
        let k = candidate.coefficients.len();
        let (space, left) =
            if coarse { (&field.coarse_space, &field.coarse_left) } else { (&field.space, &field.left) };
        for batch in points.chunks((BATCH / k).max(1)) {
            let mut joined = DMatrix::zeros(left.len(), k * batch.len());
            let mut built = Vec::new();
            for i in batch {
                let columns = match coarse {
                    true => self.coarse_of(candidate, &candidate.grid[*i]),
                    false => self.of(candidate, &candidate.grid[*i]),
                };
                if let Some(columns) = columns {
                    joined.columns_mut(built.len() * k, k).copy_from(&columns);
                    built.push(*i);
                }
            }
            let joined = joined.columns(0, k * built.len()).into_owned();
            let along = space.along(&joined);
            let toward = joined.tr_mul(left);
            for (b, i) in built.iter().enumerate() {
                let (own, columns) = (along.columns(b * k, k), joined.columns(b * k, k));
                let gram = columns.tr_mul(&columns) - own.tr_mul(&own);
                let g = toward.rows(b * k, k).into_owned();
                let all: Vec<(f64, f64)> =
                    lengths.iter().map(|length| evidence(&gram, &g, *length, heat)).collect();
                let values: Vec<f64> = all.iter().map(|(evidence, _)| *evidence).collect();
                let best = (0..all.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0);
                table[*i] =
                    Some(Best { evidence: log_mean_exp(&values), length: lengths[best], gain: all[best].1 });
            }
        }
    }

    /// Whether the features change little within a block, at both ends of the grid.
    fn is_smooth(&self, candidate: &Candidate) -> bool {
        let ends = [candidate.grid.first(), candidate.grid.last()];
        ends.into_iter().flatten().all(|point| {
            (0..candidate.features.len()).all(|f| {
                let column = self.feature(candidate, f, point);
                let (mut off, mut all) = (0.0, 0.0);
                for (k, x) in column.iter().enumerate() {
                    off += (x - column[self.coarse.middle[k]]).powi(2);
                    all += x * x;
                }
                off <= ROUGH * ROUGH * all
            })
        })
    }

    /// Whitened columns over coarse rows.
    fn coarse_of(&self, candidate: &Candidate, parameters: &[f64]) -> Option<DMatrix<f64>> {
        let features: Vec<Vec<f64>> =
            candidate.features.iter().map(|f| f.over(&self.coarse.samples, parameters)).collect();
        if !features.iter().all(|f| f.iter().all(|x| x.is_finite())) {
            return None;
        }
        let mut out = DMatrix::zeros(self.coarse.weight.len(), candidate.coefficients.len());
        for (c, coefficient) in candidate.coefficients.iter().enumerate() {
            let unit = unit_size(coefficient, &features);
            let mut column = out.column_mut(c);
            let column = column.as_mut_slice();
            for part in &coefficient.parts {
                let answer = self.coarse_answer(part.slot, part.direction);
                let feature = &features[part.feature];
                for (row, x) in column.iter_mut().enumerate() {
                    *x += answer[row] * feature[self.coarse.sample[row]] * unit;
                }
            }
        }
        Some(out)
    }

    fn coarse_answer(&self, slot: Slot, direction: Twist<f64>) -> Arc<Vec<f64>> {
        let key = key(slot, direction);
        if let Some(known) = self.coarse_columns.lock().ok().and_then(|map| map.get(&key).cloned()) {
            return known;
        }
        let fine = self.answer(slot, direction);
        let mut white = vec![0.0; fine.len()];
        self.whitener.apply(&fine, &mut white);
        let column = Arc::new(self.coarse.reduce(&white));
        if let Ok(mut map) = self.coarse_columns.lock() {
            map.insert(key, column.clone());
        }
        column
    }

    /// Energy that a pair of sine and cosine of one phase takes away, at every point of the grid, as if it had nothing in common with
    /// the space; `None` if the features are no such pair, or the phase is no multiple of one column.
    fn harmonics(&self, candidate: &Candidate, field: &Field) -> Option<Vec<f64>> {
        let samples = &self.linear.samples;
        let (first, last) = (candidate.grid.first()?, candidate.grid.last()?);
        let dual = self.whitener.transposed(field.left.as_slice());
        let mut gains = vec![0.0; candidate.grid.len()];
        if candidate.features.len() % 2 == 1 || candidate.features.is_empty() {
            return None;
        }
        for (pair, features) in candidate.features.chunks_exact(2).enumerate() {
            let ((_, phase), (_, other)) = (features[0].wave()?, features[1].wave()?);
            if phase != other {
                return None;
            }
            let x = phase.over(samples, first);
            let reference = (0..x.len()).max_by(|a, b| x[*a].abs().total_cmp(&x[*b].abs()))?;
            let at_last = phase.over(samples, last);
            let factor = at_last[reference] / x[reference];
            let straight = |k: usize| (at_last[k] - factor * x[k]).abs() <= 1e-9 * at_last[reference].abs();
            if !(factor.is_finite() && (0..x.len()).all(straight)) {
                return None;
            }
            // The phase at one sample tells the factor at every point.
            let spans = &self.linear.spans;
            let s = spans.iter().position(|span| (span.samples.0..span.samples.1).contains(&reference))?;
            let one = [samples[s].chosen(&[reference - spans[s].samples.0])];
            let factors: Vec<f64> = (candidate.grid.iter())
                .map(|point| phase.over(&one, point).first().map_or(f64::NAN, |phase| phase / x[reference]))
                .collect();
            let largest = factors.iter().fold(0.0, |most: f64, f| most.max(f.abs()));
            for coefficient in candidate.coefficients.iter().filter(|c| c.order == 2 * pair) {
                let mut weights = vec![0.0; x.len()];
                let mut energy = 0.0;
                let mut white = vec![0.0; dual.len()];
                for part in &coefficient.parts {
                    let answer = self.answer(part.slot, part.direction);
                    answer.iter().zip(&dual).enumerate().for_each(|(row, (a, d))| {
                        weights[self.linear.sample[row]] += a * d;
                    });
                    self.whitener.plain(&answer, &mut white);
                    energy += white.iter().map(|x| x * x).sum::<f64>();
                }
                if energy <= 0.0 {
                    continue;
                }
                let spectrum = Spectrum::new(&x, &weights, largest)?;
                factors
                    .iter()
                    .zip(&mut gains)
                    .for_each(|(f, gain)| *gain += spectrum.power(*f) / (0.5 * energy));
            }
        }
        Some(gains)
    }
}

/// Candidate at one point of its grid.
#[derive(Clone, Debug)]
struct Best {
    evidence: f64,
    length: usize,
    gain: f64,
}

/// A feature whose root mean square changes by less than this part within a block counts as smooth.
const ROUGH: f64 = 0.2;
/// Grids larger than this are screened by a spectrum, where the features are sines.
const HARMONICS: usize = 64;
/// Best points that are looked at finely.
const FINE: usize = 6;

/// The highest local maxima.
fn peaks(values: &[f64]) -> Vec<usize> {
    let at = |i: usize| values[i];
    let mut peaks: Vec<usize> = (0..values.len())
        .filter(|i| (*i == 0 || at(*i) >= at(i - 1)) && (i + 1 == values.len() || at(*i) >= at(i + 1)))
        .collect();
    peaks.sort_by(|a, b| at(*b).total_cmp(&at(*a)));
    peaks.truncate(FINE);
    peaks
}

fn key(slot: Slot, direction: Twist<f64>) -> Key {
    let d = direction.to_array().map(f64::to_bits);
    match slot {
        Slot::Before(j) => (0, j, d),
        Slot::After(j) => (1, j, d),
        Slot::Reading => (2, 0, d),
    }
}

/// The usual size over the root mean square of the first part's feature.
fn unit_size(coefficient: &crate::effects::Coefficient, features: &[Vec<f64>]) -> f64 {
    let Some(part) = coefficient.parts.first() else { return 0.0 };
    let feature = &features[part.feature];
    let rms = (feature.iter().map(|x| x * x).sum::<f64>() / feature.len().max(1) as f64).sqrt();
    if rms > 0.0 { coefficient.size / rms } else { 0.0 }
}

/// How many coefficients may take part: all, or those of the first features from `least` on.
fn lengths(candidate: &Candidate) -> Vec<usize> {
    let last = candidate.coefficients.iter().map(|c| c.order + 1).max().unwrap_or(0);
    (candidate.least.max(1)..=last.max(candidate.least.max(1)))
        .map(|orders| candidate.coefficients.iter().filter(|c| c.order < orders).count())
        .collect()
}

/// Logarithm of the evidence of the first `length` columns, whose coefficients are normal with the sizes usual on machines, and half
/// the energy that they take away.
fn evidence(gram: &DMatrix<f64>, g: &DVector<f64>, length: usize, heat: f64) -> (f64, f64) {
    let (gram, g) = (gram.view((0, 0), (length, length)), g.rows(0, length));
    let mut gain = 0.0;
    let logs = SIZES.map(|size| {
        let s2 = size * size / heat;
        let mut inner = gram * s2;
        (0..length).for_each(|i| inner[(i, i)] += 1.0);
        let Some(cholesky) = Cholesky::new(inner) else { return f64::NEG_INFINITY };
        let solved = cholesky.solve(&g.into_owned()) * s2;
        let explained = 0.5 * g.dot(&solved) / heat;
        gain = f64::max(gain, explained * heat);
        let log_det: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        explained - log_det
    });
    (log_mean_exp(&logs), gain)
}

/// `ln` of the mean of exponentials.
pub(super) fn log_mean_exp(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !most.is_finite() {
        return f64::NEG_INFINITY;
    }
    most + (logs.iter().map(|l| (l - most).exp()).sum::<f64>() / logs.len() as f64).ln()
}
