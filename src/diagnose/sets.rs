//! Effects weighed as sets: where two names together stand in the place of two others, no exchange of one for another finds them,
//! `docs/diagnosis-method.md` (82).

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::equations::Score;
use super::marginal::{square, with_prior, worth_of};
use super::policy::Rule;
use super::search::Search;
use super::steps::{NEAR, PASSES};
use super::terms::{Hypothesis, ModelTerm, side_by_side};

impl Search<'_> {
    /// A likelier set of no more effects than these, found with the families' own shapes, weighed with all that effects bring along; `None`
    /// where there is none.
    pub fn likelier_set(&self, in_model: &[ModelTerm]) -> Option<Vec<ModelTerm>> {
        if in_model.is_empty() || !Rule::WeighsSets.decides() {
            return None;
        }
        let hypotheses = self.in_question(in_model);
        let best = Sets::new(self, &hypotheses)?.likeliest(in_model.len());
        if best.len() == in_model.len() && best.iter().all(|k| *k < in_model.len()) {
            return None;
        }
        let mut set = self.entered_together(best.iter().map(|k| &hypotheses[*k]))?;
        // Beside the shapes of the others another name may be likelier.
        let _ = (0..PASSES).all(|_| self.likeliest(&mut set));
        (self.weight_of(&set) > self.weight_of(in_model)).then_some(set)
    }

    /// Logarithm of the evidence and the prior of a set.
    pub fn weight_of(&self, in_model: &[ModelTerm]) -> f64 {
        let beforehand = in_model.iter().map(|effect| self.beforehand(effect.candidate, &effect.score));
        self.worth(in_model) + beforehand.sum::<f64>()
    }

    /// Logarithm of how likely a hypothesis is beforehand, with what its sizes and other parameters cost.
    fn beforehand(&self, candidate: usize, score: &Score) -> f64 {
        self.priors[candidate] + score.evidence - score.at_best
    }

    /// These effects, and behind them what came next to each of them, what stands beside all of them, and what does beside none.
    fn in_question(&self, in_model: &[ModelTerm]) -> Vec<Hypothesis> {
        let own = |effect: &ModelTerm| Hypothesis::new(effect.candidate, 0.0, effect.score.clone());
        let mut all: Vec<Hypothesis> = in_model.iter().map(own).collect();
        let beside_others = (0..in_model.len()).map(|i| self.rivals_of(in_model, i));
        for compared in [self.hypotheses(in_model), self.hypotheses(&[])].into_iter().chain(beside_others) {
            for other in compared.iter().take(NEAR) {
                if all.iter().all(|known| known.candidate != other.candidate) {
                    all.push(other.clone());
                }
            }
        }
        all
    }

    /// Hypotheses taken in one beside the other.
    fn entered_together<'h>(
        &self,
        hypotheses: impl Iterator<Item = &'h Hypothesis>,
    ) -> Option<Vec<ModelTerm>> {
        let mut set: Vec<ModelTerm> = Vec::new();
        for hypothesis in hypotheses {
            let near = self.hypotheses(&set).iter().take(NEAR).map(|r| r.candidate).collect();
            let (ground, candidate) = (self.ground(&set, None), &self.candidates[hypothesis.candidate]);
            let field = self.rows.field(ground.clone());
            let score =
                self.rows.score_at(candidate, &hypothesis.score.parameters, &field, self.overdispersion)?;
            let entered =
                self.settle(&Hypothesis::new(hypothesis.candidate, score.evidence, score), &ground)?;
            set.push(ModelTerm { near, ..entered });
        }
        Some(set)
    }
}

/// What hypotheses are worth in sets.
struct Sets {
    /// Columns of each.
    columns: Vec<Range<usize>>,
    /// Logarithm of how likely each is beforehand.
    beforehand: Vec<f64>,
    /// The first that is the same effect at the same place.
    alike: Vec<usize>,
    all: Normal,
    overdispersion: f64,
}

/// Normal equations of all hypotheses beside some of them.
#[derive(Clone)]
struct Normal {
    gram: DMatrix<f64>,
    toward: DVector<f64>,
}

impl Sets {
    /// Of hypotheses with the families' own shapes.
    fn new(search: &Search, hypotheses: &[Hypothesis]) -> Option<Self> {
        let candidate = |hypothesis: &Hypothesis| &search.candidates[hypothesis.candidate];
        let white = |hypothesis: &Hypothesis| {
            let all = search.rows.of(candidate(hypothesis), &hypothesis.score.parameters)?;
            Some(all.columns(0, hypothesis.score.coefficients) * hypothesis.score.room)
        };
        let each: Vec<DMatrix<f64>> = hypotheses.iter().map(white).collect::<Option<_>>()?;
        let mut end = 0;
        let range = |own: &DMatrix<f64>| {
            end += own.ncols();
            end - own.ncols()..end
        };
        let name = |hypothesis: &Hypothesis| (&candidate(hypothesis).effect, candidate(hypothesis).place);
        let first = |own: &Hypothesis| hypotheses.iter().position(|other| name(other) == name(own));
        let white = side_by_side(&each.iter().collect::<Vec<_>>(), search.rows.residual.len());
        Some(Sets {
            columns: each.iter().map(range).collect(),
            beforehand: hypotheses.iter().map(|own| search.beforehand(own.candidate, &own.score)).collect(),
            alike: hypotheses.iter().map(first).collect::<Option<_>>()?,
            all: Normal {
                gram: square(&white) - square(&search.base.along(&white.as_view())),
                toward: white.tr_mul(&search.base.apply(&search.rows.residual)),
            },
            overdispersion: search.overdispersion,
        })
    }

