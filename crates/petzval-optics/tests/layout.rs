//! Layouts: rays that start and end where they should, and surfaces that belong to no glass.

mod common;

use common::{nominal_triplet, telescope};
use petzval_optics::analysis::{AnalysisOptions, LineKind, layout};
use petzval_optics::lens::{Action, Lens, ObjectDistance, Surface};
use petzval_optics::paraxial::first_order;

fn with_rays(layout_rays: usize) -> AnalysisOptions {
    AnalysisOptions { layout_rays, ..AnalysisOptions::default() }
}

#[test]
fn the_axial_fan_is_symmetric_and_meets_the_stop_evenly() {
    let lens = Lens { fields_deg: vec![0.0], ..nominal_triplet() };
    let found = layout(&lens, &with_rays(9));
    let rays = &found.rays[0];
    assert_eq!(rays.len(), 9);
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    for (i, ray) in rays.iter().enumerate() {
        assert!(!ray.is_lost);
        // One corner before the lens, then one per surface: the stop is the fifth of them.
        let wanted = order.stop_radius_mm * (i as f64 / 4.0 - 1.0);
        assert!((ray.points[5][1] - wanted).abs() < 1e-9);
        assert!((ray.points.last().unwrap()[0] - lens.total_track_mm()).abs() < 1e-9);
        for (p, q) in ray.points.iter().zip(&rays[8 - i].points) {
            assert!((p[1] + q[1]).abs() < 1e-9);
        }
    }
}

#[test]
fn a_clipped_ray_ends_at_the_surface_that_stops_it() {
    let mut lens = nominal_triplet();
    lens.surfaces[6].semi_diameter_mm = 2.0;
    lens.fields_deg = vec![15.0];
    let found = layout(&lens, &with_rays(11));
    let lost: Vec<_> = found.rays[0].iter().filter(|r| r.is_lost).collect();
    assert!(!lost.is_empty());
    assert!(lost.iter().all(|r| r.points.len() == 8));
}

#[test]
fn rays_start_in_front_of_all_surfaces_but_not_before_their_object() {
    let found = layout(&telescope(), &with_rays(5));
    let foremost = found.lines.iter().flat_map(|l| &l.points).map(|p| p[0]).fold(0.0, f64::min);
    assert!(foremost < -10.0, "{foremost}");
    assert!(found.rays.iter().flatten().all(|r| r.points[0][0] < foremost));

    let near = Lens { object: ObjectDistance::Finite(2.0), ..nominal_triplet() };
    let found = layout(&near, &with_rays(5));
    // All rays of a field start at its object point.
    for fan in &found.rays {
        assert!(!fan.is_empty());
        for ray in fan {
            assert_eq!(ray.points[0][0], -2.0);
            assert!((ray.points[0][1] - fan[0].points[0][1]).abs() < 1e-9);
        }
    }
}

#[test]
fn a_mirrors_back_lies_away_from_the_light() {
    let found = layout(&telescope(), &with_rays(3));
    let mirrors: Vec<_> = found.lines.iter().filter(|l| l.kind == LineKind::Mirror).collect();
    assert!(mirrors.len() >= 2);
    // The chief ray of the axis: the corner before each mirror lies in front of it.
    let chief = &found.rays[0][1].points;
    for (i, mirror) in mirrors.iter().enumerate() {
        let arriving = [0, 1].map(|k| chief[i + 1][k] - chief[i][k]);
        assert!(mirror.back[0] * arriving[0] + mirror.back[1] * arriving[1] > 0.0, "mirror {i}");
        assert!((mirror.back[0].hypot(mirror.back[1]) - 1.0).abs() < 1e-12);
    }
}

#[test]
fn thin_lenses_are_distinguished_by_their_power() {
    let mut lens = nominal_triplet();
    let thin = |power_per_mm: f64| Surface {
        action: Action::ThinLens { power_per_mm },
        thickness_mm: 20.0,
        semi_diameter_mm: 5.0,
        ..Surface::default()
    };
    lens.surfaces = vec![thin(0.02), thin(-0.01)];
    lens.stop = 0;
    let kinds: Vec<LineKind> = layout(&lens, &with_rays(3)).lines.iter().map(|l| l.kind).collect();
    assert_eq!(kinds, [LineKind::ConvergingLens, LineKind::DivergingLens]);
}

/// The stop at the vertex of a concave surface lies in front of its rim. Rays go on from the rim: they are drawn neither back to the stop nor across
/// the glass.
#[test]
fn rays_do_not_turn_back_to_a_plane_that_does_nothing() {
    let mut lens = nominal_triplet();
    let gap_mm = std::mem::replace(&mut lens.surfaces[3].thickness_mm, 0.0);
    lens.surfaces[4].thickness_mm += gap_mm;
    let found = layout(&lens, &with_rays(5));
    let rays: Vec<_> = found.rays.iter().flatten().collect();
    assert!(rays.len() > 5);
    for ray in &rays {
        assert!(ray.points.windows(2).all(|pair| pair[1][0] >= pair[0][0]), "{:?}", ray.points);
    }
    // One corner before the lens, six on its surfaces with glass, one on the image.
    assert!(rays.iter().any(|ray| ray.points.len() == 8));
}
