//! Clear semi-diameters: left out, stated, and open.

use petzval_files::{
    Import, parse_lens, parse_lens_start, parse_seq, parse_zmx, write_lens, write_seq, write_zmx,
};
use petzval_optics::glass::Catalog;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::paraxial_launch;
use petzval_optics::trace::{launch, trace_ray};

use crate::support::{PLATE, catalog};

#[test]
fn semi_diameters_that_a_file_leaves_out_follow_from_the_fields() {
    let import = parse_lens_start(PLATE, &catalog()).unwrap();
    let semi = |i: usize| import.file.lens.surfaces[i].semi_diameter_mm;
    assert_eq!(semi(0), 5.0);
    // The upper edge of the oblique beam, with 1 % of room and the soft edge.
    let edge = 5.0 + 20.0 * 20.0_f64.to_radians().tan();
    assert!((1.01 * edge..1.03 * edge).contains(&semi(1)), "{} for {edge}", semi(1));
    // What is stated stays.
    assert_eq!(semi(2), 9.0);
    let wider = parse_lens(&PLATE.replace("20.0]", "30.0]"), &catalog()).unwrap().lens;
    assert!(wider.surfaces[1].semi_diameter_mm > 5.0 + 20.0 * 30.0_f64.to_radians().tan());
    // Once written, they are as large, and still cut nothing. The stop cuts in any case.
    let written = parse_lens_start(&write_lens(&import.file), &Catalog::default()).unwrap();
    assert!(written.file.lens == import.file.lens);
}

/// The outermost beam meets the first surface of the plate at 12.28 mm.
#[test]
fn open_surfaces_keep_a_stated_size_that_holds_the_beams() {
    let stated = |mm: &str| {
        let plate = format!("glass = \"N-BK7\"\nsemi_diameter_mm = {mm}\nopen = true\n");
        let import = parse_lens_start(&PLATE.replace("glass = \"N-BK7\"\n", &plate), &catalog()).unwrap();
        assert!(import.losses.is_empty(), "{:?}", import.losses);
        import.file.lens.surfaces[1].semi_diameter_mm
    };
    assert_eq!([stated("12.3"), stated("15.0")], [12.3, 15.0]);
    // One that does not hold them gives way to the beams and their room.
    let [small, large] = [stated("12.0"), stated("0.1")];
    assert!(small == large && (12.4..12.7).contains(&small), "{small} {large}");
}

/// A lens on the limit of its edges: its beams reach 9.9 mm and its spheres meet at 9.95 mm, so that the stated size fits between, and the usual
/// room around the beams does not.
#[test]
fn a_lens_on_the_limit_of_its_edges_keeps_its_stated_sizes() {
    let text = "name = \"edge\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 19.8\n[wavelengths]\num = [0.5876]\n\
                [fields]\nangle_deg = [0.0]\n[[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = 1.0\n\
                [[surface]]\nradius_mm = 50.0\nthickness_mm = 2.0\nglass = \"N-BK7\"\nsemi_diameter_mm = 9.93\nopen = true\n\
                [[surface]]\nradius_mm = -50.0\nthickness_mm = 48.0\nsemi_diameter_mm = 9.93\nopen = true\n";
    let semis = |import: &Import| [1, 2].map(|i: usize| import.file.lens.surfaces[i].semi_diameter_mm);
    let import = parse_lens_start(text, &catalog()).unwrap();
    assert_eq!(semis(&import), [9.93; 2]);
    assert!(import.losses.is_empty(), "{:?}", import.losses);
    // Surfaces that cross within their stated size are made smaller, with a message.
    let import = parse_lens_start(&text.replace("9.93", "9.97"), &catalog()).unwrap();
    assert!(semis(&import).iter().all(|mm| (9.89..9.91).contains(mm)), "{:?}", semis(&import));
    assert!(import.losses[0].message.contains("surfaces end or cross"), "{:?}", import.losses);
}

/// Light of fields that the file does not name passes surfaces without an edge; a stated edge of the same size cuts it.
#[test]
fn surfaces_without_an_edge_cut_no_light() {
    let import = parse_lens_start(PLATE, &catalog()).unwrap();
    let open = &import.file.lens;
    assert_eq!(open.surfaces.iter().map(|s| s.is_open).collect::<Vec<_>>(), [false, true, false]);
    let mut stated = open.clone();
    stated.surfaces[1].is_open = false;
    // The last surface has an edge of its own, which the oblique beams do not pass.
    let passes = |lens: &Lens, field_deg: f64| {
        let mut lens = lens.clone();
        lens.surfaces[2].is_open = true;
        let sequence = lens.at_wavelength(lens.reference_um);
        let at = paraxial_launch(&first_order(&sequence), &sequence, field_deg.to_radians(), [0.0, 0.99]);
        trace_ray(&sequence, launch(&sequence, field_deg.to_radians(), at).ray).transmission
    };
    assert_eq!([passes(open, 20.0), passes(&stated, 20.0)], [1.0; 2]);
    assert_eq!([passes(open, 24.0), passes(&stated, 24.0)], [1.0, 0.0]);
    let catalog = catalog();
    for read in [
        parse_zmx(&write_zmx(&import.file, &catalog).unwrap().text, &catalog).unwrap(),
        parse_seq(&write_seq(&import.file, &catalog).unwrap().text, &catalog).unwrap(),
    ] {
        assert_eq!(
            read.file.lens.surfaces.iter().map(|s| s.is_open).collect::<Vec<_>>(),
            [false, true, false]
        );
    }
}
