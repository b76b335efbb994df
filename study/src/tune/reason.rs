//! Why K_d is not larger, and why a candidate was rejected.

use std::fmt;

use super::values::Remedy;
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

fn stands(largest: Option<f64>) -> String {
    match largest {
        Some(latency) => format!("stands {:.3} ms", latency * 1e3),
        None => "is not stable even without latency".to_owned(),
    }
}

fn at(multiple: f64) -> String {
    if multiple == 1.0 { String::new() } else { format!(" at {multiple} x the latency") }
}
