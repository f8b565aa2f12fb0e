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

/// The image of a point of the cube that is nearest to a point of space, coordinate by coordinate.
pub(super) fn image_near(point: &[f64], near: &[f64]) -> Vec<f64> {
    point
        .iter()
        .zip(near)
        .map(|(x, near)| {
            // Images lie at 2k + x and at 2k - x.
            let image = |x: f64| x + 2.0 * ((near - x) / 2.0).round();
            let [a, b] = [image(*x), image(-x)];
            if (a - near).abs() <= (b - near).abs() { a } else { b }
        })
        .collect()
}

/// The nearest point in the image of the cube that holds a point of space.
pub(super) fn held(point: &[f64], near: &[f64]) -> Vec<f64> {
    point.iter().zip(near).map(|(x, near)| x.clamp(near.floor(), near.floor() + 1.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::{folded, held, image_near};

    #[test]
    fn images_stand_for_the_same_point_and_are_near() {
        let point = [0.3, 0.3, 0.9, 0.0, 0.3];
        let near = [0.5, -0.1, 1.2, 3.9, 7.4];
        let image = image_near(&point, &near);
        for ((got, want), (folded, point)) in
            image.iter().zip([0.3, -0.3, 1.1, 4.0, 7.7]).zip(folded(&image).iter().zip(point))
        {
            assert!((got - want).abs() < 1e-12 && (folded - point).abs() < 1e-12, "{image:?}");
        }
        assert_eq!(held(&[1.4, -0.4, 2.4], &[0.5, -0.1, 1.2]), [1.0, -0.4, 2.0]);
    }

    #[test]
    fn coordinates_are_reflected_at_both_ends() {
        let far = folded(&[0.0, 0.25, 1.0, 1.25, 2.25, -0.25, -1.25, 7.5, -1e-20]);
        assert_eq!(far, [0.0, 0.25, 1.0, 0.75, 0.25, 0.25, 0.75, 0.5, 0.0]);
    }
}
