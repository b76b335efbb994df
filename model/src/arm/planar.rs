//! A planar serial arm.
//!
//! The equations are written in the links' absolute angles φᵢ = q₁ + … + qᵢ, where they are short:
//!
//! ```text
//! Σⱼ aᵢⱼ cos(φᵢ − φⱼ) φ̈ⱼ + Σⱼ aᵢⱼ sin(φᵢ − φⱼ) φ̇ⱼ² + ∂V/∂φᵢ = Fᵢ
//! ```
//!
//! with constants aᵢⱼ that hold all masses and lengths (see [`PlanarArm::new`]). With φ = T q and T
//! the lower triangle of ones, the paper's eq. (1) in joint coordinates follows as H = Tᵀ M T and
//! C = Tᵀ c, which are sums over the links further out.

use nalgebra::{SMatrix, SVector, Vector2};

use super::{Arm, Kinematics, PARAMETERS};
use crate::{lift, matrix, scalar::Scalar};

/// One link: a rigid bar that turns about the end of the one before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidLink<T> {
    /// From this joint to the next, m.
    pub length: T,
    /// Mass, kg.
    pub mass: T,
    /// From this joint to the centre of mass, m, along the link.
    pub center: T,
    /// Moment of inertia about the centre of mass, kg m².
    pub inertia: T,
}

/// A serial arm of `N` links in the plane, its base at the origin.
///
/// Joint angles q are relative to the link before (rad), counter-clockwise; torques are in N m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarArm<T, const N: usize> {
    lengths: [T; N],
    /// aᵢⱼ, kg m².
    coupling: [[T; N]; N],
    /// First moment of everything that link i carries, kg m.
    moment: [T; N],
    gravity: Vector2<T>,
    /// Reflected inertia of the rotors, kg m², if they have any; the diagonal of `coupling` has it, too.
    armature: Option<[T; N]>,
}

impl<T: Scalar, const N: usize> PlanarArm<T, N> {
    /// An arm from its links, base first, under a gravitational acceleration in m/s² (zero for a
    /// horizontal plane).
    ///
    /// With mass mᵢ, length lᵢ, centre cᵢ, inertia Iᵢ and outer mass Mᵢ = Σ_{k>i} mₖ:
    /// bᵢ = mᵢ cᵢ + lᵢ Mᵢ is the first moment, aᵢⱼ = l_{min(i,j)} b_{max(i,j)} off the diagonal and
    /// aᵢᵢ = Iᵢ + mᵢ cᵢ² + lᵢ² Mᵢ on it.
    pub fn new(links: &[RigidLink<T>; N], gravity: Vector2<T>) -> Self {
        let mut coupling = [[T::zero(); N]; N];
        let mut moment = [T::zero(); N];
        let mut outer_mass = T::zero();
        for i in (0..N).rev() {
            let RigidLink { length, mass, center, inertia } = links[i];
            moment[i] = mass * center + length * outer_mass;
            coupling[i][i] = inertia + mass * center * center + length * length * outer_mass;
            outer_mass += mass;
            for j in 0..i {
                coupling[i][j] = links[j].length * moment[i];
                coupling[j][i] = coupling[i][j];
            }
        }
        let lengths = links.map(|link| link.length);
        Self { lengths, coupling, moment, gravity, armature: None }
    }

    /// The same arm with rotors of these inertias, kg m², as its gears reflect them to its joints:
    /// they turn with the joints, and add to the diagonal of H. Seen from absolute angles, a rotor turns
    /// by the difference of two of them.
    pub fn with_rotors(self, armature: [T; N]) -> Self {
        let mut arm = Self { armature: Some(armature), ..self };
        for i in 0..N {
            arm.coupling[i][i] += arm.rotors_on(i);
        }
        arm
    }
}

/// How the links of an arm stand and turn, whatever their lengths and masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration<T, const N: usize> {
    cos: [T; N],
    sin: [T; N],
    /// φ, rad.
    angle: [T; N],
    /// φ̇, rad/s.
    rate: [T; N],
}

