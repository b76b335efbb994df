//! Joint friction: what resists a joint that turns.

use nalgebra::SVector;

use crate::{lift, scalar::Scalar};

/// τ = −((coulomb + stribeck exp(−(q̇/stribeck_speed)²)) tanh(q̇/smoothing) + viscous q̇), in N m, for
/// each joint. No controller's model has it.
///
/// The hyperbolic tangent stands in for the sign of q̇, so that a joint comes to rest without a jump
/// of its acceleration: slower than `smoothing`, it creeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction<T, const N: usize> {
    /// N m s/rad.
    pub viscous: [T; N],
    /// What does not grow with the speed, if there is any.
    pub dry: Option<DryFriction<T, N>>,
}

/// Coulomb's friction, and what a joint at rest has besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DryFriction<T, const N: usize> {
    /// N m.
    pub coulomb: [T; N],
    /// rad/s, more than zero.
    pub smoothing: T,
    /// The additional friction at rest, if there is any.
    pub stribeck: Option<Stribeck<T, N>>,
}

/// What a joint that hardly turns resists with besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stribeck<T, const N: usize> {
    /// N m.
    pub torque: [T; N],
    /// How fast a joint turns when a third of it is left, rad/s, more than zero.
    pub speed: T,
}

impl<T: Scalar, const N: usize> Friction<T, N> {
    /// τ at joint velocities q̇, rad/s.
    #[inline(always)]
    pub fn torque(&self, rates: &SVector<T, N>) -> SVector<T, N> {
        let mut torque = SVector::from_fn(|i, _| -(self.viscous[i] * rates[i]));
        if let Some(dry) = &self.dry {
            let size = dry.size(rates);
            let two = T::constant(2.0) / dry.smoothing;
            let powers = T::exp_each(&rates.map(|rate| -(rate.abs() * two)));
            for i in 0..N {
                let part = size[i] * ((T::one() - powers[i]) / (T::one() + powers[i]));
                torque[i] -= rates[i].where_below(T::zero(), -part, part);
            }
        }
        torque
    }
}

impl<T: Scalar, const N: usize> DryFriction<T, N> {
    /// How much resists, whatever the direction, N m.
    #[inline(always)]
    fn size(&self, rates: &SVector<T, N>) -> SVector<T, N> {
        let mut size = SVector::from(self.coulomb);
        if let Some(Stribeck { torque, speed }) = &self.stribeck {
            let relative = rates.map(|rate| rate / *speed);
            let powers = T::exp_each(&relative.map(|rate| -(rate * rate)));
            for i in 0..N {
                size[i] += torque[i] * powers[i];
            }
        }
        size
    }
}

impl<const N: usize> Friction<f64, N> {
    /// The steepest that friction can rise with the speed of each joint, N m s/rad.
    pub fn steepest(&self) -> SVector<f64, N> {
        SVector::from_fn(|i, _| {
            let dry = self.dry.map_or(0.0, |dry| {
                let stribeck = dry.stribeck.map_or(0.0, |stribeck| stribeck.torque[i]);
                (dry.coulomb[i] + stribeck) / dry.smoothing
            });
            self.viscous[i] + dry
        })
    }
}

lift! { struct Friction<T; N> { viscous, dry } }
lift! { struct DryFriction<T; N> { coulomb, smoothing, stribeck } }
lift! { struct Stribeck<T; N> { torque, speed } }
