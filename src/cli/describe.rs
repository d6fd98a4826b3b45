//! `kincal describe`

use std::fmt::Write;
use std::path::PathBuf;

use kincal::CalibratedMachine;
use kincal::describe::{Description, describe};

use super::Common;
use super::output::{Outcome, angle, length};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Machine file
    machine: PathBuf,
    /// List every combination that a measurement does not see
    #[arg(long)]
    unseen: bool,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(args: &Args) -> Outcome {
    let calibrated = CalibratedMachine::open(&args.machine)?;
    let description = describe(calibrated.machine());
    let mut text = render(&description, args.unseen);
    if calibrated.samples() > 0 {
        let rms = calibrated.rms();
        let left: Vec<String> = rms.m.map(length).into_iter().chain(rms.rad.map(angle)).collect();
        let _ = writeln!(
            text,
            "\ncalibrated on {} samples, left over {} RMS",
            calibrated.samples(),
            left.join(" and ")
        );
    }
    args.common.say(&text);
    args.common.write_json(&description)
}

/// The description as people read it.
pub(crate) fn render(d: &Description, unseen: bool) -> String {
    let mut text = d.machine.clone();
    if let Some(about) = &d.about {
        let _ = write!(text, ": {about}");
    }
    text.push_str("\n\ntopology\n");
    for line in &d.topology {
        let _ = writeln!(text, "  {line}");
    }
    text.push_str(
        "\nmodel (exp(dh_j): small deviation twist (v; w) in frame j; M_j: declared initial pose)\n",
    );
    for line in &d.equation {
        let _ = writeln!(text, "  {line}");
    }
    text.push_str("\ndyads\n");
    for dyad in &d.dyads {
        let at = dyad.at_m.map(|x| format!("{:.4}", x * 1e3)).join(", ");
        let turned = if dyad.rotation_rad == [0.0; 3] {
            String::new()
        } else {
            format!(
                "  turned ({}) deg",
                dyad.rotation_rad.map(|x| format!("{:.4}", x.to_degrees())).join(", ")
            )
        };
        let joint = dyad.joint.as_ref().map(|j| format!("  joint {j}")).unwrap_or_default();
        let [t, r] = dyad.tolerance;
        let _ = writeln!(
            text,
            "  {:<10} {:<9}  at ({at}) mm{turned}{joint}  tolerance {}, {}",
            dyad.frame,
            dyad.branch,
            length(t),
            angle(r)
        );
    }
    let _ = writeln!(
        text,
        "\nidentifiable on general poses with measured points off the axes, of {} components of deviations",
        d.parameters
    );
    for kind in &d.identifiable {
        let [last, next] = kind.gap;
        let _ = writeln!(
            text,
            "  {:<26} {:>3} of {}   (smallest singular value seen {last:.0e}, largest not seen {next:.0e}, of the largest)",
            kind.measurement, kind.rank, kind.of
        );
    }
    if unseen {
        for kind in &d.identifiable {
            let _ =
                writeln!(text, "\nnot seen by {}: shifts (m, rad) that change no reading", kind.measurement);
            for combination in &kind.unseen {
                let parts: Vec<String> =
                    combination.iter().map(|(name, x)| format!("{x:+.4} {name}")).collect();
                let _ = writeln!(text, "  {}", parts.join("  "));
            }
        }
    } else {
        text.push_str("  (--unseen lists the combinations that each does not see)\n");
    }
    text
}
