//! Samples put together where joints stand alike, whenever that was: a function of where one or two joints stand is judged on sums over cells,
//! which cost the same however many samples there are.

use std::collections::{BTreeMap, HashMap};
use std::ops::AddAssign;
use std::sync::{Arc, Mutex, OnceLock};

use nalgebra::{DMatrix, DMatrixView, DVector, DVectorView};

use super::coarse::{AtPoint, Features, is_near};
use super::linear::Linear;
use super::panel::{Panel, WIDTH, add_along};
use super::score::{
    BATCH, Best, Column, Equations, Field, Key, Rows, best, is_of_number, key, lengths, unit_of,
};
use crate::effects::{Candidate, Coefficient};
use crate::feature::{Feature, Samples};
use crate::variation::Part;

/// About so many cells along one joint, and along each of two; for what is finer along one joint, each sample is a cell, next to its
/// neighbours there, or a few are.
const CELLS: usize = 512;
const SIDE: usize = 24;
const FINEST: usize = 8192;
/// Sums over cells are worth their memory from so many columns for each answer of the machine on.
const COLUMNS: usize = 4;

/// Joints by index of their dyad, and whether it matters from which side they came.
type Joints = BTreeMap<usize, bool>;

/// Samples by where some joints stand.
pub(super) struct Cells {
    /// Cell of each sample.
    cell: Vec<usize>,
    /// Samples of each cell.
    count: Vec<f64>,
    /// The sample that stands for each cell.
    middle: Vec<usize>,
    /// What features see of those, recording by recording.
    samples: Vec<Samples>,
}

/// All cells, and the features of each candidate on its cells over its grid, once they have been asked for.
pub(super) struct AllCells {
    of_joints: Mutex<Known>,
    kept: Vec<OnceLock<Option<InCells>>>,
}

/// Cells by the joints that they are of, and how many strips there are along each.
type Known = HashMap<(Joints, usize), Option<Arc<Cells>>>;

/// Cells, and the features of a candidate on them.
pub(super) type InCells = (Arc<Cells>, Features);

/// What an answer of the machine makes of a marginal and of the residuals, cell by cell.
pub(super) struct CellSums {
    along: Vec<Arc<Panel>>,
    toward: Vec<f64>,
}

impl AllCells {
    pub fn new(candidates: usize) -> Self {
        AllCells { of_joints: Mutex::default(), kept: (0..candidates).map(|_| OnceLock::new()).collect() }
    }

    /// Features of candidate `i` over its grid, if they are functions of where one or two joints stand that change little within a cell.
    pub fn features(&self, i: usize, candidate: &Candidate, linear: &Linear) -> Option<&InCells> {
        let first = || {
            let columns = candidate.grid.len() * candidate.coefficients.len();
            if columns < COLUMNS * answers(candidate).len() {
                return None;
            }
            let joints = joints(&candidate.features)?;
            let each = linear.lines.len().min(FINEST);
            let sizes = if joints.len() == 1 { &[CELLS, each][..] } else { &[SIDE] };
            sizes.iter().find_map(|strips| {
                let cells = self.cells(joints.clone(), *strips, linear)?;
                let samples = (&linear.samples[..], &cells.samples[..]);
                let features = Features::over(candidate, samples, None, |column| cells.follows(column))?;
                Some((cells, features))
            })
        };
        self.kept[i].get_or_init(first).as_ref()
    }

    fn cells(&self, joints: Joints, strips: usize, linear: &Linear) -> Option<Arc<Cells>> {
        let mut known = self.of_joints.lock().ok()?;
        let new = |(joints, strips): &(Joints, usize)| Cells::new(joints, *strips, linear).map(Arc::new);
        known.entry((joints, strips)).or_insert_with_key(new).clone()
    }
}

/// The joints on whose position all these features depend, if on nothing else and on no more than two.
fn joints(features: &[Feature]) -> Option<Joints> {
    let mut all = Joints::new();
    for feature in features {
        for (joint, from_side) in feature.stands_on()? {
            *all.entry(joint).or_default() |= from_side;
        }
    }
    (1..=2).contains(&all.len()).then_some(all)
}

/// The answers of the machine that a candidate's coefficients need, each once.
fn answers(candidate: &Candidate) -> Vec<Key> {
    let parts = candidate.coefficients.iter().flat_map(|c| &c.parts);
    let mut keys: Vec<Key> = parts.map(|part| key(part.slot, part.direction)).collect();
    keys.sort_unstable();
    keys.dedup();
    keys
}

