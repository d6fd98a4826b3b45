//! A humanoid whose left arm is heavy for the joints that carry its right one.

use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::Library;
use kincal::predict::predict;

use super::sets;

#[test]
#[ignore = "needs the data sets"]
fn with_the_joints_of_both_arms_a_humanoid_is_foretold_on_rows_left_out() {
    // All five, where somebody has the time.
    let folds = std::env::var("KINCAL_FOLDS").ok().and_then(|n| n.parse().ok()).unwrap_or(1);
    for (set, fold) in sets::justin_with_both_arms()
        .iter()
        .flat_map(|set| set.folds().into_iter().take(folds).map(move |fold| (set, fold)))
    {
        let (library, request) = (Library::standard(), DiagnoseOptions::default());
        let mut said = diagnose(&set.machine, &fold.train, &library, &request, &|_| {})
            .unwrap_or_else(|e| panic!("{}: {e}", set.name));
        let names: Vec<_> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
        assert!(names.contains(&("gravity_compliance", "q2")), "{}: {names:?}", set.name);
        assert!(names.iter().all(|(effect, _)| *effect == "gravity_compliance"), "{}: {names:?}", set.name);
        let model = said
            .model(&set.machine, &fold.train, request.options, &|_| {})
            .unwrap_or_else(|e| panic!("{}: {e}", set.name));
        let figures =
            predict(&model, &fold.judged[0].test[0], None).unwrap_or_else(|e| panic!("{}: {e}", set.name));
        let rms = 1e3 * figures.rms.m.expect("lengths");
        println!("{}: {rms:.2} mm", set.name);
        assert!(rms < 4.3, "{}: {rms:.2} mm", set.name);
    }
}
