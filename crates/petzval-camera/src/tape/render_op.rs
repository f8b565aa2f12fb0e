//! Rendering and illumination on the tape.

use std::sync::Arc;

use burn::prelude::*;
use rayon::prelude::*;

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use super::kernel::DeviceForm;
use super::kernel::{Kernel, View, apply};
use super::{joined, picture};
use crate::image::{CHANNELS, LinearImage};
use crate::psf::PsfLayout;
use crate::render::{
    PatchKernels, Placement, RenderError, RenderGeometry, illumination_adjoint, illumination_map,
    kernel_radius, patch_kernels, patch_kernels_adjoint, render_adjoint_kernels, render_kernels,
};

/// A scene, with the border that the PSF needs, and the sensor position of its output.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedScene {
    /// Linear light, 3 planes, output plus [`kernel_radius`] pixels on every side.
    pub scene: LinearImage,
    /// Sensor position of the output's top-left pixel.
    pub placement: Placement,
}

/// Renders a batch of scenes: `[F,3,G,G]` PSF values and `[F]` field radii to `[B,3,H,W]`, differentiable in both. The radii are
/// those of the layout.
///
/// All scenes have one size. `ready` holds the [kernels](patch_kernels) of these PSFs, where they were made before: of every patch that the
/// scenes need. See [`crate::render::render`].
pub fn render_op(
    psf_values: Tensor<4>,
    field_radius_mm: Tensor<1>,
    layout: &PsfLayout,
    geometry: &RenderGeometry,
    ready: Option<Arc<PatchKernels>>,
    scenes: Vec<PlacedScene>,
) -> Result<Tensor<4>, RenderError> {
    let radius = kernel_radius(geometry, layout)?;
    let what = "shape of the PSF values";
    same(what, [layout.fields(), CHANNELS, layout.grid, layout.grid], psf_values.dims())?;
    same("number of field radii", [layout.fields()], field_radius_mm.dims())?;
    let Some(first) = scenes.first() else {
        return Err(mismatch("number of scenes", "at least 1", "0"));
    };
    let shape = |s: &PlacedScene| [s.scene.channels, s.scene.height, s.scene.width];
    let [_, height, width] = shape(first);
    let mut active = vec![false; geometry.patch_count()];
    for placed in &scenes {
        same("shape of a scene", shape(first), shape(placed))?;
        let window = crate::render::check_scene(geometry, &placed.scene, radius, placed.placement)?;
        for (all, one) in active.iter_mut().zip(window) {
            *all |= one;
        }
    }
    let kernel = RenderKernel {
        geometry: geometry.clone(),
        layout: layout.clone(),
        ready: checked_kernels(ready, radius, &active)?,
        active,
        shape: [scenes.len(), CHANNELS, height - 2 * radius, width - 2 * radius],
        radius,
        scenes,
    };
    Ok(apply(Arc::new(kernel), [psf_values.into_dispatch(), field_radius_mm.into_dispatch()]))
}

/// Rendering of a batch as a kernel of PSF values and field radii, linear in the values.
#[derive(Debug)]
pub(super) struct RenderKernel {
    pub(super) geometry: RenderGeometry,
    pub(super) layout: PsfLayout,
    pub(super) scenes: Vec<PlacedScene>,
    pub(super) active: Vec<bool>,
    pub(super) ready: Option<Arc<PatchKernels>>,
    pub(super) shape: [usize; 4],
    pub(super) radius: usize,
}

pub(super) const CHECKED: &str = "sizes were checked when the operation was made";

impl Kernel for RenderKernel {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let kernels = match &self.ready {
            Some(ready) => ready.clone(),
            None => {
                let made = patch_kernels(&self.geometry, &self.layout, inputs[0].values, &self.active);
                Arc::new(made.expect(CHECKED))
            }
        };
        let render =
            |s: &PlacedScene| render_kernels(&self.geometry, &kernels, &s.scene, s.placement).expect(CHECKED);
        let pictures: Vec<LinearImage> = self.scenes.par_iter().map(render).collect();
        (joined(pictures.into_iter().map(|p| p.data).collect()), self.shape.to_vec())
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], wanted: &[bool]) -> Vec<Vec<f32>> {
        let [_, channels, height, width] = self.shape;
        let wanted = [wanted[0], wanted[1]];
        let parts: Vec<PatchKernels> = (0..self.scenes.len())
            .into_par_iter()
            .map(|i| {
                let (s, gradient) = (&self.scenes[i], picture(gradient, i, channels, height, width));
                render_adjoint_kernels(&self.geometry, self.radius, &s.scene, s.placement, &gradient)
                    .expect(CHECKED)
            })
            .collect();
        // Add the scenes in fixed order, then pull the patch kernels back to the PSF values.
        let mut sum = PatchKernels::zeros(self.radius, &self.active);
        parts.iter().for_each(|part| sum.add(part));
        let by = patch_kernels_adjoint(&self.geometry, &self.layout, inputs[0].values, &sum, wanted);
        let by = by.expect(CHECKED);
        vec![by.values, by.radius.into_iter().map(|v| v as f32).collect()]
    }

    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    fn device_form(&self) -> Option<&dyn DeviceForm> {
        Some(self)
    }
}

