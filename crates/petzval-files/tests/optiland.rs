//! Files of Optiland: first-order properties, both layouts of the format, what is lost, and what is refused with its line and surface.

use std::sync::Arc;

use petzval_files::{Import, parse_optiland};
use petzval_optics::glass::{Catalog, Glass};
use petzval_optics::lens::{Action, Lens, ObjectDistance};
use petzval_optics::paraxial::{first_order, paraxial_ray};

fn catalog() -> Catalog {
    let mut catalog = Catalog::default();
    for file in ["schott", "hikari"] {
        let path = format!("{}/../petzval-data/data/glasses/{file}.toml", env!("CARGO_MANIFEST_DIR"));
        catalog.merge(petzval_files::parse_catalog(&std::fs::read_to_string(path).unwrap()).unwrap());
    }
    catalog
}

fn read(text: &str) -> Import {
    parse_optiland(text, &catalog()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn efl_mm(lens: &Lens) -> f64 {
    first_order(&lens.at_wavelength(lens.reference_um)).efl_mm
}

fn losses(import: &Import) -> Vec<String> {
    import.losses.iter().map(ToString::to_string).collect()
}

const AIR: &str = r#"{"type": "IdealMaterial", "index": 1.0, "absorp": 0.0}"#;

/// A glass as the program writes it on Windows.
fn glass(maker: &str, name: &str) -> String {
    format!(
        r#"{{"type": "Material", "filename": "C:\\optiland\\database\\data-nk\\glass\\{maker}\\{name}.yml", "name": "{name}",
          "reference": null, "robust_search": true, "min_wavelength": null, "max_wavelength": null}}"#
    )
}

fn cs(z: &str) -> String {
    format!(r#"{{"x": 0.0, "y": 0.0, "z": {z}, "rx": 0.0, "ry": 0.0, "rz": 0.0, "reference_cs": null}}"#)
}

fn conic(z: f64, radius: &str, conic: f64) -> String {
    format!(
        r#"{{"type": "StandardGeometry", "cs": {}, "radius": {radius}, "conic": {conic}}}"#,
        cs(&z.to_string())
    )
}

fn plane(z: &str) -> String {
    format!(r#"{{"type": "Plane", "cs": {}, "radius": Infinity}}"#, cs(z))
}

/// A surface in the older layout.
fn surface(geometry: &str, medium: &str, is_stop: bool) -> String {
    format!(
        r#"{{"type": "Surface", "geometry": {geometry}, "material_pre": {AIR}, "material_post": {medium},
          "is_stop": {is_stop}, "aperture": null, "coating": null, "bsdf": null, "is_reflective": false}}"#
    )
}

/// A file; every surface begins on a line of its own.
fn file(aperture: (&str, f64), fields: (&str, &[f64]), object_z: &str, surfaces: &[String]) -> String {
    let field = |y: &f64| {
        let kind = fields.0;
        format!(r#"{{"field_type": "{kind}", "x": 0.0, "y": {y}, "vx": 0.0, "vy": 0.0}}"#)
    };
    let listed: Vec<String> = fields.1.iter().map(field).collect();
    format!(
        r#"{{
"version": 1.0,
"aperture": {{"type": "{}", "value": {}, "object_space_telecentric": false}},
"fields": {{"fields": [{}], "telecentric": false, "field_type": "{}", "object_space_telecentric": false}},
"wavelengths": {{"wavelengths": [{{"value": 486.1, "is_primary": false, "unit": "nm"}},
  {{"value": 0.5876, "is_primary": true, "unit": "um"}}, {{"value": 0.6563, "is_primary": false, "unit": "um"}}], "polarization": "ignore"}},
"pickups": [],
"solves": {{"solves": []}},
"surface_group": {{"surfaces": [
{{"type": "ObjectSurface", "geometry": {}, "material_post": {AIR}}},
{}
]}}
}}"#,
        aperture.0,
        aperture.1,
        listed.join(", "),
        fields.0,
        plane(object_z),
        surfaces.join(",\n")
    )
}

