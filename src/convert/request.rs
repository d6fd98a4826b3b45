//! What a caller tells of a table.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::nominal::Nominal;

/// How `measurement` calls an R-test.
pub(super) const R_TEST: &str = "r-test";

/// What is known of a table besides what it says itself.
#[non_exhaustive]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// The file of a map, which then says everything; the fields below, but for the joint, are not asked.
    pub map: Option<PathBuf>,
    /// What was measured: `position`, `pose`, `joint`, `distance` or `displacement`; `r-test` where linear axes followed a ball.
    pub measurement: Option<String>,
    /// Columns of the recording and the columns of the table that they are; `q*` for all joints of such names.
    pub columns: Vec<(String, String)>,
    /// Units by column of the table, or by `length`, `angle`, `time` for all that name none.
    pub units: Vec<(String, String)>,
    /// Lines `key: value` for the head of the recording.
    pub head: Vec<String>,
    /// Columns and the text that a row must have there to be taken.
    pub rows: BTreeMap<String, String>,
    /// Names of all columns, in the place of headings.
    pub names: Vec<String>,
    /// Markers that are taken, where a row has several; all where none is named.
    pub markers: Vec<String>,
    /// Convention of Euler angles, such as `zyx-intrinsic`.
    pub euler: Option<String>,
    /// Whether `rx ry rz` are a rotation vector.
    pub rotation_vector: bool,
    /// `row-major` or `column-major`, where a matrix does not tell by itself.
    pub matrix: Option<String>,
    /// Time stamp at which `t` is 0.
    pub time_zero: Option<String>,
    /// The joint that a file of a laser is about.
    pub joint: Option<String>,
    /// From which side the targets of a laser were approached: `alternating`, `rising` or `falling`.
    pub approach: Option<String>,
    /// What deviations are: of a laser `laser-minus-target` or `target-minus-laser`, of an R-test `ball-minus-tool` or `tool-minus-ball`.
    pub deviation: Option<String>,
    /// Along which axes the deviations of an R-test were read: `tool`, `machine` or `workpiece`.
    pub axes: Option<String>,
    /// What separates columns: `comma`, `semicolon`, `tab`, `blanks`.
    pub separator: Option<String>,
    /// `point` or `comma`.
    pub decimal: Option<String>,
    /// The path that ran, where the table has no positions of the joints.
    pub path: Option<Nominal>,
    /// Readings a second, where such a table has no column of time.
    pub sample_rate: Option<f64>,
    /// The topic of a bag that has the positions of the joints; the only one where none is told.
    pub joint_topic: Option<String>,
    /// The topic of a bag that has the poses.
    pub pose_topic: Option<String>,
    /// Parent and child in TF, in the place of a topic of poses.
    pub frames: Option<(String, String)>,
    /// Time between joint states of a bag over which a line is drawn, s; three of their usual intervals where none is told.
    pub longest_gap: Option<f64>,
    /// The command that this is, for messages that show it with what is to be added.
    pub call: Option<String>,
}

/// Each returns the same request with one thing more told, as the field of that name has it.
impl Request {
    /// By the file of a map, which then says everything.
    #[must_use]
    pub fn with_map(mut self, map: impl Into<PathBuf>) -> Self {
        self.map = Some(map.into());
        self
    }

    /// With this kind of measurement.
    #[must_use]
    pub fn with_measurement(mut self, measurement: impl Into<String>) -> Self {
        self.measurement = Some(measurement.into());
        self
    }

    /// With a column of the recording, and the column of the table that it is.
    #[must_use]
    pub fn with_column(mut self, name: impl Into<String>, of_table: impl Into<String>) -> Self {
        self.columns.push((name.into(), of_table.into()));
        self
    }

    /// With the unit of a column of the table, or of every `length`, `angle` or `time` that names none.
    #[must_use]
    pub fn with_unit(mut self, of: impl Into<String>, unit: impl Into<String>) -> Self {
        self.units.push((of.into(), unit.into()));
        self
    }

    /// With a line `key: value` for the head of the recording.
    #[must_use]
    pub fn with_head(mut self, line: impl Into<String>) -> Self {
        self.head.push(line.into());
        self
    }

