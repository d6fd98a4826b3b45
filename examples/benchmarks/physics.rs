//! Effects that are given on real machines: what they explain where they were not fitted, and how large they are.

use kincal::identify::{CalibrateOptions, ErrorModel, calibrate_model};
use kincal::variation::Varying;

use crate::cross_validation::{Squares, left_out};
use crate::given::terms;
use crate::outcome::Outcome;
use crate::sets::{self, Data, Set};
use crate::table::{Table, three};

/// Of a set: fitted on all rows, left out, and the coefficients.
struct Reached {
    fitted: f64,
    left_out: f64,
    coefficients: Vec<f64>,
}

fn reached(set: &Set, varying: Varying) -> Outcome<Reached> {
    let model = ErrorModel::default().with_varying(varying);
    let whole = set.whole()?;
    let (calibrated, fit) =
        calibrate_model(&set.machine, &whole, &model, CalibrateOptions::default(), &|_| {})?;
    let rest = left_out(set, &set.machine, &model, CalibrateOptions::default())?;
    Ok(Reached {
        fitted: Squares::of(&calibrated, &whole)?.rms(),
        left_out: rest.calibrated,
        coefficients: fit.coefficients.iter().map(|c| c.value).collect(),
    })
}

const WEIGHT: &str = "gravity_compliance@*#1";
const WAVES: &str = "cyclic_error@*:240#2";
const BOTH: &str = "gravity_compliance@*#1, cyclic_error@*:240#2";
const BOTH_ARMS: &str = "gravity_compliance@*#40";

/// Arms by set, with the effects that each is given.
const ARMS: [(&str, &[&str]); 10] = [
    ("kuka_14", &[WEIGHT]),
    ("panda_1", &[BOTH]),
    ("panda_2", &[BOTH]),
    ("panda_3", &[WAVES, "cyclic_error@*:237#2", "cyclic_error@*:120#2", BOTH]),
    ("panda_4", &[BOTH]),
    ("panda_6", &[WAVES, BOTH]),
    ("panda_7", &[WAVES, "cyclic_error@*:237#2", "cyclic_error@*:120#2"]),
    (
        "hilti_jaibot",
        &[
            WEIGHT,
            "gravity_compliance@*#1, column_compliance@column#9",
            "gravity_compliance@*#1, column_compliance@column#9, guide_clearance@column:30;1.98#6",
            "gravity_compliance@*#1, lateral_compliance@*, column_compliance@column#9, \
             guide_clearance@column:30;1.98#6, straightness@column#3, angular_error@column#3",
        ],
    ),
    ("dlr_justin left", &["gravity_compliance@*", "gravity_compliance@*, lateral_compliance@*"]),
    ("dlr_justin right", &["gravity_compliance@*", "gravity_compliance@*, lateral_compliance@*"]),
];

pub fn arms(data: &Data) -> Outcome<String> {
    let mut table = Table::new(&["set", "effects given", "terms", "fitted", "left out"]);
    for (name, given) in ARMS {
        rows(&sets::arm(data, name)?, given, &mut table)?;
    }
    for set in sets::justin_with_both_arms(data)? {
        rows(&set, &[BOTH_ARMS, &format!("{BOTH_ARMS}, lateral_compliance@*")], &mut table)?;
    }
    Ok(table.after(
        "RMS of 3-D position, mm, on all rows and on what is left out, which is as in the section on geometry alone. An effect is written \
         `effect@joint`, `*` for every joint; behind a colon stand its parameters in SI, behind `#` the number of its features.",
    ))
}

fn rows(set: &Set, given: &[&str], table: &mut Table) -> Outcome<()> {
    let row = |effects: &str, terms: usize, found: &Reached| {
        let name = set.name.clone();
        [name, effects.into(), terms.to_string(), three(found.fitted), three(found.left_out)]
    };
    table.row(&row("geometry alone", 0, &reached(set, Varying::default())?));
    for effects in given {
        let varying = terms(set, effects)?;
        let count = varying.terms.len();
        table.row(&row(&format!("`{effects}`"), count, &reached(set, varying)?));
    }
    Ok(())
}

/// What the coefficients of an axis say, in words.
type Sizes = fn(&[f64]) -> String;