/// A biconvex singlet of N-BK7, 50 mm and -80 mm, 4 mm thick.
fn singlet() -> String {
    let surfaces = [
        surface(&conic(0.0, "50", 0.0), &glass("schott", "N-BK7"), true),
        surface(&conic(4.0, "-80", 0.0), AIR, false),
        surface(&plane("62"), AIR, false),
    ];
    file(("EPD", 10.0), ("angle", &[0.0, 5.0]), "-Infinity", &surfaces)
}

fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from:?} is not there");
    text.replacen(from, to, 1)
}

#[test]
fn a_singlet_has_the_focal_length_of_the_lensmaker() {
    let import = read(&singlet());
    assert_eq!(losses(&import), [""; 0]);
    let lens = import.file.lens;
    let n = lens.surfaces[0].glass.index(0.5876);
    assert!((n - 1.5168).abs() < 1e-4 && lens.surfaces[0].glass.name == "N-BK7");
    let power = (n - 1.0) * (1.0 / 50.0 + 1.0 / 80.0 - (n - 1.0) * 4.0 / (n * 50.0 * 80.0));
    assert!((efl_mm(&lens) * power - 1.0).abs() < 1e-12, "{}", efl_mm(&lens));
    assert_eq!((lens.stop, lens.entrance_pupil_mm, lens.object), (0, 10.0, ObjectDistance::Infinity));
    assert_eq!((&lens.fields_deg[..], lens.reference_um), (&[0.0, 5.0][..], 0.5876));
    assert_eq!(lens.wavelengths_um, [0.4861, 0.5876, 0.6563]);
    assert_eq!(lens.surfaces.iter().map(|s| s.thickness_mm).collect::<Vec<_>>(), [4.0, 58.0]);
}

/// A catalogue achromat of 100 mm (62.75, -45.71, -128.23 mm; N-BK7, SF5).
#[test]
fn a_doublet_of_catalogue_glass_has_the_focal_length_of_the_catalogue() {
    let doublet = |aperture: (&str, f64)| {
        let surfaces = [
            surface(&conic(0.0, "62.75", 0.0), &glass("schott", "N-BK7"), true),
            surface(&conic(4.0, "-45.71", 0.0), &glass("schott", "SF5"), false),
            surface(&conic(6.5, "-128.23", 0.0), AIR, false),
            surface(&plane("103.58"), AIR, false),
        ];
        read(&file(aperture, ("angle", &[0.0]), "-Infinity", &surfaces)).file.lens
    };
    let lens = doublet(("imageFNO", 4.0));
    let names: Vec<&str> = lens.surfaces.iter().map(|s| s.glass.name.as_str()).collect();
    assert_eq!(names, ["N-BK7", "SF5", "AIR"]);
    assert!((efl_mm(&lens) - 100.1).abs() < 0.1, "{}", efl_mm(&lens));
    // The image-space f-number is the focal length over the pupil, and the stop is the pupil.
    assert!((lens.entrance_pupil_mm - efl_mm(&lens) / 4.0).abs() < 1e-12);
    assert!((doublet(("float_by_stop_size", 20.0)).entrance_pupil_mm - 20.0).abs() < 1e-12);
}

