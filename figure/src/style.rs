//! How curves are told apart.

/// Colours that stay apart for colour-blind readers and in grey print (after Okabe and Ito).
const COLORS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#7a5195", "#5c5c5c"];
/// Strokes, as SVG writes them.
const DASHES: [&str; 4] = ["none", "7 3", "2 2.5", "9 3 2 3"];
/// Markers about the origin, as SVG paths.
const MARKERS: [&str; 4] = [
    "m-2.4 0a2.4 2.4 0 1 0 4.8 0a2.4 2.4 0 1 0-4.8 0z",
    "m-2.4-2.4h4.8v4.8h-4.8z",
    "m0-3.4l3.2 5.6h-6.4z",
    "m0-3.5l3.5 3.5l-3.5 3.5l-3.5-3.5z",
];

/// Colour, stroke and marker of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Style {
    pub(crate) color: &'static str,
    pub(crate) dash: &'static str,
    pub(crate) marker: &'static str,
}

impl Style {
    /// The style of the `index`-th curve of a panel. The first eight differ in colour, the next in
    /// stroke and marker besides; no two of 128 are the same.
    pub(crate) fn of(index: usize) -> Self {
        let (colors, group) = (COLORS.len(), index / COLORS.len());
        Self {
            color: COLORS[index % colors],
            dash: DASHES[group % DASHES.len()],
            marker: MARKERS[(group + group / DASHES.len()) % MARKERS.len()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_of_128_curves_look_the_same() {
        let styles: std::collections::HashSet<_> = (0..128).map(Style::of).collect();
        assert_eq!(styles.len(), 128);
        let strokes = (0..32).map(|i| (Style::of(i).color, Style::of(i).dash));
        assert_eq!(strokes.collect::<std::collections::HashSet<_>>().len(), 32);
    }
}
