//! A gradient against the loss whose gradient it is, along a line.
//!
//! `f(b) - f(a)` is the integral of the slope from a to b, also where rectifiers, absolute values and maxima give f kinks: nearly everywhere there
//! is a slope. So the line may be so long that the rounding of f does not show in the difference, and needs no place without kinks.

/// A line through a point of a design space.
pub struct Line<'a> {
    /// Its middle.
    pub point: &'a [f64],
    /// Its direction, of length 1.
    pub direction: &'a [f64],
    /// Half its length.
    pub half: f64,
}

impl Line<'_> {
    fn at(&self, s: f64) -> Vec<f64> {
        self.point.iter().zip(self.direction).map(|(x, d)| x + s * d).collect()
    }

    /// The mean slope of a loss, by the loss at both ends.
    pub fn by_loss(&self, loss: impl Fn(&[f64]) -> f64) -> f64 {
        (loss(&self.at(self.half)) - loss(&self.at(-self.half))) / (2.0 * self.half)
    }

    /// The mean slope of a loss, by its gradients in the middles of so many equal parts.
    pub fn by_gradients(&self, parts: usize, gradient: impl Fn(&[f64]) -> Vec<f64>) -> f64 {
        let middles = (0..parts).map(|i| self.half * ((2 * i + 1) as f64 / parts as f64 - 1.0));
        let slope =
            |s: f64| gradient(&self.at(s)).iter().zip(self.direction).map(|(g, d)| g * d).sum::<f64>();
        middles.map(slope).sum::<f64>() / parts as f64
    }
}
