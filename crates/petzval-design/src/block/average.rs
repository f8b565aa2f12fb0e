//! The average of a noisy number over the steps of a stage.

use serde::{Deserialize, Serialize};

/// An exponential average, corrected for its start: after one value it is that value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Average {
    sum: f64,
    values: i32,
}

impl Average {
    /// Takes up a value; those before count `decay` times as much as until now, 0..1. Returns the average.
    pub fn with(&mut self, value: f64, decay: f64) -> f64 {
        self.sum = decay * self.sum + (1.0 - decay) * value;
        self.values = self.values.saturating_add(1);
        self.sum / (1.0 - decay.powi(self.values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_value_counts_whole_and_noise_averages_out() {
        let mut average = Average::default();
        assert!((average.with(-0.3, 0.95) + 0.3).abs() < 1e-12);
        assert!((average.with(0.1, 0.95) - (-0.3 * 0.95 + 0.1) / 1.95).abs() < 1e-12);
        // Values that alternate about 0.5.
        let last = (0..400).map(|i| average.with(0.5 + f64::from(i % 2 * 2 - 1), 0.95)).last().unwrap();
        assert!((last - 0.5).abs() < 0.03, "{last}");
        let text = serde_json::to_string(&average).unwrap();
        let mut again: Average = serde_json::from_str(&text).unwrap();
        assert_eq!(again.with(1.0, 0.95), average.with(1.0, 0.95));
    }
}
