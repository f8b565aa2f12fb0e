//! Built-in scenes of measured reflectances: a ColorChecker, a flat field, a slanted edge, a Siemens star, a test chart.

use rayon::prelude::*;

use super::colour_checker::{CHART_COLUMNS, CHART_ROWS, ChartData, colour_checker};
use super::reflectance_scene::{ReflectanceScene, SUPERSAMPLING};
use super::test_chart::TestChart;
use crate::spectrum::Spectrum;

/// A built-in scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SceneKind {
    /// The 24 patches of a ColorChecker Classic (Ohta's reflectances) in a black frame on mid gray.
    ColourChecker,
    /// The perfect diffuser: reflectance 1 at all wavelengths.
    Flat,
    /// An edge between the chart's black and white (reflectances 0.03 and 0.89), 5 degrees from the vertical.
    SlantedEdge,
    /// A star of 36 pairs of black and white sectors.
    SiemensStar,
    /// The patches of the ColorChecker and slanted edges over the field: a [`TestChart`].
    TestChart,
}

/// Inclination of the slanted edge, degrees from the vertical.
const EDGE_DEG: f64 = 5.0;
/// Pairs of sectors of the Siemens star.
const STAR_CYCLES: f64 = 36.0;

impl SceneKind {
    /// All scenes.
    pub const ALL: [Self; 5] =
        [Self::ColourChecker, Self::Flat, Self::SlantedEdge, Self::SiemensStar, Self::TestChart];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::ColourChecker => "colorchecker",
            Self::Flat => "flat",
            Self::SlantedEdge => "slanted-edge",
            Self::SiemensStar => "siemens-star",
            Self::TestChart => "test-chart",
        }
    }

    /// The scene with this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Draws the scene on `height` x `width` pixels.
    pub fn draw(self, height: usize, width: usize) -> ReflectanceScene {
        let patches = colour_checker(ChartData::Ohta);
        let (white, black) = (patches[18].1.clone(), patches[23].1.clone());
        let (h, w) = (height as f64, width as f64);
        match self {
            Self::ColourChecker => chart(height, width),
            Self::TestChart => TestChart { height, width }.draw(),
            Self::Flat => {
                let even = Spectrum::new(vec![0.3, 1.1], vec![1.0, 1.0]).into_iter().collect();
                ReflectanceScene { height, width, materials: even, pixels: vec![(0, 0, 0.0); height * width] }
            }
            Self::SlantedEdge => {
                // White to the right of a line through the middle.
                let slope = EDGE_DEG.to_radians().tan();
                let bright = move |y: f64, x: f64| x - 0.5 * w > -(y - 0.5 * h) * slope;
                two_tone(height, width, [black, white], bright)
            }
            Self::SiemensStar => {
                let radius = 0.45 * h.min(w);
                let bright = move |y: f64, x: f64| {
                    let (y, x) = (y - 0.5 * h, x - 0.5 * w);
                    x.hypot(y) > radius || (STAR_CYCLES * y.atan2(x)).sin() > 0.0
                };
                two_tone(height, width, [black, white], bright)
            }
        }
    }
}

/// The squares of the chart in a black frame, on the gray of its patch "neutral 5". A gap is a fifth of a square's period.
fn chart(height: usize, width: usize) -> ReflectanceScene {
    let patches = colour_checker(ChartData::Ohta);
    let (gray, black) = (21u8, 23u8);
    // A cell is a square and its gap. The chart fills at most 90 % of the picture.
    let (rows, columns) = (CHART_ROWS as f64, CHART_COLUMNS as f64);
    let cell = (0.9 * height as f64 / (rows + 0.2)).min(0.9 * width as f64 / (columns + 0.2));
    let gap = 0.2 * cell;
    let top = 0.5 * (height as f64 - rows * cell - gap);
    let left = 0.5 * (width as f64 - columns * cell - gap);
    let material = |row: usize, col: usize| {
        let (y, x) = (row as f64 + 0.5 - top, col as f64 + 0.5 - left);
        if y < 0.0 || x < 0.0 || y >= rows * cell + gap || x >= columns * cell + gap {
            return gray;
        }
        let (r, c) = ((y / cell) as usize, (x / cell) as usize);
        let inside = |v: f64, i: usize| v - i as f64 * cell >= gap;
        if r < CHART_ROWS && c < CHART_COLUMNS && inside(y, r) && inside(x, c) {
            (r * CHART_COLUMNS + c) as u8
        } else {
            black
        }
    };
    let pixels = (0..height * width).map(|i| (material(i / width, i % width), 0, 0.0)).collect();
    let materials = patches.iter().map(|(_, reflectance)| reflectance.clone()).collect();
    ReflectanceScene { height, width, materials, pixels }
}

