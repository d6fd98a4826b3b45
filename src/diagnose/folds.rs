//! Held-out figures: what the model predicts on stretches that took no part in its fit.

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::diagnosis::{Diagnosis, HeldOutRms};
use super::finding::HeldOutPair;
use super::marginal::{gram, with_prior};
use super::noise::Noise;
use super::policy::Rule;
use super::rms::{LeftOut, rms_of, sum_and_error};
use super::search::Search;
use super::terms::{ModelTerm, joined};
use crate::feature::Samples;
use crate::units::{ByQuantity, Quantity};

/// Every recording is cut into so many stretches of consecutive samples; a fold leaves one of each out.
const FOLDS: usize = 5;
/// So many groups of recordings are left out at most.
const MOST_RECORDINGS: usize = 10;
/// Extents of one joint in two recordings that differ by less than this part of them are those of one motion.
const SAME: f64 = 1e-3;

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
    diagnosis.left_out = folds.squares(search, &last);
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

/// RMS of stretches that are left out, with so many of these effects.
pub(super) fn rms_left_out(search: &Search, told: &[ModelTerm], first: usize) -> ByQuantity<Option<f64>> {
    let Some(folds) = Folds::new(search, told) else { return ByQuantity::default() };
    let left = folds.left_out(search, &|effect| effect < first);
    ByQuantity::of(|quantity| rms_of(search, &left, quantity == Quantity::Angle))
}

/// By how much the squares of stretches that are left out fall with effect `i`, in units of their mean without it, and the standard error
/// of that, from how much the stretches differ. `None` where there are too few rows.
///
/// Of the readings as they are: who predicts has no reading before the one that he predicts, and so no use for what noise remembers.
pub(super) fn gain(search: &Search, in_model: &[ModelTerm], i: usize) -> Option<(f64, f64)> {
    Some(Folds::new(search, in_model)?.gain(search, i))
}

/// The same of whole recordings, which follow paths of their own; those of one motion, read by several instruments, belong together. Only
/// those count that would be foretold better if the model were right: what others do not teach, they cannot foretell. `None` where there
/// is none.
pub(super) fn gain_elsewhere(search: &Search, in_model: &[ModelTerm], i: usize) -> Option<(f64, f64)> {
    let linear = search.rows.linear;
    let mut owner = vec![0; linear.residual.len()];
    let mut motions: Vec<Vec<Option<(f64, f64)>>> = Vec::new();
    for (span, samples) in linear.spans.iter().zip(&linear.samples) {
        let own = extents(samples);
        let known = motions.iter().position(|other| is_one_motion(&own, other));
        let number = known.unwrap_or(motions.len());
        if known.is_none() {
            motions.push(own);
        }
        owner[span.rows.0..span.rows.1].fill(number % MOST_RECORDINGS);
    }
    if motions.len() < 2 {
        return None;
    }
    Folds::of(search, (search.always(in_model), in_model), owner, stretches(search)?)?
        .gain_where_expected(search, i)
}

/// Where each joint of a recording has been, least and greatest.
fn extents(samples: &Samples) -> Vec<Option<(f64, f64)>> {
    let extent = |q: &[f64]| q.iter().fold((f64::MAX, f64::MIN), |(l, h), q| (l.min(*q), h.max(*q)));
    samples.joints.iter().map(|joint| joint.as_ref().map(|joint| extent(&joint.position))).collect()
}

/// Whether all joints have been in the same places, rows that one of two recordings lacks aside.
fn is_one_motion(a: &[Option<(f64, f64)>], b: &[Option<(f64, f64)>]) -> bool {
    let is_near = |a: &(f64, f64), b: &(f64, f64)| {
        let most = SAME * (a.1 - a.0).max(b.1 - b.0);
        (a.0 - b.0).abs() <= most && (a.1 - b.1).abs() <= most
    };
    a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| is_near(a, b))
}

/// Whether stretches that were left out are foretold better by these effects than by others, by more than one standard error.
pub(super) fn are_better(search: &Search, these: &[ModelTerm], others: &[ModelTerm]) -> bool {
    let Some(folds) = Folds::new(search, &[these, others].concat()) else { return false };
    let of_others = folds.left_out(search, &|effect| effect >= these.len());
    let (fall, error) =
        folds.fall(search, &of_others, &folds.left_out(search, &|effect| effect < these.len()));
    fall > error
}

