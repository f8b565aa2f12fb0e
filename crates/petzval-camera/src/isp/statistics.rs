//! Statistics of a raw frame, as the hardware of an ISP gathers them: histograms, and means over zones.

use rayon::prelude::*;

use super::{IspError, RawInput};

/// Bins of a histogram.
pub const BINS: usize = 1024;

/// Zones along each side of the frame.
pub const ZONES: usize = 15;

/// A pixel counts as saturated from this share of the range above black on.
const SATURATED_SHARE: f64 = 0.98;

/// Statistics of the light in a frame.
///
/// The light of a pixel is `(dn - black) / (white - black)`, with companded digital numbers expanded: 1 is white light in a green
/// pixel. Red and blue pixels answer to white light by `FrameData::response`, which is not divided out.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistics {
    /// Light at the end of the range, where pixels saturate.
    pub full: f64,
    /// Pixels of red, green and blue per bin: [`BINS`] equal steps of light from 0 to `full`; the outer bins hold what lies beyond.
    pub histogram: [Vec<u32>; 3],
    /// [`ZONES`] x [`ZONES`] zones, row by row.
    pub zones: Vec<Zone>,
}

/// A part of the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Zone {
    /// Mean light of red, green and blue pixels.
    pub mean: [f64; 3],
    /// Share of its pixels that are saturated, 0..1.
    pub saturated: f64,
}

impl Statistics {
    /// Statistics of a frame. Fails if the frame is not valid.
    pub fn of_frame(frame: &RawInput) -> Result<Self, IspError> {
        frame.validate()?;
        let about = &frame.about;
        let highest = (1_u64 << frame.bits) - 1;
        let expand = |dn: u32| about.companding.as_ref().map_or(dn, |c| c.expand(dn));
        let range = about.white_dn - about.black_dn;
        // The end of the range is that of the pixel or that of the converter, whichever comes first.
        let strongest = about.response.iter().copied().fold(0.0, f64::max);
        let converter = (f64::from(expand(highest as u32)) - about.black_dn) / range;
        let full = (about.saturation * strongest).min(converter).max(1e-9);

        let zone_rows: Vec<(Vec<Zone>, [Vec<u32>; 3])> = (0..ZONES)
            .into_par_iter()
            .map(|zone_row| {
                let rows = edges(zone_row, frame.height);
                let mut histogram = [(); 3].map(|()| vec![0; BINS]);
                let zones = (0..ZONES).map(|zone_col| {
                    let (mut sum, mut count, mut saturated) = ([0.0; 3], [0.0; 3], 0.0);
                    for row in rows.clone() {
                        for col in edges(zone_col, frame.width) {
                            let dn = expand(frame.dn[row * frame.width + col]);
                            let light = (f64::from(dn) - about.black_dn) / range;
                            let colour = frame.cfa.colour(row, col).plane().unwrap_or(1);
                            sum[colour] += light;
                            count[colour] += 1.0;
                            saturated += f64::from(u8::from(light >= SATURATED_SHARE * full));
                            let bin = (light / full * BINS as f64).max(0.0) as usize;
                            histogram[colour][bin.min(BINS - 1)] += 1;
                        }
                    }
                    let pixels: f64 = count.iter().sum();
                    let mean = std::array::from_fn(|c| sum[c] / f64::max(count[c], 1.0));
                    Zone { mean, saturated: saturated / pixels.max(1.0) }
                });
                (zones.collect(), histogram)
            })
            .collect();
        let mut all = Self { full, histogram: [(); 3].map(|()| vec![0; BINS]), zones: Vec::new() };
        for (zones, histogram) in zone_rows {
            all.zones.extend(zones);
            for (sum, part) in all.histogram.iter_mut().flatten().zip(histogram.iter().flatten()) {
                *sum += part;
            }
        }
        Ok(all)
    }

    /// Share of the pixels of all colours that are saturated.
    pub fn saturated(&self) -> f64 {
        let first = (SATURATED_SHARE * BINS as f64).round() as usize;
        let sum =
            |from: usize| self.histogram.iter().flat_map(|h| &h[from..]).map(|n| f64::from(*n)).sum::<f64>();
        sum(first) / sum(0).max(1.0)
    }

    /// The least light that all pixels of a colour but a share reach, to the upper edge of its bin: 0.5 gives the median.
    pub fn quantile(&self, colour: usize, share_above: f64) -> f64 {
        let histogram = &self.histogram[colour];
        let above = share_above * histogram.iter().map(|n| f64::from(*n)).sum::<f64>();
        let mut passed = 0.0;
        for bin in (0..BINS).rev() {
            passed += f64::from(histogram[bin]);
            if passed > above {
                return (bin + 1) as f64 / BINS as f64 * self.full;
            }
        }
        0.0
    }
}

