//! Candidates judged on sums over cells: functions of where one or two joints stand, however many samples there are.

use std::ops::AddAssign;
use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView};
use pulp::Arch;

use super::cells::{CellSums, InCells, answers};
use super::equations::{BATCH, Best, Column, Equations, Key, best, key, lengths};
use super::features::{AtPoint, Features, Groups};
use super::marginal::Marginal;
use super::panel::{Panel, WIDTH, add_along};
use super::score::{Field, Rows};
use crate::effects::{Candidate, Coefficient};
use crate::variation::Part;

/// Cells on which products of several coefficients are summed one by one.
const FEW: usize = 64;

/// Features of one point times one answer: the coefficients that have it, and their features in units of each, over the cells where they act.
struct Answered {
    coefficients: Vec<usize>,
    columns: DMatrix<f64>,
}

/// How rows answer to a part of a coefficient, whitened.
type White<'a> = dyn Fn(&Part<usize>) -> Column + 'a;

/// Rows that are summed over cells.
struct Ground<'a> {
    /// What tells it from others.
    name: usize,
    /// Cell of each row.
    cell: &'a dyn Fn() -> Vec<usize>,
    /// How many cells there are.
    cells: usize,
    marginal: &'a Marginal,
    /// What that leaves of the residuals.
    left: &'a [f64],
}

impl Rows<'_> {
    /// Fills the table at these points of the grid by sums over cells.
    pub(super) fn cell_table(
        &self,
        candidate: &Candidate,
        field: &Field,
        (cells, kept): &InCells,
        overdispersion: f64,
        points: &[usize],
        table: &mut [Option<Best>],
    ) {
        let on = Ground {
            name: Arc::as_ptr(cells) as usize,
            cell: &|| self.linear.sample.iter().map(|sample| cells.cell[*sample]).collect(),
            cells: cells.count.len(),
            marginal: &field.marginal,
            left: field.left.as_slice(),
        };
        let white = |part: &Part<usize>| self.white_answer(part.slot, part.direction);
        self.summed_table(candidate, field, (&on, &white, kept), overdispersion, points, table);
    }

    /// The same of groups of blocks that are alike.
    pub(super) fn group_table(
        &self,
        candidate: &Candidate,
        field: &Field,
        (number, groups): (usize, &Groups),
        overdispersion: f64,
        points: &[usize],
        table: &mut [Option<Best>],
    ) {
        let (level, (marginal, left)) = (&self.coarse.levels()[number], self.on_level(field, number));
        let on = Ground {
            name: std::ptr::from_ref(groups) as usize,
            cell: &|| level.sample.iter().map(|sample| groups.group[*sample]).collect(),
            cells: groups.features.samples(),
            marginal,
            left: left.as_slice(),
        };
        let white = |part: &Part<usize>| self.coarse_answer(number, part.slot, part.direction);
        self.summed_table(candidate, field, (&on, &white, &groups.features), overdispersion, points, table);
    }

    /// Fills the table at these points of the grid by sums over the cells of a ground. `white`: how its rows answer to a part.
    fn summed_table(
        &self,
        candidate: &Candidate,
        field: &Field,
        (on, white, kept): (&Ground, &White, &Features),
        overdispersion: f64,
        points: &[usize],
        table: &mut [Option<Best>],
    ) {
        let (grid, lengths) = (&candidate.grid, lengths(candidate));
        let usual = self.usual_sizes(candidate, grid);
        let (coefficients, keys) = (&candidate.coefficients, answers(candidate));
        let parts = || coefficients.iter().flat_map(|c| &c.parts);
        let answers = keys.iter().filter_map(|k| parts().find(|p| key(p.slot, p.direction) == *k));
        let white: Vec<Column> = answers.map(white).collect();
        let sums: Vec<Arc<CellSums>> =
            keys.iter().zip(&white).map(|(key, white)| cell_sums(on, *key, white, field)).collect();
        let energies: Vec<Vec<Column>> = (0..keys.len())
            .map(|a| {
                let with = |b: usize| self.cell_energies(on, (keys[a], keys[b]), (&white[a], &white[b]));
                (0..=a).map(with).collect()
            })
            .collect();
        // Points at which features act everywhere are multiplied together: what the marginal takes of several columns is had in one pass.
        let is_everywhere = |i: &usize| kept.at(*i).is_some_and(|f| f.runs.len() == 1 && f.part() == 1.0);
        let together = match keys.len() {
            1 => (BATCH / (coefficients.len() * on.cells).max(1)).max(1),
            _ => 1,
        };
        let (everywhere, somewhere): (Vec<usize>, Vec<usize>) =
            points.iter().partition(|i| together > 1 && is_everywhere(i));
        let mut few = Few::of(candidate, &keys);
        let mut many = Vec::new();
        for i in somewhere {
            let Some(features) = kept.at(i) else { continue };
            match few.as_mut().filter(|few| few.are(&features)) {
                Some(few) => {
                    let equations = few.equations(candidate, &features, &sums, &energies);
                    table[i] = Some(best(candidate, &grid[i], &lengths, &equations, overdispersion, usual));
                }
                None => many.push(i),
            }
        }
        for batch in everywhere.chunks(together).chain(many.chunks(1)) {
            let batch: Vec<(usize, AtPoint)> =
                batch.iter().filter_map(|i| Some((*i, kept.at(*i)?))).collect();
            let Some((_, first)) = batch.first() else { continue };
            let answered: Vec<Answered> =
                keys.iter().map(|key| Answered::of(candidate, *key, &batch)).collect();
            let products = Products::of(&answered, first.runs, &sums);
            for (b, (i, _)) in batch.iter().enumerate() {
                let equations = products.equations(&answered, first.runs, &energies, b, coefficients.len());
                table[*i] = Some(best(candidate, &grid[*i], &lengths, &equations, overdispersion, usual));
            }
        }
    }

    /// Products of two answers, summed over cells.
    fn cell_energies(&self, on: &Ground, keys: (Key, Key), white: (&[f64], &[f64])) -> Column {
        let name = (on.name, keys.0, keys.1);
        if let Some(known) = self.cell_energies.lock().ok().and_then(|map| map.get(&name).cloned()) {
            return known;
        }
        let mut sums = vec![0.0; on.cells];
        white.0.iter().zip(white.1).zip((on.cell)()).for_each(|((a, b), cell)| sums[cell] += a * b);
        let sums = Arc::new(sums);
        if let Ok(mut map) = self.cell_energies.lock() {
            map.insert(name, sums.clone());
        }
        sums
    }
}

