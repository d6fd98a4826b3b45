//! Families on one machine with given recordings: candidates with everything resolved.

use super::facts::RecordingFacts;
use super::family::{Clock, Directions, Family, Grid, Partner, Pivot, Range, Seat, Which};
use super::grid;
use super::library::Library;
use crate::feature::{Binding, Dimension, Expression, Feature, Scope, Unbound, dimension_of};
use crate::lie::{Twist, Vec3};
use crate::machine::{JointKind, Machine};
use crate::units::{Quantity, Unit};

/// Where an effect sits on a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// On the joint of this dyad.
    Joint(usize),
    /// On the joint of the first dyad, depending on that of the second.
    Pair(usize, usize),
    /// On the frame of this dyad.
    Frame(usize),
    /// On what the instrument reads.
    Measurement,
}

impl Place {
    /// As in findings: the name of a joint or a frame, or `measurement`.
    pub fn name(self, machine: &Machine) -> String {
        match self {
            Place::Joint(j) | Place::Pair(j, _) => joint_name(machine, j),
            Place::Frame(j) => machine.dyads()[j].frame.clone(),
            Place::Measurement => "measurement".into(),
        }
    }

    /// The dyad, if it is on the machine.
    pub fn dyad(self) -> Option<usize> {
        match self {
            Place::Joint(j) | Place::Pair(j, _) | Place::Frame(j) => Some(j),
            Place::Measurement => None,
        }
    }

    /// Name of the other joint of a pair.
    pub fn partner(self, machine: &Machine) -> Option<String> {
        match self {
            Place::Pair(_, partner) => Some(joint_name(machine, partner)),
            _ => None,
        }
    }
}

fn joint_name(machine: &Machine, j: usize) -> String {
    machine.dyads()[j]
        .joint
        .as_ref()
        .map_or_else(|| machine.dyads()[j].frame.clone(), |joint| joint.name.clone())
}

/// Where a deviation stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// `M_j exp(deviation) exp(xi_j q_j)`.
    Before(usize),
    /// `M_j exp(xi_j q_j) exp(deviation)`.
    After(usize),
    /// Added to what the instrument reads: the six numbers of the direction are weights of readings 0 to 5.
    Reading,
}

/// One summand: coefficient × feature × direction in a slot.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Where it stands.
    pub slot: Slot,
    /// Its direction in the frame of the slot.
    pub direction: Twist<f64>,
    /// Index in [`Candidate::features`].
    pub feature: usize,
}

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
    /// What it multiplies.
    pub parts: Vec<Part>,
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
    /// How often it is met, against 1 for backlash.
    pub often: f64,
    /// For effects that are spread: what their variance depends on.
    pub scatter: Option<Feature>,
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

