//! How well a candidate explains what is left: its evidence against chance, over its whole grid, `docs/diagnosis-method.md` (63) to (64).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock};

use nalgebra::{DMatrix, DVector};

use super::cells::CellSums;
use super::coarse::{Coarse, OnLevel};
use super::drives::Drives;
use super::equations::{
    BATCH, Best, Column, Equations, Key, ROOM, Score, best, judge, key, lengths, unit_size,
};
use super::evidence::{log_mean_exp, rarity, sizes_up_to};
use super::linear::Linear;
use super::marginal::Marginal;
use super::past::Pasts;
use super::terms::joined;
use super::whitener::Whitener;
use crate::effects::{Candidate, Place};
use crate::lie::Twist;
use crate::variation::Slot;

/// Rows of the recordings and what turns them white.
pub(super) struct Rows<'a> {
    pub linear: &'a Linear,
    drives: &'a Drives,
    pub whitener: Whitener,
    /// Whitened residuals of the constant model.
    pub residual: DVector<f64>,
    /// Samples put together in blocks, for features that change little within one.
    pub(super) coarse: &'a Coarse,
    columns: Mutex<HashMap<Key, Column>>,
    pub(super) coarse_columns: Mutex<HashMap<(usize, Key), Column>>,
    /// Energies of a candidate's pairs of features times an answer.
    pub(super) energies: Mutex<HashMap<(usize, usize, Key), Column>>,
    /// Whitened answers, and products of two of them summed over cells.
    white: Mutex<HashMap<Key, Column>>,
    pub(super) cell_energies: Mutex<HashMap<(usize, Key, Key), Column>>,
}

/// What all candidates are judged against: the marginal, and the residuals beside it, fine and coarse.
pub(super) struct Field {
    pub marginal: Arc<Marginal>,
    /// `M r`.
    pub left: DVector<f64>,
    /// Marginal and residuals on the blocks of each level, once they have been asked for.
    pub(super) coarse: Vec<OnceLock<(Marginal, DVector<f64>)>>,
    /// Sums of answers over cells, once they have been asked for.
    pub(super) cells: Mutex<HashMap<(usize, Key), Arc<CellSums>>>,
    /// The residuals, whitened once more by the transposed, once they have been asked for.
    pub(super) dual: OnceLock<Vec<f64>>,
    /// What all effects of a history at a joint have, by their directions.
    pub(super) pasts: Mutex<Pasts>,
}

impl<'a> Rows<'a> {
    pub fn new(linear: &'a Linear, drives: &'a Drives, coarse: &'a Coarse, whitener: Whitener) -> Self {
        let mut residual = DVector::zeros(linear.residual.len());
        whitener.apply(&linear.residual, residual.as_mut_slice());
        Rows {
            linear,
            drives,
            whitener,
            residual,
            coarse,
            columns: Mutex::default(),
            coarse_columns: Mutex::default(),
            energies: Mutex::default(),
            white: Mutex::default(),
            cell_energies: Mutex::default(),
        }
    }

    /// What candidates are judged against beside a marginal.
    pub fn field(&self, marginal: impl Into<Arc<Marginal>>) -> Field {
        let marginal = marginal.into();
        let left = marginal.apply(&self.residual);
        let coarse = self.coarse.levels().iter().map(|_| OnceLock::new()).collect();
        Field {
            marginal,
            left,
            coarse,
            cells: Mutex::default(),
            dual: OnceLock::new(),
            pasts: Mutex::default(),
        }
    }

    /// Columns of what every model has, m and rad: everything constant, and behind it how drives give way that no name stands for.
    pub fn always(&self, is_named: impl Fn(&str, Place) -> bool) -> DMatrix<f64> {
        joined(self.linear.constant.clone(), &self.drives.beside(is_named))
    }

    /// The same, marginalised.
    pub fn base(&self) -> Marginal {
        self.base_but(|_, _| false)
    }

    /// The same but for drives that a name stands for.
    pub fn base_but(&self, is_named: impl Fn(&str, Place) -> bool) -> Marginal {
        let mut columns = self.always(is_named);
        self.whiten(&mut columns);
        Marginal::new(columns)
    }

