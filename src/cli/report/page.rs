//! The page: one HTML file that needs nothing else, from the verdict down to the files that it was made from.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::style::{SCRIPT, STYLE};

/// A whole page around its sections.
pub(super) fn page(title: &str, verdict: &str, subtitle: &str, sections: &[Markup]) -> String {
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    h1 { (title) }
                    p.verdict { (verdict) }
                    p.note { (subtitle) }
                    @for section in sections { (section) }
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    markup.into_string() + "\n"
}