/// Points at which features act on few cells, each coefficient by one answer: their sums take less time than memory for each of them would.
struct Few {
    /// The answer of each coefficient.
    answers: Vec<usize>,
    /// Features in units of each coefficient, over the cells where they act, one behind the other.
    columns: Vec<f64>,
    /// What the marginal takes of each coefficient, panel by panel.
    along: Vec<[f64; WIDTH]>,
}

impl Few {
    /// `keys`: the answers of the candidate; `None` where a coefficient has several.
    fn of(candidate: &Candidate, keys: &[Key]) -> Option<Self> {
        let answer = |coefficient: &Coefficient| match &coefficient.parts[..] {
            [part] => keys.iter().position(|k| *k == key(part.slot, part.direction)),
            _ => None,
        };
        let answers = candidate.coefficients.iter().map(answer).collect::<Option<_>>()?;
        Some(Few { answers, columns: Vec::new(), along: Vec::new() })
    }

    /// Whether features of a point act on so few cells; of a single coefficient any number are.
    fn are(&self, features: &AtPoint) -> bool {
        self.answers.len() == 1 || features.columns.first().is_some_and(|column| column.len() <= FEW)
    }

    fn equations(
        &mut self,
        candidate: &Candidate,
        features: &AtPoint,
        sums: &[Arc<CellSums>],
        energies: &[Vec<Column>],
    ) -> Equations {
        self.columns.clear();
        for coefficient in &candidate.coefficients {
            let (unit, feature) =
                (features.unit(coefficient), features.columns[coefficient.parts[0].feature]);
            self.columns.extend(feature.iter().map(|f| unit * f64::from(*f)));
        }
        self.summed(features.runs, sums, energies)
    }

    /// Normal equations of the columns over these runs of cells.
    fn summed(
        &mut self,
        runs: &[(usize, usize)],
        sums: &[Arc<CellSums>],
        energies: &[Vec<Column>],
    ) -> Equations {
        let Few { answers, columns, along } = self;
        let (count, rows) = (answers.len(), columns.len() / answers.len().max(1));
        let of = |c: usize| &columns[c * rows..(c + 1) * rows];
        along.clear();
        Arch::new().dispatch(|| {
            for (c, answer) in answers.iter().enumerate() {
                add_panels(&sums[*answer].along, runs, of(c), along);
            }
        });
        let panels = along.len() / count.max(1);
        let over = |values: &[f64], of: &dyn Fn(usize) -> f64| -> f64 {
            let cells = runs.iter().flat_map(|(first, count)| &values[*first..first + count]);
            cells.enumerate().map(|(row, x)| of(row) * x).sum()
        };
        let toward = DVector::from_fn(count, |c, _| {
            let own = of(c);
            over(&sums[answers[c]].toward, &|row| own[row])
        });
        let (mut own, mut gram) = (DMatrix::zeros(count, count), DMatrix::zeros(count, count));
        for c in 0..count {
            for d in 0..=c {
                let (one, other) = (of(c), of(d));
                let (a, b) = (answers[c].max(answers[d]), answers[c].min(answers[d]));
                let whole = over(&energies[a][b], &|row| one[row] * other[row]);
                let [first, second] = [c, d].map(|c| along[c * panels..(c + 1) * panels].as_flattened());
                let taken: f64 = first.iter().zip(second).map(|(x, y)| x * y).sum();
                (own[(c, d)], own[(d, c)]) = (whole, whole);
                (gram[(c, d)], gram[(d, c)]) = (whole - taken, whole - taken);
            }
        }
        Equations::new(own, gram, toward)
    }
}

