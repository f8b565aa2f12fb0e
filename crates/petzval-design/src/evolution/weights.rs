//! Weights of ranked points, and learning rates of CMA-ES.

/// Weights and learning rates for n coordinates and lambda points: table 1 of the tutorial.
pub(super) struct Weights {
    /// One weight for each rank: positive for the better half, negative for the others.
    pub of_rank: Vec<f64>,
    /// Points with a positive weight.
    pub parents: usize,
    /// Variance-effective number of parents, `1 / sum w^2`.
    pub effective: f64,
    /// Share of a new step in the path of the size.
    pub size_rate: f64,
    /// Damping of the size.
    pub size_damping: f64,
    /// Share of a new step in the path of the covariance.
    pub path_rate: f64,
    /// Learning rate c_1 of the rank-one update.
    pub rank_one: f64,
    /// Learning rate c_mu of the rank-mu update.
    pub rank_mu: f64,
}

impl Weights {
    /// For `coordinates` and `population` points, at least 4.
    pub fn new(coordinates: usize, population: usize) -> Self {
        let (n, lambda) = (coordinates as f64, population as f64);
        let parents = population / 2;
        let raw: Vec<f64> = (1..=population).map(|i| ((lambda + 1.0) / 2.0).ln() - (i as f64).ln()).collect();
        let sums = |part: &[f64]| (part.iter().sum::<f64>(), part.iter().map(|w| w * w).sum::<f64>());
        let ((sum, squares), (sum_below, squares_below)) = (sums(&raw[..parents]), sums(&raw[parents..]));
        let (effective, effective_below) = (sum * sum / squares, sum_below * sum_below / squares_below);

        let rank_one = 2.0 / ((n + 1.3).powi(2) + effective);
        let rank_mu = 2.0 * (0.25 + effective + 1.0 / effective - 2.0) / ((n + 2.0).powi(2) + effective);
        let rank_mu = rank_mu.min(1.0 - rank_one);

        // Negative weights are as large as keeps the covariance positive.
        let limits = [
            1.0 + rank_one / rank_mu,
            1.0 + 2.0 * effective_below / (effective + 2.0),
            (1.0 - rank_one - rank_mu) / (n * rank_mu),
        ];
        let below = limits.into_iter().fold(f64::INFINITY, f64::min).max(0.0);
        let positive: f64 = raw.iter().filter(|w| **w > 0.0).sum();
        let negative: f64 = -raw.iter().filter(|w| **w < 0.0).sum::<f64>();
        let of_rank =
            raw.iter().map(|w| if *w >= 0.0 { w / positive } else { w * below / negative }).collect();

        let size_rate = (effective + 2.0) / (n + effective + 5.0);
        Self {
            of_rank,
            parents,
            effective,
            size_rate,
            size_damping: 1.0 + 2.0 * (((effective - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + size_rate,
            path_rate: (4.0 + effective / n) / (n + 4.0 + 2.0 * effective / n),
            rank_one,
            rank_mu,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Weights;

    #[test]
    fn weights_have_the_sums_of_the_tutorial() {
        for (n, lambda) in [(1, 4), (2, 6), (8, 10), (50, 15), (50, 480), (300, 21)] {
            let w = Weights::new(n, lambda);
            let parents: f64 = w.of_rank[..w.parents].iter().sum();
            assert!((parents - 1.0).abs() < 1e-12, "{n} {lambda}: {parents}");
            let squares: f64 = w.of_rank[..w.parents].iter().map(|w| w * w).sum();
            assert!((w.effective * squares - 1.0).abs() < 1e-12);
            assert!(w.of_rank.windows(2).all(|p| p[0] >= p[1]));
            assert!(w.of_rank[lambda - 1] <= 0.0);
            assert!(w.rank_one + w.rank_mu <= 1.0 + 1e-12);
            for rate in [w.size_rate, w.path_rate, w.rank_one, w.rank_mu] {
                assert!(rate > 0.0 && rate <= 1.0, "{n} {lambda}: {rate}");
            }
        }
    }
}
