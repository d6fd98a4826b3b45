//! What can be wrong with a recording, and the mend for each.

use crate::error::Fault;
use crate::units::{Quantity, UNITS, Unit};
use crate::wording;

/// A fault in a recording. Texts quoted from the file are cut short and shown without control characters.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordingFault {
    /// Arrays of different lengths.
    #[error("`{column}` has {values} values, and `{first}` has {samples}")]
    UnequalArrays {
        /// Its column.
        column: String,
        /// How many values it has.
        values: usize,
        /// The first column.
        first: String,
        /// How many values that has.
        samples: usize,
    },
    /// Nothing but blanks in the file.
    #[error("file is empty")]
    Empty,
    /// A file of another program, known by how it begins.
    #[error("this is {what}, and no recording")]
    Foreign {
        /// What it is, with its article.
        what: String,
        /// What makes of it something that is read; `None` where `kincal convert` reads it.
        mend: Option<String>,
    },
    /// Bytes that are no UTF-8.
    #[error("text is not UTF-8")]
    NotUtf8,
    /// A line that cannot be a row of numbers.
    #[error("line is longer than {limit} bytes")]
    LineTooLong {
        /// Longest line that is read, bytes.
        limit: usize,
    },
    /// Comments without end before the header row.
    #[error("more than {limit} bytes stand before the data")]
    PreambleTooLong {
        /// Most that is read, bytes.
        limit: usize,
    },
    /// Data without names above it.
    #[error("no header row names the columns")]
    NoHeaderRow,
    /// Semicolons or tabs.
    #[error("columns are separated by {found}, not by commas")]
    Separator {
        /// `semicolons` or `tabs`.
        found: &'static str,
    },
    /// A header key that is nearly a known one.
    #[error("header key `{key}` is not known")]
    MisspeltKey {
        /// As written.
        key: String,
        /// The known key.
        near: String,
    },
    /// A header key that stands twice.
    #[error("header key `{key}` stands twice, first in line {first}")]
    KeyTwice {
        /// The key, with its joint if it has one.
        key: String,
        /// Line where it stands first.
        first: u64,
    },
    /// A known header key behind the header row.
    #[error("header key `{key}` stands after the header row")]
    LateKey {
        /// The key.
        key: String,
    },
    /// A header key without value.
    #[error("header key `{key}` has no value")]
    EmptyValue {
        /// The key.
        key: String,
    },
    /// A header key that needs none bears a unit.
    #[error("header key `{key}` bears a unit `{unit}`")]
    UnitNotWanted {
        /// The key.
        key: String,
        /// As written.
        unit: String,
    },
    /// Direction of gravity in another frame than `w`, or in none.
    #[error("direction of gravity is given {}", in_frame(frame))]
    GravityFrame {
        /// As written; empty where none is.
        frame: String,
    },
    /// A header key that takes one of a few words.
    #[error("header key `{key}` has value `{found}`")]
    BadWord {
        /// The key.
        key: String,
        /// As written.
        found: String,
        /// What may stand there.
        expected: String,
    },
    /// A vector without three components.
    #[error("header key `{key}` has {found} numbers, expected 3")]
    NotThree {
        /// The key.
        key: String,
        /// How many there are.
        found: usize,
    },
    /// Zero or less where only a positive number has a meaning.
    #[error("{what} is {text}, not above zero")]
    NotPositive {
        /// The header key.
        what: String,
        /// As written.
        text: String,
    },
    /// A direction of length zero.
    #[error("{what} has length 0")]
    ZeroVector {
        /// The header key.
        what: String,
    },
    /// The recording belongs to another machine.
    #[error("recording was made on machine \"{found}\", not on \"{expected}\"")]
    WrongMachine {
        /// As the recording says.
        found: String,
        /// Name of the machine it is read for.
        expected: String,
    },
    /// No `# measurement:`.
    #[error("header does not say what was measured")]
    NoMeasurement,
    /// A measurement that is none of the five.
    #[error("measurement `{found}` is not known")]
    UnknownMeasurement {
        /// As written.
        found: String,
        /// The known one that is nearly the same.
        near: Option<&'static str>,
    },
    /// A header key without which this measurement has no meaning.
    #[error("measurement `{measurement}` needs the header key `{key}`")]
    MissingKey {
        /// The measurement.
        measurement: String,
        /// The key.
        key: String,
        /// A line that could stand there.
        example: String,
    },
    /// A fixed joint that the machine does not have or does not command.
    #[error("joint \"{joint}\" is none that this machine commands")]
    UnknownJoint {
        /// As written.
        joint: String,
        /// The machine's commands.
        known: String,
    },
    /// A column or key without unit.
    #[error("{what} has no unit")]
    NoUnit {
        /// The column or header key.
        what: String,
        /// How it could be written.
        example: String,
        /// What it must measure, where that is known.
        expected: Option<Quantity>,
    },
    /// A unit that is none.
    #[error("{what} has unit `{unit}`, which is not known")]
    UnknownUnit {
        /// The column or header key.
        what: String,
        /// As written.
        unit: String,
        /// What it must measure, where that is known.
        expected: Option<Quantity>,
    },
    /// A unit of something else.
    #[error("{what} has unit `{unit}`, a unit of {found}")]
    WrongUnit {
        /// The column or header key.
        what: String,
        /// As written.
        unit: String,
        /// What that unit measures.
        found: Quantity,
        /// Symbols that would do, as in `m mm um nm in`.
        known: String,
    },
    /// A column without a name, or with a bracket too many or too few.
    #[error("{} is no column name with a unit", quoted(text))]
    BadColumn {
        /// As written.
        text: String,
    },
    /// Two columns of one name.
    #[error("column `{name}` stands twice, first as column {first}")]
    DuplicateColumn {
        /// The name.
        name: String,
        /// Number of the first, from 1.
        first: usize,
    },
    /// A direction of approach of something that is no command.
    #[error("column `{name}` is the direction of approach of no joint that is commanded")]
    DirectionOfNothing {
        /// Name of the column.
        name: String,
        /// Names of the commands.
        known: Vec<String>,
    },
    /// A joint that the machine has and the recording lacks.
    #[error("joint \"{joint}\" has no column")]
    MissingJoint {
        /// Name of the joint.
        joint: String,
        /// The unit in which it could be given.
        unit: &'static str,
        /// A column whose name differs only in case: number and name.
        similar: Option<(usize, String)>,
    },
    /// A joint with a column and a fixed value.
    #[error("joint \"{joint}\" has both a column and the header key `fixed {joint}`")]
    BothWays {
        /// Name of the joint.
        joint: String,
    },
    /// Measured columns that this measurement needs.
    #[error("measurement `{measurement}` has no column {missing}")]
    MissingValue {
        /// The measurement.
        measurement: String,
        /// The missing names in backquotes.
        missing: String,
        /// A header row's part that would do.
        example: String,
        /// A column whose name differs only in case: number, name, and the name expected.
        similar: Option<(usize, String, String)>,
    },
    /// Two measured columns that exclude each other.
    #[error("columns `{first}` and `{second}` are both there")]
    TwoValues {
        /// One of them.
        first: String,
        /// The other.
        second: String,
    },
    /// Text where a number should be.
    #[error("`{text}` in {what} is no number")]
    NotANumber {
        /// The column or header key.
        what: String,
        /// As written.
        text: String,
    },
    /// Infinite, or too large to be meant.
    #[error("`{text}` in {what} is not a usable number")]
    NotUsable {
        /// The column or header key.
        what: String,
        /// As written.
        text: String,
    },
    /// A row with too few or too many fields.
    #[error("row has {}, header row has {expected}", wording::count(*found as u64, "field", "fields"))]
    Ragged {
        /// In this row.
        found: usize,
        /// In the header row.
        expected: usize,
    },
    /// A direction of approach other than -1, 0, +1.
    #[error("`{text}` in {what} is no direction of approach")]
    BadDirection {
        /// The column.
        what: String,
        /// As written.
        text: String,
    },
    /// A quaternion that is none of a rotation.
    #[error("quaternion `qw qx qy qz` has length {length:.6}, expected 1")]
    QuaternionLength {
        /// Its length.
        length: f64,
    },
    /// A time that stands twice.
    #[error("time {t} s repeats that of the row before")]
    TimeRepeats {
        /// s.
        t: f64,
    },
    /// A time before that of the row before.
    #[error("time runs backwards from {from} s to {to} s")]
    TimeBackwards {
        /// Of the row before, s.
        from: f64,
        /// Of this row, s.
        to: f64,
    },
    /// A header row and nothing below it.
    #[error("no data row follows the header row")]
    NoRows,
    /// Rows, but none that could be used.
    #[error("{}", all_dropped(*rows, column, *count))]
    AllDropped {
        /// Rows in the file.
        rows: u64,
        /// The column that most often was the reason.
        column: String,
        /// How often.
        count: u64,
    },
    /// Two recordings to be joined that have not as many rows.
    #[error(
        "there {} {}, and {other} has {other_rows}",
        if *rows == 1 { "is" } else { "are" },
        wording::count(*rows, "row", "rows")
    )]
    JoinRows {
        /// Of this recording.
        rows: u64,
        /// The other recording.
        other: String,
        /// Its rows.
        other_rows: u64,
    },
    /// Two recordings to be joined of which nothing shows that they belong together.
    #[error("no column that changes has the same numbers here and in {other}")]
    NothingShared {
        /// The other recording.
        other: String,
    },
    /// A name for joined columns that cannot be used.
    #[error("columns cannot be named `{name}.`")]
    JoinName {
        /// As written.
        name: String,
    },
}

