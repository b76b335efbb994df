//! A wall that the tip can touch.

use nalgebra::Vector2;

/// A plane with a yielding surface: F = stiffness · d (1 + dissipation · ḋ) along its normal, in N,
/// where the tip is d deep, m, and never a pull (K. H. Hunt and F. R. E. Crossley, *Coefficient of
/// restitution interpreted as damping in vibroimpact*, J. Appl. Mech. 42, 1975). The force begins at
/// zero, however fast the tip comes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// A point on its surface, m.
    pub point: Vector2<f64>,
    /// Of length one, out of the wall.
    pub normal: Vector2<f64>,
    /// N/m.
    pub stiffness: f64,
    /// s/m.
    pub dissipation: f64,
}

impl Wall {
    /// How deep a point is in the wall, m; negative in front of it.
    pub fn depth(&self, point: &Vector2<f64>) -> f64 {
        (self.point - point).dot(&self.normal)
    }

    /// The force on a tip at a point, m, that moves with a velocity, m/s; N.
    pub fn force(&self, tip: &Vector2<f64>, velocity: &Vector2<f64>) -> Vector2<f64> {
        let depth = self.depth(tip);
        if depth <= 0.0 {
            return Vector2::zeros();
        }
        let rate = -velocity.dot(&self.normal);
        self.normal * (self.stiffness * depth * (1.0 + self.dissipation * rate)).max(0.0)
    }
}
