//! One blind case: a machine, its tests, what is concealed in it, and what the instrument then reads.

use nalgebra::DVector;

use super::body::{Errors, Rigid};
use super::effect::{Effect, Place, Profile, all_places};
use super::odd;
use super::random::Random;
use super::setting;
use super::textbook::{self, Hints, Share};
use super::world::{Answers, Instrument, World};

/// Textbook shapes and white noise, or shapes that depart from it and noise that is not white.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Standard,
    Hard,
}

/// How much a case conceals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Clean,
    One,
    Two,
    Odd,
}

impl Mode {
    pub fn word(self) -> &'static str {
        match self {
            Mode::Clean => "clean",
            Mode::One => "one",
            Mode::Two => "two",
            Mode::Odd => "odd",
        }
    }
}

/// A concealed effect at its size.
pub struct Concealed {
    pub effect: Effect,
    /// Factor on the unit profile, m, rad or s.
    pub size: f64,
    pub snr: f64,
    /// What else explains more than 97 % of what geometry leaves of it.
    pub also: Vec<Share>,
    /// Other joints that an odd effect depends on.
    pub depends_on: Vec<usize>,
}

/// Noise of the instrument.
#[derive(Clone, Copy, Debug)]
pub struct Noise {
    /// Correlation between one sample and the next.
    pub rho: f64,
    pub outliers: f64,
    /// Step of the readings in units of the noise; 0: the instrument's own fine resolution.
    pub coarse: f64,
}

pub struct Case {
    pub number: usize,
    pub kind: Kind,
    pub mode: Mode,
    pub world: World,
    pub concealed: Vec<Concealed>,
    pub noise: Noise,
    /// Constant deviations of all frames.
    pub constant: Vec<[f64; 6]>,
    /// Family nearest to an odd effect.
    pub nearest: Option<Share>,
    /// For noise, so that it does not depend on how many draws the rest took.
    pub random: Random,
}

/// Shares of clean, one, two and odd cases.
pub const MIX: [f64; 4] = [0.15, 0.5, 0.2, 0.15];

/// Draws case `number` of a seed; what cannot be is drawn again.
pub fn draw(machines: &[kincal::Machine], kind: Kind, mode: Option<Mode>, seed: u64, number: usize) -> Case {
    let mut random = Random::new(seed, 2 * number as u64 + u64::from(kind == Kind::Hard));
    let modes = [Mode::Clean, Mode::One, Mode::Two, Mode::Odd];
    let mode = mode.unwrap_or(modes[random.weighted(&MIX)]);
    loop {
        if let Some(case) = attempt(machines, kind, mode, number, &mut random) {
            return case;
        }
    }
}

fn attempt(
    machines: &[kincal::Machine],
    kind: Kind,
    mode: Mode,
    number: usize,
    random: &mut Random,
) -> Option<Case> {
    let world = setting::draw(machines, random)?;
    let fine = Answers::of(&world, some_samples(&world, 5000, random));
    let mut concealed = Vec::new();
    let mut nearest = None;
    match mode {
        Mode::Clean => {}
        Mode::One => concealed = named(&fine, kind, 1, random)?,
        Mode::Two => concealed = named(&fine, kind, 2, random)?,
        Mode::Odd => {
            let (effect, depends_on, frequencies) = odd::draw(&world.body, &world.track, random)?;
            let (size, snr) = scale(&fine, &effect, None, kind, random)?;
            let coarse = Answers::of(&world, some_samples(&world, 1500, random));
            let y = coarse.beyond_geometry(&coarse.to(&effect.profile));
            let near = textbook::shares(&coarse, &y, &Hints { frequencies, ..Hints::default() })
                .into_iter()
                .next()?;
            if near.share > 0.3 {
                return None;
            }
            nearest = Some(near);
            concealed.push(Concealed { effect, size, snr, also: vec![], depends_on });
        }
    }
    let hard = kind == Kind::Hard;
    let noise = Noise {
        rho: if hard && random.chance(0.5) { random.between(0.3, 0.9) } else { 0.0 },
        outliers: if hard && random.chance(0.5) { 0.003 } else { 0.0 },
        coarse: if hard && random.chance(0.2) { random.between(0.5, 1.5) } else { 0.0 },
    };
    let constant = (0..world.body.links.len())
        .map(|_| {
            let mut e = [0.0; 6];
            for (c, e) in e.iter_mut().enumerate() {
                *e = random.normal() * if c < 3 { 15e-6 } else { 40e-6 };
            }
            e
        })
        .collect();
    drop(fine);
    let noise_stream = random.clone();
    Some(Case { number, kind, mode, world, concealed, noise, constant, nearest, random: noise_stream })
}

