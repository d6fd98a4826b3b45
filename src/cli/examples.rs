//! Calls that `--help` and the manual pages show.

use clap::Command;

/// Names of commands, what a call is for, and the call behind `kincal`.
const EXAMPLES: &[(&str, &[(&str, &str)])] = &[
    (
        "describe",
        &[
            ("Where the tool is, to be compared with the machine", "describe mill.ron --at x=100mm,b=90deg"),
            ("What these recordings see of it", "describe mill.ron bk4.csv tracker.csv"),
        ],
    ),
    ("check", &[("Every Jacobian at 100 positions", "check mill.ron --poses 100")]),
    (
        "calibrate",
        &[
            (
                "The machine as it is, and a report",
                "calibrate mill.ron bk1.csv bk4.csv -o calibrated.ron --report out.html",
            ),
            (
                "A robot by a tracker, outliers weighed less",
                "calibrate arm.ron tracker.csv --loss huber -o calibrated.ron",
            ),
        ],
    ),
    ("normal", &[("What one night's recording adds", "normal arm.ron night.csv -o night.part.ron")]),
    ("merge", &[("The machine from all of these", "merge monday.part.ron tuesday.part.ron -o model.ron")]),
    ("compare", &[("All schemes, judged by another recording", "compare mill.ron bk4.csv --judge bk1.csv")]),
    (
        "predict",
        &[
            ("Residuals, sample by sample", "predict calibrated.ron kept.csv -o residuals.csv"),
            (
                "The instrument stands elsewhere today",
                "predict calibrated.ron today.csv --fit-setup --json today.json",
            ),
        ],
    ),
    ("join", &[("Two arms at the same moments", "join right.csv left.csv --as left -o both.csv")]),
    (
        "diagnose",
        &[
            (
                "What physics is left, with pictures",
                "diagnose mill.ron bk4.csv --report out.html -o calibrated.ron",
            ),
            (
                "Without a family, with one of your own",
                "diagnose mill.ron bk4.csv --without hysteresis --effects mine.ron",
            ),
        ],
    ),
    (
        "compensate",
        &[(
            "A program that cuts as it was meant",
            "compensate calibrated.ron part.nc -o part_compensated.nc",
        )],
    ),
    (
        "verify",
        &[(
            "Block by block, to two micrometres",
            "verify part.nc part_compensated.nc calibrated.ron --tolerance 2um",
        )],
    ),
    (
        "simulate",
        &[
            (
                "A ballbar test of a machine whose errors are drawn",
                "simulate mill.ron --test BK4 --random 1 --noise 0.5um -o bk4.csv",
            ),
            (
                "Poses for a tracker",
                "simulate arm.ron --test poses --count 50 --measure position -o tracker.csv",
            ),
        ],
    ),
    (
        "new",
        &[
            ("Like one that comes with the program", "new --like bc_head_table -o mill.ron"),
            ("By questions", "new -o mill.ron"),
        ],
    ),
    (
        "import",
        &[
            ("An arm up to its flange", "import robot.urdf --base base_link --tip tool0 -o robot.ron"),
            ("A table of Denavit and Hartenberg", "import table.csv --dh -o robot.ron"),
        ],
    ),
    (
        "convert",
        &[
            (
                "A tracker's table",
                "convert tracker.csv --machine arm.ron --unit length=m --head 'workpiece_frame: unknown' -o rec.csv",
            ),
            (
                "A ballbar's readings and the test that ran",
                "convert bar.csv --machine mill.ron --path 'BK4 --length 100mm --feed 500mm/min' -o bk4.csv",
            ),
        ],
    ),
    (
        "export",
        &[
            ("Numbers for a control", "export calibrated.ron --to siemens --tool-length 120mm"),
            (
                "The URDF file with corrected origins",
                "export calibrated.ron --to urdf --base-file robot.urdf -o corrected.urdf",
            ),
        ],
    ),
    ("machines", &[("A file to start from", "machines scara > my.ron")]),
    ("completions", &[("For this shell", "completions bash > kincal.bash")]),
    ("man", &[("A page to be read by man", "man calibrate > kincal-calibrate.1")]),
    ("demo", &[("With the report somewhere else", "demo --report demo.html")]),
];

/// What stands before a call.
const CALL: &str = "    kincal ";

/// Whether a line of help is a call, ready to be pasted.
pub(super) fn is_call(line: &str) -> bool {
    line.starts_with(CALL)
}

/// The same command line with examples behind the help of each command.
pub(super) fn shown(command: Command) -> Command {
    command.mut_subcommands(|own| {
        let Some((_, calls)) = EXAMPLES.iter().find(|(name, _)| *name == own.get_name()) else { return own };
        let lines: Vec<String> =
            calls.iter().map(|(what, call)| format!("  {what}:\n{CALL}{call}")).collect();
        let title = if calls.len() == 1 { "Example" } else { "Examples" };
        let before =
            own.get_after_help().map_or_else(String::new, |text| format!("{}\n\n", text.to_string().trim()));
        own.after_help(format!("{before}{title}:\n{}", lines.join("\n")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_examples_that_are_understood() {
        let all = crate::cli::command();
        for own in all.get_subcommands() {
            let calls = EXAMPLES.iter().find(|(name, _)| *name == own.get_name());
            let (_, calls) = calls.unwrap_or_else(|| panic!("{} has no example", own.get_name()));
            for (_, call) in *calls {
                let quoted = call.split('\'').enumerate().flat_map(|(i, part)| match i % 2 {
                    0 => part.split_whitespace().map(String::from).collect(),
                    _ => vec![part.to_string()],
                });
                // What stands behind `>` is the shell's.
                let own = quoted.take_while(|word| word != ">");
                let words = std::iter::once("kincal".to_string()).chain(own);
                if let Err(error) = all.clone().try_get_matches_from(words) {
                    panic!("{call}: {error}");
                }
            }
        }
    }
}
