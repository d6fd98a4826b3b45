//! What one of several recordings alone shows is modelled where it is: the others cannot foretell it, and say nothing against it.

use crate::common;
use crate::common::random::Random;
use kincal::diagnose::{DiagnoseOptions, diagnose};
use kincal::effects::Library;
use kincal::lie::Vec3;
use kincal::recording::Recording;
use kincal::{Chain, Machine};

/// Noise of the instrument, m.
const SIGMA: f64 = 0.5e-6;

/// A ball that a mill leads to and fro, read in all three components, X by so many m; its guideway is bent by so many m at 140 mm.
fn path(machine: &Machine, name: &str, seed: u64, moves: f64, bow: f64) -> Recording {
    let chain: Chain<f64> = Chain::nominal(machine);
    let mut random = Random::new(seed);
    let rates = [0.31, 0.23, 0.17].map(|rate| rate * random.between(0.9, 1.1));
    let mut text = String::from(
        "# measurement: position\n# tool_point[mm]: 0, 0, 0\nt[s],x[mm],y[mm],z[mm],px[mm],py[mm],pz[mm]\n",
    );
    for k in 0..400 {
        let t = 0.1 * f64::from(k);
        let q = [moves * (rates[0] * t).sin(), 0.1 * (rates[1] * t).sin(), 0.1 * (rates[2] * t).cos()];
        // The machine's order.
        let at = [q[1], q[0], q[2] + bow * (q[0] / 0.14).powi(2)];
        let p = chain.w_from_t(&at).transform(Vec3([0.0; 3])).0.map(|x| x + SIGMA * random.normal());
        let row: Vec<String> = q.iter().chain(&p).map(|x| format!("{:.6}", 1e3 * x)).collect();
        text += &format!("{t:.3},{}\n", row.join(","));
    }
    Recording::from_bytes(name, text.into_bytes(), machine).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn what_one_recording_alone_shows_is_modelled_and_nothing_is_where_nothing_is() {
    let machine = common::machine("xyz_mill");
    let library = Library::standard().without("straightness").unwrap_or_else(|e| panic!("{e}"));
    for bow in [8e-6, 0.0] {
        let all = [
            path(&machine, "yz.csv", 1, 0.003, bow),
            path(&machine, "yz_again.csv", 2, 0.003, bow),
            path(&machine, "xyz.csv", 3, 0.14, bow),
        ];
        let said = diagnose(&machine, &all, &library, &DiagnoseOptions::default(), &|_| {});
        let said = said.unwrap_or_else(|e| panic!("{e}"));
        let parts = said.unexplained.iter().flat_map(|unexplained| &unexplained.parts);
        let at: Vec<&str> = parts.filter(|part| part.modelled).map(|part| part.at.as_str()).collect();
        assert!(said.findings.is_empty(), "{:?}", said.findings);
        assert_eq!(at, if bow > 0.0 { vec!["z"] } else { vec![] });
    }
}
