//! The line beneath all points that is nearest to them.

/// Of all lines that no point lies beneath, the one with the least sum of heights of the points
/// above it: the edge of the lower convex hull that spans the points' mean abscissa. Points are in
/// order of x, strictly rising.
///
/// `None` where there are no two points. Gives the line's height at `at` and its slope.
pub(crate) fn beneath(
    points: impl Iterator<Item = (f64, f64)> + Clone,
    at: f64,
) -> Option<(f64, f64)> {
    let count = points.clone().count();
    let mean = points.clone().map(|(x, _)| x).sum::<f64>() / count as f64;
    // Gift wrapping from the left: each next corner is the one of least slope. Few points, fewer
    // corners.
    let mut corner = points.clone().next()?;
    loop {
        let slope = |point: (f64, f64)| (point.1 - corner.1) / (point.0 - corner.0);
        // Of equal slopes the farthest, so that every edge is whole.
        let next = points
            .clone()
            .filter(|point| point.0 > corner.0)
            .min_by(|a, b| slope(*a).total_cmp(&slope(*b)).then(b.0.total_cmp(&a.0)))?;
        if next.0 >= mean {
            let slope = slope(next);
            return Some((corner.1 + slope * (at - corner.0), slope));
        }
        corner = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn one_point_is_no_line() {
        assert_eq!(beneath([].into_iter(), 0.0), None);
        assert_eq!(beneath([(1.0, 2.0)].into_iter(), 0.0), None);
        assert_eq!(
            beneath([(1.0, 2.0), (3.0, 4.0)].into_iter(), 5.0),
            Some((6.0, 1.0))
        );
    }

    proptest! {
        /// No point is beneath it, and no line through two of the points does better.
        #[test]
        fn it_is_the_nearest_line_beneath(heights in prop::collection::vec(0.0..1.0_f64, 2..20)) {
            let points: Vec<(f64, f64)> =
                heights.iter().enumerate().map(|(i, h)| (i as f64, *h)).collect();
            let (begin, slope) = beneath(points.iter().copied(), 0.0).unwrap();
            let above = |begin: f64, slope: f64| {
                points.iter().map(move |(x, y)| y - begin - slope * x).collect::<Vec<f64>>()
            };
            prop_assert!(above(begin, slope).iter().all(|h| *h > -1e-9));
            let sum: f64 = above(begin, slope).iter().sum();
            for (i, a) in points.iter().enumerate() {
                for b in &points[i + 1..] {
                    let slope = (b.1 - a.1) / (b.0 - a.0);
                    let heights = above(a.1 - slope * a.0, slope);
                    if heights.iter().all(|h| *h > -1e-12) {
                        prop_assert!(heights.iter().sum::<f64>() > sum - 1e-9);
                    }
                }
            }
        }
    }
}
