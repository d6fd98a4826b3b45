//! Damaged inputs of every kind are accepted, or refused with a message and a mend, in time; nothing panics.

use std::time::Duration;

use crate::mutated::drive::{Task, run};
use crate::mutated::input::{Input, Kind};

/// `cases` of each kind; many more are run by `examples/mutated.rs`.
fn all_keep_their_promises(cases: u64) {
    let mut told = Vec::new();
    for kind in Kind::ALL {
        // Ten times what the slowest case takes without optimisation, on a machine that has other things to do.
        let (tally, findings) =
            run(Input::new(kind), Task { from: 0, cases, seed: 28, limit: Duration::from_secs(10) });
        assert_eq!(tally.accepted + tally.refused + tally.panics + tally.other, cases, "{}", kind.name());
        // Damage that nothing survives, or that nothing notices, tests nothing.
        assert!(
            tally.accepted > 0 && tally.refused > cases / 20,
            "{}: {} accepted",
            kind.name(),
            tally.accepted
        );
        let text = |text: &[u8]| String::from_utf8_lossy(text).into_owned();
        told.extend(
            findings.iter().map(|f| format!("{} {}: {}\n{}", f.input, f.number, f.says, text(&f.text))),
        );
    }
    assert!(told.is_empty(), "{}", told.join("\n\n"));
}

#[test]
fn mutated_inputs_are_accepted_or_refused() {
    all_keep_their_promises(300);
}

#[test]
#[ignore = "long: 8 000 cases of each kind"]
fn many_mutated_inputs_are_accepted_or_refused() {
    all_keep_their_promises(8_000);
}
