//! A merit by residuals: where rays that sample the stop land, about the centroid of their field.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::{Better, Merit};
use crate::constraint::ClearRadii;
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::number::Number;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use crate::pupil::{PupilBasis, PupilSampling, Sides, aim_at_pupil, chief_ray, pull_back_chief};
use crate::trace::{
    AimedRays, LandingJacobian, RayBundle, Reaim, Seeds, Sequence, SquaredHeights, landing_jacobian,
    pull_back, trace_with_heights,
};

const UM_PER_MM: f64 = 1e3;

/// The margin of a mount beyond the beam, mm.
pub(crate) const MOUNT_MM: f64 = 0.1;

/// The p-mean over fields of RMS spots: `(sum w_f rms_f^p / sum w_f)^(1/p)`, um, about the centroid of each field over all
/// wavelengths.
///
/// Its residuals are the transverse aberrations of rays that sample the whole stop: clear apertures do not cut them.
#[derive(Clone, Debug, PartialEq)]
pub struct SpotResiduals {
    /// Field angles, rad.
    pub fields_rad: Vec<f64>,
    /// Weight of each field.
    pub field_weights: Vec<f64>,
    /// Wavelengths, um, all of the same weight.
    pub wavelengths_um: Vec<f64>,
    /// Rays.
    pub sampling: PupilSampling,
    /// The exponent p: 1 for the mean RMS spot, 2 for the root of the mean square.
    pub power: f64,
}

/// Rays of a lens, traced to the image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Landings {
    /// RMS spot of each field about its centroid, all wavelengths together, um.
    pub rms_um: Vec<f64>,
    /// Launch points of the rays, by field and wavelength: where the aiming of a similar lens starts.
    launches: Vec<Vec<[f64; 2]>>,
    /// How far the beams reach.
    pub reach: Reach,
}

/// What becomes of rays that do not reach the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lost {
    /// One of them is enough for no result: a merit must not improve by losing rays.
    Refused,
    /// They are left out, as long as every field keeps half of its rays.
    LeftOut,
}

/// Least share of the rays of a field that must arrive where lost ones are left out.
const LEAST_ARRIVING: f64 = 0.5;

/// Largest beam radius on each surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Reach {
    /// Radius at which a surface must be clear, mm.
    pub clear_mm: Vec<f64>,
    /// The field, wavelength and point of the pupil whose ray needs that radius.
    widest: Vec<(usize, usize, [f64; 2])>,
}

impl Reach {
    /// Radius 0 on every surface, before the first beam is added.
    pub fn none(lens: &Lens) -> Self {
        let surfaces = lens.surfaces.len();
        Self { clear_mm: vec![0.0; surfaces], widest: vec![(0, 0, [0.0; 2]); surfaces] }
    }

    fn widen(&mut self, heights: &[SquaredHeights], points: &[[f64; 2]], [field, colour]: [usize; 2]) {
        for h in heights {
            for (u, p) in h.values.iter().zip(points) {
                if u.sqrt() > self.clear_mm[h.surface] {
                    self.clear_mm[h.surface] = u.sqrt();
                    self.widest[h.surface] = (field, colour, *p);
                }
            }
        }
    }
}

/// Points on half of the rim of the stop.
const RIM: [[f64; 2]; 7] = [
    [0.0, -1.0],
    [0.5, -0.866_025_403_784_438_6],
    [0.866_025_403_784_438_6, -0.5],
    [1.0, 0.0],
    [0.866_025_403_784_438_6, 0.5],
    [0.5, 0.866_025_403_784_438_6],
    [0.0, 1.0],
];

/// A beam of one field at one wavelength.
struct Beam {
    sequence: Sequence,
    aimed: AimedRays,
}

/// A point in the middle of a beam from its first ray; half a beam is symmetric about x = 0.
fn origin_of([x, y]: [f64; 2], is_half: bool) -> [f64; 2] {
    [if is_half { 0.0 } else { x }, y]
}

