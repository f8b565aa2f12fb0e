//! Restoration on the tape: the Wiener filters follow the PSFs, and so does their gradient.

use std::sync::{Arc, OnceLock};

use burn::prelude::*;
use rayon::prelude::*;

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use super::kernel::DeviceForm;
use super::kernel::{Kernel, View, apply};
use super::picture;
use super::render_op::{CHECKED, checked_kernels, same};
use crate::image::{CHANNELS, LinearImage};
use crate::psf::PsfLayout;
use crate::render::{
    Curves, KNOTS, PatchKernels, Placement, RenderError, RenderGeometry, Wiener, check_placement,
    kernel_radius, patch_kernels, patch_kernels_adjoint, render_adjoint_kernels, render_adjoint_scene,
    render_kernels, render_kernels_adjoint, sensor_patches,
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
    /// The [kernels](patch_kernels) of the PSFs, where they were made before: of every patch that the pictures need.
    pub ready: Option<Arc<PatchKernels>>,
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
    let what = "shape of the PSF values";
    same(what, [layout.fields(), CHANNELS, layout.grid, layout.grid], psf_values.dims())?;
    same("number of field radii", [layout.fields()], field_radius_mm.dims())?;
    same("shape of the regularisation curves", [CHANNELS, KNOTS], curves.dims())?;
    let mut active = vec![false; geometry.patch_count()];
    for &placement in placements {
        check_placement(geometry, placement, height, width)?;
        let window = sensor_patches(geometry, placement, height, width);
        active.iter_mut().zip(window).for_each(|(all, one)| *all |= one);
    }
    checked_kernels(restoration.ready.clone(), kernel_radius(geometry, layout)?, &active)?;
    let shape = [batch, CHANNELS, height, width];
    let kernel = RestoreKernel { restoration, active, shape, made: OnceLock::new() };
    let inputs = [pictures.into_dispatch(), psf_values.into_dispatch()];
    let more = [field_radius_mm.into_dispatch(), curves.into_dispatch()];
    Ok(apply(Arc::new(kernel), inputs.into_iter().chain(more)))
}

/// Restoration of a batch as a kernel of pictures, PSF values, field radii and curves.
#[derive(Debug)]
pub(super) struct RestoreKernel {
    pub(super) restoration: Restoration,
    pub(super) active: Vec<bool>,
    pub(super) shape: [usize; 4],
    /// What the forward pass made, for the backward pass with the same inputs.
    made: OnceLock<Made>,
}

/// The kernels of the PSFs, and the filters that invert them.
#[derive(Debug)]
struct Made {
    wiener: Wiener,
    kernels: PatchKernels,
    filters: PatchKernels,
}

impl RestoreKernel {
    /// The filters of the inputs.
    fn made(&self, inputs: &[View<'_>]) -> &Made {
        self.made.get_or_init(|| {
            let Restoration { wiener, layout, geometry, ready, .. } = &self.restoration;
            let kernels = match ready {
                Some(ready) => ready.of_patches(&self.active),
                None => patch_kernels(geometry, layout, inputs[1].values, &self.active).expect(CHECKED),
            };
            let mut curves: Curves = [[0.0; KNOTS]; CHANNELS];
            curves.as_flattened_mut().copy_from_slice(inputs[3].values);
            let wiener = Wiener { curves, ..*wiener };
            let filters = wiener.filters(&kernels);
            Made { wiener, kernels, filters }
        })
    }

    /// Picture `i` with the surroundings that filters of a radius reach.
    fn surrounded(&self, pictures: &[f32], i: usize, radius: usize) -> LinearImage {
        let [_, channels, height, width] = self.shape;
        picture(pictures, i, channels, height, width).pad_replicate(radius)
    }
}

impl Kernel for RestoreKernel {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let Restoration { geometry, placements, .. } = &self.restoration;
        let Made { filters, .. } = self.made(inputs);
        let restore = |(i, placement): (usize, &Placement)| {
            let picture = self.surrounded(inputs[0].values, i, filters.radius);
            render_kernels(geometry, filters, &picture, *placement).expect(CHECKED).data
        };
        let pictures: Vec<Vec<f32>> = placements.par_iter().enumerate().map(restore).collect();
        (pictures.concat(), self.shape.to_vec())
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], wanted: &[bool]) -> Vec<Vec<f32>> {
        let Restoration { layout, geometry, placements, .. } = &self.restoration;
        let [_, channels, height, width] = self.shape;
        let Made { wiener, kernels, filters } = self.made(inputs);
        let filters_follow = wanted[1..].contains(&true);
        // Transpose the convolutions: by the filters and by the pictures, each where it is wanted.
        let pull = |(i, placement): (usize, &Placement)| {
            let seen = self.surrounded(inputs[0].values, i, filters.radius);
            let bar = picture(gradient, i, channels, height, width);
            if !filters_follow {
                let by_seen = render_adjoint_scene(geometry, filters, &seen, *placement, &bar);
                let by_picture = by_seen.expect(CHECKED).pad_replicate_adjoint(filters.radius).data;
                return (PatchKernels::zeros(filters.radius, &self.active), by_picture);
            }
            if !wanted[0] {
                let by_filters = render_adjoint_kernels(geometry, filters.radius, &seen, *placement, &bar);
                return (by_filters.expect(CHECKED), Vec::new());
            }
            let both = render_kernels_adjoint(geometry, filters, &seen, *placement, &bar);
            let (by_filters, by_seen) = both.expect(CHECKED);
            (by_filters, by_seen.pad_replicate_adjoint(filters.radius).data)
        };
        let parts: Vec<(PatchKernels, Vec<f32>)> = placements.par_iter().enumerate().map(pull).collect();
        if !filters_follow {
            let by_pictures = parts.into_iter().flat_map(|(_, by_picture)| by_picture).collect();
            return vec![by_pictures, Vec::new(), Vec::new(), Vec::new()];
        }
        // Add the pictures in fixed order.
        let mut by_filters = PatchKernels::zeros(filters.radius, &self.active);
        parts.iter().for_each(|(part, _)| by_filters.add(part));
        let by_pictures = parts.into_iter().flat_map(|(_, by_picture)| by_picture).collect();
        // From the filters to their curves and to the kernels, and from these to the PSFs.
        let psfs_follow = wanted[1] || wanted[2];
        let by = wiener.filters_adjoint(kernels, &by_filters, psfs_follow);
        let (mut by_values, mut by_radius) = (Vec::new(), Vec::new());
        if psfs_follow {
            let psfs_wanted = [wanted[1], wanted[2]];
            let by = patch_kernels_adjoint(geometry, layout, inputs[1].values, &by.kernels, psfs_wanted);
            let by = by.expect(CHECKED);
            by_values = by.values;
            by_radius = by.radius.into_iter().map(|v| v as f32).collect();
        }
        vec![by_pictures, by_values, by_radius, by.curves.as_flattened().to_vec()]
    }

    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    fn device_form(&self) -> Option<&dyn DeviceForm> {
        Some(self)
    }
}
