//! What the loop makes the arm do: torques, task force and memory.

use mtj_model::{MAX_AXES, MAX_JOINTS};
use ratatui::{
    buffer::Buffer,
    layout::Rect,
    text::{Line, Span},
    widgets::Widget,
};

use super::{Picture, figure, stack};
use crate::terminal::{palette::Ink, track::Range};

/// A bar for each joint: the torque in effect, and what was commanded in the time of the charts.
pub fn torques(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let overview = &picture.view.overview;
    let limits = picture.view.scenario().map_or(&[][..], |scenario| &scenario.safety.torque_limit);
    let is_limited = limits.iter().any(|limit| limit.is_finite());
    let right = if is_limited || limits.is_empty() { "" } else { "no limit" };
    let area = picture.rule("Torque N m", Line::from(picture.ink(right, Ink::Faint)), area, buf);
    let in_effect = overview.status.map(|status| status.torque);
    let Some(torques) = in_effect.or(overview.torque.map(|torque| torque.torque)) else { return };
    let joints = MAX_JOINTS.min(overview.header().map_or(0, |header| header.joints as usize));
    let [to, from] = [overview.time(), overview.time() - picture.window];
    for ((row, joint), torque) in area.rows().zip(0..joints).zip(torques) {
        let none = Range { min: 0.0, max: 0.0 };
        let commanded =
            picture.view.torque.get(joint).and_then(|track| track.range(from, to)).unwrap_or(none);
        let limit = limits.get(joint).copied().filter(|limit| limit.is_finite());
        let scale = limit.unwrap_or_else(|| nice(commanded.peak().max(torque.abs())));
        let left = format!("{} {:>6} ", joint + 1, figure(torque));
        let right =
            format!(" {}{}", if limit.is_some() { "≤" } else { "±" }, figure_of_scale(scale));
        let is_over = limit.is_some_and(|limit| commanded.peak() > limit);
        let used = (left.chars().count() + right.chars().count()) as u16;
        let Some(width) = row.width.checked_sub(used).filter(|width| *width >= 5) else { continue };
        let mut spans = vec![Span::raw(left)];
        spans.extend(bar(picture, torque / scale, commanded, scale, width));
        spans.push(picture.ink(right, if is_over { Ink::Bad } else { Ink::Faint }));
        Line::from(spans).render(row, buf);
    }
}

/// A bar about a middle: the value solid, the range shaded.
fn bar<'a>(picture: &Picture, value: f64, range: Range, scale: f64, width: u16) -> Vec<Span<'a>> {
    let middle = i32::from(width) / 2;
    let cell = |value: f64| middle + (value.clamp(-1.0, 1.0) * f64::from(middle)).round() as i32;
    let between = |a: i32, b: i32, at: i32| (a.min(b)..=a.max(b)).contains(&at);
    (0..2 * middle + 1)
        .map(|at| {
            if at == middle {
                picture.ink("│", Ink::Strong)
            } else if between(middle, cell(value), at) {
                picture.ink("█", Ink::Force)
            } else if between(cell(range.min / scale), cell(range.max / scale), at) {
                picture.ink("░", Ink::Force)
            } else {
                picture.ink("·", Ink::Faint)
            }
        })
        .collect()
}

/// The next of 1, 2, 5, 10, 20 …
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

const AXES: [&str; MAX_AXES] = ["x", "y", "z", "4", "5", "6"];

/// Error, factor, force and memory on each task axis.
pub fn task(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let area = picture.rule("Task", Line::default(), area, buf);
    let heading = format!("{:<2}{:>6}{:>6}{:>6}{:>6}", "", "e mm", "k", "Q N", "h N");
    let heading = Line::from(picture.ink(heading, Ink::Faint));
    stack([heading].into_iter().chain(rows(picture)), area, buf);
}

/// The same without a title.
pub fn axes(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let heading = format!("{:<2}{:>6}{:>6}{:>6}{:>6}", "", "e mm", "k", "Q N", "h N");
    let heading = picture.ink(heading, Ink::Faint);
    stack([Line::from(heading)].into_iter().chain(rows(picture)), area, buf);
}

fn rows<'a>(picture: &Picture) -> Vec<Line<'a>> {
    let overview = &picture.view.overview;
    let Some(error) = &overview.error else { return Vec::new() };
    let force = overview.torque.map(|torque| torque.force).unwrap_or_default();
    (0..MAX_AXES.min(error.header.axes as usize))
        .map(|axis| {
            Line::from(vec![
                picture.ink(format!("{:<2}", AXES[axis]), Ink::Faint),
                picture.ink(format!("{:>6}", figure(error.error[axis] * 1e3)), Ink::Tip),
                picture.ink(format!("{:>6.3}", error.factor[axis]), Ink::Well),
                picture.ink(format!("{:>6}", figure(force[axis])), Ink::Force),
                picture.ink(format!("{:>6}", figure(error.memory[axis])), Ink::Force),
            ])
        })
        .collect()
}