impl SpotResiduals {
    /// The mean RMS spot over a lens's own fields and wavelengths.
    pub fn new(lens: &Lens) -> Self {
        let fields_rad: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
        Self {
            field_weights: vec![1.0; fields_rad.len()],
            fields_rad,
            wavelengths_um: lens.wavelengths_um.clone(),
            sampling: PupilSampling::Degree(6),
            power: 1.0,
        }
    }

    /// The field furthest from the axis, rad.
    pub fn outermost_field_rad(&self) -> f64 {
        self.fields_rad.iter().fold(0.0_f64, |a, b| if b.abs() > a.abs() { *b } else { a })
    }

    /// The weighted mean of `rms^p` over the fields.
    fn mean_power(&self, rms_um: &[f64]) -> f64 {
        let total: f64 = self.field_weights.iter().sum();
        rms_um.iter().zip(&self.field_weights).map(|(rms, w)| w / total * rms.powf(self.power)).sum()
    }

    /// The square of the merit, um^2.
    pub(crate) fn square_um2(&self, landings: &Landings) -> f64 {
        self.mean_power(&landings.rms_um).powf(2.0 / self.power)
    }

    /// Derivatives of the squared merit by the mean square spot of each field, both in um^2.
    fn by_square(&self, rms_um: &[f64]) -> Vec<f64> {
        let (p, total) = (self.power, self.field_weights.iter().sum::<f64>());
        let mean = self.mean_power(rms_um);
        let of_field =
            |(rms, w): (&f64, &f64)| mean.powf(2.0 / p - 1.0) * w / total * rms.max(1e-6).powf(p - 2.0);
        rms_um.iter().zip(&self.field_weights).map(of_field).collect()
    }

    /// Rays of a field and a wavelength through points of the stop. Rays that cannot be aimed are lost.
    fn beam(
        &self,
        lens: &Lens,
        points: &[[f64; 2]],
        [field, colour]: [usize; 2],
        stop_radius_mm: f64,
        near_mm: Option<&[[f64; 2]]>,
        lost: Lost,
    ) -> Option<Beam> {
        let sequence = lens.at_wavelength(self.wavelengths_um[colour]);
        let aimed = aim_at_pupil(&sequence, self.fields_rad[field], stop_radius_mm, points, near_mm);
        let is_whole = lost == Lost::LeftOut || (0..points.len()).all(|i| aimed.is_aimed(i));
        is_whole.then_some(Beam { sequence, aimed })
    }

    /// Sample points of the pupil, and their shares of its area.
    fn samples(&self, sides: Sides) -> (Vec<[f64; 2]>, Vec<f64>) {
        let basis = PupilBasis::of(self.sampling);
        (sides.points(&basis.samples), sides.weights(&basis.weights))
    }

    /// How far rays on the rim of the stop reach; `None` if one of them is lost.
    pub(crate) fn rim(&self, lens: &Lens, sides: Sides, stop_radius_mm: f64) -> Option<Reach> {
        let mut reach = Reach::none(lens);
        let points = sides.points(&RIM);
        for field in 0..self.fields_rad.len() {
            for colour in 0..self.wavelengths_um.len() {
                let beam = self.beam(lens, &points, [field, colour], stop_radius_mm, None, Lost::Refused)?;
                let mut rays = beam.aimed.bundle(&beam.sequence);
                let mut heights: Vec<SquaredHeights> =
                    (0..lens.surfaces.len()).map(|s| SquaredHeights::zero(s, points.len())).collect();
                trace_with_heights(&beam.sequence, &mut rays, &mut heights);
                if !(0..points.len()).all(|i| rays.fate(i).reaches_image()) {
                    return None;
                }
                reach.widen(&heights, &points, [field, colour]);
            }
        }
        Some(reach)
    }