/// Samples of the recordings for least squares, at random so that no period is aliased; `rows` in all.
fn some_samples(world: &World, rows: usize, random: &mut Random) -> Vec<usize> {
    let wanted = rows / world.width();
    let all = world.track.recorded;
    if all <= wanted {
        return (0..all).collect();
    }
    let stride = all as f64 / wanted as f64;
    (0..wanted).map(|i| ((i as f64 + random.unit()) * stride) as usize).filter(|k| *k < all).collect()
}

/// Draws effects with names, sizes them, and finds what they cannot be told from.
fn named(fine: &Answers, kind: Kind, count: usize, random: &mut Random) -> Option<Vec<Concealed>> {
    let world = fine.world;
    let places = all_places(&world.body, &world.track);
    let mut names: Vec<&str> = places.iter().map(|p| p.0).collect();
    names.sort_unstable();
    names.dedup();
    let mut effects: Vec<Effect> = Vec::new();
    for _ in 0..count {
        // Names first, so that machines with many joints do not show joint effects only.
        let name = *random.pick(&names);
        let here: Vec<_> = places.iter().filter(|p| p.0 == name).collect();
        let (name, place) = **random.pick(&here);
        let wild = kind == Kind::Hard && random.chance(0.5);
        effects.push(Effect::draw(name, place, &world.body, &world.track, wild, random)?);
    }
    if count == 2 && (effects[0].name, effects[0].place) == (effects[1].name, effects[1].place) {
        return None;
    }
    let answers: Vec<DVector<f64>> = effects.iter().map(|e| fine.to(&e.profile)).collect();
    let mut all = Vec::new();
    let coarse = Answers::of(world, some_samples(world, 1500, random));
    for (i, effect) in effects.iter().enumerate() {
        let partner = (count == 2).then(|| &answers[1 - i]);
        let (size, snr) = scale(fine, effect, partner, kind, random)?;
        let y = coarse.beyond_geometry(&coarse.to(&effect.profile));
        let known = effect.coefficients.iter().filter(|c| !c.2).map(|c| (c.0, c.1)).collect();
        let mut also = textbook::shares(&coarse, &y, &Hints { known, ..Hints::default() });
        also.retain(|s| s.share > 0.97 && (s.name, s.place) != (effect.name, effect.place));
        // A curve holds the straight line too, but the name for a straight line is its own.
        also.retain(|s| (effect.name, s.name) != ("scale_error", "positioning_error"));
        all.push(Concealed { effect: effect.clone(), size, snr, also, depends_on: vec![] });
    }
    Some(all)
}

/// Size at which what geometry and the partner leave of an effect stands so many times above the noise.
fn scale(
    fine: &Answers,
    effect: &Effect,
    partner: Option<&DVector<f64>>,
    kind: Kind,
    random: &mut Random,
) -> Option<(f64, f64)> {
    let low = if kind == Kind::Hard { 0.4 } else { 1.0 };
    let snr = random.log_between(low, 6.0);
    let answer = fine.to(&effect.profile);
    let mut beyond = fine.beyond_geometry(&answer);
    if beyond.norm() < 1e-6 * answer.norm() {
        return None;
    }
    if let Some(partner) = partner {
        let other = fine.beyond_geometry(partner);
        let along = beyond.dot(&other) / other.norm_squared().max(1e-300);
        beyond -= other * along;
    }
    let rms = (beyond.norm_squared() / fine.rows() as f64).sqrt();
    let size = snr / rms;
    let peak = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |m: f64, v| m.max(v.abs())) * size;
    let small_enough = match &effect.profile {
        Profile::Joint(j, values) => {
            let turning = fine.world.body.links[*j].joint.as_ref().is_some_and(|a| a.revolute);
            let most = if turning { effect.most.1 } else { effect.most.0 };
            // Play and lost motion are stated as a whole width, twice the error.
            let whole = if matches!(effect.name, "backlash" | "hysteresis") { 2.0 } else { 1.0 };
            whole * peak(&mut values.iter().copied()) <= most
        }
        Profile::Before(_, twists) | Profile::After(_, twists) => {
            peak(&mut twists.iter().flat_map(|e| e[..3].iter().copied())) <= effect.most.0
                && peak(&mut twists.iter().flat_map(|e| e[3..].iter().copied())) <= effect.most.1
        }
        Profile::Reading(_, values) => {
            let most = if fine.world.reads_angle() { effect.most.1 } else { effect.most.0 };
            // A tracker over metres drifts more than a bar does.
            let most = most.max(8.0 * fine.world.sigma.0);
            peak(&mut values.iter().copied()) <= most
        }
        Profile::Late(_) => size <= effect.most.0,
    };
    (size.is_finite() && small_enough).then_some((size, snr))
}

