//! Of two set-ups in known places, what is not identified is entered nowhere: two rules decide, that of the fit and that of the file.

use crate::common;
use crate::common::random::Random;
use kincal::export::{ExportOptions, Format, export};
use kincal::identify::{CalibrateOptions, Fit, calibrate};
use kincal::lie::Twist;
use kincal::location::UNSEEN;
use kincal::recording::Recording;
use kincal::sensor::Sensor;
use kincal::simulate::{Instrument, random_commands, random_deviations, recording};
use kincal::{CalibratedMachine, Machine};

/// Forms whose numbers are entered one by one.
const FORMS: [Format; 5] =
    [Format::Iso230, Format::Heidenhain, Format::Siemens, Format::Fanuc, Format::LinuxCnc];

/// One to three joints of a machine move, and an instrument looks on; in a set-up of its own whose place is known.
fn seen(truth: &CalibratedMachine, setup: &str, random: &mut Random) -> Recording {
    let machine = truth.machine();
    let joints = machine.commands().len();
    let mut any = |below: usize| (random.between(0.0, below as f64) as usize).min(below - 1);
    let moving: Vec<usize> = (0..=any(3)).map(|_| any(joints)).collect();
    let (distance, seed) = (any(2) == 0, any(1 << 20) as u64);
    let mut commands = random_commands(machine, 60, seed);
    commands.iter_mut().for_each(|q| {
        q.iter_mut().enumerate().filter(|(c, _)| !moving.contains(c)).for_each(|(_, q)| *q = 0.0);
    });
    let sensor = if distance { Sensor::Distance { absolute: true } } else { Sensor::Position };
    let mut instrument = Instrument::new(sensor, 1e-6, 0.0);
    let mut header = vec![format!("setup: {setup}")];
    if distance {
        instrument.state.workpiece_point_w.0 = [(); 3].map(|()| random.between(-0.3, 0.3));
        let [x, y, z] = instrument.state.workpiece_point_w.0;
        header.push(format!("workpiece_point[m]: {x}, {y}, {z}"));
    }
    let csv = recording(truth, &instrument, &commands, &header, seed + 1);
    Recording::from_bytes(&format!("{setup}.csv"), csv.into_bytes(), machine)
        .unwrap_or_else(|e| panic!("{e}"))
}

/// The numbers of a form by name, those that are not entered left out; nothing where the machine is none that the form holds.
fn entered(calibrated: &CalibratedMachine, form: Format) -> Vec<(String, f64)> {
    let options = ExportOptions::default().with_tool_length(0.1);
    let numbers = export(calibrated, form, &options).map_or(Vec::new(), |exported| exported.numbers);
    numbers.into_iter().filter_map(|number| Some((number.name, number.value?))).collect()
}

/// By number of a form, how it changes with the six components of every dyad, each times its tolerance; `w`, which is the part's, left out.
fn gradients(machine: &Machine, form: Format) -> Vec<(String, Vec<f64>)> {
    let numbers = |sign: f64, i: usize| {
        let mut dh = vec![[0.0; 6]; machine.dyads().len()];
        dh[i / 6][i % 6] = sign * machine.tolerance(i / 6).to_array()[i % 6];
        let dh = dh.into_iter().map(Twist::from_array).collect();
        entered(&CalibratedMachine::nominal(machine.clone()).with_deviations(dh), form)
    };
    let declared = entered(&CalibratedMachine::nominal(machine.clone()), form);
    let mut all: Vec<_> = declared.into_iter().map(|(name, _)| (name, Vec::new())).collect();
    for i in 0..6 * machine.dyads().len() {
        let (more, less) = (numbers(1.0, i), numbers(-1.0, i));
        for ((_, gradient), ((_, a), (_, b))) in all.iter_mut().zip(more.iter().zip(&less)) {
            gradient.push(if i / 6 == machine.w_index() { 0.0 } else { 0.5 * (a - b) });
        }
    }
    all
}

/// Which part of the variance that the tolerances allow to a number lies where the data see nothing.
fn unseen(gradient: &[f64], fit: &Fit) -> f64 {
    let information = &fit.information;
    let components = information.dyads.iter().enumerate().flat_map(|(j, offset)| {
        let places = offset.map(|offset| (0..6).map(move |k| (6 * j + k, offset + k)));
        places.into_iter().flatten()
    });
    let mut scaled = vec![0.0; information.positions.len()];
    for (i, place) in components {
        let at = information.positions.iter().position(|p| *p == place).expect("dyads have a prior");
        scaled[at] = gradient[i];
    }
    let columns = information.directions.column_iter().zip(&information.strength);
    let along = |column: &[f64]| column.iter().zip(&scaled).map(|(a, b)| a * b).sum::<f64>().powi(2);
    let sum: f64 = columns.filter(|(_, s)| **s == 0.0).map(|(column, _)| along(column.as_slice())).sum();
    sum / gradient.iter().map(|g| g * g).sum::<f64>().max(f64::MIN_POSITIVE)
}

#[test]
fn nothing_is_entered_that_two_known_set_ups_do_not_identify() {
    let (mut count, mut parts_of_set_ups) = (0, 0);
    for machine in ["bc_nutating_table", "bc_table_tilting"].map(common::machine) {
        let forms = FORMS.map(|form| (form, gradients(&machine, form)));
        for seed in 100..103 {
            let mut random = Random::new(seed);
            // So little that the machine as declared has the same gradients, to less than decides.
            let deviations = random_deviations(&machine, 0.1, seed);
            let truth = CalibratedMachine::nominal(machine.clone()).with_deviations(deviations);
            let recordings = ["one", "two"].map(|setup| seen(&truth, setup, &mut random));
            let (found, fit) = calibrate(&machine, &recordings, CalibrateOptions::default()).expect("a fit");
            // What a file holds is what decides.
            let text = found.to_ron();
            parts_of_set_ups += usize::from(text.contains("unseen_at_all"));
            let found = CalibratedMachine::parse("calibrated.ron", &text).expect("sound");
            for (form, gradients) in &forms {
                for (name, _) in entered(&found, *form) {
                    let (_, gradient) = gradients.iter().find(|(own, _)| *own == name).expect("a gradient");
                    let unseen = unseen(gradient, &fit);
                    let case = format!("{} {seed} {form}: {name}", machine.name());
                    assert!(unseen < 2.0 * UNSEEN, "{case}: {unseen:e} of it is not seen");
                    let error = fit.location_errors.errors.iter().find(|e| e.name == name);
                    assert!(error.is_none_or(|e| e.identified), "{case}: {error:?}");
                    count += 1;
                }
            }
        }
    }
    // There is something to enter, and something that the frame of a set-up takes part in.
    assert!(count > 30 && parts_of_set_ups > 1, "{count} {parts_of_set_ups}");
}
