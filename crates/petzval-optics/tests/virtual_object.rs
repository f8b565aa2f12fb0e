//! Light that converges to a virtual object behind the first vertex, through a lens that images it without aberrations.

use std::sync::Arc;

use petzval_optics::analysis::wavefront;
use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::lens::{Lens, ObjectDistance, Surface, SurfaceShape};
use petzval_optics::merit::{Merit, SpotResiduals};
use petzval_optics::paraxial::{first_order, image_height_per_tangent, marginal_tangent};
use petzval_optics::pupil::{aim_at_pupil, chief_ray};
use petzval_optics::trace::launch;

/// The aplanatic points of a sphere of radius R = 20 mm in front of glass of n = 1.5: the point at R (1 + n) = 50 mm behind its vertex is
/// imaged sharply to R (1 + 1 / n) = 33.333 mm. A second sphere about that point does not refract the light.
fn aplanatic_lens() -> Lens {
    let glass = Arc::new(Glass::new("1.5", Dispersion::Constant(1.5)));
    let surface = |radius_mm: f64, thickness_mm, glass: &Arc<Glass>| Surface {
        shape: SurfaceShape { curvature: 1.0 / radius_mm, ..SurfaceShape::PLANE },
        thickness_mm,
        glass: glass.clone(),
        semi_diameter_mm: 15.0,
        ..Surface::default()
    };
    let image_mm = 20.0 * (1.0 + 1.0 / 1.5) - 8.0;
    Lens {
        name: "aplanatic".into(),
        source: String::new(),
        surfaces: vec![surface(20.0, 8.0, &glass), surface(image_mm, image_mm, &Glass::air())],
        stop: 0,
        entrance_pupil_mm: 24.0,
        object: ObjectDistance::Finite(-50.0),
        wavelengths_um: vec![0.5876],
        reference_um: 0.5876,
        fields_deg: vec![0.0, 0.5],
    }
}

#[test]
fn an_aplanatic_lens_images_a_virtual_object_sharply() {
    let lens = aplanatic_lens();
    let sequence = lens.at_wavelength(0.5876);
    assert!((first_order(&sequence).image_distance_mm - lens.image_distance_mm()).abs() < 1e-12);
    let axis = SpotResiduals { fields_rad: vec![0.0], field_weights: vec![1.0], ..SpotResiduals::new(&lens) };
    let spot_um = axis.value(&lens).unwrap();
    assert!(spot_um < 1e-6, "{spot_um}");
    let waves = wavefront(&lens, 0.0).unwrap().rms_waves[0];
    assert!(waves < 1e-6, "{waves}");
    // As soon as the object is elsewhere, it is not sharp.
    let elsewhere = Lens { object: ObjectDistance::Finite(-45.0), ..lens.clone() };
    assert!(axis.value(&petzval_optics::solve::with_paraxial_focus(&elsewhere, 0.0)).unwrap() > 1.0);
}

#[test]
fn light_converges_to_the_object_and_its_image_has_the_paraxial_height() {
    let lens = aplanatic_lens();
    let sequence = lens.at_wavelength(0.5876);
    let field_rad = lens.fields_deg[1].to_radians();
    let object = [0.0, 50.0 * field_rad.tan(), 50.0];
    let points = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [-0.5, -0.5]];
    let aimed = aim_at_pupil(&sequence, field_rad, first_order(&sequence).stop_radius_mm, &points, None);
    for i in 0..points.len() {
        let ray = launch(&sequence, field_rad, aimed.launch_of(i)).ray;
        assert!(ray.direction[2] > 0.0 && aimed.is_aimed(i));
        let along = (object[2] - ray.position[2]) / ray.direction[2];
        for axis in 0..2 {
            let there = ray.position[axis] + along * ray.direction[axis];
            assert!((there - object[axis]).abs() < 1e-12, "{i}: {there}");
        }
    }
    let height_mm = chief_ray(&sequence, field_rad).unwrap().y_mm;
    let paraxial_mm = image_height_per_tangent(&sequence) * field_rad.tan();
    assert!((height_mm / paraxial_mm - 1.0).abs() < 1e-3, "{height_mm} {paraxial_mm}");
    // The marginal ray goes down towards the axis.
    assert!(marginal_tangent(&sequence).unwrap() < 0.0);
}
