//! A family of effects as it is written in RON.

use ron::ser::PrettyConfig;
use serde::{Deserialize, Serialize};

use crate::document::EXTENSIONS;
use crate::feature::{Dimension, Expression};
use crate::machine::JointKind;
use crate::units::Unit;

/// What the field has a name for. Entries of one name may differ from seat to seat.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "family", deny_unknown_fields)]
pub struct Family {
    /// Name, as in findings.
    pub name: String,
    /// The name that findings bear in its place, where it is a form of something with a name of its own: play that differs along the
    /// travel is a form of `backlash`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub form_of: Option<String>,
    /// Names of which it is one by a cause of its own: a dent in a guideway is a straightness error. Findings bear its own name, but who
    /// leaves out one of those leaves it out too.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kind_of: Vec<String>,
    /// Symbol of a standard, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub symbol: Option<String>,
    /// What goes on in the machine.
    pub about: String,
    /// Where it can sit.
    pub sits: Vec<Seat>,
    /// The other joint, for families that take pairs: there is then a candidate for each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partner: Option<Partner>,
    /// Whether the deviation stands before or behind the joint.
    #[serde(default, skip_serializing_if = "is_default")]
    pub pivot: Pivot,
    /// Directions in se(3): each feature has one coefficient for each direction.
    #[serde(default, skip_serializing_if = "is_default")]
    pub directions: Vec<Directions>,
    /// What the deviation depends on.
    #[serde(default, skip_serializing_if = "is_default")]
    pub features: Vec<Expression>,
    /// What the name says more than: a positioning error bends, and is no name for a straight line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub more_than: Vec<Less>,
    /// Where features enter in their order: how many there are at least. All of them, if this is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least: Option<usize>,
    /// What features depend on beside the recording.
    #[serde(default, skip_serializing_if = "is_default")]
    pub parameters: Vec<ParameterForm>,
    /// For effects that are no deviation but spread: what their variance depends on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scatter: Option<Expression>,
    /// Size of the deviation, root mean square, that is usual on machines in use.
    #[serde(default, skip_serializing_if = "is_default")]
    pub size: Size,
    /// Features behind the first are usually so much smaller, as a part of that size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub others: Option<f64>,
    /// Coefficients up to this, SI, are usual however large the deviation becomes by what they multiply: a delay is as long as the
    /// control makes it, and what it does grows with the speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub usual_to: Option<f64>,
    /// Tried only where the recordings last this long, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lasts: Option<f64>,
    /// Tried only where the recordings' clocks are such.
    #[serde(default, skip_serializing_if = "is_default")]
    pub clock: Clock,
    /// Has coefficients of its own in every set-up: it belongs to where the machine stands, not to the machine.
    #[serde(default, skip_serializing_if = "is_default")]
    pub each_setup: bool,
    /// Every joint has it, more or less: where it is found at one, the model may have it at the others too.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at_every_joint: bool,
    /// Every drive has it, more or less: models of machines in motion have a little of it at every joint from the beginning.
    #[serde(default, skip_serializing_if = "is_default")]
    pub of_every_drive: bool,
    /// Found several times at one place, with other orders, it is one error motion and one finding.
    #[serde(default, skip_serializing_if = "is_default")]
    pub as_one: bool,
    /// Which places of a branch come into question.
    #[serde(default, skip_serializing_if = "is_default")]
    pub which: Which,
    /// Tried only where the machine file states masses beyond the joint.
    #[serde(default, skip_serializing_if = "is_default")]
    pub needs_masses: bool,
    /// How often it is met, against 1 for backlash.
    pub often: f64,
    /// What is reported.
    #[serde(default, skip_serializing_if = "is_default")]
    pub coefficients: Vec<Output>,
    /// One sentence for a machinist; names in braces stand for coefficients, `{at}` for the place, `{partner}` for the other joint.
    pub sentence: String,
    /// What is at fault where it is found, as part of a sentence.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub cause: String,
    /// What to do about it: adjust, replace, enter a value, compensate, measure; names in braces as in the sentence.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub remedy: String,
    /// What it may be taken for.
    #[serde(default, skip_serializing_if = "is_default")]
    pub look_alikes: Vec<LookAlike>,
    /// Where this is written.
    #[serde(default, skip_serializing_if = "is_default")]
    pub source: String,
}