    /// The same rows where only what is asked for gives way.
    pub fn with(&self, drives: &'a Drives) -> Rows<'a> {
        Rows::new(self.linear, drives, self.coarse, self.whitener.clone())
    }

    /// How drives give way.
    pub fn drives(&self) -> &'a Drives {
        self.drives
    }

    pub fn whiten(&self, columns: &mut DMatrix<f64>) {
        self.whitener.apply_all(columns);
    }

    /// How the readings answer to a twist in a slot, not whitened.
    pub(super) fn answer(&self, slot: Slot, direction: Twist<f64>) -> Arc<Vec<f64>> {
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

    /// How the readings answer to a twist in a slot, whitened.
    pub(super) fn white_answer(&self, slot: Slot, direction: Twist<f64>) -> Column {
        let key = key(slot, direction);
        if let Some(known) = self.white.lock().ok().and_then(|map| map.get(&key).cloned()) {
            return known;
        }
        let plain = self.answer(slot, direction);
        let mut white = vec![0.0; plain.len()];
        self.whitener.apply(&plain, &mut white);
        let white = Arc::new(white);
        if let Ok(mut map) = self.white.lock() {
            map.insert(key, white.clone());
        }
        white
    }

    /// Whitened columns of a candidate, one per coefficient, times the size usual on machines; `None` if a feature is not there.
    pub fn of(&self, candidate: &Candidate, parameters: &[f64]) -> Option<DMatrix<f64>> {
        let mut raw = self.raw(candidate, parameters)?;
        self.whiten(&mut raw);
        Some(raw)
    }

    /// The same before whitening, m and rad.
    pub fn raw(&self, candidate: &Candidate, parameters: &[f64]) -> Option<DMatrix<f64>> {
        let features = self.features(candidate, parameters)?;
        let units: Vec<f64> = candidate.coefficients.iter().map(|c| unit_size(c, &features)).collect();
        Some(self.columns_of(candidate, &features, &units))
    }

    /// The same with the features of other samples, this part of each recording away.
    pub fn raw_elsewhere(
        &self,
        candidate: &Candidate,
        parameters: &[f64],
        part: f64,
    ) -> Option<DMatrix<f64>> {
        let mut features = self.features(candidate, parameters)?;
        let units: Vec<f64> = candidate.coefficients.iter().map(|c| unit_size(c, &features)).collect();
        for feature in &mut features {
            for span in &self.linear.spans {
                let own = &mut feature[span.samples.0..span.samples.1];
                own.rotate_left((part * own.len() as f64) as usize);
            }
        }
        Some(self.columns_of(candidate, &features, &units))
    }

    /// Derivatives of its columns by each of its parameters, from dual numbers, each column times a unit of its own; m and rad.
    pub fn slopes(&self, candidate: &Candidate, parameters: &[f64], units: &[f64]) -> Vec<DMatrix<f64>> {
        let all: Vec<Vec<Vec<f64>>> = (candidate.features.iter())
            .map(|feature| feature.with_derivatives(&self.linear.samples, parameters).1)
            .collect();
        let by = |p: usize| all.iter().map(|by| by[p].clone()).collect::<Vec<_>>();
        (0..parameters.len()).map(|p| self.columns_of(candidate, &by(p), units)).collect()
    }

    /// Every feature at every sample; `None` if one is not there.
    fn features(&self, candidate: &Candidate, parameters: &[f64]) -> Option<Vec<Vec<f64>>> {
        let features = candidate.over(&self.linear.samples, parameters);
        features.iter().all(|f| f.iter().all(|x| x.is_finite())).then_some(features)
    }

    fn columns_of(&self, candidate: &Candidate, features: &[Vec<f64>], units: &[f64]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.linear.residual.len(), candidate.coefficients.len());
        for (c, coefficient) in candidate.coefficients.iter().enumerate() {
            let mut column = out.column_mut(c);
            let column = column.as_mut_slice();
            for part in &coefficient.parts {
                let (answer, feature) = (self.answer(part.slot, part.direction), &features[part.feature]);
                for ((x, answer), sample) in column.iter_mut().zip(answer.iter()).zip(&self.linear.sample) {
                    *x += units[c] * answer * feature[*sample];
                }
            }
        }
        out
    }

