//! Of a line as many points as there are pixels: an hour of a gyro has a million.

/// A gap of this many median steps ...
const GAP_STEPS: f64 = 5.0;
/// ... that can be seen at all, pixels, ends a line.
const GAP_PIXELS: f64 = 3.0;

/// The runs of a line: points (pixels to the right, value), in order, without those that are not
/// finite. A run ends where nothing came for long. In each column of pixels the first, least,
/// greatest and last value are kept.
pub(crate) fn runs(points: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
    let mut runs: Vec<Vec<[f64; 2]>> = Vec::new();
    let gap = gap(points);
    let mut last: Option<f64> = None;
    for point in points {
        let [x, y] = *point;
        if !(x.is_finite() && y.is_finite()) {
            // What is not a number is a gap too.
            last = None;
            continue;
        }
        let goes_on = last.is_some_and(|last| (0.0..=gap).contains(&(x - last)));
        match runs.last_mut() {
            Some(run) if goes_on => run.push([x, y]),
            _ => runs.push(vec![[x, y]]),
        }
        last = Some(x);
    }
    runs.iter().map(|run| columns(run)).collect()
}

fn gap(points: &[[f64; 2]]) -> f64 {
    let pairs = points.iter().zip(points.iter().skip(1));
    let mut steps: Vec<f64> = pairs.map(|(a, b)| b[0] - a[0]).collect();
    steps.sort_by(f64::total_cmp);
    let median = steps.get(steps.len() / 2).copied().unwrap_or_default();
    (GAP_STEPS * median).max(GAP_PIXELS)
}

fn columns(run: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    for column in run.chunk_by(|a, b| a[0].floor() == b[0].floor()) {
        let by_value = |a: &usize, b: &usize| match (column.get(*a), column.get(*b)) {
            (Some(a), Some(b)) => a[1].total_cmp(&b[1]),
            _ => std::cmp::Ordering::Equal,
        };
        let least = (0..column.len()).min_by(by_value);
        let most = (0..column.len()).max_by(by_value);
        let mut indices = vec![0, column.len() - 1];
        indices.extend(least.into_iter().chain(most));
        indices.sort_unstable();
        indices.dedup();
        kept.extend(indices.into_iter().filter_map(|index| column.get(index)));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_of_pixels_keeps_its_extremes() {
        let mut points: Vec<[f64; 2]> = (0..10_000).map(|n| [f64::from(n) * 0.01, 1.0]).collect();
        points[5_050][1] = 9.0;
        points[5_060][1] = -9.0;
        let runs = runs(&points);
        assert_eq!(runs.len(), 1);
        assert!(runs[0].len() <= 400, "{}", runs[0].len());
        let at = runs[0].iter().map(|point| point[1]);
        assert_eq!(at.clone().fold(0.0, f64::max), 9.0);
        assert_eq!(at.fold(0.0, f64::min), -9.0);
    }

    #[test]
    fn a_line_ends_where_nothing_came_for_long() {
        let mut points: Vec<[f64; 2]> = (0..20).map(|n| [f64::from(n), 0.0]).collect();
        points.drain(8..16);
        assert_eq!(runs(&points).len(), 2);
        // One that is only late does not.
        let late = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [6.0, 0.0], [7.0, 0.0]];
        assert_eq!(runs(&late).len(), 1);
        let broken = [[0.0, 0.0], [1.0, f64::NAN], [2.0, 0.0]];
        assert_eq!(runs(&broken).len(), 2);
        assert!(runs(&[]).is_empty() && runs(&[[f64::NAN, 1.0]]).is_empty());
    }
}