impl<T: Scalar, const N: usize> Configuration<T, N> {
    /// At joint angles `q` and joint velocities `q_dot`.
    #[inline(always)]
    pub fn new(q: &SVector<T, N>, q_dot: &SVector<T, N>) -> Self {
        let zero = [T::zero(); N];
        let mut configuration = Self { cos: zero, sin: zero, angle: zero, rate: zero };
        let (mut angle, mut rate) = (T::zero(), T::zero());
        for i in 0..N {
            angle += q[i];
            rate += q_dot[i];
            (configuration.sin[i], configuration.cos[i]) = angle.sin_cos();
            configuration.angle[i] = angle;
            configuration.rate[i] = rate;
        }
        configuration
    }

    #[inline(always)]
    fn cos_between(&self, i: usize, j: usize) -> T {
        self.cos[i] * self.cos[j] + self.sin[i] * self.sin[j]
    }

    #[inline(always)]
    fn sin_between(&self, i: usize, j: usize) -> T {
        self.sin[i] * self.cos[j] - self.cos[i] * self.sin[j]
    }
}

impl<T: Scalar, const N: usize> Arm<T, N> for PlanarArm<T, N> {
    type Configuration = Configuration<T, N>;

    #[inline(always)]
    fn configuration(q: &SVector<T, N>, q_dot: &SVector<T, N>) -> Configuration<T, N> {
        Configuration::new(q, q_dot)
    }

    #[inline(always)]
    fn turning(
        at: &Configuration<T, N>,
        _: &SVector<T, N>,
        q_dot: &SVector<T, N>,
    ) -> Configuration<T, N> {
        Configuration { rate: absolute(q_dot), ..*at }
    }

    #[inline(always)]
    fn combine(
        one: &Configuration<T, N>,
        other: &Configuration<T, N>,
        choose: impl Fn(T, T) -> T,
    ) -> Configuration<T, N> {
        let mut combined = *one;
        for i in 0..N {
            combined.cos[i] = choose(one.cos[i], other.cos[i]);
            combined.sin[i] = choose(one.sin[i], other.sin[i]);
            combined.angle[i] = choose(one.angle[i], other.angle[i]);
            combined.rate[i] = choose(one.rate[i], other.rate[i]);
        }
        combined
    }

    #[inline(always)]
    fn inertia(&self, at: &Configuration<T, N>) -> SMatrix<T, N, N> {
        let mut h = self.absolute_inertia(at);
        for i in (0..N - 1).rev() {
            for j in 0..N {
                let outer = h[(i + 1, j)];
                h[(i, j)] += outer;
            }
        }
        for j in (0..N - 1).rev() {
            for i in 0..N {
                let outer = h[(i, j + 1)];
                h[(i, j)] += outer;
            }
        }
        h
    }

    #[inline(always)]
    fn velocity_terms(&self, at: &Configuration<T, N>) -> SVector<T, N> {
        let mut c = self.absolute_velocity_terms(at);
        for i in (0..N - 1).rev() {
            let outer = c[i + 1];
            c[i] += outer;
        }
        c
    }

    /// Solved in absolute angles, where no sums over links are needed.
    #[inline(always)]
    fn acceleration(&self, at: &Configuration<T, N>, torque: &SVector<T, N>) -> SVector<T, N> {
        let mut force = -self.absolute_velocity_terms(at);
        for i in 0..N {
            force[i] += torque[i];
            if i + 1 < N {
                force[i] -= torque[i + 1];
            }
        }
        let mut out = matrix::solve_positive_definite(&self.absolute_inertia(at), &force);
        for i in (1..N).rev() {
            let inner = out[i - 1];
            out[i] -= inner;
        }
        out
    }

