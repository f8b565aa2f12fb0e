//! Preparation of data for drawing: smooths noisy points, and thins curves with many points.

/// Largest number of points of a curve that is not thinned.
const MOST_POINTS: usize = 600;

/// The value at each point of the straight line fitted to the twelfth of the points around it.
///
/// `y_i = m + s (i - k)` with m the mean of the window, k its middle and s its least-squares slope. A line
/// has no bias at the ends of the data, where a window has points on one side only; a mean would have. The curve does not leave the range of
/// the data: what is never negative is not drawn so.
pub(super) fn smoothed(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let count = points.len();
    let reach = (count / 24).max(2);
    let least = points.iter().fold(f64::INFINITY, |least, p| least.min(p.1));
    let most = points.iter().fold(f64::NEG_INFINITY, |most, p| most.max(p.1));
    // Running sums of y and i y give those of any window as differences.
    let mut sums = vec![[0.0; 2]];
    for (i, p) in points.iter().enumerate() {
        let [y, iy] = sums[i];
        sums.push([y + p.1, iy + i as f64 * p.1]);
    }
    (0..count)
        .map(|i| {
            let (from, to) = (i.saturating_sub(reach), (i + reach + 1).min(count));
            let n = (to - from) as f64;
            let [y, iy] = [0, 1].map(|k| sums[to][k] - sums[from][k]);
            let (mean, middle) = (y / n, 0.5 * (from + to - 1) as f64);
            // The sum of (i - k)^2 over n consecutive whole numbers is (n^3 - n) / 12.
            let spread = (n * n * n - n) / 12.0;
            let slope = if spread > 0.0 { (iy - middle * y) / spread } else { 0.0 };
            (points[i].0, (mean + slope * (i as f64 - middle)).max(least).min(most))
        })
        .collect()
}

/// The lowest and the highest point of each run of points, so that thinning hides no outlier.
pub(super) fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let run = (2 * points.len()).div_ceil(MOST_POINTS);
    let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
    points
        .chunks(run)
        .flat_map(|c| {
            let extremes = [c.iter().min_by(by_value), c.iter().max_by(by_value)];
            let mut extremes: Vec<_> = extremes.into_iter().flatten().copied().collect();
            extremes.sort_by(|a, b| a.0.total_cmp(&b.0));
            extremes
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smoothing_keeps_lines_and_thinning_keeps_outliers() {
        let line: Vec<_> = (0..100).map(|i| (f64::from(i), 3.0 * f64::from(i))).collect();
        assert!(smoothed(&line).iter().zip(&line).all(|(a, b)| (a.1 - b.1).abs() < 1e-9));
        // Noise of alternating sign is smaller inside and no larger at the ends.
        let noise: Vec<_> = (0..240).map(|i| (f64::from(i), f64::from(i % 2) - 0.5)).collect();
        assert!(smoothed(&noise).iter().all(|p| p.1.abs() < 0.15));
        // A fall to nothing does not pass it.
        let fall: Vec<_> = (0..60).map(|i| (f64::from(i), (-f64::from(i)).exp())).collect();
        assert!(smoothed(&fall).iter().all(|p| (0.0..=1.0).contains(&p.1)));
        let mut long: Vec<_> = (0..100_000).map(|i| (f64::from(i), 0.0)).collect();
        long[54_321].1 = 9.0;
        let thin = thinned(&long);
        assert!(thin.len() <= MOST_POINTS);
        assert!(thin.contains(&(54_321.0, 9.0)));
    }
}
