//! The regulating factor k: how much of the memory to trust.

use nalgebra::{SMatrix, SVector};

use super::{
    Command, Signals,
    describe::{Default, Form, Parameter, Per, Signal},
};
use crate::{
    MAX_AXES, lift, matrix,
    scalar::Scalar,
    scenario::{error::ScenarioError, key::Range, section::Section},
    task::TrackingError,
};

/// How k follows from the tracking error, and its sensitivity thresholds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor<T, const M: usize> {
    /// Which equation.
    pub kind: FactorKind,
    /// ε and ε̇, or e_max and ė_max.
    pub thresholds: Thresholds<T, M>,
    /// What k is multiplied with: its largest value, if that is not one as in the paper. A held
    /// loop of eq. (16) is asymptotically stable only below (2 K_d − K_p T_s)/(2 K_d + K_p T_s).
    pub ceiling: Option<T>,
}

/// The equation of the regulating factor. E and Ė are the diagonal matrices of the thresholds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorKind {
    /// 1, whatever the error: with a ceiling, the ceiling.
    Constant,
    /// Eq. (14): 1 while ‖E⁻¹ e‖ < 1 and ‖Ė⁻¹ ė‖ < 1, else 0.
    Switch,
    /// Eq. (15a): exp(−(‖E⁻¹ e‖ + ‖Ė⁻¹ ė‖)).
    Exponential,
    /// Eq. (15b): kᵢᵢ = exp(−(|eᵢ|/e_maxᵢ + |ėᵢ|/ė_maxᵢ)).
    Diagonal,
}

/// Positive thresholds, the first of the tracking error, m, the second of its rate, m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thresholds<T, const M: usize> {
    /// The same on all axes, as in the paper.
    Same(T, T),
    /// A number for each axis: the diagonals of E and Ė.
    Each(SVector<T, M>, SVector<T, M>),
}

/// A task force with its memory term, and the factor k.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithMemory<T, const M: usize> {
    /// Q̂, N.
    pub force: SVector<T, M>,
    /// h, N.
    pub memory: SVector<T, M>,
    /// k on each axis: the diagonal of K.
    pub factor: SVector<T, M>,
}

impl<T: Scalar, const M: usize> WithMemory<T, M> {
    /// τ = Jᵀ Q̂, with k and h as signals.
    #[inline(always)]
    pub fn command<const N: usize>(
        &self,
        jacobian: &SMatrix<T, M, N>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        signals[..M].copy_from_slice(self.factor.as_slice());
        signals[M..2 * M].copy_from_slice(self.memory.as_slice());
        Command::of_task_force(jacobian, &self.force)
    }
}

lift! { struct Factor<T, M> { kind, thresholds, ceiling } }
lift! { enum FactorKind { Constant, Switch, Exponential, Diagonal } }
lift! { enum Thresholds<T, M> { Same(error, error_rate), Each(error, error_rate) } }

/// law.factor.kind.
pub(super) const KIND: Parameter = Parameter {
    key: "law.factor.kind",
    label: "k from",
    form: Form::Choice(&["constant", "switch", "exponential", "diagonal"]),
    unit: "",
    default: Default::Value("\"exponential\""),
    help: "How the regulating factor follows from the error: not at all, or by eq. (14), (15a) or \
           (15b).",
};

/// law.factor.error.
pub(super) const ERROR: Parameter = Parameter {
    key: "law.factor.error",
    label: "e_max",
    form: Form::List(Range::Positive),
    unit: "m",
    default: Default::Value("1.0"),
    help: "Threshold of the tracking error.",
};

/// law.factor.error_rate.
pub(super) const ERROR_RATE: Parameter = Parameter {
    key: "law.factor.error_rate",
    label: "ė_max",
    form: Form::List(Range::Positive),
    unit: "m/s",
    default: Default::Value("10.0"),
    help: "Threshold of the tracking error's rate.",
};

/// law.factor.ceiling.
pub(super) const CEILING: Parameter = Parameter {
    key: "law.factor.ceiling",
    label: "largest k",
    form: Form::Number(Range::Fraction),
    unit: "",
    default: Default::Value("1.0"),
    help: "What k is multiplied with: its largest value.",
};

/// k and h, as a law with a memory shows them.
pub(super) const SIGNALS: &[Signal] = &[
    Signal {
        key: "factor",
        symbol: "k",
        title: "Regulating factor",
        unit: "",
        per: Per::Axis,
        range: Some([0.0, 1.0]),
    },
    Signal { key: "memory", symbol: "h", title: "Memory", unit: "N", per: Per::Axis, range: None },
];

impl Factor<f64, MAX_AXES> {
    /// Reads a scenario's `law.factor`, whose `kind` a law declares with its own default.
    pub(super) fn read(
        law: &Section<'_>,
        kind: &Parameter,
        axes: usize,
    ) -> Result<Self, ScenarioError> {
        let section = law.section_or_empty("factor")?;
        let kinds = {
            use FactorKind::{Constant, Diagonal, Exponential, Switch};
            [Constant, Switch, Exponential, Diagonal]
        };
        let factor = Self {
            kind: section.word(kind, &kinds)?,
            thresholds: Thresholds::read(&section, axes)?,
            ceiling: section.optional_number(&CEILING)?.filter(|k| *k != 1.0),
        };
        section.finish()?;
        Ok(factor)
    }
}