#[test]
fn coefficients_of_aspheres_begin_at_the_square_or_at_the_first_power() {
    let of = |kind: &str, coefficients: &str| {
        let geometry = format!(
            r#"{{"type": "{kind}", "cs": {}, "radius": 40.0, "conic": -0.7, "tol": 1e-10, "max_iter": 100, "coefficients": {coefficients}}}"#,
            cs("0")
        );
        let surfaces = [
            surface(&geometry, r#"{"type": "IdealMaterial", "index": 1.5}"#, true),
            surface(&plane("3"), AIR, false),
            surface(&plane("70"), AIR, false),
        ];
        let import = read(&file(("EPD", 8.0), ("angle", &[0.0]), "-Infinity", &surfaces));
        assert_eq!(losses(&import), [""; 0]);
        import.file.lens
    };
    let base = |r: f64| r * r / (40.0 * (1.0 + (1.0 - 0.3 * r * r / 1600.0).sqrt()));
    let even = of("EvenAsphere", "[1e-4, -2e-6, 3e-9]");
    let odd = of("OddAsphere", "[0, 0, -1e-5, 0, 1e-7]");
    for r in [0.5, 2.0, 4.0] {
        let wanted = base(r) + 1e-4 * r * r - 2e-6 * r.powi(4) + 3e-9 * r.powi(6);
        assert!((even.surfaces[0].shape.sag_mm(r).unwrap() - wanted).abs() < 1e-15, "{r}");
        let wanted = base(r) - 1e-5 * r.powi(3) + 1e-7 * r.powi(5);
        assert!((odd.surfaces[0].shape.sag_mm(r).unwrap() - wanted).abs() < 1e-15, "{r}");
    }
    // The term of r^2 adds 2e-4 to the curvature on the axis: a plano-convex lens has 1 / f = (n - 1) c.
    assert!((efl_mm(&even) * 0.5 * (1.0 / 40.0 + 2e-4) - 1.0).abs() < 1e-12);
}

#[test]
fn a_thin_lens_images_a_near_object() {
    let thin = |rest: &str| {
        format!(
            r#"{{"geometry": {}, "material_pre": {AIR}, "material_post": {AIR}, "is_stop": true, "aperture": null, {rest}}}"#,
            plane("0.0")
        )
    };
    let older = r#""type": "ParaxialSurface", "focal_length": 50.0, "coating": null, "bsdf": null, "is_reflective": false"#;
    let newer = r#""type": "Surface", "thickness": 100.0, "comment": "", "interaction_model":
        {"type": "ThinLensInteractionModel", "is_reflective": false, "coating": null, "bsdf": null, "focal_length": 50.0}"#;
    let lens = |rest: &str| {
        let surfaces = [thin(rest), surface(&plane("100"), AIR, false)];
        read(&file(("objectNA", 0.1), ("object_height", &[0.0, 10.0]), "-100.0", &surfaces)).file.lens
    };
    let found = lens(older);
    assert_eq!(found, lens(newer));
    assert_eq!(found.object, ObjectDistance::Finite(100.0));
    assert!(matches!(found.surfaces[0].action, Action::ThinLens { power_per_mm } if power_per_mm == 0.02));
    assert!((found.entrance_pupil_mm - 200.0 * 0.1_f64.asin().tan()).abs() < 1e-12);
    assert!((found.fields_deg[1] - 0.1_f64.atan().to_degrees()).abs() < 1e-12, "{:?}", found.fields_deg);
    // At twice the focal length the ray of slope 1 from the axial point comes back with slope -1: magnification -1.
    let ray = paraxial_ray(&found.at_wavelength(0.5876), 100.0, 1.0);
    assert!((ray.w[1] + 1.0).abs() < 1e-12);
}

#[test]
fn older_and_newer_layouts_are_the_same_lens() {
    let newer = |geometry: &str, medium: &str, is_stop: bool| {
        format!(
            r#"{{"type": "Surface", "thickness": 0.0, "geometry": {geometry}, "material_post": {medium}, "is_stop": {is_stop},
              "aperture": {{"type": "RadialAperture", "r_max": 7.0, "r_min": 0}}, "comment": "front",
              "interaction_model": {{"type": "RefractiveReflectiveModel", "is_reflective": false, "coating": null, "bsdf": null}}}}"#
        )
    };
    let by_reference = r#"{"type": "Material", "name": "N-BK7", "reference": "SCHOTT"}"#;
    let surfaces = [
        newer(&conic(0.0, "50", 0.0), by_reference, true),
        newer(&conic(4.0, "-80", 0.0), AIR, false),
        surface(&plane("62"), AIR, false),
    ];
    let text = file(("EPD", 10.0), ("angle", &[0.0, 5.0]), "-Infinity", &surfaces);
    let text = changed(
        &text,
        r#""field_type": "angle", "object"#,
        r#""field_definition": {"field_type": "AngleField"}, "object"#,
    );
    let text = changed(
        &text,
        r#""version": 1.0,"#,
        r#""version": 1.0, "name": "My lens", "apodization": {"type": "UniformApodization"},"#,
    );
    let (found, wanted) = (read(&text), read(&singlet()));
    assert_eq!(losses(&found), [""; 0]);
    let (found, wanted) = (found.file.lens, wanted.file.lens);
    assert_eq!((found.name.as_str(), found.surfaces[0].label.as_str()), ("My lens", "front"));
    assert_eq!(found.surfaces[0].semi_diameter_mm, 7.0);
    assert_eq!((found.entrance_pupil_mm, &found.fields_deg), (wanted.entrance_pupil_mm, &wanted.fields_deg));
    for (a, b) in found.surfaces.iter().zip(&wanted.surfaces) {
        assert_eq!((a.shape, &a.glass, a.thickness_mm), (b.shape, &b.glass, b.thickness_mm));
    }
}

