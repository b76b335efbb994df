//! The control laws, one file each, and their registry.
//!
//! A law turns a [`Situation`], what is known at a sampling instant, into a [`Command`], joint
//! torques and an echo, and into [`Signals`] to show. What it needs of the command before travels as
//! the echo: the plant holds it with the torque, scales it with the torque, and returns it. So memory
//! and prediction work for every law. Integrals and estimates are its [`State`].
//!
//! To add a law that scenarios can name, write a file like `tj.rs` and add one line to `register!`
//! below. Settings and their validation, the name on the wire and in print, recordings, displays
//! and the lanes of a sweep follow from what that file declares.
//!
//! # A law of one's own
//!
//! A program need not register its law: `mtj_controller::Controller::with_law` takes anything that
//! is an [`Equation`]. This one pulls with a force that never exceeds a bound F, N, whatever the
//! error: Q̂ᵢ = F tanh(K_p eᵢ / F) + K_d ėᵢ, eq. (7) with a spring that saturates.
//!
//! ```
//! use mtj_model::{
//!     MAX_SIGNALS, MAX_STATE,
//!     arm::{Arm, Kinematics, point_mass::PointMass},
//!     law::{Command, Equation, Signals, Situation, State},
//!     task::TrackingError,
//!     trajectory::Motion,
//! };
//! use nalgebra::{SVector, Vector2};
//!
//! #[derive(Clone, Copy)]
//! struct Saturated {
//!     /// K_p, N/m.
//!     kp: f64,
//!     /// K_d, N s/m.
//!     kd: f64,
//!     /// F, N.
//!     bound: f64,
//! }
//!
//! impl<const M: usize> Equation<f64, M> for Saturated {
//!     fn command<A: Kinematics<f64, N, M>, const N: usize>(
//!         &self,
//!         now: &Situation<'_, f64, A, N, M>,
//!         _: &mut State<f64>,
//!         _: &mut Signals<f64>,
//!     ) -> Command<f64, N> {
//!         let spring = now.error.position.map(|e| self.bound * (self.kp * e / self.bound).tanh());
//!         Command::of_task_force(&now.jacobian(), &(spring + now.error.velocity * self.kd))
//!     }
//! }
//!
//! // A point mass is its own tip: J = 1, so the torque is the task force.
//! let (arm, zero) = (PointMass { mass: 3.0 }, Vector2::zeros());
//! let at = PointMass::configuration(&zero, &zero);
//! let desired = Motion { point: Vector2::new(1e-3, 50.0), velocity: zero, acceleration: zero };
//! let error: TrackingError<f64, 2> = TrackingError { position: desired.point, velocity: zero };
//! let now = Situation {
//!     arm: &arm,
//!     position: &zero,
//!     velocity: &zero,
//!     at: &at,
//!     desired: &desired,
//!     error: &error,
//!     acceleration: &zero,
//!     interval: 0.01,
//!     memory: None,
//! };
//! let law = Saturated { kp: 30.0, kd: 60.0, bound: 20.0 };
//! let torque: SVector<f64, 2> = law.command(&now, &mut [0.0; MAX_STATE], &mut [0.0; MAX_SIGNALS]).torque;
//! assert!((torque.x - 0.03).abs() < 1e-6, "a spring for small errors");
//! assert!((torque.y - 20.0).abs() < 1e-6, "never more than the bound");
//! ```

pub mod adaptive;
pub mod describe;
pub mod dob;
pub mod factor;
pub mod impedance;
pub mod inverse;
pub mod mass;
pub mod mb;
pub mod mtj;
pub mod pid;
pub mod rate;
pub mod scct;
pub mod tdc;
pub mod tj;

use nalgebra::{SMatrix, SVector};

pub use describe::{Description, Parameter, Per, Signal};

use crate::{
    MAX_AXES, MAX_ECHO, MAX_SIGNALS, MAX_STATE,
    arm::Kinematics,
    lift,
    matrix::{self, padded},
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, section::Section},
    task::{self, TrackingError},
    trajectory::Motion,
};

/// Numbers that a law sends with its torque and gets back; those past the law's own are zero.
pub type Echo<T> = [T; MAX_ECHO];
/// What a law keeps from sample to sample: integrals, estimates; zeros before the first and after an
/// outage. Numbers past the law's own stay zero.
pub type State<T> = [T; MAX_STATE];
/// A law's signals for displays, one after the other as its description lists them.
pub type Signals<T> = [T; MAX_SIGNALS];

