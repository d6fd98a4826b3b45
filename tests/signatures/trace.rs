//! What a family does to the readings of a test.

use kincal::CalibratedMachine;
use kincal::effects::{Candidate, Clock, Family, Identified, Library, Place};
use kincal::feature::{Samples, samples_of};
use kincal::predict::residuals;

use super::scene::{Drawing, Scene};

/// Readings of a test on a machine with one effect and nothing else.
pub struct Trace<'a> {
    pub scene: &'a Scene,
    /// m, one for each sample of the scene.
    pub readings: Vec<f64>,
    /// Where the effect sits, and what ran.
    pub conditions: String,
}

/// Below this a trace shows nothing, m.
const NOTHING: f64 = 1e-7;

/// How much of each direction: a shift in one direction alone would hide what the others do.
const DIRECTIONS: [f64; 6] = [1.0, 0.7, -0.5, 0.4, -0.6, 0.3];
/// What enters only where recordings ask for it is this much smaller, one after the other.
const SMALLER: f64 = 0.35;

/// Families that take an hour to show, or a day, and those that show by a change of the feed.
const HOUR: [&str; 9] = [
    "thermal_drift",
    "temperature_drift",
    "frame_creep",
    "spindle_growth",
    "screw_growth",
    "screw_growth_by_use",
    "thermal_expansion",
    "sensor_drift",
    "clock_drift",
];
/// Families that only a turn about a level axis shows as they are.
const WEIGHS: [&str; 1] = ["gravity_backlash"];
const FEEDS: [&str; 4] = ["servo_lag", "inertial_error", "inertial_deflection", "speed_growth"];

/// Values of parameters that a picture shows well, SI; others are in the middle of their range.
const VALUES: [(&str, &str, f64, f64); 26] = [
    // family, parameter, on linear joints and elsewhere, on rotary joints
    ("", "take_up", 0.012, 0.15),
    ("", "gap", 2e-4, 1e-3),
    ("", "decay", 0.006, 0.08),
    ("", "roundness", 0.0, 0.0),
    ("", "speed", 3e-3, 0.03),
    ("", "extent", 0.03, 0.4),
    ("", "width", 0.012, 0.12),
    ("", "at", -0.06, 2.2),
    ("", "at_time", 22.0, 22.0),
    ("", "widest", 0.02, 0.3),
    ("", "lean", 0.1, 0.1),
    ("", "friction", 0.25, 0.25),
    ("", "load", 20.0, 15.0),
    ("", "preload", 12.0, 12.0),
    ("", "from", 0.0, 0.0),
    ("", "time_constant", 1200.0, 1200.0),
    ("", "frequency", 0.5, 0.5),
    ("cyclic_error", "period", 0.03, 0.03),
    ("cyclic_error", "per_rev", 36.0, 36.0),
    ("interpolation_error", "period", 1e-4, 1e-4),
    ("interpolation_error", "per_rev", 4096.0, 4096.0),
    ("cyclic_straightness", "period", 0.05, 0.05),
    ("graduation_error", "per_rev", 4.0, 4.0),
    ("axis_wobble", "per_rev", 2.0, 2.0),
    ("radial_runout", "per_rev", 3.0, 3.0),
    ("sub_harmonic_runout", "per_rev", 0.45, 0.45),
];

/// A scene with what the library makes of it.
pub struct Ready<'a> {
    scene: &'a Scene,
    samples: Vec<Samples>,
    candidates: Vec<Candidate>,
}

impl<'a> Ready<'a> {
    /// All scenes, in their order.
    pub fn all(library: &Library, scenes: &'a [Scene]) -> Vec<Ready<'a>> {
        let ready = |scene: &'a Scene| Ready {
            scene,
            samples: samples(scene),
            candidates: library.candidates(&scene.machine, &scene.facts).all,
        };
        scenes.iter().map(ready).collect()
    }
}

/// The trace in the first scene that shows the family; where a bar can point three ways, in the one that shows most.
pub fn of<'a>(library: &Library, index: usize, ready: &[Ready<'a>]) -> Trace<'a> {
    let family = &library.families()[index];
    let mut best: Option<(f64, Trace)> = None;
    for Ready { scene, samples, candidates } in
        ready.iter().filter(|own| comes_into_question(family, own.scene))
    {
        let scene: &'a Scene = scene;
        if best.as_ref().is_some_and(|(_, best)| best.scene.name != scene.name) {
            break;
        }
        let mut own: Vec<&Candidate> = candidates.iter().filter(|c| c.family == index).collect();
        own.sort_by_key(|candidate| rank(candidate.place, scene));
        for candidate in own {
            let readings = match candidate.scatter {
                Some(_) => scattered(candidate, scene, samples),
                None => readings(family, candidate, scene, samples),
            };
            let size = rms(&readings);
            if size > NOTHING && best.as_ref().is_none_or(|(most, _)| size > 1.05 * most) {
                let at = candidate.place.name(&scene.machine);
                let at = match (candidate.place, candidate.place.partner(&scene.machine)) {
                    (_, Some(partner)) => format!("Effect at {at}, with {partner}"),
                    (Place::Measurement, _) => "Effect on the measurement".into(),
                    (Place::Frame(_), _) => format!("Effect at frame {at}"),
                    _ => format!("Effect at {at}"),
                };
                best = Some((size, Trace { scene, readings, conditions: format!("{at}; {}", scene.says) }));
                break;
            }
        }
    }
    best.unwrap_or_else(|| panic!("{} shows in no scene", family.name)).1
}

