//! The counts that are kept.

use std::path::PathBuf;

/// Where they are kept.
pub const FILE: &str = "benches/instructions/counts.csv";

/// Instructions a sample by workload.
pub struct Counts(pub Vec<(String, f64)>);

impl Counts {
    /// Those that are kept.
    pub fn read() -> Result<Counts, String> {
        let text = std::fs::read_to_string(path()).map_err(|e| format!("{FILE}: {e}"))?;
        let mut counts = Vec::new();
        for (line, row) in (1..).zip(text.lines()).skip(1) {
            let cells = row.split_once(',').and_then(|(name, count)| Some((name, count.parse().ok()?)));
            let (name, count) =
                cells.ok_or_else(|| format!("{FILE}:{line}: a workload and a number are needed"))?;
            counts.push((name.to_string(), count));
        }
        Ok(Counts(counts))
    }

    /// Keeps these.
    pub fn write(&self) -> Result<(), String> {
        let rows = self.0.iter().map(|(name, count)| format!("{name},{count:.0}\n"));
        let text = format!("workload,instructions_per_sample\n{}", rows.collect::<String>());
        std::fs::write(path(), text).map_err(|e| format!("{FILE}: {e}"))
    }
}

fn path() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(FILE)
}
