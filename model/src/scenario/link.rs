//! The two directions between plant and controller.

use std::{path::PathBuf, time::Duration};

use super::{
    error::ScenarioError,
    section::{self, Section},
};

/// Both directions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Links {
    /// Sensor to controller.
    pub state: LinkSettings,
    /// Controller to actuator.
    pub torque: LinkSettings,
}

/// How one direction delays and loses what it carries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkSettings {
    /// From entering to leaving the link: the mean, or with a replay what is added to it.
    pub latency: Duration,
    /// How the latency varies.
    pub jitter: Jitter,
    /// What is lost.
    pub dropout: Dropout,
}

/// How a latency varies about its mean.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Jitter {
    /// Not at all.
    #[default]
    None,
    /// Evenly within the mean ± `spread`.
    Uniform {
        /// Half the width; no more than the mean.
        spread: Duration,
    },
    /// Normally, cut off at zero.
    Normal {
        /// Standard deviation.
        deviation: Duration,
    },
    /// By a gamma distribution: never negative, with a long tail, as queues make it.
    Gamma {
        /// Standard deviation.
        deviation: Duration,
    },
    /// As measured: the latencies in a CSV file, one after the other and round again.
    Replay {
        /// A file with a header line and a column `latency_s`, `_ms`, `_us` or `_ns`.
        file: PathBuf,
    },
}

/// What a link loses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Dropout {
    /// Nothing.
    #[default]
    None,
    /// Each message with the same probability.
    Independent(f64),
    /// In bursts (Gilbert and Elliott): a two-state Markov chain that moves before each message.
    Burst {
        /// Probability of going from the good state to the bad.
        enter: f64,
        /// Probability of going from the bad state to the good.
        leave: f64,
        /// Probability of losing a message in the good state.
        good: f64,
        /// Probability of losing a message in the bad state.
        bad: f64,
    },
}

#[derive(Clone, Copy)]
enum JitterKind {
    Uniform,
    Normal,
    Gamma,
    Replay,
}

impl Links {
    pub(super) fn read(section: Option<Section<'_>>) -> Result<Self, ScenarioError> {
        let Some(section) = section else { return Ok(Self::default()) };
        let links = Self {
            state: LinkSettings::read(section.optional_section("state")?)?,
            torque: LinkSettings::read(section.optional_section("torque")?)?,
        };
        section.finish()?;
        Ok(links)
    }
}

impl LinkSettings {
    fn read(section: Option<Section<'_>>) -> Result<Self, ScenarioError> {
        let Some(section) = section else { return Ok(Self::default()) };
        let latency = section.duration("latency", Duration::ZERO, Some(Duration::ZERO))?;
        let jitter = match section.optional_section("jitter")? {
            None => Jitter::None,
            Some(jitter) => {
                Jitter::read(&jitter, latency).and_then(|j| jitter.finish().map(|()| j))?
            }
        };
        let dropout = Dropout::read(&section)?;
        section.finish()?;
        Ok(Self { latency, jitter, dropout })
    }
}

impl Jitter {
    fn read(section: &Section<'_>, latency: Duration) -> Result<Self, ScenarioError> {
        let kinds = [
            ("uniform", JitterKind::Uniform),
            ("normal", JitterKind::Normal),
            ("gamma", JitterKind::Gamma),
            ("replay", JitterKind::Replay),
        ];
        let kind = section.choice("kind", &kinds, None)?;
        let deviation = || section.duration("deviation", Duration::ZERO, None);
        Ok(match kind {
            JitterKind::Uniform => {
                let spread = section.duration("spread", Duration::ZERO, None)?;
                if spread > latency {
                    return Err(section.refuse("spread", "no more than the link's latency"));
                }
                Self::Uniform { spread }
            }
            JitterKind::Normal => Self::Normal { deviation: deviation()? },
            JitterKind::Gamma => {
                let deviation = deviation()?;
                if latency.is_zero() && !deviation.is_zero() {
                    return Err(section.refuse("deviation", "0 s, because the link's latency is 0"));
                }
                Self::Gamma { deviation }
            }
            JitterKind::Replay => Self::Replay {
                file: section.required("file", "the path of a CSV file", |value| {
                    value.as_str().map(PathBuf::from)
                })?,
            },
        })
    }
}

impl Dropout {
    fn read(link: &Section<'_>) -> Result<Self, ScenarioError> {
        let expected = "a probability from 0 to 1, or a table {enter, leave} for bursts";
        let independent = link.optional("dropout", expected, |value| {
            Some(probability(value).map(Self::Independent))
        })?;
        match independent {
            None => Ok(Self::None),
            Some(Some(independent)) => Ok(independent),
            Some(None) => {
                let Ok(Some(burst)) = link.optional_section("dropout") else {
                    return Err(link.refuse("dropout", expected));
                };
                let chance = |key, default: Option<f64>| {
                    let given = burst.optional(key, "a probability from 0 to 1", probability)?;
                    given.or(default).ok_or_else(|| burst.refuse(key, "a probability from 0 to 1"))
                };
                let dropout = Self::Burst {
                    enter: chance("enter", None)?,
                    leave: chance("leave", None)?,
                    good: chance("good", Some(0.0))?,
                    bad: chance("bad", Some(1.0))?,
                };
                burst.finish()?;
                Ok(dropout)
            }
        }
    }
}

fn probability(value: &toml::Value) -> Option<f64> {
    section::number(value).filter(|p| (0.0..=1.0).contains(p))
}
