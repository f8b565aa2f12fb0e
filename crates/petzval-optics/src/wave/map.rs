//! The wave of a beam over the direction cosines of its rays at the image.

mod forward;

use super::fit::{self, PlaneFit};
use super::opd::ReferenceSphere;
use crate::gradient::LensGradient;
use crate::number::Number;
use crate::pupil::{
    PupilBasis, PupilPolynomial, PupilSamples, SamplesCotangent, Sides, Symmetry, check_points, optical_paths,
};
use crate::trace::{Ray, SOFT_EDGE_MM, Sequence, SquaredHeights, WaveSeeds, aperture_transmission};

/// Largest error of the polynomials for the optical path of a ray, waves.
const TOLERANCE_WAVES: f64 = 2e-3;

/// Degrees of the polynomials, in the order of trial.
const DEGREES: [usize; 4] = [8, 12, 16, 20];

/// One field at one wavelength: amplitude and phase over `q = (l - l_0, m - m_0) / scale`, with l and m the direction
/// cosines from a ray's point on the reference sphere to the centre of the sphere.
///
/// The phase of a ray is its optical path W to the sphere. At a point x of the image plane, relative to the centre, the
/// wave from the sphere is `exp(i k (W + n' x.d))`. The sphere goes through the exit pupil, where the rim of the beam
/// is sharp.
pub(crate) struct WaveMap {
    pub samples: PupilSamples,
    pub sphere: ReferenceSphere,
    /// Middle of the direction cosines, and half of their range with a margin.
    pub middle: [f64; 2],
    pub scale: [f64; 2],
    /// Index behind the lens, signed.
    pub n_image: f64,
    even: PlaneFit,
    odd: Option<PlaneFit>,
    /// Points of the samples, and the direction cosines of their rays.
    q: Vec<[f64; 2]>,
    direction: [Vec<f64>; 3],
    /// Derivatives of q by the stop coordinates at the samples: [q_x by p_x, by p_y, q_y by p_x, by p_y].
    q_by_p: [Vec<f64>; 4],
    /// Optical path, mm, of the first sample.
    path_origin_mm: f64,
    path: Vec<f64>,
    /// Light per unit of q area.
    density: Vec<f64>,
    /// Stop coordinates.
    stop: [Vec<f64>; 2],
    /// Squared heights at clear apertures: surface, semi-diameter and coefficients.
    heights: Vec<(usize, f64, Vec<f64>)>,
}

/// A wave along one row of q_y.
pub(crate) struct WaveRow {
    pub q_y: f64,
    /// Coefficients of the powers of q_x, as those below.
    pub path: Vec<f64>,
    pub density: Vec<f64>,
    pub stop: [Vec<f64>; 2],
    pub heights: Vec<Vec<f64>>,
}

/// A wave at one point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WavePoint {
    /// Optical path minus that of the first sample, mm.
    pub path_mm: f64,
    /// Amplitude: the root of the light per unit of q area through the apertures, divided by the root of the cosine to
    /// the axis, because a slanted wave carries less light through the image plane.
    pub amplitude: f64,
    /// Light per unit of q area through the apertures.
    pub light: f64,
    /// Energy on the image plane per unit of q area: the light divided by the cosine to the axis. At a soft edge it
    /// exceeds the squared amplitude by the light that a hard edge diffracts far away.
    pub energy: f64,
}

/// Cotangents of a point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WavePointBar {
    /// By the optical path, 1/mm.
    pub path: f64,
    /// By the amplitude.
    pub amplitude: f64,
    /// By the light.
    pub light: f64,
    /// By the energy.
    pub energy: f64,
}

/// Cotangents of the map's coefficients, summed over rows.
pub(crate) struct WaveCotangent {
    path: Vec<f64>,
    density: Vec<f64>,
    stop: [Vec<f64>; 2],
    heights: Vec<Vec<f64>>,
    semi_diameters: Vec<f64>,
    /// By the position of the centre, 1/mm.
    pub origin: [f64; 2],
    /// By the index behind the lens, apart from the optical path of the rays.
    pub n_image: f64,
}

/// Changes of the map's coefficients, of the centre (mm) and of the index behind the lens, laid out as their cotangents.
pub(crate) type WaveTangent = WaveCotangent;

impl WaveCotangent {
    /// Adds to the cotangent of the semi-diameter of a clear aperture, in the order of [`WaveMap::semi_diameters_mm`].
    pub fn add_semi_diameter(&mut self, k: usize, bar: f64) {
        self.semi_diameters[k] += bar;
    }
}

