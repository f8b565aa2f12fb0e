//! Which matched boxes a loss is computed of: some with objects, the rest without.

use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::Match;

/// Numbers of sampled boxes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sampled {
    /// Boxes with an object: `(box, object)`.
    pub positive: Vec<(usize, usize)>,
    /// Boxes without.
    pub negative: Vec<usize>,
}

/// Draws `count` boxes, of which at most the share `positive` has an object; ignored boxes are never drawn. Returned in ascending order.
pub fn sample(matches: &[Match], count: usize, positive: f32, random: &mut ChaCha8Rng) -> Sampled {
    let mut with: Vec<(usize, usize)> = Vec::new();
    let mut without: Vec<usize> = Vec::new();
    for (i, found) in matches.iter().enumerate() {
        match found {
            Match::Object(object) => with.push((i, *object)),
            Match::Background => without.push(i),
            Match::Ignored => {}
        }
    }
    let most = (count as f32 * positive) as usize;
    if with.len() > most {
        with.shuffle(random);
        with.truncate(most);
        with.sort_unstable();
    }
    let rest = count - with.len();
    if without.len() > rest {
        without.shuffle(random);
        without.truncate(rest);
        without.sort_unstable();
    }
    Sampled { positive: with, negative: without }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn samples_hold_the_share_of_objects_and_no_ignored_box() {
        let matches: Vec<Match> = (0..100)
            .map(|i| match i % 10 {
                0..4 => Match::Object(i),
                4 => Match::Ignored,
                _ => Match::Background,
            })
            .collect();
        let draw = |seed| sample(&matches, 20, 0.25, &mut ChaCha8Rng::seed_from_u64(seed));
        let drawn = draw(1);
        assert_eq!((drawn.positive.len(), drawn.negative.len()), (5, 15));
        assert!(drawn.positive.iter().all(|(i, object)| i == object && i % 10 < 4));
        assert!(drawn.negative.iter().all(|i| i % 10 > 4));
        assert_eq!(drawn, draw(1));
        assert_ne!(drawn, draw(2));
        // Fewer objects than their share are made up by background.
        let few = sample(&matches[8..12], 20, 0.5, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!((few.positive.len(), few.negative.len()), (2, 2));
    }
}
