//! Laws of the library of effects, on every shipped machine.

use std::collections::BTreeSet;

use crate::common;
use crate::common::channels::{prepared, recording};
use kincal::effects::{Candidate, Grid, Identified, Library, Place, Range, RecordingFacts, StoredEffect};
use kincal::feature::samples_of;
use kincal::recording::Recording;
use kincal::variation::Slot;

/// A point in the middle of the grid.
fn middle(candidate: &Candidate) -> &[f64] {
    &candidate.grid[candidate.grid.len() / 2]
}

/// The names of `contract.md` section 4 with their coefficients.
const CONTRACT: [(&str, &[&str]); 22] = [
    ("backlash", &["width"]),
    ("hysteresis", &["width", "take_up"]),
    ("direction_dependent_pose", &["vx", "vy", "vz", "wx", "wy", "wz"]),
    ("scale_error", &["slope"]),
    ("positioning_error", &["peak"]),
    ("cyclic_error", &["amplitude", "phase", "period"]),
    ("encoder_eccentricity", &["amplitude", "phase", "per_rev"]),
    ("straightness", &["peak"]),
    ("angular_error", &["peak"]),
    ("axis_wobble", &["amplitude", "phase", "per_rev"]),
    ("radial_runout", &["amplitude", "phase", "per_rev"]),
    ("reversal_spike", &["height", "decay"]),
    ("servo_lag", &["lag"]),
    ("inertial_error", &["gain"]),
    ("gravity_compliance", &["peak"]),
    ("local_defect", &["height", "at", "width"]),
    ("thermal_drift", &["vx", "vy", "vz", "wx", "wy", "wz", "time_constant"]),
    ("setup_slip", &["vx", "vy", "vz", "wx", "wy", "wz", "at_time"]),
    ("sensor_drift", &["rate", "peak"]),
    ("latency", &["delay"]),
    ("vibration", &["amplitude", "frequency"]),
    ("outliers", &[]),
];

#[test]
fn every_name_and_coefficient_of_the_contract_is_there() {
    let library = Library::standard();
    assert!(library.names().len() >= 40, "{} families", library.names().len());
    let machine = common::machine("ac_table_tilting");
    let (facts, samples) = prepared(&machine, 200);
    let candidates = library.candidates(&machine, &facts);
    for (name, coefficients) in CONTRACT {
        let mut there = candidates.all.iter().filter(|c| c.effect == name).peekable();
        assert!(there.peek().is_some(), "{name} has no candidate: {:?}", candidates.skipped);
        for candidate in there {
            let sizes = identified(&library, candidate).sizes(&samples);
            let names: BTreeSet<&str> = sizes.iter().map(|s| s.name.as_str()).collect();
            assert!(coefficients.iter().all(|c| names.contains(c)), "{name}: {names:?}");
        }
    }
}

fn identified<'a>(library: &'a Library, candidate: &'a Candidate) -> Identified<'a> {
    let count = candidate.coefficients.len();
    let size = |i: usize| candidate.coefficients[i].size * (1.0 + 0.1 * i as f64);
    let unknowns = count + candidate.parameters.len();
    let mut covariance = vec![vec![0.0; unknowns]; unknowns];
    for (i, row) in covariance.iter_mut().enumerate() {
        let value = if i < count { size(i) } else { middle(candidate)[i - count] };
        row[i] = (0.01 * value).powi(2);
    }
    Identified {
        family: &library.families()[candidate.family],
        candidate,
        coefficients: (0..count).map(size).collect(),
        parameters: middle(candidate).to_vec(),
        covariance: Some(covariance),
    }
}

