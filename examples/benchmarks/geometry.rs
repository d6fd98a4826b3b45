//! Constant geometry alone on real machines, judged where it was not fitted.

use kincal::Machine;
use kincal::identify::{CalibrateOptions, ErrorModel, Loss, calibrate};
use kincal::machine::Tolerance;

use crate::cross_validation::left_out;
use crate::outcome::{Outcome, given};
use crate::sets::{Data, arms};
use crate::table::{Table, three};

pub fn geometry(data: &Data) -> Outcome<String> {
    let mut table = Table::new(&[
        "set",
        "samples",
        "nominal",
        "geometric",
        "left out: nominal",
        "geometric",
        "left out is",
    ]);
    for set in arms(data)? {
        let (_, fit) = calibrate(&set.machine, &set.whole()?, CalibrateOptions::default())?;
        let all = given(fit.rms.m, "positions")?;
        let rest = left_out(&set, &set.machine, &ErrorModel::default(), CalibrateOptions::default())?;
        table.row(&[
            set.name.clone(),
            fit.samples.to_string(),
            three(1e3 * all.nominal),
            three(1e3 * all.geometric),
            three(rest.nominal),
            three(rest.calibrated),
            set.split.words(),
        ]);
    }
    Ok(table.after(
        "RMS of the 3-D distance between measured and modelled point, mm. Nominal: the machine as its file declares it, with what the \
         recording calls unknown found. Geometric: with six constant deviations of every frame. Default options.",
    ))
}

pub fn losses(data: &Data) -> Outcome<String> {
    let losses = [
        ("squares", Loss::Squares),
        ("Huber 3 (default)", Loss::Huber { k: 3.0 }),
        ("Huber 2", Loss::Huber { k: 2.0 }),
        ("Huber 1.345", Loss::Huber { k: 1.345 }),
        ("Tukey 4.685", Loss::Tukey { c: 4.685 }),
    ];
    let mut table = Table::new(&[&["set"][..], &losses.map(|(name, _)| name)].concat());
    for set in arms(data)? {
        let mut row = vec![set.name.clone()];
        for (_, loss) in losses {
            let options = CalibrateOptions::default().with_loss(loss);
            let rest = left_out(&set, &set.machine, &ErrorModel::default(), options)?;
            row.push(format!("{:.4}", rest.calibrated));
        }
        table.row(&row);
    }
    Ok(table.after("RMS on what is left out, mm, as in the section on geometry alone, under each loss."))
}

/// The machine with another tolerance (mm, deg) of the frames that state none.
fn with_tolerance(machine: &Machine, mm: f64, deg: f64) -> Outcome<Machine> {
    let tolerance = Tolerance { translation: 1e-3 * mm, rotation: deg.to_radians() };
    Ok(machine.clone().with_tolerance(tolerance)?)
}

pub fn tolerances(data: &Data) -> Outcome<String> {
    const DEGREES: [f64; 5] = [0.03, 0.1, 0.3, 1.0, 3.0];
    const MILLIMETRES: [f64; 5] = [0.2, 0.5, 1.0, 2.0, 5.0];
    let degrees = DEGREES.map(|deg| format!("{deg} deg"));
    let columns: Vec<&str> =
        ["set", "tolerance"].into_iter().chain(degrees.iter().map(String::as_str)).collect();
    let mut table = Table::new(&columns);
    for set in arms(data)? {
        for mm in MILLIMETRES {
            let mut row = vec![set.name.clone(), format!("{mm} mm")];
            for deg in DEGREES {
                let machine = with_tolerance(&set.machine, mm, deg)?;
                let rest = left_out(&set, &machine, &ErrorModel::default(), CalibrateOptions::default())?;
                row.push(three(rest.calibrated));
            }
            table.row(&row);
        }
    }
    Ok(table
        .after("RMS on what is left out, mm, by the tolerance of the frames that state none of their own."))
}
