//! The desired motion of a scenario.

use std::{path, time::Duration};

use nalgebra::Vector2;
use toml::Table;

use super::{
    error::ScenarioError,
    key::{
        Default::{Required, Value, Words},
        Form, Parameter, Range,
    },
    section::{self, Origin, Section},
};
use crate::{
    spline::{Order, Spline, TimedPoint},
    table,
    trajectory::{Circle, Path, PointToPoint, Ripple, Trajectory},
    transition::Transition,
};

const KIND: Parameter = Parameter::new(
    "trajectory.kind",
    Form::Choice(&["perturbed-circle", "circle", "point-to-point", "file"]),
    "",
    Required,
    "What the tip should do; a perturbed circle is the paper's eq. (18).",
);
const BLEND: Parameter = Parameter::new(
    "trajectory.blend",
    Form::Duration(Duration::from_millis(1)),
    "",
    Value("\"1 s\""),
    "How long the way to a motion takes that is set while the loop runs.",
);
/// The keys of every trajectory.
pub(super) const KEYS: &[&Parameter] = &[&KIND, &BLEND];

const BEGIN: Parameter = Parameter::new(
    "trajectory.transition.begin",
    Form::Number(Range::NotNegative),
    "s",
    Required,
    "When the motion took effect.",
);
const TAKES: Parameter = Parameter::new(
    "trajectory.transition.duration",
    Form::Number(Range::Positive),
    "s",
    Required,
    "How long the way to it takes.",
);
const SHIFT: Parameter = Parameter::new(
    "trajectory.transition.shift",
    Form::Number(Range::Any),
    "s",
    Required,
    "How much later than the run the motion's own time begins.",
);
const OFFSET: Parameter = Parameter::new(
    "trajectory.transition.offset",
    Form::Text("a list of three points [x, y]"),
    "m, m/s, m/s²",
    Required,
    "Motion before − this one at the beginning: point, velocity, acceleration.",
);
/// The keys of a motion that was changed while the loop ran.
pub(super) const TRANSITION_KEYS: &[&Parameter] = &[&BEGIN, &TAKES, &SHIFT, &OFFSET];

const CENTER: Parameter = Parameter::new(
    "trajectory.center",
    Form::Point,
    "m",
    Value("[0.0, 0.0]"),
    "Centre of the circle; the base of the arm is the origin.",
);
const RADIUS: Parameter = Parameter::new(
    "trajectory.radius",
    Form::Number(Range::Positive),
    "m",
    Required,
    "Radius of the circle.",
);
const ANGULAR_FREQUENCY: Parameter = Parameter::new(
    "trajectory.angular_frequency",
    Form::Number(Range::Any),
    "rad/s",
    Required,
    "ω: how fast the circle is gone round, counter-clockwise.",
);
const PHASE: Parameter = Parameter::new(
    "trajectory.phase",
    Form::Number(Range::Any),
    "rad",
    Value("0.0"),
    "Where on the circle the motion begins.",
);
/// The keys of a circle, perturbed or not.
pub(super) const CIRCLE_KEYS: &[&Parameter] = &[&CENTER, &RADIUS, &ANGULAR_FREQUENCY, &PHASE];

const AMPLITUDE: Parameter = Parameter::new(
    "trajectory.ripple.amplitude",
    Form::Number(Range::Any),
    "m",
    Required,
    "Amplitude of the sine that is added to both axes.",
);
const MULTIPLE: Parameter = Parameter::new(
    "trajectory.ripple.multiple",
    Form::Number(Range::Any),
    "",
    Required,
    "Ripples a turn: the frequency of that sine as a multiple of ω.",
);
/// The keys that a perturbed circle has besides.
pub(super) const RIPPLE_KEYS: &[&Parameter] = &[&AMPLITUDE, &MULTIPLE];

const FROM: Parameter =
    Parameter::new("trajectory.from", Form::Point, "m", Required, "Where the motion begins.");
const TO: Parameter =
    Parameter::new("trajectory.to", Form::Point, "m", Required, "Where it ends and rests.");
const DURATION: Parameter = Parameter::new(
    "trajectory.duration",
    Form::Duration(Duration::from_nanos(1)),
    "",
    Required,
    "How long the motion takes, at rest at both ends (a quintic in time).",
);
/// The keys of a motion from point to point.
pub(super) const POINT_TO_POINT_KEYS: &[&Parameter] = &[&FROM, &TO, &DURATION];

const POINTS: Parameter = Parameter::new(
    "trajectory.points",
    Form::Text("a list of [time in s, x in m, y in m], at least two, at times that rise"),
    "",
    Words("those of the file"),
    "The points: a scenario that was loaded has these in place of the file.",
);
const SOURCE: Parameter = Parameter::new(
    "trajectory.file",
    Form::Text("the path of a CSV file"),
    "",
    Words("none where there are points"),
    "A CSV file with the columns time_s, x_m and y_m; relative paths start at the scenario's folder.",
);
const ORDER: Parameter = Parameter::new(
    "trajectory.order",
    Form::Choice(&["cubic", "quintic"]),
    "",
    Value("\"quintic\""),
    "How it goes from point to point, at rest at both ends: quintic begins and ends without a jump of \
     the acceleration.",
);
/// The keys of a motion through points.
pub(super) const FILE_KEYS: &[&Parameter] = &[&SOURCE, &POINTS, &ORDER];

#[derive(Clone, Copy)]
enum Kind {
    PerturbedCircle,
    Circle,
    PointToPoint,
    File,
}

