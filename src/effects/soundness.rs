//! Whether a family makes sense, whatever the machine.

use super::family::{Directions, Family, Grid, Meaning, Output, ParameterForm, Range, Seat};
use crate::error::Fault;
use crate::feature::{Dimension, Expression, Scope, dimension_of};
use crate::machine::JointKind;
use crate::wording::count;

/// Most parameters of a family.
const MOST_PARAMETERS: usize = 4;
/// Most features of a family.
const MOST_FEATURES: usize = 80;

/// What is wrong with a family.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{what}")]
pub struct LibraryFault {
    /// What.
    pub what: String,
    /// How to mend it.
    pub mend: String,
}

impl Fault for LibraryFault {
    fn mend(&self) -> String {
        self.mend.clone()
    }
}

pub(super) fn fault(what: impl Into<String>, mend: impl Into<String>) -> LibraryFault {
    LibraryFault { what: what.into(), mend: mend.into() }
}

/// A fault and the path of the value at which it was found.
pub(super) type Checked<T> = std::result::Result<T, (String, LibraryFault)>;

/// Everything that can be said of a family without a machine.
pub(super) fn check(family: &Family) -> Checked<()> {
    let usable = family.name.starts_with(|c: char| c.is_ascii_lowercase())
        && family.name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if !usable {
        let what = format!("\"{}\" cannot be the name of an effect", family.name);
        return Err(("name".into(), fault(what, "use lower-case letters, digits and `_`, a letter first")));
    }
    if family.form_of.as_ref() == Some(&family.name) {
        let what = format!("\"{}\" is a form of itself", family.name);
        return Err(("form_of".into(), fault(what, "leave `form_of` out, or name what it is a form of")));
    }
    if family.sits.is_empty() {
        return Err((
            "sits".into(),
            fault("it sits nowhere", "write Prismatic, Revolute, Frame or Measurement"),
        ));
    }
    if family.features.is_empty() && family.scatter.is_none() {
        return Err((
            "features".into(),
            fault("it depends on nothing", "write at least one feature, or `scatter`"),
        ));
    }
    if family.features.len() > MOST_FEATURES {
        let what = format!("there are {} features, more than {MOST_FEATURES}", family.features.len());
        return Err(("features".into(), fault(what, "use fewer")));
    }
    if family.parameters.len() > MOST_PARAMETERS {
        let what = format!("there are {} parameters, more than {MOST_PARAMETERS}", family.parameters.len());
        return Err((
            "parameters".into(),
            fault(what, "use fewer; what is linear is a coefficient and no parameter"),
        ));
    }
    if family.least.is_some_and(|least| least == 0 || least > family.features.len()) {
        let features = count(family.features.len() as u64, "feature", "features");
        let what = format!("at least {} of {features}", family.least.unwrap_or(0));
        return Err(("least".into(), fault(what, "write a number from 1 to the number of features")));
    }
    let numbers = [("often", family.often), ("size.um", family.size.um), ("size.urad", family.size.urad)];
    for (path, value) in numbers.into_iter().chain(family.usual_to.map(|to| ("usual_to", to))) {
        if !(value.is_finite() && value > 0.0) {
            return Err((
                path.into(),
                fault(format!("{value} is no usable number"), "write a positive number"),
            ));
        }
    }
    check_directions(family)?;
    check_parameters(family)?;
    for seat in &family.sits {
        check_features(family, *seat)?;
    }
    for (i, less) in family.lessened().enumerate() {
        let at = |(path, fault)| (format!("more_than[{i}].{path}"), fault);
        check_directions(&less).map_err(at)?;
        (family.sits.iter()).try_for_each(|seat| check_features(&less, *seat)).map_err(at)?;
    }
    check_sentence(family)
}

fn check_directions(family: &Family) -> Checked<()> {
    if family.directions.is_empty() && !family.features.is_empty() {
        return Err(("directions".into(), fault("it has no direction", "write at least one, such as Along")));
    }
    for (i, directions) in family.directions.iter().enumerate() {
        if let Some((what, mend)) = misplaced(*directions, &family.sits) {
            return Err((format!("directions[{i}]"), fault(what, mend)));
        }
    }
    Ok(())
}

fn misplaced(directions: Directions, sits: &[Seat]) -> Option<(String, &'static str)> {
    use Directions::*;
    let all = |fits: fn(&Seat) -> bool| sits.iter().all(fits);
    let (fits, mend) = match directions {
        Along | Across | Slide | Turn | Tilts => (
            all(|s| s.joint().is_some()),
            "let the family sit on Prismatic or Revolute only, or use Translations, Rotations",
        ),
        Translations | Rotations => {
            (all(|s| *s != Seat::Measurement), "on the Measurement use Readings or EveryJoint")
        }
        Readings | EveryJoint => (all(|s| *s == Seat::Measurement), "let the family sit on Measurement only"),
    };
    (!fits).then(|| (format!("direction {directions:?} does not go with where the family sits"), mend))
}

