//! Errors of bad files name line, key, value and hint; impossible lenses are refused.

use std::sync::Arc;

use petzval_base::FileError;
use petzval_files::parse_lens;
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{Axis, LensDefect, Placement, SurfaceShape, validate};
use petzval_optics::paraxial::first_order;

use crate::support::{catalog, nominal, odd_number};

/// A bad file: a replacement in the nominal triplet, and the expected error.
struct Bad {
    from: &'static str,
    to: &'static str,
    /// Text on the line that the error must name.
    line_with: &'static str,
    key: &'static str,
    value: &'static str,
    message: &'static str,
    hint: &'static str,
}

#[rustfmt::skip]
const BAD: &[Bad] = &[
    Bad { from: "radius_mm = 11.45", to: "radius_mm = 0", line_with: "radius_mm = 0", key: "radius_mm", value: "0",
          message: "surface 2: a surface cannot have the radius 0", hint: "`radius_mm = inf`" },
    Bad { from: "radius_mm = 11.45", to: "radius_mm = nan", line_with: "radius_mm = nan", key: "radius_mm", value: "nan",
          message: "not a number", hint: "" },
    Bad { from: "radius_mm = 11.45", to: "radius_um = 11450 # long", line_with: "radius_um", key: "radius_um", value: "11450",
          message: "no such key", hint: "convert from um to mm and write `radius_mm`" },
    Bad { from: "thickness_mm = 8.11", to: "thickness_cm = 0.811", line_with: "thickness_cm", key: "thickness_cm", value: "0.811",
          message: "no such key", hint: "`thickness_mm`" },
    Bad { from: "thickness_mm = 8.11", to: "thicknes_mm = 8.11", line_with: "thicknes_mm", key: "thicknes_mm", value: "8.11",
          message: "no such key", hint: "did you mean `thickness_mm`?" },
    Bad { from: "thickness_mm = 8.11\n", to: "", line_with: "[[surface]]\nlabel = \"V1 rear\"", key: "thickness_mm", value: "",
          message: "the key `thickness_mm` is missing", hint: "" },
    Bad { from: "units = \"mm\"\n", to: "", line_with: "# The nominal Cooke triplet", key: "units", value: "",
          message: "the key `units` is missing", hint: "`units = \"mm\"`" },
    Bad { from: "glass = \"PMMA\"", to: "glass = { nd = 1.49, vd = 57.4 }", line_with: "glass = {", key: "glass", value: "{ nd = 1.49, vd = 57.4 }",
          message: "expected text in quotes", hint: "[glass.NAME]" },
    Bad { from: "thickness_mm = 8.11", to: "thickness_mm = \"thick\"", line_with: "\"thick\"", key: "thickness_mm", value: "\"thick\"",
          message: "expected a number", hint: "without a unit" },
    Bad { from: "thickness_mm = 4.014", to: "thickness_mm = -4.014", line_with: "-4.014", key: "thickness_mm", value: "-4.014",
          message: "surface 1: the thickness of -4.014 mm of PMMA goes against the light", hint: "it is at least 0" },
    Bad { from: "thickness_mm = 2.698", to: "thickness_mm = 0.3", line_with: "thickness_mm = 0.3", key: "thickness_mm", value: "0.3",
          message: "surface 6: the edge thickness of PMMA is -0.", hint: "semi-diameters" },
    Bad { from: "semi_diameter_mm = 4.56", to: "semi_diameter_mm = -4.56", line_with: "= -4.56", key: "semi_diameter_mm", value: "-4.56",
          message: "positive", hint: "" },
    Bad { from: "semi_diameter_mm = 6.415", to: "semi_diameter_mm = 11.5", line_with: "= 11.5", key: "semi_diameter_mm", value: "11.5",
          message: "surface 2: the shape ends 11.4500 mm from its vertex", hint: "flatten" },
    Bad { from: "glass = \"N-SF11\"", to: "glass = \"NSF11\"", line_with: "\"NSF11\"", key: "glass", value: "\"NSF11\"",
          message: "surface 3: no glass is called `NSF11`", hint: "N-SF11" },
    Bad { from: "stop = true\n", to: "", line_with: "[[surface]]", key: "stop", value: "",
          message: "no surface is the aperture stop", hint: "stop = true" },
    Bad { from: "label = \"V3 rear\"", to: "stop = true # V3 rear", line_with: "# V3 rear", key: "stop", value: "true",
          message: "surfaces 5 and 7", hint: "one stop" },
    Bad { from: "um = [0.486, 0.55, 0.62]", to: "um = [\n0.486,\n550,\n620]", line_with: "550", key: "um", value: "550",
          message: "a wavelength of 550 um", hint: "did you mean 0.55?" },
    Bad { from: "um = [0.486, 0.55, 0.62]", to: "um = [0.55, 0.486]", line_with: "0.486", key: "um", value: "0.486",
          message: "does not ascend", hint: "sort" },
    Bad { from: "angle_deg = [0.0, 5.0, 10.0, 15.0]", to: "angle_deg = []", line_with: "angle_deg", key: "angle_deg", value: "[]",
          message: "empty", hint: "" },
    Bad { from: "angle_deg = [0.0, 5.0, 10.0, 15.0]", to: "angle_deg = [-5]", line_with: "angle_deg", key: "angle_deg", value: "-5",
          message: "angle", hint: "mirror" },
    Bad { from: "units = \"mm\"", to: "units = \"inch\"", line_with: "units", key: "units", value: "\"inch\"",
          message: "in mm", hint: "convert to mm" },
    Bad { from: "distance_mm = inf", to: "distance_mm = 0", line_with: "distance_mm", key: "distance_mm", value: "0",
          message: "apart from the first vertex", hint: "" },
    Bad { from: "diameter_mm = 5.7", to: "diameter_mm = 0.0", line_with: "pupil_diameter", key: "entrance_pupil_diameter_mm", value: "0.0",
          message: "positive", hint: "" },
    Bad { from: "min = 9.85\nmax = 14.98", to: "min = 14.98\nmax = 9.85", line_with: "max = 9.85", key: "max", value: "9.85",
          message: "radius_mm of surface 1 are reversed", hint: "exchange" },
    Bad { from: "min = 9.85", to: "min = 12.0", line_with: "min = 12.0", key: "min", value: "12.0",
          message: "radius_mm of surface 1 is 11.34", hint: "widen" },
    Bad { from: "min = 9.85", to: "min = -9.85", line_with: "min = -9.85", key: "min", value: "-9.85",
          message: "include a radius of 0", hint: "" },
    Bad { from: "parameter = \"a10\"", to: "parameter = \"a9\"", line_with: "\"a9\"", key: "parameter", value: "\"a9\"",
          message: "no parameter `a9`", hint: "did you mean" },
    Bad { from: "surface = 7, efl_mm", to: "surface = 8, efl_mm", line_with: "efl = {", key: "surface", value: "8",
          message: "no surface 8", hint: "from 1 to 7" },
    Bad { from: "surface = 7, efl_mm", to: "surface = 6, efl_mm", line_with: "efl = {", key: "surface", value: "6",
          message: "a variable already", hint: "solved for or varied" },
    Bad { from: "values = [4.0,", to: "values = [", line_with: "rms_spot_um", key: "values", value: "[ 7.7, 16.4, 22.3]",
          message: "3 values do not fit the lens's 4 fields", hint: "one per field" },
    Bad { from: "efl_mm = { value = 25.04, tolerance = 0.005 }", to: "efl_mm = 25.04", line_with: "efl_mm = 25.04\n", key: "efl_mm", value: "25.04",
          message: "expected { value = ..., tolerance = ... }", hint: "" },
    Bad { from: "surface = 1\n", to: "surface = -1\n", line_with: "surface = -1", key: "surface", value: "-1",
          message: "expected a number from 0", hint: "a whole number" },
    Bad { from: "[aperture]", to: "[aperture", line_with: "[aperture", key: "", value: "",
          message: "", hint: "" },
    Bad { from: "[fields]", to: "[glass.MINE]\nnd = 1.5\n[fields]", line_with: "[glass.MINE]", key: "glass", value: "MINE",
          message: "no formula", hint: "`nd` and `vd`" },
    Bad { from: "[fields]", to: "[glass.MINE]\nnd = 1.5\nn = 1.6\n[fields]", line_with: "nd = 1.5", key: "nd", value: "1.5",
          message: "gives nd = 1.60000", hint: "mistyped" },
    Bad { from: "[fields]", to: "[glass.air]\nn = 1.6\n[fields]", line_with: "[glass.air]", key: "glass", value: "air",
          message: "already defined", hint: "AIR" },
];

