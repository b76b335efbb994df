//! The colours of the terminal: legible on dark and on light.

use ratatui::style::{Color, Modifier, Style};

/// The styles of all tones, with or without colours.
#[derive(Clone, Copy, Debug)]
pub(super) struct Palette {
    coloured: bool,
}

/// The meaning of a piece of text or a line, which decides its style.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tone {
    /// Rules, units, side remarks.
    Faint,
    /// Headings and values that matter.
    Strong,
    /// The measured tip and the tracking error.
    Tip,
    /// The desired path and point.
    Desired,
    /// The law's primary signal, and good states.
    Ok,
    /// Torques and forces.
    Force,
    /// A change of the running loop.
    Change,
    /// Losses and errors.
    Bad,
    /// The banner of an alarm.
    Alarm,
    /// The banner of a role that is waited for.
    Waiting,
}

impl Palette {
    /// Without colours if NO_COLOR is set to anything (see no-color.org).
    pub(super) fn from_environment() -> Self {
        Self { coloured: std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()) }
    }

    /// With or without colours.
    #[cfg(test)]
    pub(super) fn new(coloured: bool) -> Self {
        Self { coloured }
    }

    /// The style of a tone. Shapes distinguish whatever colours distinguish.
    pub(super) fn style(self, tone: Tone) -> Style {
        let style = match tone {
            Tone::Strong => Style::new().add_modifier(Modifier::BOLD),
            Tone::Bad => Style::new().add_modifier(Modifier::BOLD),
            Tone::Alarm | Tone::Waiting if self.coloured => {
                Style::new().fg(Color::Indexed(231)).add_modifier(Modifier::BOLD)
            }
            Tone::Alarm | Tone::Waiting => {
                Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD)
            }
            _ => Style::new(),
        };
        match tone {
            _ if !self.coloured => style,
            Tone::Alarm => style.bg(Color::Indexed(160)),
            Tone::Waiting => style.bg(Color::Indexed(130)),
            tone => style.fg(self.color(tone)),
        }
    }

    /// The colour of a tone: one of the 256 that look the same in every terminal and theme, with
    /// contrast to black and to white.
    pub(super) fn color(self, tone: Tone) -> Color {
        match tone {
            _ if !self.coloured => Color::Reset,
            Tone::Faint => Color::Indexed(244),
            Tone::Strong => Color::Reset,
            Tone::Tip => Color::Indexed(32),
            Tone::Desired => Color::Indexed(130),
            Tone::Ok => Color::Indexed(29),
            Tone::Force => Color::Indexed(134),
            Tone::Change => Color::Indexed(168),
            Tone::Bad | Tone::Alarm => Color::Indexed(160),
            Tone::Waiting => Color::Indexed(130),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance as WCAG 2 defines it, of a colour of the 6 × 6 × 6 cube or of the grey
    /// ramp.
    fn luminance(index: u8) -> f64 {
        let level = |step: u8| if step == 0 { 0.0 } else { f64::from(step) * 40.0 + 55.0 };
        let rgb = match index {
            16..=231 => {
                let index = index - 16;
                [level(index / 36), level(index / 6 % 6), level(index % 6)]
            }
            232.. => [f64::from(index - 232) * 10.0 + 8.0; 3],
            _ => panic!("{index} looks different in every theme"),
        };
        let linear = rgb.map(|value| {
            let value = value / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    }

    fn contrast(a: f64, b: f64) -> f64 {
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn every_colour_is_legible_on_dark_and_on_light() {
        let palette = Palette::new(true);
        for tone in
            [Tone::Faint, Tone::Tip, Tone::Desired, Tone::Ok, Tone::Force, Tone::Change, Tone::Bad]
        {
            let Color::Indexed(index) = palette.color(tone) else {
                panic!("{tone:?} follows the theme")
            };
            for ground in [0.0, 1.0] {
                // What WCAG asks of large text and of graphics.
                let contrast = contrast(luminance(index), ground);
                assert!(contrast >= 3.0, "{tone:?} on {ground}: {contrast:.2}");
            }
        }
        for tone in [Tone::Alarm, Tone::Waiting] {
            let Style { fg: Some(Color::Indexed(fg)), bg: Some(Color::Indexed(bg)), .. } =
                palette.style(tone)
            else {
                panic!("{tone:?} has a ground of its own")
            };
            assert!(contrast(luminance(fg), luminance(bg)) >= 4.5);
        }
    }

    #[test]
    fn without_colour_a_banner_still_stands_out() {
        let palette = Palette::new(false);
        let style = palette.style(Tone::Alarm);
        assert_eq!((style.fg, style.bg), (None, None));
        assert!(style.add_modifier.contains(Modifier::REVERSED));
    }
}
