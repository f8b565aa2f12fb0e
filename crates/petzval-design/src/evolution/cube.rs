//! Points of the unit cube.

/// The point of the cube that a point of space stands for: each coordinate is reflected at 0 and 1 until it lies between them.
///
/// A function of the cube so becomes one of all space without edges, and an optimum on a face keeps a neighbourhood on both sides.
pub(super) fn folded(at: &[f64]) -> Vec<f64> {
    at.iter()
        .map(|x| {
            let turn = x.rem_euclid(2.0);
            // Rounding may give 2 for small negative numbers.
            if turn > 1.0 { (2.0 - turn).max(0.0) } else { turn }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::folded;

    #[test]
    fn coordinates_are_reflected_at_both_ends() {
        let far = folded(&[0.0, 0.25, 1.0, 1.25, 2.25, -0.25, -1.25, 7.5, -1e-20]);
        assert_eq!(far, [0.0, 0.25, 1.0, 0.75, 0.25, 0.25, 0.75, 0.5, 0.0]);
    }
}