impl Trajectory<f64> {
    /// The motion, and how long the way to it takes if it is set while the loop runs.
    pub(super) fn read(section: Section<'_>) -> Result<(Self, Duration), ScenarioError> {
        let kinds = [Kind::PerturbedCircle, Kind::Circle, Kind::PointToPoint, Kind::File];
        let path = match section.word(&KIND, &kinds)? {
            Kind::Circle => Path::Circle(circle(&section)?),
            Kind::PerturbedCircle => {
                let circle = circle(&section)?;
                Path::PerturbedCircle(circle, ripple(section.section("ripple")?)?)
            }
            Kind::PointToPoint => Path::PointToPoint(PointToPoint {
                from: section.point(&FROM)?.into(),
                to: section.point(&TO)?.into(),
                duration: section.duration(&DURATION)?.as_secs_f64(),
            }),
            Kind::File => {
                // Loading has put the points in its place.
                section.text(&SOURCE, |_| true)?;
                let order = section.word(&ORDER, &[Order::Cubic, Order::Quintic])?;
                Path::Points(section.get(&POINTS, 1, |value| points(value, order))?)
            }
        };
        let transition =
            section.optional_section("transition")?.map(Transition::read).transpose()?;
        let blend = section.duration(&BLEND)?;
        section.finish()?;
        Ok((Self { path, transition }, blend))
    }
}

impl Transition<f64> {
    fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let points = |value: &toml::Value| -> Option<[_; 3]> {
            let points = value.as_array()?.iter().map(|point| section::numbers(point, 2));
            let points = points.collect::<Option<Vec<_>>>()?.try_into().ok()?;
            Some(<[Vec<f64>; 3]>::map(points, |point| Vector2::new(point[0], point[1])))
        };
        let transition = Self {
            begin: section.number(&BEGIN)?,
            duration: section.number(&TAKES)?,
            shift: section.number(&SHIFT)?,
            offset: section.get(&OFFSET, 1, points)?,
        };
        section.finish()?;
        Ok(transition)
    }

    /// Its table, to follow the table of the trajectory.
    pub(super) fn to_toml(self) -> String {
        let Self { begin, duration, shift, offset } = self;
        let [point, velocity, acceleration] =
            offset.map(|point| format!("[{:?}, {:?}]", point.x, point.y));
        format!(
            "\n[{TRANSITION}]\nbegin = {begin:?}\nduration = {duration:?}\nshift = {shift:?}\n\
             offset = [{point}, {velocity}, {acceleration}]\n"
        )
    }
}

const TRANSITION: &str = "trajectory.transition";

/// Takes the transition out of a scenario's table.
pub(super) fn remove_transition(root: &mut Table) {
    if let Some(table) = root.get_mut("trajectory").and_then(toml::Value::as_table_mut) {
        table.remove("transition");
    }
}

/// The motion through the points of a list.
fn points(value: &toml::Value, order: Order) -> Option<Spline> {
    let points = value.as_array()?.iter().map(|point| section::numbers(point, 3)?.try_into().ok());
    Spline::through(&points.collect::<Option<Vec<TimedPoint>>>()?, order)
}

/// The most points of a file: what a plant offers to the other roles has to hold them.
const MOST_POINTS: usize = 1000;

/// Puts the points of the file that a scenario's table names in the file's place, so that a scenario
/// that travels needs no file; returns whether there was one.
pub(super) fn load_points(root: &mut Table, origin: &Origin) -> Result<bool, ScenarioError> {
    let Some(table) = root.get_mut("trajectory").and_then(toml::Value::as_table_mut) else {
        return Ok(false);
    };
    let Some(file) = table.get(SOURCE.name()).and_then(toml::Value::as_str) else {
        return Ok(false);
    };
    let path = origin.folder().join(file);
    let read = read_points(&path);
    let found = read.map_err(|reason| origin.refuse(format!("trajectory.file: {reason}")))?;
    table.remove(SOURCE.name());
    table.insert(POINTS.name().to_owned(), found);
    Ok(true)
}

/// The points of a CSV file, or what is wrong with it.
fn read_points(path: &path::Path) -> Result<toml::Value, String> {
    let named = |reason: String| format!("{}: {reason}", path.display());
    let table = table::Table::read(path).map_err(|error| named(error.to_string()))?;
    let column = |title: &str| {
        table.column(title).ok_or_else(|| {
            let found = table.titles();
            named(format!(
                "expected the columns time_s, x_m and y_m in the first line, found {found}"
            ))
        })
    };
    let numbers = |title: &str| -> Result<Vec<f64>, String> {
        let number = |(line, cell): (u64, &str)| {
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| {
                named(format!("line {line}: '{cell}' is not accepted: expected a number"))
            })
        };
        table.cells(column(title)?).map(number).collect()
    };
    let (times, xs, ys) = (numbers("time_s")?, numbers("x_m")?, numbers("y_m")?);
    if times.len() > MOST_POINTS {
        return Err(named(format!("expected at most {MOST_POINTS} points, found {}", times.len())));
    }
    let rows = times.into_iter().zip(xs).zip(ys).map(|((time, x), y)| [time, x, y]);
    Ok(rows.map(|row| toml::Value::from(row.to_vec())).collect::<Vec<_>>().into())
}

fn circle(section: &Section<'_>) -> Result<Circle<f64>, ScenarioError> {
    Ok(Circle {
        center: section.point(&CENTER)?.into(),
        radius: section.number(&RADIUS)?,
        angular_frequency: section.number(&ANGULAR_FREQUENCY)?,
        phase: section.number(&PHASE)?,
    })
}

fn ripple(section: Section<'_>) -> Result<Ripple<f64>, ScenarioError> {
    let amplitude = section.number(&AMPLITUDE)?;
    let ripple = Ripple { amplitude, multiple: section.number(&MULTIPLE)? };
    section.finish()?;
    Ok(ripple)
}
