//! Compares the rows of `expose` with the pixels of the readable reference, bit by bit.

use pulp::{Simd, WithSimd};

use super::*;
use crate::sensor::expose::{ExposeRow, Frame, Scratch};

const MODES: [NoiseMode; 6] = [
    NoiseMode::Exact,
    NoiseMode::Dequantised,
    NoiseMode::HalfStep,
    NoiseMode::StraightThrough,
    NoiseMode::Gaussian,
    NoiseMode::Off,
];

/// Light from below zero to far above saturation.
fn wild(height: usize, width: usize) -> LinearImage {
    let mut light = LinearImage::zeros(CHANNELS, height, width);
    for (i, v) in light.data.iter_mut().enumerate() {
        *v = ((i * 2654435761 % 1000) as f32 / 1000.0 - 0.02).powi(3) * 4.0;
    }
    light
}

fn sensors() -> Vec<SensorModel> {
    let with = |cfa: &str, electronics, nonuniformity| SensorModel {
        cfa: cfa.parse().unwrap(),
        electronics,
        nonuniformity,
        clear_response: [0.5, 0.9, 0.7],
        ..imx249()
    };
    let even = NonUniformity::default();
    vec![
        with("RGGB", Electronics::BeforeAdc, even),
        with("GBGGRG/RGRBGB/GBGGRG/GRGGBG/BGBRGR/GRGGBG", Electronics::AfterAdc, uneven(8)),
        with("mono", Electronics::BeforeAdc, uneven(9)),
        with(
            "WR/GB",
            Electronics::BeforeAdc,
            NonUniformity { hot_pixel_share: 0.3, hot_pixel_e_per_s: 1e5, ..even },
        ),
        with(
            "GRBG",
            Electronics::BeforeAdc,
            NonUniformity { prnu_pixel_percent: 30.0, row_noise_e: 2.0, ..even },
        ),
    ]
}

#[test]
fn every_pixel_of_a_frame_equals_the_reference_pixel() {
    let light = wild(13, 150);
    for (i, sensor) in sensors().iter().enumerate() {
        for mode in MODES {
            let capture = Capture {
                placement: Placement { row: 5, col: 9 + i },
                frame: 3,
                ..capture(15_000.0, 0.3, 1.3)
            };
            let (raw, slopes) = expose_with_tape(&light, sensor, &capture, &noise(mode)).unwrap();
            assert_eq!(expose(&light, sensor, &capture, &noise(mode)).unwrap(), raw);
            for pixel in 0..raw.dn.len() {
                let (r, c) = (pixel / 150, pixel % 150);
                let seen = [0, 1, 2].map(|channel| light.get(channel, r, c));
                let reading = expose_pixel(seen, sensor, &capture, &noise(mode), (5 + r, 9 + i + c));
                let row = PixelReading { dn: raw.dn[pixel], by_light: slopes[pixel] };
                assert_eq!(row, reading, "{}, {mode:?}, pixel ({r}, {c})", sensor.cfa);
            }
        }
    }
}

/// The bits of one row computed with a given instruction set.
fn row_with(simd: impl Simd, light: &LinearImage, sensor: &SensorModel, mode: NoiseMode) -> Vec<u32> {
    let capture = capture(15_000.0, 0.3, 1.3);
    let noise = noise(mode);
    let frame = Frame::new(light, sensor, &capture, &noise);
    let n = light.width;
    let (mut dn, mut by_light) = (vec![0.0f32; n], vec![0.0f32; n]);
    let mut scratch = Scratch::default();
    let row = ExposeRow::<true> {
        frame: &frame,
        row: 2,
        scratch: &mut scratch,
        dn: &mut dn,
        by_light: &mut by_light,
    };
    simd.vectorize(Row(row));
    dn.iter().chain(&by_light).map(|v| v.to_bits()).collect()
}

struct Row<'f, 'a, 'm>(ExposeRow<'f, 'a, 'm, true>);

impl WithSimd for Row<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.with_simd(simd);
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    let light = wild(3, 1003);
    for sensor in sensors() {
        for mode in MODES {
            let plain = row_with(pulp::Scalar::new(), &light, &sensor, mode);
            #[cfg(target_arch = "x86_64")]
            {
                if let Some(v3) = pulp::x86::V3::try_new() {
                    assert!(row_with(v3, &light, &sensor, mode) == plain, "AVX2, {mode:?}");
                }
                if let Some(v4) = pulp::x86::V4::try_new() {
                    assert!(row_with(v4, &light, &sensor, mode) == plain, "AVX-512, {mode:?}");
                }
            }
            assert_eq!(plain.len(), 2 * 1003);
        }
    }
}

#[test]
fn noise_depends_on_seed_frame_and_pixel_only() {
    let sensor = SensorModel { nonuniformity: uneven(3), ..imx249() };
    let light = LinearImage::filled(CHANNELS, 30, 40, 0.01);
    let frame = capture(5000.0, 0.01, 4.0);
    for mode in MODES {
        let run = |threads: usize, noise: Noise, capture: Capture| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| expose_with_tape(&light, &sensor, &capture, &noise).unwrap())
        };
        let base = run(1, noise(mode), frame);
        assert!(base == run(2, noise(mode), frame));
        let changes = mode != NoiseMode::Off;
        assert_eq!(base.0.dn != run(1, Noise { seed: 21, ..noise(mode) }, frame).0.dn, changes);
        assert_eq!(base.0.dn != run(1, noise(mode), Capture { frame: 1, ..frame }).0.dn, changes);

        // A crop of the sensor repeats the noise of the same pixels, and their fixed pattern.
        let placement = Placement { row: 11, col: 7 };
        let crop = light.crop(0, 0, 10, 20).unwrap();
        let part = expose(&crop, &sensor, &Capture { placement, ..frame }, &noise(mode)).unwrap();
        for r in 0..10 {
            assert_eq!(part.dn[r * 20..(r + 1) * 20], base.0.dn[(r + 11) * 40 + 7..][..20]);
        }
        let (whole, part) =
            (sensor.fixed_pattern(Placement::default(), 30, 40), sensor.fixed_pattern(placement, 10, 20));
        assert_eq!(part.offset_e[..20], whole.offset_e[11 * 40 + 7..][..20]);
    }
}

#[test]
fn irradiance_that_is_not_finite_makes_its_pixel_nan() {
    let mut light = LinearImage::filled(CHANNELS, 4, 8, 0.2);
    light.plane_mut(1)[1] = f32::NAN;
    light.plane_mut(0)[10] = f32::INFINITY;
    for mode in MODES {
        let (raw, slopes) =
            crate::sensor::expose_tracked(&light, &imx249(), &capture(5e3, 0.01, 1.0), &noise(mode));
        for i in 0..32 {
            let unknown = i == 1 || i == 10;
            assert_eq!(raw.dn[i].is_nan(), unknown, "{mode:?}, pixel {i}");
            assert_eq!(slopes[i].is_nan(), unknown);
        }
    }
}
