//! PSFs at any place of the image of any lens. Without rotational symmetry a lens has other PSFs along each azimuth.
//!
//! Rays are traced from fields in the y-z plane. For a field elsewhere the axes are turned about z in front of the lens, and the lens
//! stays: its image plane turns back with it, so that PSFs come out along the rows and columns of the sensor.

use petzval_camera::psf::PsfLayout;
use petzval_camera::render::{PatchKernels, RenderGeometry, patch_kernels};
use petzval_optics::lens::{Axis, Lens, Placement, Surface};
use petzval_optics::psf::{FieldPsf, PsfKind, PsfOptions, psf, psf_converged};
use petzval_optics::pupil::{LostRay, PupilRefinement, Quadrature, chief_ray, where_lost};

use super::psf_plan::PsfPlan;
use crate::error::DesignError;

/// Clear semi-diameter of the plane in front of the lens, mm: it stops no ray.
const OPEN_MM: f64 = 1e6;

/// How far from its place a chief ray may land, mm.
const LANDS_MM: f64 = 1e-9;

/// Steps of Newton's method. Twice as many halvings of a step are tried.
const STEPS: usize = 30;

/// Change of the field by which its slopes are taken.
const SLOPE: f64 = 1e-6;

/// Change of the field by which the area of its image is taken; the relative error of a central difference is its square.
const AREA_STEP: f64 = 2e-4;

/// A field: the tangents of its angles to the axis, along x and y.
type Field = [f64; 2];

/// A lens as fields in the y-z plane of turned axes see it: a plane without effect turns them in front of it.
fn turned(lens: &Lens, [x, y]: Field) -> Lens {
    let placement =
        Placement { tilt_rad: [0.0, 0.0, x.atan2(y)], axis: Axis::Follows, ..Placement::default() };
    let plane = Surface { semi_diameter_mm: OPEN_MM, placement: Some(placement), ..Surface::default() };
    let mut turned = lens.clone();
    turned.surfaces.insert(0, plane);
    turned.stop += 1;
    turned
}

/// The angle of a field to the axis, rad.
fn angle_rad([x, y]: Field) -> f64 {
    x.hypot(y).atan()
}

/// Where the chief ray of a field lands, mm.
fn landing_mm(lens: &Lens, field: Field) -> Option<[f64; 2]> {
    let turned = turned(lens, field);
    let chief = chief_ray(&turned.at_wavelength(turned.reference_um), angle_rad(field))?;
    Some([chief.x_mm, chief.y_mm])
}

/// Area of the image per area of the tangents of a field, mm^2: the determinant of the slopes of its landing point.
fn area_mm2(lens: &Lens, field: Field) -> Option<f64> {
    let slope = |axis: usize| -> Option<[f64; 2]> {
        let landed = |step: f64| {
            let mut moved = field;
            moved[axis] += step;
            landing_mm(lens, moved)
        };
        let (below, above) = (landed(-AREA_STEP)?, landed(AREA_STEP)?);
        Some([0, 1].map(|i| (above[i] - below[i]) / (2.0 * AREA_STEP)))
    };
    let ([a, b], [c, d]) = (slope(0)?, slope(1)?);
    Some((a * d - b * c).abs())
}

/// The field whose chief ray lands at a place, by Newton's method from the axis.
fn field_at(lens: &Lens, place_mm: [f64; 2]) -> Option<Field> {
    let mut field = [0.0; 2];
    let mut at = landing_mm(lens, field)?;
    let miss = |at: [f64; 2]| [place_mm[0] - at[0], place_mm[1] - at[1]];
    let length = |[x, y]: [f64; 2]| x.hypot(y);
    for _ in 0..STEPS {
        let left = miss(at);
        if length(left) <= LANDS_MM {
            return Some(field);
        }
        // Slopes of the landing point by the field, then the step that would land there.
        let by_x = landing_mm(lens, [field[0] + SLOPE, field[1]])?;
        let by_y = landing_mm(lens, [field[0], field[1] + SLOPE])?;
        let slope = |moved: [f64; 2], axis: usize| (moved[axis] - at[axis]) / SLOPE;
        let [a, b, c, d] = [slope(by_x, 0), slope(by_y, 0), slope(by_x, 1), slope(by_y, 1)];
        let determinant = a * d - b * c;
        let step = [(d * left[0] - b * left[1]) / determinant, (a * left[1] - c * left[0]) / determinant];
        // Distortion may throw it too far: half of the step, until it lands nearer.
        let nearer = (0..STEPS).find_map(|halvings| {
            let share = 0.5_f64.powi(halvings as i32);
            let tried = [field[0] + share * step[0], field[1] + share * step[1]];
            let landed = landing_mm(lens, tried)?;
            (length(miss(landed)) < length(left)).then_some((tried, landed))
        });
        let Some((next, landed)) = nearer else {
            // Rounding ends the steps.
            return (length(left) <= 1e3 * LANDS_MM).then_some(field);
        };
        (field, at) = (next, landed);
    }
    None
}

