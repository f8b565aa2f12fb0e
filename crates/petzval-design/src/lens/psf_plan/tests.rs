use super::*;
use crate::assets::Assets;
use petzval_optics::lens::{Action, Axis, Pattern, Phase, Placement, Surface};
use petzval_optics::solve::with_paraxial_focus;

#[test]
fn light_beyond_the_grid_is_named() {
    let psf = PsfConfig::default();
    assert_eq!(psf.lost_light(0.985, None), None);
    let said = psf.lost_light(0.5, None).unwrap();
    assert!(said.contains("grid of 128 um cuts off 50 % of the light somewhere"), "{said}");
    let said = psf.lost_light(0.5, Some(9.04)).unwrap();
    assert!(said.contains("cuts off 50 % of the light at 9.0 degrees"), "{said}");
}

#[test]
fn fields_are_those_which_the_lens_images_at_the_radii_from_any_distance() {
    let nominal = assets().lens("cooke-triplet-nominal").unwrap().lens;
    let quadrature = Quadrature::grid(16).unwrap();
    let plan = PsfPlan::new(4, 6.0, [0.62, 0.55, 0.486], PsfOptions::default(), quadrature);
    for object in
        [100.0, 400.0, 1e5].map(ObjectDistance::Finite).into_iter().chain([ObjectDistance::Infinity])
    {
        let lens = with_paraxial_focus(&Lens { object, ..nominal.clone() }, 0.0);
        for (field, radius) in plan.field_angles(&lens).unwrap().into_iter().zip(&plan.field_radius_mm) {
            let chief = chief_ray(&lens.at_wavelength(lens.reference_um), field).unwrap();
            assert!((chief.y_mm - radius).abs() < 1e-9, "{object:?}: {}", chief.y_mm);
        }
        // The map has the scale of the image near the axis, and the distortion of the chief rays.
        let map = plan.distortion(&lens).unwrap();
        let field = plan.field_angle(&lens, 6.0).unwrap();
        let near = plan.field_angle(&lens, 0.01).unwrap();
        let wanted = 0.01 / near.tan() * field.tan();
        assert!((map.ideal_mm(6.0) / wanted - 1.0).abs() < 1e-5, "{object:?}");
    }
}

#[test]
fn tracing_that_is_cancelled_ends_before_the_next_field() {
    let nominal = assets().lens("cooke-triplet-nominal").unwrap().lens;
    let cancel = Cancel::default();
    cancel.set();
    let traced = by_waves(RoughFields::ByRays).trace_unless(&cancel, &nominal);
    assert!(traced.is_err_and(|error| error.is_stopped()));
}

