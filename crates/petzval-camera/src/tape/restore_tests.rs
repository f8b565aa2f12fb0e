use std::sync::Arc;

use burn::prelude::*;
use petzval_base::Cancel;

use super::tests::{tensor, uniform, values};
use super::*;
use crate::image::CHANNELS;
use crate::psf::PsfBank;
use crate::render::{KNOTS, Placement, RenderGeometry, Wiener, patch_kernels};

const GRID: usize = 16;
const HEIGHT: usize = 30;
const WIDTH: usize = 26;

fn geometry() -> RenderGeometry {
    RenderGeometry { sensor_height: 60, sensor_width: 80, pixel_um: 5.0, patches: (2, 3) }
}

/// Uneven Gauss curves, wider at the corner.
fn bank() -> PsfBank {
    let mut values = Vec::new();
    for (field, sigma) in [3.0f32, 4.5].into_iter().enumerate() {
        for c in 0..CHANNELS {
            let random = uniform((10 * field + c) as u64, GRID * GRID);
            let at = |i: usize| (i as f32 - 7.5) * 1.5 / sigma;
            let cell = |i: usize| (-0.5 * (at(i / GRID).powi(2) + at(i % GRID).powi(2))).exp();
            let psf: Vec<f32> = (0..GRID * GRID).map(|i| cell(i) * (0.5 + random[i])).collect();
            let sum: f32 = psf.iter().sum();
            values.extend(psf.iter().map(|v| v / sum));
        }
    }
    let field_radius_mm = vec![0.0, 0.25];
    PsfBank { field_radius_mm, grid: GRID, pitch_um: 1.5, values, illumination: vec![1.0; 6] }
}

fn restoration() -> Restoration {
    Restoration {
        wiener: Wiener { noise: 0.02, ..Wiener::default() },
        layout: bank().layout(),
        geometry: geometry(),
        ready: None,
        placements: vec![Placement { row: 0, col: 3 }, Placement { row: 27, col: 50 }],
    }
}

/// Pictures, PSF values, radii and curves, flattened.
fn inputs() -> [Vec<f32>; 4] {
    let curves = uniform(6, CHANNELS * KNOTS).into_iter().map(|v| 2.0 * v - 1.0).collect();
    [uniform(5, 2 * CHANNELS * HEIGHT * WIDTH), bank().values, vec![0.0, 0.25], curves]
}

/// The restoration of such inputs. A layout has its own radii; the tensor carries their gradient.
fn restored([pictures, psf, radii, curves]: [Tensor<1>; 4]) -> Tensor<4> {
    let mut restoration = restoration();
    restoration.layout.field_radius_mm = values(radii.clone()).into_iter().map(f64::from).collect();
    restore_op(
        pictures.reshape([2, CHANNELS, HEIGHT, WIDTH]),
        psf.reshape([2, CHANNELS, GRID, GRID]),
        radii,
        curves.reshape([CHANNELS, KNOTS]),
        restoration,
    )
    .unwrap()
}

