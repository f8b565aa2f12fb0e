//! Reflectances and light as triples of channels in which white and gray are equal.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Red, green and blue channel: a reflectance 0..1, an illuminance in lx or a luminance in cd/m^2.
pub(crate) type Rgb = [f32; 3];

/// The product, channel by channel.
#[inline(always)]
pub(crate) fn times(a: Rgb, b: Rgb) -> Rgb {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

/// The sum.
#[inline(always)]
pub(crate) fn plus(a: Rgb, b: Rgb) -> Rgb {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// The multiple.
#[inline(always)]
pub(crate) fn scaled(a: Rgb, s: f32) -> Rgb {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// `a` for a share of 0, `b` for a share of 1.
#[inline(always)]
pub(crate) fn blend(a: Rgb, b: Rgb, share: f32) -> Rgb {
    plus(scaled(a, 1.0 - share), scaled(b, share))
}

/// A reflectance from hue (turns), saturation 0..1 and value 0..1.
pub(crate) fn from_hue(hue: f32, saturation: f32, value: f32) -> Rgb {
    let channel = |offset: f32| {
        let turn = (hue + offset).rem_euclid(1.0) * 6.0;
        let share = (2.0 - (turn - 3.0).abs()).clamp(0.0, 1.0);
        value * (1.0 - saturation * share)
    };
    [channel(0.0), channel(2.0 / 3.0), channel(1.0 / 3.0)]
}

/// The reflectance of a man-made surface: mostly dull, now and then a strong colour.
pub(crate) fn surface_colour(rng: &mut ChaCha8Rng) -> Rgb {
    let value = 0.03 + 0.72 * rng.random::<f32>().powf(1.7);
    let saturation = match rng.random_range(0..10) {
        0..=5 => 0.2 * rng.random::<f32>(),
        6..=8 => rng.random_range(0.2..0.5),
        _ => rng.random_range(0.5..0.9),
    };
    from_hue(rng.random(), saturation, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hues_are_red_green_and_blue_at_thirds_of_a_turn() {
        for (hue, main) in [(0.0, 0), (1.0 / 3.0, 1), (2.0 / 3.0, 2)] {
            let rgb = from_hue(hue, 0.8, 0.5);
            assert!((rgb[main] - 0.5).abs() < 1e-5, "{hue} {rgb:?}");
            let others = (0..3).filter(|i| *i != main);
            assert!(others.into_iter().all(|i| (rgb[i] - 0.1).abs() < 1e-5), "{hue} {rgb:?}");
        }
        assert_eq!(from_hue(0.4, 0.0, 0.3), [0.3; 3]);
    }
}
