//! The colours of the terminal, in the middle between dark and light.

use ratatui::style::{Color, Modifier, Style};

/// The colours, or none of them.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    coloured: bool,
}

/// What something is, which decides how it looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Rules, units, what is not asked for at the moment.
    Faint,
    /// Headings and values that matter.
    Strong,
    /// The measured tip and the tracking error.
    Tip,
    /// The desired path and point.
    Desired,
    /// The law's gauge, and all that is well.
    Ok,
    /// Torques and forces.
    Force,
    /// A knob that was turned.
    Mark,
    /// What should not be.
    Bad,
    /// A banner about what should not be.
    Alarm,
    /// A banner about what is waited for.
    Waiting,
}

impl Palette {
    /// Without colour if NO_COLOR is set to anything (see no-color.org).
    pub fn from_environment() -> Self {
        Self { coloured: std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()) }
    }

    /// With or without colours.
    #[cfg(test)]
    pub fn new(coloured: bool) -> Self {
        Self { coloured }
    }

    /// How something looks. What is told apart by colour is told apart by its shape too.
    pub fn style(self, ink: Ink) -> Style {
        let style = match ink {
            Ink::Strong => Style::new().add_modifier(Modifier::BOLD),
            Ink::Bad => Style::new().add_modifier(Modifier::BOLD),
            Ink::Alarm | Ink::Waiting if self.coloured => {
                Style::new().fg(Color::Indexed(231)).add_modifier(Modifier::BOLD)
            }
            Ink::Alarm | Ink::Waiting => {
                Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD)
            }
            _ => Style::new(),
        };
        match ink {
            _ if !self.coloured => style,
            Ink::Alarm => style.bg(Color::Indexed(160)),
            Ink::Waiting => style.bg(Color::Indexed(130)),
            ink => style.fg(self.color(ink)),
        }
    }

    /// Of a line that is drawn. From the 256 colours that look the same in every terminal, whatever
    /// theme it has, those that stand out from black and from white alike.
    pub fn color(self, ink: Ink) -> Color {
        match ink {
            _ if !self.coloured => Color::Reset,
            Ink::Faint => Color::Indexed(244),
            Ink::Strong => Color::Reset,
            Ink::Tip => Color::Indexed(32),
            Ink::Desired => Color::Indexed(130),
            Ink::Ok => Color::Indexed(29),
            Ink::Force => Color::Indexed(134),
            Ink::Mark => Color::Indexed(168),
            Ink::Bad | Ink::Alarm => Color::Indexed(160),
            Ink::Waiting => Color::Indexed(130),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance as WCAG 2 defines it, of a colour of the 6 × 6 × 6 cube or of the grey ramp.
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
        for ink in [Ink::Faint, Ink::Tip, Ink::Desired, Ink::Ok, Ink::Force, Ink::Mark, Ink::Bad] {
            let Color::Indexed(index) = palette.color(ink) else {
                panic!("{ink:?} follows the theme")
            };
            for ground in [0.0, 1.0] {
                // What WCAG asks of large text and of graphics.
                let contrast = contrast(luminance(index), ground);
                assert!(contrast >= 3.0, "{ink:?} on {ground}: {contrast:.2}");
            }
        }
        for ink in [Ink::Alarm, Ink::Waiting] {
            let Style { fg: Some(Color::Indexed(fg)), bg: Some(Color::Indexed(bg)), .. } =
                palette.style(ink)
            else {
                panic!("{ink:?} has a ground of its own")
            };
            assert!(contrast(luminance(fg), luminance(bg)) >= 4.5);
        }
    }

    #[test]
    fn without_colour_a_banner_still_stands_out() {
        let palette = Palette::new(false);
        let style = palette.style(Ink::Alarm);
        assert_eq!((style.fg, style.bg), (None, None));
        assert!(style.add_modifier.contains(Modifier::REVERSED));
    }
}
