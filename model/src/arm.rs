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

use crate::{matrix, scalar::Scalar};

/// One link: a rigid bar that turns about the end of the one before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<T> {
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
    coupling: SMatrix<T, N, N>,
    /// First moment of everything that link i carries, kg m.
    moment: [T; N],
    gravity: Vector2<T>,
}

impl<T: Scalar, const N: usize> PlanarArm<T, N> {
    /// An arm from its links, base first, under a gravitational acceleration in m/s² (zero for a
    /// horizontal plane).
    ///
    /// With mass mᵢ, length lᵢ, centre cᵢ, inertia Iᵢ and outer mass Mᵢ = Σ_{k>i} mₖ:
    /// bᵢ = mᵢ cᵢ + lᵢ Mᵢ is the first moment, aᵢⱼ = l_{min(i,j)} b_{max(i,j)} off the diagonal and
    /// aᵢᵢ = Iᵢ + mᵢ cᵢ² + lᵢ² Mᵢ on it.
    pub fn new(links: &[Link<T>; N], gravity: Vector2<T>) -> Self {
        let mut coupling = SMatrix::zeros();
        let mut moment = [T::zero(); N];
        let mut outer_mass = T::zero();
        for i in (0..N).rev() {
            let Link { length, mass, center, inertia } = links[i];
            moment[i] = mass * center + length * outer_mass;
            coupling[(i, i)] = inertia + mass * center * center + length * length * outer_mass;
            outer_mass += mass;
            for j in 0..i {
                coupling[(i, j)] = links[j].length * moment[i];
                coupling[(j, i)] = coupling[(i, j)];
            }
        }
        Self { lengths: links.map(|link| link.length), coupling, moment, gravity }
    }

    /// The arm at joint angles `q` and joint velocities `q_dot`: everything that follows from the
    /// configuration is asked of the [`Pose`], which computes each sine and cosine once.
    #[inline(always)]
    pub fn pose(&self, q: &SVector<T, N>, q_dot: &SVector<T, N>) -> Pose<'_, T, N> {
        self.in_posture(Posture::new(q, q_dot))
    }

    /// The arm in a posture that is known already.
    #[inline(always)]
    pub fn in_posture(&self, posture: Posture<T, N>) -> Pose<'_, T, N> {
        let Posture { cos, sin, angle, rate } = posture;
        Pose { arm: self, cos, sin, angle, rate }
    }

    /// Joint accelerations q̈ = H⁻¹ (τ − C) under joint torques `torque`.
    #[inline(always)]
    pub fn acceleration(
        &self,
        q: &SVector<T, N>,
        q_dot: &SVector<T, N>,
        torque: &SVector<T, N>,
    ) -> SVector<T, N> {
        self.pose(q, q_dot).acceleration(torque)
    }
}

/// How the links of an arm stand and turn, whatever their lengths and masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture<T, const N: usize> {
    cos: [T; N],
    sin: [T; N],
    /// φ, rad.
    angle: [T; N],
    /// φ̇, rad/s.
    rate: [T; N],
}

impl<T: Scalar, const N: usize> Posture<T, N> {
    /// At joint angles `q` and joint velocities `q_dot`.
    #[inline(always)]
    pub fn new(q: &SVector<T, N>, q_dot: &SVector<T, N>) -> Self {
        let zero = [T::zero(); N];
        let mut posture = Self { cos: zero, sin: zero, angle: zero, rate: zero };
        let (mut angle, mut rate) = (T::zero(), T::zero());
        for i in 0..N {
            angle += q[i];
            rate += q_dot[i];
            (posture.sin[i], posture.cos[i]) = angle.sin_cos();
            posture.angle[i] = angle;
            posture.rate[i] = rate;
        }
        posture
    }

    /// Of this and another posture number by number what `choose` says.
    #[inline(always)]
    pub fn zip(&self, other: &Self, choose: impl Fn(T, T) -> T) -> Self {
        let mut chosen = *self;
        for i in 0..N {
            chosen.cos[i] = choose(self.cos[i], other.cos[i]);
            chosen.sin[i] = choose(self.sin[i], other.sin[i]);
            chosen.angle[i] = choose(self.angle[i], other.angle[i]);
            chosen.rate[i] = choose(self.rate[i], other.rate[i]);
        }
        chosen
    }
}

/// A [`PlanarArm`] in one configuration.
///
/// The task has `M` axes, the first `M` of tip position x, tip position y and orientation of the
/// last link (m, m, rad); `M` is 1, 2 or 3.
#[derive(Clone, Copy, Debug)]
pub struct Pose<'a, T, const N: usize> {
    arm: &'a PlanarArm<T, N>,
    cos: [T; N],
    sin: [T; N],
    angle: [T; N],
    rate: [T; N],
}