impl Cells {
    /// So many strips along each joint.
    fn new(joints: &Joints, strips: usize, linear: &Linear) -> Option<Self> {
        let count = linear.lines.len();
        let mut places: Vec<(f64, Vec<f64>)> = vec![(0.0, Vec::new()); count];
        for (samples, span) in linear.samples.iter().zip(&linear.spans) {
            for (j, from_side) in joints {
                let columns = samples.joints[*j].as_ref()?;
                for (k, place) in places[span.samples.0..span.samples.1].iter_mut().enumerate() {
                    place.1.push(columns.position[k]);
                    // Each side of each joint is a digit.
                    place.0 = 3.0 * place.0 + if *from_side { columns.direction[k] } else { 0.0 };
                }
            }
        }
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|a, b| places[*a].0.total_cmp(&places[*b].0));
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for side in order.chunk_by(|a, b| places[*a].0 == places[*b].0) {
            let mut strip_of: Vec<Vec<usize>> = vec![side.to_vec()];
            for joint in 0..joints.len() {
                strip_of = strip_of
                    .into_iter()
                    .flat_map(|mut group| {
                        group.sort_by(|a, b| places[*a].1[joint].total_cmp(&places[*b].1[joint]));
                        let size = group.len().div_ceil(strips).max(1);
                        group.chunks(size).map(<[usize]>::to_vec).collect::<Vec<_>>()
                    })
                    .collect();
            }
            groups.extend(strip_of);
        }
        Some(Self::of(groups, linear))
    }

    /// From the samples of each cell.
    fn of(mut groups: Vec<Vec<usize>>, linear: &Linear) -> Self {
        let span_of = |group: &Vec<usize>| {
            linear.spans.partition_point(|span| span.samples.1 <= group[group.len() / 2])
        };
        groups.sort_by_key(span_of);
        let mut cells = Cells {
            cell: vec![0; linear.lines.len()],
            count: groups.iter().map(|group| group.len() as f64).collect(),
            middle: groups.iter().map(|group| group[group.len() / 2]).collect(),
            samples: Vec::new(),
        };
        groups.iter().enumerate().for_each(|(c, group)| group.iter().for_each(|s| cells.cell[*s] = c));
        for (samples, span) in linear.samples.iter().zip(&linear.spans) {
            let inside = |sample: &&usize| (span.samples.0..span.samples.1).contains(*sample);
            let own: Vec<usize> = cells.middle.iter().filter(inside).map(|s| s - span.samples.0).collect();
            cells.samples.push(samples.chosen(&own));
        }
        cells
    }

    /// Whether a column changes little within a cell.
    fn follows(&self, column: &[f64]) -> bool {
        let middle = self.cell.iter().map(|cell| column[self.middle[*cell]]);
        is_near(column, middle)
    }

    /// What a coefficient is scaled by: the usual size over the root mean square of its first feature over all samples.
    fn unit(&self, coefficient: &Coefficient, features: &AtPoint) -> f64 {
        let Some(part) = coefficient.parts.first() else { return 0.0 };
        let count = features.runs.iter().flat_map(|(from, count)| &self.count[*from..from + count]);
        let square: f64 =
            features.columns[part.feature].iter().zip(count).map(|(x, n)| n * f64::from(*x).powi(2)).sum();
        let rms = (square / self.count.iter().sum::<f64>()).sqrt();
        unit_of(coefficient.size, rms, is_of_number(coefficient))
    }
}

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
                keys.iter().map(|key| Answered::of(candidate, *key, &batch, cells)).collect();
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
    fn of(candidate: &Candidate, of: Key, batch: &[(usize, AtPoint)], cells: &Cells) -> Self {
        let rows = batch[0].1.columns.first().map_or(0, |column| column.len());
        let is_own = |p: &&Part<usize>| key(p.slot, p.direction) == of;
        let own: Vec<(usize, &Coefficient)> = (candidate.coefficients.iter().enumerate())
            .filter(|(_, coefficient)| coefficient.parts.iter().any(|part| is_own(&part)))
            .collect();
        let mut columns: Vec<f64> = Vec::with_capacity(rows * own.len() * batch.len());
        for (_, features) in batch {
            for (_, coefficient) in &own {
                let unit = cells.unit(coefficient, features);
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
        let w = DMatrix::from_fn(rows, 9, |i, j| 0.1 * at(i, j + 5));
        let panels: Vec<Panel> = Panel::of_transposed(&w.transpose());
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