/// What is known at a sampling instant of an arm `A` with `N` joints and a task with `M` axes.
#[derive(Debug)]
pub struct Situation<'a, T: Scalar, A: Kinematics<T, N, M>, const N: usize, const M: usize> {
    /// The arm, as far as the controller's model knows it.
    pub arm: &'a A,
    /// Joint positions q, rad, as measured.
    pub position: &'a SVector<T, N>,
    /// Joint velocities q̇, rad/s, as measured.
    pub velocity: &'a SVector<T, N>,
    /// The configuration there.
    pub at: &'a A::Configuration,
    /// The desired motion at the instant that the law aims at.
    pub desired: &'a Motion<T, A::Point, M>,
    /// e and ė there.
    pub error: &'a TrackingError<T, M>,
    /// a, the mean acceleration of the tip over the last sample, m/s²; zero at the first.
    pub acceleration: &'a SVector<T, M>,
    /// Since the sample before, s; zero at the first.
    pub interval: T,
    /// The echo that the memory holds; `None` at the first sample.
    pub memory: Option<&'a Echo<T>>,
}

impl<T: Scalar, A: Kinematics<T, N, M>, const N: usize, const M: usize> Situation<'_, T, A, N, M> {
    /// J. A law calls this when it has its task force: a matrix that is computed earlier has to be
    /// kept until then, which costs instructions.
    #[inline(always)]
    pub fn jacobian(&self) -> SMatrix<T, M, N> {
        self.arm.jacobian(self.at)
    }
}

/// A law's answer: joint torques and echo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command<T, const N: usize> {
    /// τ, N m.
    pub torque: SVector<T, N>,
    /// Numbers that the plant holds with the torque and returns.
    pub echo: Echo<T>,
    /// How strongly the inverse of the matrix that the law inverts, J or J H⁻¹ Jᵀ, is damped: 0 where
    /// it is not, to 1 where the matrix is singular.
    pub damping: T,
}

impl<T: Scalar, const N: usize> Command<T, N> {
    /// τ = Jᵀ Q̂ for a task force Q̂, N, which is the echo, too.
    #[inline(always)]
    pub fn of_task_force<const M: usize>(
        jacobian: &SMatrix<T, M, N>,
        force: &SVector<T, M>,
    ) -> Self {
        Self {
            torque: matrix::transpose_times(jacobian, force),
            echo: padded(force.as_slice()),
            damping: T::zero(),
        }
    }

    /// Joint torques τ, N m, which are the echo, too, found with an inverse that is damped so strongly.
    #[inline(always)]
    pub fn of_torques(torque: SVector<T, N>, damping: T) -> Self {
        Self { torque, echo: padded(torque.as_slice()), damping }
    }
}

/// The task force in an echo that [`Command::of_task_force`] made.
#[inline(always)]
fn recalled<T: Scalar, const M: usize>(echo: &Echo<T>) -> SVector<T, M> {
    padded(echo).into()
}

/// The equation of a law for a task with `M` axes.
pub trait Equation<T: Scalar, const M: usize>: Copy {
    /// Computes joint torques and echo from a situation.
    ///
    /// Brings `state` from the sample before to this one. Writes the law's signals into `signals`, the
    /// same entries at every call; entries past its last signal stay as they are. Runs between state and
    /// torque: no allocation, no lock, no I/O.
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        state: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N>;

    /// Whether the law's torques balance gravity by themselves.
    fn balances_gravity(&self) -> bool {
        false
    }

    /// How the law regulates its memory, if it does.
    fn factor(&self) -> Option<&factor::Factor<T, M>> {
        None
    }
}

/// Why a law cannot control an arm in a task; the sentence says what the key should be instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unsuited {
    /// The law inverts J, which has to be square for that.
    #[error(
        "tj or mtj, because {law} inverts the Jacobian and this arm's is not square ({joints} joints \
         for {axes} task axes)"
    )]
    NotSquare {
        /// The law.
        law: &'static str,
        /// Joints of the arm.
        joints: usize,
        /// Axes of the task.
        axes: usize,
    },
    /// The law needs joint velocities for every velocity of the tip.
    #[error(
        "tj or mtj, because {law} needs a joint for each task axis and this arm has {joints} for {axes}"
    )]
    TooFewJoints {
        /// The law.
        law: &'static str,
        /// Joints of the arm.
        joints: usize,
        /// Axes of the task.
        axes: usize,
    },
    /// The law inverts J H⁻¹ Jᵀ, for which J needs full rank.
    #[error(
        "a number, a list or a matrix, because the task inertia needs a Jacobian of full rank and \
         this arm has {joints} joints for {axes} task axes"
    )]
    NoTaskInertia {
        /// Joints of the arm.
        joints: usize,
        /// Axes of the task.
        axes: usize,
    },
}

impl Unsuited {
    /// The key of the `law` table that has to change.
    pub fn key(&self) -> &'static str {
        match self {
            Self::NotSquare { .. } | Self::TooFewJoints { .. } => "kind",
            Self::NoTaskInertia { .. } => "mass",
        }
    }
}

/// The declaration of a law: its description, and how a scenario's settings are read.
trait Declaration: Sized {
    /// Its name, parameters and signals.
    const DESCRIPTION: Description;

