//! Families on one machine with given recordings: candidates with everything resolved.

use super::directions::directions;
use super::facts::RecordingFacts;
use super::family::{Clock, Directions, Family, Grid, Range};
use super::grid;
use super::library::Library;
use super::place::{Place, joint_name, places};
use crate::feature::{Binding, Dimension, Expression, Feature, Scope, Unbound, dimension_of};
use crate::lie::Twist;
use crate::machine::{Dyad, Machine};
use crate::units::Unit;
use crate::variation::{Part, Slot};

/// A number to be found. Its parts share it.
#[derive(Clone, Debug, PartialEq)]
pub struct Coefficient {
    /// Index of the feature in the family's list.
    pub order: usize,
    /// Name of its direction, `vx` to `wz`; empty where there is only one.
    pub direction: String,
    /// Its unit.
    pub dimension: Dimension,
    /// Root mean square that coefficient × feature has on machines in use, m or rad (of the first part's direction).
    pub size: f64,
    /// What it multiplies; their features are indices in [`Candidate::features`].
    pub parts: Vec<Part<usize>>,
}

/// A parameter of the features, to be found on the grid and then by its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name in the family.
    pub name: String,
    /// Its unit.
    pub dimension: Dimension,
    /// Least and greatest value that make sense, SI.
    pub range: (f64, f64),
    /// Where there are gaps between them, what lies between the gaps.
    pub pieces: Vec<(f64, f64)>,
    /// Whether the features' derivatives by it say how they change. Else (whole numbers, moments of a step) only the grid does.
    pub smooth: bool,
    /// Whether only whole numbers come into question.
    pub whole: bool,
}

impl Parameter {
    /// The range, or the piece of it that a value lies in.
    pub fn range_around(&self, value: f64) -> (f64, f64) {
        let piece = self.pieces.iter().find(|(from, to)| (*from..=*to).contains(&value));
        piece.copied().unwrap_or(self.range)
    }
}

/// A family at one place: columns of a regression, `docs/effects.md` (40).
///
/// The deviation is `Σ coefficients c · Σ parts direction · feature(sample; parameters)`. Evaluate each of `features` once for
/// each point of `grid` ([`Feature::over`], [`Feature::with_derivatives`]); coefficients only multiply.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Index in [`Library::families`].
    pub family: usize,
    /// Name of the effect.
    pub effect: String,
    /// The name that findings bear: another one where the family is a form of that, [`Family::told_as`].
    pub told_as: String,
    /// Where it sits.
    pub place: Place,
    /// Distinct features; all have the parameters of `parameters`, in that order.
    pub features: Vec<Feature>,
    /// What is to be found; empty for effects that are spread and no deviation.
    pub coefficients: Vec<Coefficient>,
    /// What the features depend on beside the recording.
    pub parameters: Vec<Parameter>,
    /// Points of the parameters to be tried, SI; a single one without numbers where there are no parameters.
    pub grid: Vec<Vec<f64>>,
    /// Coefficients of features beyond this many may be left out from the end, by their `order`.
    pub least: usize,
    /// Itself, were it only what its name says more than, with the same parameters.
    pub more_than: Vec<Candidate>,
    /// Found several times at one place, it is told as one, [`Family::as_one`].
    pub as_one: bool,
    /// How often it is met, against 1 for backlash.
    pub often: f64,
    /// Coefficients up to this, SI, are usual whatever the deviation that they make.
    pub usual_to: Option<f64>,
    /// For effects that are spread: what their variance depends on.
    pub scatter: Option<Feature>,
}

impl Candidate {
    /// Whether its features jump at a value of a parameter, as a slip does at its moment.
    pub(crate) fn jumps(&self) -> bool {
        self.parameters.iter().any(|p| !p.smooth && !p.whole)
    }
}

/// A family that was not tried at a place, or nowhere, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skipped {
    /// Name of the effect.
    pub effect: String,
    /// Name of the place; `None` where none came into question.
    pub at: Option<String>,
    /// Why, as the end of a sentence.
    pub reason: String,
}