    /// What each coefficient is scaled by: the usual size over the root mean square of its feature.
    pub fn units(&self, candidate: &Candidate, parameters: &[f64]) -> Vec<f64> {
        let features = self.features(candidate, parameters).unwrap_or_default();
        candidate
            .coefficients
            .iter()
            .map(|c| if features.is_empty() { 0.0 } else { unit_size(c, &features) })
            .collect()
    }

    /// How many sizes beyond the usual one are usual too.
    pub(super) fn usual_sizes(&self, candidate: &Candidate, grid: &[Vec<f64>]) -> usize {
        let (Some(to), Some(at)) = (candidate.usual_to, grid.first()) else { return 0 };
        let unit = self.units(candidate, at).first().copied().filter(|unit| *unit > 0.0);
        unit.map_or(0, |unit| sizes_up_to(to / unit))
    }

    /// Logarithm of how rare its size is, 0 for one that is usual.
    pub fn rarity(&self, candidate: &Candidate, score: &Score) -> f64 {
        let usual = self.usual_sizes(candidate, std::slice::from_ref(&score.parameters));
        rarity(sizes_up_to(score.times_usual()), usual)
    }

    /// The best of candidate `i` over its grid, on blocks where that does. `overdispersion`: by how much chance is larger than the noise says.
    pub fn screen(
        &self,
        i: usize,
        candidate: &Candidate,
        field: &Field,
        overdispersion: f64,
    ) -> Option<Score> {
        let (i, lengths) = (self.coarse.first_alike(i), lengths(candidate));
        let all: Vec<usize> = (0..candidate.grid.len()).collect();
        let mut table: Vec<Option<Best>> = vec![None; all.len()];
        if candidate.coefficients.is_empty() {
            return None;
        }
        if all.len() > WAVES
            && let Some(gains) = self.harmonics(i, candidate, field)
        {
            // Far from a line there is next to nothing: evidence of no gain.
            let none = -(candidate.coefficients.len() as f64);
            let peaks = peaks(&gains);
            self.table(candidate, &candidate.grid, field, None, overdispersion, &peaks, &mut table);
            // What waves have in common with the marginal, and sizes that are not usual, take as much from those that are not looked at.
            let exact = peaks.iter().filter_map(|i| Some(table[*i].as_ref()?.gain));
            let rough = peaks.iter().map(|i| 0.5 * gains[*i]).fold(0.0, f64::max);
            let part = (exact.fold(0.0, f64::max) / rough.max(1e-300)).min(1.0);
            for (best, gain) in table.iter_mut().zip(&gains).filter(|(best, _)| best.is_none()) {
                let gain = 0.5 * part * gain;
                let evidence = gain / overdispersion + none;
                *best = Some(Best { evidence, length: lengths[0], gain, room: ROOM, is_faint: false });
            }
            let mut summary = summary(&candidate.grid, &table, &peaks)?;
            let nearly =
                |i: &&usize| table[**i].as_ref().is_some_and(|b| b.evidence > NEARLY * summary.at_best);
            let also = peaks.iter().filter(nearly).map(|i| candidate.grid[*i].clone());
            summary.also = also.filter(|at| *at != summary.parameters).collect();
            return Some(summary);
        }
        let remembers = self.whitener.remembers();
        // Rows that remember belong to their neighbours in time.
        let in_cells = (!remembers).then(|| self.coarse.cells.features(i, candidate, self.linear)).flatten();
        let kept = match in_cells {
            Some(kept) => {
                self.cell_table(candidate, field, kept, overdispersion, &all, &mut table);
                None
            }
            None => {
                let kept = self.coarse.features(i, candidate, &self.linear.samples);
                self.table(candidate, &candidate.grid, field, kept, overdispersion, &all, &mut table);
                kept
            }
        };
        let mut rough = summary(&candidate.grid, &table, &all)?;
        let halves = candidate.grid.iter().filter(|at| candidate.is_half(at, &rough.parameters)).cloned();
        rough.also = halves.collect();
        if kept.is_none() && in_cells.is_none() {
            return Some(rough);
        }
        let best =
            candidate.grid.iter().position(|at| *at == rough.parameters).and_then(|i| table[i].as_ref());
        let is_faint = best.is_some_and(|best| best.is_faint);
        let is_nothing = rough.at_best <= 0.0 && !candidate.jumps();
        if !is_faint && (is_nothing || !remembers && in_cells.is_none()) {
            return Some(rough);
        }
        // White rows of noise that remembers are differences: what jumps is in a single one, and drowns in its block.
        let evidence: Vec<f64> =
            table.iter().map(|best| best.as_ref().map_or(f64::NEG_INFINITY, |best| best.evidence)).collect();
        let looked_at: Vec<Vec<f64>> = match candidate.jumps() {
            true => peaks(&evidence).into_iter().map(|i| candidate.grid[i].clone()).collect(),
            false => vec![rough.parameters.clone()],
        };
        let fine = looked_at.iter().filter_map(|at| self.score_at(candidate, at, field, overdispersion));
        let fine = fine.max_by(|a, b| a.at_best.total_cmp(&b.at_best))?;
        Some(Score { evidence: rough.evidence + fine.at_best - rough.at_best, also: rough.also, ..fine })
    }