/// Pixels of a zone along one side: whole blocks of two, so that every zone of a large frame has all colours.
fn edges(zone: usize, length: usize) -> std::ops::Range<usize> {
    let edge = |zone: usize| 2 * (zone * (length / 2) / ZONES);
    edge(zone)..edge(zone + 1)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::isp::{Companding, FrameData, NoiseProfile};
    use crate::sensor::CfaPattern;

    /// A frame of 120 x 150 pixels whose light, as white light would be, is a function of row, column and colour.
    pub fn frame(light: impl Fn(usize, usize, usize) -> f64) -> RawInput {
        let (height, width, cfa) = (120, 150, CfaPattern::GRBG);
        let response = [0.5, 1.0, 0.7];
        let dn = |i: usize| {
            let (row, col) = (i / width, i % width);
            let colour = cfa.colour(row, col).plane().unwrap_or(1);
            (100.0 + 1000.0 * response[colour] * light(row, col, colour)).round().clamp(0.0, 4095.0) as u32
        };
        RawInput {
            height,
            width,
            dn: (0..height * width).map(dn).collect(),
            bits: 12,
            cfa,
            about: FrameData {
                black_dn: 100.0,
                white_dn: 1100.0,
                response,
                saturation: 10.0,
                noise: NoiseProfile { shot: 1e-4, read: 1e-6 },
                gain_ev: 0.0,
                colour_matrix: None,
                companding: None,
                shading: None,
                warp: None,
            },
        }
    }

    #[test]
    fn zones_have_the_means_of_their_pixels() {
        // Brighter to the right, and the lowest row of zones saturated.
        let frame = frame(|row, col, _| if row >= 112 { 20.0 } else { (col / 10) as f64 * 0.1 });
        let statistics = Statistics::of_frame(&frame).unwrap();
        assert_eq!(statistics.zones.len(), ZONES * ZONES);
        for (i, zone) in statistics.zones.iter().enumerate() {
            let (row, light) = (i / ZONES, (i % ZONES) as f64 * 0.1);
            if row == ZONES - 1 {
                assert_eq!(zone.saturated, 1.0);
                continue;
            }
            assert_eq!(zone.saturated, 0.0);
            for (mean, response) in zone.mean.iter().zip([0.5, 1.0, 0.7]) {
                assert!((mean - response * light).abs() < 1e-3, "{i}: {mean}");
            }
        }
        assert!((statistics.saturated() - 1.0 / 15.0).abs() < 1e-12);
        assert!((statistics.full - 3.995).abs() < 1e-12);
    }

    #[test]
    fn histograms_count_every_pixel_and_have_quantiles() {
        let frame = frame(|row, _, _| row as f64 / 120.0);
        let statistics = Statistics::of_frame(&frame).unwrap();
        let count = |c: usize| statistics.histogram[c].iter().sum::<u32>();
        assert_eq!([0, 1, 2].map(count), [4500, 9000, 4500]);
        for (colour, response) in [0.5, 1.0, 0.7].into_iter().enumerate() {
            for share in [0.1, 0.5, 0.9] {
                let quantile = statistics.quantile(colour, share);
                assert!((quantile - response * (1.0 - share)).abs() < 0.015, "{colour} {share}: {quantile}");
            }
        }
        assert_eq!(Statistics::of_frame(&frame).unwrap(), statistics);
    }

    #[test]
    fn companded_frames_are_expanded() {
        let mut frame = frame(|_, _, _| 0.5);
        let linear = Statistics::of_frame(&frame).unwrap();
        let companding = Companding { companded_dn: vec![0, 300, 4095], linear_dn: vec![0, 300, 65_535] };
        frame.dn.iter_mut().for_each(|dn| *dn = companding.compress(*dn));
        frame.about.companding = Some(companding);
        let companded = Statistics::of_frame(&frame).unwrap();
        for (a, b) in linear.zones.iter().zip(&companded.zones) {
            assert!((a.mean[1] - b.mean[1]).abs() < 0.02, "{a:?} {b:?}");
        }
        assert_eq!(companded.full, 10.0);
    }

    #[test]
    fn extreme_frames_give_numbers() {
        for value in [0, 4095] {
            let mut frame = frame(|_, _, _| 0.0);
            frame.dn.fill(value);
            let statistics = Statistics::of_frame(&frame).unwrap();
            assert!(statistics.zones.iter().all(|z| z.mean.iter().all(|m| m.is_finite())));
            assert_eq!(statistics.saturated(), f64::from(u8::from(value > 0)));
        }
        // Zones of the smallest frame may be empty.
        let mut small = frame(|_, _, _| 0.3);
        (small.height, small.width) = (16, 16);
        small.dn.truncate(256);
        let statistics = Statistics::of_frame(&small).unwrap();
        assert_eq!(statistics.histogram.iter().flatten().sum::<u32>(), 256);
    }
}
