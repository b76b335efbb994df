//! Charts over time.

use mtj_model::law::Signal;
use ratatui::{
    buffer::Buffer,
    layout::Rect,
    symbols::Marker,
    text::Line,
    widgets::{Axis, Chart, Dataset, GraphType, Widget},
};

use super::Picture;
use crate::{
    overview::primary_signal,
    terminal::{
        envelope::{Envelope, Range},
        palette::Tone,
    },
};

/// Smaller errors are drawn as this one, because a logarithmic axis has no zero, m.
const SMALLEST_ERROR: f64 = 1e-9;
/// A gap longer than this, s, and than three sample periods interrupts a line.
const GAP: f64 = 0.5;

/// Tracking error, on a logarithmic scale.
pub(super) fn error(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let [from, to] = window(picture);
    let range = picture.view.error.range(from, to);
    let newest = picture.view.tip_error();
    let right = match (newest, range) {
        (Some(newest), Some(range)) => Line::from(vec![
            picture.styled(format!("{newest:.2e} m"), Tone::Tip),
            picture.styled(format!("  peak {:.1e}", range.max), Tone::Faint),
        ]),
        _ => Line::default(),
    };
    let area = picture.rule("Tracking error", right, area, buf);
    let log = |value: f64| value.max(SMALLEST_ERROR).log10();
    let (min, max) = range.map_or((-3.0, -2.0), |range| (log(range.min), log(range.max)));
    let decades = Decades::around(min, max, area.height);
    let mut lines = lines(picture, &picture.view.error, area);
    for point in lines.iter_mut().flatten() {
        point.1 = log(point.1);
    }
    let plot = Plot { lines, tone: Tone::Tip, y: decades.bounds(), labels: decades.labels() };
    plot.render(picture, area, buf);
}

/// The law's primary signal.
pub(super) fn signal(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let now = picture.view.overview.law().and_then(primary_signal);
    let shown = now.or(picture.view.signal_description);
    let [from, to] = window(picture);
    let range = picture.view.signal.range(from, to);
    let title =
        shown.map_or("Signal".to_owned(), |signal| format!("{} {}", signal.title, signal.symbol));
    let area = picture.rule(&title, values(picture, now, range), area, buf);
    let [low, high] = shown.and_then(|signal| signal.range).unwrap_or([0.0, 1.0]);
    let (low, high) = range.map_or((low, high), |range| (low.min(range.min), high.max(range.max)));
    // A margin, so that a line along the end of the range is visible.
    let margin = 0.04 * (high - low);
    let plot = Plot {
        lines: lines(picture, &picture.view.signal, area),
        tone: Tone::Ok,
        y: [low - margin, high + margin],
        labels: [low, high].map(super::three_digits).to_vec(),
    };
    plot.render(picture, area, buf);
}

/// The newest values of a signal and the lowest in the time span of the charts, or that the law has
/// no such signal.
fn values<'a>(picture: &Picture, signal: Option<&Signal>, range: Option<Range>) -> Line<'a> {
    let overview = &picture.view.overview;
    let Some(signal) = signal else {
        let none = overview.law().map(|law| format!("{} has none", law.name));
        return picture.styled(none.unwrap_or_default(), Tone::Faint).into();
    };
    let newest = overview.error.as_ref().and_then(|error| error.signal(signal.key));
    let (Some(newest), Some(range)) = (newest, range) else { return Line::default() };
    let newest: Vec<_> = newest.iter().map(|number| format!("{number:.3}")).collect();
    Line::from(vec![
        picture.styled(newest.join(" "), Tone::Ok),
        picture.styled(format!("  lowest {:.3}", range.min), Tone::Faint),
    ])
}

/// The time span of the charts: it fills from the left, then moves on.
fn window(picture: &Picture) -> [f64; 2] {
    let from = (picture.view.overview.time() - picture.window).max(0.0);
    [from, from + picture.window]
}

fn lines(picture: &Picture, envelope: &Envelope, area: Rect) -> Vec<Vec<(f64, f64)>> {
    let [from, to] = window(picture);
    let period =
        picture.view.scenario().map_or(0.0, |scenario| scenario.timing.sample_period.as_secs_f64());
    envelope.lines(from, to, 2 * usize::from(area.width), GAP.max(3.0 * period))
}

/// A logarithmic axis from one power of ten to another.
struct Decades {
    lowest: i32,
    highest: i32,
    step: i32,
}

impl Decades {
    fn around(min: f64, max: f64, height: u16) -> Self {
        let lowest = min.floor() as i32;
        let highest = (max.ceil() as i32).max(lowest + 1);
        // A label at each power of ten if each has two rows; otherwise at both ends.
        let is_roomy = 2 * (highest - lowest) < i32::from(height);
        Self { lowest, highest, step: if is_roomy { 1 } else { highest - lowest } }
    }

    fn bounds(&self) -> [f64; 2] {
        [f64::from(self.lowest), f64::from(self.highest)]
    }

    fn labels(&self) -> Vec<String> {
        let powers = (self.lowest..=self.highest).step_by(self.step as usize);
        powers.map(|power| format!("1e{power}")).collect()
    }
}

struct Plot {
    lines: Vec<Vec<(f64, f64)>>,
    tone: Tone,
    y: [f64; 2],
    labels: Vec<String>,
}

impl Plot {
    fn render(&self, picture: &Picture, area: Rect, buf: &mut Buffer) {
        // A chart without its axis tells nothing.
        if area.height < 3 {
            return;
        }
        let [from, to] = window(picture);
        let changes = self.change_lines(picture, area);
        let faint = picture.palette.style(Tone::Faint);
        let dataset = |points, graph_type, tone| {
            Dataset::default()
                .data(points)
                .marker(Marker::Braille)
                .graph_type(graph_type)
                .style(picture.palette.style(tone))
        };
        let mut datasets = vec![dataset(&changes, GraphType::Scatter, Tone::Change)];
        datasets.extend(self.lines.iter().map(|line| dataset(line, GraphType::Line, self.tone)));
        let times = [from, f64::midpoint(from, to), to].map(|time| format!("{time:.0} s"));
        let labels = self.labels.iter().map(|label| Line::from(label.clone()));
        Chart::new(datasets)
            .x_axis(Axis::default().bounds([from, to]).labels(times).style(faint))
            .y_axis(Axis::default().bounds(self.y).labels(labels).style(faint))
            .render(area, buf);
    }

    /// Dotted vertical lines at the times of changes.
    fn change_lines(&self, picture: &Picture, area: Rect) -> Vec<(f64, f64)> {
        let [low, high] = self.y;
        let dots = 2 * area.height;
        let changes = picture.view.overview.changes.iter().filter(|change| change.accepted == 1);
        let times = changes.map(|change| change.header.time_ns as f64 * 1e-9);
        times
            .flat_map(|time| {
                (0..=dots).map(move |i| (time, low + (high - low) * f64::from(i) / f64::from(dots)))
            })
            .collect()
    }
}