impl Case {
    /// Errors of the whole machine at sample `k` of the track.
    fn errors(&self, k: usize, with_effects: bool) -> Errors {
        let mut errors = Errors::none(self.world.body.links.len());
        errors.before.clone_from(&self.constant);
        for c in self.concealed.iter().filter(|_| with_effects) {
            let add =
                |to: &mut [f64; 6], e: &[f64; 6]| to.iter_mut().zip(e).for_each(|(t, e)| *t += e * c.size);
            match &c.effect.profile {
                Profile::Joint(j, values) => errors.joint[*j] += values[k] * c.size,
                Profile::Before(j, twists) => add(&mut errors.before[*j], &twists[k]),
                Profile::After(j, twists) => add(&mut errors.after[*j], &twists[k]),
                Profile::Reading(..) | Profile::Late(_) => {}
            }
        }
        errors
    }

    /// What the instrument reads on run `run`, per sample; a pose as position and rotation. `with_effects`: what is concealed acts.
    pub fn readings(&self, run: usize, with_effects: bool, random: Option<&mut Random>) -> Vec<Reading> {
        let track = &self.world.track;
        let samples = track.starts[run]..track.starts[run + 1];
        let mut all: Vec<Reading> = samples
            .clone()
            .map(|k| {
                let (parts, tool) = self.world.measure(k, &self.errors(k, with_effects));
                Reading { parts, turned: tool.r }
            })
            .collect();
        if with_effects {
            self.change_readings(run, &mut all);
        }
        if let Some(random) = random {
            self.add_noise(&mut all, random);
        }
        all
    }

    /// Effects that sit on the measurement.
    fn change_readings(&self, run: usize, all: &mut [Reading]) {
        let first = self.world.track.starts[run];
        for c in &self.concealed {
            match &c.effect.profile {
                Profile::Reading(direction, values) => {
                    for (i, reading) in all.iter_mut().enumerate() {
                        let by = values[first + i] * c.size;
                        match reading.parts.as_mut_slice() {
                            [one] => *one += by,
                            parts => parts.iter_mut().zip(direction).for_each(|(p, d)| *p += d * by),
                        }
                    }
                }
                Profile::Late(_) => {
                    let r = &self.world.runs[run];
                    let exact = all.to_vec();
                    for i in 0..all.len() {
                        // One-sided at the ends of a leg, where the machine stands.
                        let a = if i == 0 || r.after_pause[i] { i } else { i - 1 };
                        let b = if i + 1 == all.len() || r.after_pause[i + 1] { i } else { i + 1 };
                        let dt = r.time[b] - r.time[a];
                        for (p, part) in all[i].parts.iter_mut().enumerate() {
                            let rate =
                                if dt > 0.0 { (exact[b].parts[p] - exact[a].parts[p]) / dt } else { 0.0 };
                            *part -= rate * c.size;
                        }
                        let turn = |r: &Reading| Rigid { r: r.turned, p: [0.0; 3] };
                        let step = turn(&exact[b]).then(&turn(&exact[a]).inverse()).vector();
                        let back = step.map(|x| if dt > 0.0 { -x / dt * c.size } else { 0.0 });
                        all[i].turned = Rigid::turn(back).then(&turn(&exact[i])).r;
                    }
                }
                _ => {}
            }
        }
    }

    fn add_noise(&self, all: &mut [Reading], random: &mut Random) {
        let (sigma_m, sigma_rad) = self.world.sigma;
        let sigma = if self.world.reads_angle() { sigma_rad } else { sigma_m };
        let resolution = match self.world.instrument {
            _ if self.noise.coarse > 0.0 => self.noise.coarse * sigma,
            Instrument::Position | Instrument::Pose if sigma > 5e-6 => 1e-6,
            _ => 1e-7,
        };
        let (rho, fresh) = (self.noise.rho, (1.0 - self.noise.rho * self.noise.rho).sqrt());
        let mut state: Vec<f64> = (0..6).map(|_| random.normal()).collect();
        for reading in all {
            for s in &mut state {
                *s = rho * *s + fresh * random.normal();
            }
            let strike = random.chance(self.noise.outliers);
            for (part, s) in reading.parts.iter_mut().zip(&state) {
                let far = if strike { random.sign() * random.between(5.0, 25.0) } else { 0.0 };
                *part += sigma * (s + far);
                *part = (*part / resolution).round() * resolution;
            }
            if self.world.instrument == Instrument::Pose {
                let tilt = Rigid::turn([state[3], state[4], state[5]].map(|s| s * sigma_rad));
                let turned = Rigid { r: reading.turned, p: [0.0; 3] };
                reading.turned = tilt.then(&turned).r;
            }
        }
    }

    /// Name of a place as answers and findings say it.
    pub fn at(&self, place: Place) -> String {
        let link = |j: usize| &self.world.body.links[j];
        match place {
            Place::Joint(j) => {
                link(j).joint.as_ref().map_or_else(|| link(j).frame.clone(), |a| a.name.clone())
            }
            Place::Frame(j) => link(j).frame.clone(),
            Place::Measurement => "measurement".into(),
        }
    }
}

/// One reading: its lengths (or angle), and the rotation of a pose.
#[derive(Clone, Debug)]
pub struct Reading {
    pub parts: Vec<f64>,
    pub turned: [[f64; 3]; 3],
}
