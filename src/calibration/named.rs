//! The named effects of a calibrated machine, as they are used and as they stand in its file.

use super::pieces::{command, unit, unknown};
use super::{AxisForm, CalibratedMachine, CalibrationForm, checked};
use crate::effects::{StoredEffect, StoredTerm, by_setup};
use crate::feature::{Expression, Feature, Unbound};
use crate::machine::{Checked, Machine, MachineFault};
use crate::recording::Recording;
use crate::sensor::Sensor;
use crate::units::Unit;
use crate::variation::{Part, Term, Variation};

/// An effect that is not used, and why.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct LeftOut {
    /// Name of the effect.
    pub effect: String,
    /// Where it sits.
    pub at: String,
    /// Why, as the end of a sentence.
    pub because: String,
}

impl CalibratedMachine {
    /// The machine with named effects besides its deviations: physics that constant geometry leaves out, in the order given.
    /// `dead_bands`: motion against the direction of travel that is no reversal yet, one per command, m or rad.
    ///
    /// # Errors
    /// A frame, joint or number of an effect that cannot stand.
    ///
    /// # Panics
    /// If there is not one dead band per command.
    pub fn with_effects(mut self, effects: Vec<StoredEffect>, dead_bands: Vec<f64>) -> Result<Self, Unbound> {
        assert_eq!(dead_bands.len(), self.machine.commands().len(), "one dead band per command");
        for effect in effects {
            self.add_effect(effect)?;
        }
        self.variation.dead_bands = dead_bands;
        Ok(self)
    }

    /// The named effects.
    pub fn effects(&self) -> &[StoredEffect] {
        &self.effects
    }

    /// First and last time of the recordings that it was calibrated on, on their clock, s; known where effects are.
    pub fn clock(&self) -> Option<(f64, f64)> {
        self.clock
    }

    /// The machine whose last terms are those of these effects.
    pub(crate) fn with_names(mut self, effects: Vec<StoredEffect>) -> Self {
        self.effects = effects;
        self
    }

    /// The machine with the clock of its recordings, s.
    pub(crate) fn with_clock(mut self, clock: Option<(f64, f64)>) -> Self {
        self.clock = clock;
        self
    }

    fn add_effect(&mut self, effect: StoredEffect) -> Result<(), Unbound> {
        for (value, term) in terms(&self.machine, &effect)? {
            self.variation.varying.terms.push(term);
            self.variation.coefficients.push(value);
        }
        self.effects.push(effect);
        Ok(())
    }

    /// What its deviations depend on without the effects for which `because` gives a reason, and those with their reasons.
    /// `because` sees an effect and its features.
    pub(crate) fn variation_without(
        &self,
        mut because: impl FnMut(&StoredEffect, &[&Feature]) -> Option<String>,
    ) -> (Variation, Vec<LeftOut>) {
        let mut variation = self.variation.clone();
        let mut left_out = Vec::new();
        let mut kept = vec![true; variation.varying.terms.len()];
        // Terms that belong to no named effect stand before all others.
        let mut from = kept.len() - self.effects.iter().map(|e| e.terms.len()).sum::<usize>();
        for effect in &self.effects {
            let to = from + effect.terms.len();
            let terms = &self.variation.varying.terms[from..to];
            let features: Vec<&Feature> =
                terms.iter().flat_map(|t| t.parts.iter().map(|p| &p.feature)).collect();
            if let Some(because) = because(effect, &features) {
                kept[from..to].fill(false);
                let (effect, at) = (effect.effect.clone(), effect.at.clone());
                left_out.push(LeftOut { effect, at, because });
            }
            from = to;
        }
        let mut keep = kept.iter();
        variation.varying.terms.retain(|_| *keep.next().unwrap_or(&true));
        let mut keep = kept.iter();
        variation.coefficients.retain(|_| *keep.next().unwrap_or(&true));
        (variation, left_out)
    }