#[test]
fn ready_kernels_change_no_bit() {
    let active = vec![true; geometry().patch_count()];
    let ready = patch_kernels(&geometry(), &bank().layout(), &bank().values, &active).unwrap();
    let [plain, prepared] = [None, Some(Arc::new(ready))].map(|ready| {
        let [pictures, psf, radii, curves] = inputs();
        let curves = tensor(curves, [CHANNELS, KNOTS]).require_grad();
        let out = restore_op(
            tensor(pictures, [2, CHANNELS, HEIGHT, WIDTH]),
            tensor(psf, [2, CHANNELS, GRID, GRID]),
            tensor(radii, [2]),
            curves.clone(),
            Restoration { ready, ..restoration() },
        );
        let gradients = out.clone().unwrap().square().sum().backward();
        (values(out.unwrap()), values(curves.grad(&gradients).unwrap()))
    });
    assert!(plain == prepared);
    // Kernels of too few patches are refused.
    let few =
        patch_kernels(&geometry(), &bank().layout(), &bank().values, &[true, false, true, true, true, true]);
    let [pictures, psf, radii, curves] = inputs().map(|v| tensor(v.clone(), [v.len()]));
    let out = restore_op(
        pictures.reshape([2, CHANNELS, HEIGHT, WIDTH]),
        psf.reshape([2, CHANNELS, GRID, GRID]),
        radii,
        curves.reshape([CHANNELS, KNOTS]),
        Restoration { ready: Some(Arc::new(few.unwrap())), ..restoration() },
    );
    assert!(out.is_err());
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

#[test]
fn restoration_on_the_tape_is_its_reference() {
    let [pictures, _, _, curves] = inputs();
    let found = values(restored(inputs().map(|v| tensor(v.clone(), [v.len()]))));
    let Restoration { mut wiener, geometry, placements, .. } = restoration();
    wiener.curves.as_flattened_mut().copy_from_slice(&curves);
    let n = CHANNELS * HEIGHT * WIDTH;
    for (i, placement) in placements.into_iter().enumerate() {
        let picture = picture(&pictures, i, CHANNELS, HEIGHT, WIDTH);
        let expected = wiener.restore(&geometry, &bank(), &picture, placement, &Cancel::default()).unwrap();
        assert_eq!(found[i * n..(i + 1) * n], expected.data);
    }
}

#[test]
fn restoration_has_the_gradient_of_differences_in_every_input() {
    let weight: Vec<f32> = uniform(9, 2 * CHANNELS * HEIGHT * WIDTH).into_iter().map(|v| v - 0.5).collect();
    let loss = |at: [Vec<f32>; 4]| dot(&values(restored(at.map(|v| tensor(v.clone(), [v.len()])))), &weight);
    let leaves = inputs().map(|v| tensor(v.clone(), [v.len()]).require_grad());
    let weighted = restored(leaves.clone()) * tensor(weight.clone(), [2, CHANNELS, HEIGHT, WIDTH]);
    let gradients = weighted.sum().backward();
    let found = leaves.map(|leaf| values(leaf.grad(&gradients).unwrap()));
    for (i, (name, step, tolerance)) in
        [("pictures", 0.1, 1e-3), ("PSFs", 1e-4, 1e-2), ("radii", 0.02, 1e-2), ("curves", 0.02, 5e-3)]
            .into_iter()
            .enumerate()
    {
        let mut direction: Vec<f32> =
            uniform(20 + i as u64, found[i].len()).into_iter().map(|v| v - 0.5).collect();
        if name == "radii" {
            // The first field stays on the axis.
            direction[0] = 0.0;
        }
        let moved = |step: f32| {
            let mut at = inputs();
            at[i].iter_mut().zip(&direction).for_each(|(v, d)| *v += step * d);
            loss(at)
        };
        let wanted = (moved(step) - moved(-step)) / (2.0 * f64::from(step));
        let found = dot(&found[i], &direction);
        assert!((found / wanted - 1.0).abs() < tolerance, "{name}: {found} against {wanted}");
    }
}

#[test]
fn an_input_that_is_tracked_alone_has_the_bits_that_it_has_beside_the_others() {
    let gradients = |is_tracked: [bool; 4]| {
        let mut flags = is_tracked.into_iter();
        let leaves = inputs().map(|v| {
            let leaf: Tensor<1> = tensor(v.clone(), [v.len()]);
            if flags.next() == Some(true) { leaf.require_grad() } else { leaf }
        });
        let gradients = restored(leaves.clone()).square().sum().backward();
        leaves.map(|leaf| leaf.grad(&gradients).map(values))
    };
    let all = gradients([true; 4]);
    for i in 0..4 {
        let mut alone = [false; 4];
        alone[i] = true;
        for (k, found) in gradients(alone).into_iter().enumerate() {
            assert!(found == all[k].clone().filter(|_| k == i), "input {k}, tracked {i}");
        }
    }
}

#[test]
fn restoration_and_its_transpose_have_one_dot_product() {
    // Linear in the pictures, border included: <bar, R v> = <R^T bar, v>.
    let bar = uniform(30, 2 * CHANNELS * HEIGHT * WIDTH);
    let [pictures, psf, radii, curves] = inputs().map(|v| tensor(v.clone(), [v.len()]));
    let pictures = pictures.require_grad();
    let out = restored([pictures.clone(), psf, radii, curves]);
    let forward = dot(&values(out.clone()), &bar);
    let gradients = (out * tensor(bar, [2, CHANNELS, HEIGHT, WIDTH])).sum().backward();
    let back = dot(&values(pictures.grad(&gradients).unwrap()), &inputs()[0]);
    assert!((forward / back - 1.0).abs() < 1e-5, "{forward} {back}");
}

#[test]
fn wrong_shapes_are_typed_errors() {
    let of = |restoration: Restoration, knots: usize| {
        let [pictures, psf, radii, _] = inputs();
        restore_op(
            tensor(pictures, [2, CHANNELS, HEIGHT, WIDTH]),
            tensor(psf, [2, CHANNELS, GRID, GRID]),
            tensor(radii, [2]),
            tensor(vec![0.0; CHANNELS * knots], [CHANNELS, knots]),
            restoration,
        )
    };
    assert!(of(restoration(), KNOTS).is_ok());
    assert!(of(restoration(), KNOTS + 1).is_err());
    let off = Placement { row: 31, col: 0 };
    assert!(of(Restoration { placements: vec![off, off], ..restoration() }, KNOTS).is_err());
    assert!(of(Restoration { placements: vec![Placement::default()], ..restoration() }, KNOTS).is_err());
}
