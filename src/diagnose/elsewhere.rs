//! All that is told as one effect of a joint, at another joint together, `docs/diagnosis-method.md` (80).

use super::search::Search;
use super::terms::ModelTerm;
use crate::effects::Place;

impl Search<'_> {
    /// These effects, or the same with several that are told as one effect of a joint at another joint, where they say more there.
    ///
    /// A joint that gives way about its axis and across it is two effects, and while one of them stays the other has no reason to go. It is
    /// tried where positions are settled: weight is what several effects of one name are told of.
    pub fn moved_together(&self, in_model: Vec<ModelTerm>) -> Vec<ModelTerm> {
        let groups: Vec<(&str, Place)> = in_model.iter().map(|effect| self.told(effect.candidate)).collect();
        let mut best = in_model;
        for (i, group) in groups.iter().enumerate() {
            let (is_known, is_several) = (groups[..i].contains(group), groups[i + 1..].contains(group));
            if self.in_motion || is_known || !is_several {
                continue;
            }
            let places = self.other_places(*group);
            let moved = places.into_iter().filter_map(|to| self.moved_to(to, &best, *group));
            let better = moved.filter(|moved| self.says_more(moved, &best));
            let worth = better.map(|moved| (self.worth(&moved), moved));
            best = worth.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(best, |(_, moved)| moved);
        }
        best
    }

    /// What it is told as, and where.
    fn told(&self, candidate: usize) -> (&str, Place) {
        (&self.candidates[candidate].told_as, self.candidates[candidate].place)
    }

    /// Other places where the same can be told.
    fn other_places(&self, (told_as, place): (&str, Place)) -> Vec<Place> {
        let mut places: Vec<Place> = Vec::new();
        for candidate in self.candidates.iter().filter(|c| c.told_as == told_as && c.place != place) {
            if !places.contains(&candidate.place) {
                places.push(candidate.place);
            }
        }
        places
    }

    /// A group of effects at another place; `None` where one of them cannot sit there, or does.
    fn moved_to(&self, to: Place, in_model: &[ModelTerm], group: (&str, Place)) -> Option<Vec<ModelTerm>> {
        let (here, mut moved): (Vec<ModelTerm>, Vec<ModelTerm>) =
            in_model.iter().cloned().partition(|effect| self.told(effect.candidate) == group);
        for effect in here {
            let name = &self.candidates[effect.candidate].effect;
            let there = self.candidates.iter().position(|c| c.effect == *name && c.place == to)?;
            if moved.iter().any(|other| other.candidate == there) {
                return None;
            }
            let ground = self.ground(&moved, None);
            let hypothesis = self.compare(ground.clone(), Some(&[there])).into_iter().next()?;
            // Each stays a hypothesis of the other.
            let mut near = effect.near.clone();
            near.extend([there, effect.candidate].into_iter().filter(|c| !effect.near.contains(c)));
            moved.push(ModelTerm { near, ..self.settle(&hypothesis, &ground)? });
        }
        Some(moved)
    }
}
