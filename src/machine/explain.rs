//! A machine file with comments that say what its fields are.

/// What stands above a field, by the beginning of its line.
const ABOVE: [(&str, &[&str]); 8] = [
    ("    name:", &["The name that recordings state as `# machine: NAME`."]),
    ("    about:", &["One line for people."]),
    (
        "    units:",
        &[
            "Units of every length and every angle in this file: m, mm, um, nm or in; rad, mrad, urad, deg or arcsec.",
        ],
    ),
    ("    gravity:", &["Direction of gravity in the frame of the base; (0, 0, -1) where nothing is said."]),
    (
        "    tolerance:",
        &[
            "How far off each number of a frame may be before anything is measured, one standard deviation. A frame may have its own.",
        ],
    ),
    (
        "    workpiece:",
        &[
            "What carries the workpiece, from the base outwards; the last frame is w.",
            "Each line is a frame in the one before it, and the joint that moves all that follows:",
            "  frame      its name, once in the whole file",
            "  at         its origin in the frame before it: (x, y, z)",
            "  rotation   its rotation vector there; direction is the axis, length the angle",
            "  moves      instead of both: [Tx(..), Ty(..), Tz(..), Rx(..), Ry(..), Rz(..)], from left to right",
            "  joint      Revolute(..) turns, Prismatic(..) slides; none on w and t",
            "    axis     \"x\", \"-x\", ... or a unit vector: where to, or about what, it moves when its number grows",
            "    travel   (lower, upper)",
            "    name     column of recordings, where it is not the frame's name",
            "    nc       (address: \"C\", sign: -1): NC word, where it is not the name in capitals or counts the other way",
            "    follows  {\"leader\": factor}: a joint that the control does not command",
            "  mass, centre_of_mass   kg, and where: of what the frame carries behind its joint",
            "  tolerance  of this frame alone: (translation: .., rotation: ..)",
        ],
    ),
    ("    tool:", &["What carries the tool, from the base outwards; the last frame is t, the tool tip."]),
    (
        "    side_branches:",
        &["What hangs beside the chain on one of its frames, and weighs on it; nothing of it is identified."],
    ),
];

/// A machine file with comments above its fields that say what they are. A file without a `tolerance` of its own is told what holds.
///
/// ```
/// use kincal::machine::explained;
///
/// let text = "Machine(\n    name: \"z\",\n    tool: [\n    ],\n)\n";
/// assert!(explained(text).contains("    // What carries the tool, from the base outwards;"));
/// ```
pub fn explained(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2048);
    let has_tolerance = text.lines().any(|line| line.starts_with("    tolerance:"));
    for line in text.split_inclusive('\n') {
        if line.starts_with("    workpiece:") && !has_tolerance {
            let said = "    // tolerance: (translation: .., rotation: ..) is 0.1 mm and 0.5 mrad where nothing is said: how far off each number of a frame may be.\n";
            out.push_str(said);
        }
        if let Some((_, comments)) = ABOVE.iter().find(|(begins, _)| line.starts_with(begins)) {
            comments.iter().for_each(|comment| out.push_str(&format!("    // {comment}\n")));
        }
        out.push_str(line);
    }
    out
}
