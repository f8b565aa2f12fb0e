//! The first-order table: properties of the lens near its axis, as on a data sheet.

use schemars::JsonSchema;
use serde::Serialize;

use super::cone::{Cone, leaves_parallel, paraxial_image_mm};
use crate::lens::{Lens, ObjectDistance};
use crate::paraxial::{first_order, image_height_per_tangent, paraxial_ray, rectilinear_tangent};
use crate::seidel::marginal_and_chief;

/// First-order quantities at the reference wavelength. A quantity that does not exist (the distance of an object at
/// infinity, the focal length of an afocal lens) is `None`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FirstOrderTable {
    /// Effective focal length, mm.
    pub efl_mm: Option<f64>,
    /// From the last vertex to the rear focal point, mm.
    pub bfl_mm: Option<f64>,
    /// From the first vertex to the front focal point, mm, negative in front of the lens.
    pub ffl_mm: Option<f64>,
    /// Focal length divided by the entrance pupil diameter, without its sign.
    pub f_number: Option<f64>,
    /// Numerical aperture at the image by real marginal rays, see [`Cone`]; 0 where light leaves parallel.
    pub image_na: f64,
    /// `1 / (2 NA)`, for the actual object distance.
    pub working_f_number: Option<f64>,
    /// Whether the numerical aperture is that of real rays; else of the paraxial marginal ray, because a real one is lost.
    pub is_image_na_real: bool,
    /// The field of that cone, degrees, where it is not that of the axis, see [`Lens::reference_field_deg`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_na_field_deg: Option<f64>,
    /// Of a far object through an afocal lens: tangent of the angle at which a field leaves over that at which it comes.
    pub angular_magnification: Option<f64>,
    /// From the first vertex to the object, mm, negative.
    pub object_mm: Option<f64>,
    /// Lateral magnification of a near object; none where light leaves parallel.
    pub magnification: Option<f64>,
    /// From the last vertex to the image plane, mm.
    pub image_mm: f64,
    /// Image plane from the paraxial image, mm; positive away from the lens.
    pub defocus_mm: Option<f64>,
    /// Length with the image plane, mm, see [`Lens::track_mm`].
    pub total_track_mm: f64,
    /// Entrance pupil diameter, mm.
    pub entrance_pupil_mm: f64,
    /// Entrance pupil from the first vertex, mm.
    pub entrance_pupil_at_mm: Option<f64>,
    /// Exit pupil diameter, mm.
    pub exit_pupil_mm: Option<f64>,
    /// Exit pupil from the last vertex, mm.
    pub exit_pupil_at_mm: Option<f64>,
    /// Radius of the stop, mm.
    pub stop_radius_mm: f64,
    /// Full field, degrees from the axis.
    pub full_field_deg: f64,
    /// Height of the paraxial image of the full field, mm.
    pub image_height_mm: Option<f64>,
    /// Lagrange's invariant `n (u ybar - ubar y)` of the full field, mm.
    pub lagrange_invariant_mm: Option<f64>,
    /// Radius of the Petzval surface, mm; negative if its centre is at smaller z, as for most lenses.
    pub petzval_radius_mm: Option<f64>,
    /// Radius of the first dark ring of a perfect lens of that numerical aperture, um.
    pub airy_radius_um: Option<f64>,
    /// Frequency beyond which nothing is resolved on the axis, cycles/mm; 0 where light leaves parallel.
    pub cutoff_per_mm: f64,
}

/// The first-order table of a lens.
pub fn first_order_table(lens: &Lens) -> FirstOrderTable {
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    let exists = |v: f64| Some(v).filter(|v| v.is_finite());
    let full_field_deg = lens.outermost_field_deg();
    let full = full_field_deg.to_radians();
    let per_tangent = image_height_per_tangent(&sequence);
    let paraxial_image_mm = paraxial_image_mm(lens);
    let (object_mm, magnification) = match lens.object {
        ObjectDistance::Infinity => (None, None),
        // The field of tangent t has its object at -D t.
        ObjectDistance::Finite(d) => {
            (Some(-d), exists(-per_tangent / d).filter(|_| paraxial_image_mm.is_some()))
        }
    };
    let (marginal, chief) = marginal_and_chief(&sequence, full);
    // A ray that leaves parallel to the axis comes from the front focal point: y + u s = 0 there.
    let count = sequence.surfaces.len();
    let [a, b] = [paraxial_ray(&sequence, 1.0, 0.0), paraxial_ray(&sequence, 0.0, 1.0)].map(|r| r.w[count]);
    // Petzval: 1 / (n' R) = sum c (1/n' - 1/n) over the surfaces.
    let bends =
        sequence.surfaces.iter().map(|s| s.shape.paraxial_curvature() * (1.0 / s.n_after - 1.0 / s.n_before));
    let n_image = sequence.surfaces.last().map_or(1.0, |s| s.n_after);
    let cone = Cone::of(lens);
    // Light of the y-z section leaves a telescope parallel, although indices and thicknesses have last digits.
    let is_afocal =
        lens.object == ObjectDistance::Infinity && paraxial_image_mm.is_none() && leaves_parallel(lens)[1];
    FirstOrderTable {
        efl_mm: exists(order.efl_mm),
        bfl_mm: exists(order.bfl_mm),
        ffl_mm: exists(b / a),
        f_number: exists(order.f_number),
        image_na: cone.na,
        working_f_number: exists(cone.working_f_number()),
        is_image_na_real: cone.is_real,
        image_na_field_deg: Some(lens.reference_field_deg()).filter(|field_deg| *field_deg != 0.0),
        angular_magnification: exists(b / n_image.abs()).filter(|_| is_afocal),
        object_mm,
        magnification,
        image_mm: lens.image_distance_mm(),
        defocus_mm: paraxial_image_mm.map(|at_mm| lens.away_from_lens_mm(lens.image_distance_mm() - at_mm)),
        total_track_mm: lens.track_mm(),
        entrance_pupil_mm: lens.entrance_pupil_mm,
        entrance_pupil_at_mm: exists(order.entrance_pupil_at_mm),
        exit_pupil_mm: exists(order.exit_pupil_mm),
        exit_pupil_at_mm: exists(order.exit_pupil_at_mm),
        stop_radius_mm: order.stop_radius_mm.abs(),
        full_field_deg,
        image_height_mm: exists(per_tangent * rectilinear_tangent(full)),
        lagrange_invariant_mm: exists(marginal.w[0] * chief.y[0] - chief.w[0] * marginal.y[0]),
        petzval_radius_mm: exists(1.0 / (n_image * bends.sum::<f64>())),
        airy_radius_um: exists(cone.airy_radius_um(lens.reference_um)),
        cutoff_per_mm: cone.cutoff_per_mm(lens.reference_um),
    }
}