impl Skipped {
    /// Whether a column of times would let it be tried.
    pub(crate) fn is_for_want_of_time(&self) -> bool {
        self.reason == grid::NO_TIME || self.reason == Unbound::NoTime.to_string()
    }
}

/// All candidates, and what was left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidates {
    /// In the order of the library, places in machine order.
    pub all: Vec<Candidate>,
    /// What was left out.
    pub skipped: Vec<Skipped>,
}

impl Library {
    /// Every family at every place of the machine where it can sit, as far as the recordings have what it needs.
    pub fn candidates(&self, machine: &Machine, facts: &RecordingFacts) -> Candidates {
        let mut found = Candidates::default();
        for (index, family) in self.families().iter().enumerate() {
            let places = places(family, machine);
            if places.is_empty() {
                let reason = "the machine has no place for it".into();
                found.skipped.push(Skipped { effect: family.name.clone(), at: None, reason });
            }
            for place in places {
                match candidate(index, family, place, machine, facts) {
                    Ok(candidate) => found.all.push(candidate),
                    Err(reason) => {
                        let at = Some(place.name(machine));
                        found.skipped.push(Skipped { effect: family.name.clone(), at, reason });
                    }
                }
            }
        }
        found
    }
}

fn candidate(
    index: usize,
    family: &Family,
    place: Place,
    machine: &Machine,
    facts: &RecordingFacts,
) -> Result<Candidate, String> {
    let (own, partner) = match place {
        Place::Joint(j) => (Some(j), None),
        Place::Pair(j, partner) => (Some(j), Some(partner)),
        Place::Frame(_) | Place::Measurement => (None, None),
    };
    for j in [own, partner].into_iter().flatten() {
        if !facts.moves(j) {
            return Err(format!("joint {} does not move", joint_name(machine, j)));
        }
    }
    if let Some(lasts) = family.lasts {
        let (from, to) = facts.time.ok_or(grid::NO_TIME)?;
        if to - from < lasts {
            return Err(format!(
                "it takes {} h to show, and the recordings last {:.1} h",
                lasts / 3600.0,
                (to - from) / 3600.0
            ));
        }
    }
    match family.clock {
        Clock::One if facts.time.is_some() && !facts.one_clock => return Err(grid::MANY_CLOCKS.into()),
        Clock::None | Clock::NoneOfOneSetup | Clock::NoneOfSeveral if facts.one_clock => {
            return Err("the recordings' clock says what came first".into());
        }
        Clock::NoneOfOneSetup if facts.setups.len() > 1 => {
            return Err("they are of several set-ups, and no clock says which came first".into());
        }
        Clock::NoneOfSeveral if facts.begins.len() == 1 => return Err("there is one recording".into()),
        Clock::None | Clock::NoneOfOneSetup | Clock::NoneOfSeveral if facts.begins.is_empty() => {
            return Err("two recordings have one name, and nothing says which came first".into());
        }
        _ => {}
    }
    if family.needs_masses && !own.is_some_and(|j| has_masses(machine, j)) {
        return Err("the machine file states no masses beyond the joint".into());
    }
    let kind = |j: usize| machine.dyads()[j].joint.as_ref().map(|joint| joint.kind);
    let own_kind = own.and_then(kind);
    let travel = own.and_then(|j| facts.travel[j]);
    let names: Vec<String> = family.parameters.iter().map(|p| p.name.clone()).collect();
    let binding = |own| Binding {
        machine,
        own,
        partner,
        travel: &facts.travel,
        time: facts.time,
        begins: &facts.begins,
        parameters: &names,
    };
    let bind = |expression: &Expression, own| {
        Feature::bind(expression, &binding(own)).map_err(|e| e.to_string()).and_then(|f| has_all(f, facts))
    };
    let spacing = own.map_or((0.0, 0.0), |j| (facts.spacing[j], facts.finest[j]));
    let stride = own.map_or(0.0, |j| facts.stride[j]);
    if family.widest_play().is_some_and(|width| width < stride) {
        return Err(grid::TOO_FAR.into());
    }
    let ranges = (family.parameters.iter())
        .map(|form| {
            let stride = if family.takes_up_in(&form.name) { stride } else { 0.0 };
            grid::range(form, own_kind, travel, spacing, stride, facts)
        })
        .collect::<Result<Vec<_>, _>>()?;

    // Features of the own joint; a family on every joint has those of each joint in their turn.
    let every = family.directions.contains(&Directions::EveryJoint);
    let owners: Vec<Option<usize>> = match every {
        true => machine.joints().map(|(j, _)| j).filter(|j| facts.moves(*j)).map(Some).collect(),
        false => vec![own],
    };
    // Levers of joints that are not there are no features of this place.
    let there = |e: &Expression| {
        owners.iter().all(|own| !matches!(Feature::bind(e, &binding(*own)), Err(Unbound::NoLever)))
    };
    // Through few targets goes every curve of as high an order.
    let is_shown = |e: &Expression| {
        own.and_then(|j| facts.places[j]).is_none_or(|places| usize::from(e.degree()) < places)
    };
    let own_features: Vec<(usize, &Expression)> =
        family.features.iter().enumerate().filter(|(_, e)| there(e) && is_shown(e)).collect();
    let mut features = Vec::new();
    for owner in &owners {
        for (_, expression) in &own_features {
            features.push(bind(expression, *owner)?);
        }
    }
    let dimensions = |owner: Option<usize>| {
        let named =
            |name: &str| machine.joints().find(|(_, joint)| joint.name == name).map(|(_, joint)| joint.kind);
        let parameter = |name: &str| {
            family.parameters.iter().find(|p| p.name == name).and_then(|p| p.dimension(owner.and_then(kind)))
        };
        let scope = Scope {
            own: owner.and_then(kind),
            partner: partner.and_then(kind),
            named: &named,
            parameter: &parameter,
        };
        let one = |e: &Expression| dimension_of(e, &scope).map_err(|fault| fault.to_string());
        own_features.iter().map(|(_, e)| one(e)).collect::<Result<Vec<_>, _>>()
    };
    let dimensions = dimensions(owners.first().copied().flatten())?;

    let directions = directions(family, place, machine, facts);
    let mut coefficients = Vec::new();
    for (index, ((order, _), dimension)) in own_features.iter().zip(&dimensions).enumerate() {
        let order = *order;
        if every {
            let parts = (owners.iter().flatten().enumerate())
                .map(|(i, j)| Part {
                    slot: Slot::Before(*j),
                    direction: machine.dyads()[*j]
                        .joint
                        .as_ref()
                        .map_or(Twist::zero(0.0), |joint| joint.twist()),
                    feature: i * own_features.len() + index,
                })
                .collect();
            // Deviation and feature carry the same joint's unit: what is left is the same for all.
            let own =
                owners.first().copied().flatten().and_then(kind).map_or(Dimension::ONE, Dimension::of_joint);
            let size = family.size.um * 1e-6;
            let dimension = own.over(*dimension);
            coefficients.push(Coefficient { order, direction: String::new(), dimension, size, parts });
            continue;
        }
        for (name, slot, direction, unit) in &directions {
            let size = if *unit == Dimension::ANGLE { family.size.urad } else { family.size.um } * 1e-6;
            let size = if index > 0 { size * family.others.unwrap_or(1.0) } else { size };
            let name = if directions.len() > 1 { name.clone() } else { String::new() };
            let part = Part { slot: *slot, direction: *direction, feature: index };
            coefficients.push(Coefficient {
                order,
                direction: name,
                dimension: unit.over(*dimension),
                size,
                parts: vec![part],
            });
        }
    }
    if family.each_setup {
        (features, coefficients) = in_each_setup(&features, &coefficients, facts)?;
    }
    if coefficients.is_empty() && family.scatter.is_none() {
        return Err("the instrument reads nothing that it could change".into());
    }
    // A whole number of teeth has no derivative that says anything.
    let turned = travel.is_some_and(|(a, b)| b - a >= 0.99 * std::f64::consts::TAU);
    let whole = |i: usize| match family.parameters[i].grid {
        Grid::Whole => true,
        Grid::Orders(_) => turned,
        _ => false,
    };
    let parameters = (family.parameters.iter().zip(&ranges).enumerate())
        .map(|(i, (form, range))| Parameter {
            name: form.name.clone(),
            dimension: form.dimension(own_kind).unwrap_or(Dimension::ONE),
            range: *range,
            pieces: if form.range == Range::Order { grid::insides(facts) } else { Vec::new() },
            whole: whole(i),
            smooth: !whole(i) && features.iter().all(|f| f.is_smooth_in(i)),
        })
        .collect();
    let lessened = |less: Family| candidate(index, &less, place, machine, facts);
    Ok(Candidate {
        more_than: family.lessened().map(lessened).collect::<Result<_, _>>()?,
        family: index,
        effect: family.name.clone(),
        told_as: family.told_as().into(),
        place,
        scatter: family.scatter.as_ref().map(|e| bind(e, own)).transpose()?,
        features,
        coefficients,
        parameters,
        grid: grid::points(&family.parameters, &ranges, travel, facts),
        least: family.least.unwrap_or(family.features.len()).min(own_features.len()),
        as_one: family.as_one,
        often: family.often,
        usual_to: family.usual_to,
    })
}