impl Thresholds<f64, MAX_AXES> {
    fn read(section: &Section<'_>, axes: usize) -> Result<Self, ScenarioError> {
        let each = |key| -> Result<SVector<f64, MAX_AXES>, ScenarioError> {
            let list = section.one_or_each(key, axes)?.unwrap_or_default();
            // What is past the last axis must not make a difference.
            let first = list.first().copied().unwrap_or(1.0);
            Ok(SVector::from_fn(|i, _| list.get(i).copied().unwrap_or(first)))
        };
        let (error, error_rate) = (each(&ERROR)?, each(&ERROR_RATE)?);
        let is_same = |each: &SVector<f64, MAX_AXES>| each.iter().all(|x| *x == each[0]);
        if is_same(&error) && is_same(&error_rate) {
            return Ok(Self::Same(error[0], error_rate[0]));
        }
        Ok(Self::Each(error, error_rate))
    }
}

impl<T: Scalar, const M: usize> Thresholds<T, M> {
    /// E and Ė.
    #[inline(always)]
    fn each(&self) -> (SVector<T, M>, SVector<T, M>) {
        match self {
            Self::Same(error, error_rate) => {
                (SVector::repeat(*error), SVector::repeat(*error_rate))
            }
            Self::Each(error, error_rate) => (*error, *error_rate),
        }
    }

    /// ‖E⁻¹ e‖ + ‖Ė⁻¹ ė‖.
    #[inline(always)]
    fn relative(&self, e: &TrackingError<T, M>) -> T {
        match self {
            Self::Same(error, error_rate) => {
                matrix::norm(&e.position) / *error + matrix::norm(&e.velocity) / *error_rate
            }
            Self::Each(error, error_rate) => {
                matrix::norm(&e.position.component_div(error))
                    + matrix::norm(&e.velocity.component_div(error_rate))
            }
        }
    }

    /// 1 where ‖E⁻¹ e‖ < 1 and ‖Ė⁻¹ ė‖ < 1, else 0.
    #[inline(always)]
    fn contain(&self, e: &TrackingError<T, M>) -> T {
        let (one, zero) = (T::one(), T::zero());
        match self {
            Self::Same(error, error_rate) => {
                let slow = matrix::norm(&e.velocity).where_below(*error_rate, one, zero);
                matrix::norm(&e.position).where_below(*error, slow, zero)
            }
            Self::Each(error, error_rate) => {
                let rate = matrix::norm(&e.velocity.component_div(error_rate));
                let slow = rate.where_below(one, one, zero);
                matrix::norm(&e.position.component_div(error)).where_below(one, slow, zero)
            }
        }
    }
}

impl<T: Scalar, const M: usize> Factor<T, M> {
    /// k whatever the error: what a loop has to be linear.
    pub fn constant(k: T) -> Self {
        let thresholds = Thresholds::Same(T::one(), T::one());
        Self { kind: FactorKind::Constant, thresholds, ceiling: Some(k) }
    }

    /// Adds h = k · memory to a task force; no memory at the first step, where k = 0.
    #[inline(always)]
    pub fn add_memory(
        &self,
        force: SVector<T, M>,
        error: &TrackingError<T, M>,
        remembered: Option<&SVector<T, M>>,
    ) -> WithMemory<T, M> {
        let Some(remembered) = remembered else {
            let nothing = SVector::zeros();
            return WithMemory { force, memory: nothing, factor: nothing };
        };
        let (factor, memory) = self.regulate(error, remembered);
        WithMemory { force: force + memory, memory, factor }
    }

    /// k for a tracking error, and k · memory: without a multiplication where k is one or zero.
    #[inline(always)]
    fn regulate(
        &self,
        e: &TrackingError<T, M>,
        remembered: &SVector<T, M>,
    ) -> (SVector<T, M>, SVector<T, M>) {
        let (k, memory) = match self.kind {
            FactorKind::Constant => (SVector::repeat(T::one()), *remembered),
            FactorKind::Switch => {
                let (k, zero) = (self.thresholds.contain(e), T::zero());
                (SVector::repeat(k), remembered.map(|entry| zero.where_below(k, entry, zero)))
            }
            FactorKind::Exponential => {
                let k = SVector::<T, M>::repeat((-self.thresholds.relative(e)).exp());
                (k, k.component_mul(remembered))
            }
            FactorKind::Diagonal => {
                let (error, error_rate) = self.thresholds.each();
                let relative = e.position.zip_map(&error, |e, all| e.abs() / all)
                    + e.velocity.zip_map(&error_rate, |e, all| e.abs() / all);
                let k = T::exp_each(&-relative);
                (k, k.component_mul(remembered))
            }
        };
        match self.ceiling {
            None => (k, memory),
            Some(ceiling) => {
                let k = k * ceiling;
                (k, k.component_mul(remembered))
            }
        }
    }
}
