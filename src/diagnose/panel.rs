//! Tall matrices in panels of eight columns, row by row: products with few columns read them once, on whatever lanes the machine has.

use std::sync::{Arc, OnceLock};

use nalgebra::{DMatrix, DMatrixView};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Columns of a panel.
pub(super) const WIDTH: usize = 8;
/// Rows that are looked at together: a panel's stay in a core's nearest cache while the other factor's columns pass by.
const ROWS: usize = 512;
/// Blocks of samples of so many sizes, at most, that a panel can be put together in.
pub(super) const LEVELS: usize = 3;

/// Eight columns, those that are not used zero.
#[derive(Default)]
pub(super) struct Panel {
    rows: Vec<[f64; WIDTH]>,
    /// The same on blocks of samples, level by level, once it has been asked for.
    reduced: [OnceLock<Arc<Panel>>; LEVELS],
}

impl Panel {
    pub fn new(rows: Vec<[f64; WIDTH]>) -> Self {
        Panel { rows, reduced: Default::default() }
    }

    /// The columns of a matrix that is given row by row, some rows after the other: `transposed` have a column per row.
    pub fn of_transposed(transposed: &[DMatrix<f64>]) -> Vec<Panel> {
        let columns = transposed.first().map_or(0, DMatrix::nrows);
        let panel = |from: usize| {
            let count = WIDTH.min(columns - from);
            let row = |column: &[f64]| {
                let mut row = [0.0; WIDTH];
                row[..count].copy_from_slice(&column[from..from + count]);
                row
            };
            let mut rows = Vec::with_capacity(transposed.iter().map(DMatrix::ncols).sum());
            transposed.iter().for_each(|some| rows.extend(some.as_slice().chunks_exact(columns).map(row)));
            Panel::new(rows)
        };
        (0..columns).step_by(WIDTH).map(panel).collect()
    }

    pub fn rows(&self) -> &[[f64; WIDTH]] {
        &self.rows
    }

    /// On the blocks of a level.
    pub fn reduced(&self, level: usize, reduce: impl FnOnce(&Panel) -> Panel) -> Arc<Panel> {
        self.reduced[level].get_or_init(|| Arc::new(reduce(self))).clone()
    }

    /// Each row times a number, summed over cells of rows.
    pub fn gathered(&self, by: &[f64], cell: &[usize], cells: usize) -> Panel {
        let mut sums = vec![[0.0; WIDTH]; cells];
        for ((row, x), cell) in self.rows.iter().zip(by).zip(cell) {
            sums[*cell].iter_mut().zip(row).for_each(|(sum, w)| *sum += x * w);
        }
        Panel::new(sums)
    }

    pub fn norm_squared(&self) -> f64 {
        self.rows.as_flattened().iter().map(|x| x * x).sum()
    }
}

/// Adds `Wᵀ C` of columns that are given for some rows from `first` on and are zero elsewhere; `to`: a row per column of the panels, a column per
/// column of `C`.
pub(super) fn add_along(panels: &[Arc<Panel>], first: usize, c: &DMatrixView<f64>, to: &mut DMatrix<f64>) {
    let wide = to.nrows();
    if wide == 0 {
        return;
    }
    to.as_mut_slice().par_chunks_mut(WIDTH * wide).enumerate().for_each(|(chunk, to)| {
        let own = c.columns(chunk * WIDTH, to.len() / wide);
        add_some_along(panels, first, &own, to);
    });
}

/// The same of the few columns that one thread takes at a time; `to`: column by column.
fn add_some_along(panels: &[Arc<Panel>], first: usize, c: &DMatrixView<f64>, to: &mut [f64]) {
    let arch = Arch::new();
    let wide = panels.len() * WIDTH;
    let columns: Vec<_> = c.column_iter().collect();
    let fours = columns.len() / 4 * 4;
    let mut rows: Vec<&[[f64; WIDTH]]> = Vec::with_capacity(panels.len());
    for from in (0..c.nrows()).step_by(ROWS) {
        let count = ROWS.min(c.nrows() - from);
        rows.clear();
        rows.extend(panels.iter().map(|panel| &panel.rows[first + from..first + from + count]));
        let own = |k: usize| &columns[k].as_slice()[from..from + count];
        for (pair, rows) in rows.chunks(2).enumerate() {
            for k in (0..fours).step_by(4) {
                let to = &mut to[k * wide + 2 * pair * WIDTH..];
                add_few::<2, 4>(arch, rows, [own(k), own(k + 1), own(k + 2), own(k + 3)], to, wide);
            }
        }
        let (k, to) = (fours, &mut to[fours * wide..]);
        match columns.len() - fours {
            0 => {}
            1 => add_few::<4, 1>(arch, &rows, [own(k)], to, wide),
            2 => add_few::<4, 2>(arch, &rows, [own(k), own(k + 1)], to, wide),
            _ => add_few::<2, 3>(arch, &rows, [own(k), own(k + 1), own(k + 2)], to, wide),
        }
    }
}