fn check_parameters(family: &Family) -> Checked<()> {
    for (i, form) in family.parameters.iter().enumerate() {
        let path = |field: &str| format!("parameters[{i}].{field}");
        if family.parameters[..i].iter().any(|p| p.name == form.name) {
            let what = format!("parameter \"{}\" is named twice", form.name);
            return Err((path("name"), fault(what, "give every parameter a name of its own")));
        }
        let named = |e: &Expression| *e == Expression::Parameter(form.name.clone());
        if !family.features.iter().chain(&family.scatter).any(|f| f.any(&named)) {
            let what = format!("nothing takes parameter \"{}\"", form.name);
            return Err((path("name"), fault(what, "use Parameter(\"...\") in a feature, or leave it out")));
        }
        for seat in &family.sits {
            check_range(form, *seat, &path)?;
        }
        let sound = match &form.grid {
            Grid::Logarithmic(ratio) => *ratio > 1.0 && *ratio <= 10.0,
            Grid::Parts(parts) => (1..=100_000).contains(parts),
            Grid::Whole => true,
            Grid::Periods(part) | Grid::Frequencies(part) | Grid::Orders(part) => {
                *part >= 0.01 && *part <= 1.0
            }
            Grid::Within(other, part) => {
                let known =
                    family.parameters.iter().any(|p| p.name == *other && !matches!(p.grid, Grid::Within(..)));
                known && *part >= 0.01 && *part <= 10.0
            }
        };
        if !sound {
            let mend = "Logarithmic(1.5), Parts(80), Whole, Periods(0.25), Frequencies(0.25) or Within(\"width\", 0.6)";
            return Err((path("grid"), fault("this grid makes no sense", mend)));
        }
    }
    Ok(())
}

fn check_range(form: &ParameterForm, seat: Seat, path: &dyn Fn(&str) -> String) -> Checked<()> {
    let own = seat.joint();
    let Some(dimension) = form.dimension(own) else {
        let what = format!("\"{}\" is no unit on {seat:?}", form.unit);
        return Err((path("unit"), fault(what, "write a unit such as travel (on joints), s, 1/s, m, 1")));
    };
    match (&form.range, own) {
        (Range::Travel, Some(kind)) if dimension == Dimension::of_joint(kind) => return Ok(()),
        (Range::Time, _) if dimension == Dimension::TIME => return Ok(()),
        (Range::Order, _) if dimension == Dimension::ONE => return Ok(()),
        (Range::Travel | Range::Time | Range::Order, _) => {
            let what = format!("the range is not in {dimension}");
            return Err((
                path("range"),
                fault(what, "Travel goes with unit travel on joints, Time with unit s, Order with unit 1"),
            ));
        }
        (Range::ByKind | Range::Between(..), _) => {}
    }
    let field = match (&form.range, own) {
        (Range::Between(..), _) => "range",
        (_, Some(JointKind::Revolute)) => "angular",
        _ => "linear",
    };
    let Some((from, to, found)) = form.stated(own) else {
        let mend = match own {
            Some(JointKind::Prismatic) => "add linear: (from, to, \"mm\")",
            Some(JointKind::Revolute) => "add angular: (from, to, \"deg\")",
            None => "add range: Between(from, to, \"s\")",
        };
        return Err((path(field), fault(format!("there is no range on {seat:?}"), mend)));
    };
    if found != dimension {
        let what = format!("the range is in {found}, the parameter in {dimension}");
        return Err((path(field), fault(what, "give both the same unit")));
    }
    if !(from.is_finite() && to.is_finite() && from < to) {
        return Err((path(field), fault("the range is empty", "write the smaller number first")));
    }
    let positive = !matches!(form.grid, Grid::Logarithmic(_) | Grid::Periods(_)) || from > 0.0;
    if !positive {
        return Err((
            path(field),
            fault("the range begins at or below 0", "this grid needs positive numbers"),
        ));
    }
    Ok(())
}

/// Kinds of joint that stand for joints not known yet.
const KINDS: [JointKind; 2] = [JointKind::Prismatic, JointKind::Revolute];

fn check_features(family: &Family, seat: Seat) -> Checked<()> {
    // On every joint, a feature must be right for joints of both kinds.
    let every = family.directions.contains(&Directions::EveryJoint);
    let owners: Vec<Option<JointKind>> = if every { KINDS.map(Some).to_vec() } else { vec![seat.joint()] };
    for own in owners {
        let mut dimensions = Vec::new();
        for (i, feature) in family.features.iter().enumerate() {
            dimensions.push(
                dimension(family, feature, own).map_err(|(path, f)| (format!("features[{i}]{path}"), f))?,
            );
        }
        if let Some(scatter) = &family.scatter {
            dimension(family, scatter, own).map_err(|(path, f)| (format!("scatter{path}"), f))?;
        }
        let units: Vec<Dimension> = family.directions.iter().map(|d| unit_of(*d, own)).collect();
        for (i, output) in family.coefficients.iter().enumerate() {
            check_output(family, output, &dimensions, &units, own, &format!("coefficients[{i}]"))?;
        }
    }
    Ok(())
}

