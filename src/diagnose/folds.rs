//! Held-out figures: what the model predicts on stretches that took no part in its fit.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::diagnosis::{Diagnosis, HeldOutRms, rms_of};
use super::finding::HeldOutPair;
use super::marginal::gram;
use super::search::{ModelTerm, Search, all_but};
use crate::units::{ByQuantity, Quantity};

/// Every recording is cut into so many stretches of consecutive samples; a fold leaves one of each out.
const FOLDS: usize = 5;

/// Fits coefficients (geometry and effects, on the linearised model) with each fold left out in turn, and puts what is left there
/// into the diagnosis. Nonlinear parameters and the choice of effects stay as all samples gave them.
pub(super) fn fill(search: &Search, told: &[ModelTerm], diagnosis: &mut Diagnosis) {
    let Some(folds) = Folds::new(search, told) else { return };
    let with = |takes: &dyn Fn(usize) -> bool| folds.left_out(search, takes);
    let (geometric, last) = (with(&|_| false), with(&|_| true));
    let both = |angle: bool| {
        let rms = |left: &[f64]| rms_of(search, left, angle);
        Some(HeldOutRms { geometric: rms(&geometric)?, r#final: rms(&last)? })
    };
    diagnosis.held_out_rms = ByQuantity::of(|quantity| both(quantity == Quantity::Angle));
    let is_of = |a: usize, b: usize| a == b || search.is_one(told[a].candidate, told[b].candidate);
    for (i, finding) in diagnosis.findings.iter_mut().enumerate() {
        let before = with(&|effect| !is_of(effect, i));
        let pair = |angle: bool| {
            let rms = |left: &[f64]| rms_of(search, left, angle);
            Some(HeldOutPair { before: rms(&before)?, after: rms(&last)? })
        };
        finding.held_out_rms = ByQuantity::of(|quantity| pair(quantity == Quantity::Angle));
    }
}

/// Held-out figures of effect `i` of these.
pub(super) fn pair(search: &Search, told: &[ModelTerm], i: usize) -> ByQuantity<Option<HeldOutPair>> {
    let Some(folds) = Folds::new(search, told) else { return ByQuantity::default() };
    let before = folds.left_out(search, &|effect| effect != i);
    let after = folds.left_out(search, &|_| true);
    ByQuantity::of(|quantity| {
        let rms = |left: &[f64]| rms_of(search, left, quantity == Quantity::Angle);
        Some(HeldOutPair { before: rms(&before)?, after: rms(&after)? })
    })
}

/// By how much the whitened squares of stretches that are left out fall with effect `i`, and the standard error of that, from how much the
/// stretches differ. `None` where there are too few rows.
pub(super) fn gain(search: &Search, in_model: &[ModelTerm], i: usize) -> Option<(f64, f64)> {
    let folds = Folds::new(search, in_model)?;
    let white = |takes: &dyn Fn(usize) -> bool| {
        let left = folds.left_out(search, takes);
        let mut white = vec![0.0; left.len()];
        search.rows.whitener.apply(&left, &mut white);
        white
    };
    let (without, with) = (white(&|effect| effect != i), white(&|_| true));
    let mut cells = Vec::new();
    for span in &search.rows.linear.spans {
        for fold in 0..FOLDS {
            let rows = (span.rows.0..span.rows.1).filter(|row| folds.owner[*row] == fold);
            cells.push(rows.map(|row| without[row] * without[row] - with[row] * with[row]).sum::<f64>());
        }
    }
    let (count, sum) = (cells.len() as f64, cells.iter().sum::<f64>());
    let spread = cells.iter().map(|x| (x - sum / count).powi(2)).sum::<f64>() / (count - 1.0);
    Some((sum, (count * spread).sqrt()))
}

/// By how much stretches that are left out surprise the model of the others, beyond what its uncertainty there explains:
/// `Σ_f (e_f - r_f)·r_f - p`, (67), and the standard deviation of that by chance. `None` where there are too few rows.
pub(super) fn surprise(search: &Search, in_model: &[ModelTerm]) -> Option<(f64, f64)> {
    let normal = Normal::new(search, in_model)?;
    let (gram, b) = normal.without(None);
    let all = Cholesky::new(gram.clone())?;
    let x = all.solve(&b);
    let p = b.len() as f64 - all.inverse().trace();
    let (mut sum, mut variance) = (0.0, 0.0);
    for (own, toward) in &normal.folds {
        let part = all.solve(own);
        variance += 2.0 * part.tr_mul(&part.transpose()).trace();
        let without = Cholesky::new(&gram - own)?.solve(&(&b - toward));
        // (e - r)·r = (x - x_without)ᵀ Xᵀ(y - X x)
        sum += (&x - without).dot(&(toward - own * &x));
    }
    Some((sum - p, variance.sqrt()))
}

/// The effect without which stretches that are left out are foretold best, where that is better than with all, (68): a patch.
pub(super) fn harmful(search: &Search, in_model: &[ModelTerm]) -> Option<usize> {
    let without = foretold_without(search, in_model)?;
    (0..without.len()).filter(|i| without[*i] > 0.0).max_by(|a, b| without[*a].total_cmp(&without[*b]))
}

/// Of each effect, by how much better stretches that are left out are foretold without it, as a logarithm, (68); none where the others
/// would have to take it for a shape that right names do not have.
fn foretold_without(search: &Search, in_model: &[ModelTerm]) -> Option<Vec<f64>> {
    let normal = Normal::new(search, in_model)?;
    let all = normal.foretold(&|_| true)?;
    let bends = |i: usize| {
        let others = all_but(in_model, Some(i));
        !others.is_empty() && search.shares(&others).is_misshapen(others.len())
    };
    let without = |i: usize| {
        let better = normal.foretold(&|other| other != i).map(|without| without - all);
        better.filter(|better| *better <= 0.0 || !bends(i)).unwrap_or(f64::NEG_INFINITY)
    };
    Some((0..in_model.len()).map(without).collect())
}

/// Whether stretches that are left out are foretold better by these effects than by others, (68).
pub(super) fn foretell_better(search: &Search, these: &[ModelTerm], others: &[ModelTerm]) -> bool {
    let foretold = |in_model: &[ModelTerm]| Normal::new(search, in_model)?.foretold(&|_| true);
    foretold(these).zip(foretold(others)).is_some_and(|(these, others)| these > others)
}

/// By how much better they are foretold by geometry alone, as a logarithm.
fn foretold_without_all(search: &Search, in_model: &[ModelTerm]) -> Option<f64> {
    let normal = Normal::new(search, in_model)?;
    Some(normal.foretold(&|_| false)? - normal.foretold(&|_| true)?)
}

/// Whitened normal equations of each fold, with everything that an effect brings along: states and shape.
struct Normal {
    folds: Vec<(DMatrix<f64>, DVector<f64>)>,
    /// Of each column, which effect it belongs to.
    owner: Vec<Option<usize>>,
}

impl Normal {
    fn new(search: &Search, in_model: &[ModelTerm]) -> Option<Self> {
        let rows = search.rows;
        let fold_of = owners(search)?;
        let mut white = rows.linear.constant.clone();
        rows.whiten(&mut white);
        let mut owner = vec![None; white.ncols()];
        // Where one stands for what was the shape of another, the shape of either would do without the other.
        let shaped = !in_model.iter().any(|effect| effect.hidden);
        for (i, effect) in in_model.iter().enumerate() {
            let all = [&effect.columns, &effect.state, &effect.shape];
            for own in &all[..if shaped { 3 } else { 2 }] {
                let at = white.ncols();
                white = white.insert_columns(at, own.ncols(), 0.0);
                white.columns_mut(at, own.ncols()).copy_from(own);
                owner.extend(vec![Some(i); own.ncols()]);
            }
        }
        let mut folds = grams(&white, &rows.residual, &fold_of);
        for (gram, b) in &mut folds {
            *gram /= search.overdispersion;
            *b /= search.overdispersion;
        }
        Some(Normal { folds, owner })
    }

    /// The sum over all folds but one, with the prior.
    fn without(&self, fold: Option<usize>) -> (DMatrix<f64>, DVector<f64>) {
        let width = self.owner.len();
        let start = (DMatrix::identity(width, width), DVector::zeros(width));
        let used = self.folds.iter().enumerate().filter(|(f, _)| Some(*f) != fold);
        used.fold(start, |(gram, b), (_, (own, toward))| (gram + own, b + toward))
    }

    /// Logarithm of the probability of every fold, given all others, by geometry and these effects.
    fn foretold(&self, takes: &dyn Fn(usize) -> bool) -> Option<f64> {
        let columns: Vec<usize> =
            (0..self.owner.len()).filter(|c| self.owner[*c].is_none_or(takes)).collect();
        let evidence = |fold: Option<usize>| {
            let (gram, b) = self.without(fold);
            let (gram, b) = (gram.select_rows(&columns).select_columns(&columns), b.select_rows(&columns));
            let factor = Cholesky::new(gram)?;
            let determinant = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
            Some(0.5 * b.dot(&factor.solve(&b)) - determinant)
        };
        let all = evidence(None)?;
        (0..FOLDS).map(|fold| Some(all - evidence(Some(fold))?)).sum()
    }
}

/// The fold of each row.
fn owners(search: &Search) -> Option<Vec<usize>> {
    let linear = search.rows.linear;
    let mut owner = vec![0; linear.residual.len()];
    for span in &linear.spans {
        let count = span.samples.1 - span.samples.0;
        if count < 2 * FOLDS {
            return None;
        }
        let rows = span.rows.0..span.rows.1;
        for (fold, sample) in owner[rows.clone()].iter_mut().zip(&linear.sample[rows]) {
            *fold = (sample - span.samples.0) * FOLDS / count;
        }
    }
    Some(owner)
}

/// Normal equations of the whitened rows of each fold.
fn grams(
    white: &DMatrix<f64>,
    residual: &DVector<f64>,
    owner: &[usize],
) -> Vec<(DMatrix<f64>, DVector<f64>)> {
    let one = |fold: usize| {
        let own: Vec<usize> = (0..owner.len()).filter(|row| owner[*row] == fold).collect();
        let columns = white.select_rows(&own);
        let residual = residual.select_rows(&own);
        (gram(&columns, &columns), columns.tr_mul(&residual))
    };
    (0..FOLDS).map(one).collect()
}

/// What predicts stretches that were left out no worse: effects without which their mean square would fall by more than this factor
/// go, the worst first; and all of them, where together they do no better than geometry alone. In motion, where noise is known,
/// effects stay of which the other stretches foretell how little they know of them in the one that was left out.
pub(super) fn useful(search: &Search, in_model: &[ModelTerm], factor: f64) -> Vec<ModelTerm> {
    let mut kept = in_model.to_vec();
    let are_harm = |kept: &[ModelTerm]| {
        !search.in_motion || foretold_without_all(search, kept).is_none_or(|without| without > 0.0)
    };
    while let Some(folds) = Folds::new(search, &kept) {
        let foretold = search.in_motion.then(|| foretold_without(search, &kept)).flatten();
        let is_harm = |i: usize| foretold.as_ref().is_none_or(|without| without[i] > 0.0);
        let each = folds.without_each(search, &kept).into_iter().enumerate();
        let better = each.filter(|(i, b)| *b > factor && is_harm(*i));
        match better.max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((worst, _)) => drop(kept.remove(worst)),
            None if folds.without_all(search) > factor && are_harm(&kept) => kept.clear(),
            None => break,
        }
    }
    kept
}

/// Whether effects make the mean square of stretches that were left out so many times that of geometry alone.
pub(super) fn worsen(search: &Search, in_model: &[ModelTerm], factor: f64) -> bool {
    Folds::new(search, in_model).is_some_and(|folds| folds.without_all(search) > factor)
}

/// Normal equations of all samples and of each fold.
struct Folds {
    /// Columns as they are, m and rad.
    raw: DMatrix<f64>,
    /// What each column is of.
    part: Vec<Part>,
    /// The fold of each row.
    owner: Vec<usize>,
    /// Of the whitened rows of each fold.
    grams: Vec<(DMatrix<f64>, DVector<f64>)>,
}

/// What a column is of.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Geometry,
    Effect(usize),
    /// What an effect was before anybody looked.
    InitialCondition(usize),
}

