//! placeholder
/// What can be wrong with a recording.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordingFault {
    /// No unit.
    #[error("column has no unit")]
    NoUnit,
}
impl RecordingFault {
    /// How to mend it.
    pub fn mend(&self) -> String {
        String::new()
    }
}
