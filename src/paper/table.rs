//! The paper's numbers beside ours.

use mtj_plant::{report::Report, trace::TraceRow};

use super::{
    comparison::Comparison,
    figures::LAWS,
    operations::{Counts, Formula, printed},
    runs::{Runs, RunsError},
};

/// Statements without a number, and what the numbers leave open.
pub(crate) const NOT_REPRODUCIBLE: [&str; 6] = [
    "The curves of the figures are published only as pictures, so they can be compared by eye only.",
    "'About five times smaller' is read off Fig. 4; neither the measure nor the time span is given. \
     Here errors count over the second half of the run, when the initial error has died away.",
    "The paper does not say how often its white noise is drawn. Here it is drawn anew for every \
     sample, each 0.5 ms. With any sample period from 0.25 to 2 ms mtj's torque step stays 4.5 to \
     4.7 times that of MB case 1; its noisy error moves between 4.9 and 7.1 mm.",
    "The integrator's step, the run's length and the places of the centres of mass are not printed. \
     20 s, centres at mid-link and feedback each 0.5 ms give the printed energies within 1 %.",
    "Energy (d) is printed as 154 J: which mass properties are perturbed by 10 %, and in which \
     direction, is not. Here all masses and inertias of the controller's model are 10 % too large.",
    "Words are judged by a number: 'fairly similar' errors are less than 1 mm apart, 'almost' equal \
     quantities within a factor of two, and 'about the same' torques are shown without a verdict.",
];

/// Up to this ratio two numbers count as almost the same.
const ALMOST: f64 = 2.0;
/// Up to this difference two tracking errors count as fairly similar, m.
const SIMILAR: f64 = 1e-3;

/// Energies of Fig. 4, (a) to (d), J.
pub(crate) const PRINTED_ENERGIES: [f64; 4] = [153.0, 156.0, 153.0, 154.0];

/// Every statement of section 4 that has a number, and Table 1.
pub(crate) fn compare(runs: &Runs, counts: &[Counts]) -> Result<Vec<Comparison>, RunsError> {
    let mut all = low_and_high_speed(runs)?;
    all.extend(fig4(runs)?);
    all.extend(fig5(runs)?);
    all.extend(table1(counts));
    Ok(all)
}

fn low_and_high_speed(runs: &Runs) -> Result<Vec<Comparison>, RunsError> {
    let (slow_tj, slow_mtj) = (report(runs, "fig2-tj")?, report(runs, "fig2-mtj")?);
    let (fast_tj, fast_mtj) = (report(runs, "fig3-tj")?, report(runs, "fig3-mtj")?);
    let peak = |name| Ok::<_, RunsError>(peak_of(&runs.get(name)?.trace, |row| row.error[1]));
    let (peak_tj, peak_mtj) = (peak("fig2-tj")?, peak("fig2-mtj")?);
    let (rise, slow) = (peak_tj / peak_mtj, rms(slow_tj) / rms(slow_mtj));
    let fast = rms(fast_tj) / rms(fast_mtj);
    let difference = (rms(slow_tj) - rms(slow_mtj)).abs();
    Ok(vec![
        claim(
            "Fig. 2  rms error, TJ and MTJ",
            "fairly similar",
            format!("{:.2} and {:.2} mm, {slow:.1} to 1", mm(slow_tj), mm(slow_mtj)),
            difference < SIMILAR,
            slow,
        ),
        claim(
            "Fig. 2  peak |e(y)| of the whole run, TJ to MTJ",
            "higher for TJ",
            format!("{:.1} to {:.1} mm, {rise:.2} to 1", peak_tj * 1e3, peak_mtj * 1e3),
            rise > 1.0,
            rise,
        ),
        claim(
            "Fig. 3  rms error, TJ to MTJ",
            "smaller for MTJ",
            format!("{:.1} to {:.1} mm, {fast:.2} to 1", mm(fast_tj), mm(fast_mtj)),
            fast > 1.0,
            fast,
        ),
    ])
}