impl Part {
    fn effect(self) -> Option<usize> {
        match self {
            Part::Geometry => None,
            Part::Effect(i) | Part::InitialCondition(i) => Some(i),
        }
    }
}

impl Folds {
    /// `None` where there are too few rows, or a column cannot be built.
    fn new(search: &Search, told: &[ModelTerm]) -> Option<Self> {
        let rows = search.rows;
        let linear = rows.linear;
        let mut raw = linear.constant.clone();
        let mut part = vec![Part::Geometry; raw.ncols()];
        let mut put = |own: &DMatrix<f64>, of: Part| {
            let at = raw.ncols();
            raw = std::mem::take(&mut raw).insert_columns(at, own.ncols(), 0.0);
            raw.columns_mut(at, own.ncols()).copy_from(own);
            part.extend(vec![of; own.ncols()]);
        };
        for (i, effect) in told.iter().enumerate() {
            put(&effect.raw(search)?, Part::Effect(i));
        }
        for (i, effect) in told.iter().enumerate() {
            if let Some(states) = search.states_of(effect) {
                put(&states.raw(rows), Part::InitialCondition(i));
            }
        }
        let owner = owners(search)?;
        let mut white = raw.clone();
        rows.whiten(&mut white);
        let grams = grams(&white, &rows.residual, &owner);
        Some(Folds { raw, part, owner, grams })
    }