fn assets() -> Assets {
    Assets::from_folder(&std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data"))
        .unwrap()
}

/// Waves on few cells.
fn by_waves(rough_fields: RoughFields) -> PsfPlan {
    let options = PsfOptions { grid: 64, pitch_um: 2.0, kind: PsfKind::Diffraction };
    let plan = PsfPlan::new(5, 6.0, [0.62, 0.55, 0.486], options, Quadrature::grid(32).unwrap());
    PsfPlan { rough_fields, ..plan }
}

/// The nominal triplet so wide open that no wave can be computed at some of its fields.
fn rough_somewhere() -> Lens {
    let nominal = assets().lens("cooke-triplet-nominal").unwrap().lens;
    let widened = (2..30).map(|k| {
        let entrance_pupil_mm = nominal.entrance_pupil_mm * (1.0 + 0.1 * f64::from(k));
        Lens { entrance_pupil_mm, ..nominal.clone() }
    });
    let rough = |lens: &Lens| match by_waves(RoughFields::ByRays).trace(lens) {
        Ok(bank) => (0.1..0.9).contains(&bank.by_rays()),
        Err(_) => false,
    };
    widened.into_iter().find(rough).expect("a pupil at which waves fail at some fields and not at others")
}

#[test]
fn a_field_of_which_no_wave_can_be_computed_is_refused_or_by_rays() {
    let lens = rough_somewhere();
    assert!(matches!(by_waves(RoughFields::Refused).bank(&lens), Err(DesignError::NoLight { .. })));
    let mixed = by_waves(RoughFields::ByRays).trace(&lens).unwrap();
    let rays = PsfOptions { kind: PsfKind::Geometric, ..by_waves(RoughFields::ByRays).options };
    let all_rays = PsfPlan { options: rays, ..by_waves(RoughFields::Refused) }.trace(&lens).unwrap();
    // Each field is wholly one or the other.
    let cells = 3 * 64 * 64;
    let same = (0..5)
        .filter(|f| mixed.bank.values[f * cells..][..cells] == all_rays.bank.values[f * cells..][..cells]);
    assert_eq!(same.count() as f64 / 5.0, mixed.by_rays());
    let config = PsfConfig { kind: PsfsBy::Diffraction, ..PsfConfig::default() };
    assert!(
        config
            .rough_fields(mixed.by_rays(), NoWaves::of(&lens))
            .unwrap()
            .contains("% of the fields are by rays")
    );
    assert_eq!(config.rough_fields(0.0, None), None);
}

/// A thin lens without power right behind the nominal triplet.
#[test]
fn a_thin_lens_behind_others_has_no_waves_and_is_named() {
    let mut lens = assets().lens("cooke-triplet-nominal").unwrap().lens;
    assert_eq!(NoWaves::of(&lens), None);
    let thin = Surface {
        action: Action::ThinLens { power_per_mm: 0.0 },
        thickness_mm: lens.image_distance_mm() - 1.0,
        semi_diameter_mm: 20.0,
        ..Surface::default()
    };
    lens = lens.with_image_distance(1.0);
    lens.surfaces.push(thin);
    let no_waves = NoWaves { surface: lens.surfaces.len() - 1 };
    let error = by_waves(RoughFields::Refused).bank(&lens).err().unwrap();
    assert!(matches!(error, DesignError::NoWaves(found) if found == no_waves), "{error}");
    assert!(error.to_string().starts_with("surface 8 is a thin lens") && error.is_input(), "{error}");
    let by_rays = by_waves(RoughFields::ByRays).trace(&lens).unwrap().by_rays();
    assert_eq!(by_rays, 1.0);
    let config = PsfConfig { kind: PsfsBy::Diffraction, ..PsfConfig::default() };
    let said = config.rough_fields(by_rays, NoWaves::of(&lens)).unwrap();
    assert!(said.contains("because surface 8 is a thin lens"), "{said}");
}

#[test]
fn fields_by_rays_stay_so_while_a_lens_moves() {
    let lens = rough_somewhere();
    let free = by_waves(RoughFields::ByRays);
    let held = free.held_as(&free.trace(&lens).unwrap());
    let RoughFields::Held(marked) = &held.rough_fields else { panic!("{:?}", held.rough_fields) };
    assert!(marked.contains(&true) && marked.contains(&false), "{marked:?}");
    // The PSFs of the lens are as without marks; those of the narrower lens keep their marks, although its waves could be computed.
    assert_eq!(held.bank(&lens).unwrap().values, free.bank(&lens).unwrap().values);
    let nominal = assets().lens("cooke-triplet-nominal").unwrap().lens;
    assert_eq!(free.trace(&nominal).unwrap().by_rays(), 0.0);
    let share = marked.iter().filter(|is_rough| **is_rough).count() as f64 / marked.len() as f64;
    assert_eq!(held.trace(&nominal).unwrap().by_rays(), share);
    // With other fields the marks are gone.
    assert_eq!(held.with_fields(7).rough_fields, RoughFields::ByRays);
}

#[test]
fn a_perfect_lens_has_the_image_of_the_kind_unless_another_is_named() {
    let perfect =
        petzval_optics::solve::thin_equivalent(&assets().lens("cooke-triplet-nominal").unwrap().lens);
    let sensor = assets().sensor("imx249-fitted").unwrap();
    let brightest = |kind: PsfKind, image: Option<PerfectImage>| {
        let plan =
            PsfConfig { kind: kind.into(), fields: 2, ..PsfConfig::default() }.plan(&sensor, 32).unwrap();
        let plan = PsfPlan { perfect_image: image.unwrap_or(plan.perfect_image), ..plan };
        plan.bank(&perfect).unwrap().values.iter().copied().fold(0.0, f32::max)
    };
    // A point between four cells gives each a quarter of its light; the Airy disk of f/4.4 in blue has 5.2 um across its first dark ring.
    let point = brightest(PsfKind::Geometric, None);
    assert!((point - 0.25).abs() < 1e-6, "{point}");
    let airy = brightest(PsfKind::Diffraction, None);
    assert!((0.1..0.2).contains(&airy), "{airy}");
    assert_eq!(brightest(PsfKind::Geometric, Some(PerfectImage::AiryDisk)), airy);
}

/// The nominal triplet with its first element moved.
fn decentred(decenter_mm: [f64; 2]) -> Lens {
    let mut lens = assets().lens("cooke-triplet-nominal").unwrap().lens;
    let placement = Placement { decenter_mm, axis: Axis::Returns, ..Placement::default() };
    lens.surfaces[..2].iter_mut().for_each(|surface| surface.placement = Some(placement));
    lens
}

fn three_fields() -> PsfPlan {
    let options = PsfOptions { grid: 32, pitch_um: 4.0, ..PsfOptions::default() };
    PsfPlan::new(3, 4.0, [0.62, 0.55, 0.486], options, Quadrature::grid(16).unwrap())
}

/// Where the chief ray of a field lands along y, mm.
fn height_mm(lens: &Lens, field_rad: f64) -> f64 {
    chief_ray(&lens.at_wavelength(lens.reference_um), field_rad).unwrap().y_mm
}

#[test]
fn the_field_of_radius_zero_is_the_one_that_is_imaged_on_the_axis() {
    let plan = three_fields();
    for offset_mm in [0.4, -0.4] {
        let lens = decentred([0.0, offset_mm]);
        assert!(height_mm(&lens, 0.0).abs() > 0.01);
        for (field, radius) in plan.field_angles(&lens).unwrap().into_iter().zip(&plan.field_radius_mm) {
            assert!((height_mm(&lens, field) - radius).abs() < 1e-6, "{offset_mm}: {radius}");
            assert!((height_mm(&lens, plan.field_angle(&lens, *radius).unwrap()) - radius).abs() < 1e-6);
        }
    }
    // Without a decentre along y it is field 0 to the bit.
    for lens in [decentred([0.0; 2]), decentred([0.4, 0.0])] {
        assert_eq!(plan.field_angles(&lens).unwrap()[0].to_bits(), 0);
        assert_eq!(plan.field_angle(&lens, 0.0).unwrap().to_bits(), 0);
    }
}

#[test]
fn behind_a_grating_the_fields_of_the_file_lead_to_the_one_on_the_axis() {
    // Light of 40 degrees leaves the grating along the axis of the perfect lens behind it.
    let lines_per_mm = 40_f64.to_radians().sin() / 0.55e-3;
    let grating = |order: i32| {
        let phase = Some(Phase { order, pattern: Pattern::Grating { lines_per_mm } });
        let plane = Surface { phase, thickness_mm: 5.0, semi_diameter_mm: 3.0, ..Surface::default() };
        let thin = Surface {
            action: Action::ThinLens { power_per_mm: 0.01 },
            thickness_mm: 100.0,
            semi_diameter_mm: 10.0,
            ..Surface::default()
        };
        let nominal = assets().lens("cooke-triplet-nominal").unwrap().lens;
        let side = f64::from(order.signum());
        Lens {
            surfaces: vec![plane, thin],
            stop: 0,
            entrance_pupil_mm: 4.0,
            wavelengths_um: vec![0.55],
            reference_um: 0.55,
            fields_deg: vec![-42.0 * side, -38.0 * side],
            ..nominal
        }
    };
    for lens in [grating(1), grating(-1)] {
        let fields = three_fields().field_angles(&lens).unwrap();
        assert!((fields[0].abs().to_degrees() - 40.0).abs() < 1e-6, "{fields:?}");
        assert!((height_mm(&lens, fields[2]) - 4.0).abs() < 1e-6, "{fields:?}");
    }
}

#[test]
fn radii_in_files_are_the_distances_of_the_images_from_the_axis() {
    let plan = three_fields();
    for decenter_mm in [[0.0; 2], [0.0, 0.4]] {
        let lens = decentred(decenter_mm);
        let psfs = plan.psfs(&lens, &Cancel::default()).unwrap();
        assert_eq!(plan.landing_radii_mm(&lens, &psfs), plan.field_radius_mm);
    }
    let lens = decentred([0.4, 0.0]);
    let psfs = plan.psfs(&lens, &Cancel::default()).unwrap();
    for (radius_mm, psf) in plan.landing_radii_mm(&lens, &psfs).into_iter().zip(&psfs) {
        assert!(psf.chief_x_mm.abs() > 0.01, "{}", psf.chief_x_mm);
        assert_eq!(radius_mm, psf.chief_x_mm.hypot(psf.chief_y_mm));
    }
}

#[test]
fn the_scale_of_a_decentred_lens_is_the_slope_of_its_image_height() {
    let plan = three_fields();
    let scale_mm = |lens: &Lens| plan.image_scale_mm(lens).unwrap().unwrap();
    let straight = scale_mm(&decentred([0.0; 2]));
    let [above, below] = [0.4, -0.4].map(|mm| scale_mm(&decentred([0.0, mm])));
    // Mirror images of each other have the same scale, and a decentre changes it little.
    assert!((above / below - 1.0).abs() < 1e-4, "{above} {below}");
    assert!((above / straight - 1.0).abs() < 0.05, "{above} {straight}");
    // Of a lens with symmetry it is the height of one chief ray over the tangent of its field.
    let nominal = assets().lens("cooke-triplet-nominal").unwrap().lens;
    let near = plan.field_angles(&nominal).unwrap()[2] * NEAR_AXIS;
    assert_eq!(scale_mm(&nominal), height_mm(&nominal, near) / near.tan());
}

#[test]
fn the_scale_of_a_lens_out_of_focus_is_that_of_its_chief_rays_on_the_plane() {
    let plan = three_fields();
    let nominal = assets().lens("cooke-triplet-nominal").unwrap().lens;
    let lens = with_paraxial_focus(&nominal, 1.0);
    let last = plan.field_angles(&lens).unwrap()[2];
    let scale_mm = scale_of_bank_mm(&lens, last).unwrap();
    assert_eq!(Some(scale_mm), plan.image_scale_mm(&lens).unwrap());
    // A plane that is 1 mm away from the paraxial image has another scale than the focal length.
    assert!((scale_mm / paraxial_scale_mm(&lens) - 1.0).abs() > 5e-3, "{scale_mm}");
    // The image of a near object is upside down, and the bank has radii without a sign.
    let near = with_paraxial_focus(&Lens { object: ObjectDistance::Finite(200.0), ..nominal.clone() }, 0.0);
    let stated_mm = scale_of_bank_mm(&near, 0.1).unwrap();
    assert!((stated_mm / paraxial_scale_mm(&near) - 1.0).abs() < 1e-3, "{stated_mm}");
    assert_eq!(scale_of_bank_mm(&nominal, 0.0), None);
}

#[test]
fn a_cancelled_plan_traces_no_field() {
    let (plan, cancel) = (three_fields(), Cancel::default());
    let lens = assets().lens("cooke-triplet-nominal").unwrap().lens;
    cancel.set();
    assert!(plan.psfs(&lens, &cancel).is_err_and(|error| error.is_stopped()));
    assert!(plan.converged(&lens, 1e-9, &cancel).is_err_and(|error| error.is_stopped()));
}