fn fig4(runs: &Runs) -> Result<Vec<Comparison>, RunsError> {
    let mut all = Vec::new();
    for ((law, title), printed) in LAWS.iter().zip(PRINTED_ENERGIES) {
        let energy = report(runs, &format!("fig4-{law}"))?.energy_j.unwrap_or(f64::NAN);
        all.push(Comparison {
            quantity: format!("Fig. 4  energy {title}"),
            printed: format!("{printed:.0} J"),
            ours: format!("{energy:.1} J"),
            deviation: percent(energy / printed),
            value: energy,
        });
    }
    for (law, title) in LAWS {
        let report = report(runs, &format!("fig4-{law}"))?;
        let peak = report.peak_torque_nm.iter().copied().fold(0.0, f64::max);
        all.push(Comparison {
            quantity: format!("Fig. 4  peak joint torque {title}"),
            printed: "about the same".to_owned(),
            ours: format!("{peak:.1} N m"),
            deviation: "-".to_owned(),
            value: peak,
        });
    }
    let (tj, mtj) = (report(runs, "fig4-tj")?, report(runs, "fig4-mtj")?);
    let ratio_of = |name: &str, ratio: f64, ours: String| Comparison {
        quantity: format!("Fig. 4  {name} error, TJ to MTJ"),
        printed: "about 5 to 1".to_owned(),
        ours,
        deviation: percent(ratio / 5.0),
        value: ratio,
    };
    let ratio = rms(tj) / rms(mtj);
    all.push(ratio_of(
        "rms",
        ratio,
        format!("{:.2} to {:.2} mm, {ratio:.2} to 1", mm(tj), mm(mtj)),
    ));
    let peak = |report: &Report| report.peak_error_m.unwrap_or(f64::NAN);
    let ratio = peak(tj) / peak(mtj);
    let ours = format!("{:.2} to {:.2} mm, {ratio:.2} to 1", peak(tj) * 1e3, peak(mtj) * 1e3);
    all.push(ratio_of("peak", ratio, ours));
    let perturbed = report(runs, "fig4-mb-perturbed")?;
    let ratio = rms(perturbed) / rms(mtj);
    all.push(claim(
        "Fig. 4  rms error, MB case 2 to MTJ",
        "better for MTJ",
        format!("{:.2} to {:.2} mm, {ratio:.2} to 1", mm(perturbed), mm(mtj)),
        ratio > 1.0,
        ratio,
    ));
    Ok(all)
}

fn fig5(runs: &Runs) -> Result<Vec<Comparison>, RunsError> {
    let roughness = |law: &str| {
        Ok::<_, RunsError>(
            report(runs, &format!("fig5-{law}"))?.torque_step_rms_nm.unwrap_or(f64::NAN),
        )
    };
    let perfect = roughness("mb")?;
    let mut all = Vec::new();
    let printed = ["poorer", "almost as smooth", "", "poor"];
    for ((law, title), printed) in LAWS.iter().zip(printed) {
        let step = roughness(law)?;
        let ratio = step / perfect;
        let holds = match *law {
            "mtj" => ratio < ALMOST,
            "mb" => continue, // The measure of the others.
            _ => ratio > roughness("mtj")? / perfect,
        };
        all.push(claim(
            &format!("Fig. 5  rms torque step {title}, to MB case 1"),
            printed,
            format!("{step:.2} N m, {ratio:.1} to 1"),
            holds,
            ratio,
        ));
    }
    for (law, title) in LAWS {
        let noisy = report(runs, &format!("fig5-{law}"))?;
        let clean = report(runs, &format!("fig4-{law}"))?;
        let ratio = rms(noisy) / rms(clean);
        all.push(claim(
            &format!("Fig. 5  rms error {title}, noisy to clean"),
            "almost the same",
            format!("{:.2} to {:.2} mm, {ratio:.2} to 1", mm(noisy), mm(clean)),
            (0.5..=ALMOST).contains(&ratio),
            ratio,
        ));
    }
    Ok(all)
}

