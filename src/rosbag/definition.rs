//! Structures of messages, whatever language a bag describes them in.

/// A structure: its fields in their order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Definition {
    /// `package/Type`.
    pub name: String,
    /// Where it begins in the text.
    pub line: usize,
    pub fields: Vec<Field>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Field {
    /// `float64`, `string[]`, `float64[36]`, `package/Type`; bounded lists and texts are written as those without a bound.
    pub kind: String,
    pub name: String,
    pub line: usize,
}

/// `package/Type` of `package/msg/Type` and `package::msg::Type`.
pub(super) fn plain(name: &str) -> String {
    name.replace("::", "/").replace("/msg/", "/")
}
