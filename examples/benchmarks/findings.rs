//! What `kincal diagnose` says of real recordings, with nothing given but the machine file.

use kincal::diagnose::{DiagnoseOptions, Diagnosis, Finding, diagnose};
use kincal::effects::Library;
use kincal::identify::{Loss, fit_setup};

use crate::cross_validation::Squares;
use crate::outcome::{Outcome, given};
use crate::sets::{self, Data, Set, Split};
use crate::table::{Table, engineering, three};

pub fn of(set: &Set) -> Outcome<Diagnosis> {
    Ok(diagnose(&set.machine, &set.whole()?, &Library::standard(), &DiagnoseOptions::default(), &|_| {})?)
}

const COLUMNS: [&str; 5] =
    ["set", "found (probability)", "unexplained", "outliers", "held out: geometry, final"];
const WORDS: &str = "Held out: five stretches of each recording, in turn. A number behind a name is its first coefficient. Names of the same \
                     shape that the recordings cannot tell apart stand behind `or`.";

pub fn axes(data: &Data) -> Outcome<String> {
    let mut table = Table::new(&COLUMNS);
    for set in sets::axes(data)? {
        row(&set.name, &of(&set)?, &mut table);
    }
    Ok(table.after(WORDS))
}

pub fn arms(data: &Data) -> Outcome<String> {
    let mut table = Table::new(&COLUMNS);
    let mut set_ups =
        Table::new(&["set", "set-up left out", "geometry", "with what was found", "with placebos"]);
    for set in sets::arms(data)?.into_iter().chain(sets::justin_with_both_arms(data)?) {
        let said = of(&set)?;
        row(&set.name, &said, &mut table);
        for left in &said.set_ups_left_out {
            let Some(rms) = left.rms.m else { continue };
            let mm = |m: f64| three(1e3 * m);
            set_ups.row(&[
                set.name.clone(),
                left.setup.clone(),
                mm(rms.geometric),
                mm(rms.r#final),
                rms.placebo.map_or_else(String::new, mm),
            ]);
        }
    }
    let set_ups = set_ups.after(
        "Set-ups left out in turn: the machine is known from the others, where it stands is found again. Placebos are as many numbers that \
         multiply causes without a meaning. RMS of 3-D position, mm.",
    );
    Ok(format!("{}\n{set_ups}", table.after(WORDS)))
}

fn row(name: &str, said: &Diagnosis, table: &mut Table) {
    let findings: Vec<String> = said.findings.iter().map(finding).collect();
    let unexplained = said.unexplained.as_ref().map_or_else(String::new, |left| left.at.clone());
    let outliers: usize = said.outliers.iter().map(|o| o.lines.len()).sum();
    let held_out = match (said.held_out_rms.m, said.held_out_rms.rad) {
        (Some(rms), _) => [rms.geometric, rms.r#final].map(|x| engineering(x, "m")),
        (None, Some(rms)) => [rms.geometric, rms.r#final].map(|x| engineering(x.to_degrees(), "deg")),
        (None, None) => [String::new(), String::new()],
    };
    table.row(&[
        name.into(),
        if findings.is_empty() { "nothing".into() } else { findings.join("; ") },
        unexplained,
        if outliers == 0 { String::new() } else { outliers.to_string() },
        held_out.join(", "),
    ]);
}

fn finding(found: &Finding) -> String {
    let size = found.coefficients.first().map_or_else(String::new, |size| {
        let (value, unit) = if size.unit == "rad" {
            (size.value.to_degrees(), "deg")
        } else {
            (size.value, size.unit.as_str())
        };
        format!(" {}", engineering(value, unit))
    });
    let others: Vec<String> =
        found.confusable_with.iter().map(|c| format!("`{}` {}", c.effect, c.at)).collect();
    let or = if others.is_empty() { String::new() } else { format!(", or {}", others.join(", ")) };
    format!("`{}` {}{size} ({:.2}{or})", found.name(), found.at, found.probability)
}

/// Each trial of the Hilti JaiBot predicted by what the three others say.
pub fn trials(data: &Data) -> Outcome<String> {
    let whole = sets::arm(data, "hilti_jaibot")?;
    let mut table = Table::new(&["trial left out", "RMS, mm"]);
    let mut together = Squares::default();
    let recordings = whole.whole()?;
    for out in 0..recordings.len() {
        let mut train = recordings.clone();
        let test = [train.remove(out)];
        let request = DiagnoseOptions::default();
        let mut said = diagnose(&whole.machine, &train, &Library::standard(), &request, &|_| {})?;
        let model = said.model(&whole.machine, &train, request.options, &|_| {})?;
        let placed = fit_setup(&model, &test, Loss::default())?;
        let left = Squares::of(&placed, &test)?;
        together = together.with(left);
        table.row(&[whole.texts[out].name.trim_end_matches(".csv").to_string(), three(left.rms())]);
    }
    table.row(&["together".to_string(), three(together.rms())]);
    Ok(table.after(
        "Each trial is left out of the diagnosis in turn; `predict --fit-setup` then finds where the machine stands in it, and what belongs \
         to that. The same by hand: `kincal diagnose machines/hilti_jaibot.ron THREE.csv -o model.ron; kincal predict model.ron \
         FOURTH.csv --fit-setup`.",
    ))
}

/// Every fifth row of Justin's arms predicted by what the others say.
pub fn rows(data: &Data) -> Outcome<String> {
    let mut table = Table::new(&["set", "each fifth of the rows, mm", "together, mm", "named in each"]);
    for set in sets::justin_with_both_arms(data)? {
        debug_assert!(set.split == Split::Rows(5));
        let (mut each, mut together, mut always) = (Vec::new(), Squares::default(), None);
        for fold in set.folds()? {
            let request = DiagnoseOptions::default();
            let mut said = diagnose(&set.machine, &fold.train, &Library::standard(), &request, &|_| {})?;
            let names: Vec<String> =
                said.findings.iter().map(|f| format!("`{}` {}", f.effect, f.at)).collect();
            let before = always.take().unwrap_or_else(|| names.clone());
            always = Some(before.into_iter().filter(|name| names.contains(name)).collect::<Vec<_>>());
            let model = said.model(&set.machine, &fold.train, request.options, &|_| {})?;
            let left = Squares::of(&model, &fold.test)?;
            together = together.with(left);
            each.push(three(left.rms()));
        }
        let always = given(always, "folds")?;
        table.row(&[set.name.clone(), each.join(", "), three(together.rms()), always.join(", ")]);
    }
    Ok(table.after(
        "Every fifth row is left out of the diagnosis in turn, and predicted by the model that it writes.",
    ))
}
