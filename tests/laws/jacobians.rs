//! The analytic Jacobians of every shipped machine against forward-mode autodiff.

use crate::common;
use kincal::check::{PASS, check};

#[test]
fn jacobian_matches_dual_for_every_machine_at_zero_and_away_from_it() {
    for (name, machine) in common::machines() {
        for result in check(&machine, 12, 7) {
            assert!(
                result.worst <= PASS,
                "{name}: {} by {} with {} deviations differs by {:.1e}",
                result.measurement,
                result.by,
                result.deviations,
                result.worst
            );
        }
    }
}

#[test]
fn every_kind_of_measurement_is_checked() {
    let (_, machine) = common::machines().remove(0);
    let kinds: std::collections::BTreeSet<String> =
        check(&machine, 1, 1).into_iter().map(|c| format!("{} by {}", c.measurement, c.by)).collect();
    assert_eq!(kinds.len(), 14, "{kinds:?}");
}