    /// What its deviations depend on in this recording, and the effects that cannot be used there: what they need is not in it.
    pub(crate) fn variation_in(&self, recordings: &[Recording]) -> (Variation, Vec<LeftOut>) {
        self.variation_without(|effect, features| recordings.iter().find_map(|r| not_in(r, effect, features)))
    }

    /// The machine with terms of their own, 0 as yet, for the set-ups of these recordings, of every effect that belongs to where the
    /// machine stands: [`Term::of_setup`] is set on these alone. Their prior is as wide as what other set-ups had.
    pub(crate) fn for_setups_of(&self, recordings: &[Recording]) -> Self {
        let mut own = self.clone();
        if self.effects.iter().all(|effect| !effect.of_setup) {
            return own;
        }
        let setups = by_setup(recordings);
        let terms =
            own.variation.varying.terms.len() - own.effects.iter().map(|e| e.terms.len()).sum::<usize>();
        own.variation.varying.terms.truncate(terms);
        own.variation.coefficients.truncate(terms);
        for effect in std::mem::take(&mut own.effects) {
            let (known, shapes) =
                if effect.of_setup { apart(&effect, recordings) } else { (effect.terms.clone(), Vec::new()) };
            let fixed = known.len();
            let mut effect = StoredEffect { terms: known, ..effect };
            let mut scales = Vec::new();
            for (shape, scale) in shapes {
                for (_, names) in &setups {
                    let mut term = shape.clone();
                    for part in &mut term.parts {
                        part.feature = Expression::Only(names.clone(), Box::new(part.feature.clone()));
                    }
                    effect.terms.push(term);
                    scales.push(scale);
                }
            }
            let from = own.variation.varying.terms.len() + fixed;
            // What stood in the file binds again.
            if own.add_effect(effect).is_err() {
                return self.clone();
            }
            for (term, scale) in own.variation.varying.terms[from..].iter_mut().zip(scales) {
                *term = Term { scale, prior: true, of_setup: true, ..term.clone() };
            }
        }
        own
    }

    /// The coefficients of the terms that [`CalibratedMachine::for_setups_of`] has added, in their order.
    pub(crate) fn put_terms_of_setups(&mut self, values: &[f64]) {
        let mut values = values.iter();
        let all = self.variation.varying.terms.len();
        let skipped = all - self.effects.iter().map(|e| e.terms.len()).sum::<usize>();
        let named = self.effects.iter_mut().flat_map(|effect| &mut effect.terms);
        let terms = self.variation.varying.terms.iter().zip(&mut self.variation.coefficients).skip(skipped);
        for ((_, coefficient), stored) in terms.zip(named).filter(|((term, _), _)| term.of_setup) {
            if let Some(value) = values.next() {
                (*coefficient, stored.value) = (*value, *value);
            }
        }
    }

    pub(super) fn dead_band_forms(&self) -> Vec<AxisForm> {
        if self.effects.is_empty() {
            return Vec::new();
        }
        let bands = self.variation.dead_bands.iter().enumerate();
        bands
            .map(|(c, band)| AxisForm {
                joint: self.machine.commands()[c].clone(),
                dead_band: unit(&self.machine, c).write_si(*band),
            })
            .collect()
    }

