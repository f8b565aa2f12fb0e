//! Mean squared spots from the samples of a pupil basis.

use std::sync::OnceLock;

use pulp::{Simd, WithSimd};

use super::traced::field_mean_square;
use super::{mean_of, mean_over_fields};
use crate::gradient::LensGradient;
use crate::lanes::Lanes;
use crate::lens::Lens;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use crate::pupil::{
    DenseCotangent, DenseMap, PointsCotangent, PupilBasis, PupilMap, PupilRows, PupilSamples, PupilSampling,
    Quadrature, SamplesCotangent, Sides,
};
use crate::trace::Sequence;
use petzval_base::simd::dispatch;

/// Accurate to 2e-5 of the spots of the paper's triplets and 3e-4 of those of an f/2 lens of eight elements, by
/// comparison with a dense grid of traced rays (`examples/spot_accuracy.rs`); not checked for each lens.
const SAMPLING: PupilSampling = PupilSampling::Degree(8);

/// Number of rows of the pupil if an aperture cuts the beam.
const ROWS: usize = 64;

/// Cells a side of the pupil if rays through the stop are lost.
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
    mean_over_fields(lens, fields_rad, |field| field_spot(lens, field, basis, true))
}

/// The squared RMS spot radius of one field, um^2, over all wavelengths, and its gradient, which is zero without
/// `with_gradient`. `None` if the field has no light.
pub(crate) fn field_mean_square_sampled(
    lens: &Lens,
    field_rad: f64,
    sampling: PupilSampling,
    with_gradient: bool,
) -> Option<(f64, LensGradient)> {
    field_spot(lens, field_rad, PupilBasis::of(sampling), with_gradient)
}

/// The light of a beam on the image plane.
enum Cloud {
    /// At the samples, whose weights integrate it.
    Samples(PupilSamples),
    /// Dense, because an aperture cuts the beam.
    Cut(PupilMap),
}

/// Sums over a cloud, relative to an origin: light, light times x, light times y, light times x^2 + y^2. Half a cloud
/// includes its mirror image, so its sum of x is zero.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    light: f64,
    x: f64,
    y: f64,
    square: f64,
}

impl Moments {
    /// Mean square distance from a point, weighted by light.
    fn mean_square(&self, [x, y]: [f64; 2]) -> f64 {
        (self.square - 2.0 * y * self.y - 2.0 * x * self.x) / self.light + (y * y + x * x)
    }
}

/// Factors of the cotangents of a point p with light w: by p `2 s w (p - c)`, by w `s (|p - c|^2 - m)`.
#[derive(Clone, Copy)]
struct CloudCotangent {
    scale: f64,
    centre: [f64; 2],
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
    origin: [f64; 2],
}

impl WithSimd for DenseMoments<'_> {
    type Output = Moments;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Moments {
        let Self { dense, origin } = self;
        let zero = Lanes::splat(simd, 0.0);
        let sides = dense.sides();
        let (mut light, mut first_x, mut first, mut square) = (zero, zero, zero, zero);
        for row in 0..dense.rows() {
            for turn in 0..dense.turns::<S>(row) * sides.len() {
                let p = dense.points(simd, row, turn / sides.len(), sides[turn % sides.len()]);
                let (x, y) = (p.x - origin[0], p.y - origin[1]);
                light += p.weight;
                first_x += p.weight * x;
                first += p.weight * y;
                square += p.weight * (x * x + y * y);
            }
        }
        let x = if sides.len() == 1 { 0.0 } else { first_x.sum() };
        Moments { light: light.sum(), x, y: first.sum(), square: square.sum() }
    }
}

struct DensePullBack<'a> {
    dense: &'a DenseMap<'a>,
    origin: [f64; 2],
    cloud_bar: CloudCotangent,
    sums: &'a mut DenseCotangent,
}

