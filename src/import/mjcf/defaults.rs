//! Classes of defaults: what an element has where it states nothing.

use std::collections::HashMap;

use roxmltree::Node;

use super::super::xml::Source;
use crate::error::Result;

/// The class of everything that names none.
const MAIN: &str = "main";

pub(super) struct Defaults<'a> {
    classes: HashMap<String, Class<'a>>,
}

#[derive(Default)]
struct Class<'a> {
    parent: Option<String>,
    /// Elements of the class that hold attributes, later ones first.
    elements: Vec<Node<'a, 'a>>,
}

impl<'a> Defaults<'a> {
    pub fn read(source: &Source, root: Node<'a, 'a>) -> Result<Defaults<'a>> {
        let mut classes: HashMap<String, Class<'a>> = HashMap::from([(MAIN.to_string(), Class::default())]);
        let sections = root.children().filter(|n| n.has_tag_name("default"));
        let mut waiting: Vec<(Node<'a, 'a>, Option<String>)> = sections.map(|n| (n, None)).collect();
        waiting.reverse();
        while let Some((node, parent)) = waiting.pop() {
            let name = match (node.attribute("class"), &parent) {
                (Some(name), _) => name.to_string(),
                (None, None) => MAIN.to_string(),
                (None, Some(_)) => {
                    let what = "a <default> within another one has no `class`";
                    return Err(source.fault(node, what, "write <default class=\"...\">"));
                }
            };
            // The outermost class is the main one, whatever it is called.
            if parent.is_none() && name != MAIN {
                classes.entry(name.clone()).or_default().parent = Some(MAIN.to_string());
            }
            let slot = if parent.is_none() { MAIN.to_string() } else { name.clone() };
            let class = classes.entry(slot.clone()).or_default();
            if slot != MAIN {
                class.parent = parent;
            }
            for element in node.children().filter(Node::is_element) {
                match element.has_tag_name("default") {
                    true => waiting.push((element, Some(slot.clone()))),
                    false => class.elements.insert(0, element),
                }
            }
        }
        Ok(Defaults { classes })
    }

    /// # Errors
    /// Where the model has no such class.
    pub fn known(&self, source: &Source, node: Node, name: &str) -> Result<()> {
        if self.classes.contains_key(name) {
            return Ok(());
        }
        let mut names: Vec<&str> = self.classes.keys().map(String::as_str).collect();
        names.sort_unstable();
        names.truncate(40);
        let what = format!("there is no class \"{name}\" of defaults");
        Err(source.fault(node, what, format!("name one of: {}", names.join(", "))))
    }

    /// An element, then its defaults, nearest first: of its own class, or of the class that bodies around it give.
    pub fn of(
        &self,
        source: &Source,
        node: Node<'a, 'a>,
        element: &str,
        around: &Option<String>,
    ) -> Result<Vec<Node<'a, 'a>>> {
        let own = node.attribute("class");
        if let Some(name) = own {
            self.known(source, node, name)?;
        }
        let mut found = vec![node];
        let mut next = Some(own.or(around.as_deref()).unwrap_or(MAIN));
        // Classes stand within each other, and so form no ring; counted all the same.
        for _ in 0..=self.classes.len() {
            let Some(class) = next.and_then(|name| self.classes.get(name)) else { break };
            found.extend(class.elements.iter().filter(|n| n.has_tag_name(element)));
            next = class.parent.as_deref();
        }
        Ok(found)
    }
}
