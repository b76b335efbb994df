//! `mtj advise`: which law to take, and with which gains.

use std::io::{self, Write};

use clap::Args;
use mtj_model::scenario::{Override, Scenario};
use mtj_protocol::shutdown::Shutdown;
use mtj_study::{
    best::advice::{self, Advice, Advised, Question},
    tune::{self, Latency, LatencySource, Wanted},
};
use serde_json::{Value, json};

use super::tune::{seconds, torque_limit_or_motion};
use crate::failure::Failure;

/// Say which law to take, with which gains: the least error within limits of torque, noise and margin
#[derive(Args, Debug)]
pub struct Advise {
    /// Built-in scenario ('mtj scenario list' prints them) or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "sampled/mtj")]
    scenario: String,
    /// Set any key of the scenario; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Latency from sample to application; the scenario's links' unless given
    #[arg(long, value_name = "DURATION")]
    latency: Option<String>,
    /// Sample period; the scenario's unless given
    #[arg(long, value_name = "DURATION")]
    sample_period: Option<String>,
    /// Noise of the measured angles and velocities, as a part of their magnitude, like 0.5%
    #[arg(long, value_name = "PERCENT")]
    noise: Option<String>,
    /// Coulomb friction in N m and viscous friction in N m s/rad of every joint, like 2,2
    #[arg(long, value_name = "N,N")]
    friction: Option<String>,
    /// How far the masses of the controller's model may be off, either way, like 10%
    #[arg(long, value_name = "PERCENT")]
    model_error: Option<String>,
    /// Largest torque in N m, one number or one for each joint, like 18,10
    #[arg(long, value_name = "N[,N]")]
    torque_limit: Option<String>,
    /// Largest rms torque step between commands in N m; 4 unless given
    #[arg(long, value_name = "N")]
    torque_step_limit: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Advise {
    /// Prints the law with the least error, its gains, and what the others would lose.
    pub fn run(self) -> Result<(), Failure> {
        let set = self.overrides()?;
        let scenario = Scenario::load(&self.scenario, &set)?;
        let shutdown = Shutdown::on_signals();
        let proceed = move || shutdown.proceed();
        let limit = self.torque_limit.as_deref();
        let (torque_limit_nm, source) = torque_limit_or_motion(limit, &scenario, &proceed)?;
        let step = |text: &str| {
            number(text).filter(|step| *step > 0.0).ok_or_else(|| {
                let expected = "a torque step in N m greater than 0, like 4";
                Failure::bad_input(format!("--torque-step-limit {text}: expected {expected}"))
            })
        };
        let question = Question {
            scenario: self.scenario.clone(),
            set,
            torque_limit_nm,
            torque_step_limit_nm: self.torque_step_limit.as_deref().map(step).transpose()?,
            cases: self.cases(&scenario)?,
        };
        let advice = advice::advise(&question, &proceed)?;
        if advice.laws.is_empty() {
            return Err(Failure::other(none(&advice)));
        }
        let mut out = io::stdout().lock();
        if self.json {
            writeln!(out, "{}", object(&advice, &source))?;
        } else {
            write!(out, "{}", table(&advice, &source))?;
        }
        Ok(())
    }

    /// What the options set.
    fn overrides(&self) -> Result<Vec<Override>, Failure> {
        let mut set: Vec<Override> =
            self.set.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        if let Some(period) = &self.sample_period {
            seconds("--sample-period", period)?;
            set.push(Override::text("timing.sample_period", period));
        }
        if let Some(text) = &self.noise {
            let noise = share("--noise", text)?;
            set.push(Override::value("sensor.noise", noise.into()));
        }
        if let Some(text) = &self.friction {
            let [coulomb, viscous] = friction(text)?;
            set.push(Override::value("arm.friction.coulomb", coulomb.into()));
            set.push(Override::value("arm.friction.viscous", viscous.into()));
        }
        if let Some(text) = &self.latency {
            let latency = Latency::constant(seconds("--latency", text)?);
            let wanted = Wanted {
                time_constant_s: 1.0,
                torque_limit_nm: Vec::new(),
                latency,
                latency_source: LatencySource::Given,
            };
            set.extend(tune::links(&Scenario::load(&self.scenario, &set)?, &wanted, 1.0));
        }
        Ok(set)
    }

    /// The models that every candidate has to do with.
    fn cases(&self, scenario: &Scenario) -> Result<Vec<Vec<Override>>, Failure> {
        let Some(text) = &self.model_error else { return Ok(vec![Vec::new()]) };
        let error = share("--model-error", text)?;
        let own = scenario.law.mass_scale;
        // To twelve digits, so that 0.9 is printed as 0.9.
        let scale = |factor: f64| (own * factor * 1e12).round() * 1e-12;
        let scales = [1.0 - error, 1.0 + error].map(scale);
        let case = |scale: f64| vec![Override::value("law.model.mass_scale", scale.into())];
        Ok(scales.map(case).to_vec())
    }
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|x: &f64| x.is_finite())
}

