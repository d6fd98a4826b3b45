//! Laws of the engine that hold for whatever is drawn. A draw takes a diagnosis, so that few are made by default and the rest where the
//! long tests run. They are the same each time: in one of some hundred, chance itself looks like structure, as the engine's odds say.

use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};

/// That a law holds for the first so many draws.
pub fn hold<S: Strategy>(cases: u32, drawn: S, law: impl Fn(S::Value) -> Result<(), TestCaseError>) {
    let config = ProptestConfig {
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        max_shrink_iters: 0,
        ..ProptestConfig::with_cases(cases)
    };
    TestRunner::new(config).run(&drawn, law).unwrap_or_else(|e| panic!("{e}"));
}
