//! A traced ray for every pupil cell.

use super::{Asked, PsfOptions, splat, with_mirror_image};
use crate::gradient::LensGradient;
use crate::pupil::{Beam, BeamCotangent, Quadrature, trace_beam};
use crate::trace::Sequence;

pub(super) struct TracedChannel {
    beam: Beam,
}

impl TracedChannel {
    pub fn new(sequence: &Sequence, field_rad: f64, stop_radius_mm: f64, quadrature: &Quadrature) -> Self {
        Self { beam: trace_beam(sequence, field_rad, stop_radius_mm, quadrature) }
    }

    /// The light on the grid, twice that of the half pupil, and the relative illumination.
    pub fn splat(&self, options: &PsfOptions, chief_y_mm: f64) -> (Vec<f64>, f64) {
        let beam = &self.beam;
        let (per_mm, centre) = options.scale();
        let mut half = vec![0.0; options.grid * options.grid];
        for i in 0..beam.x_mm.len() {
            let (u, v) = (beam.x_mm[i] * per_mm + centre, (beam.y_mm[i] - chief_y_mm) * per_mm + centre);
            splat::add(&mut half, options.grid, u, v, beam.weight[i]);
        }
        (with_mirror_image(&half, options.grid), beam.illumination())
    }

    /// Adds the gradient; returns the derivatives by the chief ray's height and by the stop radius.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        quadrature: &Quadrature,
        asked: &Asked,
        gradient: &mut LensGradient,
    ) -> (f64, f64) {
        let beam = &self.beam;
        let (per_mm, centre) = asked.options.scale();
        let mut bar = BeamCotangent::zero(quadrature.len());
        let mut chief_bar = 0.0;
        for i in 0..quadrature.len() {
            let u = beam.x_mm[i] * per_mm + centre;
            let v = (beam.y_mm[i] - asked.chief_y_mm) * per_mm + centre;
            let [by_u, by_v, by_light] = splat::gather(&asked.grid, asked.options.grid, u, v);
            bar.x[i] = beam.weight[i] * by_u * per_mm;
            bar.y[i] = beam.weight[i] * by_v * per_mm;
            bar.weight[i] = by_light + asked.illumination;
            chief_bar -= bar.y[i];
        }
        (chief_bar, beam.pull_back(sequence, quadrature, &bar, gradient))
    }
}
