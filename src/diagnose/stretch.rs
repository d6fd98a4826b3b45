//! When in the recordings something is there.

use super::finding::Where;
use super::search::Search;

/// In which recordings there is most of an energy of the rows, and when.
pub(super) fn wheres(search: &Search, energy: &dyn Fn(usize) -> f64) -> Vec<Where> {
    let linear = search.rows.linear;
    let all: f64 = (0..linear.residual.len()).map(energy).sum::<f64>().max(1e-300);
    let mut list: Vec<Where> = Vec::new();
    for (s, span) in linear.spans.iter().enumerate() {
        let own: f64 = (span.rows.0..span.rows.1).map(energy).sum();
        if own < 0.02 * all {
            continue;
        }
        let time = linear.samples[s].time.as_deref();
        let at = |row: usize| time.map(|t| t[linear.sample[row] - span.samples.0]);
        let mut sum = 0.0;
        let (mut from, mut to) = (None, None);
        for row in span.rows.0..span.rows.1 {
            sum += energy(row);
            if from.is_none() && sum > 0.02 * own {
                from = at(row);
            }
            if to.is_none() && sum > 0.98 * own {
                to = at(row);
            }
        }
        list.push(Where {
            recording: span.label.clone(),
            from_s: from,
            to_s: to,
            share_of_misfit: own / all,
        });
    }
    list.sort_by(|a, b| b.share_of_misfit.total_cmp(&a.share_of_misfit));
    list
}