    /// Effects with their dead bands and their clock back from the file.
    pub(super) fn read_effects(&mut self, form: &CalibrationForm) -> Checked<()> {
        if let Some((from, to)) = form.clock {
            checked("calibration.clock[0]".into(), from)?;
            checked("calibration.clock[1]".into(), to)?;
        }
        self.clock = form.clock;
        if form.effects.is_empty() {
            return Ok(());
        }
        let mut bands = self.variation.dead_bands.clone();
        bands.resize(self.machine.commands().len(), 0.0);
        for (i, axis) in form.dead_bands.iter().enumerate() {
            let at = format!("calibration.dead_bands[{i}]");
            let c = command(&self.machine, &axis.joint)
                .ok_or_else(|| unknown(&self.machine, &at, &axis.joint))?;
            checked(format!("{at}.dead_band"), axis.dead_band)?;
            bands[c] = unit(&self.machine, c).to_si(axis.dead_band);
        }
        self.variation.dead_bands = bands;
        for (i, effect) in form.effects.iter().enumerate() {
            self.add_effect(effect.clone()).map_err(|unbound| {
                let what = format!("effect {} at {}: {unbound}", effect.effect, effect.at);
                (format!("calibration.effects[{i}]"), MachineFault::BadEffect { what })
            })?;
        }
        Ok(())
    }
}

/// The terms of an effect for set-ups that are none of these recordings', and one of each shape with the root mean square of its
/// coefficients over all set-ups.
fn apart(effect: &StoredEffect, recordings: &[Recording]) -> (Vec<StoredTerm>, Vec<(StoredTerm, f64)>) {
    let is_here = |e: &Expression| match e {
        Expression::Only(names, _) => recordings.iter().any(|r| names.iter().any(|name| name == r.name())),
        _ => false,
    };
    let bare = |term: &StoredTerm| {
        let mut bare = StoredTerm { value: 0.0, std_error: None, ..term.clone() };
        for part in &mut bare.parts {
            if let Expression::Only(_, e) = &part.feature {
                part.feature = (**e).clone();
            }
        }
        bare
    };
    let mut shapes: Vec<(StoredTerm, Vec<f64>)> = Vec::new();
    for term in &effect.terms {
        let own = bare(term);
        match shapes.iter_mut().find(|(shape, _)| *shape == own) {
            Some((_, values)) => values.push(term.value),
            None => shapes.push((own, vec![term.value])),
        }
    }
    let known =
        effect.terms.iter().filter(|t| !t.parts.iter().any(|p| is_here(&p.feature))).cloned().collect();
    let rms = |values: Vec<f64>| {
        let squares = values.iter().map(|v| v * v).sum::<f64>();
        (squares / values.len() as f64).sqrt().max(f64::MIN_POSITIVE)
    };
    (known, shapes.into_iter().map(|(shape, values)| (shape, rms(values))).collect())
}

/// Why an effect cannot be used in a recording.
fn not_in(recording: &Recording, effect: &StoredEffect, features: &[&Feature]) -> Option<String> {
    let kind = Sensor::of(recording.header()).name();
    if let Some(own) = effect.instrument.as_ref().filter(|own| *own != kind) {
        return Some(format!("it belongs to the instrument of the {own}, and {kind} was measured"));
    }
    if effect.of_setup && !features.iter().any(|f| f.is_of(recording.name())) {
        return Some(
            "it belongs to where the machine stood, and this is another set-up: --fit-setup finds it".into(),
        );
    }
    if !recording.has_time() && features.iter().any(|f| f.needs_time() || f.needs_rates()) {
        return Some("the recording has no time column `t`".into());
    }
    let here = |name: &str, symbol: &str| {
        let quantity = Unit::named(symbol).map(|u| u.quantity);
        recording.extra_channels().iter().any(|c| c.name == name && Some(c.unit.quantity) == quantity)
    };
    let mut channels = features.iter().flat_map(|f| f.channels());
    let (name, unit) = channels.find(|(name, symbol)| !here(name, symbol))?;
    Some(format!("the recording has no column {name}[{unit}]"))
}

/// The terms of an effect with their values.
pub(crate) fn terms(machine: &Machine, effect: &StoredEffect) -> Result<Vec<(f64, Term)>, Unbound> {
    let term = |(value, parts): (f64, Vec<Part>)| {
        (value, Term { parts, scale: value.abs().max(f64::MIN_POSITIVE), prior: false, of_setup: false })
    };
    Ok(effect.bind(machine)?.into_iter().map(term).collect())
}
