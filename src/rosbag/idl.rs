//! Definitions in IDL, the Interface Definition Language of the OMG, as `rosidl` makes them of messages.

use std::collections::BTreeMap;

use super::definition::{Definition, Field, plain};

/// A word, a number, a sign or a text in quotes, with its line.
type Token = (String, usize);
type Wrong = (usize, String);

/// The structures of a text, also of several files behind lines of `=` and `IDL: name`.
pub(super) fn definitions(text: &str) -> Result<Vec<Definition>, Wrong> {
    let tokens = tokens(text)?;
    let mut reader =
        Reader { tokens: &tokens, at: 0, modules: Vec::new(), lists: BTreeMap::new(), found: Vec::new() };
    reader.all()?;
    Ok(reader.found)
}

fn tokens(text: &str) -> Result<Vec<Token>, Wrong> {
    let mut all = Vec::new();
    // Lines that are no IDL: bars between files, their names, instructions of the preprocessor.
    let is_other = |line: &str| line.starts_with("===") || line.starts_with("IDL:") || line.starts_with('#');
    let text: String = text
        .lines()
        .map(|line| if is_other(line.trim()) { "\n".into() } else { format!("{line}\n") })
        .collect();
    let mut chars = text.chars().peekable();
    let mut line = 1;
    while let Some(c) = chars.next() {
        match c {
            '\n' => line += 1,
            _ if c.is_whitespace() => {}
            '/' if chars.peek() == Some(&'/') => while chars.next_if(|c| *c != '\n').is_some() {},
            '/' if chars.peek() == Some(&'*') => {
                let (begins, mut last) = (line, ' ');
                chars.next();
                loop {
                    match chars.next() {
                        Some('/') if last == '*' => break,
                        Some(c) => {
                            line += usize::from(c == '\n');
                            last = c;
                        }
                        None => return Err((begins, "a comment has no end".into())),
                    }
                }
            }
            '"' => {
                let begins = line;
                loop {
                    match chars.next() {
                        Some('"') => break,
                        Some('\\') => drop(chars.next()),
                        Some(c) => line += usize::from(c == '\n'),
                        None => return Err((begins, "a text in quotes has no end".into())),
                    }
                }
                all.push(("\"\"".into(), begins));
            }
            _ if c.is_alphanumeric() || c == '_' => {
                let mut word = String::from(c);
                // `std_msgs::msg::Header` is one word.
                while let Some(c) = chars.next_if(|c| c.is_alphanumeric() || *c == '_' || *c == ':') {
                    word.push(c);
                }
                all.push((word, line));
            }
            _ => all.push((c.into(), line)),
        }
    }
    Ok(all)
}

struct Reader<'a> {
    tokens: &'a [Token],
    at: usize,
    modules: Vec<String>,
    /// Types that `typedef` makes: `double__36` is `float64[36]`.
    lists: BTreeMap<String, String>,
    found: Vec<Definition>,
}

