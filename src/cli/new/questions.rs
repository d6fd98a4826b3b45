//! Questions about a new machine, answered on a terminal or by what is piped in; only a person sees them.

use std::io::{BufRead, IsTerminal, StdinLock};

use crate::cli::Common;
use crate::cli::output::{Failure, Outcome};
use crate::import::{Sketch, SketchJoint, Wrong, branch, direction, limits, named_kind, point, usable_name};
use crate::machine::{JointKind, is_usable_name};
use crate::units::{Quantity, Unit};

/// So many joints are asked for at most.
const MOST: usize = 64;

/// Whoever answers.
struct Asked<'a> {
    common: &'a Common,
    input: StdinLock<'static>,
    line: usize,
    is_person: bool,
}

/// Asks for a machine; `name` is what it is called where nothing is answered.
pub(super) fn ask(common: &Common, name: &str) -> Result<Sketch, Failure> {
    let input = std::io::stdin();
    let is_person = input.is_terminal();
    let mut asked = Asked { common, input: input.lock(), line: 0, is_person };
    asked.say(
        "Points and directions are in one frame, that of the base, with all joints at zero. An empty answer takes what stands in brackets.\n",
    )?;
    let name = asked.answer(&format!("name of the machine [{name}]"), |text| match text {
        "" => Ok(name.to_string()),
        _ if is_usable_name(text) => Ok(text.to_string()),
        _ => Err((
            format!("`{}` is no name of a machine", crate::wording::shown(text)),
            "letters, digits, `_ - .`, begins with a letter, 64 at most",
        )),
    })?;
    let mut sketch = Sketch::new(name);
    sketch.units.length = asked.answer("unit of lengths: m, mm, um, nm or in [mm]", |text| {
        let symbol = if text.is_empty() { "mm" } else { text };
        let unit = Unit::named(symbol).filter(|unit| unit.quantity == Quantity::Length);
        unit.ok_or_else(|| (format!("`{}` is no unit of lengths", crate::wording::shown(text)), "write mm"))
    })?;
    asked.say(
        "Joints from the base outwards, those that carry the tool and those that carry the workpiece.\n",
    )?;
    while sketch.joints.len() < MOST {
        let Some(joint) = asked.joint(&sketch)? else { break };
        sketch.joints.push(joint);
    }
    let unit = sketch.units.length;
    let mut end = |what: &str| asked.answer(&format!("{what}, {unit} [0 0 0]"), |text| point(text, unit));
    sketch.tip = end("tool tip")?.unwrap_or(sketch.tip);
    sketch.origin = end("origin of the workpiece")?.unwrap_or(sketch.origin);
    Ok(sketch)
}

impl Asked<'_> {
    /// One more joint, or none.
    fn joint(&mut self, sketch: &Sketch) -> Result<Option<SketchJoint>, Failure> {
        let number = sketch.joints.len() + 1;
        let name =
            self.answer(&format!("joint {number}: its name, such as x or c [no more joints]"), |text| {
                match text.is_empty() {
                    true if sketch.joints.is_empty() => {
                        Err(("a machine has one joint at least".into(), "write its name"))
                    }
                    true => Ok(None),
                    false => usable_name(text, &sketch.joints).map(Some),
                }
            })?;
        let Some(name) = name else { return Ok(None) };
        let kind = self.answer("  revolute or prismatic", named_kind)?;
        let branch = self.answer("  carries tool or workpiece", branch)?;
        let where_ = match kind {
            JointKind::Revolute => {
                "  direction about which it turns that, right-handed, when its number grows: x, -y, z, or three numbers"
            }
            JointKind::Prismatic => {
                "  direction in which it moves that when its number grows: x, -y, z, or three numbers"
            }
        };
        let direction = self.answer(where_, direction)?;
        let mut joint = SketchJoint::new(name, kind, branch, direction);
        let unit = sketch.units.length;
        joint.point = self
            .answer(&format!("  a point of its axis, {unit} [as the joint before]"), |text| {
                point(text, unit)
            })?;
        let unit = sketch.units.of(kind);
        joint.travel =
            self.answer(&format!("  lower and upper limit, {unit} [none]"), |text| limits(text, unit))?;
        Ok(Some(joint))
    }

    fn say(&self, text: &str) -> Outcome {
        if self.is_person { self.common.say(text) } else { Ok(()) }
    }

    /// Asks until a person gives an answer that can stand; what is piped in has one try.
    fn answer<T>(&mut self, question: &str, read: impl Fn(&str) -> Result<T, Wrong>) -> Result<T, Failure> {
        loop {
            self.say(&format!("{question}: "))?;
            let mut text = String::new();
            let told = |what: String, mend: &str| Failure::Told { what, mend: mend.into() };
            let bytes = self.input.read_line(&mut text).map_err(|error| {
                told(format!("standard input: {error}"), "answer in UTF-8, a line for each question")
            })?;
            self.line += 1;
            if bytes == 0 {
                let what = format!("standard input:{}: no answer to: {}", self.line, question.trim());
                return Err(told(
                    what,
                    "answer every question by a line, or give --like, --joints or --joint",
                ));
            }
            match read(text.trim()) {
                Ok(answer) => return Ok(answer),
                Err((what, mend)) if self.is_person => self.say(&format!("  {what}: {mend}\n"))?,
                Err((what, mend)) => return Err(told(format!("standard input:{}: {what}", self.line), mend)),
            }
        }
    }
}