/// Whether stretches that were left out are foretold by these effects as well as by others: no worse by more than one standard error of what the
/// others leave there.
pub(super) fn are_as_good(search: &Search, these: &[ModelTerm], others: &[ModelTerm]) -> bool {
    let Some(folds) = Folds::new(search, &[these, others].concat()) else { return false };
    let of_others = folds.left_out(search, &|effect| effect >= these.len());
    let (fall, _) = folds.fall(search, &of_others, &folds.left_out(search, &|effect| effect < these.len()));
    -fall <= folds.error(search, &of_others)
}

/// Which part of the squares of left-out stretches is left with all effects, against what the first of them leave, the noise's own taken from
/// both; of lengths or of angles, whichever fall by the larger part: what shifts a frame turns nothing. `None` where there are too few rows, or
/// nothing but noise.
pub(super) fn remaining(
    search: &Search,
    noise: &[Noise],
    in_model: &[ModelTerm],
    first: usize,
) -> Option<f64> {
    let folds = Folds::new(search, in_model)?;
    let (without, with) =
        (folds.left_out(search, &|effect| effect < first), folds.left_out(search, &|_| true));
    let mut of_noise = vec![0.0; without.len()];
    // Of settled positions nothing tells the noise but what is left. What remembers for long may be a misfit.
    for (run, noise) in search.runs.iter().zip(noise).filter(|_| search.in_motion) {
        run.iter().for_each(|row| of_noise[*row] = noise.shortened().sigma.powi(2));
    }
    let of = |angle: bool| {
        let counts = |row: &usize| !search.rows.whitener.out[*row] && search.rows.linear.angle[*row] == angle;
        let sum = |of_row: &dyn Fn(usize) -> f64| (0..without.len()).filter(counts).map(of_row).sum::<f64>();
        let before = sum(&|row| without[row].powi(2));
        let (fall, noise) = (before - sum(&|row| with[row].powi(2)), sum(&|row| of_noise[row]));
        (before > noise).then(|| (fall / before, 1.0 - fall / (before - noise)))
    };
    let most = [of(false), of(true)].into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0));
    most.map(|(_, left)| left)
}

/// Whether stretches that are left out are foretold better without one of these effects, (68): a patch.
pub(super) fn is_patched(search: &Search, in_model: &[ModelTerm]) -> bool {
    let Some(normal) = Normal::new(search, in_model) else { return false };
    let Some(all) = normal.foretold(&|_| true) else { return false };
    let without = |i: usize| normal.foretold(&|other| other != i);
    (0..in_model.len()).any(|i| without(i).is_some_and(|without| without > all))
}

/// Whether stretches that are left out are foretold better by these effects than by others, (68).
pub(super) fn foretell_better(search: &Search, these: &[ModelTerm], others: &[ModelTerm]) -> bool {
    let foretold = |in_model: &[ModelTerm]| Normal::new(search, in_model)?.foretold(&|_| true);
    foretold(these).zip(foretold(others)).is_some_and(|(these, others)| these > others)
}

/// Whitened normal equations of each fold, with everything that an effect brings along: initial conditions and discrepancy.
struct Normal {
    folds: Vec<(DMatrix<f64>, DVector<f64>)>,
    /// Of each column, which effect it belongs to.
    owner: Vec<Option<usize>>,
}

