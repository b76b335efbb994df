//! Differential evolution in the unit cube.
//!
//! J. Zhang and A. C. Sanderson, *JADE: adaptive differential evolution with optional external
//! archive*, IEEE Trans. Evol. Comput. 13(5), 2009: "current-to-pbest", with factors that are drawn
//! instead of adapted. Limits are kept as by K. Deb, *An efficient constraint handling method for
//! genetic algorithms*, Comput. Methods Appl. Mech. Eng. 186, 2000: a candidate that keeps them is
//! better than one that does not; of two that do not, the one that breaks them less.

use rand_pcg::{Pcg64, rand_core::Rng};

/// Candidates with what was found of them, `V`, of which less is better.
#[derive(Clone, Debug)]
pub(crate) struct Population<V> {
    members: Vec<(Vec<f64>, V)>,
    random: Pcg64,
}

/// Keeps the search's random numbers apart from those of other parts with the same seed.
const STREAM: u128 = 0x6265_7374;
/// The share of the members that others are drawn towards.
const LEADING: f64 = 0.25;
/// The factor on differences.
const FACTOR: std::ops::Range<f64> = 0.4..0.9;
/// How likely a number is taken from the new place instead of the old one.
const CROSSOVER: f64 = 0.9;

impl<V: PartialOrd + Copy> Population<V> {
    /// A Latin hypercube: `count` places whose numbers are spread evenly in each dimension.
    pub(crate) fn places(seed: u64, count: usize, dimensions: usize) -> (Vec<Vec<f64>>, Pcg64) {
        let mut random = Pcg64::new(u128::from(seed), STREAM);
        let mut places = vec![Vec::with_capacity(dimensions); count];
        for _ in 0..dimensions {
            let mut order: Vec<usize> = (0..count).collect();
            for i in (1..count).rev() {
                order.swap(i, below(&mut random, i + 1));
            }
            for (place, slot) in places.iter_mut().zip(order) {
                place.push((slot as f64 + fraction(&mut random)) / count as f64);
            }
        }
        (places, random)
    }

    /// The population of these members.
    pub(crate) fn new(members: Vec<(Vec<f64>, V)>, random: Pcg64) -> Self {
        Self { members, random }
    }

    /// Sorts the members, the best first, and keeps so many.
    pub(crate) fn keep(&mut self, count: usize) {
        self.members
            .sort_by(|(_, a), (_, b)| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
        self.members.truncate(count);
    }

    /// The members; sorted after [`keep`](Self::keep).
    pub(crate) fn members(&self) -> &[(Vec<f64>, V)] {
        &self.members
    }

    /// Members with the same places and something else found of them.
    pub(crate) fn found_anew(&mut self, found: impl Iterator<Item = V>) {
        for (member, found) in self.members.iter_mut().zip(found) {
            member.1 = found;
        }
    }

    /// A new place for each member.
    pub(crate) fn offspring(&mut self) -> Vec<Vec<f64>> {
        let count = self.members.len();
        self.keep(count);
        let leading = ((LEADING * count as f64).ceil() as usize).clamp(2, count.max(2));
        let Self { members, random } = self;
        let one = |i: usize| {
            let [leader, a, b] = [leading, count, count].map(|bound| below(random, bound));
            let factor = FACTOR.start + (FACTOR.end - FACTOR.start) * fraction(random);
            let dimensions = members[i].0.len();
            let always = below(random, dimensions);
            let mut place = members[i].0.clone();
            for (d, x) in place.iter_mut().enumerate() {
                let at = |member: usize| members[member].0[d];
                if fraction(random) < CROSSOVER || d == always {
                    *x = (*x + factor * (at(leader) - *x + at(a) - at(b))).clamp(0.0, 1.0);
                }
            }
            place
        };
        (0..count).map(one).collect()
    }

    /// Each new place takes a member's if it is at least as good.
    pub(crate) fn select(&mut self, offspring: Vec<(Vec<f64>, V)>) {
        for (member, new) in self.members.iter_mut().zip(offspring) {
            if new.1 <= member.1 {
                *member = new;
            }
        }
    }
}

/// A random number in [0, 1).
fn fraction(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// A random whole number below `bound`.
fn below(random: &mut Pcg64, bound: usize) -> usize {
    (fraction(random) * bound as f64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley in the unit cube, least at (0.75, 0.75).
    fn valley(at: &[f64]) -> f64 {
        let (x, y) = (4.0 * at[0] - 2.0, 4.0 * at[1] - 2.0);
        100.0 * (y - x * x).powi(2) + (1.0 - x).powi(2)
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        let (places, random) = Population::<f64>::places(1, 60, 2);
        let members = places.into_iter().map(|at| (at.clone(), valley(&at))).collect();
        let mut population = Population::new(members, random);
        population.keep(20);
        for _ in 0..60 {
            let new = population.offspring();
            population.select(new.into_iter().map(|at| (at.clone(), valley(&at))).collect());
        }
        population.keep(1);
        let (at, least) = &population.members()[0];
        assert!(*least < 1e-3 && (at[0] - 0.75).abs() < 0.01, "{least} at {at:?}");
    }

    #[test]
    fn the_first_places_are_spread_evenly_in_each_dimension() {
        let (places, _) = Population::<f64>::places(7, 10, 3);
        for dimension in 0..3 {
            let mut slots: Vec<usize> =
                places.iter().map(|at| (10.0 * at[dimension]) as usize).collect();
            slots.sort_unstable();
            assert_eq!(slots, (0..10).collect::<Vec<_>>());
        }
    }
}
