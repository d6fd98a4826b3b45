//! Vocabulary: what a dialect has words for, and what each of its codes does.

use super::modes::{Distance, Feed, MotionKind, Plane, Units};

/// The words of a dialect. What stands in none of these lists is not followed.
pub(super) struct Vocabulary {
    /// G codes.
    pub g: &'static [Codes],
    /// M codes.
    pub m: &'static [Codes],
    /// Addresses beside those of axes.
    pub addresses: &'static [&'static str],
    /// Names without arguments, between blanks: they neither move nor call, or what they do is followed.
    pub names: &'static str,
    /// Names with arguments that neither move nor call a program of the user.
    pub calls: &'static str,
    /// What may follow names behind which the rest of the block belongs to them; any other such name may be followed by anything.
    pub statements: &'static [Statement],
    /// How parameters, variables and indexed words begin that may be written.
    pub parameters: &'static [&'static str],
}

/// What may stand behind a name.
pub(super) struct Statement {
    /// The name.
    pub name: &'static str,
    /// How the rest begins; nothing else may follow. Without any, nothing may.
    pub starts: &'static [&'static str],
    /// Words that may not be in it.
    pub never: &'static [&'static str],
}

/// Codes of one action, from the first to the last.
pub(super) struct Codes {
    /// In tenths: `G54.1` is `54_1`.
    first: u32,
    last: u32,
    /// From one code to the next.
    step: u32,
    action: Action,
}

impl Codes {
    pub const fn one(code: u32, action: Action) -> Self {
        Codes { first: code, last: code, action, step: 1 }
    }

    /// With the tenths between.
    pub const fn tenths(first: u32, last: u32, action: Action) -> Self {
        Codes { first, last, action, step: 1 }
    }

    /// Whole codes only.
    pub const fn whole(first: u32, last: u32, action: Action) -> Self {
        Codes { first, last, action, step: 10 }
    }

    fn has(&self, tenths: u32) -> bool {
        (self.first..=self.last).contains(&tenths) && (tenths - self.first).is_multiple_of(self.step)
    }
}

/// What a code does, as far as it is followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Action {
    /// Nothing that axes or coordinates depend on.
    Nothing,
    /// Known for what it is, and not followed.
    NotFollowed,
    /// The motion in force.
    Motion(MotionKind),
    /// The motion of a block that names axes; nothing in another.
    MotionOfAxes(MotionKind),
    /// A canned cycle at the place of the block.
    Cycle,
    /// Moves until a probe touches.
    Probe,
    /// Numbers of axis words are no targets.
    NoTargets,
    /// Plane of arcs.
    Plane(Plane),
    /// Unit of lengths.
    Units(Units),
    /// Unit of lengths, but a cycle of lathes with `P`.
    UnitsUnlessP(Units),
    /// Absolute or incremental.
    Distance(Distance),
    /// Meaning of `F`.
    Feed(Feed),
    /// The tool length counts.
    Length,
    /// It does not, nor does the tool centre point function.
    NoLength,
    /// The tool centre point function, on or off.
    Tcp(bool),
    /// The tool centre point function with the tool length.
    TcpWithLength,
    /// Numbers are meant in the machine's own frame.
    MachineFrame,
    /// A work offset, by its own name.
    Offset,
    /// A work offset, by the `P` word.
    OffsetByP,
    /// Axes go to a reference point.
    Reference,
    /// The present place gets numbers.
    Preset,
    /// Numbers are no targets; lengths, and the axes named, mean something else.
    Frame,
    /// All coordinates mean something else.
    FrameOfAll,
    /// A limit of the spindle with `S`, else [`Action::Frame`].
    FrameUnlessS,
    /// A call.
    Call,
    /// A call behind every block that moves, or the end of such calls.
    ModalCall(bool),
    /// The program goes on elsewhere.
    Jump,
    /// Another tool, for which the axes go elsewhere.
    ToolChange,
}

impl Vocabulary {
    /// What a G code does; `None` for one that the dialect does not have here.
    pub fn g(&self, number: f64) -> Option<Action> {
        find(self.g, number)
    }

    /// What an M code does.
    pub fn m(&self, number: f64) -> Option<Action> {
        find(self.m, number)
    }

    /// Whether the name stands for itself.
    pub fn has_name(&self, name: &str) -> bool {
        listed(self.names, name)
    }

    /// Whether the name with arguments neither moves nor calls.
    pub fn has_call(&self, name: &str) -> bool {
        listed(self.calls, name)
    }

    /// Whether what follows the name is followed. `rest`: in upper case.
    pub fn has_statement(&self, name: &str, rest: &str) -> bool {
        let name = name.trim_end_matches(|c: char| c.is_ascii_digit());
        let begins = |start: &&&str| {
            let behind = rest.strip_prefix(**start).map(|behind| behind.chars().next());
            // `DEF 2` is not the start of `DEF 200`.
            behind.is_some_and(|next| !next.is_some_and(|c| c.is_ascii_alphanumeric()))
        };
        self.statements.iter().filter(|s| s.name == name).all(|s| {
            s.starts.iter().any(|start| begins(&start)) && !s.never.iter().any(|word| rest.contains(word))
        })
    }

    /// Whether the address may stand in a block, beside those of axes.
    pub fn has_address(&self, address: &str) -> bool {
        let letters = address.trim_end_matches(|c: char| c.is_ascii_digit());
        self.addresses.contains(&address)
            // `M2=3`, `S1=`, parameters `R17`, `Q5`.
            || letters.len() < address.len() && self.parameters.contains(&letters)
            || address.starts_with('_') && self.parameters.contains(&"_")
    }

    /// Whether a text that assigns something outside the words of a block may stand there.
    pub fn may_assign(&self, text: &str) -> bool {
        let number = text.strip_prefix('#').map(|rest| rest.trim_start()).and_then(|rest| {
            let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
            rest[..digits].parse::<u32>().ok()
        });
        match number {
            // From there on a control keeps its own: offsets, tools, places.
            Some(number) => number < 1000,
            None => self.parameters.iter().any(|start| start.len() > 1 && text.starts_with(start)),
        }
    }
}

fn find(codes: &[Codes], number: f64) -> Option<Action> {
    let tenths = number * 10.0;
    // `G54.12` is no `G54.1`.
    if !(0.0..1e6).contains(&tenths) || (tenths - tenths.round()).abs() > 1e-6 {
        return None;
    }
    let tenths = tenths.round() as u32;
    codes.iter().find(|codes| codes.has(tenths)).map(|codes| codes.action)
}

fn listed(names: &str, name: &str) -> bool {
    names.split_ascii_whitespace().any(|known| known == name)
}