#[test]
fn every_family_is_finite_at_every_place_of_every_machine() {
    let library = Library::standard();
    let mut seen = BTreeSet::new();
    for (stem, machine) in common::machines() {
        let (facts, samples) = prepared(&machine, 250);
        let candidates = library.candidates(&machine, &facts);
        for candidate in &candidates.all {
            seen.insert(candidate.effect.clone());
            let at = candidate.place.name(&machine);
            let ends = [candidate.grid.first(), candidate.grid.last()];
            for point in ends.into_iter().flatten().map(Vec::as_slice).chain([middle(candidate)]) {
                for feature in candidate.features.iter().chain(&candidate.scatter) {
                    let column = feature.over(&samples, point);
                    assert_eq!(column.len(), 250);
                    assert!(
                        column.iter().all(|x| x.is_finite()),
                        "{stem}: {} at {at}, {point:?}",
                        candidate.effect
                    );
                }
            }
            for coefficient in &candidate.coefficients {
                for part in &coefficient.parts {
                    assert!(part.feature < candidate.features.len());
                    let length: f64 = part.direction.to_array().iter().map(|x| x * x).sum();
                    assert!((length - 1.0).abs() < 1e-12, "{stem}: {} at {at}", candidate.effect);
                    if let Slot::Before(j) | Slot::After(j) = part.slot {
                        assert!(j < machine.dyads().len());
                    }
                }
            }
        }
        for skipped in &candidates.skipped {
            assert!(!skipped.reason.is_empty(), "{stem}: {}", skipped.effect);
        }
    }
    // A recording of a few seconds is too short for what takes eight hours, and it is of one set-up.
    let missing: Vec<&str> = library.names().into_iter().filter(|n| !seen.contains(*n)).collect();
    let of_setups = ["homing_error", "scale_drift", "ground_compliance", "remounting_error"];
    let missing: Vec<&str> = missing.into_iter().filter(|name| !of_setups.contains(name)).collect();
    assert_eq!(missing, ["daily_drift"]);
}

