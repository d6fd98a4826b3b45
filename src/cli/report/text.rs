//! What there is to say of a diagnosis, a line each: on the terminal and on the page.

use std::fmt::Write;

use crate::diagnose::{
    Diagnosis, Finding, HeldOutPair, HeldOutRms, LeftOutRms, Meaningless, RmsByModel, SaidBy, SharedEffect,
    StandsStill, Thinned, Unexplained, UnnamedPart, UnseenSideBranch, Where,
};
use crate::effects::in_words;
use crate::feature::Dimension;

use crate::cli::output::{count, decimals, length};

/// A length or an angle, as people on a shop floor say it: um, mm; arcsec, deg.
pub(super) fn amount(si: f64, angle: bool) -> String {
    if angle { in_words(si, None, Dimension::ANGLE, None) } else { length(si) }
}

/// Lengths and angles of the same figure, those that there are, with what the second is of.
fn both<T: Copy>(lengths: Option<T>, angles: Option<T>) -> Vec<(T, bool)> {
    lengths.map(|x| (x, false)).into_iter().chain(angles.map(|x| (x, true))).collect()
}

/// Effects that could not be looked for, a line for each reason.
pub(super) fn not_tried(diagnosis: &Diagnosis) -> Vec<String> {
    diagnosis.not_tried.iter().map(|n| format!("{}: {}", n.effects.join(", "), n.because)).collect()
}

/// What the model has beside the findings, a line each: joints that have an effect of theirs too, and sides of approach.
pub(super) fn beside(diagnosis: &Diagnosis) -> Vec<String> {
    let mut by_effect: Vec<(&str, bool, Vec<&str>)> = Vec::new();
    for SharedEffect { effect, at, of_set_up } in &diagnosis.shared {
        match by_effect.iter_mut().find(|(known, ..)| known == effect) {
            Some((.., places)) => places.push(at),
            None => by_effect.push((effect, *of_set_up, vec![at])),
        }
    }
    let one = |(effect, of_set_up, places): (&str, bool, Vec<&str>)| {
        let because = match of_set_up {
            true => "what comes anew with every set-up hardly does so at one place alone",
            false => "every joint has it more or less",
        };
        format!("the model has a small {effect} of {} too: {because}", places.join(", "))
    };
    let still = |StandsStill { recording, at, direction, said_by, .. }: &StandsStill| {
        let side = if *direction > 0 { "rising" } else { "falling" };
        let hint = said_by.as_ref().map_or_else(String::new, |SaidBy { column, value }| {
            format!("; a column {column} of {value} would say so too")
        });
        format!(
            "{at} stands still all through {recording}, where the readings say that it came there {side}{hint}"
        )
    };
    let unseen = |UnseenSideBranch { on, columns, recorded_as }: &UnseenSideBranch| {
        let mend = match recorded_as {
            Some(machine) => format!("name a recording of {machine} of the same moments in this call too"),
            None => "`kincal join` puts recordings of the same moments beside each other".into(),
        };
        format!(
            "what hangs on {on} beside the chain is left out, since a recording has no column for each of its joints: {}; {mend}",
            columns.join(", ")
        )
    };
    let stand_still = diagnosis.stand_still.iter().map(still);
    let unseen = diagnosis.unseen_side_branches.iter().map(unseen);
    by_effect.into_iter().map(one).chain(stand_still).chain(unseen).collect()
}

/// Where there is nothing to be found.
pub(super) fn calm(diagnosis: &Diagnosis) -> String {
    let explains = match diagnosis.shared.is_empty() {
        true => "Constant geometry explains",
        false => "Constant geometry and what every joint has more or less explain",
    };
    format!("{explains} these recordings down to their noise: there is nothing else to be found in them.")
}

