//! Effects that could not be looked for: what they need is not in the recordings.

use serde::{Deserialize, Serialize};

use crate::effects::{Candidates, NO_TIME};

/// Effects that were tried nowhere, for one reason.
#[non_exhaustive]
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NotTried {
    /// Why, as the end of a sentence.
    pub because: String,
    /// Names of the effects.
    pub effects: Vec<String>,
    /// Whether a column of times would let them be looked for.
    #[serde(skip)]
    pub for_want_of_time: bool,
}

/// Effects without a single place, by the reason that was given first.
pub(super) fn not_tried(candidates: &Candidates) -> Vec<NotTried> {
    let mut all: Vec<NotTried> = Vec::new();
    for skipped in &candidates.skipped {
        let effect = &skipped.effect;
        let for_want_of_time = skipped.is_for_want_of_time();
        let because = if for_want_of_time { NO_TIME } else { &skipped.reason };
        let tried = candidates.all.iter().any(|c| c.effect == *effect);
        if tried || all.iter().any(|known| known.effects.contains(effect)) {
            continue;
        }
        match all.iter_mut().find(|known| known.because == because) {
            Some(known) => known.effects.push(effect.clone()),
            None => {
                let (because, effects) = (because.to_string(), vec![effect.clone()]);
                all.push(NotTried { because, effects, for_want_of_time });
            }
        }
    }
    all.sort_by_key(|known| std::cmp::Reverse(known.effects.len()));
    all
}