/// Relative illumination of a batch of sensor windows: table `[F,3]` and field radii `[F]` to `[B,3,H,W]`, differentiable in both.
/// The radii are those of the layout.
///
/// See [`crate::render::illumination_map`].
pub fn illumination_op(
    illumination: Tensor<2>,
    field_radius_mm: Tensor<1>,
    layout: &PsfLayout,
    geometry: &RenderGeometry,
    placements: &[Placement],
    height: usize,
    width: usize,
) -> Result<Tensor<4>, RenderError> {
    layout.validate()?;
    same("shape of the illumination table", [layout.fields(), CHANNELS], illumination.dims())?;
    same("number of field radii", [layout.fields()], field_radius_mm.dims())?;
    for &placement in placements {
        crate::render::check_placement(geometry, placement, height, width)?;
    }
    let kernel = IlluminationKernel {
        geometry: geometry.clone(),
        layout: layout.clone(),
        placements: placements.to_vec(),
        shape: [placements.len(), CHANNELS, height, width],
    };
    Ok(apply(Arc::new(kernel), [illumination.into_dispatch(), field_radius_mm.into_dispatch()]))
}

/// Distance of every pixel of a batch of windows from the optical axis, in units of the corner's, `[B,1,H,W]`.
///
/// It is the illumination of a lens that has none on the axis and 1 at the corner.
pub fn field_map(
    geometry: &RenderGeometry,
    placements: &[Placement],
    [height, width]: [usize; 2],
    device: &Device,
) -> Result<Tensor<4>, RenderError> {
    let field_radius_mm = vec![0.0, geometry.radius_mm(0, 0)];
    let radii = Tensor::from_data([0.0f32, field_radius_mm[1] as f32], device);
    let layout = PsfLayout { field_radius_mm, grid: 2, pitch_um: geometry.pixel_um };
    let table = Tensor::from_data([[0.0f32; CHANNELS], [1.0; CHANNELS]], device);
    let map = illumination_op(table, radii, &layout, geometry, placements, height, width)?;
    Ok(map.slice([0..placements.len(), 0..1]))
}

/// Illumination of a batch of windows as a kernel of table and field radii, linear in the table.
#[derive(Debug)]
pub(super) struct IlluminationKernel {
    pub(super) geometry: RenderGeometry,
    pub(super) layout: PsfLayout,
    pub(super) placements: Vec<Placement>,
    pub(super) shape: [usize; 4],
}

impl Kernel for IlluminationKernel {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let [_, _, height, width] = self.shape;
        let table = inputs[0].values;
        let map = |p: &Placement| {
            illumination_map(&self.geometry, &self.layout, table, *p, height, width).expect(CHECKED).data
        };
        (joined(self.placements.iter().map(map).collect()), self.shape.to_vec())
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], wanted: &[bool]) -> Vec<Vec<f32>> {
        let [_, channels, height, width] = self.shape;
        let (table, wanted) = (inputs[0].values, [wanted[0], wanted[1]]);
        let mut sum = vec![0.0f32; if wanted[0] { table.len() } else { 0 }];
        let mut by_radius = vec![0.0f32; if wanted[1] { self.layout.fields() } else { 0 }];
        for (i, &placement) in self.placements.iter().enumerate() {
            let gradient = picture(gradient, i, channels, height, width);
            let (part, radius) =
                illumination_adjoint(&self.geometry, &self.layout, table, placement, &gradient, wanted)
                    .expect(CHECKED);
            by_radius.iter_mut().zip(radius).for_each(|(a, b)| *a += b as f32);
            sum.iter_mut().zip(part).for_each(|(a, b)| *a += b);
        }
        vec![sum, by_radius]
    }

    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    fn device_form(&self) -> Option<&dyn DeviceForm> {
        Some(self)
    }
}

/// Ready kernels, if they have the radius and the patches.
pub(super) fn checked_kernels(
    ready: Option<Arc<PatchKernels>>,
    radius: usize,
    active: &[bool],
) -> Result<Option<Arc<PatchKernels>>, RenderError> {
    if let Some(kernels) = &ready {
        same("radius of the ready kernels", [radius], [kernels.radius])?;
        if !kernels.covers(active) {
            return Err(mismatch("ready kernels", "those of every patch", "fewer"));
        }
    }
    Ok(ready)
}

pub(super) fn same<const N: usize>(
    what: &'static str,
    expected: [usize; N],
    got: [usize; N],
) -> Result<(), RenderError> {
    if expected == got { Ok(()) } else { Err(mismatch(what, &format!("{expected:?}"), &format!("{got:?}"))) }
}

fn mismatch(what: &'static str, expected: &str, got: &str) -> RenderError {
    RenderError::Mismatch { what, expected: expected.to_owned(), got: got.to_owned() }
}