    /// Traces the rays; `None` if too many of them are lost. `near`, the landings of a similar lens, makes aiming quicker.
    ///
    /// With `by_rim` the reach of the beams is that of rays on the rim of the stop, else that of the sampled rays.
    pub(crate) fn landings(
        &self,
        lens: &Lens,
        sides: Sides,
        near: Option<&Landings>,
        by_rim: bool,
        lost: Lost,
    ) -> Option<Landings> {
        let (points, weights) = self.samples(sides);
        let is_half = sides == Sides::Mirrored;
        let stop_radius_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        let surfaces = lens.surfaces.len();
        let colours = self.wavelengths_um.len();
        let mut launches = Vec::with_capacity(self.fields_rad.len() * colours);
        let mut rms_um = Vec::with_capacity(self.fields_rad.len());
        let mut reach = if by_rim { self.rim(lens, sides, stop_radius_mm)? } else { Reach::none(lens) };
        for field in 0..self.fields_rad.len() {
            // Heights are taken about the first ray, so that their squares can be subtracted.
            let (mut origin, mut sums) = (None, [0.0; 4]);
            for colour in 0..colours {
                let guesses = near.and_then(|n| n.launches.get(field * colours + colour)).or(if colour > 0 {
                    launches.last()
                } else {
                    None
                });
                let guesses = guesses.map(Vec::as_slice);
                let beam = self.beam(lens, &points, [field, colour], stop_radius_mm, guesses, lost)?;
                let mut rays = beam.aimed.bundle(&beam.sequence);
                let mut heights: Vec<SquaredHeights> = if by_rim {
                    Vec::new()
                } else {
                    (0..surfaces).map(|s| SquaredHeights::zero(s, points.len())).collect()
                };
                trace_with_heights(&beam.sequence, &mut rays, &mut heights);
                let [x, y] = rays.image_xy();
                for (i, weight) in weights.iter().enumerate() {
                    match (rays.fate(i).reaches_image(), lost) {
                        (false, Lost::Refused) => return None,
                        (false, Lost::LeftOut) => continue,
                        (true, _) => {}
                    }
                    let [at_x, at_y] = *origin.get_or_insert(origin_of([x[i], y[i]], is_half));
                    let (x, y) = (x[i] - at_x, y[i] - at_y);
                    sums[0] += weight;
                    sums[1] += weight * y;
                    sums[2] += weight * (x * x + y * y);
                    sums[3] += weight * x;
                }
                reach.widen(&heights, &points, [field, colour]);
                launches.push((0..points.len()).map(|i| beam.aimed.launch_of(i)).collect());
            }
            if sums[0] < LEAST_ARRIVING * colours as f64 {
                return None;
            }
            // Half a beam and its mirror image have their mean at x = 0.
            let mean_x = if is_half { 0.0 } else { sums[3] };
            let square = (sums[2] - sums[1] * sums[1] / sums[0] - mean_x * mean_x / sums[0]) / sums[0];
            rms_um.push(UM_PER_MM * square.max(0.0).sqrt());
        }
        Some(Landings { rms_um, launches, reach })
    }

    /// The merit, um.
    pub(crate) fn size_um(&self, lens: &Lens, lost: Lost) -> Option<f64> {
        let sides = Sides::of(&lens.at_wavelength(lens.reference_um));
        let landings = self.landings(lens, sides, None, false, lost)?;
        Some(self.square_um2(&landings).sqrt()).filter(|value| value.is_finite())
    }

    /// The products of the columns of the linearised residuals: their derivatives by each of the numbers, then by the logarithm
    /// of the stop radius, then the residuals themselves, um. The last product is the squared merit.
    pub(crate) fn gram(
        &self,
        lens: &Lens,
        sides: Sides,
        landings: &Landings,
        numbers: &[(usize, Number)],
    ) -> Option<DMatrix<f64>> {
        self.gram_with(lens, sides, landings, numbers, Lost::Refused, |_, _, _| Some(()))
    }

