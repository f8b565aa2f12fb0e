//! Photographs in another light, so that a network that trains on few of them sees more exposures and colours.

use petzval_camera::image::LinearImage;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Keeps these numbers apart from all else that is drawn from a seed.
const OWN: u64 = 0x7265_6c69_6768_7421;

/// By how much red and blue change beside green, as a share of the range of the exposure.
const COLOUR_SHARE: f32 = 0.25;

/// Factors of red, green and blue for item `item` of step `step`: a change of exposure uniform between `-range_ev` and 0, and changes of red
/// and blue uniform within a quarter of that range on either side. None is above 1, so that nothing that was not white becomes white. They
/// depend on the arguments alone.
pub fn light_factors(range_ev: f64, seed: u64, step: u64, item: u32) -> [f32; 3] {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ OWN);
    random.set_stream(step);
    random.set_word_pos(u128::from(item) * 16);
    let range = range_ev as f32;
    let mut unit = || random.random::<f32>();
    let exposure = -range * unit();
    let mut colour = || COLOUR_SHARE * range * (2.0 * unit() - 1.0);
    let change = [colour(), 0.0, colour()];
    let largest = change.into_iter().fold(0.0, f32::max);
    change.map(|ev| (exposure + ev - largest).exp2())
}

/// Multiplies the planes of a picture by the factors.
///
/// # Panics
/// Panics if the picture does not have three planes.
pub fn relight(picture: &mut LinearImage, factors: [f32; 3]) {
    assert_eq!(picture.channels, factors.len(), "planes of a picture to relight");
    let plane = picture.height * picture.width;
    for (values, factor) in picture.data.chunks_exact_mut(plane).zip(factors) {
        values.iter_mut().for_each(|v| *v *= factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_fill_their_range_and_never_brighten() {
        let all: Vec<[f32; 3]> =
            (0..250).flat_map(|step| (0..4).map(move |item| light_factors(1.0, 7, step, item))).collect();
        // A colour that loses a quarter while another gains one is 1.5 EV darker at most.
        assert!(all.iter().flatten().all(|f| ((-1.5_f32).exp2()..=1.0).contains(f)));
        // The brightest plane has the exposure alone, which is uniform.
        let brightest = |f: &[f32; 3]| f.iter().copied().fold(0.0, f32::max).log2();
        let mean = all.iter().map(brightest).sum::<f32>() / all.len() as f32;
        assert!((mean + 0.5).abs() < 0.04, "{mean}");
        let reddish = all.iter().map(|f| (f[0] / f[1]).log2()).collect::<Vec<_>>();
        let (least, most) = reddish.iter().fold((0.0_f32, 0.0_f32), |(a, b), v| (a.min(*v), b.max(*v)));
        assert!(least < -0.24 && most > 0.24 && least >= -0.25 && most <= 0.25, "{least} {most}");
        assert_eq!(light_factors(0.0, 7, 3, 1), [1.0; 3]);
        assert_eq!(light_factors(1.0, 7, 3, 1), light_factors(1.0, 7, 3, 1));
    }

    #[test]
    fn every_plane_has_its_factor() {
        let mut picture = LinearImage::zeros(3, 1, 2);
        picture.data = vec![0.5; 6];
        relight(&mut picture, [1.0, 0.5, 0.25]);
        assert_eq!(picture.data, [0.5, 0.5, 0.25, 0.25, 0.125, 0.125]);
    }
}