impl Normal {
    fn new(search: &Search, in_model: &[ModelTerm]) -> Option<Self> {
        let rows = search.rows;
        let fold_of = stretches(search)?;
        let mut white = search.always(in_model);
        rows.whiten(&mut white);
        let mut owner = vec![None; white.ncols()];
        // Where one stands for what was the shape of another, the shape of either would do without the other.
        let with_discrepancies = !in_model.iter().any(|effect| effect.hidden);
        for (i, effect) in in_model.iter().enumerate() {
            let all = [&effect.columns, &effect.initial, &effect.discrepancy];
            for own in &all[..if with_discrepancies { 3 } else { 2 }] {
                white = joined(white, own);
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

/// The stretch of its recording that each row is in; `None` where there are too few rows.
fn stretches(search: &Search) -> Option<Vec<usize>> {
    let linear = search.rows.linear;
    let mut stretch = vec![0; linear.residual.len()];
    for span in &linear.spans {
        let count = span.samples.1 - span.samples.0;
        if count < 2 * FOLDS {
            return None;
        }
        let rows = span.rows.0..span.rows.1;
        for (own, sample) in stretch[rows.clone()].iter_mut().zip(&linear.sample[rows]) {
            *own = (sample - span.samples.0) * FOLDS / count;
        }
    }
    Some(stretch)
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
    (0..=owner.iter().copied().max().unwrap_or(0)).map(one).collect()
}

/// What foretells stretches that were left out, (68): effects without which these are foretold better go, the worst first, and all of them
/// where together they do worse than geometry alone. `least`: by so many standard errors one that stays makes them better. Judged as the file
/// has them, where drives give way by what is named alone.
pub(super) fn useful(search: &Search, in_model: &[ModelTerm], least: f64) -> Vec<ModelTerm> {
    let mut kept = in_model.to_vec();
    while let Some(folds) = Folds::rigid(search, &kept) {
        match folds.worst(search, kept.len(), least) {
            Some(worst) if Rule::HasToForetell.decides() => drop(kept.remove(worst)),
            Some(_) => break,
            None => {
                let (alone, all) = (folds.left_out(search, &|_| false), folds.left_out(search, &|_| true));
                if is_harm(least, folds.fall(search, &alone, &all)) {
                    kept.clear();
                }
                break;
            }
        }
    }
    kept
}

/// Of the first `names` of these effects, the one without which left-out stretches are foretold best, if that is better than with it, as above.
pub(super) fn worst(search: &Search, in_model: &[ModelTerm], names: usize) -> Option<usize> {
    Folds::new(search, in_model)?.worst(search, names, least(search))
}

/// By so many standard errors left-out stretches have to be foretold better with an effect that stays. Along a path what is undecided stays.
/// Settled positions are few, and where none is repeated nothing tells their noise: there every effect has to prove itself.
pub(super) fn least(search: &Search) -> f64 {
    if search.in_motion { -1.0 } else { 1.0 }
}

/// Whether an effect goes by which squares fall so much, with this standard error.
fn is_harm(least: f64, (gain, error): (f64, f64)) -> bool {
    gain < least * error
}

/// Normal equations of all samples and of each fold.
struct Folds {
    /// Columns as they are, m and rad.
    raw: DMatrix<f64>,
    /// What each column is of.
    part: Vec<Part>,
    /// The fold of each row.
    owner: Vec<usize>,
    /// The stretch of its recording that each row is in.
    stretch: Vec<usize>,
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
    /// Stretches of every recording; `None` where there are too few rows, or a column cannot be built.
    fn new(search: &Search, told: &[ModelTerm]) -> Option<Self> {
        let stretch = stretches(search)?;
        Self::of(search, (search.always(told), told), stretch.clone(), stretch)
    }

    /// The same, where drives give way by what is told alone.
    fn rigid(search: &Search, told: &[ModelTerm]) -> Option<Self> {
        let stretch = stretches(search)?;
        Self::of(search, (search.rows.linear.constant.clone(), told), stretch.clone(), stretch)
    }

    /// `always`: columns of what every model has; `owner`: the fold of each row; `stretch`: as [`stretches`].
    fn of(
        search: &Search,
        (always, told): (DMatrix<f64>, &[ModelTerm]),
        owner: Vec<usize>,
        stretch: Vec<usize>,
    ) -> Option<Self> {
        let (rows, mut raw) = (search.rows, always);
        let mut part = vec![Part::Geometry; raw.ncols()];
        let mut put = |own: &DMatrix<f64>, of: Part| {
            raw = joined(std::mem::take(&mut raw), own);
            part.extend(vec![of; own.ncols()]);
        };
        for (i, effect) in told.iter().enumerate() {
            put(&effect.raw(search)?, Part::Effect(i));
        }
        for (i, effect) in told.iter().enumerate() {
            if let Some(initial) = search.initial_conditions_of(effect) {
                put(&initial.raw(rows), Part::InitialCondition(i));
            }
        }
        let mut white = raw.clone();
        rows.whiten(&mut white);
        let grams = grams(&white, &rows.residual, &owner);
        Some(Folds { raw, part, owner, stretch, grams })
    }

    /// By how much the squares of what is left out fall with effect `i`, in units of their mean without it, and the standard error of that.
    fn gain(&self, search: &Search, i: usize) -> (f64, f64) {
        self.fall(search, &self.left_out(search, &|effect| effect != i), &self.left_out(search, &|_| true))
    }

    /// Of the first `names` effects the one that does the greatest harm, if one does.
    fn worst(&self, search: &Search, names: usize, least: f64) -> Option<usize> {
        let each = (0..names).map(|i| (i, self.gain(search, i)));
        let worse = each.filter(|(_, gain)| is_harm(least, *gain));
        worse.min_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b)).map(|(i, _)| i)
    }

    /// The same over those folds alone where it would be so if the model were right; `None` where there is none.
    fn gain_where_expected(&self, search: &Search, i: usize) -> Option<(f64, f64)> {
        let counts: Vec<bool> = (0..self.grams.len())
            .map(|fold| self.expected_fall(search.overdispersion, fold, i).is_some_and(|fall| fall > 0.0))
            .collect();
        if !counts.contains(&true) {
            return None;
        }
        let (without, with) =
            (self.left_out(search, &|effect| effect != i), self.left_out(search, &|_| true));
        Some(self.fall_where(search, (&without, &with), &|row| counts[self.owner[row]]))
    }

    /// By how much whitened squares of a fold would fall with effect `i` on average, were it what all folds together say, (79a): what the
    /// others do not foretell of it, and what the noise that they have makes of the coefficients.
    fn expected_fall(&self, overdispersion: f64, fold: usize, i: usize) -> Option<f64> {
        let width = self.part.len();
        let sum = |takes: &dyn Fn(usize) -> bool| {
            let start = (DMatrix::zeros(width, width), DVector::zeros(width));
            let taken = self.grams.iter().enumerate().filter(|(other, _)| takes(*other));
            taken.fold(start, |(gram, b), (_, own)| (gram + &own.0, b + &own.1))
        };
        let (all, toward) = sum(&|_| true);
        let mut truth = with_prior(all)?.solve(&toward);
        (0..width).filter(|c| self.part[*c] != Part::Effect(i)).for_each(|c| truth[c] = 0.0);
        let here = &self.grams[fold].0;
        let others = sum(&|other| other != fold).0 / overdispersion;
        let squares = |takes: &dyn Fn(usize) -> bool| {
            let is_lasting = |c: &usize| !self.is_own(*c, others[(*c, *c)]);
            let (lasting, own): (Vec<usize>, Vec<usize>) =
                (0..width).filter(|c| self.part[*c].effect().is_none_or(takes)).partition(is_lasting);
            let factor = with_prior(others.select_rows(&lasting).select_columns(&lasting))?;
            let mut off = truth.clone();
            let found = factor.solve(&(others.select_rows(&lasting) * &truth));
            lasting.iter().zip(found.iter()).for_each(|(c, x)| off[*c] -= x);
            // What is found again here takes its part.
            let columns = here.select_columns(&own);
            let again = with_prior(columns.select_rows(&own))?;
            let left = here - &columns * again.solve(&columns.transpose());
            let spread = left.select_rows(&lasting).select_columns(&lasting) * factor.inverse();
            Some(off.dot(&(left * &off)) + spread.trace())
        };
        Some(squares(&|effect| effect != i)? - squares(&|_| true)?)
    }

    /// Whether a column is found again in every fold: what effects were before anybody looked, and what no other fold knows.
    fn is_own(&self, column: usize, of_others: f64) -> bool {
        matches!(self.part[column], Part::InitialCondition(_)) || of_others == 0.0
    }

    /// By how much squares fall from one model to another, in units of their mean under the first, and the standard error of that.
    fn fall(&self, search: &Search, without: &[f64], with: &[f64]) -> (f64, f64) {
        self.fall_where(search, (without, with), &|_| true)
    }

    /// The same over the rows that count.
    fn fall_where(
        &self,
        search: &Search,
        (without, with): (&[f64], &[f64]),
        counts: &dyn Fn(usize) -> bool,
    ) -> (f64, f64) {
        let means = self.means(search, without, counts);
        self.sum(search, counts, &|row, angle| {
            (without[row].powi(2) - with[row].powi(2)) / if angle { means.rad } else { means.m }
        })
    }

    /// The standard error of the sum of squares of what is left, in units of their mean.
    fn error(&self, search: &Search, left: &[f64]) -> f64 {
        let means = self.means(search, left, &|_| true);
        let one = |row: usize, angle| left[row].powi(2) / if angle { means.rad } else { means.m } - 1.0;
        self.sum(search, &|_| true, &one).1
    }

    /// The sum over the rows that count, each by its number and whether it is an angle, and its standard error from how much stretches differ.
    fn sum(
        &self,
        search: &Search,
        counts: &dyn Fn(usize) -> bool,
        of_row: &dyn Fn(usize, bool) -> f64,
    ) -> (f64, f64) {
        let linear = search.rows.linear;
        let used = |row: &usize| !search.rows.whitener.out[*row] && counts(*row);
        let mut cells: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        for (number, span) in linear.spans.iter().enumerate() {
            for row in (span.rows.0..span.rows.1).filter(used) {
                *cells.entry((number, self.stretch[row])).or_default() += of_row(row, linear.angle[row]);
            }
        }
        sum_and_error(&cells.into_values().collect::<Vec<f64>>())
    }

    /// Squares of what is left of each stretch.
    fn squares(&self, search: &Search, left: &[f64]) -> LeftOut {
        let linear = search.rows.linear;
        let mut all = LeftOut::default();
        for (number, span) in linear.spans.iter().enumerate() {
            for row in (span.rows.0..span.rows.1).filter(|row| !search.rows.whitener.out[*row]) {
                let quantity = if linear.angle[row] { Quantity::Angle } else { Quantity::Length };
                all.add(number, self.stretch[row], quantity, left[row]);
            }
        }
        all
    }

    /// Mean squares of what is left in the rows that count.
    fn means(&self, search: &Search, left: &[f64], counts: &dyn Fn(usize) -> bool) -> ByQuantity<f64> {
        ByQuantity::of(|quantity| {
            let of = |row: &usize| search.rows.linear.angle[*row] == (quantity == Quantity::Angle);
            let used = |row: &usize| !search.rows.whitener.out[*row] && counts(*row);
            let rows: Vec<usize> = (0..left.len()).filter(used).filter(of).collect();
            let squares: f64 = rows.iter().map(|row| left[*row].powi(2)).sum();
            (squares / rows.len().max(1) as f64).max(f64::MIN_POSITIVE)
        })
    }

    /// Residuals of every row under the fit of geometry and these effects to the folds that the row is not in, m and rad. What no other fold
    /// knows, what effects were before anybody looked and a set-up of its own, is found again in the one that was left out.
    fn left_out(&self, search: &Search, takes: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let used = |c: &usize| self.part[*c].effect().is_none_or(takes);
        let columns: Vec<usize> = (0..self.part.len()).filter(used).collect();
        let of_columns = |(gram, b): (&DMatrix<f64>, &DVector<f64>)| {
            (gram.select_rows(&columns).select_columns(&columns), b.select_rows(&columns))
        };
        let solved = |fold: usize| -> Option<DVector<f64>> {
            let width = columns.len();
            let start = (DMatrix::zeros(width, width), DVector::zeros(width));
            let others = (0..self.grams.len()).filter(|other| *other != fold).map(|other| &self.grams[other]);
            let (gram, b) = others
                .map(|(gram, b)| of_columns((gram, b)))
                .fold(start, |(g, b), own| (g + own.0, b + own.1));
            let is_own = |c: &usize| self.is_own(columns[*c], gram[(*c, *c)]);
            let (own, lasting): (Vec<usize>, Vec<usize>) = (0..width).partition(is_own);
            let mut x = with_prior(gram)?.solve(&b);
            let (gram, b) = of_columns((&self.grams[fold].0, &self.grams[fold].1));
            let rows = gram.select_rows(&own);
            let toward = b.select_rows(&own) - rows.select_columns(&lasting) * x.select_rows(&lasting);
            let found = with_prior(rows.select_columns(&own))?.solve(&toward);
            own.iter().zip(found.iter()).for_each(|(c, value)| x[*c] = *value);
            Some(x)
        };
        let solutions: Vec<Option<DVector<f64>>> = (0..self.grams.len()).map(solved).collect();
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

#[cfg(test)]
mod tests {
    use super::is_harm;

    #[test]
    fn an_effect_goes_that_harms_by_a_standard_error_or_helps_by_less_where_it_has_to_prove_itself() {
        for (gain, stays, goes) in
            [(-2.0, true, true), (-0.5, false, true), (0.5, false, true), (2.0, false, false)]
        {
            assert_eq!((is_harm(-1.0, (gain, 1.0)), is_harm(1.0, (gain, 1.0))), (stays, goes), "{gain}");
        }
    }
}