/// A scene of two materials. A pixel's share of the second is the share of its sample points where `second(y, x)` holds;
/// y and x are in pixels from the top-left corner.
fn two_tone(
    height: usize,
    width: usize,
    materials: [Spectrum; 2],
    second: impl Fn(f64, f64) -> bool + Sync,
) -> ReflectanceScene {
    let step = 1.0 / SUPERSAMPLING as f64;
    let share = |i: usize| {
        let (row, col) = ((i / width) as f64, (i % width) as f64);
        let points = (0..SUPERSAMPLING * SUPERSAMPLING).map(|k| {
            let (y, x) = (k / SUPERSAMPLING, k % SUPERSAMPLING);
            second(row + (y as f64 + 0.5) * step, col + (x as f64 + 0.5) * step)
        });
        (0, 1, points.filter(|p| *p).count() as f32 / (SUPERSAMPLING * SUPERSAMPLING) as f32)
    };
    let pixels = (0..height * width).into_par_iter().map(share).collect();
    ReflectanceScene { height, width, materials: materials.to_vec(), pixels }
}

#[cfg(test)]
mod tests {
    use super::super::illuminant::Illuminant;
    use super::*;
    use crate::spectrum::bands::even_bands;

    #[test]
    fn black_and_white_have_the_reflectances_of_the_book() {
        for kind in [SceneKind::SlantedEdge, SceneKind::SiemensStar] {
            let scene = kind.draw(24, 32);
            let rounded =
                |material: usize, um: f64| (100.0 * scene.materials[material].at(um)).round() / 100.0;
            for um in [0.50, 0.55, 0.65, 0.70] {
                assert_eq!((rounded(0, um), rounded(1, um)), (0.03, 0.89), "{um} um");
            }
            assert_eq!(rounded(1, 0.40), 0.41);
        }
    }

    #[test]
    fn the_chart_shows_its_patches_in_order() {
        let scene = SceneKind::ColourChecker.draw(240, 384);
        let count = |m: u8| scene.pixels.iter().filter(|(a, _, _)| *a == m).count();
        for patch in 0..23u8 {
            assert!(count(patch) > 1000, "patch {patch}: {}", count(patch));
        }
        // White lies at the left of the bottom row, cyan at the right of the third.
        let at = |row: usize, col: usize| scene.pixels[row * 384 + col].0;
        assert_eq!((at(200, 60), at(0, 0)), (18, 21));
        let third: Vec<u8> = (0..384).map(|c| at(148, c)).collect();
        assert!(third.contains(&17) && third.contains(&12));
    }

    #[test]
    fn flat_white_has_the_luminance_of_the_perfect_diffuser() {
        let light = Illuminant::named("D65").unwrap();
        let bands = even_bands(0.38, 0.78, 81);
        let image = SceneKind::Flat.draw(2, 3).under(&light, 1000.0, &bands);
        image.validate().unwrap();
        let spectrum = Spectrum::new(bands, (0..81).map(|b| f64::from(image.plane(b)[4])).collect()).unwrap();
        let luminance = super::super::observer::luminous(&spectrum);
        assert!((luminance / (1000.0 / std::f64::consts::PI) - 1.0).abs() < 1e-3, "{luminance}");
    }

    #[test]
    fn edge_and_star_are_half_bright() {
        for kind in [SceneKind::SlantedEdge, SceneKind::SiemensStar] {
            let scene = kind.draw(200, 200);
            let inner = |i: usize| ((i / 200) as f64 - 99.5).hypot((i % 200) as f64 - 99.5) < 85.0;
            let shares: Vec<f32> = (0..40_000).filter(|i| inner(*i)).map(|i| scene.pixels[i].2).collect();
            let mean = shares.iter().sum::<f32>() / shares.len() as f32;
            assert!((mean - 0.5).abs() < 5e-3, "{kind:?}: {mean}");
            assert_eq!(SceneKind::named(kind.name()), Some(kind));
        }
    }
}
