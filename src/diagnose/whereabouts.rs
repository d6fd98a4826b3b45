//! Where structure without a name sits: which joint, frame or reading foretells most of it, whatever the law.
//!
//! Each place is asked with motions that it can make, times functions of what it knows: where the joint stands, the way it goes, how fast,
//! the time. By their evidence they compete with each other and with the named effects that came nearest, `docs/diagnosis-method.md` (69).

use rayon::prelude::*;

use super::course::{Course, FINE};
use super::curves::product;
use super::equations::judge;
use super::evidence::{Worth, evidence};
use super::marginal::Marginal;
use super::search::Search;
use super::series::{Series, Standing, over_range, series, smooth};
use super::sums::sums;
use crate::effects::Place;
use crate::machine::Machine;

/// What no place foretells by at least this part is the instrument's, or the time's.
const FORETOLD: f64 = 0.1;
/// A series comes into question if it takes at least this part of what the best one does, on blocks of samples.
const IN_QUESTION: f64 = 0.97;

/// The place that most of what geometry leaves over depends on, and another joint whose position it goes with.
pub(super) fn whereabouts(search: &Search, machine: &Machine) -> (Place, Option<usize>) {
    let series = standing(search, machine, search.base.clone());
    let hypotheses = search.hypotheses(&[]);
    let named = hypotheses.first().map(|r| Standing {
        place: search.candidates[r.candidate].place,
        with: None,
        evidence: r.weight,
        gain: r.reach,
    });
    let best = series.into_iter().chain(named).max_by(|a, b| a.evidence.total_cmp(&b.evidence));
    let energy = search.leftover(&search.base).energy;
    best.filter(|best| 2.0 * best.gain > FORETOLD * energy)
        .map_or((Place::Measurement, None), |best| (best.place, best.with))
}

/// The series of most evidence beside a marginal.
///
/// Blocks of samples hide a little of every curve, which may be more than what one place is ahead of another: they say which series come
/// into question, and all samples which of these it is.
pub(super) fn standing(search: &Search, machine: &Machine, marginal: Marginal) -> Option<Standing> {
    let (rows, overdispersion) = (search.rows, search.overdispersion);
    let field = rows.field(marginal);
    let one = |series: &Series, level: Option<usize>| {
        let (marginal, left) = level.map_or((&*field.marginal, &field.left), |level| {
            let (marginal, left) = rows.on_level(&field, level);
            (marginal, left)
        });
        let columns = level.map_or_else(|| series.columns(rows), |level| series.on_blocks(rows, level));
        let mut standing = None;
        let count = columns.ncols();
        judge((&columns, count), marginal, left, &[0], &mut |_, equations| {
            let Worth { evidence, gain, .. } =
                evidence(&equations.gram, &equations.toward, count, overdispersion, 0);
            standing = Some(series.standing(evidence, gain));
        });
        standing
    };
    let courses = courses(search, machine);
    let all = all(&courses);
    let coarse = |series: &Series| {
        let level = series.level(rows);
        one(series, level).map(|standing| (standing, level.is_some()))
    };
    // Made anew where they are asked for twice: all together they would be larger than everything else.
    let judged: Vec<Vec<Option<(Standing, bool)>>> =
        all.par_iter().map(|of| of.series(search).par_iter().map(coarse).collect()).collect();
    let most = judged.iter().flatten().flatten().map(|(standing, _)| standing.gain).fold(0.0, f64::max);
    let in_question =
        |(standing, on_blocks): &(Standing, bool)| *on_blocks && standing.gain > IN_QUESTION * most;
    let fine = |(of, judged): (&Of, &Vec<Option<(Standing, bool)>>)| -> Vec<Standing> {
        if !judged.iter().flatten().any(in_question) {
            return judged.iter().flatten().map(|(standing, _)| *standing).collect();
        }
        let settled = |(series, judged): (&Series, &Option<(Standing, bool)>)| {
            let judged = judged.as_ref()?;
            if in_question(judged) { one(series, None) } else { Some(judged.0) }
        };
        of.series(search).iter().zip(judged).filter_map(settled).collect()
    };
    let mut settled: Vec<Standing> = all.par_iter().zip(&judged).flat_map_iter(fine).collect();
    settled.extend(sums(rows, &field, &courses, overdispersion));
    settled.into_iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence))
}

/// The ways of all joints that move.
fn courses<'a>(search: &Search<'a>, machine: &Machine) -> Vec<Course<'a>> {
    let samples = &search.rows.linear.samples;
    machine.joints().filter_map(|(j, joint)| Course::of(samples, j, joint)).collect()
}

/// What series are of: one joint, one that goes with another, or the time.
enum Of<'a> {
    One(&'a Course<'a>),
    Two(&'a Course<'a>, &'a Course<'a>),
    Time,
}

/// Every series of every place.
fn all<'a>(courses: &'a [Course<'a>]) -> Vec<Of<'a>> {
    let others = |one: &'a Course<'a>| courses.iter().filter(|other| other.joint != one.joint);
    let pairs = courses.iter().flat_map(|one| others(one).map(move |other| Of::Two(one, other)));
    courses.iter().map(Of::One).chain(pairs).chain([Of::Time]).collect()
}

impl Of<'_> {
    fn series(&self, search: &Search) -> Vec<Series> {
        match self {
            Of::One(course) => course.series(),
            Of::Two(one, other) => {
                let (own, others) = (one.crossing(), other.crossing());
                let curves = own.iter().flat_map(|a| others.iter().map(|b| product(a, b))).collect();
                let (place, motions) = (Place::Joint(one.joint), vec![one.own()]);
                vec![Series { place, with: Some(other.joint), motions, curves, jumps: false }]
            }
            Of::Time => over_time(search),
        }
    }
}

/// What frames and readings do over time, as candidates say that they can.
fn over_time(search: &Search) -> Vec<Series> {
    let times: Option<Vec<Vec<f64>>> = search.rows.linear.samples.iter().map(|s| s.time.clone()).collect();
    let Some((clock, _)) = times.and_then(|times| over_range(&times.concat())) else { return Vec::new() };
    let mut all: Vec<Series> = Vec::new();
    let is_still = |place: Place| matches!(place, Place::Frame(_) | Place::Measurement);
    for candidate in search.candidates.iter().filter(|c| is_still(c.place)) {
        let at = all.iter().position(|series| series.place == candidate.place).unwrap_or_else(|| {
            let curves = smooth(&clock);
            all.push(Series {
                place: candidate.place,
                with: None,
                motions: Vec::new(),
                curves,
                jumps: false,
            });
            all.len() - 1
        });
        for part in candidate.coefficients.iter().flat_map(|c| &c.parts) {
            let motion = (part.slot, part.direction);
            if !all[at].motions.contains(&motion) {
                all[at].motions.push(motion);
            }
        }
    }
    let swift = all.iter().find(|series| series.place == Place::Measurement).map(|readings| Series {
        motions: readings.motions.clone(),
        curves: series(&clock, 1, FINE),
        ..*readings
    });
    all.extend(swift);
    all
}
