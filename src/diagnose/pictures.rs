//! What pictures of a diagnosis show, as data: residuals sample by sample, and what goes with each finding.

/// Residuals (measured minus model) along every recording, and curves of what was found.
///
/// They are those of the linearised model that the search works on, SI, in the order of the samples; drop-outs are left out.
#[derive(Clone, Debug, Default)]
pub struct Traces {
    /// One for each recording and quantity (lengths, angles).
    pub recordings: Vec<Trace>,
    /// One for each finding, in their order.
    pub findings: Vec<Curve>,
    /// Of what is unexplained, against the joint that it fits best; its effect is 0.
    pub unexplained: Option<Curve>,
}

/// Residuals of one recording.
#[derive(Clone, Debug)]
pub struct Trace {
    /// File name.
    pub recording: String,
    /// Whether these are angles (rad); else lengths (m).
    pub angle: bool,
    /// Time of the samples, s; `None` where the recordings have none.
    pub time: Option<Vec<f64>>,
    /// With constant geometry alone: one list for each reading of a sample (1 of a distance, 3 of a position).
    pub geometric: Vec<Vec<f64>>,
    /// With what was found besides.
    pub r#final: Vec<Vec<f64>>,
}

/// What a curve runs along.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Along {
    /// Displacement of a joint, m or rad.
    Joint {
        /// Its name.
        name: String,
        /// Whether it turns.
        angle: bool,
    },
    /// What gravity does to a joint (the first feature of the finding): its load, or the weight that it carries.
    Load {
        /// Its name.
        name: String,
    },
    /// Time, s.
    Time,
    /// Number of the sample, from 0, counted through all recordings.
    Sample,
}

/// What one finding takes away of the residual, where it takes most: of each recording the reading that it changes most.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What `x` is.
    pub along: Along,
    /// Whether residuals are angles (rad); else lengths (m).
    pub angle: bool,
    /// Consecutive samples with one direction of travel; recordings and pauses part them too.
    pub runs: Vec<Vec<CurvePoint>>,
}

/// A sample of a [`Curve`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Number of the sample, from 0, counted through all recordings.
    pub sample: usize,
    /// Where, as [`Curve::along`] says.
    pub x: f64,
    /// Direction of travel: -1, 1; 0 where none is known or it does not matter.
    pub direction: i8,
    /// Residual with geometry and all other findings fitted, m or rad.
    pub residual: f64,
    /// What this finding takes away of it: the same minus the residual with all of them, m or rad.
    pub effect: f64,
}

impl Trace {
    /// Signed residuals of the only reading, or the norms of several: before and after.
    pub fn lines(&self) -> (Vec<f64>, Vec<f64>) {
        let line = |of: &[Vec<f64>]| match of {
            [] => Vec::new(),
            [one] => one.clone(),
            several => (0..several[0].len())
                .map(|k| several.iter().map(|s| s[k] * s[k]).sum::<f64>().sqrt())
                .collect(),
        };
        (line(&self.geometric), line(&self.r#final))
    }
}