    /// By which factor the mean square of what is left out grows with each effect beside all others.
    fn without_each(&self, search: &Search, in_model: &[ModelTerm]) -> Vec<f64> {
        let all = self.energy(search, &|_| true);
        (0..in_model.len()).map(|i| all / self.energy(search, &|effect| effect != i)).collect()
    }

    /// By which factor it grows with all effects beside geometry.
    fn without_all(&self, search: &Search) -> f64 {
        self.energy(search, &|_| true) / self.energy(search, &|_| false)
    }

    /// Whitened sum of squares of what is left out, with these effects.
    fn energy(&self, search: &Search, takes: &dyn Fn(usize) -> bool) -> f64 {
        let left = self.left_out(search, takes);
        let mut white = vec![0.0; left.len()];
        search.rows.whitener.apply(&left, &mut white);
        white.iter().map(|x| x * x).sum()
    }

    /// Residuals of every row under the fit of geometry and these effects to the folds that the row is not in, m and rad. What the effects were
    /// before anybody looked, no other stretch knows: that is found again in the one that was left out.
    fn left_out(&self, search: &Search, takes: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let used = |c: &usize| self.part[*c].effect().is_none_or(takes);
        let columns: Vec<usize> = (0..self.part.len()).filter(used).collect();
        // Initial conditions come last.
        let lasting = columns.iter().filter(|c| !matches!(self.part[**c], Part::InitialCondition(_))).count();
        let states = columns.len() - lasting;
        let of_columns = |(gram, b): (&DMatrix<f64>, &DVector<f64>)| {
            (gram.select_rows(&columns).select_columns(&columns), b.select_rows(&columns))
        };
        let solved = |fold: usize| -> Option<DVector<f64>> {
            let width = columns.len();
            let start = (DMatrix::identity(width, width), DVector::zeros(width));
            let others = (0..FOLDS).filter(|other| *other != fold).map(|other| &self.grams[other]);
            let (gram, b) = others
                .map(|(gram, b)| of_columns((gram, b)))
                .fold(start, |(g, b), own| (g + own.0, b + own.1));
            let mut x = Cholesky::new(gram)?.solve(&b);
            let (gram, b) = of_columns((&self.grams[fold].0, &self.grams[fold].1));
            let own = gram.view((lasting, lasting), (states, states)) + DMatrix::identity(states, states);
            let toward =
                b.rows(lasting, states) - gram.view((lasting, 0), (states, lasting)) * x.rows(0, lasting);
            x.rows_mut(lasting, states).copy_from(&Cholesky::new(own)?.solve(&toward));
            Some(x)
        };
        let solutions: Vec<Option<DVector<f64>>> = (0..FOLDS).map(solved).collect();
        let residual = &search.rows.linear.residual;
        (0..residual.len())
            .map(|row| match &solutions[self.owner[row]] {
                Some(x) => {
                    let model = columns.iter().zip(x.iter()).map(|(c, x)| self.raw[(row, *c)] * x);
                    residual[row] - model.sum::<f64>()
                }
                None => residual[row],
            })
            .collect()
    }
}