/// Fields have weights, as they have in files of other programs; without a weight a field counts 1.
#[test]
fn fields_have_weights() {
    let weighted = |field: &str, weight: &str| {
        let text = changed(&singlet(), field, &format!("{field}, \"weight\": {weight}"));
        read(&changed(&text, r#""pickups": []"#, r#""ray_tracer": {"ray_aiming_config": {}}, "pickups": []"#))
    };
    let import = weighted(r#""y": 5"#, "0.25");
    assert_eq!((&import.file.field_weights[..], losses(&import)), (&[1.0, 0.25][..], vec![]));
    assert!(weighted(r#""y": 5"#, "1.0").file.field_weights.is_empty());
    let import = weighted(r#""y": 5"#, "-1");
    assert!(
        losses(&import)[0].starts_with("line 4: `weight`: weights of fields below 0"),
        "{:?}",
        losses(&import)
    );
    assert!(import.file.field_weights.is_empty());
}

#[test]
fn what_is_lost_is_named_with_its_line() {
    let text = singlet();
    for (from, to, wanted) in [
        (
            r#""coating": null"#,
            r#""coating": {"type": "FresnelCoating"}"#,
            "line 13: `surface 1`: coatings are not read",
        ),
        (
            r#""aperture": null"#,
            r#""aperture": {"type": "RectangularAperture", "x_min": -1}"#,
            "line 13: `surface 1`: the aperture is not round about the vertex, and is not kept: light passes there",
        ),
        (
            r#""pickups": []"#,
            r#""pickups": [{"type": "radius"}]"#,
            "line 7: `pickups`: pickups are not kept, but their values are",
        ),
        (
            r#""polarization": "ignore""#,
            r#""polarization": {"Ex": 1}"#,
            "line 6: `polarization`: polarisation is not traced",
        ),
        (
            r#""vx": 0.0"#,
            r#""vx": 0.1"#,
            "line 4: `vx, vy`: vignetting factors are not read: clear semi-diameters vignette the beam",
        ),
        (r#""vx": 0.0"#, r#""vx": 0.0, "vz": 1"#, "line 4: `vz`: this key is not understood"),
        (r#""radius": 50,"#, r#""radius": 50, "bumps": 3,"#, "line 11: `bumps`: this key is not understood"),
        // The planes of the object and of the image: surfaces 0 and 3.
        (
            r#""radius": Infinity"#,
            r#""radius": 30"#,
            "line 10: `surface 0`: a plane has no radius; the one of the file is not kept",
        ),
        (
            &format!(r#"{}, "radius": Infinity"#, cs("62")),
            &format!(r#"{}, "radius": -80.0"#, cs("62")),
            "line 16: `surface 3`: a plane has no radius; the one of the file is not kept",
        ),
        (
            &glass("schott", "N-BK7"),
            r#"{"type": "AbbeMaterial", "index": 1.5168, "abbe": 64.2}"#,
            "line 11: `surface 1`: the glass has the dispersion of its Abbe number by Cauchy's formula, not by the program's",
        ),
        (
            &glass("schott", "N-BK7"),
            r#"{"type": "Material", "name": "N-BK7", "reference": "vendor"}"#,
            "line 11: `N-BK7 in surface 1`: the glass is that of Schott, and the file names vendor",
        ),
    ] {
        let found = losses(&read(&changed(&text, from, to)));
        assert_eq!(found, [wanted], "{to}");
    }
}

#[test]
fn a_glass_that_was_left_out_has_no_stand_in_of_another_maker() {
    let mut catalog = catalog();
    let glass = catalog.get("SCHOTT:N-BK7").unwrap();
    catalog.refuse("N-BK7", "Schott", "its numbers contradict each other".to_owned());
    catalog.insert("N-BK7", Arc::new(Glass { maker: "Other".into(), ..(*glass).clone() }));
    let error = parse_optiland(&singlet(), &catalog).unwrap_err().to_string();
    assert!(error.contains("its numbers contradict each other") && error.contains("OTHER:N-BK7"), "{error}");
}

#[test]
fn what_cannot_be_traced_is_refused_with_line_and_surface() {
    let text = singlet();
    let bk7 = glass("schott", "N-BK7");
    for (from, to, wanted) in [
        (
            r#""is_reflective": false"#,
            r#""is_reflective": true"#,
            &["surface 1: mirrors are not read", ".zmx"][..],
        ),
        (
            r#""radius": 50"#,
            r#""radius": 0"#,
            &["line 11: `radius = 0`: surface 1: a radius of 0 is no surface"],
        ),
        (r#""radius": 50"#, r#""radius": "wide""#, &["line 11: `radius = wide`: expected a number"]),
        (r#""radius": 50"#, r#""radius": NaN"#, &["`radius = NaN`: expected a number"]),
        (r#""radius": 50, "#, "", &["line 11: `radius`: the key is missing"]),
        (
            r#""type": "StandardGeometry""#,
            r#""type": "BiconicGeometry""#,
            &["surface 1: geometries of the type BiconicGeometry", "EvenAsphere"],
        ),
        (
            r#""z": 4, "rx": 0.0"#,
            r#""z": 4, "rx": 0.02"#,
            &["line 14: `rx = 0.02`: surface 2: shifted and tilted", ".zmx"],
        ),
        (r#""z": 4"#, r#""z": Infinity"#, &["surface 2: only the object may be at minus infinity"]),
        (r#""bsdf": null"#, r#""bsdf": {"type": "LambertianBSDF"}"#, &["surface 1: scattering surfaces"]),
        (
            r#""type": "Surface""#,
            r#""type": "GratingSurface""#,
            &["`surface 1`: surfaces of the kind GratingSurface are not traced"],
        ),
        (
            &bk7,
            r#"{"type": "Material", "name": "XK99"}"#,
            &["`XK99 in surface 1`: no glass is called `XK99`", "the nearest names are"],
        ),
        (
            &bk7,
            r#"{"type": "GradientMaterial"}"#,
            &["surface 1: media of the type GradientMaterial are not traced"],
        ),
        (
            &bk7,
            r#"{"type": "IdealMaterial", "index": -1.0}"#,
            &["surface 1: an index from 1 to 10 is traced"],
        ),
        (r#""is_stop": true"#, r#""is_stop": false"#, &["no surface is the aperture stop", "is_stop"]),
        (r#""is_stop": false"#, r#""is_stop": true"#, &["`surface 2`: another surface is already the stop"]),
        (
            r#""type": "EPD""#,
            r#""type": "imageNA""#,
            &["line 3: `type = imageNA`: apertures of this type are not read", "imageFNO"],
        ),
        (r#""value": 10"#, r#""value": -10"#, &["line 3: `value = -10`: the aperture must be positive"]),
        (
            r#""telecentric": false"#,
            r#""telecentric": true"#,
            &["line 4: `telecentric = true`: chief rays that are parallel"],
        ),
        (
            r#""field_type": "angle", "object"#,
            r#""field_type": "sky", "object"#,
            &["line 4: `field_type = sky`", "object_height"],
        ),
        (r#""unit": "nm""#, r#""unit": "furlong""#, &["line 5: `unit = furlong`: no such unit", "nm, um"]),
        (
            r#""value": 486.1"#,
            r#""value": 486100"#,
            &["`value = 486100`: a wavelength of 486100 nm is not optical", "did you mean 486.1?"],
        ),
        (r#"{"type": "ObjectSurface""#, r#"{"type": "Surface""#, &["this is not a lens", "ObjectSurface"]),
        ("\"version\": 1.0,", "\"version\": 1.0]", &["this is not JSON"]),
        ("{\n\"version\"", "[\n\"version\"", &["a lens in JSON begins with a brace"]),
    ] {
        let changed = changed(&text, from, to);
        let error = parse_optiland(&changed, &catalog()).expect_err(to).to_string();
        for words in wanted {
            assert!(error.contains(words), "{to}: {words:?} is not in\n{error}");
        }
    }
}