impl WaveMap {
    /// The wave by polynomials of the least degree within the tolerance. `None` if no degree is, if rays through the
    /// stop are lost, or in a system with thin lenses. `like`, the same field at another wavelength, makes aiming
    /// faster.
    pub fn new(
        sequence: &Sequence,
        field_rad: f64,
        stop_radius_mm: f64,
        origin_mm: [f64; 2],
        like: Option<&Self>,
    ) -> Option<Self> {
        if !sequence.has_optical_paths() {
            return None;
        }
        let least = like.map_or(0, |map| map.samples.basis.degree);
        DEGREES.into_iter().filter(|d| *d >= least).find_map(|degree| {
            let basis = PupilBasis::of_degree(degree);
            let near = like.map(|map| &map.samples);
            let samples = PupilSamples::new(sequence, field_rad, stop_radius_mm, basis, near)?;
            let map = Self::through(sequence, samples, origin_mm)?;
            map.is_good(sequence).then_some(map)
        })
    }

    fn through(sequence: &Sequence, samples: PupilSamples, origin_mm: [f64; 2]) -> Option<Self> {
        // Follow the rays to the reference sphere.
        let (basis, sides) = (samples.basis, samples.sides);
        let n_image = sequence.surfaces.last().map_or(1.0, |s| s.n_after);
        let sphere = ReferenceSphere::through_exit_pupil(sequence, origin_mm).rounded();
        let direction = samples.direction();
        let optical_path = samples.optical_path(sequence);
        let met: Vec<(f64, [f64; 3])> = (0..samples.x.len())
            .map(|i| sphere.run([samples.x[i], samples.y[i]], [0, 1, 2].map(|k| direction[k][i])))
            .collect();
        let [l, m]: [Vec<f64>; 2] = [0, 1].map(|k| met.iter().map(|(_, towards)| towards[k]).collect());
        // Find the range of the cosines, rounded to two digits, so that small changes of a lens do not move the grid.
        let rim = |of: &[f64], symmetry| {
            let at_checks = basis.at_checks(&basis.fit(of, sides, symmetry), sides);
            let all = of.iter().chain(&at_checks);
            all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)))
        };
        let (low_x, high_x) = match sides {
            Sides::Mirrored => {
                let (low, high) = rim(&l, Symmetry::Odd);
                let high = high.max(-low);
                (-high, high)
            }
            Sides::Both => rim(&l, Symmetry::Odd),
        };
        let (low_y, high_y) = rim(&m, Symmetry::Even);
        let range = |low: f64, high: f64| {
            let half = rounded_up(0.5 * (high - low) * 1.02);
            let middle = 0.5 * (low + high);
            // Round the middle to a tenth of the range.
            ((middle / (0.1 * half)).round() * 0.1 * half, half * 1.1)
        };
        let ((middle_x, scale_x), (middle_y, scale_y)) = (range(low_x, high_x), range(low_y, high_y));
        let (middle, scale) = ([middle_x, middle_y], [scale_x, scale_y]);
        if !(scale_x > 0.0 && scale_y > 0.0) {
            return None;
        }
        let q: Vec<[f64; 2]> =
            l.iter().zip(m).map(|(l, m)| [(l - middle[0]) / scale[0], (m - middle[1]) / scale[1]]).collect();
        let (even, odd) = match sides {
            Sides::Mirrored => (
                PlaneFit::new(&q, basis.degree, Some(Symmetry::Even))?,
                Some(PlaneFit::new(&q, basis.degree, Some(Symmetry::Odd))?),
            ),
            Sides::Both => (PlaneFit::new(&q, basis.degree, None)?, None),
        };
        // Compute the light per unit of q: the light per share of the stop, divided by the Jacobian of q by the stop
        // coordinates.
        let [qx, qy]: [Vec<f64>; 2] = [0, 1].map(|axis| q.iter().map(|q| q[axis]).collect());
        let [xx, xy] = basis.slopes(&basis.fit(&qx, sides, Symmetry::Odd), sides);
        let [yx, yy] = basis.slopes(&basis.fit(&qy, sides, Symmetry::Even), sides);
        let area = |i: usize| (xx[i] * yy[i] - xy[i] * yx[i]).abs();
        let density: Vec<f64> =
            (0..q.len()).map(|i| samples.light[i] / (std::f64::consts::PI * area(i))).collect();
        // Fit paths, light, stop coordinates and squared heights as polynomials of q.
        let paths: Vec<f64> = (0..q.len()).map(|i| optical_path[i] + n_image * met[i].0).collect();
        let path_origin_mm = paths[0];
        let relative: Vec<f64> = paths.iter().map(|p| p - path_origin_mm).collect();
        let points = sides.points(&basis.samples);
        let [p_x, p_y]: [Vec<f64>; 2] = [0, 1].map(|axis| points.iter().map(|p| p[axis]).collect());
        let heights = samples.heights.iter().map(|h| {
            (h.surface, sequence.surfaces[h.surface].semi_diameter_mm, even.fit(&h.values[..q.len()]))
        });
        let heights = heights.collect();
        Some(Self {
            path: even.fit(&relative),
            density: even.fit(&density),
            stop: [odd.as_ref().unwrap_or(&even).fit(&p_x), even.fit(&p_y)],
            heights,
            q_by_p: [xx, xy, yx, yy],
            sphere,
            middle,
            scale,
            n_image,
            even,
            odd,
            q,
            path_origin_mm,
            direction,
            samples,
        })
    }

    /// Whether the polynomials agree with the tracing of other rays.
    fn is_good(&self, sequence: &Sequence) -> bool {
        let s = &self.samples;
        let points = s.sides.points(&check_points());
        let Some(checks) = s.trace_checks(sequence, std::iter::empty()) else { return false };
        let paths = optical_paths(sequence, s.field_rad, |i| checks.aimed.launch_of(i), &checks.rays);
        let tolerance = TOLERANCE_WAVES * 1e-3 * sequence.wavelength_um;
        (0..points.len()).all(|i| {
            let Ray { position: [x, y, _], direction } = checks.rays.ray(i);
            let (run, [l, m, _]) = self.sphere.run([x, y], direction);
            let q = [(l - self.middle[0]) / self.scale[0], (m - self.middle[1]) / self.scale[1]];
            let path = paths[i] + self.n_image * run;
            let found = self.even.value(&self.path, q) + self.path_origin_mm;
            let p_x = self.odd.as_ref().unwrap_or(&self.even).value(&self.stop[0], q);
            let p_y = self.even.value(&self.stop[1], q);
            (path - found).abs() < tolerance && (p_x - points[i][0]).hypot(p_y - points[i][1]) < 1e-3
        })
    }

    /// The polynomials along a row of q_y.
    pub fn row(&self, q_y: f64) -> WaveRow {
        let odd = self.odd.as_ref().unwrap_or(&self.even);
        WaveRow {
            q_y,
            path: self.even.along(&self.path, q_y),
            density: self.even.along(&self.density, q_y),
            stop: [odd.along(&self.stop[0], q_y), self.even.along(&self.stop[1], q_y)],
            heights: self.heights.iter().map(|(.., c)| self.even.along(c, q_y)).collect(),
        }
    }

    /// Semi-diameters of the clear apertures whose squared heights a row holds, mm.
    pub fn semi_diameters_mm(&self) -> impl Iterator<Item = f64> {
        self.heights.iter().map(|(_, semi, _)| *semi)
    }

    /// Cosine to the axis at a point.
    pub fn slant(&self, q_y: f64, q_x: f64) -> f64 {
        let [l, m] =
            [self.middle[0] + self.scale[0] * q_x, self.middle[1] + self.scale[1] * q_y].map(|v| v * v);
        (1.0 - l - m).max(1e-6).sqrt()
    }

    /// The wave at a point of a row. The rim of the stop is soft over the share `soft` of its radius, because the grid
    /// samples it.
    pub fn point(&self, row: &WaveRow, q_x: f64, soft: f64) -> WavePoint {
        let p = [fit::at(&row.stop[0], q_x), fit::at(&row.stop[1], q_x)];
        let (inside, _) = soft_rim(p[0].hypot(p[1]), soft);
        if inside == 0.0 {
            return WavePoint::default();
        }
        let mut share = inside;
        for ((_, semi, _), row) in self.heights.iter().zip(&row.heights) {
            share *= aperture_transmission(fit::at(row, q_x).max(0.0).sqrt(), *semi).0;
        }
        let density = fit::at(&row.density, q_x).max(0.0);
        WavePoint {
            path_mm: fit::at(&row.path, q_x),
            amplitude: (density / self.slant(row.q_y, q_x)).sqrt() * share,
            light: density * share,
            energy: density * share / self.slant(row.q_y, q_x),
        }
    }

    /// Adds the cotangents of a point of a row to `row_bar`.
    pub fn pull_back_point(
        &self,
        row: &WaveRow,
        q_x: f64,
        soft: f64,
        bar: WavePointBar,
        row_bar: &mut WaveRow,
        sums: &mut WaveCotangent,
    ) {
        // Evaluate the rim and the apertures again.
        let p = [fit::at(&row.stop[0], q_x), fit::at(&row.stop[1], q_x)];
        let radius = p[0].hypot(p[1]);
        let (inside, by_radius) = soft_rim(radius, soft);
        if inside == 0.0 {
            return;
        }
        let edges = self.heights.iter().zip(&row.heights).map(|((_, semi, _), row)| {
            let r = fit::at(row, q_x).max(1e-24).sqrt();
            let (through, by) = aperture_transmission(r, *semi);
            (through, by, r)
        });
        let edges: Vec<(f64, f64, f64)> = edges.collect();
        let others = |skip: usize| {
            edges.iter().enumerate().filter(|(k, _)| *k != skip).map(|(_, e)| e.0).product::<f64>()
        };
        let all = others(usize::MAX);
        let density = fit::at(&row.density, q_x).max(1e-300);
        // Turn the cotangent of the energy into one of the light, and divide that of the amplitude by the slant.
        let per_slant = 1.0 / self.slant(row.q_y, q_x).sqrt();
        let root = density.sqrt();
        let light = bar.light + bar.energy * per_slant * per_slant;
        let bar = WavePointBar { amplitude: bar.amplitude * per_slant, light, ..bar };
        // Add the cotangents of path, density, rim and apertures.
        fit::add_moments(&mut row_bar.path, bar.path, q_x);
        let share = inside * all;
        let density_bar = bar.amplitude * share * 0.5 / root + bar.light * share;
        fit::add_moments(&mut row_bar.density, density_bar, q_x);
        let share_bar = bar.amplitude * root + bar.light * density;
        let inside_bar = share_bar * all * by_radius;
        if inside_bar != 0.0 {
            for axis in 0..2 {
                fit::add_moments(&mut row_bar.stop[axis], inside_bar * p[axis] / radius, q_x);
            }
        }
        for (k, (_, by, r)) in edges.iter().enumerate() {
            let bar = share_bar * inside * others(k) * by;
            fit::add_moments(&mut row_bar.heights[k], bar * 0.5 / r, q_x);
            sums.semi_diameters[k] -= bar;
        }
    }

    /// An empty row for [`WaveMap::pull_back_point`].
    pub fn zero_row(&self, like: &WaveRow) -> WaveRow {
        let zero = |row: &Vec<f64>| vec![0.0; row.len()];
        WaveRow {
            q_y: like.q_y,
            path: zero(&like.path),
            density: zero(&like.density),
            stop: like.stop.each_ref().map(zero),
            heights: like.heights.iter().map(zero).collect(),
        }
    }

    /// Adds the cotangents of the coefficients, from those of a row.
    pub fn pull_back_row(&self, row_bar: &WaveRow, q_y: f64, sums: &mut WaveCotangent) {
        let odd = self.odd.as_ref().unwrap_or(&self.even);
        self.even.pull_back_along(&row_bar.path, q_y, &mut sums.path);
        self.even.pull_back_along(&row_bar.density, q_y, &mut sums.density);
        odd.pull_back_along(&row_bar.stop[0], q_y, &mut sums.stop[0]);
        self.even.pull_back_along(&row_bar.stop[1], q_y, &mut sums.stop[1]);
        for (row, sum) in row_bar.heights.iter().zip(&mut sums.heights) {
            self.even.pull_back_along(row, q_y, sum);
        }
    }

    /// All-zero cotangents.
    pub fn zero_cotangent(&self) -> WaveCotangent {
        let zero = |c: &Vec<f64>| vec![0.0; c.len()];
        WaveCotangent {
            path: zero(&self.path),
            density: zero(&self.density),
            stop: self.stop.each_ref().map(zero),
            heights: self.heights.iter().map(|(.., c)| zero(c)).collect(),
            semi_diameters: vec![0.0; self.heights.len()],
            origin: [0.0; 2],
            n_image: 0.0,
        }
    }

    /// Adds the gradient to `gradient`; returns the derivative by the stop radius. The cotangent of the origin is added to
    /// `sums`.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        sums: &mut WaveCotangent,
        gradient: &mut LensGradient,
    ) -> f64 {
        // From the coefficients to the values at the samples, and to the points q at which they are.
        let s = &self.samples;
        let count = self.q.len();
        let mut q_bar = vec![[0.0; 2]; count];
        let (mut path_bar, mut density_bar) = (vec![0.0; count], vec![0.0; count]);
        let odd = self.odd.as_ref().unwrap_or(&self.even);
        self.even.pull_back(&self.path, &sums.path, &mut path_bar, &mut q_bar);
        self.even.pull_back(&self.density, &sums.density, &mut density_bar, &mut q_bar);
        // The stop coordinates of the samples are fixed, but their points q move.
        let mut fixed = vec![0.0; count];
        odd.pull_back(&self.stop[0], &sums.stop[0], &mut fixed, &mut q_bar);
        self.even.pull_back(&self.stop[1], &sums.stop[1], &mut fixed, &mut q_bar);
        let mut samples_bar = SamplesCotangent::zero(s);
        for ((surface, _, coefficients), (bar, semi_bar)) in
            self.heights.iter().zip(sums.heights.iter().zip(&sums.semi_diameters))
        {
            gradient[(*surface, Number::SemiDiameter)] += semi_bar;
            let mut height = SquaredHeights::zero(*surface, count);
            self.even.pull_back(coefficients, bar, &mut height.values[..count], &mut q_bar);
            samples_bar.seeds.heights.push(height);
        }
        self.pull_back_density(&density_bar, &mut samples_bar.light, &mut q_bar);
        // From W = L + n' run and q = (towards - middle) / scale to positions and directions on the image plane.
        let mut wave = WaveSeeds::zero(count);
        for i in 0..count {
            wave.optical_path[i] = path_bar[i];
            let (place, d) = ([s.x[i], s.y[i]], [0, 1, 2].map(|k| self.direction[k][i]));
            sums.n_image += path_bar[i] * self.sphere.run(place, d).0;
            let towards_bar = [0, 1].map(|axis| q_bar[i][axis] / self.scale[axis]);
            let (place_bar, direction_bar) =
                self.sphere.pull_back(place, d, self.n_image * path_bar[i], towards_bar);
            (samples_bar.seeds.image_x[i], samples_bar.seeds.image_y[i]) = (place_bar[0], place_bar[1]);
            for axis in 0..2 {
                wave.direction[axis][i] = direction_bar[axis];
                sums.origin[axis] -= place_bar[axis];
            }
        }
        // From the index behind the lens and from the samples to the numbers of the lens.
        samples_bar.seeds.wave = Some(wave);
        let last = sequence.surfaces.len() - 1;
        for i in 0..=last {
            gradient[(i, Number::Index)] +=
                sequence.glass_index_bar(i, |j| if j == last { sums.n_image } else { 0.0 });
        }
        s.pull_back(sequence, &samples_bar, gradient)
    }

    /// Pulls cotangents of the density back to the light and to the points q.
    fn pull_back_density(&self, density_bar: &[f64], light_bar: &mut [f64], q_bar: &mut [[f64; 2]]) {
        let (basis, sides) = (self.samples.basis, self.samples.sides);
        let [xx, xy, yx, yy] = &self.q_by_p;
        let count = density_bar.len();
        let mut by: [Vec<f64>; 4] = [0, 1, 2, 3].map(|_| vec![0.0; count]);
        for i in 0..count {
            let determinant = xx[i] * yy[i] - xy[i] * yx[i];
            let per_area = 1.0 / (std::f64::consts::PI * determinant.abs());
            light_bar[i] += density_bar[i] * per_area;
            let bar = -density_bar[i] * self.samples.light[i] * per_area / determinant;
            by[0][i] = bar * yy[i];
            by[1][i] = -bar * yx[i];
            by[2][i] = -bar * xy[i];
            by[3][i] = bar * xx[i];
        }
        let mut of_x = vec![0.0; count];
        let mut of_y = vec![0.0; count];
        let x: PupilPolynomial = basis.pull_back_slopes([&by[0], &by[1]], sides, Symmetry::Odd);
        let y: PupilPolynomial = basis.pull_back_slopes([&by[2], &by[3]], sides, Symmetry::Even);
        basis.pull_back_fit(&x, sides, &mut of_x);
        basis.pull_back_fit(&y, sides, &mut of_y);
        for i in 0..count {
            q_bar[i][0] += of_x[i];
            q_bar[i][1] += of_y[i];
        }
    }
}

/// Transmission of the rim of the stop, soft over `soft` on either side, and its derivative by the radius.
fn soft_rim(radius: f64, soft: f64) -> (f64, f64) {
    // The same step as that of a clear aperture, with another width.
    let scale = SOFT_EDGE_MM / soft;
    let (through, by) = aperture_transmission(radius * scale, scale);
    (through, by * scale)
}

/// A number rounded up to two digits.
fn rounded_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return value;
    }
    let unit = 10f64.powf(value.log10().floor() - 1.0);
    (value / unit).ceil() * unit
}