#[test]
fn a_bad_file_names_line_key_value_and_hint() {
    let (good, catalog) = (nominal(), catalog());
    for bad in BAD {
        assert!(good.contains(bad.from), "the nominal triplet has no `{}`", bad.from);
        let text = good.replacen(bad.from, bad.to, 1);
        let error = parse_lens(&text, &catalog).map(|_| ()).expect_err(bad.to);
        let line = text[..text.find(bad.line_with).unwrap()].matches('\n').count() + 1;
        let place = format!("`{}` gave {error:?}", bad.to);
        assert_eq!(error.line, Some(line as u32), "{place}");
        assert!(error.column.is_some(), "{place}");
        assert_eq!((error.key.as_str(), error.value.as_str()), (bad.key, bad.value), "{place}");
        assert!(error.message.contains(bad.message), "{place}");
        assert!(error.hint.as_deref().unwrap_or("").contains(bad.hint), "{place}");
        assert!(error.to_string().starts_with(&format!("line {line}, column ")), "{place}");
    }
}

#[test]
fn an_error_prints_place_value_message_and_hint() {
    let text = nominal().replacen("radius_mm = 11.45", "radius_mm = 0", 1);
    let error: FileError = parse_lens(&text, &catalog()).unwrap_err();
    let (line, column) = (error.line.unwrap(), error.column.unwrap());
    assert_eq!(column, 13);
    assert_eq!(
        error.to_string(),
        format!(
            "line {line}, column 13: `radius_mm = 0`: surface 2: a surface cannot have the radius \
             0 (hint: a plane is `radius_mm = inf`)"
        )
    );
}

