//! Rendering and illumination on a device. Scenes go there once for each batch; kernels of patches come from PSFs on the host.

use burn::backend::{DispatchTensor, TensorMetadata};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

use super::convolve::{Blend, support};
use super::{buffers, empty, given, groups, numbers, read, shaped, taken, words};
use crate::image::CHANNELS;
use crate::psf::PsfLayout;
use crate::render::{PatchKernels, Placement, RenderGeometry, patch_kernels, patch_kernels_adjoint};
use crate::tape::render_op::{CHECKED, IlluminationKernel, RenderKernel};
use crate::tape::{BackwardPass, DeviceForm, Kernel, View};

/// The derivatives by PSF values and field radii from those by their kernels on a device.
pub fn by_psfs(
    psfs: &CubeTensor,
    (geometry, layout): (&RenderGeometry, &PsfLayout),
    d_kernels: &PatchKernels,
    wanted: [bool; 2],
) -> [Option<DispatchTensor>; 2] {
    let by = patch_kernels_adjoint(geometry, layout, &read(psfs), d_kernels, wanted).expect(CHECKED);
    let radii: Vec<f32> = by.radius.iter().map(|v| *v as f32).collect();
    let by_values = wanted[0].then(|| given(shaped(numbers(psfs, &by.values), psfs.shape())));
    [by_values, wanted[1].then(|| given(numbers(psfs, &radii)))]
}

impl RenderKernel {
    /// The kernels of patches on the host, in the order of patches.
    fn kernels(&self, psfs: &CubeTensor) -> PatchKernels {
        match &self.ready {
            Some(ready) => ready.of_patches(&self.active),
            None => patch_kernels(&self.geometry, &self.layout, &read(psfs), &self.active).expect(CHECKED),
        }
    }

    fn blend(&self, like: &CubeTensor, patches: &[usize]) -> Blend {
        let [_, _, height, width] = self.shape;
        let placements: Vec<Placement> = self.scenes.iter().map(|s| s.placement).collect();
        Blend::new(like, &self.geometry, patches, &placements, [height, width])
    }

    fn scenes_on(&self, like: &CubeTensor) -> CubeTensor {
        let scenes: Vec<&[f32]> = self.scenes.iter().map(|s| &s.scene.data[..]).collect();
        numbers(like, &scenes.concat())
    }
}

impl DeviceForm for RenderKernel {
    fn forward(&self, inputs: &[DispatchTensor], _: &[bool]) -> DispatchTensor {
        let psfs = taken(&inputs[0]);
        let kernels = self.kernels(&psfs);
        let blend = self.blend(&psfs, &kernels.patches);
        let of_kernels = numbers(&psfs, &kernels.values);
        given(blend.convolved(&self.scenes_on(&psfs), &of_kernels, self.radius, support(&kernels)))
    }

    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        let BackwardPass { gradient, wanted, .. } = at;
        let psfs = taken(&inputs[0]);
        let mut sum = PatchKernels::zeros(self.radius, &self.active);
        let blend = self.blend(&psfs, &sum.patches);
        sum.values = read(&blend.by_kernels(&self.scenes_on(&psfs), &taken(gradient), self.radius));
        by_psfs(&psfs, (&self.geometry, &self.layout), &sum, [wanted[0], wanted[1]]).into()
    }
}

impl DeviceForm for IlluminationKernel {
    fn forward(&self, inputs: &[DispatchTensor], _: &[bool]) -> DispatchTensor {
        let [_, _, height, width] = self.shape;
        let table = taken(&inputs[0]);
        let radii: Vec<f32> = self.layout.field_radius_mm.iter().map(|v| *v as f32).collect();
        let places = self.placements.iter().flat_map(|p| [p.row as u32, p.col as u32]).collect::<Vec<_>>();
        let map = empty(&table, self.shape);
        let (count, dim) = groups(&table, self.shape.iter().product());
        let RenderGeometry { sensor_height, sensor_width, pixel_um, .. } = self.geometry;
        let [y, x] = [sensor_height, sensor_width].map(|pixels| 0.5 * (pixels as f32 - 1.0));
        let (client, pixel_mm) = (&map.client, (pixel_um * 1e-3) as f32);
        let [radii, places] = [numbers(&table, &radii), words(&table, &places)];
        let [table, radii, places, to] = buffers([&table, &radii, &places, &map]);
        illuminate::launch(client, count, dim, table, radii, places, to, height, width, y, x, pixel_mm);
        given(map)
    }

    /// On the host: only a lens that moves wants it.
    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        let BackwardPass { gradient, wanted, .. } = at;
        let inputs: Vec<CubeTensor> = inputs.iter().map(taken).collect();
        let all: Vec<Vec<f32>> = inputs.iter().map(read).collect();
        let view = |(values, tensor): (&Vec<f32>, &CubeTensor)| (values.clone(), tensor.shape());
        let held: Vec<_> = all.iter().zip(&inputs).map(view).collect();
        let views: Vec<View> =
            held.iter().map(|(values, shape)| View { values, shape: shape.as_slice().to_vec() }).collect();
        let found = Kernel::backward(self, &views, &[], &read(&taken(gradient)), wanted);
        let keep = |((values, input), wanted): ((Vec<f32>, &CubeTensor), &bool)| {
            wanted.then(|| given(shaped(numbers(input, &values), input.shape())))
        };
        found.into_iter().zip(&inputs).zip(wanted).map(keep).collect()
    }
}

/// Relative illumination of every pixel, linear between the fields around its radius.
#[cube(launch)]
fn illuminate(
    table: &[f32],
    radii_mm: &[f32],
    places: &[u32],
    map: &mut [f32],
    height: usize,
    width: usize,
    middle_row: f32,
    middle_col: f32,
    pixel_mm: f32,
) {
    let at = ABSOLUTE_POS;
    if at < map.len() {
        let col = at % width;
        let row = at / width % height;
        let plane = at / (width * height);
        let frame = plane / CHANNELS;
        let y = (f32::cast_from(places[2 * frame] + row as u32) - middle_row) * pixel_mm;
        let x = (f32::cast_from(places[2 * frame + 1] + col as u32) - middle_col) * pixel_mm;
        let radius = (x * x + y * y).sqrt();
        // The last field at or below the radius, but for the last of all.
        let mut lower = 0usize;
        for field in 1..radii_mm.len() {
            if radii_mm[field] <= radius && field + 1 < radii_mm.len() {
                lower = field;
            }
        }
        let upper = min(lower + 1, radii_mm.len() - 1);
        let gap = radii_mm[upper] - radii_mm[lower];
        let mut of_upper = 0.0f32;
        if gap > 0.0f32 {
            of_upper = min(max((radius - radii_mm[lower]) / gap, 0.0f32), 1.0f32);
        }
        let a = table[lower * CHANNELS + plane % CHANNELS];
        map[at] = a + of_upper * (table[upper * CHANNELS + plane % CHANNELS] - a);
    }
}
