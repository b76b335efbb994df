//! The regulating factor k: how much of the memory to trust.

use nalgebra::{SMatrix, SVector};

use super::{
    Command,
    describe::{Default, Form, Parameter, Per, Signal},
};
use crate::{
    MAX_AXES, lift, matrix,
    scalar::Scalar,
    scenario::section::{self, ScenarioError, Section},
    task::TrackingError,
};

/// How k follows from the tracking error, and its sensitivity thresholds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor<T, const M: usize> {
    /// Which equation.
    pub kind: FactorKind,
    /// ε or e_max, m.
    pub error: Threshold<T, M>,
    /// ε̇ or ė_max, m/s.
    pub error_rate: Threshold<T, M>,
    /// What k is multiplied with: its largest value, if that is not one as in the paper. A held loop of
    /// eq. (16) is asymptotically stable only below (2 K_d − K_p T_s)/(2 K_d + K_p T_s).
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

/// A positive threshold: one for all axes, as in the paper, or one for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Threshold<T, const M: usize> {
    /// The same on all axes.
    Same(T),
    /// One for each axis.
    Each(SVector<T, M>),
}

/// A regulating factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Regulation<T, const M: usize> {
    /// Use none of the memory: k = 0.
    Nothing,
    /// Use the memory as it is: k = 1, without a multiplication.
    Everything,
    /// k of one or zero: use the memory as it is, or none of it, without a multiplication.
    Switch(T),
    /// k on each axis: the diagonal of K.
    Each(SVector<T, M>),
}

/// A task force and what the memory had to do with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remembered<T, const M: usize> {
    /// Q̂, N.
    pub force: SVector<T, M>,
    /// h, N.
    pub memory: SVector<T, M>,
    /// k.
    pub factor: Regulation<T, M>,
}

impl<T: Scalar, const M: usize> Remembered<T, M> {
    /// τ = Jᵀ Q̂, with k and h as signals.
    #[inline(always)]
    pub fn command<const N: usize>(&self, jacobian: &SMatrix<T, M, N>) -> Command<T, N> {
        let mut command = Command::of_task_force(jacobian, &self.force);
        let k = self.factor.per_axis();
        for i in 0..M {
            command.signals[i] = k[i];
            command.signals[M + i] = self.memory[i];
        }
        command
    }
}

lift! { struct Factor<T, M> { kind, error, error_rate, ceiling } }
lift! { enum FactorKind { Constant, Switch, Exponential, Diagonal } }
lift! { enum Threshold<T, M> { Same(all), Each(each) } }

const KINDS: [(&str, FactorKind); 4] = [
    ("constant", FactorKind::Constant),
    ("switch", FactorKind::Switch),
    ("exponential", FactorKind::Exponential),
    ("diagonal", FactorKind::Diagonal),
];

/// law.factor.kind.
pub(super) const KIND: Parameter = Parameter {
    key: "law.factor.kind",
    label: "k from",
    form: Form::Choice(&["constant", "switch", "exponential", "diagonal"]),
    unit: "",
    default: Default::Value("\"exponential\""),
    help: "How the regulating factor follows from the error: not at all, or by eq. (14), (15a) or (15b).",
};

/// law.factor.error.
pub(super) const ERROR: Parameter = Parameter {
    key: "law.factor.error",
    label: "e_max",
    form: Form::List,
    unit: "m",
    default: Default::Value("1.0"),
    help: "Threshold of the tracking error.",
};

/// law.factor.error_rate.
pub(super) const ERROR_RATE: Parameter = Parameter {
    key: "law.factor.error_rate",
    label: "ė_max",
    form: Form::List,
    unit: "m/s",
    default: Default::Value("10.0"),
    help: "Threshold of the tracking error's rate.",
};

/// law.factor.ceiling.
pub(super) const CEILING: Parameter = Parameter {
    key: "law.factor.ceiling",
    label: "largest k",
    form: Form::Number,
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
    /// The paper's: eq. (15a) with e_max = 1 m and ė_max = 10 m/s.
    pub const PAPER: Self = Self {
        kind: FactorKind::Exponential,
        error: Threshold::Same(1.0),
        error_rate: Threshold::Same(10.0),
        ceiling: None,
    };
    /// k = 1.
    pub const ALL: Self = Self { kind: FactorKind::Constant, ..Self::PAPER };

    /// Reads a scenario's `law.factor`; what is absent is as in `default`.
    pub(super) fn read(
        law: &Section<'_>,
        axes: usize,
        default: Self,
    ) -> Result<Self, ScenarioError> {
        let Some(section) = law.optional_section("factor")? else { return Ok(default) };
        let ceiling = |section: &Section<'_>| {
            section.optional("ceiling", "a factor from 0 to 1", |value| {
                section::number(value).filter(|k| (0.0..=1.0).contains(k))
            })
        };
        let factor = Self {
            kind: section.choice("kind", &KINDS, Some(default.kind))?,
            error: Threshold::read(&section, "error", "m", axes)?.unwrap_or(default.error),
            error_rate: Threshold::read(&section, "error_rate", "m/s", axes)?
                .unwrap_or(default.error_rate),
            ceiling: ceiling(&section)?.filter(|k| *k != 1.0),
        };
        section.finish()?;
        Ok(factor)
    }
}