/// What a file need not say.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Family {
    /// As it is written in a file of effects, a field a line.
    pub fn to_ron(&self) -> String {
        let config = PrettyConfig::new().depth_limit(1).indentor("    ").compact_arrays(true);
        let options = ron::Options::default().with_default_extension(EXTENSIONS);
        let text =
            options.to_string_pretty(self, config).expect("a family has nothing that RON cannot write");
        format!("    {},\n", text.replace('\n', "\n    "))
    }

    /// The name that findings bear.
    pub fn told_as(&self) -> &str {
        self.form_of.as_ref().unwrap_or(&self.name)
    }

    /// Itself, were it only what its name says more than.
    pub(super) fn lessened(&self) -> impl Iterator<Item = Family> {
        self.more_than.iter().map(|less| Family {
            directions: less.directions.clone(),
            features: less.features.clone(),
            least: None,
            more_than: Vec::new(),
            coefficients: Vec::new(),
            ..self.clone()
        })
    }

    /// The widest play of which the width is stated, m or rad.
    pub(super) fn widest_play(&self) -> Option<f64> {
        let mut widest: Option<f64> = None;
        for feature in &self.features {
            if let Expression::Play(width) = feature
                && let Expression::Value(value, symbol) = &**width
                && let Some(unit) = Unit::named(symbol)
            {
                widest = Some(widest.unwrap_or(0.0).max(unit.to_si(*value)));
            }
        }
        widest
    }

    /// Whether a parameter is the travel in which something is taken up or crossed.
    pub(super) fn takes_up_in(&self, parameter: &str) -> bool {
        let named = |e: &Expression| matches!(e, Expression::Parameter(name) if name == parameter);
        let takes = |e: &Expression| matches!(e, Expression::TakeUp(length) | Expression::Play(length) if length.any(&named));
        self.features.iter().any(|feature| feature.any(&takes))
    }
}

/// Where an effect can sit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Seat {
    /// On a linear joint.
    Prismatic,
    /// On a rotary joint.
    Revolute,
    /// On a frame.
    Frame,
    /// On what the instrument reads.
    Measurement,
}

impl Seat {
    /// Kind of the joint there.
    pub fn joint(self) -> Option<JointKind> {
        match self {
            Seat::Prismatic => Some(JointKind::Prismatic),
            Seat::Revolute => Some(JointKind::Revolute),
            Seat::Frame | Seat::Measurement => None,
        }
    }
}

/// What a name says more than, in the same place and with the same parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "less", deny_unknown_fields)]
pub struct Less {
    /// Directions in se(3).
    pub directions: Vec<Directions>,
    /// What the deviation depends on.
    pub features: Vec<Expression>,
}

/// The other joint of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Partner {
    /// Any other linear joint.
    Prismatic,
    /// Any other rotary joint.
    Revolute,
    /// Any other joint.
    Joint,
}

/// Places along a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Which {
    /// All of them.
    #[default]
    All,
    /// The first, which carries all others.
    First,
    /// The last, which carries no other.
    Last,
    /// Joints that carry one rotary joint at most, so that what weighs on them is nearly one body: the last two of a wrist, a head, a
    /// table that tilts.
    Outer,
}

/// How time runs through the recordings of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Clock {
    /// No matter.
    #[default]
    Any,
    /// They follow one another on one clock, as what goes on from one to the next needs.
    One,
    /// They have no time, or clocks of their own: only the order of samples says what came first.
    None,
    /// The same, and they are of one set-up: which of several came first nothing says.
    NoneOfOneSetup,
    /// They have no time, or clocks of their own, and there are several of them, so that something may end with its recording.
    NoneOfSeveral,
}

/// Which side of the joint a deviation stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Pivot {
    /// `M exp(error) exp(xi q)`: in the frame that stands still.
    #[default]
    Before,
    /// `M exp(xi q) exp(error)`: in the frame that moves along.
    After,
}

/// Sets of directions in se(3), in the frame of the place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Directions {
    /// The joint's own twist: the error adds to its displacement.
    Along,
    /// The two translations across the joint's axis.
    Across,
    /// The translation along the joint's axis.
    Slide,
    /// The rotation about the joint's axis.
    Turn,
    /// The two rotations across the joint's axis.
    Tilts,
    /// All three translations.
    Translations,
    /// All three rotations.
    Rotations,
    /// Every length that the instrument reads, each for itself.
    Readings,
    /// The own twists of all joints at once, with one coefficient; features are then those of each joint.
    EveryJoint,
}

/// A parameter that features depend on in a way that is not linear.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "parameter", deny_unknown_fields)]
pub struct ParameterForm {
    /// Name, as in `Parameter("name")`.
    pub name: String,
    /// Its unit: `travel` (the joint's unit), `s`, `1/s`, `1`, or a product of such.
    pub unit: String,
    /// Range on linear joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linear: Option<(f64, f64, String)>,
    /// Range on rotary joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angular: Option<(f64, f64, String)>,
    /// Range, whatever the place.
    #[serde(default, skip_serializing_if = "is_default")]
    pub range: Range,
    /// Which values are tried.
    pub grid: Grid,
}