/// Puts `Wᵀ c` of a column that is given over runs of cells behind what is there, panel by panel.
#[inline(always)]
fn add_panels(panels: &[Arc<Panel>], runs: &[(usize, usize)], column: &[f64], to: &mut Vec<[f64; WIDTH]>) {
    // A sum waits for the one before it, and others can be seen to meanwhile.
    let (fours, rest) = panels.as_chunks::<4>();
    for four in fours {
        to.extend(times(four, runs, column));
    }
    for panel in rest {
        to.extend(times(std::array::from_ref(panel), runs, column));
    }
}

#[inline(always)]
fn times<const P: usize>(
    panels: &[Arc<Panel>; P],
    runs: &[(usize, usize)],
    column: &[f64],
) -> [[f64; WIDTH]; P] {
    let (mut sums, mut at) = ([[0.0; WIDTH]; P], 0);
    for (first, count) in runs {
        let own = &column[at..at + count];
        let rows: [&[[f64; WIDTH]]; P] = std::array::from_fn(|p| &panels[p].rows()[*first..first + count]);
        for (k, x) in own.iter().enumerate() {
            for p in 0..P {
                for l in 0..WIDTH {
                    sums[p][l] += x * rows[p][k][l];
                }
            }
        }
        at += count;
    }
    sums
}

/// Sums of an answer over cells.
fn cell_sums(on: &Ground, key: Key, white: &[f64], field: &Field) -> Arc<CellSums> {
    let name = (on.name, key);
    if let Some(known) = field.cells.lock().ok().and_then(|map| map.get(&name).cloned()) {
        return known;
    }
    let (cell, mut toward) = ((on.cell)(), vec![0.0; on.cells]);
    white.iter().zip(on.left).zip(&cell).for_each(|((a, left), cell)| toward[*cell] += a * left);
    let along = on.marginal.gathered(white, &cell, on.cells);
    let sums = Arc::new(CellSums { along, toward });
    if let Ok(mut map) = field.cells.lock() {
        map.insert(name, sums.clone());
    }
    sums
}

impl Answered {
    /// Of points that have the same runs, one after the other.
    fn of(candidate: &Candidate, of: Key, batch: &[(usize, AtPoint)]) -> Self {
        let rows = batch[0].1.columns.first().map_or(0, |column| column.len());
        let is_own = |p: &&Part<usize>| key(p.slot, p.direction) == of;
        let own: Vec<(usize, &Coefficient)> = (candidate.coefficients.iter().enumerate())
            .filter(|(_, coefficient)| coefficient.parts.iter().any(|part| is_own(&part)))
            .collect();
        let mut columns: Vec<f64> = Vec::with_capacity(rows * own.len() * batch.len());
        for (_, features) in batch {
            for (_, coefficient) in &own {
                let unit = features.unit(coefficient);
                let from = columns.len();
                columns.resize(from + rows, 0.0);
                for part in coefficient.parts.iter().filter(is_own) {
                    let feature = features.columns[part.feature];
                    columns[from..].iter_mut().zip(feature).for_each(|(x, f)| *x += unit * f64::from(*f));
                }
            }
        }
        let coefficients: Vec<usize> = own.iter().map(|(c, _)| *c).collect();
        Answered { columns: DMatrix::from_vec(rows, coefficients.len() * batch.len(), columns), coefficients }
    }

    /// The columns of a point.
    fn at(&self, point: usize) -> DMatrixView<'_, f64> {
        let count = self.coefficients.len();
        self.columns.columns(point * count, count)
    }
}

/// What the marginal and the residuals have in common with the columns of each answer.
struct Products {
    along: Vec<DMatrix<f64>>,
    toward: Vec<DVector<f64>>,
}

impl Products {
    fn of(answered: &[Answered], runs: &[(usize, usize)], sums: &[Arc<CellSums>]) -> Self {
        let mut products = Products { along: Vec::new(), toward: Vec::new() };
        for (one, sums) in answered.iter().zip(sums) {
            let count = one.columns.ncols();
            let (mut along, mut toward) =
                (DMatrix::zeros(sums.along.len() * WIDTH, count), DVector::zeros(count));
            let mut at = 0;
            for (first, rows) in runs {
                let part = one.columns.rows(at, *rows);
                add_along(&sums.along, *first, &part, &mut along);
                toward += part.tr_mul(&DVectorView::from_slice(&sums.toward[*first..first + rows], *rows));
                at += rows;
            }
            products.along.push(along);
            products.toward.push(toward);
        }
        products
    }