fn table1(counts: &[Counts]) -> Vec<Comparison> {
    let row = |name: &str, formula: &Formula, ours: &dyn Fn(&Counts) -> u64| {
        let difference = |c: &Counts| ours(c) as i64 - (formula.at)(c.n) as i64;
        let values = |value: &dyn Fn(&Counts) -> String| {
            counts.iter().map(value).collect::<Vec<_>>().join(" ")
        };
        let equal = counts.iter().all(|c| difference(c) == 0);
        Comparison {
            quantity: format!("Table 1 {name}"),
            printed: formula.text.to_owned(),
            ours: values(&|c| ours(c).to_string()),
            deviation: if equal {
                "0".to_owned()
            } else {
                values(&|c| format!("{:+}", difference(c)))
            },
            value: counts.iter().map(difference).map(|d| d as f64).sum(),
        }
    };
    let mtj = |c: &Counts| c.mtj_without_norms().multiplications + c.mtj_without_norms().divisions;
    vec![
        row("TJ multiplications", &printed::TJ_MULTIPLICATIONS, &|c| c.tj.multiplications),
        row("TJ additions", &printed::TJ_ADDITIONS, &|c| c.tj.additions),
        row("MTJ multiplications, table's formula", &printed::MTJ_MULTIPLICATIONS_TABLE, &mtj),
        row("MTJ multiplications, text's formula", &printed::MTJ_MULTIPLICATIONS_TEXT, &mtj),
        row("MTJ additions", &printed::MTJ_ADDITIONS, &|c| c.mtj_without_norms().additions),
        row("MB multiplications, with J̇ times q̇", &printed::MB_MULTIPLICATIONS, &|c| {
            c.mb_from_jacobian_rate().multiplications
        }),
        row("MB additions, with J̇ times q̇", &printed::MB_ADDITIONS, &|c| {
            c.mb_from_jacobian_rate().additions
        }),
    ]
}

fn claim(quantity: &str, printed: &str, ours: String, holds: bool, value: f64) -> Comparison {
    Comparison {
        quantity: quantity.to_owned(),
        printed: printed.to_owned(),
        ours,
        deviation: if holds { "holds" } else { "does not hold" }.to_owned(),
        value,
    }
}

fn report<'a>(runs: &'a Runs, name: &str) -> Result<&'a Report, RunsError> {
    Ok(&runs.get(name)?.report)
}

fn rms(report: &Report) -> f64 {
    report.rms_error_m.unwrap_or(f64::NAN)
}

fn mm(report: &Report) -> f64 {
    rms(report) * 1e3
}

fn peak_of(trace: &[TraceRow], value: fn(&TraceRow) -> f64) -> f64 {
    trace.iter().map(value).map(f64::abs).fold(0.0, f64::max)
}

fn percent(ratio: f64) -> String {
    format!("{:+.1} %", (ratio - 1.0) * 100.0)
}

#[cfg(test)]
mod tests {
    use mtj_model::scenario::Scenario;

    use super::*;
    use mtj_study::experiment;

    use crate::paper::operations::count_all;

    #[test]
    fn the_energies_are_within_one_percent_of_the_printed_ones() {
        let runs = Runs::make(&|| true).unwrap();
        for ((law, _), printed) in LAWS.iter().zip(PRINTED_ENERGIES) {
            let energy = report(&runs, &format!("fig4-{law}")).unwrap().energy_j.unwrap();
            assert!((energy / printed - 1.0).abs() < 0.01, "{law}: {energy} J");
        }
    }

    #[test]
    fn the_errors_are_within_two_percent_of_an_independent_program() {
        let runs = Runs::make(&|| true).unwrap();
        for ((law, _), expected) in LAWS.iter().zip([8.37e-3, 1.43e-3, 1.25e-4, 2.21e-3]) {
            let error = rms(report(&runs, &format!("fig4-{law}")).unwrap());
            assert!((error / expected - 1.0).abs() < 0.02, "{law}: {error} m");
        }
    }

    #[test]
    fn how_much_rougher_mtj_is_than_mb_does_not_depend_on_how_often_noise_is_drawn() {
        let step = |law: &str, period: &str| {
            let set = [format!("timing.sample_period={period}").parse().unwrap()];
            let scenario = Scenario::load(&format!("paper/fig5-{law}"), &set).unwrap();
            let outcome = experiment::run_direct(&scenario, false, &|| true).unwrap();
            outcome.report.torque_step_rms_nm.unwrap()
        };
        for period in ["0.5 ms", "1 ms", "2 ms"] {
            let ratio = step("mtj", period) / step("mb", period);
            assert!((4.3..4.8).contains(&ratio), "{period}: {ratio}");
        }
    }

    #[test]
    fn every_row_of_the_comparison_has_a_number() {
        let runs = Runs::make(&|| true).unwrap();
        let rows = compare(&runs, &count_all()).unwrap();
        assert!(rows.iter().all(|row| row.value.is_finite()));
        assert!(rows.iter().all(|row| !row.ours.is_empty() && !row.deviation.is_empty()));
    }
}