/// Features and coefficients anew for each set-up, 0 in the others.
fn in_each_setup(
    features: &[Feature],
    coefficients: &[Coefficient],
    facts: &RecordingFacts,
) -> Result<(Vec<Feature>, Vec<Coefficient>), String> {
    if facts.setups.len() < 2 {
        return Err("of one set-up nothing tells it from the machine's own".into());
    }
    if facts.begins.is_empty() {
        return Err("two recordings have one name, and nothing says which set-up is meant".into());
    }
    let (mut own_features, mut own_coefficients) = (Vec::new(), Vec::new());
    for coefficient in coefficients {
        for (s, (setup, _)) in facts.setups.iter().enumerate() {
            let mut own = coefficient.clone();
            own.parts.iter_mut().for_each(|part| part.feature += s * features.len());
            own.direction = format!("{}@{setup}", own.direction);
            own_coefficients.push(own);
        }
    }
    for (_, recordings) in &facts.setups {
        own_features.extend(features.iter().map(|feature| feature.only_in(recordings)));
    }
    Ok((own_features, own_coefficients))
}

/// Whether the joint of dyad `j` carries masses that the machine file states.
fn has_masses(machine: &Machine, j: usize) -> bool {
    let beyond =
        machine.dyads().iter().enumerate().skip(j).filter(|(k, _)| machine.branch(*k) == machine.branch(j));
    let sides = machine.side_branches().iter().filter(|side| machine.carries(j, side));
    let weighs = |dyad: &Dyad| dyad.mass.is_some_and(|m| m.mass > 0.0);
    beyond.into_iter().any(|(_, dyad)| weighs(dyad)) || sides.flat_map(|side| &side.dyads).any(weighs)
}

/// The feature, if the recordings have all that it needs.
fn has_all(feature: Feature, facts: &RecordingFacts) -> Result<Feature, String> {
    if facts.time.is_none() && (feature.needs_time() || feature.needs_rates()) {
        return Err(grid::NO_TIME.into());
    }
    if facts.settled && feature.needs_rates() {
        return Err("it needs velocities, and samples are settled positions".into());
    }
    for (name, unit) in feature.channels() {
        let quantity = Unit::named(&unit).map(|u| u.quantity);
        if !facts.channels.iter().any(|(n, q)| *n == name && Some(*q) == quantity) {
            return Err(format!("it needs a column {name}[{unit}], which not all recordings have"));
        }
    }
    Ok(feature)
}
