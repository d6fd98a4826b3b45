//! Set-ups that took no part in the fit: whether what was found holds where the machine stands otherwise, `docs/diagnosis-method.md` (71).

use nalgebra::{Cholesky, DMatrix, DVector};

use super::diagnosis::{LeftOutRms, SetUpLeftOut};
use super::marginal::gram;
use super::placebo::Placebo;
use super::rms::rms_of_rows;
use super::search::Search;
use super::terms::{ModelTerm, joined};
use crate::units::{ByQuantity, Quantity};

/// Fewer samples of a set-up do not say where the machine stands.
const FEWEST: usize = 6;

/// Every set-up left out in turn; nothing where there is only one.
pub(super) fn left_out(
    search: &Search,
    told: &[ModelTerm],
    placebos: &[Option<Placebo>],
) -> Vec<SetUpLeftOut> {
    let names = names(search);
    let effects: Option<Vec<DMatrix<f64>>> = told.iter().map(|effect| effect.raw(search)).collect();
    let meaningless: Vec<DMatrix<f64>> = placebos.iter().flatten().map(|p| p.raw.clone()).collect();
    let (Some(effects), true) = (effects, says(search, &names)) else { return Vec::new() };
    let left =
        |effects: &[DMatrix<f64>]| SetUps::new(search, &names, effects).with_tolerances(search).left(search);
    let (geometric, with_all) = (left(&[]), left(&effects));
    let instead = (!meaningless.is_empty()).then(|| left(&meaningless));
    let one = |name: &String| {
        let rms = |angle: bool| {
            let rms = |left: &[f64]| {
                let linear = search.rows.linear;
                let spans = linear.spans.iter().filter(|span| span.setup == *name);
                let rows: Vec<usize> = spans.flat_map(|span| span.rows.0..span.rows.1).collect();
                rms_of_rows(search, left, angle, &rows)
            };
            let placebo = instead.as_ref().and_then(|left| rms(left));
            Some(LeftOutRms { geometric: rms(&geometric)?, r#final: rms(&with_all)?, placebo })
        };
        SetUpLeftOut {
            setup: name.clone(),
            samples: samples_of(search, name) as u64,
            rms: ByQuantity::of(|quantity| rms(quantity == Quantity::Angle)),
        }
    };
    names.iter().map(one).collect()
}

/// Whether the first effects foretell set-ups that are left out no worse than the second, lengths and angles alike; `None` where there are
/// not several.
pub(super) fn foretell(search: &Search, first: &[ModelTerm], second: &[ModelTerm]) -> Option<bool> {
    let names = names(search);
    let squares = |told: &[ModelTerm]| -> Option<[f64; 2]> {
        let effects: Option<Vec<DMatrix<f64>>> = told.iter().map(|effect| effect.raw(search)).collect();
        let left = SetUps::new(search, &names, &effects?).left(search);
        let mut sums = [0.0; 2];
        let used = (0..left.len()).filter(|row| !search.rows.whitener.out[*row]);
        used.for_each(|row| sums[usize::from(search.rows.linear.angle[row])] += left[row] * left[row]);
        Some(sums)
    };
    if !says(search, &names) {
        return None;
    }
    let (first, second) = (squares(first)?, squares(second)?);
    Some((0..2).all(|kind| first[kind] <= second[kind]))
}

/// Whether there are several set-ups, and every one says where the machine stands.
fn says(search: &Search, names: &[String]) -> bool {
    names.len() > 1 && names.iter().all(|name| samples_of(search, name) >= FEWEST)
}

/// Names of the set-ups in their order.
fn names(search: &Search) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for span in &search.rows.linear.spans {
        if !names.contains(&span.setup) {
            names.push(span.setup.clone());
        }
    }
    names
}

fn samples_of(search: &Search, name: &str) -> usize {
    let spans = search.rows.linear.spans.iter().filter(|span| span.setup == name);
    spans.map(|span| span.samples.1 - span.samples.0).sum()
}

/// Normal equations of every set-up.
struct SetUps {
    /// Columns of everything constant and of the effects, m and rad.
    raw: DMatrix<f64>,
    /// The set-up of each row.
    of_row: Vec<usize>,
    /// Of the whitened rows of each set-up.
    normal: Vec<(DMatrix<f64>, DVector<f64>)>,
    /// What is known of each column beforehand: its information, and that times where it stands at most likely.
    before: (DVector<f64>, DVector<f64>),
}

/// A column that has no more than this part of its energy elsewhere belongs to its set-up.
const ELSEWHERE: f64 = 1e-12;

impl SetUps {
    fn new(search: &Search, names: &[String], effects: &[DMatrix<f64>]) -> Self {
        let linear = search.rows.linear;
        let mut raw = search.rows.always(|_, _| false);
        for own in effects {
            raw = joined(raw, own);
        }
        let mut of_row = vec![0; raw.nrows()];
        for span in &linear.spans {
            let setup = names.iter().position(|name| *name == span.setup).unwrap_or(0);
            of_row[span.rows.0..span.rows.1].fill(setup);
        }
        let mut white = raw.clone();
        search.rows.whiten(&mut white);
        let one = |setup: usize| {
            let rows: Vec<usize> = (0..of_row.len()).filter(|row| of_row[*row] == setup).collect();
            let (own, residual) = (white.select_rows(&rows), search.rows.residual.select_rows(&rows));
            (gram(&own, &own), own.tr_mul(&residual))
        };
        let normal = (0..names.len()).map(one).collect();
        let before = (DVector::from_element(raw.ncols(), 1.0), DVector::zeros(raw.ncols()));
        SetUps { raw, of_row, normal, before }
    }

    /// With what `calibrate` knows beforehand, of deviations their tolerances and that they lie about zero: rows are taken at the optimum of
    /// all set-ups, and would keep what the one that is left out has told.
    fn with_tolerances(mut self, search: &Search) -> Self {
        for (column, (information, at)) in search.rows.linear.tolerated().into_iter().enumerate() {
            if let Some(information) = information {
                (self.before.0[column], self.before.1[column]) = (information, information * at);
            }
        }
        self
    }

    /// Residuals of every row, m and rad: what its machine is like is known from the other set-ups alone, and what belongs to its own
    /// set-up is found again.
    fn left(&self, search: &Search) -> Vec<f64> {
        let solutions: Vec<Option<DVector<f64>>> = (0..self.normal.len()).map(|s| self.without(s)).collect();
        let residual = &search.rows.linear.residual;
        (self.of_row.iter().enumerate())
            .map(|(row, setup)| match &solutions[*setup] {
                Some(x) => residual[row] - self.raw.row(row).transpose().dot(x),
                None => residual[row],
            })
            .collect()
    }

    fn without(&self, setup: usize) -> Option<DVector<f64>> {
        let width = self.raw.ncols();
        let others = self.normal.iter().enumerate().filter(|(s, _)| *s != setup);
        let start = (DMatrix::from_diagonal(&self.before.0), self.before.1.clone());
        let (known, toward) = others.fold(start, |(g, b), (_, (own, toward))| (g + own, b + toward));
        let (here, toward_here) = &self.normal[setup];
        let is_own = |c: &usize| known[(*c, *c)] - self.before.0[*c] <= ELSEWHERE * here[(*c, *c)];
        let own: Vec<usize> = (0..width).filter(is_own).collect();
        let mut x = Cholesky::new(known.clone())?.solve(&toward);
        let left = (toward_here - here * &x).select_rows(&own);
        let mut gram = here.select_rows(&own).select_columns(&own);
        (0..own.len()).for_each(|i| gram[(i, i)] += 1.0);
        let found = Cholesky::new(gram)?.solve(&left);
        own.iter().zip(found.iter()).for_each(|(c, value)| x[*c] += value);
        Some(x)
    }
}