#[test]
fn mutilated_files_never_panic() {
    let catalog = catalog();
    let good = nominal();
    let lines: Vec<&str> = good.lines().collect();
    let nasty = ["", "=", "nan", "-inf", "1e999", "[[surface]]", "{", "\"\"\"", "\u{fffd}=1", "-0.0", "[]"];
    let mut state = 1;
    for _ in 0..3000 {
        odd_number(&mut state);
        let (line, cut) = (state as usize % lines.len(), (state >> 20) as usize);
        let insert = nasty[(state >> 40) as usize % nasty.len()];
        let old = lines[line];
        let mut cut = cut % (old.len() + 1);
        while !old.is_char_boundary(cut) {
            cut -= 1;
        }
        let keep = if state >> 60 & 1 == 0 { &old[cut..] } else { "" };
        let new = format!("{}{insert}{keep}", &old[..cut]);
        let mut changed = lines.clone();
        changed[line] = &new;
        if let Err(error) = parse_lens(&changed.join("\n"), &catalog) {
            assert!(!error.to_string().is_empty());
        }
    }
}

/// A lens whose semi-diameters follow from the beam is impossible because of the beam: the aperture is named.
#[test]
fn beams_that_make_a_lens_impossible_are_named() {
    let text = |thickness: &str, pupil: &str| {
        format!(
            "name = \"singlet\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = {pupil}\n[object]\ndistance_mm = inf\n\
             [wavelengths]\num = [0.5876]\n[fields]\nangle_deg = [0.0]\n[glass.M15]\nn = 1.5\n\
             [[surface]]\nstop = true\nradius_mm = 50.0\nthickness_mm = {thickness}\nglass = \"M15\"\n\
             [[surface]]\nradius_mm = inf\nthickness_mm = 97.0\n"
        )
    };
    let error =
        |thickness: &str, pupil: &str| parse_lens(&text(thickness, pupil), &Catalog::default()).unwrap_err();
    let sharp = error("0.1", "20.0");
    assert_eq!((sharp.key.as_str(), sharp.value.as_str()), ("thickness_mm", "0.1"), "{sharp}");
    assert!(sharp.hint.unwrap().contains("narrow the beam"));
    let short = error("80.0", "120.0");
    assert_eq!(
        (short.key.as_str(), short.value.as_str()),
        ("entrance_pupil_diameter_mm", "120.0"),
        "{short}"
    );
    assert!(short.message.contains("the shape ends 50.0000 mm") && short.hint.unwrap().contains("the beam"));
}