/// What was looked at, noise and root mean squares, a line each.
pub(super) fn figures(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(Thinned { every, samples }) = diagnosis.thinned {
        lines.push(format!(
            "so many samples are thinned out: causes were looked for in one of {every} ({samples}), the model is fitted to all"
        ));
    }
    for (noise, angle) in both(diagnosis.noise_floor.m, diagnosis.noise_floor.rad) {
        lines.push(format!("noise of the readings: {}", amount(noise, angle)));
    }
    let found = diagnosis.has_more_than_geometry();
    for (rms, angle) in both(diagnosis.rms.m, diagnosis.rms.rad) {
        let RmsByModel { nominal, geometric, r#final } = rms;
        let mut line = format!(
            "RMS of the residuals: {} as declared -> {} with geometry calibrated",
            amount(nominal, angle),
            amount(geometric, angle)
        );
        if found {
            let _ = write!(line, " -> {} with what is {} below", amount(r#final, angle), said(diagnosis));
        }
        lines.push(line);
    }
    for (HeldOutRms { geometric, r#final }, angle) in
        both(diagnosis.held_out_rms.m, diagnosis.held_out_rms.rad)
    {
        let mut line = format!("on stretches left out of the fit: {}", amount(geometric, angle));
        if found {
            let _ = write!(line, " -> {}", amount(r#final, angle));
        }
        lines.push(line);
    }
    lines.extend(set_ups(diagnosis));
    if diagnosis.dropped > 0 {
        let rows = count(diagnosis.dropped, "row", "rows");
        lines.push(format!("drop-outs: {rows} with a missing number, left out"));
    }
    lines.extend(outliers(diagnosis));
    lines
}

/// What is left of every set-up when the others alone say what the machine is like.
fn set_ups(diagnosis: &Diagnosis) -> Vec<String> {
    let found = diagnosis.has_more_than_geometry();
    let mut lines = Vec::new();
    for one in &diagnosis.set_ups_left_out {
        for (LeftOutRms { geometric, r#final, placebo }, angle) in both(one.rms.m, one.rms.rad) {
            let mut line = format!("set-up {} left out of the fit: {}", one.setup, amount(geometric, angle));
            if found {
                let _ = write!(line, " -> {}", amount(r#final, angle));
            }
            if let Some(placebo) = placebo.filter(|_| found) {
                let _ = write!(line, " ({} with placebos)", amount(placebo, angle));
            }
            if found && r#final > WORSE * geometric {
                let _ = write!(line, ": what is {} below does not hold there", said(diagnosis));
            }
            lines.push(line);
        }
    }
    lines
}

/// What is done with what the model has beside geometry.
fn said(diagnosis: &Diagnosis) -> &'static str {
    let nameless = diagnosis.unexplained.as_ref().is_some_and(|u| u.parts.iter().any(|part| part.modelled));
    match (diagnosis.findings.is_empty(), nameless) {
        (false, false) => "named",
        (false, true) => "named and modelled",
        (true, _) => "modelled",
    }
}

/// A meaningless cause that explains this part as much is told.
const TELLING: f64 = 0.3;
/// A set-up left out is worse by what is named where it has this many times the error that geometry leaves.
const WORSE: f64 = 1.1;
/// Lines of a file that are told one by one.
const FEW_LINES: usize = 8;

/// Samples that were left out as outliers, by recording, and what the others leave.
fn outliers(diagnosis: &Diagnosis) -> Vec<String> {
    let mut lines = Vec::new();
    for one in &diagnosis.outliers {
        let by: Vec<String> =
            both(one.largest.m, one.largest.rad).into_iter().map(|(x, angle)| amount(x, angle)).collect();
        let shown: Vec<String> = one.lines.iter().take(FEW_LINES).map(u64::to_string).collect();
        lines.push(format!(
            "outliers: {} of {}, off by up to {} ({} {}{}), left out of the fit",
            count(one.lines.len() as u64, "sample", "samples"),
            one.recording,
            by.join(" and "),
            if one.lines.len() == 1 { "line" } else { "lines" },
            shown.join(", "),
            if one.lines.len() > FEW_LINES { " ..." } else { "" },
        ));
    }
    let (m, rad) = (diagnosis.rms_without_outliers.m, diagnosis.rms_without_outliers.rad);
    for (rms, angle) in both(m, rad) {
        let mut line = format!("RMS without the outliers: {} with geometry", amount(rms.geometric, angle));
        if diagnosis.has_more_than_geometry() {
            let _ = write!(line, " -> {} with what is {} below", amount(rms.r#final, angle), said(diagnosis));
        }
        lines.push(line);
    }
    lines
}

/// What there is to say of a finding besides its sentence.
pub(super) fn about(diagnosis: &Diagnosis, finding: &Finding) -> Vec<String> {
    let mut lines = vec![format!(
        "{} at {}, probability {}; it explains {} of what geometry left over",
        finding.name(),
        places_of(finding),
        probability(finding.probability),
        percent(finding.share)
    )];
    if !finding.also_at.is_empty() {
        lines.push(
            "these recordings do not tell at which of these places; the model has it at the first".into(),
        );
    }
    for (HeldOutPair { before, after }, angle) in both(finding.held_out_rms.m, finding.held_out_rms.rad) {
        lines.push(format!(
            "held-out error: {} without it -> {} with it",
            amount(before, angle),
            amount(after, angle)
        ));
    }
    if let Some(Meaningless { cause, share }) = finding.placebo.as_ref().filter(|p| p.share > TELLING) {
        lines.push(format!(
            "placebo: {cause} in place of its own cause would explain {} as much",
            percent(*share)
        ));
    }
    if let Some(places) = places(&finding.r#where, diagnosis.recordings.len()) {
        lines.push(format!("it acts in {places}"));
    }
    for other in &finding.confusable_with {
        lines.push(format!(
            "it may be {} at {} instead (probability {})",
            other.effect,
            other.at,
            probability(other.probability)
        ));
    }
    for (test, of) in tests(finding) {
        lines.push(format!("next test, to tell {} apart: {test}", of.join(" and ")));
    }
    lines
}

/// Which measurements would tell a finding from its rivals, each with the rivals that it tells apart.
pub(super) fn tests(finding: &Finding) -> Vec<(&str, Vec<String>)> {
    let elsewhere = finding.also_at.iter().map(|other| {
        let name = format!("{} at {}", finding.effect, other.at);
        (other.separate_by.as_str(), name)
    });
    let instead = finding.confusable_with.iter().map(|other| {
        let name = if other.at == finding.at {
            other.effect.clone()
        } else {
            format!("{} at {}", other.effect, other.at)
        };
        (other.separate_by.as_str(), name)
    });
    let mut tests: Vec<(&str, Vec<String>)> = Vec::new();
    for (test, name) in elsewhere.chain(instead) {
        match tests.iter_mut().find(|(known, _)| *known == test) {
            Some((_, names)) => names.push(name),
            None => tests.push((test, vec![name])),
        }
    }
    tests
}

/// Where a finding is: `w or x` where the recordings do not tell them apart.
pub(super) fn places_of(finding: &Finding) -> String {
    let places =
        [finding.at.as_str()].into_iter().chain(finding.also_at.iter().map(|other| other.at.as_str()));
    places.collect::<Vec<_>>().join(" or ")
}

/// What there is to say of a structure without a name.
pub(super) fn about_unexplained(unexplained: &Unexplained) -> Vec<String> {
    let mut lines = Vec::new();
    lines.extend(unexplained.parts.iter().map(part));
    if let Some(places) = places(&unexplained.r#where, usize::MAX) {
        lines.push(format!("it stands out in {places}"));
    }
    lines.push(format!("next test: {}", next_test(unexplained)));
    lines
}

/// Which measurement shows more of a structure without a name.
pub(super) fn next_test(unexplained: &Unexplained) -> String {
    let at = unexplained.at.as_str();
    let goes_by_time = |part: &UnnamedPart| part.at == at && part.depends_on == ["time"];
    match at == "measurement" || unexplained.parts.iter().any(goes_by_time) {
        true => "the same path once more, and a stretch at rest".into(),
        false => {
            format!("a path on which {at} moves on its own, slowly, to and fro over all of its travel, twice")
        }
    }
}

/// One part: its place, what it follows, how large it is, and whether the model has it.
fn part(part: &UnnamedPart) -> String {
    let sizes: Vec<String> =
        both(part.rms.m, part.rms.rad).into_iter().map(|(rms, angle)| amount(rms, angle)).collect();
    let held_out: Vec<String> = both(part.held_out_rms.m, part.held_out_rms.rad)
        .into_iter()
        .map(|(pair, angle)| format!("{} -> {}", amount(pair.before, angle), amount(pair.after, angle)))
        .collect();
    let names: Vec<String> =
        part.names.iter().map(|name| format!("{} ({:.2})", name.effect, name.probability)).collect();
    let names = match names.is_empty() {
        true => String::new(),
        false => format!("; of all names for what is there {} fits best", names.join(", then ")),
    };
    format!(
        "something at {} that follows the {}: {} RMS; stretches left out of the fit {}; {}{names}",
        part.at,
        part.depends_on.join(" and the "),
        sizes.join(", "),
        held_out.join(", "),
        if part.modelled {
            "the model has it"
        } else {
            "told only, since too little of what was left out is foretold with it"
        }
    )
}

/// `rec_1.csv from 0 s to 61 s (80 %), rec_2.csv (20 %)`.
fn places(list: &[Where], recordings: usize) -> Option<String> {
    if list.is_empty() {
        return None;
    }
    let place = |place: &Where| {
        let mut text = place.recording.clone();
        if let (Some(from), Some(to)) = (place.from_s, place.to_s) {
            let _ = write!(text, " from {from:.0} s to {to:.0} s");
        }
        if recordings > 1 {
            let _ = write!(text, " ({} of its effect)", percent(place.share_of_misfit));
        }
        text
    };
    let shown: Vec<String> = list.iter().take(4).map(place).collect();
    let more = match list.len().saturating_sub(4) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    Some(shown.join(", ") + &more)
}

/// Two digits, and never a certainty.
pub(super) fn probability(p: f64) -> String {
    match p {
        p if p > 0.995 => "> 0.99".into(),
        p if p < 0.005 => "< 0.01".into(),
        p => format!("{p:.2}"),
    }
}

fn percent(share: f64) -> String {
    let value = 100.0 * share;
    if value < 0.1 { "less than 0.1 %".into() } else { format!("{value:.*} %", decimals(value, 2)) }
}
