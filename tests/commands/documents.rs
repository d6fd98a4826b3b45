//! What documents show of the program's output is what it prints.

use std::path::Path;

/// The lines of the README's block of this language that begins with these words.
pub fn block(begins: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let text = std::fs::read_to_string(path).expect("part of the project");
    let mut blocks = text.split("```text\n").skip(1).map(|part| part.split("```").next().unwrap_or_default());
    let block = blocks.find(|block| block.starts_with(begins)).expect("a block that begins so");
    block.lines().map(str::to_string).collect()
}

/// Whether a line is that of the document. Words, counts and layout are the same; what is measured may differ by one in its
/// last place, as it does from processor to processor.
fn same(shown: &str, printed: &str) -> bool {
    let shape = |line: &str| line.replace(|c: char| c.is_ascii_digit(), "#");
    if shape(shown) != shape(printed) {
        return false;
    }
    let words = |line: &str| line.split_whitespace().map(str::to_string).collect::<Vec<_>>();
    let (shown, printed) = (words(shown), words(printed));
    (0..shown.len()).all(|i| {
        let beside = |j: Option<usize>, of: &[&str]| {
            let word = j.and_then(|j| shown.get(j)).map(|w| w.trim_end_matches([',', ';', '.']));
            word.is_some_and(|w| of.contains(&w))
        };
        let measured =
            beside(i.checked_sub(1), &["±"]) || beside(Some(i + 1), &["±", "%", "um", "mm", "urad", "um/m"]);
        match (measured, shown[i].parse::<f64>(), printed[i].parse::<f64>()) {
            (true, Ok(a), Ok(b)) => {
                let decimals = shown[i].split_once('.').map_or(0, |(_, behind)| behind.len() as i32);
                (a - b).abs() < 1.01 * 10f64.powi(-decimals)
            }
            _ => shown[i] == printed[i],
        }
    })
}

/// Says where `shown` is not in `printed`, line by line; a line `...` stands for any lines left out.
pub fn compare(shown: &[String], printed: &[&str]) -> Result<(), String> {
    let mut at = 0;
    for run in shown.split(|line| line.trim() == "...") {
        // Blank lines next to `...` belong to the document.
        let blank = |line: &&String| line.is_empty();
        let start = run.iter().take_while(blank).count();
        let end = run.len() - run[start..].iter().rev().take_while(blank).count();
        let run = &run[start..end];
        let Some(first) = run.first() else { continue };
        let found = printed[at..].iter().position(|line| same(first, line));
        at += found.ok_or_else(|| format!("not printed, or not in this order: {first}"))?;
        for line in run {
            match printed.get(at) {
                Some(there) if same(line, there) => at += 1,
                there => {
                    return Err(format!("shown:   {line}\nprinted: {}", there.unwrap_or(&"nothing more")));
                }
            }
        }
    }
    Ok(())
}