impl Reader<'_> {
    fn next(&mut self) -> Result<&str, Wrong> {
        let line = self.line();
        let (word, _) =
            self.tokens.get(self.at).ok_or((line, "it ends in the middle of a definition".into()))?;
        self.at += 1;
        Ok(word)
    }

    /// Line of the next token.
    fn line(&self) -> usize {
        self.tokens.get(self.at).or(self.tokens.last()).map_or(0, |(_, line)| *line)
    }

    fn is_next(&self, word: &str) -> bool {
        self.tokens.get(self.at).is_some_and(|(own, _)| own == word)
    }

    fn expect(&mut self, word: &str) -> Result<(), Wrong> {
        let line = self.line();
        match self.next()? {
            own if own == word => Ok(()),
            own => Err((line, format!("`{}` stands where `{word}` is expected", crate::wording::shown(own)))),
        }
    }

    fn all(&mut self) -> Result<(), Wrong> {
        while self.at < self.tokens.len() {
            let line = self.line();
            match self.next()? {
                "module" => {
                    let name = self.next()?.to_string();
                    self.modules.push(name);
                    self.expect("{")?;
                }
                "}" => drop(self.modules.pop()),
                ";" => {}
                "@" => self.annotation()?,
                "struct" => self.structure(line)?,
                "typedef" => {
                    let kind = self.kind()?;
                    let name = self.next()?.to_string();
                    let kind = self.with_length(kind)?;
                    self.lists.insert(name, kind);
                }
                // Constants and enumerations: no field has them.
                _ => self.skip_statement()?,
            }
        }
        Ok(())
    }

    fn structure(&mut self, line: usize) -> Result<(), Wrong> {
        let package = self.modules.first().cloned().unwrap_or_default();
        let name = format!("{package}/{}", self.next()?);
        let mut fields = Vec::new();
        self.expect("{")?;
        while !self.is_next("}") {
            if self.is_next("@") {
                self.at += 1;
                self.annotation()?;
                continue;
            }
            let line = self.line();
            let kind = self.kind()?;
            let name = self.next()?.to_string();
            let kind = self.with_length(kind)?;
            self.expect(";")?;
            fields.push(Field { kind, name, line });
        }
        self.at += 1;
        self.found.push(Definition { name, line, fields });
        Ok(())
    }

    /// `@verbatim (language="comment", text="..." "...")`
    fn annotation(&mut self) -> Result<(), Wrong> {
        self.next()?;
        if !self.is_next("(") {
            return Ok(());
        }
        let mut depth = 0;
        loop {
            match self.next()? {
                "(" => depth += 1,
                ")" if depth == 1 => return Ok(()),
                ")" => depth -= 1,
                _ => {}
            }
        }
    }

    fn skip_statement(&mut self) -> Result<(), Wrong> {
        let mut depth = 0;
        while self.at < self.tokens.len() {
            match self.next()? {
                "{" => depth += 1,
                "}" if depth > 0 => depth -= 1,
                ";" if depth == 0 => return Ok(()),
                _ => {}
            }
        }
        Ok(())
    }

    /// A type as `.msg` files have it.
    fn kind(&mut self) -> Result<String, Wrong> {
        let word = self.next()?.to_string();
        let kind = match &*word {
            "sequence" => {
                self.expect("<")?;
                if self.is_next("sequence") {
                    return Err((self.line(), "it has a list of lists".into()));
                }
                let inner = self.kind()?;
                self.bound()?;
                self.expect(">")?;
                return Ok(format!("{inner}[]"));
            }
            "string" => {
                if self.is_next("<") {
                    self.at += 1;
                    self.next()?;
                    self.expect(">")?;
                }
                "string".into()
            }
            "unsigned" => {
                let word = self.next()?.to_string();
                format!("u{}", integer(&word))
            }
            "double" => "float64".into(),
            "float" => "float32".into(),
            "long" | "short" => integer(&word).into(),
            "boolean" => "bool".into(),
            _ => match self.lists.get(&word) {
                Some(list) => list.clone(),
                None if word.contains("::") => plain(&word),
                None => word,
            },
        };
        Ok(kind)
    }

    /// The most elements of a sequence.
    fn bound(&mut self) -> Result<(), Wrong> {
        if self.is_next(",") {
            self.at += 1;
            self.next()?;
        }
        Ok(())
    }

    fn with_length(&mut self, kind: String) -> Result<String, Wrong> {
        if !self.is_next("[") {
            return Ok(kind);
        }
        self.at += 1;
        let length = self.next()?.to_string();
        self.expect("]")?;
        Ok(format!("{kind}[{length}]"))
    }
}

fn integer(word: &str) -> &'static str {
    if word == "short" { "int16" } else { "int32" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_are_read_as_rosidl_writes_them() {
        let text = "// generated from rosidl_adapter/resource/msg.idl.em\n#include \"geometry_msgs/msg/Pose.idl\"\nmodule geometry_msgs {\n  module msg {\n\
            typedef double double__36[36];\n    module Kinds {\n const long MOST = 5; };\n @verbatim (language=\"comment\", text=\n \"a (b) \\\"c\\\"; }\" \"\\n\" \"d\")\n\
            struct PoseWithCovariance {\n @unit (value=\"m\")\n geometry_msgs::msg::Pose pose; // the pose\n /* row by\n row */ double__36 covariance;\n\
            sequence<string> names; sequence<double, 6> six; @key unsigned long n; string<9> word; float f; };\n };\n};\n";
        let found = definitions(text).expect("sound");
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].name, "geometry_msgs/PoseWithCovariance");
        let fields: Vec<_> = found[0].fields.iter().map(|f| (&*f.kind, &*f.name, f.line)).collect();
        assert_eq!(
            fields,
            [
                ("geometry_msgs/Pose", "pose", 12),
                ("float64[36]", "covariance", 14),
                ("string[]", "names", 15),
                ("float64[]", "six", 15),
                ("uint32", "n", 15),
                ("string", "word", 15),
                ("float32", "f", 15),
            ]
        );
    }

    #[test]
    fn no_beginning_of_a_text_makes_the_reader_panic() {
        let text = "module a { module msg { @verbatim (text=\"b\") struct C { sequence<double> d; double e[3]; }; }; };";
        for end in 0..text.len() {
            if let Err((line, what)) = definitions(&text[..end]) {
                assert!(line <= 1 && !what.is_empty());
            }
        }
        assert_eq!(definitions(text).expect("sound")[0].fields.len(), 2);
    }
}