    /// Reads the settings from a scenario's `law` table, for an arm and a task.
    ///
    /// The scenario may name another law: a key that this one needs may be missing. It reads its own
    /// keys all the same, before it returns an error about one, so that all keys are known.
    fn read(
        law: &Section<'_>,
        arm: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError>;

    /// Whether the law can control an arm in a task.
    fn check(&self, _: &ArmSettings, _: &task::Description) -> Result<(), Unsuited> {
        Ok(())
    }
}

/// The registry.
macro_rules! register {
    ($($variant:ident($module:ident::$law:ident),)*) => {
        /// All laws, in the order in which they are listed.
        pub const LAWS: &[&Description] =
            &[$(&<$module::$law<f64, MAX_AXES> as Declaration>::DESCRIPTION,)*];

        /// Any of the laws.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Law<T, const M: usize> {
            $(#[doc = concat!("See [`", stringify!($module), "`].")] $variant($module::$law<T, M>),)*
        }

        lift! { enum Law<T, M> { $($variant(law)),* } }

        impl<T: Scalar, const M: usize> Equation<T, M> for Law<T, M> {
            #[inline(always)]
            fn command<A: Kinematics<T, N, M>, const N: usize>(
                &self,
                now: &Situation<'_, T, A, N, M>,
                state: &mut State<T>,
                signals: &mut Signals<T>,
            ) -> Command<T, N> {
                match self {
                    $(Self::$variant(law) => law.command(now, state, signals),)*
                }
            }

            fn balances_gravity(&self) -> bool {
                match self {
                    $(Self::$variant(law) => law.balances_gravity(),)*
                }
            }

            fn factor(&self) -> Option<&factor::Factor<T, M>> {
                match self {
                    $(Self::$variant(law) => law.factor(),)*
                }
            }
        }

        impl<T, const M: usize> Law<T, M> {
            /// The law's description.
            pub fn description(&self) -> &'static Description {
                match self {
                    $(Self::$variant(_) => &<$module::$law<f64, MAX_AXES> as Declaration>::DESCRIPTION,)*
                }
            }
        }

        impl Law<f64, MAX_AXES> {
            /// Reads the law of this name. Keys that only other laws have must be valid for them.
            fn of(
                name: &str,
                law: &Section<'_>,
                arm: &ArmSettings,
                task: &task::Description,
            ) -> Result<Self, ScenarioError> {
                let mut chosen = None;
                $(
                    let read = $module::$law::read(law, arm, task).map(Self::$variant);
                    let description = &<$module::$law<f64, MAX_AXES> as Declaration>::DESCRIPTION;
                    match read {
                        read if description.name == name => chosen = Some(read?),
                        Err(error) if is_for_others(&error, name) => return Err(error),
                        _ => {}
                    }
                )*
                chosen.ok_or_else(|| law.refuse("kind", "the name of a law"))
            }

            /// Whether the law can control an arm in a task.
            pub fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
                match self {
                    $(Self::$variant(law) => law.check(arm, task),)*
                }
            }
        }
    };
}

register! {
    Tj(tj::TransposeJacobianControl),
    Mtj(mtj::ModifiedTransposeJacobian),
    Mb(mb::ModelBased),
    Tdc(tdc::TimeDelay),
    Dob(dob::DisturbanceObserver),
    Impedance(impedance::Impedance),
    Scct(scct::SimplifiedComputedTorque),
    Pid(pid::JointPid),
    Rate(rate::MotionRate),
    Adaptive(adaptive::Adaptive),
}

/// The names of all laws, as [`LAWS`] has them.
const NAMES: [&str; LAWS.len()] = {
    let mut names = [""; LAWS.len()];
    let mut i = 0;
    while i < LAWS.len() {
        names[i] = LAWS[i].name;
        i += 1;
    }
    names
};

/// law.kind.
pub(crate) const KIND: Parameter = Parameter::new(
    "law.kind",
    describe::Form::Choice(&NAMES),
    "",
    describe::Default::Required,
    "The control law.",
);

/// The law of this name.
pub fn find(name: &str) -> Option<&'static Description> {
    LAWS.iter().copied().find(|law| law.name == name)
}

/// Whether an error is about a key that the law of this name does not have.
fn is_for_others(error: &ScenarioError, name: &str) -> bool {
    error.refused_key().is_some_and(|refused| {
        let reads = |key: &Parameter| refused.starts_with(key.key);
        !find(name).is_some_and(|chosen| chosen.parameters.iter().any(reads))
    })
}

impl Law<f64, MAX_AXES> {
    /// Reads the law that a scenario's `law` table names.
    pub fn read(
        law: &Section<'_>,
        arm: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError> {
        Self::of(law.word(&KIND, &NAMES)?, law, arm, task)
    }
}