fn all_dropped(rows: u64, column: &str, count: u64) -> String {
    match rows {
        1 => format!("the only row is a drop-out: column `{column}` is empty or NaN"),
        _ => format!("all {rows} rows are drop-outs; column `{column}` is empty or NaN in {count} of them"),
    }
}

impl Fault for RecordingFault {
    fn mend(&self) -> String {
        use RecordingFault::*;
        match self {
            UnequalArrays { .. } => "give one value for each sample; NaN for a reading that is missing".into(),
            Empty => "a recording holds lines `# key: value`, one header row and rows of numbers".into(),
            Foreign { mend, .. } => {
                mend.clone().unwrap_or_else(|| "`kincal convert` makes a recording of it".into())
            }
            NotUtf8 => "save the file as CSV in UTF-8 (plain ASCII is UTF-8; `um` for micrometres)".into(),
            LineTooLong { .. } => "write one sample per line; is this a text file at all?".into(),
            PreambleTooLong { .. } => "shorten the comments above the header row".into(),
            NoHeaderRow => {
                "write a row such as `t[s],x[mm],a[deg],d[um]` between the lines with `#` and the numbers"
                    .into()
            }
            Separator { .. } => "separate columns by commas, and write decimals with a point".into(),
            MisspeltKey { near, .. } => {
                format!("write `{near}`; in a comment, leave the colon out")
            }
            KeyTwice { .. } => "keep one of the two lines".into(),
            LateKey { .. } => "move the line above the header row".into(),
            EmptyValue { key } => format!("write a value behind `{key}:`, or leave the line out"),
            UnitNotWanted { key, .. } => format!("write `# {key}:` without brackets"),
            GravityFrame { .. } => "write it in the workpiece frame: `# gravity[w]: 0,0,-1`".into(),
            BadWord { expected, .. } => format!("write {expected}"),
            NotThree { key, .. } => format!("write three numbers: `{key}: 0,0,1`"),
            NotPositive { .. } => "write a number above zero".into(),
            ZeroVector { .. } => "write a vector with a length, such as `0,0,1`".into(),
            WrongMachine { found, expected } => {
                format!("use the machine file of \"{found}\", or write `# machine: {expected}`; `kincal join` lays a recording of the same moments beside another one")
            }
            NoMeasurement => {
                "add `# measurement: ` with one of: distance, position, pose, displacement, joint".into()
            }
            UnknownMeasurement { near: Some(near), .. } => format!("write `{near}`"),
            UnknownMeasurement { near: None, .. } => {
                "write one of: distance, position, pose, displacement, joint".into()
            }
            MissingKey { example, .. } => format!("add {example}"),
            UnknownJoint { known, .. } => {
                format!("write `# fixed NAME[unit]: value` with one of: {known}")
            }
            NoUnit { example, expected, .. } => {
                format!("write {example}; units that fit: {}", symbols(*expected))
            }
            UnknownUnit { expected, .. } => format!("write one of: {}", symbols(*expected)),
            WrongUnit { known, .. } => format!("write one of: {known}"),
            BadColumn { text } if text.is_empty() => {
                "write NAME[unit], as in `x[mm]`, or leave the empty column and its comma out".into()
            }
            BadColumn { .. } => "write NAME[unit], as in `x[mm]`; a pure number is `NAME[1]`".into(),
            DuplicateColumn { .. } => "leave one of the two out, or give it another name".into(),
            DirectionOfNothing { known, .. } => {
                let names: Vec<String> = known.iter().map(|c| format!("`{c}_direction`")).collect();
                format!(
                    "write {}; a channel of its own takes a name that does not end so",
                    names.join(" or ")
                )
            }
            MissingJoint { joint, similar: Some((number, name)), .. } => {
                format!("column {number} is named `{name}`: write `{joint}`, case matters")
            }
            MissingJoint { joint, unit, similar: None } => {
                format!(
                    "add a column `{joint}[{unit}]`, or, if it stood still, the line `# fixed {joint}[{unit}]: 0`"
                )
            }
            BothWays { .. } => "leave one of the two out".into(),
            MissingValue { similar: Some((number, name, expected)), .. } => {
                format!("column {number} is named `{name}`: write `{expected}`, case matters")
            }
            MissingValue { example, similar: None, .. } => format!("name the measured columns {example}"),
            TwoValues { .. } => "leave one of the two out; a recording holds one measurement".into(),
            NotANumber { what, .. } if !what.starts_with("column") => {
                "write a finite number with a decimal point".into()
            }
            NotUsable { what, .. } if !what.starts_with("column") => {
                "write a finite number below 1e9 in m, rad".into()
            }
            NotANumber { .. } => {
                "write a number with a decimal point; a drop-out is an empty cell or `NaN`".into()
            }
            NotUsable { .. } => {
                "write a number below 1e9 in m, rad; a drop-out is an empty cell or `NaN`".into()
            }
            Ragged { .. } => {
                "give every row as many fields as the header row; decimals have a point, not a comma".into()
            }
            BadDirection { .. } => {
                "write 1 (moving up), -1 (moving down) or 0 (not known to have moved)".into()
            }
            QuaternionLength { .. } => {
                "write unit quaternions with at least four decimals, scalar part in `qw`".into()
            }
            TimeRepeats { .. } => {
                "keep one of the rows, write `t` with more decimals, or drop the column `t`".into()
            }
            TimeBackwards { .. } => "sort the rows by `t`, or drop the column `t` if it is no clock".into(),
            NoRows => "add rows of numbers below the header row".into(),
            JoinRows { .. } => "join recordings of the same moments, row by row; an empty cell keeps the place of what is missing".into(),
            NothingShared { .. } => "both need a column that shows which rows belong together: `t`, or the commands of an axis that both have".into(),
            JoinName { .. } => "use letters, digits, `_`, `-` and `.`, starting with a letter, such as `left`".into(),
            AllDropped { column, .. } => format!("write the numbers of column `{column}`"),
        }
    }
}

fn in_frame(frame: &str) -> String {
    if frame.is_empty() { "without its frame".into() } else { format!("in frame `{frame}`") }
}

fn quoted(text: &str) -> String {
    if text.is_empty() { "an empty field".into() } else { format!("`{text}`") }
}

/// Units of a quantity, or all of them.
fn symbols(quantity: Option<Quantity>) -> String {
    let all = || UNITS.iter().map(|u| u.symbol).collect::<Vec<_>>().join(" ");
    quantity.map_or_else(all, Unit::symbols_of)
}