impl<T: Scalar, const N: usize> Pose<'_, T, N> {
    /// The output variables x(q).
    #[inline(always)]
    pub fn tip<const M: usize>(&self) -> SVector<T, M> {
        let mut out = [T::zero(); 3];
        for i in 0..N {
            out[0] += self.arm.lengths[i] * self.cos[i];
            out[1] += self.arm.lengths[i] * self.sin[i];
        }
        out[2] = self.angle[N - 1];
        first_axes(&out)
    }

    /// Where each link ends, base first; the last end is the tip. m.
    pub fn ends(&self) -> [Vector2<T>; N] {
        let mut end = Vector2::zeros();
        std::array::from_fn(|i| {
            end += Vector2::new(self.cos[i], self.sin[i]) * self.arm.lengths[i];
            end
        })
    }

    /// The output speeds J q̇, eq. (2).
    #[inline(always)]
    pub fn tip_velocity<const M: usize>(&self) -> SVector<T, M> {
        let mut out = [T::zero(); 3];
        for i in 0..N {
            let speed = self.arm.lengths[i] * self.rate[i];
            out[0] -= speed * self.sin[i];
            out[1] += speed * self.cos[i];
        }
        out[2] = self.rate[N - 1];
        first_axes(&out)
    }

    /// The Jacobian J = ∂x/∂q, M × N.
    #[inline(always)]
    pub fn jacobian<const M: usize>(&self) -> SMatrix<T, M, N> {
        const { assert!(M >= 1 && M <= 3) };
        let mut jacobian = SMatrix::zeros();
        let mut lever = [T::zero(), T::zero(), T::one()];
        for j in (0..N).rev() {
            lever[0] -= self.arm.lengths[j] * self.sin[j];
            lever[1] += self.arm.lengths[j] * self.cos[j];
            for i in 0..M {
                jacobian[(i, j)] = lever[i];
            }
        }
        jacobian
    }

    /// J̇ q̇: the tip's acceleration when no joint accelerates.
    #[inline(always)]
    pub fn jacobian_rate_velocity<const M: usize>(&self) -> SVector<T, M> {
        let mut out = [T::zero(); 3];
        for i in 0..N {
            let pull = self.arm.lengths[i] * self.rate[i] * self.rate[i];
            out[0] -= pull * self.cos[i];
            out[1] -= pull * self.sin[i];
        }
        first_axes(&out)
    }

    /// The inertia matrix H of eq. (1), kg m².
    #[inline(always)]
    pub fn inertia(&self) -> SMatrix<T, N, N> {
        let mut h = self.absolute_inertia();
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

    /// The velocity and gravity terms C of eq. (1), N m.
    #[inline(always)]
    pub fn velocity_terms(&self) -> SVector<T, N> {
        let mut c = self.absolute_velocity_terms();
        for i in (0..N - 1).rev() {
            let outer = c[i + 1];
            c[i] += outer;
        }
        c
    }

    /// q̈ = H⁻¹ (τ − C), solved in absolute angles where no sums over links are needed.
    #[inline(always)]
    pub fn acceleration(&self, torque: &SVector<T, N>) -> SVector<T, N> {
        let mut force = -self.absolute_velocity_terms();
        for i in 0..N {
            force[i] += torque[i];
            if i + 1 < N {
                force[i] -= torque[i + 1];
            }
        }
        let mut out = matrix::solve_positive_definite(&self.absolute_inertia(), &force);
        for i in (1..N).rev() {
            let inner = out[i - 1];
            out[i] -= inner;
        }
        out
    }

    #[inline(always)]
    fn absolute_inertia(&self) -> SMatrix<T, N, N> {
        let mut inertia = self.arm.coupling;
        for i in 0..N {
            for j in 0..N {
                if i != j {
                    inertia[(i, j)] *= self.cos_between(i, j);
                }
            }
        }
        inertia
    }

    #[inline(always)]
    fn absolute_velocity_terms(&self) -> SVector<T, N> {
        let gravity = self.arm.gravity;
        let mut terms = SVector::zeros();
        for i in 0..N {
            let weight = self.arm.moment[i] * (gravity.x * self.sin[i] - gravity.y * self.cos[i]);
            let mut sum = weight;
            for j in 0..N {
                if j != i {
                    sum += self.arm.coupling[(i, j)]
                        * self.sin_between(i, j)
                        * self.rate[j]
                        * self.rate[j];
                }
            }
            terms[i] = sum;
        }
        terms
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

#[inline(always)]
fn first_axes<T: Scalar, const M: usize>(all: &[T; 3]) -> SVector<T, M> {
    const { assert!(M >= 1 && M <= 3, "a planar task has one to three axes") };
    let mut axes = SVector::zeros();
    for i in 0..M {
        axes[i] = all[i];
    }
    axes
}
