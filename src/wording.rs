//! How messages word what they count and quote.

/// `1 reading`, `2 readings`.
pub(crate) fn count(n: u64, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// Text of a file as it is quoted: no longer than 40 characters, control characters escaped.
pub(crate) fn shown(text: &str) -> String {
    let mut out = String::new();
    for (n, c) in text.trim().chars().enumerate() {
        if n == 40 {
            out.push_str("...");
            break;
        }
        if c.is_control() { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out
}

/// Whether two words differ by at most two letters (one, where the right word is short), or only in case.
pub(crate) fn nearly(written: &str, right: &str) -> bool {
    if written.len() > 40 {
        return false;
    }
    let plain = |s: &str| -> Vec<char> {
        s.to_lowercase().chars().map(|c| if c == '-' || c == ' ' { '_' } else { c }).collect()
    };
    let (a, b) = (plain(written), plain(right));
    let allowed = if b.len() < 6 { 1 } else { 2 };
    distance(&a, &b) <= allowed
}

/// Insertions, deletions, replacements and swaps of neighbours from one word to the other.
fn distance(a: &[char], b: &[char]) -> usize {
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            if i == 0 || j == 0 {
                rows[i][j] = i + j;
                continue;
            }
            let replaced = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = replaced.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            rows[i][j] = least;
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_quoted_is_short_and_plain() {
        assert_eq!(shown(" a\tb\u{7} "), "a\\tb\\u{7}");
        assert_eq!(shown(&"x".repeat(41)), format!("{}...", "x".repeat(40)));
    }

    #[test]
    fn one_is_not_many() {
        assert_eq!(count(0, "row", "rows"), "0 rows");
        assert_eq!(count(1, "row", "rows"), "1 row");
        assert_eq!(count(2, "row", "rows"), "2 rows");
    }

    #[test]
    fn nearly_right_words_are_found() {
        assert!(nearly("mesurement", "measurement"));
        assert!(nearly("Machine", "machine"));
        assert!(nearly("tool point", "tool_point"));
        assert!(nearly("set-up", "setup"));
        assert!(!nearly("note", "zero"));
        assert!(!nearly("date", "zero"));
        assert!(!nearly("step size", "setup"));
    }
}