/// Unit of a deviation in these directions.
fn unit_of(directions: Directions, own: Option<JointKind>) -> Dimension {
    use Directions::*;
    match directions {
        Along | EveryJoint => own.map_or(Dimension::ONE, Dimension::of_joint),
        Across | Slide | Translations | Readings => Dimension::LENGTH,
        Turn | Tilts | Rotations => Dimension::ANGLE,
    }
}

/// Other joints may be of either kind where the text does not say: one of them must fit.
fn dimension(family: &Family, feature: &Expression, own: Option<JointKind>) -> Checked<Dimension> {
    use super::family::Partner;
    let partners: Vec<Option<JointKind>> = match family.partner {
        None => vec![None],
        Some(Partner::Prismatic) => vec![Some(JointKind::Prismatic)],
        Some(Partner::Revolute) => vec![Some(JointKind::Revolute)],
        Some(Partner::Joint) => KINDS.map(Some).to_vec(),
    };
    let mut result = None;
    for partner in partners {
        let mut this = None;
        for kind in KINDS {
            let named = |_: &str| Some(kind);
            let parameter =
                |name: &str| family.parameters.iter().find(|p| p.name == name).and_then(|p| p.dimension(own));
            let scope = Scope { own, partner, named: &named, parameter: &parameter };
            let found = dimension_of(feature, &scope);
            let better = found.is_ok() || this.is_none();
            if better {
                this = Some(found);
            }
            if this.as_ref().is_some_and(|r| r.is_ok()) {
                break;
            }
        }
        match this {
            Some(Ok(dimension)) => result = Some(dimension),
            Some(Err(f)) => return Err((f.path, fault(f.what, f.mend))),
            None => {}
        }
    }
    Ok(result.unwrap_or(Dimension::ONE))
}

fn check_output(
    family: &Family,
    output: &Output,
    dimensions: &[Dimension],
    units: &[Dimension],
    own: Option<JointKind>,
    path: &str,
) -> Checked<()> {
    let at = |field: &str| format!("{path}.{field}");
    let feature = |order: usize| match dimensions.get(order) {
        Some(dimension) => Ok(units.first().copied().unwrap_or(Dimension::ONE).over(*dimension)),
        None => {
            let what = format!("there is no feature {order}");
            Err((
                at("is"),
                fault(what, format!("features are counted from 0 to {}", dimensions.len().saturating_sub(1))),
            ))
        }
    };
    let parameter = |name: &str| {
        let form = family.parameters.iter().find(|p| p.name == name);
        form.and_then(|p| p.dimension(own)).ok_or_else(|| {
            (
                at("is"),
                fault(format!("there is no parameter \"{name}\""), "name one of the family's parameters"),
            )
        })
    };
    let expected = match &output.is {
        Meaning::Coefficient(order) | Meaning::Magnitude(order) => feature(*order)?,
        Meaning::Amplitude(sine, cosine) => {
            feature(*cosine)?;
            feature(*sine)?
        }
        Meaning::Phase(sine, cosine) => {
            feature(*cosine)?;
            feature(*sine)?;
            Dimension::ANGLE
        }
        Meaning::Parameter(name) => parameter(name)?,
        Meaning::TurnOver(name) => Dimension::ANGLE.over(parameter(name)?),
        Meaning::Reciprocal(name) => Dimension::ONE.over(parameter(name)?),
        Meaning::Constant(_) => Dimension::ONE,
        Meaning::Peak => {
            let length = units.contains(&Dimension::LENGTH);
            if length { Dimension::LENGTH } else { units.first().copied().unwrap_or(Dimension::ONE) }
        }
        Meaning::Components(order) => return feature(*order).map(|_| ()),
        Meaning::Curve => return Ok(()),
    };
    if output.name.is_empty() {
        return Err((at("name"), fault("this number has no name", "add name: \"...\"")));
    }
    let stated = Dimension::parse(&output.unit, own.map(Dimension::of_joint));
    if stated != Some(expected) {
        let what = format!("\"{}\" comes out in {expected}, not in \"{}\"", output.name, output.unit);
        return Err((at("unit"), fault(what, format!("write unit: \"{expected}\", or mend the features"))));
    }
    Ok(())
}

fn check_sentence(family: &Family) -> Checked<()> {
    let mut known: Vec<&str> = vec!["at"];
    known.extend(family.partner.map(|_| "partner"));
    known.extend(family.coefficients.iter().map(|o| o.name.as_str()).filter(|name| !name.is_empty()));
    for (field, text) in [("sentence", &family.sentence), ("remedy", &family.remedy)] {
        for part in text.split('{').skip(1) {
            let name = part.split('}').next().unwrap_or_default();
            if !part.contains('}') || !known.contains(&name) {
                let what = format!("the {field} asks for {{{name}}}");
                return Err((field.into(), fault(what, format!("names in braces: {}", known.join(", ")))));
            }
        }
    }
    if family.sentence.trim().is_empty() {
        return Err((
            "sentence".into(),
            fault("there is no sentence", "say what a machinist would want to know"),
        ));
    }
    Ok(())
}
