//! Mean squared spots from the samples of a pupil basis.

use std::sync::OnceLock;

use pulp::{Simd, WithSimd};

use super::mean_over_fields;
use super::traced::field_mean_square;
use crate::gradient::LensGradient;
use crate::lanes::{Lanes, dispatch};
use crate::lens::Lens;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use crate::pupil::{
    DenseCotangent, DenseMap, PointsCotangent, PupilBasis, PupilMap, PupilRows, PupilSamples, PupilSampling,
    Quadrature, SamplesCotangent,
};
use crate::trace::Sequence;

/// Good to 2e-5 of the spots of the paper's triplets and 3e-4 of those of an f/2 lens of eight elements, by comparison with
/// a dense grid of traced rays (`examples/spot_accuracy.rs`); not checked for each lens.
const SAMPLING: PupilSampling = PupilSampling::Degree(8);

/// Rows of the pupil where an aperture cuts the beam.
const ROWS: usize = 64;

/// Cells of the pupil where rays of the stop are lost.
const CELLS: usize = 32;

const UM2_PER_MM2: f64 = 1e6;

/// Mean over fields and wavelengths of the squared RMS spot radius, um^2, about the polychromatic
/// centroid, with its gradient. `None` if some field brings no light.
pub fn mean_square_spot(lens: &Lens, fields_rad: &[f64]) -> Option<(f64, LensGradient)> {
    mean_square_spot_sampled(lens, fields_rad, SAMPLING)
}

/// [`mean_square_spot`] with other rays: more are more accurate, and slower.
pub fn mean_square_spot_sampled(
    lens: &Lens,
    fields_rad: &[f64],
    sampling: PupilSampling,
) -> Option<(f64, LensGradient)> {
    let basis = PupilBasis::of(sampling);
    mean_over_fields(lens, fields_rad, |field| field_spot(lens, field, basis))
}

/// The light of a beam on the image plane.
enum Cloud {
    /// At the samples, which integrate it as it is.
    Samples(PupilSamples),
    /// Dense, because an aperture cuts it.
    Cut(PupilMap),
}

/// Sums over a cloud: light, light times y, light times x^2 + y^2; y about an origin.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    light: f64,
    y: f64,
    square: f64,
}

impl Moments {
    /// Mean of x^2 + (y - centre)^2 over the light.
    fn mean_square(&self, centre: f64) -> f64 {
        (self.square - 2.0 * centre * self.y) / self.light + centre * centre
    }
}

/// What is asked of a point with light w: by x `2 s w x`, by y `2 s w (y - c)`, by w `s (x^2 + (y - c)^2 - m)`.
#[derive(Clone, Copy)]
struct Wish {
    scale: f64,
    centre: f64,
    mean_square: f64,
}

fn rows() -> &'static PupilRows {
    static ROWS_MADE: OnceLock<PupilRows> = OnceLock::new();
    ROWS_MADE.get_or_init(|| PupilRows::new(ROWS))
}

fn cells() -> &'static Quadrature {
    static CELLS_MADE: OnceLock<Quadrature> = OnceLock::new();
    CELLS_MADE
        .get_or_init(|| Quadrature::grid(CELLS).unwrap_or_else(|_| unreachable!("a grid that is allowed")))
}

struct DenseMoments<'a> {
    dense: &'a DenseMap<'a>,
    origin: f64,
}

impl WithSimd for DenseMoments<'_> {
    type Output = Moments;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Moments {
        let Self { dense, origin } = self;
        let zero = Lanes::splat(simd, 0.0);
        let (mut light, mut first, mut square) = (zero, zero, zero);
        for row in 0..dense.rows() {
            for turn in 0..dense.turns::<S>(row) {
                let p = dense.points(simd, row, turn);
                let y = p.y - origin;
                light += p.weight;
                first += p.weight * y;
                square += p.weight * (p.x * p.x + y * y);
            }
        }
        Moments { light: light.sum(), y: first.sum(), square: square.sum() }
    }
}

struct DensePullBack<'a> {
    dense: &'a DenseMap<'a>,
    origin: f64,
    wish: Wish,
    sums: &'a mut DenseCotangent,
}

impl WithSimd for DensePullBack<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { dense, origin, wish, sums } = self;
        for row in 0..dense.rows() {
            for turn in 0..dense.turns::<S>(row) {
                let p = dense.points(simd, row, turn);
                let y = p.y - (origin + wish.centre);
                let twice = p.weight * (2.0 * wish.scale);
                let weight = (p.x * p.x + y * y - wish.mean_square) * wish.scale;
                let bar = PointsCotangent { x: twice * p.x, y: twice * y, weight };
                dense.pull_back_points(row, &p, bar, sums);
            }
        }
    }
}

