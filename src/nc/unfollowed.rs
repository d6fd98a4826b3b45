//! What stands in a block and is not followed: codes, axes, words, names, parameters that the dialect's vocabulary does not have.

use std::collections::BTreeSet;
use std::ops::Range;

use super::block::Block;
use super::codes::{structures, takes_the_rest};
use super::dialect::Dialect;
use super::token::Kind;
use super::vocabulary::{Action, Vocabulary};

/// A piece of a block that is not followed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unfollowed {
    /// What it is.
    pub what: Unknown,
    /// Its bytes in the line.
    pub span: Range<usize>,
}

/// What is not followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// A G code.
    Code,
    /// An M code that is known to do what is not followed.
    Function,
    /// The word of an axis that the machine does not have.
    Axis,
    /// A word with another address.
    Address,
    /// A name.
    Name,
    /// A parameter of the control that is written.
    Parameter,
    /// What is no word.
    Text,
}

/// What a dialect and its program have names for.
pub(super) struct Known<'a> {
    pub dialect: Dialect,
    pub vocabulary: &'a Vocabulary,
    /// Addresses of the machine's axes.
    pub axes: &'a [String],
    /// Names that the program has declared.
    pub declared: &'a BTreeSet<String>,
    /// Whether axis words of this block say where axes go.
    pub targets: bool,
}

impl Known<'_> {
    /// The first piece of the block that is not followed.
    pub fn first_unfollowed(&self, block: &Block) -> Option<Unfollowed> {
        let mut statement = false;
        for (at, token) in block.tokens().iter().enumerate() {
            let unknown = match token.kind {
                Kind::BlockNumber | Kind::Skip | Kind::Comment | Kind::Percent => None,
                Kind::Word(index) => self.word(block, index),
                Kind::Call => {
                    let name = block.name(token);
                    // What a Siemens program calls besides is told as a call.
                    let known = self.dialect == Dialect::Siemens
                        || self.vocabulary.has_call(&name)
                        || structures(&name);
                    (!known).then_some(Unknown::Name)
                }
                Kind::Name => {
                    let name = block.name(token);
                    statement |= takes_the_rest(&name, self.dialect);
                    let rest = block.tokens().get(at + 1).map_or(String::new(), |t| block.text(&t.span));
                    if !self.vocabulary.has_statement(&name, rest.trim().to_ascii_uppercase().as_str()) {
                        return Some(Unfollowed {
                            what: Unknown::Name,
                            span: token.span.start..block.content_end(),
                        });
                    }
                    // Alone in its block it is a program of the user, and told as a call.
                    let called = self.dialect == Dialect::Siemens && name.len() > 1 && is_alone(block);
                    let known = self.vocabulary.has_name(&name)
                        || self.dialect != Dialect::Heidenhain && structures(&name)
                        || statement
                        || called;
                    (!known).then_some(Unknown::Name)
                }
                Kind::Other if statement => None,
                Kind::Other => self.other(&block.text(&token.span)),
            };
            if let Some(what) = unknown {
                return Some(Unfollowed { what, span: token.span.clone() });
            }
        }
        None
    }

    fn word(&self, block: &Block, index: usize) -> Option<Unknown> {
        let word = &block.words()[index];
        let address = word.address.as_str();
        match (address, word.number()) {
            ("G", Some(code)) => {
                let action = self.vocabulary.g(code);
                return matches!(action, None | Some(Action::NotFollowed)).then_some(Unknown::Code);
            }
            ("M", Some(code)) => {
                return (self.vocabulary.m(code) == Some(Action::NotFollowed)).then_some(Unknown::Function);
            }
            _ => {}
        }
        if self.axes.iter().any(|axis| word.address == *axis)
            || self.vocabulary.has_address(address)
            || self.declared.contains(address)
        {
            return None;
        }
        if !is_axis(address) {
            return Some(if address.starts_with('$') { Unknown::Parameter } else { Unknown::Address });
        }
        self.targets.then_some(Unknown::Axis)
    }

    fn other(&self, text: &str) -> Option<Unknown> {
        let text = text.to_ascii_uppercase();
        let letters = text.trim_start_matches('$');
        let name = letters.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').next().unwrap_or_default();
        // Labels; positions beside the words of a block, which are told as such.
        let stands = text.ends_with(':')
            || ["POS[", "POSA[", "POSP[", "MOV["].iter().any(|start| text.starts_with(start))
            || self.vocabulary.may_assign(&text)
            || self.declared.contains(name);
        if stands {
            return None;
        }
        let writes = text.starts_with(['#', '$']) || text.contains('=') && !name.is_empty();
        Some(if writes { Unknown::Parameter } else { Unknown::Text })
    }
}

/// Whether the address could be that of an axis.
fn is_axis(address: &str) -> bool {
    let digits = address.trim_start_matches(|c: char| "ABCUVWXYZ".contains(c));
    address.len() == digits.len() + 1 && digits.bytes().all(|b| b.is_ascii_digit())
}

/// Whether one name is all that the block says.
fn is_alone(block: &Block) -> bool {
    let says = |kind: &Kind| !matches!(kind, Kind::BlockNumber | Kind::Skip | Kind::Comment | Kind::Percent);
    block.tokens().iter().filter(|token| says(&token.kind)).count() == 1
}

/// The M codes of a block that the dialect does not have: indices of their words.
pub(super) fn unknown_functions(block: &Block, vocabulary: &Vocabulary) -> Vec<usize> {
    let is_unknown = |(index, word): (usize, &super::words::Word)| {
        let number = word.number().filter(|_| word.address == "M")?;
        vocabulary.m(number).is_none().then_some(index)
    };
    block.words().iter().enumerate().filter_map(is_unknown).collect()
}
