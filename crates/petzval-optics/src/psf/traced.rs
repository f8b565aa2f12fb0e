//! PSFs with a traced ray for every pupil cell: the reference.

use super::grid::{LightChange, LightCotangent, PsfOptions, with_mirror_image};
use super::splat;
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

    /// The light on the grid and the light of the beam per ideal image area. On the grid it is that of half of the pupil with its mirror
    /// image (twice its weight), or that of both halves.
    pub fn splat(&self, options: &PsfOptions, chief_mm: [f64; 2], is_half: bool) -> (Vec<f64>, f64) {
        let beam = &self.beam;
        let (per_mm, centre) = options.scale();
        let mut half = vec![0.0; options.grid * options.grid];
        // Share the light of each ray among the cells around it.
        for i in 0..beam.x_mm.len() {
            let at = [beam.x_mm[i], beam.y_mm[i]];
            let [u, v] = [0, 1].map(|axis| (at[axis] - chief_mm[axis]) * per_mm + centre);
            splat::add(&mut half, options.grid, u, v, beam.weight[i]);
        }
        let all = if is_half { with_mirror_image(&half, options.grid) } else { half };
        (all, beam.light())
    }

    /// Adds the gradient; returns the derivatives by the position of the chief ray and by the stop radius.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        light: &LightCotangent,
        gradient: &mut LensGradient,
    ) -> ([f64; 2], f64) {
        let beam = &self.beam;
        let (per_mm, centre) = light.options.scale();
        let rays = beam.x_mm.len();
        let mut bar = BeamCotangent::zero(rays);
        let mut chief_bar = [0.0; 2];
        // Gather the cotangents of the cells around each ray: by its position and by its light.
        for i in 0..rays {
            let at = [beam.x_mm[i], beam.y_mm[i]];
            let [u, v] = [0, 1].map(|axis| (at[axis] - light.chief_mm[axis]) * per_mm + centre);
            let [by_u, by_v, by_light] = splat::gather(&light.grid, light.options.grid, u, v);
            bar.x[i] = beam.weight[i] * by_u * per_mm;
            bar.y[i] = beam.weight[i] * by_v * per_mm;
            bar.weight[i] = by_light + light.density;
            chief_bar[0] -= bar.x[i];
            chief_bar[1] -= bar.y[i];
        }
        (chief_bar, beam.pull_back(sequence, &bar, gradient))
    }

    /// The change of [`TracedChannel::splat`]: the transpose of [`TracedChannel::pull_back`].
    pub fn push_forward(&self, sequence: &Sequence, change: &LightChange, is_half: bool) -> (Vec<f64>, f64) {
        let beam = &self.beam;
        let moved = beam.push_forward(sequence, change.lens, change.stop_growth);
        let mut half = vec![0.0; change.options.grid * change.options.grid];
        for i in (0..beam.x_mm.len()).filter(|i| beam.weight[*i] > 0.0) {
            let (at, by) = ([beam.x_mm[i], beam.y_mm[i]], [moved.x_mm[i], moved.y_mm[i]]);
            change.add(&mut half, at, beam.weight[i], by, moved.weight[i]);
        }
        let all = if is_half { with_mirror_image(&half, change.options.grid) } else { half };
        (all, moved.weight.iter().sum())
    }
}