fn places(family: &Family, machine: &Machine) -> Vec<Place> {
    let mut places = Vec::new();
    let sits = |kind: JointKind| family.sits.iter().any(|seat| seat.joint() == Some(kind));
    let along = |j: usize, k: usize| machine.branch(k) == machine.branch(j);
    let here = |j: usize| match family.which {
        Which::All => true,
        Which::First => machine.joints().all(|(k, _)| k >= j || !along(j, k)),
        Which::Last => (j + 1..machine.dyads().len()).all(|k| !along(j, k)),
    };
    for (j, _) in machine.joints().filter(|(j, joint)| sits(joint.kind) && here(*j)) {
        let Some(partner) = family.partner else {
            places.push(Place::Joint(j));
            continue;
        };
        let fits = |kind: JointKind| match partner {
            Partner::Joint => true,
            Partner::Prismatic => kind == JointKind::Prismatic,
            Partner::Revolute => kind == JointKind::Revolute,
        };
        places.extend(
            machine.joints().filter(|(k, other)| *k != j && fits(other.kind)).map(|(k, _)| Place::Pair(j, k)),
        );
    }
    if family.sits.contains(&Seat::Frame) {
        places.extend((0..machine.dyads().len()).filter(|j| here(*j)).map(Place::Frame));
    }
    if family.sits.contains(&Seat::Measurement) {
        places.push(Place::Measurement);
    }
    places
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
        Clock::None | Clock::NoneOfSeveral if facts.one_clock => {
            return Err("the recordings' clock says what came first".into());
        }
        Clock::NoneOfSeveral if facts.begins.len() == 1 => return Err("there is one recording".into()),
        Clock::None | Clock::NoneOfSeveral if facts.begins.is_empty() => {
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
    let (spacing, stride) = own.map_or((0.0, 0.0), |j| (facts.spacing[j], facts.stride[j]));
    if widest_play(family).is_some_and(|width| width < stride) {
        return Err(grid::TOO_FAR.into());
    }
    let ranges = (family.parameters.iter())
        .map(|form| {
            let stride = if is_taken_up(family, &form.name) { stride } else { 0.0 };
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
    Ok(Candidate {
        family: index,
        effect: family.name.clone(),
        place,
        scatter: family.scatter.as_ref().map(|e| bind(e, own)).transpose()?,
        features,
        coefficients,
        parameters,
        grid: grid::points(&family.parameters, &ranges, travel, facts),
        least: family.least.unwrap_or(family.features.len()).min(own_features.len()),
        often: family.often,
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

/// The widest play of which the width is stated, m or rad.
fn widest_play(family: &Family) -> Option<f64> {
    let mut widest: Option<f64> = None;
    for feature in &family.features {
        if let Expression::Play(width) = feature
            && let Expression::Value(value, symbol) = &**width
            && let Some(unit) = Unit::named(symbol)
        {
            widest = Some(widest.unwrap_or(0.0).max(unit.to_si(*value)));
        }
    }
    widest
}

/// Whether a parameter is the travel in which something is taken up.
fn is_taken_up(family: &Family, parameter: &str) -> bool {
    let named = |e: &Expression| matches!(e, Expression::Parameter(name) if name == parameter);
    let takes = |e: &Expression| matches!(e, Expression::TakeUp(length) if length.any(&named));
    family.features.iter().any(|feature| feature.any(&takes))
}

/// Whether the joint of dyad `j` carries masses that the machine file states.
fn has_masses(machine: &Machine, j: usize) -> bool {
    let beyond =
        machine.dyads().iter().enumerate().skip(j).filter(|(k, _)| machine.branch(*k) == machine.branch(j));
    beyond.into_iter().any(|(_, dyad)| dyad.mass.is_some_and(|m| m.mass > 0.0))
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

/// Name, slot, direction and unit of each direction at a place.
fn directions(
    family: &Family,
    place: Place,
    machine: &Machine,
    facts: &RecordingFacts,
) -> Vec<(String, Slot, Twist<f64>, Dimension)> {
    let zero = Vec3([0.0; 3]);
    let slot = |j| match family.pivot {
        Pivot::Before => Slot::Before(j),
        Pivot::After => Slot::After(j),
    };
    let joint = place.dyad().and_then(|j| machine.dyads()[j].joint.as_ref());
    let axis = joint.map_or(Vec3([0.0, 0.0, 1.0]), |joint| joint.axis);
    let mut all = Vec::new();
    for set in &family.directions {
        if *set == Directions::Readings {
            for (i, _) in facts.readings.iter().enumerate().filter(|(_, q)| reads(facts, **q)) {
                let mut weights = [0.0; 6];
                weights[i] = 1.0;
                let unit = Dimension::of_quantity(facts.readings[i]);
                all.push((format!("r{i}"), Slot::Reading, Twist::from_array(weights), unit));
            }
            continue;
        }
        let Some(j) = place.dyad() else { continue };
        let mut translation =
            |v: Vec3<f64>| all.push((named('v', v), slot(j), Twist::new(v, zero), Dimension::LENGTH));
        match set {
            Directions::Translations => basis().into_iter().for_each(&mut translation),
            Directions::Across => axis.across().into_iter().for_each(&mut translation),
            Directions::Slide => translation(axis),
            _ => {}
        }
        let mut rotation =
            |w: Vec3<f64>| all.push((named('w', w), slot(j), Twist::new(zero, w), Dimension::ANGLE));
        match set {
            Directions::Rotations => basis().into_iter().for_each(&mut rotation),
            Directions::Tilts => axis.across().into_iter().for_each(&mut rotation),
            Directions::Turn => rotation(axis),
            _ => {}
        }
        if let (Directions::Along, Some(joint)) = (set, joint) {
            all.push(("along".into(), slot(j), joint.twist(), Dimension::of_joint(joint.kind)));
        }
    }
    all
}

/// Lengths, or angles where the instrument reads nothing else.
fn reads(facts: &RecordingFacts, quantity: Quantity) -> bool {
    quantity == Quantity::Length || !facts.readings.contains(&Quantity::Length)
}

fn basis() -> [Vec3<f64>; 3] {
    [Vec3([1.0, 0.0, 0.0]), Vec3([0.0, 1.0, 0.0]), Vec3([0.0, 0.0, 1.0])]
}

/// `vx` for a frame's own vector, `v` with its components for another.
fn named(letter: char, vector: Vec3<f64>) -> String {
    for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
        if (vector.0[k].abs() - 1.0).abs() < 1e-12 {
            return format!("{letter}{name}");
        }
    }
    let [x, y, z] = vector.0;
    format!("{letter}({x:.3},{y:.3},{z:.3})")
}
