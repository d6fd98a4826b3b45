#!/usr/bin/env bash
# You write Rust. You have readings in arrays. You get a crate that calibrates, and depends on the library without its command line.
# `cargo` is on the path; give the folder of the project's build in CARGO_TARGET_DIR, and what is built there serves.
set -euo pipefail
project=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

mkdir src
cat > Cargo.toml <<TOML
[package]
name = "sag"
version = "0.1.0"
edition = "2024"

[dependencies]
kincal = { path = "$project", default-features = false }

# As tests/outside has it.
[profile.dev]
opt-level = 1
debug = false
debug-assertions = false
overflow-checks = false
incremental = false
lto = "off"

[profile.dev.package]
matrixmultiply = { opt-level = 2 }
rustfft = { opt-level = 2 }
chacha20 = { opt-level = 2 }
ron = { opt-level = 2 }
kincal = { opt-level = 0 }
TOML
cat > src/main.rs <<'RUST'
use kincal::identify::{CalibrateOptions, calibrate};
use kincal::{Machine, recording::Arrays};

fn main() -> kincal::Result<()> {
    let machine = Machine::parse("slide.ron", r#"Machine(
        name: "slide", units: (length: mm, angle: deg),
        workpiece: [(frame: "w")],
        tool: [(frame: "x", joint: Prismatic(axis: "x", travel: (0, 500))), (frame: "t", at: (0, 0, 80))],
    )"#)?;
    // The carriage sinks by 50 um over 500 mm; the tracker reads to 0.5 um.
    let x: Vec<f64> = (0..50).map(|k| 0.01 * f64::from(k)).collect();
    let p: Vec<[f64; 3]> = x.iter().map(|x| [*x, 5e-7 * (700.0 * x).sin(), 0.08 - 1e-4 * x]).collect();
    let recordings = [Arrays::position(&p).command("x", &x).recording("tracker", &machine)?];
    let (calibrated, fit) = calibrate(&machine, &recordings, CalibrateOptions::default())?;
    let rms = fit.rms.m.expect("positions are lengths");
    let way = calibrated.chain().w_from_t(&[0.4]).translation - calibrated.chain().w_from_t(&[0.0]).translation;
    println!("RMS {:.1} um, then {:.2} um; it sinks by {:.1} um over 400 mm", 1e6 * rms.nominal, 1e6 * rms.geometric, -1e6 * way.0[2]);
    Ok(())
}
RUST
cp "$project/Cargo.lock" .
out=$(cargo run --quiet)

# What there has to be: 100 um/m.
grep -q 'it sinks by \(39\|40\)\.[0-9] um' <<< "$out" || { echo "$0: $out" >&2; exit 1; }
echo "programmer: $out"
