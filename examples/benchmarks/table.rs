//! Tables and numbers as the page prints them.

/// A table of GitHub's Markdown.
pub struct Table {
    text: String,
}

impl Table {
    pub fn new(columns: &[&str]) -> Self {
        let rule = vec!["---"; columns.len()].join(" | ");
        Table { text: format!("| {} |\n| {rule} |\n", columns.join(" | ")) }
    }

    pub fn row<S: AsRef<str>>(&mut self, cells: &[S]) {
        let cells: Vec<&str> = cells.iter().map(AsRef::as_ref).collect();
        self.text.push_str(&format!("| {} |\n", cells.join(" | ")));
    }

    /// With what is said before it.
    pub fn after(&self, words: &str) -> String {
        format!("{}\n\n{}", words.trim(), self.text)
    }
}

/// Three significant digits.
pub fn three(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let digits = 2 - x.abs().log10().floor() as i32;
    if (-3..=6).contains(&digits) { format!("{x:.*}", digits.max(0) as usize) } else { format!("{x:.1e}") }
}

/// A number in SI with its unit, in thousands of it: 0.00412 m is 4.12 mm.
pub fn engineering(x: f64, unit: &str) -> String {
    const PREFIXES: [(f64, &str); 5] = [(1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"), (1e-12, "p")];
    if unit.is_empty() || unit == "1" {
        return three(x);
    }
    let fits = |(size, _): &&(f64, &str)| x.abs() >= 0.9995 * size;
    let (size, prefix) = PREFIXES.iter().find(fits).copied().unwrap_or(PREFIXES[0]);
    format!("{} {prefix}{unit}", three(x / size))
}

/// The middle one of some numbers.
pub fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    let n = all.len();
    0.5 * (all[(n - 1) / 2] + all[n / 2])
}
