//! The blend of patches against the PSF that is traced for each place.

use petzval_camera::psf::PsfBank;
use petzval_camera::render::{PatchKernels, RenderGeometry, blend_error, patch_kernels, with_patches_for};
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_optics::psf::PsfOptions;
use petzval_optics::pupil::Quadrature;

use crate::common::library;

/// A grid of patches so fine that one patch is a place: 5 rows by 8 columns.
const PLACES: (usize, usize) = (240, 240);

fn kernels(geometry: &RenderGeometry, bank: &PsfBank, patches: &[usize]) -> PatchKernels {
    let mut active = vec![false; geometry.patch_count()];
    patches.iter().for_each(|patch| active[*patch] = true);
    patch_kernels(geometry, &bank.layout(), &bank.values, &active).unwrap()
}

/// The patches around position `at` of an axis, in pixels, and their weights: linear between the centres, constant beyond them.
fn around(at: f64, len: usize, patches: usize) -> [(usize, f64); 2] {
    let position = ((at + 0.5) * patches as f64 / len as f64 - 0.5).clamp(0.0, (patches - 1) as f64);
    let low = (position.floor() as usize).min(patches - 2);
    [(low, 1.0 - (position - low as f64)), (low + 1, position - low as f64)]
}

/// L1 difference between the blend and the PSF traced for a place, mean of the colours.
fn difference(
    plan: &PsfPlan,
    lens: &petzval_optics::lens::Lens,
    bank: &PsfBank,
    geometry: &RenderGeometry,
    place: usize,
) -> f64 {
    let fine = RenderGeometry { patches: PLACES, ..geometry.clone() };
    let (x, y) = fine.patch_centre_um(place);
    let exact_plan = PsfPlan { field_radius_mm: vec![0.0, 1e-3 * x.hypot(y)], ..plan.clone() };
    let exact = kernels(&fine, &exact_plan.bank(lens).unwrap(), &[place]);
    let (row, col) = (
        y / geometry.pixel_um + 0.5 * (geometry.sensor_height as f64 - 1.0),
        x / geometry.pixel_um + 0.5 * (geometry.sensor_width as f64 - 1.0),
    );
    let mut blended = vec![0.0; 3 * exact.size() * exact.size()];
    for (i, by_row) in around(row, geometry.sensor_height, geometry.patches.0) {
        for (j, by_col) in around(col, geometry.sensor_width, geometry.patches.1) {
            let patch = i * geometry.patches.1 + j;
            let of_patch = kernels(geometry, bank, &[patch]);
            let values = (0..3).flat_map(|c| of_patch.kernel(patch, c).to_vec());
            blended.iter_mut().zip(values).for_each(|(b, v)| *b += by_row * by_col * f64::from(v));
        }
    }
    let values = (0..3).flat_map(|c| exact.kernel(place, c).to_vec());
    blended.iter().zip(values).map(|(b, v)| (b - f64::from(v)).abs()).sum::<f64>() / 3.0
}

#[test]
fn the_chosen_patches_blend_to_the_stated_error() {
    let lens = library().lens("cooke-triplet-nominal").unwrap().lens;
    let options = PsfOptions::default();
    let plan = PsfPlan::new(31, 6.634, [0.62, 0.55, 0.486], options, Quadrature::grid(96).unwrap());
    let bank = plan.bank(&lens).unwrap();
    let coarse = RenderGeometry::default();
    let (chosen, stated) = with_patches_for(&coarse, &bank, 0.03).unwrap();
    assert!(stated.median <= 0.03);
    // Places spread over the sensor by a sequence that fills it evenly.
    let median = |geometry: &RenderGeometry| {
        let mut errors: Vec<f64> = (1..=25)
            .map(|i| {
                let share = |step: f64| (f64::from(i) * step).fract();
                let (row, col) =
                    ((share(0.754_877_666) * 240.0) as usize, (share(0.569_840_291) * 240.0) as usize);
                difference(&plan, &lens, &bank, geometry, row * 240 + col)
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        errors[12]
    };
    let (before, after) = (median(&coarse), median(&chosen));
    println!("7 x 7: {before:.3}, {:?}: {after:.3} (stated {stated:?})", chosen.patches);
    assert!(before > 0.1, "{before}");
    assert!(after <= 0.032, "{after}");
    assert!(blend_error(&coarse, &bank).unwrap().median > 0.1);
}
