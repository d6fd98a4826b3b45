//! How long the columns of all candidate effects take on 7000 samples of the reference machine.

use std::time::Instant;

use kincal::effects::{Candidate, Library};

use crate::common::channels::prepared;

pub fn run() {
    let library = Library::standard();
    let machine = crate::common::machine("ac_table_tilting");
    let (facts, samples) = prepared(&machine, 7000);
    let start = Instant::now();
    let candidates = library.candidates(&machine, &facts);
    println!("{} candidates in {:?}", candidates.all.len(), start.elapsed());
    let (mut columns, mut sum) = (0, 0.0);
    let start = Instant::now();
    let mut slowest = Vec::new();
    for candidate in &candidates.all {
        let before = Instant::now();
        candidate.scan(&samples, |_, found| {
            sum += found.iter().map(|column| column[100]).sum::<f64>();
            columns += found.len();
        });
        slowest.push((before.elapsed(), candidate.effect.clone(), candidate.place, candidate.grid.len()));
    }
    println!("{columns} columns of 7000 samples in {:?} (sum {sum:.3})", start.elapsed());
    slowest.sort_by_key(|s| std::cmp::Reverse(s.0));
    slowest.iter().take(12).for_each(|s| println!("{s:?}"));
    let start = Instant::now();
    let plain: Vec<&Candidate> = candidates.all.iter().filter(|c| c.parameters.is_empty()).collect();
    let sum: f64 = plain.iter().flat_map(|c| &c.features).map(|f| f.over(&samples, &[])[100]).sum();
    println!("{} candidates without parameters in {:?} (sum {sum:.3})", plain.len(), start.elapsed());
}
