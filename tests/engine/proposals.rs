//! What has no name gets a law: put together from the library's own terms, written as a family, found again on other recordings.

use crate::common;
use crate::common::random::Random;
use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::Library;
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::{Chain, Machine};

/// Noise of the instrument, m.
const SIGMA: f64 = 0.5e-6;
/// Rates of a path, rad/s.
const SEEN: [f64; 3] = [0.31, 0.23, 0.17];

/// A ball that a mill leads to and fro at these rates, rad/s, read in all three components; X is off by its acceleration times so many s².
fn path(machine: &Machine, name: &str, yields: f64, [a, b, c]: [f64; 3]) -> Recording {
    let chain: Chain<f64> = Chain::nominal(machine);
    let mut random = Random::new((1e4 * a) as u64);
    let mut text = String::from(
        "# measurement: position\n# tool_point[mm]: 0, 0, 0\nt[s],x[mm],y[mm],z[mm],px[mm],py[mm],pz[mm]\n",
    );
    for k in 0..900 {
        let t = 0.1 * f64::from(k);
        // Of one sine alone the acceleration is a scale error.
        let swing = |size: f64, rate: f64| (size * (rate * t).sin(), -size * rate * rate * (rate * t).sin());
        let (slow, fast) = (swing(0.12, a), swing(0.04, 2.7 * a));
        let q = [slow.0 + fast.0, 0.12 * (b * t).sin(), 0.1 * (c * t).cos()];
        let acceleration = slow.1 + fast.1;
        // The machine's order.
        let at = [q[1], q[0] + yields * acceleration, q[2]];
        let p = chain.w_from_t(&at).transform(Vec3([0.0; 3])).0.map(|x| x + SIGMA * random.normal());
        let row: Vec<String> = q.iter().chain(&p).map(|x| format!("{:.6}", 1e3 * x)).collect();
        text += &format!("{t:.3},{}\n", row.join(","));
    }
    Recording::from_bytes(name, text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

/// The file of effects that is proposed.
fn proposed(machine: &Machine, recordings: &[Recording], library: &Library) -> Option<(String, Vec<String>)> {
    let request = DiagnoseOptions::default().with_proposals();
    let said = diagnose(machine, recordings, library, &request, &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    let [proposal] = said.proposals.as_slice() else {
        assert!(said.proposals.is_empty(), "{:?}", said.proposals);
        return None;
    };
    assert_eq!(proposal.at, "x");
    assert!(!proposal.free);
    Some((said.proposed_library().expect("a file of effects"), proposal.law.clone()))
}

#[test]
fn a_law_is_put_together_for_what_has_no_name_and_found_again_on_another_path() {
    let machine = common::machine("xyz_mill");
    let without = Library::standard().without("inertial_error").unwrap_or_else(|e| panic!("{e}"));
    let seen =
        [path(&machine, "seen.csv", 1e-3, SEEN), path(&machine, "again.csv", 1e-3, [0.26, 0.27, 0.15])];
    let (ron, law) = proposed(&machine, &seen, &without).expect("a law");
    assert_eq!(law, ["a"]);
    let library = without.with_text("new.ron", &ron).unwrap_or_else(|e| panic!("{e}"));
    let other = [path(&machine, "other.csv", 0.7e-3, [0.36, 0.2, 0.19])];
    let said = diagnose(&machine, &other, &library, &DiagnoseOptions::default(), &|_| {});
    let said = said.unwrap_or_else(|e| panic!("{e}"));
    let found: Vec<_> = said.findings.iter().map(|f| (f.effect.as_str(), f.at.as_str())).collect();
    assert_eq!(found, [("proposed_1", "x")]);
}

#[test]
fn nothing_is_proposed_for_what_has_a_name_or_is_not_there() {
    let machine = common::machine("xyz_mill");
    for yields in [1e-3, 0.0] {
        let seen = [path(&machine, "seen.csv", yields, SEEN)];
        assert!(proposed(&machine, &seen, &Library::standard()).is_none());
    }
}