impl WithSimd for DensePullBack<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { dense, origin, cloud_bar, sums } = self;
        let sides = dense.sides();
        for row in 0..dense.rows() {
            for turn in 0..dense.turns::<S>(row) * sides.len() {
                let p = dense.points(simd, row, turn / sides.len(), sides[turn % sides.len()]);
                let (x, y) =
                    (p.x - (origin[0] + cloud_bar.centre[0]), p.y - (origin[1] + cloud_bar.centre[1]));
                let twice = p.weight * (2.0 * cloud_bar.scale);
                let weight = (x * x + y * y - cloud_bar.mean_square) * cloud_bar.scale;
                let bar = PointsCotangent { x: twice * x, y: twice * y, weight };
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

    /// A point within the cloud, mm.
    fn origin(&self) -> [f64; 2] {
        let s = self.samples();
        [if s.sides == Sides::Mirrored { 0.0 } else { s.x[0] }, s.y[0]]
    }

    fn moments(&self, origin: [f64; 2]) -> Moments {
        match self {
            Self::Samples(s) => {
                let mut sums = Moments::default();
                for (i, share) in s.weights().into_iter().enumerate() {
                    let w = share * s.light[i];
                    let (x, y) = (s.x[i] - origin[0], s.y[i] - origin[1]);
                    sums.light += w;
                    sums.x += w * x;
                    sums.y += w * y;
                    sums.square += w * (x * x + y * y);
                }
                if s.sides == Sides::Mirrored {
                    sums.x = 0.0;
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
    fn pull_back(
        &self,
        sequence: &Sequence,
        origin: [f64; 2],
        cloud_bar: CloudCotangent,
        gradient: &mut LensGradient,
    ) -> f64 {
        match self {
            Self::Samples(s) => {
                let mut bar = SamplesCotangent::zero(s);
                for (i, share) in s.weights().into_iter().enumerate() {
                    let at = [s.x[i], s.y[i]];
                    let [x, y] = [0, 1].map(|axis| at[axis] - origin[axis] - cloud_bar.centre[axis]);
                    let twice = 2.0 * cloud_bar.scale * share * s.light[i];
                    bar.seeds.image_x[i] = twice * x;
                    bar.seeds.image_y[i] = twice * y;
                    bar.light[i] = cloud_bar.scale * share * (x * x + y * y - cloud_bar.mean_square);
                }
                s.pull_back(sequence, &bar, gradient)
            }
            Self::Cut(map) => {
                let dense = DenseMap::new(map, rows());
                let mut sums = dense.zero_cotangent();
                dispatch(DensePullBack { dense: &dense, origin, cloud_bar, sums: &mut sums });
                map.pull_back(sequence, &dense.pull_back(&sums), gradient)
            }
        }
    }
}

fn field_spot(
    lens: &Lens,
    field_rad: f64,
    basis: &'static PupilBasis,
    with_gradient: bool,
) -> Option<(f64, LensGradient)> {
    // Trace the samples of every wavelength.
    let reference = lens.at_wavelength(lens.reference_um);
    let stop_radius_mm = first_order(&reference).stop_radius_mm;
    let mut colours: Vec<(Sequence, Cloud)> = Vec::with_capacity(lens.wavelengths_um.len());
    for wavelength in &lens.wavelengths_um {
        let sequence = lens.at_wavelength(*wavelength);
        let like = colours.last().map(|(_, cloud)| cloud.samples());
        let Some(samples) = PupilSamples::new(&sequence, field_rad, stop_radius_mm, basis, like) else {
            // Rays through the stop are lost: trace all of them.
            return field_mean_square(lens, field_rad, cells());
        };
        let cloud = Cloud::new(&sequence, samples);
        colours.push((sequence, cloud));
    }
    // Compute the moments relative to a point of the cloud, so that the subtraction of squares loses no digits.
    let origin = colours.first().map_or([0.0; 2], |(_, cloud)| cloud.origin());
    let moments: Vec<Moments> = colours.iter().map(|(_, cloud)| cloud.moments(origin)).collect();
    if !moments.iter().all(|m| m.light > 0.0) {
        return None;
    }
    let count = moments.len() as f64;
    let centres: Vec<[f64; 2]> = moments.iter().map(|m| [m.x / m.light, m.y / m.light]).collect();
    let centre = mean_of(&centres);
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    let (mut value, mut stop_radius_bar) = (0.0, 0.0);
    for ((sequence, cloud), m) in colours.iter().zip(&moments) {
        let mean_square = m.mean_square(centre);
        value += mean_square / count;
        if !with_gradient {
            continue;
        }
        // The common centroid c is the mean of the wavelengths' own, so the derivative of the sum of squares by c is zero.
        let cloud_bar = CloudCotangent { scale: UM2_PER_MM2 / (count * m.light), centre, mean_square };
        stop_radius_bar += cloud.pull_back(sequence, origin, cloud_bar, &mut gradient);
    }
    if with_gradient {
        let first_order_bar = FirstOrderCotangent { stop_radius: stop_radius_bar, ..Default::default() };
        pull_back_first_order(&reference, first_order_bar, &mut gradient);
    }
    Some((UM2_PER_MM2 * value, gradient))
}
