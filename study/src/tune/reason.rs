//! Why K_d is not larger, and why a candidate was rejected.

use std::fmt;

use super::{MARGIN, STARTS, VERIFIED_S, values::Remedy};
use crate::predict::path::Masses;

/// Of K_d T_s/m < 2, which a held damping force needs, half is kept as a margin.
pub(crate) const HELD_DAMPING: f64 = 1.0;

/// The limit on K_d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GainLimit {
    /// A damping force that is held for a sample period.
    HeldDamping {
        /// The least effective mass, kg.
        least_mass: f64,
    },
    /// The torque of the first command.
    FirstTorque {
        /// From 1.
        joint: usize,
        /// N m.
        limit: f64,
    },
    /// The latency that the linear loop must stand.
    Latency {
        /// With its margin, s.
        latency: f64,
        /// Effective masses along the path.
        masses: Masses,
    },
    /// The search found smaller gains to be better.
    Search {
        /// The largest K_d that was tried, N s/m.
        most: f64,
    },
}

impl fmt::Display for GainLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HeldDamping { least_mass } => write!(
                f,
                "held damping: K_d T_s/m < 2, kept at {HELD_DAMPING} on the least effective mass, \
                 {least_mass:.2} kg"
            ),
            Self::FirstTorque { joint, limit } => {
                write!(
                    f,
                    "torque: the initial error alone asks for {limit:.3} N m at joint {joint}"
                )
            }
            Self::Latency { latency, masses: Masses { least, most } } => write!(
                f,
                "latency: the linear loop must stand {:.3} ms on {least:.2} to {most:.2} kg",
                latency * 1e3
            ),
            Self::Search { most } => write!(f, "simulation: the best of the gains up to {most}"),
        }
    }
}

/// A remedy, with a gain if one was tried, that does not do what is wanted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}{}: {problem}", remedy.name(), kd.map_or(String::new(), |kd| format!(", K_d = {kd}")))]
pub struct Rejected {
    /// The remedy.
    pub remedy: Remedy,
    /// The gain that was simulated, N s/m; `None` if theory allows none.
    pub kd: Option<f64>,
    /// The problem with it.
    #[source]
    pub problem: Problem,
}

/// The problem with a candidate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// The linear loop is not stable at the latency, with any gain.
    #[error(
        "with K_d = {kd:.3} and k = {factor:.3} the loop {}; {:.3} ms are needed",
        stands(*largest),
        needed * 1e3
    )]
    Unstable {
        /// N s/m.
        kd: f64,
        /// The regulating factor k.
        factor: f64,
        /// The largest latency that it stands, s; `None` if it is not stable even without.
        largest: Option<f64>,
        /// The latency with its margin, s.
        needed: f64,
    },
    /// The arm runs away.
    #[error("the arm runs away{}", at(*multiple))]
    Diverges {
        /// Of the latency.
        multiple: f64,
    },
    /// The error grows from the third quarter of the run to the last.
    #[error("the error still grows at the end{}", at(*multiple))]
    Grows {
        /// Of the latency.
        multiple: f64,
    },
    /// A joint needs more torque than it has.
    #[error("the torque at joint {joint} reaches {peak:.3} of {limit:.3} N m{}", at(*multiple))]
    Torque {
        /// From 1.
        joint: usize,
        /// N m.
        peak: f64,
        /// N m.
        limit: f64,
        /// Of the latency.
        multiple: f64,
    },
}

/// How a proposal falls short of what is wanted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Shortfall {
    /// It stands the scenario's duration, but not the longer simulation.
    #[error("from {STARTS} starts and for {VERIFIED_S} s or more, {problem}")]
    AtLength {
        /// The problem with it.
        #[source]
        problem: Problem,
    },
    /// The error decays at another rate.
    #[error("the error decays with a time constant of {found:.2} s; {wanted} s was wanted")]
    TimeConstant {
        /// s.
        found: f64,
        /// s.
        wanted: f64,
    },
    /// The decay of the error is too short to tell its rate.
    #[error(
        "whether the error decays with the wanted {wanted} s cannot be told: it is too small from \
         the start, or does not decay far enough"
    )]
    Unknown {
        /// s.
        wanted: f64,
    },
    /// The error is much larger at [`MARGIN`] times the latency.
    #[error(
        "at {MARGIN} x the latency the worst error is {:.2} mm, {:.1} times as large as at the latency",
        error * 1e3,
        ratio
    )]
    Margin {
        /// m.
        error: f64,
        /// Over the worst error at the latency.
        ratio: f64,
    },
    /// The error differs much from start to start.
    #[error("from the worst start the error is {ratio:.1} times the median")]
    Spread {
        /// The worst over the median.
        ratio: f64,
    },
}

fn stands(largest: Option<f64>) -> String {
    match largest {
        Some(latency) => format!("stands {:.3} ms", latency * 1e3),
        None => "is not stable even without latency".to_owned(),
    }
}

fn at(multiple: f64) -> String {
    if multiple == 1.0 { String::new() } else { format!(" at {multiple} x the latency") }
}