    /// [`SpotResiduals::gram`] with further products for each field, mm^2, which `add_further` finds from the means of the columns of x and of y.
    fn gram_with(
        &self,
        lens: &Lens,
        sides: Sides,
        landings: &Landings,
        numbers: &[(usize, Number)],
        lost: Lost,
        add_further: impl Fn(usize, &[DVector<f64>; 2], &mut DMatrix<f64>) -> Option<()>,
    ) -> Option<DMatrix<f64>> {
        let (points, weights) = self.samples(sides);
        let is_half = sides == Sides::Mirrored;
        let stop_radius_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        let colours = self.wavelengths_um.len();
        let columns = numbers.len() + 2;
        let mut gram = DMatrix::<f64>::zeros(columns, columns);
        for (field, weight) in self.by_square(&landings.rms_um).into_iter().enumerate() {
            let mut of_field = DMatrix::<f64>::zeros(columns, columns);
            let mut means = [0, 1].map(|_| DVector::<f64>::zeros(columns));
            let (mut origin, mut lost_share) = (None, 0.0);
            for colour in 0..colours {
                let guesses = landings.launches.get(field * colours + colour).map(Vec::as_slice);
                let beam = self.beam(lens, &points, [field, colour], stop_radius_mm, guesses, lost)?;
                let landing = landing_jacobian(&beam.sequence, &beam.aimed, numbers);
                if lost == Lost::Refused && landing.arrives.contains(&false) {
                    return None;
                }
                let Some(first) = landing.arrives.iter().position(|arrives| *arrives) else { continue };
                let first = [0, 1].map(|axis| landing.landing[axis][first]);
                let origin = *origin.get_or_insert(origin_of(first, is_half));
                let share = |(weight, arrives): (&f64, &bool)| if *arrives { *weight } else { 0.0 };
                let arriving: Vec<f64> = weights.iter().zip(&landing.arrives).map(share).collect();
                add_gram(&landing, &arriving, origin, is_half, colours as f64, &mut of_field, &mut means);
                let lost_weights = weights.iter().zip(&landing.arrives).filter(|(_, arrives)| !**arrives);
                lost_share += lost_weights.map(|(weight, _)| weight / colours as f64).sum::<f64>();
            }
            // The rays that arrive stand for all.
            let arriving_share = 1.0 - lost_share;
            of_field /= arriving_share;
            means.iter_mut().for_each(|mean| *mean /= arriving_share);
            // About the centroid of the field.
            let [mean_x, mean_y] = &means;
            of_field -= mean_y * mean_y.transpose();
            if !is_half {
                of_field -= mean_x * mean_x.transpose();
            }
            add_further(field, &means, &mut of_field)?;
            gram += of_field * (weight * UM_PER_MM * UM_PER_MM);
        }
        Some(gram)
    }

    /// Gram matrix of the ray displacements, um^2: the products of the derivatives of the landing points by each of the numbers and by the
    /// logarithm of the stop radius.
    ///
    /// Landing points are taken about the centroid of their field. With `places` they are taken about the chief ray of their field, and the
    /// motion of the chief rays is added. Lost rays are left out; `None` if most rays of a field are lost.
    pub(crate) fn motion(
        &self,
        lens: &Lens,
        numbers: &[(usize, Number)],
        places: bool,
    ) -> Option<DMatrix<f64>> {
        let lost = Lost::LeftOut;
        let landings = self.landings(lens, Sides::Both, None, false, lost)?;
        let reference = lens.at_wavelength(lens.reference_um);
        let count = numbers.len();
        let gram =
            self.gram_with(lens, Sides::Both, &landings, numbers, lost, |field, means, of_field| {
                if !places {
                    return Some(());
                }
                let chief = chief_ray(&reference, self.fields_rad[field])?;
                for (axis, mean) in means.iter().enumerate() {
                    let mut by = LensGradient::zero(lens.surfaces.len());
                    let along = [0, 1].map(|a| if a == axis { 1.0 } else { 0.0 });
                    pull_back_chief(&reference, &chief, along, &mut by);
                    let chief = DVector::from_fn(count + 2, |i, _| numbers.get(i).map_or(0.0, |n| by[*n]));
                    let about = mean - &chief;
                    *of_field += &chief * chief.transpose() + &about * about.transpose();
                }
                Some(())
            })?;
        Some(gram.view((0, 0), (count + 1, count + 1)).into_owned())
    }

