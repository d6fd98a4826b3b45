//! The page that shows the pictures, with sign, cause, remedy and look-alikes beside each.

use std::fmt::Write as _;

use kincal::effects::Family;

/// A family with its picture.
pub struct Shown<'a> {
    pub family: &'a Family,
    pub sign: String,
    pub conditions: String,
    pub file: String,
}

const HEAD: &str = "# What effects look like

What each family of [the library](../effects.md#the-families) does to the trace of a ballbar, and nothing else: no noise, no geometry. Families of rotary axes are shown on a turn of the axis, with the bar pointing where it shows most. Sizes are usual ones; signs are as drawn, those of a machine may be the other way round. Around the thin circle lie two divisions to either side; blue is the positive sense (counter-clockwise), dashed orange the negative.

The page and its pictures are made of `src/effects/library.ron` by `cargo run --release --features measure --example signatures`. Which effect it is, is not told from one picture: [`kincal diagnose`](../diagnosis.md) weighs all of them, with their look-alikes.

";

/// The page.
pub fn write(shown: &[Shown]) -> String {
    let mut text = String::from(HEAD);
    let mut names: Vec<&str> = shown.iter().map(|shown| shown.family.name.as_str()).collect();
    names.dedup();
    let links: Vec<String> = names.iter().map(|name| format!("[{name}](#{name})")).collect();
    let _ = writeln!(text, "{}\n", links.join(" · "));
    let mut last = "";
    for Shown { family, sign, conditions, file } in shown {
        if family.name != last {
            let _ = writeln!(text, "## {}\n", family.name);
        }
        last = &family.name;
        let _ = writeln!(
            text,
            "<img src=\"{file}\" alt=\"{}\" width=\"260\" align=\"right\">\n",
            sign.trim_end_matches('.')
        );
        let _ = writeln!(text, "{}\n", family.about);
        let _ = writeln!(text, "- **Shown:** {conditions}.");
        let _ = writeln!(text, "- **Sign:** {sign}");
        let _ = writeln!(text, "- **Cause:** {}.", family.cause);
        let _ = writeln!(text, "- **Remedy:** {}.", plain(&family.remedy));
        if let Some(whole) = &family.form_of {
            let _ = writeln!(text, "- **A form of** [{whole}](#{whole}).");
        }
        if !family.look_alikes.is_empty() {
            let others: Vec<String> = (family.look_alikes.iter())
                .map(|other| format!("[{0}](#{0}) ({1})", other.effect, plain(&other.separate_by)))
                .collect();
            let _ = writeln!(text, "- **Look-alikes**, and what tells them apart: {}.", others.join("; "));
        }
        text.push_str("\n<br clear=\"right\">\n\n");
    }
    while text.ends_with("\n\n") {
        text.pop();
    }
    text
}

/// Without the braces around what stands for a number or a place.
fn plain(text: &str) -> String {
    text.replace("{at}", "the axis").replace(['{', '}'], "")
}