#[test]
fn derivatives_by_parameters_are_those_of_central_differences() {
    let library = Library::standard();
    for stem in ["ac_table_tilting", "six_r_arm"] {
        let machine = common::machine(stem);
        let (facts, samples) = prepared(&machine, 300);
        for candidate in &library.candidates(&machine, &facts).all {
            let point = middle(candidate);
            for feature in &candidate.features {
                let (values, derivatives) = feature.with_derivatives(&samples, point);
                common::are_the_same_but_for_rounding(&values, &feature.over(&samples, point));
                for (i, parameter) in candidate.parameters.iter().enumerate().filter(|(_, p)| p.smooth) {
                    let h = 1e-6 * point[i].abs().max(1e-3 * (parameter.range.1 - parameter.range.0));
                    let moved = |by: f64| {
                        let mut p = point.to_vec();
                        p[i] += by;
                        feature.over(&samples, &p)
                    };
                    let (up, down) = (moved(h), moved(-h));
                    let largest = |column: &[f64]| column.iter().fold(0.0f64, |m, d| m.max(d.abs()));
                    // Truncation, and the rounding that a difference of so small a step suffers, of positions over a gap too.
                    let rounding = 1e-15 * largest(&values).max(1.0 / point[i].abs()) / h;
                    let allowed = 1e-4 * largest(&derivatives[i]) + rounding;
                    for (((u, d), here), dual) in up.iter().zip(&down).zip(&values).zip(&derivatives[i]) {
                        let difference = (u - d) / (2.0 * h);
                        let error = (difference - dual).abs();
                        // Where a play begins to carry its slope has two sides, and the derivative is that of one of them.
                        let sides = [(u - here) / h, (here - d) / h];
                        let (least, most) = (sides[0].min(sides[1]), sides[0].max(sides[1]));
                        assert!(
                            error <= allowed || (least - allowed..=most + allowed).contains(dual),
                            "{} {}: {dual} {difference}",
                            candidate.effect,
                            parameter.name
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn every_sentence_renders_with_all_its_numbers() {
    let library = Library::standard();
    for stem in ["ac_table_tilting", "six_r_arm"] {
        let machine = common::machine(stem);
        let (facts, samples) = prepared(&machine, 200);
        for candidate in &library.candidates(&machine, &facts).all {
            let found = identified(&library, candidate);
            let sizes = found.sizes(&samples);
            for size in &sizes {
                assert!(
                    size.value.is_finite() && size.std_error.is_none_or(f64::is_finite),
                    "{}: {size:?}",
                    candidate.effect
                );
            }
            let sentence = found.sentence(&machine, &sizes);
            assert!(!sentence.contains(['{', '}']) && !sentence.contains("NaN"), "{sentence}");
        }
    }
}

#[test]
fn an_effect_in_a_file_needs_no_library() {
    let library = Library::standard();
    let machine = common::machine("ac_table_tilting");
    let (facts, samples) = prepared(&machine, 200);
    for candidate in &library.candidates(&machine, &facts).all {
        let found = identified(&library, candidate);
        let sizes = found.sizes(&samples);
        let stored = found.stored(&machine, &sizes);
        let text = ron::to_string(&stored).expect("RON");
        let again: StoredEffect = ron::from_str(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        assert_eq!(again, stored);
        let place = match candidate.place {
            // A joint and its frame may bear one name: the joint is what is found first.
            Place::Frame(j) if machine.dyads()[j].joint.is_some() => Place::Joint(j),
            place => place,
        };
        assert_eq!(again.place(&machine), Some(place));
        let terms = again.bind(&machine).unwrap_or_else(|e| panic!("{e}\n{text}"));
        for ((value, parts), coefficient) in terms.iter().zip(&candidate.coefficients) {
            assert!(value.is_finite());
            for (bound, part) in parts.iter().zip(&coefficient.parts) {
                assert_eq!((bound.slot, bound.direction), (part.slot, part.direction));
                let here = candidate.features[part.feature].over(&samples, &found.parameters);
                assert_eq!(bound.feature.over(&samples, &[]), here, "{}", candidate.effect);
            }
        }
    }
}

#[test]
fn what_recordings_do_not_have_is_told() {
    let machine = common::machine("ac_table_tilting");
    let recordings = [recording(&machine, 50, false)];
    let facts = RecordingFacts::of(&machine, &recordings).expect("facts");
    let candidates = Library::standard().candidates(&machine, &facts);
    let reason = |effect: &str| {
        let skipped = candidates.skipped.iter().find(|s| s.effect == effect);
        skipped.unwrap_or_else(|| panic!("{effect} was tried")).reason.clone()
    };
    assert_eq!(reason("thermal_drift"), "the recordings have no time column `t`");
    assert!(reason("servo_lag").contains("no column t"));
    assert!(candidates.all.iter().any(|c| c.effect == "backlash"));
}

#[test]
fn what_happens_once_or_goes_on_needs_one_clock() {
    let (machine, library) = (common::machine("linear_axis"), Library::standard());
    let skipped = |recordings: &[Recording]| -> BTreeSet<String> {
        let facts = RecordingFacts::of(&machine, recordings).expect("facts");
        let skipped = library.candidates(&machine, &facts).skipped;
        skipped.into_iter().filter(|s| s.reason.contains("one clock")).map(|s| s.effect).collect()
    };
    let again = || recording(&machine, 500, true);
    assert!(skipped(&[again()]).is_empty());
    let names = skipped(&[again(), again()]);
    for name in ["setup_slip", "coupling_slip", "sensor_drift", "thermal_drift", "vibration"] {
        assert!(names.contains(name), "{name}: {names:?}");
    }
    assert!(!names.contains("servo_lag") && !names.contains("temperature_drift"), "{names:?}");
}

#[test]
fn a_last_digit_that_flickers_at_a_standstill_is_no_reversal() {
    let machine = common::machine("linear_axis");
    let name = &machine.commands()[0];
    let mut text = format!("# measurement: joint\nt[s],{name}[mm],{name}_meas[mm]\n");
    for k in 0..300 {
        let q = match k {
            0..100 => f64::from(k) * 0.5,
            100..200 => 50.0 + 1e-6 * f64::from(k % 2),
            _ => 50.0 + f64::from(k - 200) * 0.4,
        };
        text += &format!("{:.2},{q:.6},{q:.6}\n", f64::from(k) * 0.01);
    }
    let recordings = [Recording::from_bytes("f.csv", text.into_bytes(), &machine).expect("a recording")];
    let facts = RecordingFacts::of(&machine, &recordings).expect("facts");
    assert!(!facts.settled);
    let samples = samples_of(&recordings[0], &machine, &facts.dead_bands).expect("samples");
    let j = machine.joints().next().expect("a joint").0;
    assert!((facts.dead_bands[j] - 1.5e-9).abs() < 1e-12, "{:?}", facts.dead_bands);
    let joint = samples[0].joints[j].as_ref().expect("a joint");
    assert!(joint.direction.iter().all(|d| *d == 1.0));
}

#[test]
fn what_is_left_out_goes_with_its_forms_and_comes_back_by_a_file() {
    let standard = Library::standard();
    let family = standard.family("backlash").expect("it is there").clone();
    assert_eq!(standard.family("worn_stretch").map(|f| f.told_as()), Some("backlash"));
    let text = format!("Effects(families: [{}])", ron::to_string(&family).expect("a family is RON"));
    let back = standard.clone().with_text("back.ron", &text).and_then(|l| l.without("backlash"));
    let back = back.unwrap_or_else(|e| panic!("{e}"));
    assert!(back.family("backlash").is_some() && back.family("worn_stretch").is_none());
    assert!(standard.without("backlash").is_ok_and(|l| l.family("worn_stretch").is_none()));
    // Only files have it: then it goes.
    let text = text.replacen("backlash", "wear", 1);
    let worn = Library::standard().with_text("wear.ron", &text).unwrap_or_else(|e| panic!("{e}"));
    assert!(worn.clone().without("wear").is_ok_and(|l| l.family("wear").is_none()));
}

#[test]
fn a_family_left_out_is_gone_and_an_unknown_one_is_told() {
    let library = Library::standard().without("backlash").expect("it is there");
    assert!(library.family("backlash").is_none());
    assert!(library.families().iter().all(|f| f.look_alikes.iter().all(|l| l.effect != "backlash")));
    let error = library.without("backlash").expect_err("it is gone");
    assert!(error.to_string().contains("backlash") && error.mend().contains("hysteresis"), "{error}");
}

/// Share of a column that others explain, as a multiple correlation; columns and others have no mean.
fn correlation(column: &[f64], others: &[Vec<f64>]) -> f64 {
    let n = others.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let gram = nalgebra::DMatrix::from_fn(n, n, |i, k| dot(&others[i], &others[k]));
    let right = nalgebra::DVector::from_fn(n, |i, _| dot(column, &others[i]));
    let fit = gram.clone().pseudo_inverse(1e-12 * gram.trace()).expect("a pseudo-inverse") * &right;
    (fit.dot(&right) / dot(column, column)).max(0.0).sqrt()
}

fn centred(mut column: Vec<f64>) -> Vec<f64> {
    let mean = column.iter().sum::<f64>() / column.len() as f64;
    column.iter_mut().for_each(|x| *x -= mean);
    column
}

#[test]
fn neighbouring_points_of_every_grid_look_alike() {
    let library = Library::standard();
    let machine = common::machine("ac_table_tilting");
    let (facts, samples) = prepared(&machine, 4000);
    let mut judged = 0;
    for candidate in &library.candidates(&machine, &facts).all {
        let forms = &library.families()[candidate.family].parameters;
        // Of a large grid, some sixty pairs.
        let stride = 1 + candidate.grid.len() / 60;
        for pair in candidate.grid.windows(2).step_by(stride) {
            // Neighbours differ in one parameter; a step in the outer one of two is judged by the inner ones around it.
            let differs: Vec<usize> = (0..forms.len()).filter(|i| pair[0][*i] != pair[1][*i]).collect();
            let [i] = differs[..] else { continue };
            // Whole numbers have nothing between them. A step close to either end of the time is like no other.
            let (from, to) = candidate.parameters[i].range;
            let margin = 0.05 * (to - from);
            let at_an_end =
                forms[i].range == Range::Time && (pair[0][i] < from + margin || pair[1][i] > to - margin);
            if forms[i].grid == Grid::Whole || at_an_end {
                continue;
            }
            let columns = |point: &[f64]| -> Vec<Vec<f64>> {
                candidate.features.iter().map(|f| centred(f.over(&samples, point))).collect()
            };
            let (here, next) = (columns(&pair[0]), columns(&pair[1]));
            // Features that may be left out are refinements of those that may not.
            for (column, feature) in here.iter().zip(&candidate.features).take(candidate.least) {
                let power: f64 = column.iter().map(|x| x * x).sum();
                if power > 1e-9 && feature.takes(i) {
                    let found = correlation(column, &next);
                    assert!(found >= 0.9, "{}: {found:.3} between {pair:?}", candidate.effect);
                    judged += 1;
                }
            }
        }
    }
    assert!(judged > 1000, "{judged}");
}

#[test]
fn a_scan_of_the_grid_has_the_columns_of_each_point() {
    let library = Library::standard();
    let machine = common::machine("ac_table_tilting");
    let (facts, samples) = prepared(&machine, 150);
    for candidate in &library.candidates(&machine, &facts).all {
        let mut next = 0;
        candidate.scan(&samples, |index, columns| {
            assert_eq!(index, next);
            next += 1;
            // Every seventh point, and those around the seams of the blocks.
            if index % 7 != 0 && index % 64 > 1 {
                return;
            }
            for (column, feature) in columns.iter().zip(&candidate.features) {
                let direct = feature.over(&samples, &candidate.grid[index]);
                let largest = direct.iter().fold(0.0f64, |m, x| m.max(x.abs()));
                for (a, b) in column.iter().zip(&direct) {
                    assert!((a - b).abs() <= 1e-11 * largest, "{} {index}: {a} {b}", candidate.effect);
                }
            }
        });
        assert_eq!(next, candidate.grid.len());
    }
}
