//! Restoration on the tape: the Wiener filters follow the PSFs, and so does their gradient.

use std::sync::Arc;

use burn::prelude::*;
use rayon::prelude::*;

use super::host_kernel::{HostKernel, apply_four};
use super::picture;
use super::render_op::{CHECKED, same};
use crate::image::{CHANNELS, LinearImage};
use crate::psf::PsfLayout;
use crate::render::{
    Curves, KNOTS, PatchKernels, Placement, RenderError, RenderGeometry, Wiener, check_placement,
    patch_kernels, patch_kernels_adjoint, render_adjoint_kernels, render_kernels, render_kernels_adjoint,
    sensor_patches,
};

/// What a restoration of a batch depends on beside its tensors.
#[derive(Clone, Debug)]
pub struct Restoration {
    /// Noise and power of the regularisation. Its curves are those of the tensor.
    pub wiener: Wiener,
    /// Layout of the PSFs.
    pub layout: PsfLayout,
    /// Sensor grid, and patches of constant filter.
    pub geometry: RenderGeometry,
    /// Sensor position of each picture's top-left pixel.
    pub placements: Vec<Placement>,
}

/// Takes the blur of the lens out of a batch of pictures, as far as their noise allows.
///
/// Pictures `[B,3,H,W]` in linear light, PSF values `[F,3,G,G]`, field radii `[F]` and regularisation curves `[3,KNOTS]` to
/// `[B,3,H,W]`, differentiable in all four: linear in the pictures; a lens that moves blurs otherwise and is filtered otherwise. The radii
/// are those of the layout. See [`Wiener::restore`].
///
/// Beyond the border of a picture its edge is repeated, as at the border of the sensor. In a window of a larger picture this is wrong by
/// what the filter takes from outside: take a window with surroundings, and crop.
pub fn restore_op(
    pictures: Tensor<4>,
    psf_values: Tensor<4>,
    field_radius_mm: Tensor<1>,
    curves: Tensor<2>,
    restoration: Restoration,
) -> Result<Tensor<4>, RenderError> {
    let Restoration { layout, geometry, placements, .. } = &restoration;
    layout.validate()?;
    let [batch, channels, height, width] = pictures.dims();
    same("number of pictures and planes", [placements.len(), CHANNELS], [batch, channels])?;
    same(
        "shape of the PSF values",
        [layout.fields(), CHANNELS, layout.grid, layout.grid],
        psf_values.dims(),
    )?;
    same("number of field radii", [layout.fields()], field_radius_mm.dims())?;
    same("shape of the regularisation curves", [CHANNELS, KNOTS], curves.dims())?;
    let mut active = vec![false; geometry.patch_count()];
    for &placement in placements {
        check_placement(geometry, placement, height, width)?;
        let window = sensor_patches(geometry, placement, height, width);
        active.iter_mut().zip(window).for_each(|(all, one)| *all |= one);
    }
    let kernel = RestoreKernel { restoration, active, shape: [batch, CHANNELS, height, width] };
    Ok(apply_four(Arc::new(kernel), (pictures, psf_values, field_radius_mm, curves)))
}

/// Restoration of a batch as a host kernel of pictures, PSF values, field radii and curves.
#[derive(Debug)]
struct RestoreKernel {
    restoration: Restoration,
    active: Vec<bool>,
    shape: [usize; 4],
}

impl RestoreKernel {
    /// The Wiener filter with the curves of the tensor, and the kernels of the PSFs.
    fn kernels(&self, inputs: &[&[f32]]) -> (Wiener, PatchKernels) {
        let Restoration { wiener, layout, geometry, .. } = &self.restoration;
        let mut curves: Curves = [[0.0; KNOTS]; CHANNELS];
        curves.as_flattened_mut().copy_from_slice(inputs[3]);
        let kernels = patch_kernels(geometry, layout, inputs[1], &self.active).expect(CHECKED);
        (Wiener { curves, ..*wiener }, kernels)
    }

    /// Picture `i` with the surroundings that filters of a radius reach.
    fn surrounded(&self, pictures: &[f32], i: usize, radius: usize) -> LinearImage {
        let [_, channels, height, width] = self.shape;
        picture(pictures, i, channels, height, width).pad_replicate(radius)
    }
}

impl HostKernel for RestoreKernel {
    fn output_shape(&self) -> Vec<usize> {
        self.shape.to_vec()
    }

    fn forward(&self, inputs: &[&[f32]]) -> Vec<f32> {
        let Restoration { geometry, placements, .. } = &self.restoration;
        let (wiener, kernels) = self.kernels(inputs);
        let filters = wiener.filters(&kernels);
        let restore = |(i, placement): (usize, &Placement)| {
            let picture = self.surrounded(inputs[0], i, filters.radius);
            render_kernels(geometry, &filters, &picture, *placement).expect(CHECKED).data
        };
        let pictures: Vec<Vec<f32>> = placements.par_iter().enumerate().map(restore).collect();
        pictures.concat()
    }

    fn adjoint(&self, inputs: &[&[f32]], d_output: &[f32]) -> Vec<Vec<f32>> {
        self.adjoint_of(inputs, d_output, &[true; 4])
    }

    fn adjoint_of(&self, inputs: &[&[f32]], d_output: &[f32], wanted: &[bool]) -> Vec<Vec<f32>> {
        let Restoration { layout, geometry, placements, .. } = &self.restoration;
        let [_, channels, height, width] = self.shape;
        let (wiener, kernels) = self.kernels(inputs);
        let filters = wiener.filters(&kernels);
        // Transpose the convolutions: by the filters, and by the pictures where that is needed.
        let pull = |(i, placement): (usize, &Placement)| {
            let seen = self.surrounded(inputs[0], i, filters.radius);
            let bar = picture(d_output, i, channels, height, width);
            if !wanted[0] {
                let by_filters = render_adjoint_kernels(geometry, filters.radius, &seen, *placement, &bar);
                return (by_filters.expect(CHECKED), Vec::new());
            }
            let both = render_kernels_adjoint(geometry, &filters, &seen, *placement, &bar);
            let (by_filters, by_seen) = both.expect(CHECKED);
            (by_filters, by_seen.pad_replicate_adjoint(filters.radius).data)
        };
        let parts: Vec<(PatchKernels, Vec<f32>)> = placements.par_iter().enumerate().map(pull).collect();
        // Add the pictures in fixed order.
        let mut by_filters: Option<PatchKernels> = None;
        let mut by_pictures = Vec::new();
        for (part, by_picture) in parts {
            by_pictures.extend(by_picture);
            match &mut by_filters {
                Some(sum) => sum.add(&part, &self.active),
                None => by_filters = Some(part),
            }
        }
        let Some(by_filters) = by_filters else { return vec![Vec::new(); 4] };
        // From the filters to their curves and to the kernels, and from these to the PSFs.
        let by = wiener.filters_adjoint(&kernels, &by_filters);
        let (mut by_values, mut by_radius) = (Vec::new(), Vec::new());
        if wanted[1] || wanted[2] {
            let by = patch_kernels_adjoint(geometry, layout, inputs[1], &by.kernels, &self.active);
            let by = by.expect(CHECKED);
            by_values = by.values;
            by_radius = by.radius.into_iter().map(|v| v as f32).collect();
        }
        vec![by_pictures, by_values, by_radius, by.curves.as_flattened().to_vec()]
    }
}
