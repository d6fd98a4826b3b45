//! What there is to tell of some lines of a program, put together in their order.

use super::report::{Listed, MOST_LISTED, Report, Worst};
use super::unseen::UnseenSums;

/// The report of some lines, and their sums of what the calibration has not seen.
#[derive(Default)]
pub(super) struct Part {
    pub report: Report,
    pub unseen: UnseenSums,
}

impl Part {
    /// Takes up the lines that follow.
    pub fn absorb(&mut self, next: Part) {
        self.unseen.absorb(&next.unseen);
        let (all, next) = (&mut self.report, next.report);
        if all.machine.is_empty() {
            all.machine = next.machine;
        }
        for (count, more) in [
            (&mut all.moves, next.moves),
            (&mut all.machine_moves, next.machine_moves),
            (&mut all.corrected_words, next.corrected_words),
            (&mut all.inserted_words, next.inserted_words),
            (&mut all.split_arcs, next.split_arcs),
            (&mut all.arc_lines, next.arc_lines),
            (&mut all.split_moves, next.split_moves),
            (&mut all.cycles, next.cycles),
            (&mut all.extrapolated_moves, next.extrapolated_moves),
        ] {
            *count += more;
        }
        for (worst, other) in [
            (&mut all.largest_cycle_m, next.largest_cycle_m),
            (&mut all.largest_correction_m, next.largest_correction_m),
            (&mut all.largest_correction_rad, next.largest_correction_rad),
            (&mut all.largest_left_m, next.largest_left_m),
            (&mut all.largest_left_rad, next.largest_left_rad),
            (&mut all.largest_mid_line_m, next.largest_mid_line_m),
            (&mut all.largest_arc_m, next.largest_arc_m),
            (&mut all.largest_reversal_m, next.largest_reversal_m),
        ] {
            take(worst, other);
        }
        list(&mut all.reversals, next.reversals);
        list(&mut all.large_steps, next.large_steps);
        list(&mut all.unseen_directions, next.unseen_directions);
        list(&mut all.unknown_ways, next.unknown_ways);
        list(&mut all.unknown_places, next.unknown_places);
        list(&mut all.singular, next.singular);
        list(&mut all.unreachable, next.unreachable);
        for beyond in next.extrapolated_joints {
            match all.extrapolated_joints.iter_mut().find(|other| other.joint == beyond.joint) {
                Some(other) => take(&mut other.by, beyond.by),
                None => all.extrapolated_joints.push(beyond),
            }
        }
    }
}

fn take(worst: &mut Worst, other: Worst) {
    worst.take(other.value, other.line);
}

fn list<T>(all: &mut Listed<T>, next: Listed<T>) {
    all.count += next.count;
    all.first.extend(next.first.into_iter().take(MOST_LISTED - all.first.len().min(MOST_LISTED)));
}
