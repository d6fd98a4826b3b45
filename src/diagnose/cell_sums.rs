//! Candidates judged on sums over cells: functions of where one or two joints stand, however many samples there are.

use std::ops::AddAssign;
use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView};

use super::cells::{CellSums, Cells, InCells, answers};
use super::equations::{BATCH, Best, Column, Equations, Key, best, key, lengths};
use super::features::AtPoint;
use super::panel::{WIDTH, add_along};
use super::score::{Field, Rows};
use crate::effects::{Candidate, Coefficient};
use crate::variation::Part;

/// Features of one point times one answer: the coefficients that have it, and their features in units of each, over the cells where they act.
struct Answered {
    coefficients: Vec<usize>,
    columns: DMatrix<f64>,
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
        let (grid, lengths) = (&candidate.grid, lengths(candidate));
        let usual = self.usual_sizes(candidate, grid);
        let (coefficients, keys) = (&candidate.coefficients, answers(candidate));
        let parts = || coefficients.iter().flat_map(|c| &c.parts);
        let white = keys.iter().filter_map(|k| parts().find(|p| key(p.slot, p.direction) == *k));
        let white: Vec<Column> = white.map(|part| self.white_answer(part.slot, part.direction)).collect();
        let sums: Vec<Arc<CellSums>> =
            keys.iter().zip(&white).map(|(key, white)| self.cell_sums(cells, *key, white, field)).collect();
        let energies: Vec<Vec<Column>> = (0..keys.len())
            .map(|a| {
                let with = |b: usize| self.cell_energies(cells, (keys[a], keys[b]), (&white[a], &white[b]));
                (0..=a).map(with).collect()
            })
            .collect();
        // Points at which features act everywhere are multiplied together: what the marginal takes of several columns is had in one pass.
        let is_everywhere = |i: &usize| kept.at(*i).is_some_and(|f| f.runs.len() == 1 && f.part() == 1.0);
        let together = match keys.len() {
            1 => (BATCH / (coefficients.len() * cells.count.len()).max(1)).max(1),
            _ => 1,
        };
        let (everywhere, somewhere): (Vec<usize>, Vec<usize>) =
            points.iter().partition(|i| together > 1 && is_everywhere(i));
        for batch in everywhere.chunks(together).chain(somewhere.chunks(1)) {
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

    /// Sums of an answer over cells.
    fn cell_sums(&self, cells: &Arc<Cells>, key: Key, white: &[f64], field: &Field) -> Arc<CellSums> {
        let name = (Arc::as_ptr(cells) as usize, key);
        if let Some(known) = field.cells.lock().ok().and_then(|map| map.get(&name).cloned()) {
            return known;
        }
        let cell: Vec<usize> = self.linear.sample.iter().map(|sample| cells.cell[*sample]).collect();
        let mut toward = vec![0.0; cells.count.len()];
        white.iter().zip(&field.left).zip(&cell).for_each(|((a, left), cell)| toward[*cell] += a * left);
        let along = field.marginal.gathered(white, &cell, cells.count.len());
        let sums = Arc::new(CellSums { along, toward });
        if let Ok(mut map) = field.cells.lock() {
            map.insert(name, sums.clone());
        }
        sums
    }

    /// Products of two answers, summed over cells.
    fn cell_energies(&self, cells: &Arc<Cells>, keys: (Key, Key), white: (&[f64], &[f64])) -> Column {
        let name = (Arc::as_ptr(cells) as usize, keys.0, keys.1);
        if let Some(known) = self.cell_energies.lock().ok().and_then(|map| map.get(&name).cloned()) {
            return known;
        }
        let mut sums = vec![0.0; cells.count.len()];
        let both = white.0.iter().zip(white.1).zip(&self.linear.sample);
        both.for_each(|((a, b), sample)| sums[cells.cell[*sample]] += a * b);
        let sums = Arc::new(sums);
        if let Ok(mut map) = self.cell_energies.lock() {
            map.insert(name, sums.clone());
        }
        sums
    }
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
    use super::super::panel::Panel;
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
        let w = DMatrix::from_fn(rows, 9, |i, j| 0.1 * at(i, j + 5));
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
    }
}
