//! Several nodes at a time against one at a time.

use super::super::map::{WavePoint, WavePointBar};
use super::*;
use crate::common::{nominal_triplet, special_lenses};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::number::Number;
use crate::paraxial::first_order;
use crate::pupil::chief_ray;
use crate::trace::Sequence;

fn scattered(i: usize, salt: f64) -> f64 {
    2.0 * (i as f64 * 0.754_877_666 + salt).fract() - 1.0
}

/// The wave of a lens and its nodes, one at a time.
fn with_each_node(
    map: &WaveMap,
    grid: &NodeGrid,
    mut each: impl FnMut(&WaveRow, usize, usize, usize, WavePoint),
) {
    for j in 0..grid.nodes {
        let row = map.row(grid.q(j));
        for (c, i) in grid.columns(map.samples.sides).enumerate() {
            each(&row, c, i, j, map.point(&row, grid.q(i), grid.soft));
        }
    }
}

fn map_of(lens: &Lens, field_deg: f64) -> (Sequence, WaveMap) {
    let sequence = lens.at_wavelength(lens.reference_um);
    let field = field_deg.to_radians();
    let chief = chief_ray(&sequence, field).unwrap();
    let stop_mm = first_order(&sequence).stop_radius_mm;
    let map = WaveMap::new(&sequence, field, stop_mm, [chief.x_mm, chief.y_mm], None).unwrap();
    (sequence, map)
}

#[test]
fn several_nodes_at_a_time_equal_one_at_a_time_and_back() {
    // Without and with rays cut by an aperture in front of the stop, and a lens without a plane of symmetry.
    let mut cut = nominal_triplet();
    cut.surfaces[0].semi_diameter_mm = 3.5;
    let mut lenses = vec![(nominal_triplet(), 0.0), (nominal_triplet(), 14.0), (cut, 10.0)];
    lenses.extend(special_lenses().into_iter().filter(|l| l.name.contains("tilted")).map(|l| (l, 5.0)));
    assert!(lenses.len() > 3);
    for (lens, field_deg) in lenses {
        let (sequence, map) = map_of(&lens, field_deg);
        let grid = NodeGrid { nodes: 80, soft: 0.02, wavenumber: TAU / (1e-3 * lens.reference_um) };
        let found = grid.wave(&map);
        let times = images(map.samples.sides);
        let (mut light, mut energy) = (0.0, 0.0);
        with_each_node(&map, &grid, |_, c, _, j, point| {
            let (sin, cos) = (grid.wavenumber * point.path_mm).sin_cos();
            let off = (found.wave.re[(c, j)] - point.amplitude * cos)
                .hypot(found.wave.im[(c, j)] - point.amplitude * sin);
            assert!(off < 1e-9 * (1.0 + point.amplitude), "{} {c} {j}: {off}", lens.name);
            light += times * point.light;
            energy += times * point.energy;
        });
        assert!(light > 0.0 && (found.light / light - 1.0).abs() < 1e-12);
        assert!((found.energy / energy - 1.0).abs() < 1e-12);
        // The transpose, compared with that of one node at a time.
        let (rows, columns) = found.wave.re.shape();
        let mut bar_wave = Complex::zeros(rows, columns);
        for (i, value) in bar_wave.re.iter_mut().enumerate() {
            *value = scattered(i, 0.2);
        }
        for (i, value) in bar_wave.im.iter_mut().enumerate() {
            *value = scattered(i, 0.7);
        }
        let (light_bar, energy_bar) = (0.3, -0.8);
        let gradient = |sums: &mut WaveCotangent| {
            let mut gradient = LensGradient::zero(sequence.surfaces.len());
            let by_stop = map.pull_back(&sequence, sums, &mut gradient);
            (gradient, by_stop)
        };
        let mut sums = map.zero_cotangent();
        grid.pull_back(
            &map,
            NodeWaveBar { wave: &bar_wave, light: light_bar, energy: energy_bar },
            &mut sums,
        );
        let (fast, fast_stop) = gradient(&mut sums);
        let mut sums = map.zero_cotangent();
        let mut rows: Vec<(f64, WaveRow)> = Vec::new();
        with_each_node(&map, &grid, |row, c, i, j, point| {
            if rows.len() == j {
                rows.push((grid.q(j), map.zero_row(row)));
            }
            let (sin, cos) = (grid.wavenumber * point.path_mm).sin_cos();
            let (re, im) = (bar_wave.re[(c, j)], bar_wave.im[(c, j)]);
            let bar = WavePointBar {
                amplitude: re * cos + im * sin,
                path: grid.wavenumber * point.amplitude * (im * cos - re * sin),
                light: times * light_bar,
                energy: times * energy_bar,
            };
            map.pull_back_point(row, grid.q(i), grid.soft, bar, &mut rows[j].1, &mut sums);
        });
        for (q_y, row_bar) in &rows {
            map.pull_back_row(row_bar, *q_y, &mut sums);
        }
        let (reference, reference_stop) = gradient(&mut sums);
        for surface in 0..lens.surfaces.len() {
            for number in [Number::Curvature, Number::Thickness, Number::SemiDiameter] {
                let (a, b) = (fast[(surface, number)], reference[(surface, number)]);
                assert!(
                    (a - b).abs() < 1e-8 * (1.0 + b.abs()),
                    "{} {surface} {number:?}: {a} {b}",
                    lens.name
                );
            }
        }
        assert!((fast_stop - reference_stop).abs() < 1e-8 * (1.0 + reference_stop.abs()));
    }
}
