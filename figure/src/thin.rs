//! Thinning a curve to what a picture can show.

/// Keeps, of every column of the picture, the first, lowest, highest and last point, so that the
/// drawing looks the same and no peak is lost. A curve that goes back in x, or has no more points
/// than that already, is left alone.
pub(crate) fn thin(points: &[(f64, f64)], from: f64, to: f64, columns: usize) -> Vec<(f64, f64)> {
    let goes_on = points.windows(2).all(|pair| pair[0].0 <= pair[1].0);
    if !goes_on || points.len() <= 4 * columns || to <= from {
        return points.to_vec();
    }
    let column = |x: f64| ((x - from) / (to - from) * columns as f64).floor();
    points
        .chunk_by(|a, b| column(a.0) == column(b.0))
        .flat_map(|chunk| {
            let extreme = |sign: f64| {
                (0..chunk.len())
                    .max_by(|&i, &j| (sign * chunk[i].1).total_cmp(&(sign * chunk[j].1)))
            };
            let mut keep =
                [0, extreme(-1.0).unwrap_or(0), extreme(1.0).unwrap_or(0), chunk.len() - 1];
            keep.sort_unstable();
            let repeated = |i: usize| i > 0 && keep[i] == keep[i - 1];
            (0..4).filter(|&i| !repeated(i)).map(|i| chunk[keep[i]]).collect::<Vec<_>>()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_a_peak_of_a_single_sample() {
        let mut points: Vec<_> = (0..40_000).map(|i| (f64::from(i) * 5e-4, 0.0)).collect();
        points[12_345].1 = 7.0;
        points[23_456].1 = -8.0;
        let thinned = thin(&points, 0.0, 20.0, 300);
        assert!(thinned.len() <= 4 * 300);
        assert!(thinned.contains(&points[12_345]) && thinned.contains(&points[23_456]));
        assert_eq!((thinned[0], thinned[thinned.len() - 1]), (points[0], points[39_999]));
    }

    #[test]
    fn a_closed_path_is_left_alone() {
        let path: Vec<_> = (0..2000).map(|i| f64::from(i).sin_cos()).collect();
        assert_eq!(thin(&path, -1.0, 1.0, 10), path);
    }
}
