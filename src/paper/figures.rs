//! Figs. 1(b) to 5.

use mtj_model::trajectory::Trajectory;
use mtj_plant::{plant::Outcome, trace::TraceRow};

use super::runs::{Runs, RunsError, scenario};
use mtj_figure::lines::{Curve, LineFigure, LinePanel, ValueAxis};

/// The laws of Figs. 4 and 5: ending of the scenario's name, title of the panel.
pub(crate) const LAWS: [(&str, &str); 4] = [
    ("tj", "(a) TJ, high gains"),
    ("mtj", "(b) MTJ"),
    ("mb", "(c) MB, case 1"),
    ("mb-perturbed", "(d) MB, case 2"),
];

const DURATION: f64 = 20.0;

/// Every figure with the name of its files.
pub(crate) fn all(runs: &Runs) -> Result<Vec<(&'static str, LineFigure)>, RunsError> {
    Ok(vec![
        ("fig1b", desired_path(&scenario("fig4-mtj")?.trajectory)),
        (
            "fig2",
            tracking_errors(runs, "fig2", "Fig. 2: Tracking errors, low speed (ω = 0.05 rad/s)")?,
        ),
        (
            "fig3",
            tracking_errors(runs, "fig3", "Fig. 3: Tracking errors, high speed (ω = 2 rad/s)")?,
        ),
        ("fig4", torques_and_errors(runs)?),
        ("fig5", noisy_torques(runs)?),
    ])
}

fn desired_path(trajectory: &Trajectory<f64>) -> LineFigure {
    const POINTS: u32 = 720;
    let turn = std::f64::consts::TAU; // ω = 1 rad/s
    let path = (0..=POINTS).map(|i| {
        let position = trajectory.at::<2>(turn * f64::from(i) / f64::from(POINTS)).point;
        (position[0], position[1])
    });
    LineFigure {
        title: String::new(),
        columns: 1,
        panel_size: (478.0, 476.0),
        panels: vec![LinePanel {
            title: "Fig. 1(b): Desired tracking path".to_owned(),
            x: ValueAxis::new("x (m)", -2.0..2.0),
            y: ValueAxis::new("y (m)", -2.0..2.0),
            curves: vec![Curve::new("", path)],
        }],
    }
}

fn tracking_errors(runs: &Runs, name: &str, title: &str) -> Result<LineFigure, RunsError> {
    let outcomes = [runs.get(&format!("{name}-tj"))?, runs.get(&format!("{name}-mtj"))?];
    let y = symmetric("tracking error (m)", &outcomes, |row| [row.error[0], row.error[1]]);
    let panels = outcomes
        .iter()
        .zip(["(a) TJ", "(b) MTJ"])
        .map(|(outcome, title)| error_panel(outcome, title, &y))
        .collect();
    Ok(LineFigure { title: title.to_owned(), columns: 2, panel_size: (440.0, 300.0), panels })
}

fn torques_and_errors(runs: &Runs) -> Result<LineFigure, RunsError> {
    let outcomes = outcomes(runs, "fig4")?;
    let torque = symmetric("joint torque (N m)", &outcomes, torques);
    let error = symmetric("tracking error (m)", &outcomes, |row| [row.error[0], row.error[1]]);
    let panels = outcomes
        .iter()
        .zip(LAWS)
        .flat_map(|(outcome, (_, title))| {
            [torque_panel(outcome, title, &torque), error_panel(outcome, title, &error)]
        })
        .collect();
    let title = "Fig. 4: Joint torques and tracking errors (ω = 1 rad/s)".to_owned();
    Ok(LineFigure { title, columns: 2, panel_size: (440.0, 250.0), panels })
}

fn noisy_torques(runs: &Runs) -> Result<LineFigure, RunsError> {
    let outcomes = outcomes(runs, "fig5")?;
    let y = symmetric("joint torque (N m)", &outcomes, torques);
    let panels = outcomes
        .iter()
        .zip(LAWS)
        .map(|(outcome, (_, title))| torque_panel(outcome, title, &y))
        .collect();
    let title = "Fig. 5: Joint torques under noisy feedback (ω = 1 rad/s, 2 % noise)".to_owned();
    Ok(LineFigure { title, columns: 2, panel_size: (440.0, 280.0), panels })
}

fn outcomes<'a>(runs: &'a Runs, name: &str) -> Result<Vec<&'a Outcome>, RunsError> {
    LAWS.iter().map(|(law, _)| runs.get(&format!("{name}-{law}"))).collect()
}

fn torques(row: &TraceRow) -> [f64; 2] {
    [row.torque[0], row.torque[1]]
}

fn torque_panel(outcome: &Outcome, title: &str, y: &ValueAxis) -> LinePanel {
    panel(outcome, title, y, ["τ₁", "τ₂"], torques)
}

fn error_panel(outcome: &Outcome, title: &str, y: &ValueAxis) -> LinePanel {
    panel(outcome, title, y, ["e(x)", "e(y)"], |row| [row.error[0], row.error[1]])
}

fn panel(
    outcome: &Outcome,
    title: &str,
    y: &ValueAxis,
    names: [&str; 2],
    values: fn(&TraceRow) -> [f64; 2],
) -> LinePanel {
    let curve = |i: usize| {
        // No torque is in effect before the first command.
        let rows = outcome.trace.iter().skip(1);
        Curve::new(names[i], rows.map(|row| (row.time, values(row)[i])))
    };
    LinePanel {
        title: title.to_owned(),
        x: ValueAxis::new("time (s)", 0.0..DURATION),
        y: y.clone(),
        curves: vec![curve(0), curve(1)],
    }
}

/// One axis, symmetric about zero, for every value of every outcome.
fn symmetric(label: &str, outcomes: &[&Outcome], values: fn(&TraceRow) -> [f64; 2]) -> ValueAxis {
    let rows = outcomes.iter().flat_map(|outcome| &outcome.trace);
    let peak = rows.flat_map(values).map(f64::abs).fold(0.0, f64::max) * 1.05;
    ValueAxis::new(label, -peak..peak)
}

#[cfg(test)]
mod tests {
    use resvg::{tiny_skia::Pixmap, usvg};

    use super::*;
    use mtj_figure::raster;

    #[test]
    fn every_figure_is_a_well_formed_svg_and_a_png_with_something_on_it() {
        let runs = Runs::make(&|| true).unwrap();
        let figures = all(&runs).unwrap();
        assert_eq!(figures.len(), 5);
        for (name, figure) in figures {
            let svg = figure.svg();
            assert!(svg.len() < 500_000, "{name} has {} bytes", svg.len());
            usvg::roxmltree::Document::parse(&svg).unwrap();
            let picture = Pixmap::decode_png(&raster::png(&svg).unwrap()).unwrap();
            let inked = picture.pixels().iter().filter(|p| p.red() < 200 || p.blue() < 200).count();
            assert!(inked > picture.pixels().len() / 200, "{name} is blank");
            let drawn = picture.pixels().iter().filter(|p| p.blue() > p.red().saturating_add(60));
            assert!(drawn.count() > 1000, "{name} has no blue curve");
        }
    }
}