    /// Dᵢ = Σ_{k ≥ i} aₖₖ, kg m², and behind them bᵢ, kg m: 2 N parameters. Those of a horizontal
    /// arm of two links are the textbook's: D₁ = a₁, D₂ = a₂ and l₁ b₂ = a₃ in H₁₁ = a₁ + 2 a₃ cos q₂,
    /// H₁₂ = a₂ + a₃ cos q₂, H₂₂ = a₂. The rotors are known, and are not among them.
    #[inline(always)]
    fn parameters(&self) -> [T; PARAMETERS] {
        let mut parameters = [T::zero(); _];
        let mut outer = T::zero();
        for i in (0..N).rev() {
            outer += self.coupling[i][i] - self.rotors_on(i);
            parameters[i] = outer;
            parameters[N + i] = self.moment[i];
        }
        parameters
    }

    #[inline(always)]
    fn regressor_times(
        &self,
        at: &Configuration<T, N>,
        velocity: &SVector<T, N>,
        joint_acceleration: &SVector<T, N>,
        parameters: &[T; PARAMETERS],
    ) -> SVector<T, N> {
        let (rate, acceleration) = (absolute(velocity), absolute(joint_acceleration));
        let mut force = SVector::<T, N>::zeros();
        for i in 0..N {
            let moment = parameters[N + i];
            let outer = if i + 1 < N { parameters[i + 1] } else { T::zero() };
            force[i] += (parameters[i] - outer) * acceleration[i] + moment * self.weight(at, i);
            for j in 0..i {
                let (on_i, on_j) = self.pair(at, (i, j), &rate, &acceleration);
                force[i] += moment * on_i;
                force[j] += moment * on_j;
            }
        }
        for i in (1..N).rev() {
            let outer = force[i];
            force[i - 1] += outer;
        }
        if let Some(armature) = &self.armature {
            for i in 0..N {
                force[i] += armature[i] * joint_acceleration[i];
            }
        }
        force
    }

    #[inline(always)]
    fn regressor_transpose_times(
        &self,
        at: &Configuration<T, N>,
        velocity: &SVector<T, N>,
        acceleration: &SVector<T, N>,
        s: &SVector<T, N>,
    ) -> [T; PARAMETERS] {
        let (rate, acceleration, s) = (absolute(velocity), absolute(acceleration), absolute(s));
        let mut slope = [T::zero(); PARAMETERS];
        for i in 0..N {
            slope[i] = acceleration[i] * s[i];
            if i > 0 {
                slope[i] -= acceleration[i - 1] * s[i - 1];
            }
            slope[N + i] = self.weight(at, i) * s[i];
            for j in 0..i {
                let (on_i, on_j) = self.pair(at, (i, j), &rate, &acceleration);
                slope[N + i] += on_i * s[i] + on_j * s[j];
            }
        }
        slope
    }
}

impl<T: Scalar, const N: usize> PlanarArm<T, N> {
    /// What the coupling aᵢⱼ = lⱼ bᵢ of links i and j < i adds to the forces in the absolute angles of
    /// i and of j, for bᵢ = 1.
    #[inline(always)]
    fn pair(
        &self,
        at: &Configuration<T, N>,
        (i, j): (usize, usize),
        rate: &[T; N],
        acceleration: &[T; N],
    ) -> (T, T) {
        let (length, cos, sin) = (self.lengths[j], at.cos_between(i, j), at.sin_between(i, j));
        (
            length * (cos * acceleration[j] + sin * at.rate[j] * rate[j]),
            length * (cos * acceleration[i] - sin * at.rate[i] * rate[i]),
        )
    }

    /// What the rotors add to the diagonal of `coupling` at link i.
    #[inline(always)]
    fn rotors_on(&self, i: usize) -> T {
        match &self.armature {
            None => T::zero(),
            Some(armature) if i + 1 < N => armature[i] + armature[i + 1],
            Some(armature) => armature[i],
        }
    }

    /// The weight of a first moment of one in the absolute angle of link i.
    #[inline(always)]
    fn weight(&self, at: &Configuration<T, N>, i: usize) -> T {
        self.gravity.x * at.sin[i] - self.gravity.y * at.cos[i]
    }
}

/// x₁, x₁ + x₂, …: joint rates as those of the absolute angles.
#[inline(always)]
fn absolute<T: Scalar, const N: usize>(joints: &SVector<T, N>) -> [T; N] {
    let mut sum = T::zero();
    std::array::from_fn(|i| {
        sum += joints[i];
        sum
    })
}

