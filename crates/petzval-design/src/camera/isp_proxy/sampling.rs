//! Parameters with which an ISP develops the training frames of its proxy.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Standard deviation of parameters about the point around which a proxy is wanted, as a share of their ranges.
const DEVIATION: f64 = 0.05;

/// Chance of a parameter to lie anywhere in its range where a point is drawn far from the centre. If all of some fifty did, hardly a
/// picture would be left: most would be white, black or of one colour.
const FAR: f64 = 0.1;

/// Distance of parameters at which slopes are compared, as a share of their ranges.
const BESIDE: f64 = 0.1;

/// Keeps these draws apart from all else that is drawn from a seed.
const OWN: u64 = 0x0070_6172_616d_7332;

/// Two neighbouring points of the unit cube, at which one frame is developed: by their difference the proxy learns the slope of the ISP.
/// Every other pair lies near `centre`, the others far from it. It depends on the arguments alone.
pub(super) fn pair(centre: &[f64], seed: u64, step: u64, item: u64) -> [Vec<f64>; 2] {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ OWN);
    random.set_stream(step);
    random.set_word_pos(u128::from(item) << 20);
    let first = match item % 2 {
        0 => near(centre, &mut random),
        _ => far(centre, &mut random),
    };
    let second = near(&first, &mut random);
    [first, second]
}

/// A point near another, some of whose coordinates lie anywhere.
pub(super) fn far(centre: &[f64], random: &mut impl Rng) -> Vec<f64> {
    let mut point = near(centre, random);
    for at in &mut point {
        if random.random_bool(FAR) {
            *at = random.random();
        }
    }
    point
}

/// A point whose every coordinate is a tenth of its range beside another, on one side or the other, and inside.
pub(super) fn beside(centre: &[f64], random: &mut impl Rng) -> Vec<f64> {
    let mut moved = |at: &f64| {
        let off = if random.random_bool(0.5) { BESIDE } else { -BESIDE };
        if (0.0..=1.0).contains(&(at + off)) { at + off } else { at - off }
    };
    centre.iter().map(&mut moved).collect()
}

/// A point about another; what would leave the unit cube is reflected at its face.
pub(super) fn near(centre: &[f64], random: &mut impl Rng) -> Vec<f64> {
    let mut moved = |at: &f64| {
        let to: f64 = at + DEVIATION * Distribution::<f64>::sample(&StandardNormal, random);
        (1.0 - (1.0 - to.abs()).abs()).clamp(0.0, 1.0)
    };
    centre.iter().map(&mut moved).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_beside_are_a_tenth_away_and_inside() {
        let centre = [0.0, 0.05, 0.5, 0.97, 1.0];
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let points: Vec<Vec<f64>> = (0..20).map(|_| beside(&centre, &mut random)).collect();
        for (at, centre) in points.iter().flat_map(|point| point.iter().zip(centre)) {
            assert!(
                (0.0..=1.0).contains(at) && ((at - centre).abs() - 0.1).abs() < 1e-12,
                "{at} beside {centre}"
            );
        }
        assert!(points.iter().any(|p| p[2] > 0.5) && points.iter().any(|p| p[2] < 0.5));
    }

    #[test]
    fn pairs_lie_in_the_cube_half_of_them_about_the_centre_and_come_again() {
        let centre = [0.0, 0.5, 1.0];
        let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let mut apart = 0;
        for step in 0..100 {
            for item in 0..4 {
                let [first, second] = pair(&centre, 3, step, item);
                assert!(first.iter().chain(&second).all(|v| (0.0..=1.0).contains(v)));
                assert!(distance(&first, &second) < 0.5);
                assert_eq!([first.clone(), second], pair(&centre, 3, step, item));
                match item % 2 {
                    0 => assert!(distance(&first, &centre) < 0.5),
                    _ => apart += usize::from(distance(&first, &centre) > 0.5),
                }
            }
        }
        // Two of the three coordinates can lie as far, each with a chance of one in twenty.
        assert!((8..=35).contains(&apart), "{apart} of 200");
    }
}