/// The same of `K` columns, `P` panels at a time: a sum waits for the one before it, and others can be seen to meanwhile.
fn add_few<const P: usize, const K: usize>(
    arch: Arch,
    panels: &[&[[f64; WIDTH]]],
    c: [&[f64]; K],
    to: &mut [f64],
    wide: usize,
) {
    let mut add = |p: usize, sums: &[[[f64; WIDTH]; K]]| {
        for (p, sums) in (p..).zip(sums) {
            for (k, sums) in sums.iter().enumerate() {
                let to = &mut to[k * wide + p * WIDTH..][..WIDTH];
                to.iter_mut().zip(sums).for_each(|(to, x)| *to += x);
            }
        }
    };
    for (some, rows) in panels.chunks(P).enumerate() {
        match <[&[[f64; WIDTH]]; P]>::try_from(rows) {
            Ok(rows) => add(some * P, &arch.dispatch(Along { rows, c })),
            Err(_) => (some * P..)
                .zip(rows)
                .for_each(|(p, rows)| add(p, &arch.dispatch(Along { rows: [*rows], c }))),
        }
    }
}

/// Subtracts `W A` from columns; `along`: `A`, a row per column of the panels, a column per column that it is taken from.
pub(super) fn take_away(panels: &[Arc<Panel>], along: &DMatrix<f64>, from: &mut DMatrix<f64>) {
    let arch = Arch::new();
    let panels: Vec<&[[f64; WIDTH]]> = panels.iter().map(|panel| panel.rows()).collect();
    let own = |k: usize| along.as_slice()[k * along.nrows()..][..along.nrows()].as_chunks().0;
    let rows = from.nrows().max(1);
    let take = |(chunk, columns): (usize, &mut [f64])| {
        let mut columns: Vec<&mut [f64]> = columns.chunks_mut(rows).collect();
        let (panels, k) = (&panels[..], 4 * chunk);
        match &mut columns[..] {
            [a, b, c, d] => {
                arch.dispatch(Beside { panels, along: [0, 1, 2, 3].map(|j| own(k + j)), out: [a, b, c, d] })
            }
            rest => {
                (k..).zip(rest).for_each(|(k, a)| arch.dispatch(Beside { panels, along: [own(k)], out: [a] }))
            }
        }
    };
    from.as_mut_slice().par_chunks_mut(4 * rows).enumerate().for_each(take);
}

/// `Wᵀ C` of `P` panels and `K` columns.
struct Along<'a, const P: usize, const K: usize> {
    rows: [&'a [[f64; WIDTH]]; P],
    c: [&'a [f64]; K],
}

impl<const P: usize, const K: usize> WithSimd for Along<'_, P, K> {
    type Output = [[[f64; WIDTH]; K]; P];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let mut out = [[[0.0; WIDTH]; K]; P];
        let count = self.rows.first().map_or(0, |rows| rows.len());
        let (rows, c) = (self.rows.map(|rows| &rows[..count]), self.c.map(|c| &c[..count]));
        for lane in 0..WIDTH / S::F64_LANES {
            let mut sums = [[simd.splat_f64s(0.0); K]; P];
            for i in 0..count {
                for p in 0..P {
                    let x = S::as_simd_f64s(&rows[p][i]).0[lane];
                    for k in 0..K {
                        sums[p][k] = simd.mul_add_e_f64s(x, simd.splat_f64s(c[k][i]), sums[p][k]);
                    }
                }
            }
            for p in 0..P {
                for k in 0..K {
                    S::as_mut_simd_f64s(&mut out[p][k]).0[lane] = sums[p][k];
                }
            }
        }
        out
    }
}

/// `K` columns less `W A`.
struct Beside<'a, 'b, const K: usize> {
    panels: &'a [&'a [[f64; WIDTH]]],
    along: [&'a [[f64; WIDTH]]; K],
    out: [&'b mut [f64]; K],
}

impl<const K: usize> WithSimd for Beside<'_, '_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Beside { panels, along, out } = self;
        for i in 0..out.first().map_or(0, |out| out.len()) {
            let mut sums = [simd.splat_f64s(0.0); K];
            for (p, panel) in panels.iter().enumerate() {
                for (lane, x) in S::as_simd_f64s(&panel[i]).0.iter().enumerate() {
                    for k in 0..K {
                        sums[k] = simd.mul_add_e_f64s(*x, S::as_simd_f64s(&along[k][p]).0[lane], sums[k]);
                    }
                }
            }
            for k in 0..K {
                out[k][i] -= simd.reduce_sum_f64s(sums[k]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_plain_matrices() {
        for (width, columns) in [(1, 1), (7, 2), (8, 3), (21, 9), (40, 6)] {
            let at = |i: usize, j: usize| (0.37 * (i as f64 + 1.0) * (j as f64 + 2.0)).sin();
            let (w, c) =
                (DMatrix::from_fn(1200, width, at), DMatrix::from_fn(1200, columns, |i, j| at(j + 3, i)));
            let panels: Vec<_> = Panel::of_transposed(&[w.transpose()]).into_iter().map(Arc::new).collect();
            let mut along = DMatrix::zeros(panels.len() * WIDTH, columns);
            add_along(&panels, 0, &c.as_view(), &mut along);
            let plain = w.tr_mul(&c);
            assert!((along.rows(0, width) - &plain).amax() < 1e-11);
            assert_eq!(along.rows_range(width..).amax(), 0.0);
            let mut beside = c.clone();
            take_away(&panels, &along, &mut beside);
            assert!((beside - (&c - &w * plain)).amax() < 1e-9);
            let (mut part, some) = (DMatrix::zeros(along.nrows(), columns), c.rows(0, 40).into_owned());
            add_along(&panels, 700, &some.as_view(), &mut part);
            assert!((part.rows(0, width) - w.rows(700, 40).tr_mul(&some)).amax() < 1e-11);
        }
    }
}
