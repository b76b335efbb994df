//! Colours for numbers.

/// Viridis, perceptually uniform and safe for colour-blind readers, at equal distances.
const ANCHORS: [(u8, u8, u8); 10] = [
    (68, 1, 84),
    (72, 40, 120),
    (62, 73, 137),
    (49, 104, 142),
    (38, 130, 142),
    (31, 158, 137),
    (53, 183, 121),
    (110, 206, 88),
    (181, 222, 43),
    (253, 231, 37),
];

/// The colour at a part of the way from 0 to 1, as `#rrggbb`.
pub(crate) fn viridis(part: f64) -> String {
    let at = part.clamp(0.0, 1.0) * (ANCHORS.len() - 1) as f64;
    let below = (at.floor() as usize).min(ANCHORS.len() - 2);
    let rest = at - below as f64;
    let mix = |a: u8, b: u8| (f64::from(a) + rest * (f64::from(b) - f64::from(a))).round() as u8;
    let (a, b) = (ANCHORS[below], ANCHORS[below + 1]);
    format!("#{:02x}{:02x}{:02x}", mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}