/// A place of the image: what lights it up.
pub struct Place {
    turned: Lens,
    field_rad: f64,
    /// Image area on the axis per image area here, for equal areas of a flat scene; none where a field beside it does not reach the image.
    image_area: Option<f64>,
}

impl Place {
    /// The place `[x, y]` on the image plane, mm.
    pub fn new(lens: &Lens, place_mm: [f64; 2]) -> Result<Self, DesignError> {
        let radius_mm = place_mm[0].hypot(place_mm[1]);
        let field = field_at(lens, place_mm).ok_or(DesignError::OutsideTheImage { radius_mm })?;
        let image_area = area_mm2(lens, [0.0; 2]).zip(area_mm2(lens, field)).map(|(axis, here)| axis / here);
        Ok(Self { turned: turned(lens, field), field_rad: angle_rad(field), image_area })
    }

    /// No light comes here. A ray that is lost at a surface is lost at that of the lens, which has no plane in front of it.
    fn no_light(&self, plan: &PsfPlan) -> DesignError {
        let lost = where_lost(&self.turned, self.field_rad, &plan.wavelengths_um);
        DesignError::NoLight {
            field_deg: self.field_rad.to_degrees(),
            lost: lost.map(|ray| LostRay { surface: ray.surface.saturating_sub(1), ..ray }),
        }
    }

    /// The PSFs of the place on the grids of a plan, rows along y and columns along x of the image. Where no wave can be computed they are by rays.
    pub fn psf(&self, plan: &PsfPlan) -> Result<FieldPsf, DesignError> {
        let of_kind = |kind: PsfKind| {
            let options = PsfOptions { kind, ..plan.options };
            psf(&self.turned, self.field_rad, &plan.wavelengths_um, &plan.quadrature, &options)
        };
        let found = of_kind(plan.options.kind).or_else(|| of_kind(PsfKind::Geometric));
        let mut psf = found.ok_or_else(|| self.no_light(plan))?;
        // The PSF's own area has the sagittal part of a lens with rotational symmetry.
        if let Some(exact) = self.image_area.filter(|area| area.is_finite()) {
            psf.illumination.iter_mut().for_each(|light| *light *= exact / psf.image_area);
            psf.image_area = exact;
        }
        Ok(psf)
    }

    /// The plan with as many pupil cells, up to `most_cells`, as the PSFs here need for an error of `tolerance`; and the error that is reached.
    pub fn converged(
        &self,
        plan: &PsfPlan,
        tolerance: f64,
        most_cells: usize,
    ) -> Result<(PsfPlan, f64), DesignError> {
        let first_cells = plan.quadrature.cells;
        let refinement =
            PupilRefinement { tolerance, first_cells, most_cells: most_cells.max(2 * first_cells) };
        let (field, colours) = (self.field_rad, &plan.wavelengths_um);
        let found = psf_converged(&self.turned, field, colours, &plan.options, &refinement);
        let found = found.ok_or_else(|| self.no_light(plan))?;
        Ok((PsfPlan { quadrature: Quadrature::grid(found.cells)?, ..plan.clone() }, found.error))
    }
}