    /// The gradient of the squared merit, um^2 per unit of each number.
    fn gradient(&self, lens: &Lens, sides: Sides, landings: &Landings) -> Option<LensGradient> {
        let (points, weights) = self.samples(sides);
        let is_half = sides == Sides::Mirrored;
        let reference = lens.at_wavelength(lens.reference_um);
        let stop_radius_mm = first_order(&reference).stop_radius_mm;
        let colours = self.wavelengths_um.len();
        let mut gradient = LensGradient::zero(lens.surfaces.len());
        let mut stop_bar = 0.0;
        for (field, weight) in self.by_square(&landings.rms_um).into_iter().enumerate() {
            // Trace the field, for its centroid over all wavelengths.
            let mut traced = Vec::with_capacity(colours);
            let (mut light, mut centre) = (0.0, [0.0; 2]);
            for colour in 0..colours {
                let guesses = landings.launches.get(field * colours + colour).map(Vec::as_slice);
                let beam =
                    self.beam(lens, &points, [field, colour], stop_radius_mm, guesses, Lost::Refused)?;
                let mut rays = beam.aimed.bundle(&beam.sequence);
                trace_with_heights(&beam.sequence, &mut rays, &mut []);
                let at = rays.image_xy().map(<[f64]>::to_vec);
                for (i, w) in weights.iter().enumerate() {
                    light += w;
                    centre = [centre[0] + w * at[0][i], centre[1] + w * at[1][i]];
                }
                traced.push((beam, at));
            }
            let centre = [if is_half { 0.0 } else { centre[0] / light }, centre[1] / light];
            // The centroid needs no cotangent: the sum of squares is least there.
            for (beam, at) in traced {
                let mut seeds = Seeds::zero(points.len());
                for (i, w) in weights.iter().enumerate() {
                    let scale = 2.0 * weight * UM_PER_MM * UM_PER_MM * w / light;
                    seeds.image_x[i] = scale * (at[0][i] - centre[0]);
                    seeds.image_y[i] = scale * (at[1][i] - centre[1]);
                }
                let nothing = vec![0.0; RayBundle::padded(points.len())];
                let reaim = Reaim { aimed: &beam.aimed, launch_bar: [&nothing, &nothing] };
                let launched = beam.aimed.bundle(&beam.sequence);
                stop_bar += pull_back(&beam.sequence, &launched, &seeds, Some(&reaim), &mut gradient);
            }
        }
        let bars = FirstOrderCotangent { stop_radius: stop_bar / stop_radius_mm, ..Default::default() };
        pull_back_first_order(&reference, bars, &mut gradient);
        gradient.keep_symmetry(&reference);
        Some(gradient)
    }

    /// Adds the gradient of a loss that depends on the radius at which a surface must be clear, `bar` per mm: that of the ray
    /// which needs it.
    fn pull_back_reach(
        &self,
        lens: &Lens,
        reach: &Reach,
        surface: usize,
        bar: f64,
        gradient: &mut LensGradient,
    ) -> Option<()> {
        let (field, colour, point) = reach.widest[surface];
        let reference = lens.at_wavelength(lens.reference_um);
        let stop_radius_mm = first_order(&reference).stop_radius_mm;
        let beam = self.beam(lens, &[point], [field, colour], stop_radius_mm, None, Lost::Refused)?;
        let mut seeds = Seeds::zero(1);
        let mut height = SquaredHeights::zero(surface, 1);
        height.values[0] = 0.5 * bar / reach.clear_mm[surface];
        seeds.heights.push(height);
        let nothing = vec![0.0; RayBundle::padded(1)];
        let reaim = Reaim { aimed: &beam.aimed, launch_bar: [&nothing, &nothing] };
        let launched = beam.aimed.bundle(&beam.sequence);
        let by_stop = pull_back(&beam.sequence, &launched, &seeds, Some(&reaim), gradient);
        let bars = FirstOrderCotangent { stop_radius: by_stop / stop_radius_mm, ..Default::default() };
        pull_back_first_order(&reference, bars, gradient);
        Some(())
    }
}

