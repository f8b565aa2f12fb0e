//! Mean squared spots with a traced ray for every pupil cell: the reference.

use super::{centroid, mean_of, mean_over_fields, mean_square, trace_field};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::paraxial::{FirstOrderCotangent, pull_back_first_order};
use crate::pupil::{BeamCotangent, Quadrature};

/// Mean over fields and wavelengths of the squared RMS spot radius, um^2, about the polychromatic
/// centroid, with its gradient. `None` if some field brings no light.
pub fn mean_square_spot_traced(
    lens: &Lens,
    fields_rad: &[f64],
    quadrature: &Quadrature,
) -> Option<(f64, LensGradient)> {
    mean_over_fields(lens, fields_rad, |field| field_mean_square(lens, field, quadrature))
}

pub(super) fn field_mean_square(
    lens: &Lens,
    field_rad: f64,
    quadrature: &Quadrature,
) -> Option<(f64, LensGradient)> {
    const UM2_PER_MM2: f64 = 1e6;
    let traced = trace_field(lens, field_rad, quadrature);
    if !traced.iter().all(|t| t.beam.light() > 0.0) {
        return None;
    }
    let count = traced.len() as f64;
    let centres: Vec<[f64; 2]> = traced.iter().map(|t| centroid(&t.sequence, &t.beam)).collect();
    let centre = mean_of(&centres);
    let mut value = 0.0;
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    let mut stop_radius_bar = 0.0;
    for t in &traced {
        let (beam, light) = (&t.beam, t.beam.light());
        let square = mean_square(beam, centre);
        value += square / count;
        // The common centroid c is the mean of the wavelengths' own, so the sum over wavelengths of d(square)/dc is
        // zero and c needs no cotangent: m = <x^2 + (y-c)^2>_w.
        let scale = UM2_PER_MM2 / (count * light);
        let mut bar = BeamCotangent::zero(beam.y_mm.len());
        for i in 0..beam.y_mm.len() {
            let (x, y) = (beam.x_mm[i] - centre[0], beam.y_mm[i] - centre[1]);
            bar.x[i] = 2.0 * scale * beam.weight[i] * x;
            bar.y[i] = 2.0 * scale * beam.weight[i] * y;
            bar.weight[i] = scale * (x * x + y * y - square);
        }
        stop_radius_bar += beam.pull_back(&t.sequence, &bar, &mut gradient);
    }
    let reference = lens.at_wavelength(lens.reference_um);
    let first_order_bar = FirstOrderCotangent { stop_radius: stop_radius_bar, ..Default::default() };
    pull_back_first_order(&reference, first_order_bar, &mut gradient);
    Some((UM2_PER_MM2 * value, gradient))
}
