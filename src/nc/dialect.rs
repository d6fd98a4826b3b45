//! Families of controls, as far as the same text means different things to them.

/// A family of controls. Most of the language is common; a dialect decides only where the same text has two meanings.
#[non_exhaustive]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dialect {
    /// RS-274 and its relatives: LinuxCNC, Fanuc, Haas, Mitsubishi, grbl.
    #[default]
    Rs274,
    /// SINUMERIK 840D and its relatives.
    Siemens,
    /// Heidenhain TNC, in its own conversational language or in DIN/ISO.
    Heidenhain,
}
