//! Every built-in lens has the published properties that its file lists.

use std::fs;
use std::path::{Path, PathBuf};

use petzval_files::{Expected, parse_lens};
use petzval_optics::glass::Catalog;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::{Quadrature, chief_ray, field_imaged_at};
use petzval_optics::solve::{with_best_focus, with_efl, with_paraxial_focus};
use petzval_optics::spot::{mean_square_spot_traced, spot, spot_paraxial_pupil};

fn files(folder: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data").join(folder);
    let mut files: Vec<PathBuf> = fs::read_dir(root)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    files
}

#[test]
fn first_order_and_spots_are_as_published() {
    let mut catalog = Catalog::default();
    for path in files("glasses") {
        catalog.merge(petzval_files::parse_catalog(&fs::read_to_string(path).unwrap()).unwrap());
    }
    let quadrature = Quadrature::grid(64).unwrap();
    let (mut lenses, mut spots) = (0, 0);
    for path in files("lenses") {
        let file = parse_lens(&fs::read_to_string(&path).unwrap(), &catalog).unwrap();
        let (name, lens) = (path.display(), &file.lens);
        let expect = file.expect.as_ref().unwrap_or_else(|| panic!("{name}: no [expect]"));
        let order = first_order(&lens.at_wavelength(lens.reference_um));
        let track = lens.total_track_mm() - lens.image_distance_mm() + order.image_distance_mm;
        let check = |what: &str, wanted: Option<Expected>, found: f64| {
            if let Some(wanted) = wanted {
                assert!(wanted.agrees(found), "{name}: {what} {found}, expected {wanted:?}");
            }
        };
        assert!(expect.efl_mm.is_some() && expect.bfl_mm.is_some(), "{name}");
        check("EFL", expect.efl_mm, order.efl_mm);
        check("BFL", expect.bfl_mm, order.bfl_mm);
        check("f-number", expect.f_number, order.f_number);
        check("track", expect.total_track_mm, track);
        lenses += 1;
        if let Some(wanted) = &expect.rms_spot_um {
            for (field, um) in lens.fields_deg.iter().zip(&wanted.values_um) {
                let found = spot_paraxial_pupil(lens, field.to_radians(), &quadrature).unwrap().rms_poly_um;
                let off = (found - um).abs() / um;
                assert!(off <= wanted.relative_tolerance, "{name}: {field} deg: {found} for {um} um");
                spots += 1;
            }
        }
        // Light through the real stop arrives at every field that the file lists.
        for field in &lens.fields_deg {
            assert!(spot(lens, field.to_radians(), &quadrature).is_some(), "{name}: {field} deg");
        }
    }
    assert!(lenses >= 8 && spots >= 4, "{lenses} lenses, {spots} spots");
}

#[test]
fn solves_reach_their_targets() {
    let mut catalog = Catalog::default();
    for path in files("glasses") {
        catalog.merge(petzval_files::parse_catalog(&fs::read_to_string(path).unwrap()).unwrap());
    }
    let path = files("lenses").into_iter().find(|p| p.ends_with("cooke-triplet-nominal.toml")).unwrap();
    let lens = parse_lens(&fs::read_to_string(path).unwrap(), &catalog).unwrap().lens;
    let order = |lens: &Lens| first_order(&lens.at_wavelength(lens.reference_um));

    // The last radius, and one in the middle, bring the focal length to 27 mm.
    for surface in [6, 2] {
        let solved = with_efl(&lens, surface, 27.0).unwrap();
        assert!((order(&solved).efl_mm - 27.0).abs() < 1e-10, "surface {surface}");
    }
    // The stop has no power, whatever its curvature.
    assert!(with_efl(&lens, 4, 27.0).is_none());

    let focused = with_paraxial_focus(&lens, 0.25);
    assert!((focused.image_distance_mm() - order(&lens).bfl_mm - 0.25).abs() < 1e-12);

    // The field that lands at 6 mm does land there, and is larger than the ideal one: barrel distortion.
    let sequence = lens.at_wavelength(lens.reference_um);
    let ideal = (6.0 / order(&lens).efl_mm).atan();
    let field = field_imaged_at(&sequence, 6.0, ideal).unwrap();
    assert!((chief_ray(&sequence, field).unwrap().y_mm - 6.0).abs() < 1e-9);
    assert!(field > 1.02 * ideal && field < 1.1 * ideal, "{field} for {ideal}");

    // Best focus does not depend on the start, and the spot is larger on either side.
    let quadrature = Quadrature::grid(24).unwrap();
    let fields: Vec<f64> = lens.fields_deg.iter().map(|f| f.to_radians()).collect();
    let best = with_best_focus(&lens, &fields, &quadrature).unwrap();
    let far = with_best_focus(&lens.with_image_distance(26.0), &fields, &quadrature).unwrap();
    let at = best.image_distance_mm();
    assert!((at - far.image_distance_mm()).abs() < 1e-9);
    let value =
        |d: f64| mean_square_spot_traced(&lens.with_image_distance(d), &fields, &quadrature).unwrap().0;
    assert!(value(at) < value(at + 1e-3) && value(at) < value(at - 1e-3));
}