impl Merit for SpotResiduals {
    fn name(&self) -> String {
        if self.power == 1.0 { "mean RMS spot".into() } else { format!("{}-mean RMS spot", self.power) }
    }

    fn unit(&self) -> &str {
        "um"
    }

    fn better(&self) -> Better {
        Better::Lower
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        self.size_um(lens, Lost::Refused)
    }

    fn with_gradient(&self, lens: &Lens) -> Option<(f64, Option<LensGradient>)> {
        let sides = Sides::of(&lens.at_wavelength(lens.reference_um));
        let landings = self.landings(lens, sides, None, false, Lost::Refused)?;
        let value = self.square_um2(&landings).sqrt();
        // d sqrt(q) = dq / (2 sqrt(q)); a perfect spot has no slope.
        let per = if value > 0.0 { 0.5 / value } else { 0.0 };
        let gradient = self.gradient(lens, sides, &landings)?.scaled(per);
        value.is_finite().then_some((value, Some(gradient)))
    }

    fn normal_equations(&self, lens: &Lens, numbers: &[(usize, Number)]) -> Option<DMatrix<f64>> {
        let landings = self.landings(lens, Sides::Both, None, false, Lost::Refused)?;
        self.gram(lens, Sides::Both, &landings, numbers)
    }
}

/// The clear radii that the beams of a lens need, with the margin of a mount.
pub(crate) struct Beams<'a> {
    pub merit: &'a SpotResiduals,
    pub lens: &'a Lens,
    pub reach: &'a Reach,
    /// Clear semi-diameters that surfaces keep although beams need more, mount included, mm.
    pub kept_mm: &'a [Option<f64>],
}

impl Beams<'_> {
    /// The clear radius beyond which a surface does not go, mm.
    fn most_mm(&self, surface: usize) -> f64 {
        self.kept_mm.get(surface).copied().flatten().map_or(f64::INFINITY, |kept_mm| kept_mm - MOUNT_MM)
    }
}

impl ClearRadii for Beams<'_> {
    fn radius_mm(&self, surface: usize) -> f64 {
        self.reach.clear_mm[surface].min(self.most_mm(surface))
    }

    fn mount_mm(&self) -> f64 {
        MOUNT_MM
    }

    fn pull_back(&self, surface: usize, bar: f64, gradient: &mut LensGradient) -> Option<()> {
        if self.most_mm(surface) < self.reach.clear_mm[surface] {
            return Some(());
        }
        self.merit.pull_back_reach(self.lens, self.reach, surface, bar, gradient)
    }
}

/// Adds the products of the columns of a beam, weighted, and the means of x and of y; about an origin. Half a beam and its
/// mirror image have no mean of x.
fn add_gram(
    landing: &LandingJacobian,
    weights: &[f64],
    origin: [f64; 2],
    is_half: bool,
    colours: f64,
    gram: &mut DMatrix<f64>,
    means: &mut [DVector<f64>; 2],
) {
    let count = weights.len();
    // Columns scaled by the roots of the weights: x and then y of every ray.
    let roots: Vec<f64> = weights.iter().map(|w| (w / colours).sqrt()).collect();
    let columns = landing.by.len() + 1;
    let block = DMatrix::from_fn(2 * count, columns, |r, c| {
        let (axis, ray) = (r / count, r % count);
        let value = match landing.by.get(c) {
            // A lost ray has no landing point at all.
            _ if roots[ray] == 0.0 => return 0.0,
            Some(by) => by[axis][ray],
            None => landing.landing[axis][ray] - origin[axis],
        };
        roots[ray] * value
    });
    gram.gemm_tr(1.0, &block, &block, 1.0);
    for c in 0..columns {
        for (axis, means) in means.iter_mut().enumerate().skip(usize::from(is_half)) {
            means[c] += (0..count).map(|ray| roots[ray] * block[(axis * count + ray, c)]).sum::<f64>();
        }
    }
}
