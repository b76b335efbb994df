//! Torques, and the law's echo and signals on the task axes.

use mtj_model::{
    MAX_JOINTS,
    law::{Description, Per, Signal},
};
use ratatui::{
    buffer::Buffer,
    layout::Rect,
    text::{Line, Span},
    widgets::Widget,
};

use super::{Picture, render_lines, three_digits};
use crate::{
    overview::Overview,
    terminal::{envelope::Range, palette::Tone},
};

/// One bar for each joint: the torque in effect, and the range of the torques that were commanded
/// in the time span of the charts.
pub(super) fn torques(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let overview = &picture.view.overview;
    let safety = picture.view.scenario().map(|scenario| &scenario.safety);
    let limits = safety.and_then(|safety| safety.torque_limit.as_deref());
    let right = if safety.is_some() && limits.is_none() { "no limit" } else { "" };
    let area =
        picture.rule("Torque N m", Line::from(picture.styled(right, Tone::Faint)), area, buf);
    let in_effect = overview.status.map(|status| status.torque);
    let Some(torques) = in_effect.or(overview.torque.map(|torque| torque.torque)) else { return };
    let joints = MAX_JOINTS.min(overview.header().map_or(0, |header| header.joints as usize));
    let [to, from] = [overview.time(), overview.time() - picture.window];
    for ((row, joint), torque) in area.rows().zip(0..joints).zip(torques) {
        let none = Range { min: 0.0, max: 0.0 };
        let commanded = picture
            .view
            .torque
            .get(joint)
            .and_then(|envelope| envelope.range(from, to))
            .unwrap_or(none);
        let limit = limits.and_then(|limits| limits.get(joint)).copied();
        let scale = limit.unwrap_or_else(|| nice(commanded.peak().max(torque.abs())));
        let left = format!("{} {:>6} ", joint + 1, three_digits(torque));
        let right =
            format!(" {}{}", if limit.is_some() { "≤" } else { "±" }, figure_of_scale(scale));
        let is_over = limit.is_some_and(|limit| commanded.peak() > limit);
        let used = (left.chars().count() + right.chars().count()) as u16;
        let Some(width) = row.width.checked_sub(used).filter(|width| *width >= 5) else { continue };
        let mut spans = vec![Span::raw(left)];
        spans.extend(bar(picture, torque / scale, commanded, scale, width));
        spans.push(picture.styled(right, if is_over { Tone::Bad } else { Tone::Faint }));
        Line::from(spans).render(row, buf);
    }
}

/// A bar with zero in the middle: the value solid, the range shaded.
fn bar<'a>(picture: &Picture, value: f64, range: Range, scale: f64, width: u16) -> Vec<Span<'a>> {
    let middle = i32::from(width) / 2;
    let cell = |value: f64| middle + (value.clamp(-1.0, 1.0) * f64::from(middle)).round() as i32;
    let between = |a: i32, b: i32, at: i32| (a.min(b)..=a.max(b)).contains(&at);
    (0..2 * middle + 1)
        .map(|at| {
            if at == middle {
                picture.styled("│", Tone::Strong)
            } else if between(middle, cell(value), at) {
                picture.styled("█", Tone::Force)
            } else if between(cell(range.min / scale), cell(range.max / scale), at) {
                picture.styled("░", Tone::Force)
            } else {
                picture.styled("·", Tone::Faint)
            }
        })
        .collect()
}

/// The next larger of 1, 2, 5, 10, 20 …
fn nice(value: f64) -> f64 {
    let decade = 10f64.powf(value.max(1e-3).log10().floor());
    [1.0, 2.0, 5.0]
        .map(|digit| digit * decade)
        .into_iter()
        .find(|nice| *nice >= value)
        .unwrap_or(10.0 * decade)
}

fn figure_of_scale(value: f64) -> String {
    if value.fract() == 0.0 && value < 1e6 {
        format!("{value:<4.0}")
    } else {
        format!("{value:<4}")
    }
}

/// How many quantities of the law fit beside the tracking error.
const QUANTITIES: usize = 3;

/// The tracking error, the law's echo and its signals on each task axis.
pub(super) fn task(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let area = picture.rule("Task", Line::default(), area, buf);
    axes(picture, area, buf);
}

/// Like [`task`], without a title.
pub(super) fn axes(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let Some(scene) = &picture.view.scene else { return };
    let overview = &picture.view.overview;
    let quantities: Vec<_> = overview.law().map(quantities).into_iter().flatten().collect();
    let mut heading = "  ".to_owned() + &right(&format!("e m{}", scene.task().axes[0].unit));
    heading.extend(quantities.iter().map(|signal| right(&head(signal))));
    let heading = Line::from(picture.styled(heading, Tone::Faint));
    let rows = overview.error.iter().flat_map(|error| {
        scene.task().axes.iter().zip(error.error).enumerate().map(|(i, (axis, error))| {
            let error = right(&three_digits(error * 1e3));
            let mut line = Line::from(vec![
                picture.styled(format!("{:<2}", axis.name), Tone::Faint),
                picture.styled(error, Tone::Tip),
            ]);
            for signal in &quantities {
                let tone = if signal.range.is_some() { Tone::Ok } else { Tone::Force };
                line.push_span(picture.styled(right(&value(overview, signal, i)), tone));
            }
            line
        })
    });
    render_lines(std::iter::once(heading).chain(rows), area, buf);
}

/// The quantities of a law with a number for each axis, those with a range first.
fn quantities(law: &'static Description) -> impl Iterator<Item = &'static Signal> {
    let (gauges, others): (Vec<_>, Vec<_>) =
        law.signals.iter().partition(|signal| signal.range.is_some());
    let all = gauges.into_iter().chain([&law.echo]).chain(others);
    all.filter(|signal| signal.per == Per::Axis).take(QUANTITIES)
}

fn head(signal: &Signal) -> String {
    format!("{} {}", signal.symbol, signal.unit).trim_end().to_owned()
}

/// The value of a law's signal or of its echo on an axis.
fn value(overview: &Overview, signal: &Signal, axis: usize) -> String {
    let of_signal = overview.error.as_ref().and_then(|error| error.signal(signal.key));
    let of_echo = overview.torque.as_ref().map(|torque| &torque.echo[..]);
    let number = of_signal.or(of_echo).and_then(|numbers| numbers.get(axis)).copied();
    let write = if signal.range.is_some() { |number| format!("{number:.3}") } else { three_digits };
    number.map_or_else(|| "–".to_owned(), write)
}

/// Aligns a text to the right end of a column.
fn right(words: &str) -> String {
    " ".repeat(6_usize.saturating_sub(Span::raw(words).width())) + words
}