fn comes_into_question(family: &Family, scene: &Scene) -> bool {
    let name = family.name.as_str();
    match scene.name {
        "circle" => {
            !(HOUR.contains(&name) || FEEDS.contains(&name) || family.lasts.is_some() || family.each_setup)
        }
        "two feeds" => FEEDS.contains(&name),
        "an hour" => HOUR.contains(&name),
        "a day" => family.lasts.is_some(),
        "two set-ups" => family.each_setup,
        "along x" => family.clock == Clock::Any || family.clock == Clock::One,
        "turn of c" => !family.each_setup && !WEIGHS.contains(&name),
        _ => !family.each_setup,
    }
}

/// Places that readers know best come first: X, C, the frame of the tool.
fn rank(place: Place, scene: &Scene) -> usize {
    let name = place.name(&scene.machine);
    // A joint and its frame may bear one name.
    let known: &[&str] = if matches!(place, Place::Frame(_)) { &["t"] } else { &["x", "c", "a", "y"] };
    known.iter().position(|known| *known == name).unwrap_or(known.len())
}

fn samples(scene: &Scene) -> Vec<Samples> {
    let one = |recording| {
        samples_of(recording, &scene.machine, &scene.facts.dead_bands).unwrap_or_else(|e| panic!("{e}"))
    };
    scene.recordings.iter().flat_map(one).collect()
}

/// By the candidate at its usual size.
fn readings(family: &Family, candidate: &Candidate, scene: &Scene, samples: &[Samples]) -> Vec<f64> {
    let machine = &scene.machine;
    let parameters = parameters(candidate, scene);
    let mut of_order = std::collections::BTreeMap::new();
    let coefficients = (candidate.coefficients.iter())
        .map(|coefficient| {
            let nth = of_order.entry(coefficient.order).or_insert(0);
            let direction = DIRECTIONS[*nth % DIRECTIONS.len()];
            *nth += 1;
            let column = candidate.features[coefficient.parts[0].feature].over(samples, &parameters);
            let beyond = (coefficient.order + 1).saturating_sub(candidate.least);
            let weight = SMALLER.powi(beyond as i32) * direction;
            let size = rms(&column);
            // What takes part in one set-up only is as large there as it would be everywhere.
            if size > 0.0 { weight * coefficient.size / size } else { 0.0 }
        })
        .collect();
    let found = Identified { family, candidate, coefficients, parameters, covariance: None };
    let sizes = found.sizes(samples);
    let stored = found.stored(machine, &sizes);
    let joints: Vec<usize> = (machine.commands().iter())
        .filter_map(|name| machine.joints().find(|(_, joint)| joint.name == *name).map(|(j, _)| j))
        .collect();
    let bands = joints.iter().map(|j| scene.facts.dead_bands[*j]).collect();
    let effective = CalibratedMachine::nominal(machine.clone())
        .with_effects(vec![stored], bands)
        .unwrap_or_else(|e| panic!("{}: {e}", candidate.effect));
    let mut readings = Vec::new();
    for recording in &scene.recordings {
        // What was read is the nominal machine's: the model's readings are less by the residual.
        let each = |left: &[f64]| readings.push(-left[0]);
        residuals(&effective, recording, each).unwrap_or_else(|e| panic!("{}: {e}", candidate.effect));
    }
    readings
}

/// What has no deviation: readings far off now and then, readings in steps, and else noise where the family spreads it.
fn scattered(candidate: &Candidate, scene: &Scene, samples: &[Samples]) -> Vec<f64> {
    let spread =
        candidate.scatter.as_ref().expect("it is spread").over(samples, &parameters(candidate, scene));
    let oval = |angle: f64| 8e-6 * (2.0 * angle).sin();
    let draw = |k: usize| {
        // A sequence without period that fills the interval evenly: the same on every machine.
        let golden = (k as f64 * 0.618_033_988_749_894_9).fract();
        (golden, (golden * 7919.0).fract() - 0.5)
    };
    (0..spread.len())
        .map(|k| {
            let (often, noise) = draw(k);
            let angle = scene.angle[k];
            match candidate.effect.as_str() {
                "outliers" => {
                    if often < 0.03 {
                        8e-5 * noise
                    } else {
                        2e-6 * noise
                    }
                }
                "quantisation" => (oval(angle) / 4e-6).round() * 4e-6,
                _ => 2e-5 * noise * spread[k].max(0.0) + 1e-6 * noise,
            }
        })
        .collect()
}

fn parameters(candidate: &Candidate, scene: &Scene) -> Vec<f64> {
    let rotary = candidate
        .place
        .dyad()
        .and_then(|j| scene.machine.dyads()[j].joint.as_ref())
        .is_some_and(|joint| joint.kind == kincal::machine::JointKind::Revolute);
    (candidate.parameters.iter())
        .map(|parameter| {
            let (from, to) = parameter.range;
            let mut told = VALUES.iter().filter(|(family, name, ..)| {
                *name == parameter.name && (family.is_empty() || *family == candidate.effect)
            });
            match told.next_back() {
                Some((_, _, linear, angular)) => (if rotary { *angular } else { *linear }).clamp(from, to),
                None if from > 0.0 => (from * to).sqrt(),
                None => 0.5 * (from + to),
            }
        })
        .collect()
}

pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

impl Trace<'_> {
    /// Samples of each pass: angle or position, reading, in their order.
    pub fn passes(&self) -> Vec<(bool, Vec<(f64, f64)>)> {
        let mut passes: Vec<(bool, Vec<(f64, f64)>)> = Vec::new();
        let mut last = None;
        for (k, (pass, positive)) in self.scene.pass.iter().enumerate() {
            if last != Some(*pass) {
                passes.push((*positive, Vec::new()));
                last = Some(*pass);
            }
            let own = passes.last_mut().expect("one was begun");
            own.1.push((self.scene.angle[k], self.readings[k]));
        }
        passes
    }

    pub fn is_polar(&self) -> bool {
        self.scene.drawing == Drawing::Polar
    }
}