/// A percentage, or a fraction, that is less than all.
fn share(option: &str, text: &str) -> Result<f64, Failure> {
    let part = match text.trim().strip_suffix('%') {
        // A division, so that 10 % is printed as 0.1.
        Some(percent) => number(percent).map(|percent| percent / 100.0),
        None => number(text),
    };
    part.filter(|part| (0.0..1.0).contains(part)).ok_or_else(|| {
        let expected =
            "a percentage from 0% to less than 100%, like 0.5%, or the same as a fraction";
        Failure::bad_input(format!("{option} {text}: expected {expected}"))
    })
}

/// Coulomb and viscous friction.
fn friction(text: &str) -> Result<[f64; 2], Failure> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| number(part).filter(|x| *x >= 0.0)).collect();
    match numbers.as_deref() {
        Some([coulomb, viscous]) => Ok([*coulomb, *viscous]),
        _ => Err(Failure::bad_input(format!(
            "--friction {text}: expected Coulomb friction in N m and viscous friction in N m s/rad, \
             0 or more, like 2,2"
        ))),
    }
}

/// Why there is no advice.
fn none(advice: &Advice) -> String {
    let of_law = |advised: &Advised| format!("{}: {}", advised.law, in_the_way(advised));
    let reasons: Vec<_> = advice.others.iter().map(of_law).collect();
    format!(
        "no law keeps the limits with any gains that were tried ({}); allow more with \
         --torque-limit or --torque-step-limit, or shorten the latency",
        reasons.join("; ")
    )
}

fn in_the_way(advised: &Advised) -> String {
    match &advised.found {
        Ok(found) => found.limit.to_string(),
        Err(error) => error.to_string(),
    }
}

/// How much larger the error of each law is than the least, as a factor.
fn loss(advice: &Advice, advised: &Advised) -> Option<f64> {
    Some(advised.rms_error_m()? / advice.laws.first()?.rms_error_m()?)
}

/// The value of a gain.
fn value(gain: &Override) -> Value {
    let text = gain.to_string();
    text.split_once('=').and_then(|(_, value)| number(value)).into()
}

fn object(advice: &Advice, source: &str) -> Value {
    let law = |advised: &Advised| {
        let found = advised.found.as_ref().ok();
        let gains: serde_json::Map<String, Value> = found
            .into_iter()
            .flat_map(|found| &found.gains)
            .map(|gain| (gain.path().to_owned(), value(gain)))
            .collect();
        json!({
            "law": advised.law,
            "gains": gains,
            "rms_error_m": advised.rms_error_m(),
            "margin_rms_error_m": found.and_then(|found| found.margin_rms_error_m),
            "over_best": loss(advice, advised),
            "limit": found.map(|found| found.limit.to_string()),
            "error": advised.found.as_ref().err().map(ToString::to_string),
            "report": found.and_then(|found| found.report.as_ref()),
            "command": found.map(|found| &found.command).filter(|command| !command.is_empty()),
        })
    };
    json!({
        "torque_limit_nm": advice.limits.torque_nm,
        "torque_limit_source": source,
        "torque_step_limit_nm": advice.limits.torque_step_nm,
        "laws": advice.laws.iter().map(law).collect::<Vec<_>>(),
        "without_gains": advice.others.iter().map(law).collect::<Vec<_>>(),
    })
}

fn table(advice: &Advice, source: &str) -> String {
    let all = || advice.laws.iter().chain(&advice.others);
    let width = all().map(|advised| advised.law.chars().count()).max().unwrap_or(0);
    let mut text = format!(
        "limits: torque {} N m ({source}), rms torque step {} N m, {} x the latency with at most {} x \
         the error\n\n{:<width$}  {:>10}  {:>10}  {:>7}  limit in the way\n",
        list(&advice.limits.torque_nm),
        advice.limits.torque_step_nm,
        advice.limits.margin,
        advice.limits.growth,
        "law",
        "rms error",
        "at margin",
        "x best"
    );
    let millimetres = |error: Option<f64>| {
        error.map_or_else(|| "-".to_owned(), |error| format!("{:.3} mm", 1e3 * error))
    };
    for advised in all() {
        let margin = advised.found.as_ref().ok().and_then(|found| found.margin_rms_error_m);
        let loss = loss(advice, advised).map_or_else(|| "-".to_owned(), |x| format!("{x:.2}"));
        text += &format!(
            "{:<width$}  {:>10}  {:>10}  {loss:>7}  {}\n",
            advised.law,
            millimetres(advised.rms_error_m()),
            millimetres(margin),
            in_the_way(advised)
        );
    }
    let Some((first, Ok(found))) = advice.laws.first().map(|first| (first, &first.found)) else {
        return text;
    };
    let gains: Vec<_> = found.gains.iter().map(ToString::to_string).collect();
    text += &format!("\nTake {} with {}.\n", first.law, gains.join(", "));
    if let Some(second) = advice.laws.get(1)
        && let Some(loss) = loss(advice, second)
    {
        text += &format!("{} would have {loss:.2} times its error.\n", second.law);
    }
    text + &format!("\n{}\n", found.command)
}

fn list(numbers: &[f64]) -> String {
    let texts: Vec<_> = numbers.iter().map(|number| format!("{number:.4}")).collect();
    let trimmed = texts.iter().map(|text| text.trim_end_matches('0').trim_end_matches('.'));
    trimmed.collect::<Vec<_>>().join(", ")
}