impl Threshold<f64, MAX_AXES> {
    fn read(
        section: &Section<'_>,
        key: &str,
        unit: &str,
        axes: usize,
    ) -> Result<Option<Self>, ScenarioError> {
        let expected = format!("a threshold in {unit} greater than 0, or a list of {axes}");
        let list = section.per_axis(key, axes, &expected, |x| x > 0.0)?;
        Ok(list.map(|list| {
            if list.iter().all(|x| *x == list[0]) {
                return Self::Same(list[0]);
            }
            Self::Each(SVector::from_fn(|i, _| list.get(i).copied().unwrap_or(1.0)))
        }))
    }
}

impl<T: Scalar, const M: usize> Threshold<T, M> {
    /// ‖E⁻¹ x‖.
    #[inline(always)]
    fn relative(&self, x: &SVector<T, M>) -> T {
        match self {
            Self::Same(all) => matrix::norm(x) / *all,
            Self::Each(each) => matrix::norm(&x.component_div(each)),
        }
    }

    /// `then` where ‖E⁻¹ x‖ < 1, else `otherwise`.
    #[inline(always)]
    fn where_within(&self, x: &SVector<T, M>, then: T, otherwise: T) -> T {
        match self {
            Self::Same(all) => matrix::norm(x).where_below(*all, then, otherwise),
            Self::Each(_) => self.relative(x).where_below(T::one(), then, otherwise),
        }
    }

    /// |xᵢ|/Eᵢ on each axis.
    #[inline(always)]
    fn relative_each(&self, x: &SVector<T, M>) -> SVector<T, M> {
        match self {
            Self::Same(all) => x.map(|x| x.abs() / *all),
            Self::Each(each) => x.zip_map(each, |x, threshold| x.abs() / threshold),
        }
    }
}

impl<T: Scalar, const M: usize> Factor<T, M> {
    /// k whatever the error: what a loop has to be linear.
    pub fn constant(k: T) -> Self {
        let unused = Threshold::Same(T::one());
        Self { kind: FactorKind::Constant, error: unused, error_rate: unused, ceiling: Some(k) }
    }

    /// Adds h = k · remembered to a task force; `None` at the first step, where k = 0.
    #[inline(always)]
    pub fn add_memory(
        &self,
        force: SVector<T, M>,
        error: &TrackingError<T, M>,
        remembered: Option<&SVector<T, M>>,
    ) -> Remembered<T, M> {
        let Some(remembered) = remembered else {
            return Remembered { force, memory: SVector::zeros(), factor: Regulation::Nothing };
        };
        let factor = self.regulate(error);
        let memory = factor.times(remembered);
        Remembered { force: force + memory, memory, factor }
    }

    /// k for a tracking error.
    #[inline(always)]
    pub fn regulate(&self, e: &TrackingError<T, M>) -> Regulation<T, M> {
        let Self { error, error_rate, .. } = self;
        let k = match self.kind {
            FactorKind::Constant => Regulation::Everything,
            FactorKind::Switch => {
                let (one, zero) = (T::one(), T::zero());
                let slow = error_rate.where_within(&e.velocity, one, zero);
                Regulation::Switch(error.where_within(&e.position, slow, zero))
            }
            FactorKind::Exponential => {
                let sum = error.relative(&e.position) + error_rate.relative(&e.velocity);
                Regulation::Each(SVector::repeat((-sum).exp()))
            }
            FactorKind::Diagonal => {
                let sum = error.relative_each(&e.position) + error_rate.relative_each(&e.velocity);
                Regulation::Each(T::exp_each(&-sum))
            }
        };
        match self.ceiling {
            None => k,
            Some(ceiling) => k.under(ceiling),
        }
    }
}

impl<T: Scalar, const M: usize> Regulation<T, M> {
    /// k · memory.
    #[inline(always)]
    pub fn times(&self, memory: &SVector<T, M>) -> SVector<T, M> {
        match self {
            Self::Nothing => SVector::zeros(),
            Self::Everything => *memory,
            Self::Switch(k) => memory.map(|entry| T::zero().where_below(*k, entry, T::zero())),
            Self::Each(k) => k.component_mul(memory),
        }
    }

    /// c k: the same factor under a ceiling c.
    #[inline(always)]
    fn under(self, ceiling: T) -> Self {
        match self {
            Self::Nothing => self,
            Self::Everything => Self::Each(SVector::repeat(ceiling)),
            Self::Switch(k) => Self::Each(SVector::repeat(k * ceiling)),
            Self::Each(k) => Self::Each(k * ceiling),
        }
    }

    /// k on each axis.
    #[inline(always)]
    pub fn per_axis(&self) -> SVector<T, M> {
        match self {
            Self::Nothing => SVector::zeros(),
            Self::Everything => SVector::repeat(T::one()),
            Self::Switch(k) => SVector::repeat(*k),
            Self::Each(k) => *k,
        }
    }
}
