//! Relative illumination against rays of a uniform scene, thrown at random through the real stop.

mod common;

use common::{nearly_telecentric, nominal_triplet};
use petzval_optics::analysis::{AnalysisOptions, field_curves};
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::paraxial::{first_order, image_height_per_tangent};
use petzval_optics::psf::{PsfOptions, psf};
use petzval_optics::pupil::{Quadrature, field_imaged_at};
use petzval_optics::solve::with_paraxial_focus;
use petzval_optics::spot::spot;
use petzval_optics::trace::{Ray, trace_ray};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Irradiance of the image of a uniform scene in the ring `inner_mm ... outer_mm` of the image plane, per unit of radiance.
///
/// Points of the first vertex plane are drawn evenly from a disc around the paraxial entrance pupil that is wider than any beam. Directions are drawn evenly in
/// projected solid angle, within fields whose chief rays land near the ring. Rays that pass the stop and land in the ring count by
/// the transmission of the clear apertures. This shares only the tracing of single rays with the code under test.
fn thrown(lens: &Lens, [inner_mm, outer_mm]: [f64; 2], rays: usize) -> f64 {
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    let stop_mm = order.stop_radius_mm;
    let disc_mm = 0.65 * lens.entrance_pupil_mm;
    let scale = image_height_per_tangent(&sequence).abs();
    // Fields of the ring with a margin for blur and distortion.
    let square_sine = |height_mm: f64| (height_mm.max(0.0) / scale).atan().sin().powi(2);
    let [from, to] = [square_sine(0.85 * inner_mm - 0.4), square_sine(1.2 * outer_mm + 0.4)];
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut sum = 0.0;
    for _ in 0..rays {
        let (r, azimuth) =
            (disc_mm * random.random::<f64>().sqrt(), random.random_range(0.0..std::f64::consts::TAU));
        let (sin, turn) =
            (random.random_range(from..to).sqrt(), random.random_range(0.0..std::f64::consts::TAU));
        let (l, m) = (sin * turn.sin(), sin * turn.cos());
        let n = (1.0 - sin * sin).sqrt();
        // The disc is where the pupil lies as seen along the ray.
        let shift = -order.entrance_pupil_at_mm / n;
        let position = [r * azimuth.sin() + shift * l, r * azimuth.cos() + shift * m, 0.0];
        let path = trace_ray(&sequence, Ray { position, direction: [l, m, n] });
        let Some(image) = path.image else { continue };
        let [x, y, _] = path.passages[lens.stop].point;
        let landed = image.position[0].hypot(image.position[1]);
        if x.hypot(y) < stop_mm && landed > inner_mm && landed < outer_mm {
            sum += path.transmission;
        }
    }
    // Flux = radiance x area x projected solid angle, d(sin^2) d(azimuth) / 2.
    let etendue = std::f64::consts::PI * disc_mm * disc_mm * std::f64::consts::PI * (to - from);
    sum / rays as f64 * etendue / (std::f64::consts::PI * (outer_mm.powi(2) - inner_mm.powi(2)))
}

/// Illumination at an image radius relative to the axis, thrown.
fn thrown_relative(lens: &Lens, radius_mm: f64) -> f64 {
    let rays = 1_500_000;
    thrown(lens, [radius_mm - 0.15, radius_mm + 0.15], rays) / thrown(lens, [0.0, 0.6], rays)
}

fn field_at(lens: &Lens, radius_mm: f64) -> f64 {
    let sequence = lens.at_wavelength(lens.reference_um);
    let guess = (radius_mm / image_height_per_tangent(&sequence).abs()).atan();
    field_imaged_at(&sequence, radius_mm, guess).unwrap()
}

fn psf_relative(lens: &Lens, field_rad: f64) -> f64 {
    let quadrature = Quadrature::grid(128).unwrap();
    let at = |field: f64| {
        let psf = psf(lens, field, &[lens.reference_um], &quadrature, &PsfOptions::default()).unwrap();
        psf.illumination[0]
    };
    at(field_rad) / at(0.0)
}

#[test]
fn illumination_is_that_of_a_uniform_scene_on_the_real_image() {
    // The corner of the paper's sensor, where the nominal triplet has 5.9 % of barrel distortion.
    let lens = nominal_triplet();
    for radius_mm in [4.0, 6.63] {
        let wanted = thrown_relative(&lens, radius_mm);
        let field = field_at(&lens, radius_mm);
        let found = psf_relative(&lens, field);
        assert!((found / wanted - 1.0).abs() < 0.01, "{radius_mm} mm: {found} for {wanted}");
        // Spots and the analysis say the same.
        let quadrature = Quadrature::grid(128).unwrap();
        let reference = Lens { wavelengths_um: vec![lens.reference_um], ..lens.clone() };
        let light = |field: f64| spot(&reference, field, &quadrature).unwrap().illumination[0];
        assert!((light(field) / light(0.0) / found - 1.0).abs() < 2e-3);
        let of_field = Lens { fields_deg: vec![0.0, field.to_degrees()], ..reference };
        let curves = field_curves(&of_field, &AnalysisOptions::default()).unwrap();
        let curve = *curves.relative_illumination[0].last().unwrap();
        assert!((curve / found - 1.0).abs() < 2e-3, "{curve} for {found}");
    }
}

#[test]
fn illumination_of_a_near_scene_is_that_of_its_real_image() {
    let near = Lens { object: ObjectDistance::Finite(200.0), ..nominal_triplet() };
    let lens = with_paraxial_focus(&near, 0.0);
    // By pairs of rings: rays of a near plane of uniform radiance are rays of any uniform scene.
    let wanted = thrown_relative(&lens, 6.0);
    let found = psf_relative(&lens, field_at(&lens, 6.0).abs());
    assert!((found / wanted - 1.0).abs() < 0.01, "{found} for {wanted}");
}

#[test]
fn every_colour_has_the_light_of_its_cone_where_chief_rays_are_nearly_parallel() {
    // The entrance pupil is a hundred metres away, and that of another colour a hundred times nearer. The cone from the object to the rim of the
    // stop is nearly the same.
    let lens = nearly_telecentric(0.1, vec![0.486, 0.5876, 0.656], 0.5876);
    let light =
        spot(&with_paraxial_focus(&lens, 0.0), 0.0, &Quadrature::grid(64).unwrap()).unwrap().illumination;
    assert!(light.iter().all(|l| (l - 1.0).abs() < 0.05 && (l / light[1] - 1.0).abs() < 0.01), "{light:?}");
}