    /// The likeliest set that is reached from the first `most` hypotheses by steps of two at a time, each the best one, of no more than so many.
    fn likeliest(&self, most: usize) -> Vec<usize> {
        let found: Vec<usize> = (0..most).collect();
        let mut best = (self.weight(&self.all, &found), found);
        while let Some(better) = self.better(&best, most) {
            best = better;
        }
        best.1
    }

    /// The likeliest set that differs by two effects at most, if it is likelier.
    fn better(&self, (weight, set): &(f64, Vec<usize>), most: usize) -> Option<(f64, Vec<usize>)> {
        let without = |i: usize, j: usize| -> Vec<usize> {
            let stays = |(n, k): (usize, &usize)| (n != i && n != j).then_some(*k);
            set.iter().enumerate().filter_map(stays).collect()
        };
        let pairs = (0..=set.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        let mut best = (*weight, None);
        for rest in pairs.map(|(i, j)| without(i, j)) {
            let Some((beside, own)) =
                self.beside(&rest).map(|beside| (beside, self.weight(&self.all, &rest)))
            else {
                continue;
            };
            let is_other = |a: usize, b: usize| self.alike[a] != self.alike[b];
            let may = (0..self.columns.len()).filter(|a| rest.iter().all(|b| is_other(*a, *b)));
            let may: Vec<usize> = may.collect();
            let mut weigh = |more: &[usize]| {
                let weight = own + self.weight(&beside, more);
                if rest.len() + more.len() <= most && weight > best.0 {
                    best = (weight, Some([rest.as_slice(), more].concat()));
                }
            };
            weigh(&[]);
            for (n, a) in may.iter().enumerate() {
                weigh(&[*a]);
                may[..n].iter().filter(|b| is_other(*a, **b)).for_each(|b| weigh(&[*a, *b]));
            }
        }
        best.1.map(|set| (best.0, set))
    }

    /// Logarithm of the evidence of these, with these normal equations, and of their prior.
    fn weight(&self, beside: &Normal, set: &[usize]) -> f64 {
        let own = self.columns_of(set);
        let gram = beside.gram.select_rows(&own).select_columns(&own);
        worth_of(gram, &beside.toward.select_rows(&own), self.overdispersion)
            + set.iter().map(|k| self.beforehand[*k]).sum::<f64>()
    }

    fn columns_of(&self, set: &[usize]) -> Vec<usize> {
        set.iter().flat_map(|k| self.columns[*k].clone()).collect()
    }

    /// Normal equations of all hypotheses beside a set, whose coefficients are integrated out.
    fn beside(&self, set: &[usize]) -> Option<Normal> {
        let own = self.columns_of(set);
        if own.is_empty() {
            return Some(self.all.clone());
        }
        let across = self.all.gram.select_columns(&own);
        let factor = with_prior(across.select_rows(&own) / self.overdispersion)?;
        let solved = factor.solve(&across.transpose()) / self.overdispersion;
        Some(Normal {
            gram: &self.all.gram - &across * &solved,
            toward: &self.all.toward - solved.tr_mul(&self.all.toward.select_rows(&own)),
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::{Normal, Sets};

    /// Hypotheses of one column each, and what the recordings say.
    fn sets(columns: &[[f64; 3]], toward: [f64; 3], beforehand: &[f64]) -> Sets {
        let white = DMatrix::from_fn(3, columns.len(), |row, column| 10.0 * columns[column][row]);
        let seen = DMatrix::from_column_slice(3, 1, &toward) * 10.0;
        Sets {
            columns: (0..columns.len()).map(|k| k..k + 1).collect(),
            beforehand: beforehand.to_vec(),
            alike: (0..columns.len()).collect(),
            all: Normal { gram: white.tr_mul(&white), toward: white.tr_mul(&seen).column(0).into() },
            overdispersion: 1.0,
        }
    }

    #[test]
    fn two_effects_take_the_place_of_two_others_where_no_exchange_of_one_is_likelier() {
        let columns = [[0.7, 0.7, 0.5], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let sets = sets(&columns, [1.0, 1.0, 0.0], &[-8.0, -8.0, -5.0, -5.0]);
        let weight = |set: &[usize]| sets.weight(&sets.all, set);
        for one in [[2, 1], [3, 1], [0, 2], [0, 3]] {
            assert!(weight(&one) < weight(&[0, 1]), "{one:?}");
        }
        let mut best = sets.likeliest(2);
        best.sort_unstable();
        assert_eq!(best, [2, 3]);
        // Beside one of them the other weighs as much as both do together without it.
        let beside = sets.beside(&[2]).expect("positive definite");
        assert!((weight(&[2]) + sets.weight(&beside, &[3]) - weight(&[2, 3])).abs() < 1e-9);
    }

    #[test]
    fn what_says_nothing_goes_and_no_effect_stands_twice_at_one_place() {
        let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]];
        let mut sets = sets(&columns, [1.0, 0.0, -1.0], &[-5.0, -5.0, -5.0]);
        let mut both = sets.likeliest(2);
        both.sort_unstable();
        sets.alike[2] = 0;
        assert_eq!((both, sets.likeliest(2)), (vec![0, 2], vec![0]));
    }
}