    /// With rows only that have this text in a column.
    #[must_use]
    pub fn with_rows(mut self, column: impl Into<String>, text: impl Into<String>) -> Self {
        self.rows.insert(column.into(), text.into());
        self
    }

    /// With the names of all columns, in the place of headings.
    #[must_use]
    pub fn with_names(mut self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.names = names.into_iter().map(Into::into).collect();
        self
    }

    /// With this marker among those that are taken.
    #[must_use]
    pub fn with_marker(mut self, marker: impl Into<String>) -> Self {
        self.markers.push(marker.into());
        self
    }

    /// With this convention of Euler angles.
    #[must_use]
    pub fn with_euler(mut self, euler: impl Into<String>) -> Self {
        self.euler = Some(euler.into());
        self
    }

    /// With `rx ry rz` as a rotation vector, or not.
    #[must_use]
    pub fn with_rotation_vector(mut self, is_one: bool) -> Self {
        self.rotation_vector = is_one;
        self
    }

    /// With matrices `row-major` or `column-major`.
    #[must_use]
    pub fn with_matrix(mut self, matrix: impl Into<String>) -> Self {
        self.matrix = Some(matrix.into());
        self
    }

    /// With the time stamp at which `t` is 0.
    #[must_use]
    pub fn with_time_zero(mut self, time_zero: impl Into<String>) -> Self {
        self.time_zero = Some(time_zero.into());
        self
    }

    /// About this joint.
    #[must_use]
    pub fn with_joint(mut self, joint: impl Into<String>) -> Self {
        self.joint = Some(joint.into());
        self
    }

    /// With targets approached `alternating`, `rising` or `falling`.
    #[must_use]
    pub fn with_approach(mut self, approach: impl Into<String>) -> Self {
        self.approach = Some(approach.into());
        self
    }

    /// With what deviations are.
    #[must_use]
    pub fn with_deviation(mut self, deviation: impl Into<String>) -> Self {
        self.deviation = Some(deviation.into());
        self
    }

    /// With deviations of an R-test along the axes of the `tool`, the `machine` or the `workpiece`.
    #[must_use]
    pub fn with_axes(mut self, axes: impl Into<String>) -> Self {
        self.axes = Some(axes.into());
        self
    }

    /// With what separates columns.
    #[must_use]
    pub fn with_separator(mut self, separator: impl Into<String>) -> Self {
        self.separator = Some(separator.into());
        self
    }

    /// With a decimal `point` or `comma`.
    #[must_use]
    pub fn with_decimal(mut self, decimal: impl Into<String>) -> Self {
        self.decimal = Some(decimal.into());
        self
    }

    /// With the path that ran.
    #[must_use]
    pub fn with_path(mut self, path: Nominal) -> Self {
        self.path = Some(path);
        self
    }

    /// With the positions of the joints of this topic of a bag.
    #[must_use]
    pub fn with_joint_topic(mut self, topic: impl Into<String>) -> Self {
        self.joint_topic = Some(topic.into());
        self
    }

    /// With the poses of this topic of a bag.
    #[must_use]
    pub fn with_pose_topic(mut self, topic: impl Into<String>) -> Self {
        self.pose_topic = Some(topic.into());
        self
    }

    /// With the poses of `child` in `parent`, two frames of TF.
    #[must_use]
    pub fn with_frames(mut self, parent: impl Into<String>, child: impl Into<String>) -> Self {
        self.frames = Some((parent.into(), child.into()));
        self
    }

    /// With lines between joint states of a bag that are no further apart than this, s.
    #[must_use]
    pub fn with_longest_gap(mut self, seconds: f64) -> Self {
        self.longest_gap = Some(seconds);
        self
    }

    /// With the command that this is.
    #[must_use]
    pub fn with_call(mut self, call: impl Into<String>) -> Self {
        self.call = Some(call.into());
        self
    }

    /// Whether something is told that only a bag has.
    pub(super) fn is_of_bag(&self) -> bool {
        let topic = self.joint_topic.is_some() || self.pose_topic.is_some();
        topic || self.frames.is_some() || self.longest_gap.is_some()
    }

    /// With so many readings a second.
    #[must_use]
    pub fn with_sample_rate(mut self, sample_rate: f64) -> Self {
        self.sample_rate = Some(sample_rate);
        self
    }
}
