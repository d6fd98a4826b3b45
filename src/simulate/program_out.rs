//! The commands of courses as an NC program.

use std::fmt::Write as _;
use std::io::Write;

use super::Run;
use crate::error::{Error, Result};
use crate::machine::{JointKind, Machine};

/// Decimals of every axis word, mm and deg.
const DECIMALS: usize = 4;

/// Writes the recorded samples of all runs as joint coordinates: `G90 G21`, then one block each with the words of all axes, mm and
/// deg to four decimals, with the signs of the machine's NC words.
///
/// # Errors
/// Those of the courses and of the output.
pub fn write_program(machine: &Machine, runs: &[Run], out: &mut dyn Write) -> Result<()> {
    let lost = |e| Error::file("", e);
    out.write_all(format!("({})\nG90 G21 G94\n", machine.name()).as_bytes()).map_err(lost)?;
    let mut line = String::new();
    let mut axes: Vec<(String, f64, bool, usize)> = (0..machine.commands().len())
        .map(|c| {
            let joint = machine.command_joint(c);
            let word = joint.nc_word();
            // C1=90: an address with a digit needs its sign of equality.
            let equals = if word.address.ends_with(|c: char| c.is_ascii_digit()) { "=" } else { "" };
            (word.address + equals, f64::from(word.sign), joint.kind == JointKind::Prismatic, c)
        })
        .collect();
    // X Y Z A C, as programs are written.
    axes.sort_by(|a, b| b.2.cmp(&a.2).then_with(|| a.0.cmp(&b.0)));
    let mut first = true;
    for run in runs {
        for sample in run.course.samples()? {
            let sample = sample?;
            if !sample.recorded {
                continue;
            }
            line.clear();
            for (address, sign, prismatic, c) in &axes {
                let q = sample.q[*c];
                let value = sign * if *prismatic { q * 1e3 } else { q.to_degrees() };
                // Rounding must not write -0.0000.
                let scale = 10f64.powi(DECIMALS as i32);
                let value = (value * scale).round() / scale + 0.0;
                let _ = write!(line, "{address}{value:.DECIMALS$} ");
            }
            line.pop();
            let motion = if std::mem::take(&mut first) { "G1 F1000 " } else { "" };
            out.write_all(format!("{motion}{line}\n").as_bytes()).map_err(lost)?;
        }
    }
    out.write_all(b"M2\n").map_err(lost)
}
