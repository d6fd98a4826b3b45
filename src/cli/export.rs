//! `kincal export`

use std::path::PathBuf;

use serde_json::json;

use crate::calibration::CalibratedMachine;
use crate::export::{BaseFile, ExportOptions, Exported, FORMATS, Format, export};
use crate::import::Ends;
use crate::units::{Quantity, amount};

use super::Common;
use super::files::{Destination, Output};
use super::output::{Failure, Outcome, length, open_machine, print, write_whole};
use super::table::table;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Calibrated machine file
    #[arg(value_name = "CALIBRATED.ron")]
    machine: PathBuf,
    /// Form of the file
    #[arg(long, value_name = "FORMAT", value_parser = clap::builder::PossibleValuesParser::new(FORMATS.map(|(_, name)| name)))]
    to: String,
    /// Length of the tool that frame t is the tip of, as the control's tool table has it, such as 120mm
    #[arg(long, value_name = "LENGTH", default_value = "0mm", value_parser = |text: &str| amount(text, Quantity::Length))]
    tool_length: f64,
    /// linuxcnc-comp: the axis, where several have position errors
    #[arg(long, value_name = "JOINT")]
    axis: Option<String>,
    /// urdf: the file that the machine was imported from; its origins are written anew, every other byte is kept
    #[arg(long, value_name = "ROBOT.urdf")]
    base_file: Option<PathBuf>,
    /// urdf: link that carries the workpiece, as for import
    #[arg(long, value_name = "LINK", requires = "base_file")]
    base: Option<String>,
    /// urdf: link that is the tool, as for import
    #[arg(long, value_name = "LINK", requires = "base_file")]
    tip: Option<String>,
    /// Where to write the file; printed where nothing is said
    #[arg(short, long, value_name = "FILE")]
    output: Option<Output>,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let calibrated = open_machine(&args.machine, |path| CalibratedMachine::open(path))?;
    let format = Format::named(&args.to).unwrap_or(Format::Iso230);
    let of_one = [
        ("axis", args.axis.is_some(), Format::LinuxCncComp),
        ("base-file", args.base_file.is_some(), Format::Urdf),
    ];
    if let Some((flag, _, only)) = of_one.into_iter().find(|(_, told, only)| *told && *only != format) {
        return Err(Failure::Told {
            what: format!("--{flag} is of --to {} alone, and this is --to {}", only.name(), format.name()),
            mend: format!("leave --{flag} out"),
        });
    }
    let based =
        |file: &PathBuf| BaseFile::open(file, Ends { base: args.base.clone(), tip: args.tip.clone() });
    let options = ExportOptions {
        tool_length: args.tool_length,
        axis: args.axis.clone(),
        base_file: args.base_file.as_ref().map(based).transpose()?,
    };
    let exported = export(&calibrated, format, &options)?;
    let on_output = matches!(args.common.json, Some(Destination::StandardOutput));
    match &args.output {
        Some(output) => {
            write_whole(output, |out| {
                // Watched: an error here is told of the output.
                let _ = out.write_all(exported.text.as_bytes());
                Ok(())
            })?;
            args.common.say(&format!("{}written to {}\n", told(&exported), output.display()))?;
        }
        // Asked for, whatever else is not; JSON on standard output has it as a field.
        None if !on_output => print(&exported.text)?,
        None => {}
    }
    args.common.write_json(&json!({
        "machine": calibrated.machine().name(),
        "format": format.name(),
        "numbers": exported.numbers,
        "left_out": exported.left_out,
        "told": exported.told,
        "text": args.output.is_none().then_some(&exported.text),
    }))
}

/// What was chosen, what is not determined and what the file does not hold.
fn told(exported: &Exported) -> String {
    let mut text: String = exported.told.iter().map(|line| format!("{line}\n")).collect();
    let open: Vec<String> = (exported.numbers.iter())
        .filter_map(|number| Some(format!("  {}: {}\n", number.name, number.because.as_ref()?)))
        .collect();
    if !open.is_empty() {
        text.push_str("\nnot determined, and so not in the file:\n");
        text.push_str(&open.concat());
    }
    if !exported.left_out.is_empty() {
        text.push_str("\nnot in the file, with the error that this leaves at the tool:\n");
        let rows: Vec<Vec<String>> = (exported.left_out.iter())
            .map(|left| {
                let size = |m: Option<f64>| m.map_or("-".to_string(), length);
                let (max, rms) = (size(left.max_m), size(left.rms_m));
                vec![left.what.clone(), format!("max {max}"), format!("RMS {rms}"), left.because.clone()]
            })
            .collect();
        text.push_str(&table("  ", &[false, false, false, false], &rows));
    }
    text
}