    /// Normal equations of the coefficients of one point.
    fn equations(
        &self,
        answered: &[Answered],
        runs: &[(usize, usize)],
        energies: &[Vec<Column>],
        point: usize,
        coefficients: usize,
    ) -> Equations {
        let width = self.along.first().map_or(0, DMatrix::nrows);
        let mut own = DMatrix::zeros(coefficients, coefficients);
        let (mut taken, mut toward) = (DMatrix::zeros(width, coefficients), DVector::zeros(coefficients));
        for (a, one) in answered.iter().enumerate() {
            let from = point * one.coefficients.len();
            for (k, c) in one.coefficients.iter().enumerate() {
                taken.column_mut(*c).add_assign(&self.along[a].column(from + k));
                toward[*c] += self.toward[a][from + k];
            }
            for (b, other) in answered[..=a].iter().enumerate() {
                let energy = || runs.iter().flat_map(|(first, rows)| &energies[a][b][*first..first + rows]);
                let mut weighted = other.at(point).into_owned();
                for mut column in weighted.column_iter_mut() {
                    column.iter_mut().zip(energy()).for_each(|(x, energy)| *x *= energy);
                }
                let products = one.at(point).tr_mul(&weighted);
                for (k, c) in one.coefficients.iter().enumerate() {
                    for (l, d) in other.coefficients.iter().enumerate() {
                        own[(*c, *d)] += products[(k, l)];
                        if a != b {
                            own[(*d, *c)] += products[(k, l)];
                        }
                    }
                }
            }
        }
        Equations::from_products(own, &taken, toward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Anything, but always the same.
    fn at(i: usize, j: usize) -> f64 {
        (0.37 * (i as f64 + 1.0) * (j as f64 + 2.0)).sin()
    }

    #[test]
    fn sums_over_cells_are_those_over_rows_where_features_are_alike_within_them() {
        // Two answers on 60 rows in 5 cells; one coefficient of the first, one of the second.
        let (rows, cells) = (60, 5);
        let cell: Vec<usize> = (0..rows).map(|row| (7 * row) % cells).collect();
        let answers = [0, 1].map(|a| (0..rows).map(|row| at(row, a)).collect::<Vec<f64>>());
        let features = [2, 3].map(|f| (0..cells).map(|c| at(c, f)).collect::<Vec<f64>>());
        let w = DMatrix::from_fn(rows, 37, |i, j| 0.1 * at(i, j + 5));
        let panels: Vec<Panel> = Panel::of_transposed(&[w.transpose()]);
        let left = DVector::from_fn(rows, |i, _| at(i, 20));
        let over = |values: &mut dyn Iterator<Item = f64>| {
            let mut sums = vec![0.0; cells];
            values.zip(&cell).for_each(|(x, cell)| sums[*cell] += x);
            sums
        };
        let sums = answers.each_ref().map(|answer| {
            Arc::new(CellSums {
                along: panels.iter().map(|panel| Arc::new(panel.gathered(answer, &cell, cells))).collect(),
                toward: over(&mut answer.iter().zip(&left).map(|(a, left)| a * left)),
            })
        });
        let energy =
            |a: usize, b: usize| Arc::new(over(&mut answers[a].iter().zip(&answers[b]).map(|(a, b)| a * b)));
        let energies = [vec![energy(0, 0)], vec![energy(1, 0), energy(1, 1)]];
        let answered = [0, 1].map(|a| Answered {
            coefficients: vec![a],
            columns: DMatrix::from_column_slice(cells, 1, &features[a]),
        });
        let runs = [(0, 2), (2, 3)];
        let equations = Products::of(&answered, &runs, &sums).equations(&answered, &runs, &energies, 0, 2);
        let columns = DMatrix::from_fn(rows, 2, |row, a| answers[a][row] * features[a][cell[row]]);
        let along = w.tr_mul(&columns);
        assert!((equations.gram - (columns.tr_mul(&columns) - along.tr_mul(&along))).amax() < 1e-12);
        assert!((equations.toward - columns.tr_mul(&left)).amax() < 1e-12);
        let mut few = Few { answers: vec![0, 1], columns: features.concat(), along: Vec::new() };
        let equations = few.summed(&runs, &sums, &energies);
        assert!((equations.gram - (columns.tr_mul(&columns) - along.tr_mul(&along))).amax() < 1e-12);
        assert!((equations.toward - columns.tr_mul(&left)).amax() < 1e-12);
    }
}