/// The kernel of PSFs that lie along the rows and columns of the sensor, for the renderer: red, green and blue, on its pixels.
pub fn kernel_of(
    psf: &FieldPsf,
    plan: &PsfPlan,
    geometry: &RenderGeometry,
) -> Result<PatchKernels, DesignError> {
    let layout =
        PsfLayout { field_radius_mm: vec![0.0], grid: plan.options.grid, pitch_um: plan.options.pitch_um };
    let values: Vec<f32> = psf.values.iter().flatten().map(|v| *v as f32).collect();
    // The middle of the sensor is on the axis, where the renderer does not turn a PSF.
    let one = RenderGeometry { patches: (1, 1), ..geometry.clone() };
    Ok(patch_kernels(&one, &layout, &values, &[true])?)
}

#[cfg(test)]
mod tests {
    use petzval_optics::lens::{Action, Departure};

    use super::*;
    use crate::assets::Assets;

    fn nominal() -> Lens {
        let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data");
        Assets::from_folder(&data).unwrap().lens("cooke-triplet-nominal").unwrap().lens
    }

    fn plan() -> PsfPlan {
        let options = PsfOptions { grid: 48, pitch_um: 2.0, kind: PsfKind::Geometric };
        PsfPlan::new(3, 6.0, [0.62, 0.55, 0.486], options, Quadrature::grid(96).unwrap())
    }

    fn moved(lens: &Lens, decenter_mm: [f64; 2], tilt_rad: [f64; 3]) -> Lens {
        let mut moved = lens.clone();
        moved.surfaces[1].placement = Some(Placement { decenter_mm, tilt_rad, axis: Axis::Returns });
        moved
    }

    /// Sum of absolute differences of two grids, the second with rows and columns exchanged if `exchanged`.
    fn apart(a: &[f64], b: &[f64], exchanged: bool) -> f64 {
        let n = a.len().isqrt();
        let at = |i: usize| if exchanged { b[i % n * n + i / n] } else { b[i] };
        a.iter().enumerate().map(|(i, v)| (v - at(i)).abs()).sum()
    }

    #[test]
    fn a_symmetric_lens_has_the_psfs_of_its_fields() {
        let (lens, plan) = (nominal(), plan());
        let radius_mm = 4.2;
        let along_y = Place::new(&lens, [0.0, radius_mm]).unwrap().psf(&plan).unwrap();
        let field_rad = plan.field_angle(&lens, radius_mm).unwrap();
        assert!((along_y.field_rad - field_rad).abs() < 1e-9, "{} {field_rad}", along_y.field_rad);
        let own = psf(&lens, field_rad, &plan.wavelengths_um, &plan.quadrature, &plan.options).unwrap();
        for (colour, (a, b)) in along_y.values.iter().zip(&own.values).enumerate() {
            assert!(apart(a, b, false) < 0.01, "{colour}: {}", apart(a, b, false));
        }
        assert!((along_y.illumination[1] / own.illumination[1] - 1.0).abs() < 1e-4);
        // Along x the same PSF lies on its side.
        let along_x = Place::new(&lens, [radius_mm, 0.0]).unwrap().psf(&plan).unwrap();
        assert!(apart(&along_x.values[1], &along_y.values[1], true) < 0.01);
        assert!(apart(&along_x.values[1], &along_y.values[1], false) > 0.1);
    }

    #[test]
    fn chief_rays_of_tilted_decentred_and_biconic_lenses_land_at_their_places() {
        let lens = nominal();
        let mut biconic = lens.clone();
        biconic.surfaces[2].shape.departure = Departure::Biconic { curvature_x: -0.026, conic_x: 0.1 };
        for lens in
            [moved(&lens, [0.1, -0.05], [0.0; 3]), moved(&lens, [0.0; 2], [0.01, -0.02, 0.3]), biconic]
        {
            for place_mm in [[0.0, 0.0], [2.0, 3.0], [-4.0, 1.0], [-3.0, -3.5], [1e-3, 0.0]] {
                let place = Place::new(&lens, place_mm).unwrap();
                let psf = place.psf(&plan()).unwrap();
                let landed = [psf.chief_x_mm, psf.chief_y_mm];
                let off = (landed[0] - place_mm[0]).hypot(landed[1] - place_mm[1]);
                assert!(off < 1e-8, "{place_mm:?} {landed:?}");
            }
        }
        assert!(matches!(Place::new(&lens, [30.0, 30.0]), Err(DesignError::OutsideTheImage { .. })));
    }