/// The task has `M` axes, the first `M` of tip position x, tip position y and orientation of the
/// last link (m, m, rad); `M` is 1, 2 or 3.
impl<T: Scalar, const N: usize, const M: usize> Kinematics<T, N, M> for PlanarArm<T, N> {
    type Point = SVector<T, M>;

    #[inline(always)]
    fn tip(&self, at: &Configuration<T, N>) -> SVector<T, M> {
        let mut out = [T::zero(); 3];
        for i in 0..N {
            out[0] += self.lengths[i] * at.cos[i];
            out[1] += self.lengths[i] * at.sin[i];
        }
        out[2] = at.angle[N - 1];
        first_axes(&out)
    }

    #[inline(always)]
    fn tip_velocity(&self, at: &Configuration<T, N>) -> SVector<T, M> {
        let mut out = [T::zero(); 3];
        for i in 0..N {
            let speed = self.lengths[i] * at.rate[i];
            out[0] -= speed * at.sin[i];
            out[1] += speed * at.cos[i];
        }
        out[2] = at.rate[N - 1];
        first_axes(&out)
    }

    #[inline(always)]
    fn jacobian(&self, at: &Configuration<T, N>) -> SMatrix<T, M, N> {
        const { assert!(M >= 1 && M <= 3) };
        let mut jacobian = SMatrix::zeros();
        let mut lever = [T::zero(), T::zero(), T::one()];
        for j in (0..N).rev() {
            lever[0] -= self.lengths[j] * at.sin[j];
            lever[1] += self.lengths[j] * at.cos[j];
            for i in 0..M {
                jacobian[(i, j)] = lever[i];
            }
        }
        jacobian
    }

    #[inline(always)]
    fn jacobian_rate_velocity(&self, at: &Configuration<T, N>) -> SVector<T, M> {
        let mut out = [T::zero(); 3];
        for i in 0..N {
            let acceleration = self.lengths[i] * at.rate[i] * at.rate[i];
            out[0] -= acceleration * at.cos[i];
            out[1] -= acceleration * at.sin[i];
        }
        first_axes(&out)
    }
}

impl<T: Scalar, const N: usize> PlanarArm<T, N> {
    /// Where each link ends, base first; the last end is the tip. m.
    pub fn ends(&self, at: &Configuration<T, N>) -> [Vector2<T>; N] {
        let mut end = Vector2::zeros();
        std::array::from_fn(|i| {
            end += Vector2::new(at.cos[i], at.sin[i]) * self.lengths[i];
            end
        })
    }

    #[inline(always)]
    fn absolute_inertia(&self, at: &Configuration<T, N>) -> SMatrix<T, N, N> {
        let mut inertia = SMatrix::from_fn(|i, j| {
            let coupling = self.coupling[i][j];
            if i == j { coupling } else { coupling * at.cos_between(i, j) }
        });
        if let Some(armature) = &self.armature {
            for i in 1..N {
                inertia[(i - 1, i)] -= armature[i];
                inertia[(i, i - 1)] -= armature[i];
            }
        }
        inertia
    }

    #[inline(always)]
    fn absolute_velocity_terms(&self, at: &Configuration<T, N>) -> SVector<T, N> {
        let mut terms = SVector::zeros();
        for i in 0..N {
            let mut sum = self.moment[i] * self.weight(at, i);
            for j in 0..N {
                if j != i {
                    sum += self.coupling[i][j] * at.sin_between(i, j) * at.rate[j] * at.rate[j];
                }
            }
            terms[i] = sum;
        }
        terms
    }
}

lift! { struct PlanarArm<T; N> { lengths, coupling, moment, gravity, armature } }

#[inline(always)]
fn first_axes<T: Scalar, const M: usize>(all: &[T; 3]) -> SVector<T, M> {
    const { assert!(M >= 1 && M <= 3, "a planar task has one to three axes") };
    let mut axes = SVector::zeros();
    for i in 0..M {
        axes[i] = all[i];
    }
    axes
}
