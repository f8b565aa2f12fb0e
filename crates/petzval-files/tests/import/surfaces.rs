//! Shapes and glasses of surfaces.

use std::sync::Arc;

use petzval_base::FileError;
use petzval_files::{Effect, Import, parse_seq, parse_zmx, write_seq, write_zmx};
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{Action, Departure, Pattern, Phase, xy_index};

use crate::common::nominal_triplet;
use crate::round_trip::{file, same_numbers};
use crate::support::{SEQ, ZMX, catalog, changed, losses, seq, zmx};

#[test]
fn shapes_of_every_type() {
    let shape = |records: &str| {
        let text =
            changed(ZMX, "  TYPE STANDARD\n  CURV 0.02 0 0 0 0 \"\"\n", &format!("{records}\n  CURV 0.02\n"));
        zmx(&text).file.lens.surfaces[0].clone()
    };
    let s = shape("  TYPE EVENASPH\n  CONI -0.5\n  PARM 1 1e-5\n  PARM 8 1e-20").shape;
    assert_eq!((s.conic, s.asphere[0], s.asphere[7], s.departure), (-0.5, 1e-5, 1e-20, Departure::None));
    let s = shape("  TYPE ODDASPHE\n  PARM 2 1e-5\n  PARM 3 2e-6\n  PARM 8 1e-12").shape;
    assert_eq!((s.asphere[0], s.asphere[3]), (1e-5, 1e-12));
    assert!(matches!(s.departure, Departure::Odd(b) if b[1] == 2e-6));
    let s = shape("  TYPE XASPHERE\n  XDAT 1 3 0 0\n  XDAT 2 2 0 0\n  XDAT 4 1.6e-4\n  XDAT 6 1").shape;
    // Terms beyond the stated number are ignored.
    assert_eq!((s.asphere[1], s.asphere[3]), (1e-5, 0.0));
    let s = shape("  TYPE XOSPHERE\n  XDAT 1 9\n  XDAT 2 1\n  XDAT 11 1e-13").shape;
    assert!(matches!(s.departure, Departure::Odd(b) if b[4] == 1e-13));
    let s = shape("  TYPE XPOLYNOM\n  XDAT 1 12\n  XDAT 2 5\n  XDAT 3 0\n  XDAT 14 1e-3").shape;
    let Departure::Xy { norm_radius_mm: 5.0, coefficients } = s.departure else { panic!("{s:?}") };
    // The manual's example: extra value 14 is the twelfth term, x^2 y^2.
    assert_eq!(coefficients[xy_index(2, 2)], 1e-3);
    let s = shape("  TYPE BICONICX\n  PARM 1 40\n  PARM 2 0.3").shape;
    assert_eq!(s.departure, Departure::Biconic { curvature_x: 0.025, conic_x: 0.3 });
    let s = shape("  TYPE TOROIDAL\n  PARM 1 0\n  PARM 3 1e-6").shape;
    assert_eq!((s.departure, s.asphere[1]), (Departure::Toroid { curvature_x: 0.0 }, 1e-6));
    let s = shape("  TYPE DGRATING\n  PARM 1 0.0407\n  PARM 2 -1");
    assert_eq!(s.phase, Some(Phase { order: -1, pattern: Pattern::Grating { lines_per_mm: 40.7 } }));
    let s = shape(
        "  TYPE BINARY_2\n  PARM 0 2\n  PARM 2 1e-6\n  XDAT 1 2\n  XDAT 2 5\n  XDAT 3 -60\n  XDAT 4 1.5",
    );
    let Some(Phase { order: 2, pattern: Pattern::Binary { norm_radius_mm: 5.0, coefficients_rad } }) =
        s.phase
    else {
        panic!("{s:?}")
    };
    assert_eq!((coefficients_rad[0], coefficients_rad[1], s.shape.asphere[1]), (-60.0, 1.5, 1e-6));
    let thin =
        changed(ZMX, "  TYPE STANDARD\n  CURV 0.02 0 0 0 0 \"\"", "  TYPE PARAXIAL\n  PARM 1 50\n  PARM 2 1");
    let thin = changed(&thin, "  GLAS N-BK7 0 0 1.5168 64.17\n", "");
    assert_eq!(zmx(&thin).file.lens.surfaces[0].action, Action::ThinLens { power_per_mm: 0.02 });

    let shape = |commands: &str| {
        seq(&changed(SEQ, "  CIR 6", &format!("  CIR 6\n{commands}"))).file.lens.surfaces[0].shape
    };
    let s = shape("ASP\nK -0.5; A 1e-6; G 1e-20; H 0; J 0\nCUF 0.0");
    assert_eq!((s.conic, s.asphere[1], s.asphere[7]), (-0.5, 1e-6, 1e-20));
    let s = shape("SPS ODD 0.0\n SCO K -0.5; SCO AR3 1e-5; SCO C3 1e-6");
    assert_eq!((s.conic, s.asphere[0]), (-0.5, 1e-6));
    assert!(matches!(s.departure, Departure::Odd(b) if b[1] == 1e-5));
    let s = shape("SPS XYP 5\n SCO NRADIUS 5.0; SCO C8 2e-3");
    assert!(
        matches!(s.departure, Departure::Xy { norm_radius_mm: 5.0, coefficients } if coefficients[xy_index(2, 1)] == 2e-3)
    );
    let s = shape("YTO\nRDX 40; K 0.1; A 1e-6");
    assert_eq!((s.departure, s.conic, s.asphere[1]), (Departure::Toroid { curvature_x: 0.025 }, 0.1, 1e-6));
    assert_eq!(shape("CYL").departure, Departure::Toroid { curvature_x: 0.0 });
    let s = shape("AAS\nRDX 40; KX 0.3; KY -0.2; AR 1e-6; AP 0");
    assert_eq!(s.departure, Departure::Biconic { curvature_x: 0.025, conic_x: 0.3 });
    assert_eq!((s.conic, s.asphere[1]), (-0.2, 1e-6));
}