    /// Evidence at a single point, finely.
    pub fn score_at(
        &self,
        candidate: &Candidate,
        parameters: &[f64],
        field: &Field,
        overdispersion: f64,
    ) -> Option<Score> {
        let grid = [parameters.to_vec()];
        let mut table = vec![None];
        self.table(candidate, &grid, field, None, overdispersion, &[0], &mut table);
        summary(&grid, &table, &[0])
    }

    /// The same from the normal equations of its columns.
    pub fn score_by(
        &self,
        candidate: &Candidate,
        parameters: &[f64],
        equations: &Equations,
        overdispersion: f64,
    ) -> Score {
        let usual = self.usual_sizes(candidate, &[parameters.to_vec()]);
        best(candidate, parameters, &lengths(candidate), equations, overdispersion, usual).at(parameters)
    }

    /// Fills the table at these points of the grid, on blocks where `kept` features are given.
    #[allow(clippy::too_many_arguments)]
    fn table(
        &self,
        candidate: &Candidate,
        grid: &[Vec<f64>],
        field: &Field,
        kept: Option<&OnLevel>,
        overdispersion: f64,
        points: &[usize],
        table: &mut [Option<Best>],
    ) {
        let (k, lengths) = (candidate.coefficients.len(), lengths(candidate));
        if let Some(kept) = kept {
            return match &kept.groups {
                Some(groups) => {
                    self.group_table(candidate, field, (kept.level, groups), overdispersion, points, table)
                }
                None => {
                    let on = (kept.level, &kept.features);
                    self.coarse_table(candidate, grid, field, on, overdispersion, points, table)
                }
            };
        }
        let (marginal, left) = (&*field.marginal, &field.left);
        let usual = self.usual_sizes(candidate, grid);
        for batch in points.chunks((BATCH / (k * left.len()).max(1)).max(1)) {
            let mut joined = DMatrix::zeros(left.len(), k * batch.len());
            let mut built = Vec::new();
            for i in batch {
                let at = built.len() * k;
                if let Some(columns) = self.raw(candidate, &grid[*i]) {
                    joined.columns_mut(at, k).copy_from(&columns);
                    built.push(*i);
                }
            }
            self.whiten(&mut joined);
            judge((&joined, k), marginal, left, &built, &mut |i, equations| {
                table[i] = Some(best(candidate, &grid[i], &lengths, equations, overdispersion, usual));
            });
        }
    }
}

/// Grids larger than this are screened by a spectrum, where the features are sines.
const WAVES: usize = 64;
/// Best points that are looked at finely.
const FINE: usize = 6;
/// Of those, the ones with this part of the best one's evidence may be better once they are refined.
const NEARLY: f64 = 0.7;

/// The best of these points, and the evidence of all.
fn summary(grid: &[Vec<f64>], table: &[Option<Best>], points: &[usize]) -> Option<Score> {
    let built = points.iter().filter_map(|i| Some((*i, table[*i].as_ref()?)));
    let (at, best) = built.max_by(|a, b| a.1.evidence.total_cmp(&b.1.evidence))?;
    let all: Vec<f64> = table.iter().flatten().map(|b| b.evidence).collect();
    // What could not be built counts as tried.
    let tried = (all.len() as f64 / table.len() as f64).ln();
    Some(Score {
        evidence: log_mean_exp(&all) + tried,
        at_best: best.evidence,
        parameters: grid[at].clone(),
        also: Vec::new(),
        coefficients: best.length,
        gain: best.gain,
        room: best.room,
    })
}

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
