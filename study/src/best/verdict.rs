//! What was found of a candidate, and which of two is better.

use std::{cmp::Ordering, fmt};

use mtj_plant::report::Report;

use super::settings::{GainRange, Limits};

/// A limit that a candidate breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The arm runs away at the latency itself.
    Stability,
    /// A joint's torque.
    Torque,
    /// The rms torque step.
    TorqueStep,
    /// A joint's torque, with the margin.
    TorqueWithMargin,
    /// The loop does not stand the margin, or its error grows too much there.
    Margin,
}

/// What stands in the way of a lower error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Binding {
    /// Nearby gains have a lower error and break this limit.
    Limit(Limit),
    /// A key is at the end of its range.
    Range(String),
    /// Nothing: the error is least between the limits.
    Nothing,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stability => "stability",
            Self::Torque => "torque",
            Self::TorqueStep => "torque step",
            Self::TorqueWithMargin => "torque with margin",
            Self::Margin => "margin",
        })
    }
}

impl fmt::Display for Binding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Limit(limit) => limit.fmt(f),
            Self::Range(key) => write!(f, "range of {key}"),
            Self::Nothing => f.write_str("none"),
        }
    }
}

/// What was found of a candidate; less is better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Verdict {
    /// The rms error at the latency, m; infinite if the arm runs away.
    pub(crate) error: f64,
    /// The limit that it breaks, and how far.
    pub(crate) broken: Option<(Limit, f64)>,
}

impl Verdict {
    /// The verdict on runs at the latency.
    pub(crate) fn at_latency(reports: &[Report], limits: &Limits) -> Self {
        if let Some(by) = lost(reports) {
            return Self { error: f64::INFINITY, broken: Some((Limit::Stability, by)) };
        }
        let [torque, step] = [torque(reports, limits), step(reports, limits)];
        let worst = if torque > step { (Limit::Torque, torque) } else { (Limit::TorqueStep, step) };
        Self { error: error(reports), broken: Some(worst).filter(|(_, ratio)| *ratio > 1.0) }
    }

    /// The same with the verdict on runs with the margin.
    pub(crate) fn with_margin(self, reports: &[Report], limits: &Limits) -> Self {
        let growth = error(reports) / self.error / limits.growth;
        let torque = torque(reports, limits);
        // Far from the limits first, so that the search comes nearer.
        let broken = match lost(reports) {
            Some(by) => Some((Limit::Margin, 2e6 + by)),
            None if torque > 1.0 => Some((Limit::TorqueWithMargin, 1e6 + torque)),
            None => Some((Limit::Margin, growth)).filter(|_| growth > 1.0),
        };
        Self { broken, ..self }
    }

    /// The same where the margin was not tried: it has no lower error than one that stands it.
    pub(crate) fn untried(self) -> Self {
        Self { broken: Some((Limit::Margin, 0.0)), ..self }
    }

    /// Whether it keeps all limits.
    pub(crate) fn stands(&self) -> bool {
        self.broken.is_none()
    }

    fn rank(&self) -> (u8, f64) {
        match self.broken {
            None => (0, self.error),
            Some((Limit::Margin | Limit::TorqueWithMargin, by)) => (1, by),
            Some((Limit::Torque | Limit::TorqueStep, by)) => (2, by),
            Some((Limit::Stability, by)) => (3, by),
        }
    }
}

impl PartialOrd for Verdict {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.rank().partial_cmp(&other.rank())
    }
}

/// The part of the runs that the arm was not under control; `None` if it always was.
fn lost(reports: &[Report]) -> Option<f64> {
    let is_lost = |report: &&Report| report.diverged || report.rms_error_m.is_none();
    let lost = reports.iter().filter(is_lost);
    // The earlier, the worse.
    lost.map(|report| 1.0 / report.duration_s.max(1e-3)).reduce(f64::max)
}

/// The largest rms error, m.
pub(crate) fn error(reports: &[Report]) -> f64 {
    reports.iter().filter_map(|report| report.rms_error_m).fold(0.0, f64::max)
}

/// The largest torque over its limit.
fn torque(reports: &[Report], limits: &Limits) -> f64 {
    let ratios = reports.iter().flat_map(|report| {
        let peaks = report.peak_torque_nm.iter().enumerate();
        peaks.map(|(joint, peak)| peak / limits.torque(joint))
    });
    ratios.fold(0.0, f64::max)
}

/// The largest rms torque step over its limit.
fn step(reports: &[Report], limits: &Limits) -> f64 {
    let steps = reports.iter().filter_map(|report| report.torque_step_rms_nm);
    steps.fold(0.0, f64::max) / limits.torque_step_nm
}

/// How far around the best gains a limit counts as being in the way, as a natural logarithm.
const NEAR: f64 = 0.2;
/// How near to the end of its range a key is at the end.
const END: f64 = 1e-3;

/// What stands in the way of a lower error than that of the gains at `best`, from all that were
/// tried at full length.
pub(crate) fn binding(
    gains: &[GainRange],
    (best, found): (&[f64], Verdict),
    tried: &[(Vec<f64>, Verdict)],
) -> Binding {
    let distance = |at: &[f64]| {
        let squares = gains.iter().zip(at.iter().zip(best));
        squares.map(|(gain, (a, b))| ((a - b) * (gain.to / gain.from).ln()).powi(2)).sum::<f64>()
    };
    let is_lost = |limit: Limit| limit == Limit::Stability;
    let in_the_way = tried.iter().filter_map(|(at, verdict)| {
        let (limit, _) = verdict.broken?;
        (verdict.error < found.error || is_lost(limit)).then(|| (distance(at), limit))
    });
    let near = in_the_way.filter(|(distance, _)| *distance < NEAR * NEAR);
    // Instability says where the error would be lower only if nothing else does.
    let nearest = near
        .min_by(|(a, of_a), (b, of_b)| is_lost(*of_a).cmp(&is_lost(*of_b)).then(a.total_cmp(b)));
    let mut pairs = gains.iter().zip(best);
    let at_end = pairs.find(|(_, at)| **at < END || **at > 1.0 - END);
    match (nearest, at_end) {
        (Some((_, limit)), _) if !is_lost(limit) => Binding::Limit(limit),
        (_, Some((gain, _))) => Binding::Range(gain.key.clone()),
        (Some((_, limit)), None) => Binding::Limit(limit),
        (None, None) => Binding::Nothing,
    }
}