impl Cloud {
    fn new(sequence: &Sequence, samples: PupilSamples) -> Self {
        if samples.heights.is_empty() {
            Self::Samples(samples)
        } else {
            Self::Cut(PupilMap::new(sequence, samples))
        }
    }

    fn samples(&self) -> &PupilSamples {
        match self {
            Self::Samples(samples) => samples,
            Self::Cut(map) => &map.samples,
        }
    }

    fn moments(&self, origin: f64) -> Moments {
        match self {
            Self::Samples(s) => {
                let mut sums = Moments::default();
                for i in 0..s.x.len() {
                    let (w, y) = (s.basis.weights[i] * s.light[i], s.y[i] - origin);
                    sums.light += w;
                    sums.y += w * y;
                    sums.square += w * (s.x[i] * s.x[i] + y * y);
                }
                sums
            }
            Self::Cut(map) => {
                let dense = DenseMap::new(map, rows());
                dispatch(DenseMoments { dense: &dense, origin })
            }
        }
    }

    /// Adds the gradient; returns the derivative by the stop radius.
    fn pull_back(&self, sequence: &Sequence, origin: f64, wish: Wish, gradient: &mut LensGradient) -> f64 {
        match self {
            Self::Samples(s) => {
                let mut bar = SamplesCotangent::zero(s);
                for i in 0..s.x.len() {
                    let (share, y) = (s.basis.weights[i], s.y[i] - origin - wish.centre);
                    let twice = 2.0 * wish.scale * share * s.light[i];
                    bar.seeds.image_x[i] = twice * s.x[i];
                    bar.seeds.image_y[i] = twice * y;
                    bar.light[i] = wish.scale * share * (s.x[i] * s.x[i] + y * y - wish.mean_square);
                }
                s.pull_back(sequence, &bar, gradient)
            }
            Self::Cut(map) => {
                let dense = DenseMap::new(map, rows());
                let mut sums = dense.zero_cotangent();
                dispatch(DensePullBack { dense: &dense, origin, wish, sums: &mut sums });
                map.pull_back(sequence, &dense.pull_back(&sums), gradient)
            }
        }
    }
}

fn field_spot(lens: &Lens, field_rad: f64, basis: &'static PupilBasis) -> Option<(f64, LensGradient)> {
    let reference = lens.at_wavelength(lens.reference_um);
    let stop_radius_mm = first_order(&reference).stop_radius_mm;
    let mut colours: Vec<(Sequence, Cloud)> = Vec::with_capacity(lens.wavelengths_um.len());
    for wavelength in &lens.wavelengths_um {
        let sequence = lens.at_wavelength(*wavelength);
        let like = colours.last().map(|(_, cloud)| cloud.samples());
        let Some(samples) = PupilSamples::new(&sequence, field_rad, stop_radius_mm, basis, like) else {
            // Rays of the stop are lost: only tracing them all says which.
            return field_mean_square(lens, field_rad, cells());
        };
        let cloud = Cloud::new(&sequence, samples);
        colours.push((sequence, cloud));
    }
    // Heights are kept small against each other, so that their squares can be subtracted.
    let origin = colours.first().map_or(0.0, |(_, cloud)| cloud.samples().y[0]);
    let moments: Vec<Moments> = colours.iter().map(|(_, cloud)| cloud.moments(origin)).collect();
    if !moments.iter().all(|m| m.light > 0.0) {
        return None;
    }
    let count = moments.len() as f64;
    let centre = moments.iter().map(|m| m.y / m.light).sum::<f64>() / count;
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    let (mut value, mut stop_radius_bar) = (0.0, 0.0);
    for ((sequence, cloud), m) in colours.iter().zip(&moments) {
        let mean_square = m.mean_square(centre);
        value += mean_square / count;
        // The common centroid c is the mean of the wavelengths' own, so what the sum of squares asks of it vanishes.
        let wish = Wish { scale: UM2_PER_MM2 / (count * m.light), centre, mean_square };
        stop_radius_bar += cloud.pull_back(sequence, origin, wish, &mut gradient);
    }
    let wish = FirstOrderCotangent { stop_radius: stop_radius_bar, ..Default::default() };
    pull_back_first_order(&reference, wish, &mut gradient);
    Some((UM2_PER_MM2 * value, gradient))
}