/// Range of a parameter where it is no matter of the joint's kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Range {
    /// `linear` and `angular` say it.
    #[default]
    ByKind,
    /// From, to, unit.
    Between(f64, f64, String),
    /// The own joint's travel seen.
    Travel,
    /// The time seen.
    Time,
    /// The samples counted.
    Order,
}

/// Which values of a parameter are tried. Neighbours must look alike: their columns correlate by 0.9 or more.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Grid {
    /// Each this many times the one before.
    Logarithmic(f64),
    /// This many equal steps.
    Parts(usize),
    /// Whole numbers.
    Whole,
    /// Numbers per turn: whole ones where a full turn or more was seen, else steps of this part of a wave over the travel seen.
    Orders(f64),
    /// Periods: one over them grows by this part of one over the travel (or time) seen.
    Periods(f64),
    /// Frequencies: they grow by this part of one over the time from the first recording to the last, or over eight times the longest one.
    Frequencies(f64),
    /// Steps of this part of another parameter's value.
    Within(String, f64),
}

/// Usual size of a deviation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "size", deny_unknown_fields)]
pub struct Size {
    /// Of translations, um.
    pub um: f64,
    /// Of rotations, urad.
    pub urad: f64,
}

impl Default for Size {
    fn default() -> Self {
        Size { um: 10.0, urad: 50.0 }
    }
}

/// A number that is reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "coefficient", deny_unknown_fields)]
pub struct Output {
    /// Its name; a list of numbers is named after its members.
    #[serde(default, skip_serializing_if = "is_default")]
    pub name: String,
    /// What it is.
    pub is: Meaning,
    /// Its unit, which must be what the features make of it; `travel` is the joint's unit. Left out for lists.
    #[serde(default, skip_serializing_if = "is_default")]
    pub unit: String,
    /// Unit for people, where it is not the usual one of its kind: `ppm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shown: Option<String>,
}

/// How a reported number follows from the coefficients of the features (counted from 0) and from the parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Meaning {
    /// The coefficient of a feature; of several directions the root of the sum of squares.
    Coefficient(usize),
    /// Its absolute value.
    Magnitude(usize),
    /// Of a pair of sine and cosine: half the largest extent of the ellipse that they make.
    Amplitude(usize, usize),
    /// Of a pair of sine and cosine: phase of the sine that they make, for the direction with the largest part, rad.
    Phase(usize, usize),
    /// A parameter.
    Parameter(String),
    /// A full turn over a parameter.
    TurnOver(String),
    /// One over a parameter.
    Reciprocal(String),
    /// A number that is the same for all, pure.
    Constant(f64),
    /// The largest deviation over the recordings.
    Peak,
    /// The coefficients of a feature, named by direction: vx vy vz wx wy wz.
    Components(usize),
    /// All coefficients, named c0, c1 and so on by feature, with the direction where there are several.
    Curve,
}

/// An effect that may be taken for this one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "look_alike", deny_unknown_fields)]
pub struct LookAlike {
    /// Its name.
    pub effect: String,
    /// The motion or test that tells them apart.
    pub separate_by: String,
}

impl ParameterForm {
    /// Its dimension at a place with this kind of joint.
    pub fn dimension(&self, own: Option<JointKind>) -> Option<Dimension> {
        Dimension::parse(&self.unit, own.map(Dimension::of_joint))
    }

    /// The range that the text gives for this kind of joint, SI; `None` where it is that of the recordings.
    pub fn stated(&self, own: Option<JointKind>) -> Option<(f64, f64, Dimension)> {
        let (from, to, symbol) = match (&self.range, own) {
            (Range::Between(from, to, symbol), _) => (*from, *to, symbol),
            (Range::ByKind, Some(JointKind::Prismatic)) => {
                self.linear.as_ref().map(|(a, b, u)| (*a, *b, u))?
            }
            (Range::ByKind, Some(JointKind::Revolute)) => {
                self.angular.as_ref().map(|(a, b, u)| (*a, *b, u))?
            }
            _ => return None,
        };
        match Unit::named(symbol) {
            Some(unit) => Some((unit.to_si(from), unit.to_si(to), Dimension::of_quantity(unit.quantity))),
            None => Dimension::parse(symbol, None).map(|dimension| (from, to, dimension)),
        }
    }
}