#[test]
fn impossible_lenses_are_named() {
    let lens = parse_lens(&nominal(), &catalog()).unwrap().lens;
    let with = |change: &dyn Fn(&mut petzval_optics::lens::Lens)| {
        let mut lens = lens.clone();
        change(&mut lens);
        validate(&lens).unwrap_err()
    };
    assert_eq!(with(&|l| l.surfaces.clear()), LensDefect::NoSurface);
    assert_eq!(with(&|l| l.stop = 7), LensDefect::NoStop { stop: 8, surfaces: 7 });
    assert_eq!(with(&|l| l.fields_deg.clear()), LensDefect::Nothing { what: "field" });
    assert_eq!(with(&|l| l.entrance_pupil_mm = -1.0), LensDefect::Pupil { diameter_mm: -1.0 });
    let nan = with(&|l| l.surfaces[2].shape.conic = f64::NAN);
    assert!(matches!(nan, LensDefect::NotFinite { surface: 3, .. }), "{nan}");
    let far = with(&|l| l.surfaces[2].thickness_mm = 1e308);
    assert!(matches!(far, LensDefect::TooFar { surface: 3, .. }), "{far}");

    // A biconcave element is thinnest in the middle, a biconvex one at the edge.
    let thin = with(&|l| l.surfaces[2].thickness_mm = -0.1);
    assert!(matches!(thin, LensDefect::CentreThickness { surface: 3, thickness_mm: -0.1, .. }), "{thin}");
    let sharp = with(&|l| l.surfaces[5].thickness_mm = 0.5);
    assert!(matches!(sharp, LensDefect::EdgeThickness { surface: 6, .. }), "{sharp}");

    // A meniscus of even thickness keeps it where the axis follows its decentre; where the axis returns, its rear stands beside it.
    let meniscus = |axis: Axis| {
        let mut lens = lens.clone();
        lens.surfaces.truncate(2);
        for (surface, thickness_mm) in lens.surfaces.iter_mut().zip([1.0, 100.0]) {
            surface.shape = SurfaceShape { curvature: 0.05, ..SurfaceShape::PLANE };
            (surface.thickness_mm, surface.semi_diameter_mm) = (thickness_mm, 8.0);
        }
        let decenter_mm = [0.0, 5.0];
        lens.surfaces[0].placement = Some(Placement { decenter_mm, axis, ..Placement::default() });
        lens.stop = 0;
        validate(&lens)
    };
    assert_eq!(meniscus(Axis::Follows), Ok(()));
    let beside = meniscus(Axis::Returns).unwrap_err();
    assert!(matches!(beside, LensDefect::EdgeThickness { surface: 1, .. }), "{beside}");

    // S2 sags towards V2 by 0.95 mm at V2's edge, and V2 comes to meet it with 0.26 mm.
    let crossing = with(&|l| l.surfaces[1].thickness_mm = 1.0);
    let LensDefect::AirGap { surface: 2, gap_mm, .. } = crossing else { panic!("{crossing}") };
    assert!(gap_mm < 0.0 && crossing.surface() == Some(2));

    let short = with(&|l| l.surfaces[6].semi_diameter_mm = 13.06);
    assert!(matches!(short, LensDefect::SurfaceEnds { surface: 7, .. }), "{short}");
    let glass = Glass::new("BAD", Dispersion::Sellmeier { b: vec![1.0], c_um2: vec![0.3025] });
    let no_index = with(&|l| l.surfaces[0].glass = Arc::new(glass.clone()));
    assert!(matches!(no_index, LensDefect::Index { surface: 1, .. }), "{no_index}");
}

/// A concave mirror of 50 mm with its stop at the focus: chief rays of a near object are parallel to the axis.
#[test]
fn an_entrance_pupil_at_infinity_is_refused_with_the_numbers_of_one_far_away() {
    let text = |[to_stop, to_image, pupil]: [&str; 3]| {
        format!(
            "name = \"telecentric\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = {pupil}\n[object]\ndistance_mm = 150.0\n\
             [wavelengths]\num = [0.55]\n[fields]\nangle_deg = [0.0, 1.0]\n\
             [[surface]]\nradius_mm = -100.0\nthickness_mm = {to_stop}\nmirror = true\nsemi_diameter_mm = 12.0\n\
             [[surface]]\nstop = true\nradius_mm = inf\nthickness_mm = {to_image}\nsemi_diameter_mm = 4.0\n"
        )
    };
    let error = parse_lens(&text(["-50.0", "-25.0", "8.0"]), &Catalog::default()).unwrap_err();
    assert_eq!((error.line, error.key.as_str()), (Some(4), "entrance_pupil_diameter_mm"), "{error}");
    // A far object has no such lens at all: the distance to the stop is at fault.
    let far = text(["-50.0", "-25.0", "8.0"]).replace("distance_mm = 150.0", "distance_mm = inf");
    let at_stop = parse_lens(&far, &Catalog::default()).unwrap_err();
    assert_eq!(
        (at_stop.line, at_stop.key.as_str(), at_stop.value.as_str()),
        (Some(13), "thickness_mm", "-50.0")
    );
    assert!(at_stop.message.contains("the entrance pupil of a far object lies at infinity"), "{at_stop}");
    let hint = error.hint.unwrap();
    assert!(error.message.contains("telecentric") && hint.contains("fills 4 mm"), "{hint}");
    // What the hint says is a lens whose beam fills the stop.
    let words: Vec<&str> = hint.split([' ', ',']).collect();
    let after = |word: &str, nth: usize| {
        let at = words.iter().enumerate().filter(|(_, w)| **w == word).map(|(i, _)| i).nth(nth).unwrap();
        words[at + 1]
    };
    let stated = [after("=", 0), after("and", 0), after("=", 1)];
    let lens = parse_lens(&text(stated), &Catalog::default()).unwrap().lens;
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    assert!((order.stop_radius_mm.abs() - 4.0).abs() < 1e-4, "{stated:?}: {}", order.stop_radius_mm);
    assert!(order.entrance_pupil_at_mm.abs() > 1e7);
}