#[test]
fn glasses_by_name_code_formula_and_table() {
    let glass = |name: &str| seq(&changed(SEQ, "NBK7_SCHOTT", name)).file.lens.surfaces[0].glass.clone();
    assert_eq!(glass("nbk7").name, "N-BK7");
    assert_eq!(glass("1.5168:64.17").dispersion, Dispersion::NdVd { nd: 1.5168, vd: 64.17 });
    assert_eq!(glass("517642").dispersion, Dispersion::NdVd { nd: 1.517, vd: 64.2 });
    assert_eq!(glass("516800.6417").dispersion, Dispersion::NdVd { nd: 1.5168, vd: 64.17 });
    // Index and Abbe number alone leave the dispersion open, which is said.
    let said = |name: &str| losses(&seq(&changed(SEQ, "NBK7_SCHOTT", name))).join("; ");
    assert!(said("517642").contains("by Cauchy's formula") && said("nbk7").is_empty(), "{}", said("517642"));
    let private = "PRV\n PWL 656.3 486.1\n 'GLUE' LAU 2.36390625 0.0 0.025493134 -0.000580235 -0.349933e-5 0.445404e-7\n \
                   'TAB' 1.5 1.51\n 'FLAT' 1.5 1.5\n 'ODD' HAR 1 2 3\nEND\nSO";
    let glass = |name: &str| {
        let text = changed(&changed(SEQ, "NBK7_SCHOTT", name), "SO", private);
        parse_seq(&text, &catalog()).map(|i| i.file.lens.surfaces[0].glass.clone())
    };
    assert!((glass("'GLUE'").unwrap().nd() - 1.56).abs() < 1e-3);
    let table = Dispersion::Table { wavelength_um: vec![0.4861, 0.6563], index: vec![1.51, 1.5] };
    assert_eq!(glass("tab").unwrap().dispersion, table);
    // How the index is read between and beyond the stated ones is said.
    let private_said =
        |name: &str| losses(&seq(&changed(&changed(SEQ, "NBK7_SCHOTT", name), "SO", private))).join("; ");
    assert!(
        private_said("tab").contains("glass TAB is linear between its 2 wavelengths"),
        "{}",
        private_said("tab")
    );
    assert_eq!(private_said("'GLUE'"), "");
    assert_eq!(glass("FLAT").unwrap().dispersion, Dispersion::Constant(1.5));
    // An unknown formula is an error only if its glass is used.
    let error = glass("ODD").unwrap_err().to_string();
    assert!(error.contains("line 12: `'ODD' HAR 1 2 3`: private glasses by the formula HAR"), "{error}");

    let model = zmx(&changed(ZMX, "GLAS N-BK7 0 0 1.5168 64.17", "GLAS ___BLANK 1 0 1.6 50 0 0"));
    assert_eq!(model.file.lens.surfaces[0].glass.dispersion, Dispersion::NdVd { nd: 1.6, vd: 50.0 });
    assert_eq!(model.losses[0].effect, Effect::Approximated);
    let other = zmx(&changed(ZMX, "ENPD", "GCAT OHARA\nENPD"));
    assert!(
        losses(&other)[0].contains("that of Schott, which the file's GCAT does not name"),
        "{:?}",
        losses(&other)
    );
    assert!(zmx(&changed(ZMX, "ENPD", "GCAT OHARA SCHOTT\nENPD")).losses.is_empty());
}

/// Names with another meaning in a file, or that would break its lines, are changed with a message.
#[test]
fn glasses_with_impossible_names_are_renamed_and_read_again() {
    let catalog = catalog();
    for name in ["MIRROR", "AIR", "REFL", "END", "PWL", "___BLANK", "a\nSURF 9", "a\u{1}b", "it's", "x y"] {
        let mut lens = nominal_triplet();
        lens.surfaces[0].glass = Arc::new(Glass::new(name, Dispersion::Constant(1.61)));
        for (export, parse) in [
            (write_zmx(&file(lens.clone()), &catalog).unwrap(), parse_zmx as fn(&str, &Catalog) -> _),
            (write_seq(&file(lens.clone()), &catalog).unwrap(), parse_seq),
        ] {
            let read: Result<Import, FileError> = parse(&export.text, &catalog);
            let read = read.unwrap_or_else(|e| panic!("{name:?}: {e}\n{}", export.text)).file.lens;
            assert_eq!(read.surfaces[0].glass.dispersion, Dispersion::Constant(1.61), "{name:?}");
            let is_reported = export.losses.iter().any(|l| l.message.contains("is called"));
            assert!(is_reported || read.surfaces[0].glass.name == name, "{name:?} {:?}", export.losses);
            same_numbers(&lens, &read);
        }
    }
    // A catalogue glass without a maker is named.
    let own = petzval_files::parse_catalog(
        "[glass.own-1]\nsellmeier = { b = [1.0, 0.2], c_um2 = [0.006, 0.02] }\n",
    )
    .unwrap();
    let mut lens = nominal_triplet();
    let glass = own.get("own-1").unwrap();
    for surface in &mut lens.surfaces {
        if !surface.glass.is_air() {
            surface.glass = glass.clone();
        }
    }
    let export = write_seq(&file(lens), &own).unwrap();
    assert_eq!(parse_seq(&export.text, &own).unwrap().file.lens.surfaces[0].glass, glass);
}
