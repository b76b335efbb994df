//! The values that a proposal sets.

use mtj_model::scenario::{MemoryPolicy, Override, Scenario};

use super::Wanted;

/// e_max as multiples of the initial error; the first makes k nearly one.
pub(crate) const THRESHOLDS: [f64; 4] = [1000.0, 30.0, 10.0, 3.0];
/// ė_max/e_max, 1/s: the paper's.
const RATE_RATIO: f64 = 10.0;

/// A remedy against latency: the task force that the law remembers, and prediction or eq. (11).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remedy {
    /// The task force that is remembered.
    pub policy: MemoryPolicy,
    /// M̄ of eq. (11), kg; `None` for eq. (16).
    pub mass: Option<f64>,
    /// Whether the law aims a measured latency ahead.
    pub predicts: bool,
}

/// M̄/m of eq. (11) that are tried, m the least effective mass: the inner loop is stable below 2,
/// and a small one stands little latency with the memory of what was sent and asks less of the
/// actuator.
const MASS_RATIOS: [f64; 7] = [1.7, 1.4, 1.2, 1.0, 0.8, 0.5, 0.3];

/// Every remedy that may be proposed, for a least effective mass.
pub(crate) fn remedies(least_mass: f64) -> Vec<Remedy> {
    let masses = MASS_RATIOS.map(|ratio| Some(round_down(ratio * least_mass)));
    let eq_11 = |policy| masses.map(|mass| Remedy { policy, mass, predicts: false });
    let eq_16 = |policy, predicts| Remedy { policy, mass: None, predicts };
    let (sent, delivered) = (MemoryPolicy::Sent, MemoryPolicy::Delivered);
    let mut all = vec![eq_16(sent, false), eq_16(delivered, false), eq_16(delivered, true)];
    all.extend(eq_11(sent));
    all.extend(eq_11(delivered));
    all
}

impl Remedy {
    /// The order in which remedies are preferred where they are as good: the fewer parts, the
    /// better.
    pub fn parts(self) -> usize {
        match (self.policy, self.mass, self.predicts) {
            (MemoryPolicy::Sent, None, _) => 0,
            (_, None, false) => 1,
            (MemoryPolicy::Sent, Some(_), _) => 2,
            (_, Some(_), _) => 3,
            (_, None, true) => 4,
        }
    }

    /// The policy's name in scenarios.
    pub fn policy_name(self) -> &'static str {
        match self.policy {
            MemoryPolicy::Sent => "sent",
            MemoryPolicy::Applied => "applied",
            MemoryPolicy::Delivered => "delivered",
        }
    }

    /// The name in print.
    pub fn name(self) -> String {
        let policy = self.policy_name();
        match (self.mass, self.predicts) {
            (Some(mass), _) => format!("{policy}, with eq. (11) at {mass} kg"),
            (None, true) => format!("{policy}, with prediction"),
            (None, false) => policy.to_owned(),
        }
    }
}

/// The values to set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values {
    /// N/m.
    pub kp: f64,
    /// N s/m.
    pub kd: f64,
    /// e_max, m.
    pub error: f64,
    /// ė_max, m/s.
    pub error_rate: f64,
    /// The remedy against latency.
    pub remedy: Remedy,
}

impl Values {
    /// With K_p from the wanted time constant and ė_max from e_max.
    pub fn new(kd: f64, error: f64, remedy: Remedy, wanted: &Wanted) -> Self {
        let kp = kd / wanted.time_constant_s;
        Self { kp, kd, error, error_rate: RATE_RATIO * error, remedy }
    }

    /// The same as settings of a scenario.
    pub fn overrides(&self, scenario: &Scenario) -> Vec<Override> {
        let mut set = vec![
            Override::text("law.kind", "mtj"),
            Override::value("law.kp", self.kp.into()),
            Override::value("law.kd", self.kd.into()),
            Override::value("law.acceleration", self.remedy.mass.is_some().into()),
            Override::text("law.factor.kind", "exponential"),
            Override::value("law.factor.error", self.error.into()),
            Override::value("law.factor.error_rate", self.error_rate.into()),
            Override::value("law.factor.ceiling", 1.0.into()),
            Override::text("law.memory.policy", self.remedy.policy_name()),
        ];
        set.extend(self.remedy.mass.map(|mass| Override::value("law.mass", mass.into())));
        if self.remedy.predicts {
            set.push(Override::text("law.prediction.horizon", "measured"));
        } else if scenario.law.prediction.is_some() {
            set.push(Override::text("law.prediction.horizon", "none"));
        }
        set
    }
}

/// A positive number rounded to two significant digits.
pub(crate) fn round(x: f64) -> f64 {
    round_down(x * (1.0 + 0.5 * 10f64.powf(x.log10().floor() - 1.0) / x))
}

/// A positive number rounded down to two significant digits.
pub(crate) fn round_down(x: f64) -> f64 {
    let unit = 10f64.powf(x.log10().floor() - 1.0);
    let digits = (x / unit + 1e-9).floor();
    // Divided by a whole number, so that 0.3 is printed as 0.3.
    if unit < 1.0 { digits / (1.0 / unit).round() } else { digits * unit.round() }
}