    /// Light that falls on an image is that of the scene, however a lens distorts it: by area it is what the chief rays say.
    #[test]
    fn illumination_is_smooth_in_every_direction() {
        let (lens, plan) = (nominal(), plan());
        let light = |lens: &Lens, place_mm: [f64; 2]| {
            Place::new(lens, place_mm).unwrap().psf(&plan).unwrap().illumination[1]
        };
        // Hardly tilted, the lens has the light of the symmetric one also along x, where no tilted field moves along y.
        let hardly = moved(&lens, [0.0; 2], [2e-5, 0.0, 0.0]);
        for radius_mm in [1.0, 2.5, 4.5] {
            let own = light(&lens, [0.0, radius_mm]);
            for [x, y] in [[1.0, 0.0], [-1.0, 0.0], [0.6, 0.8], [0.0, -1.0], [1.0, 1e-4]] {
                let placed = light(&hardly, [radius_mm * x, radius_mm * y]);
                assert!((placed / own - 1.0).abs() < 2e-3, "{radius_mm} {x} {y}: {placed} {own}");
            }
        }
        // Tilted by two degrees it changes smoothly across the rows through the middle.
        let tilted = moved(&lens, [0.0; 2], [0.035, 0.0, 0.0]);
        for x in [-4.5, -1.0, 0.5, 3.0] {
            let across = [-0.2, -0.1, 0.0, 0.1, 0.2].map(|y| light(&tilted, [x, y]));
            for pair in across.windows(2) {
                assert!((pair[1] / pair[0] - 1.0).abs() < 0.01, "{x}: {across:?}");
            }
        }
        // A mirror that folds the axis leaves the light of the lens, in both planes.
        for tilt in [[0.785, 0.0, 0.0], [0.0, 0.785, 0.0]] {
            let folded = folded(&lens, tilt);
            for place_mm in [[0.0, 2.0], [2.0, 0.0], [-1.4, 1.4], [0.0, 0.0]] {
                let (placed, own) =
                    (light(&folded, place_mm), light(&lens, [0.0, place_mm[0].hypot(place_mm[1])]));
                assert!((placed / own - 1.0).abs() < 5e-3, "{tilt:?} {place_mm:?}: {placed} {own}");
            }
        }
    }

    /// The lens with a flat mirror 10 mm behind it, which turns the axis by twice its tilt.
    fn folded(lens: &Lens, tilt_rad: [f64; 3]) -> Lens {
        let mut folded = lens.clone();
        let last = folded.surfaces.len() - 1;
        let to_image_mm = folded.surfaces[last].thickness_mm;
        folded.surfaces[last].thickness_mm = 10.0;
        let placement = Placement { tilt_rad, axis: Axis::Bends, ..Placement::default() };
        folded.surfaces.push(Surface {
            thickness_mm: 10.0 - to_image_mm,
            semi_diameter_mm: 40.0,
            placement: Some(placement),
            action: Action::Reflect,
            ..Surface::default()
        });
        folded
    }

    #[test]
    fn a_lens_that_is_turned_turns_its_psfs() {
        let (lens, plan) = (nominal(), plan());
        // The mirror image about the diagonal exchanges x and y, also of the decentre.
        let (a, b) = (moved(&lens, [0.0, 0.12], [0.0; 3]), moved(&lens, [0.12, 0.0], [0.0; 3]));
        for [x, y] in [[0.0, 0.0], [1.5, -3.0], [0.5, 4.0]] {
            let of_a = Place::new(&a, [x, y]).unwrap().psf(&plan).unwrap();
            let of_b = Place::new(&b, [y, x]).unwrap().psf(&plan).unwrap();
            assert!(apart(&of_a.values[1], &of_b.values[1], true) < 0.02, "{x} {y}");
        }
        // On the axis the decentre shows: coma that a centred lens does not have.
        let centred = Place::new(&lens, [0.0, 0.0]).unwrap().psf(&plan).unwrap();
        let decentred = Place::new(&a, [0.0, 0.0]).unwrap().psf(&plan).unwrap();
        assert!(apart(&centred.values[1], &decentred.values[1], false) > 0.3);
    }
}