const RESOLVER: &str = "servo_lag@c, graduation_error@c:4#4, coupling_misalignment@c, encoder_eccentricity@c";
const REVERSING: &str = "backlash@c, graduation_error@c:4#4, coupling_misalignment@c, encoder_eccentricity@c";
const SLOPED: &str = "servo_lag@c, graduation_error@c:4, coupling_misalignment@c, scale_error@c";

/// Single axes: set, effects, what their coefficients say, what the source of the recording says.
const AXES: [(&str, &str, Sizes, &str); 14] = [
    (
        "laser tracker",
        "position_dependent_backlash@c#3, positioning_error@c#2",
        |c| {
            // Ends and middle of the travel.
            let widths =
                [c[0] - c[1] + c[2], c[0] - c[2], c[0] + c[1] + c[2]].map(|w| format!("{:.2}", mdeg(w)));
            format!("play {} mdeg at 0, 20, 40 deg", widths.join(", "))
        },
        "34.1, 38.6, 31.2 mdeg",
    ),
    ("stroke", "cyclic_error@c:61.5#2", |c| format!("{:.2} mdeg", mdeg(c[0].hypot(c[1]))), "4.3 mdeg"),
    (
        "resolver, fourth harmonic",
        RESOLVER,
        |c| format!("delay {:.1} ms, fourth harmonic {:.2} deg", 1e3 * c[0], c[1].hypot(c[2]).to_degrees()),
        "34 ms, 8.16 deg",
    ),
    ("resolver, fourth harmonic", REVERSING, |_| String::new(), ""),
    (
        "resolver, second harmonic",
        RESOLVER,
        |c| format!("delay {:.1} ms, second harmonic {:.3} deg", 1e3 * c[0], c[5].hypot(c[6]).to_degrees()),
        "34 ms, 1.54 deg",
    ),
    ("resolver, second harmonic", REVERSING, |_| String::new(), ""),
    ("resolver, second harmonic", SLOPED, |_| String::new(), ""),
    ("reversals", "backlash@c", |c| format!("{:.1} mdeg in the mean", mdeg(c[0])), "17 to 32 mdeg by place"),
    ("reversals", "hysteresis@c:0.0005", |_| String::new(), ""),
    ("reversals", "presliding_friction@c", |_| String::new(), ""),
    (
        "resolver against motor",
        "cyclic_error@x:0.00025#4",
        |c| format!("{:.2} um, period 0.250 mm", 1e6 * c[0].hypot(c[1])),
        "20.6 um",
    ),
    (
        "two measuring systems",
        "positioning_error@x, backlash@x",
        |c| format!("backlash {:.2} um", 1e6 * c.last().copied().unwrap_or_default()),
        "no backlash",
    ),
    (
        "axis 1, laser, 10.0 mm",
        "positioning_error@x#4, position_dependent_backlash@x#3",
        |_| String::new(),
        "",
    ),
    (
        "axis 2, laser, 10.2 mm",
        "positioning_error@x#4, position_dependent_backlash@x#2",
        |_| String::new(),
        "",
    ),
];

fn mdeg(rad: f64) -> f64 {
    1e3 * rad.to_degrees()
}

pub fn axes(data: &Data) -> Outcome<String> {
    let sets = sets::axes(data)?;
    let mut table = Table::new(&[
        "set",
        "effects given",
        "left out: geometry alone",
        "with the effects",
        "size",
        "what the source says",
    ]);
    for (name, effects, sizes, source) in AXES {
        let Some(set) = sets.iter().find(|set| set.name == name) else { continue };
        let unit = if set.machine.name() == "linear_axis" { "um" } else { "mdeg" };
        // Squares are in mm or mdeg.
        let show = |rms: f64| format!("{} {unit}", three(if unit == "um" { 1e3 * rms } else { rms }));
        let bare = reached(set, Varying::default())?;
        let found = reached(set, terms(set, effects)?)?;
        table.row(&[
            name.into(),
            format!("`{effects}`"),
            show(bare.left_out),
            show(found.left_out),
            sizes(&found.coefficients),
            source.into(),
        ]);
    }
    Ok(table.after(
        "RMS on every fourth row, left out in turn. Effects are written as in the section on real arms. The last column is what the page or \
         report of the recording says, read off by other means. Seven rows with a stale channel make up the RMS of the two measuring systems.",
    ))
}
