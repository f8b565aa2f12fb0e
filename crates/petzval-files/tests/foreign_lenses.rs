//! Lens files as other programs write them: what is read, what is refused with a reason, and that nothing is read wrongly. Focal lengths are those
//! of the paraxial formula, computed apart from this program from the indices that makers print.

use std::path::Path;
use std::sync::Arc;

use petzval_files::{Effect, Import, parse_catalog, parse_seq, parse_zmx};
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::Lens;
use petzval_optics::merit::{Merit, SpotResiduals};
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::aim_at_pupil;
use petzval_optics::trace::launch;

fn catalog() -> Catalog {
    let mut catalog = Catalog::default();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/glasses");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            catalog.merge(parse_catalog(&std::fs::read_to_string(path).unwrap()).unwrap());
        }
    }
    catalog
}

/// A cemented doublet behind whose last surface is the stop: curvatures 1/50, -3/200, -1/200, glass of 5 and 3 mm.
const DOUBLET: &str = "\
VERS 140124 258 36214
MODE SEQ
NAME doublet
UNIT MM X W X CM MR CPMM
ENPD 8
GCAT SCHOTT MISC
FTYP 0 0 2 3 0 0 0
XFLN 0 0
YFLN 0 5
FWGN 1 1
WAVM 1 0.4861 1
WAVM 2 0.5875618 1
WAVM 3 0.6563 1
PWAV 2
SURF 0
  TYPE STANDARD
  CURV 0.0 0 0 0 0 \"\"
  DISZ INFINITY
SURF 1
  TYPE STANDARD
  CURV 0.02 0 0 0 0 \"\"
  DISZ 5
  GLAS N-BK7 0 0 1.5168 64.17 0 0 0 0 0 0
  DIAM 8 0 0 0 1 \"\"
SURF 2
  TYPE STANDARD
  CURV -0.015 0 0 0 0 \"\"
  DISZ 3
  GLAS N-SF5 0 0 1.67271 32.25 0 0
  DIAM 8 0 0 0 1 \"\"
SURF 3
  TYPE STANDARD
  STOP
  CURV -0.005 0 0 0 0 \"\"
  DISZ 48
  DIAM 8 0 0 0 1 \"\"
SURF 4
  TYPE STANDARD
  CURV 0.0 0 0 0 0 \"\"
  DISZ 0
  DIAM 5 0 0 0 1 \"\"
";

const PLANES: &str = "\
SURF 1
  TYPE STANDARD
  CURV 0.0 0 0 0 0 \"\"
  DISZ 10
SURF 2
  TYPE STANDARD
  CURV 0.0 0 0 0 0 \"\"
  DISZ -4
";

fn first_glass(record: &str) -> String {
    DOUBLET.replace("N-BK7 0 0 1.5168 64.17 0 0 0 0 0 0", record)
}

/// A text in which surfaces stand in front of all others but the object.
fn with_in_front(text: &str, count: usize, surfaces: &str) -> String {
    let mut text = text.to_owned();
    for surface in (1..=4).rev() {
        text = text.replace(&format!("SURF {surface}\n"), &format!("SURF {}\n", surface + count));
    }
    let first = format!("SURF {}\n", 1 + count);
    text.replace(&first, &format!("{surfaces}{first}"))
}

/// The doublet with its stop at the rim of its first surface, 0.3 mm behind the vertex.
fn behind_stop_at_rim() -> String {
    let stop = "SURF 1\n  TYPE STANDARD\n  STOP\n  CURV 0.0 0 0 0 0 \"\"\n  DISZ -0.3\n";
    with_in_front(&DOUBLET.replace("  STOP\n", ""), 1, stop)
}

/// The doublet in front of an object at 150 mm whose chief rays are parallel by decree, with the stop so far behind the last surface, and the image
/// at 210.855 mm from there. Its focus is at 84.368 mm.
fn telecentric(stop_mm: f64) -> String {
    let image_mm = 210.855 - stop_mm;
    let stop = format!(
        "DISZ {stop_mm}\n  DIAM 8 0 0 0 1 \"\"\nSURF 4\n  TYPE STANDARD\n  STOP\n  CURV 0.0 0 0 0 0 \"\"\n  DISZ {image_mm}"
    );
    DOUBLET
        .replace("  STOP\n", "")
        .replace("SURF 4", "SURF 5")
        .replace("DISZ 48\n  DIAM 8 0 0 0 1 \"\"", &stop)
        .replace("DISZ INFINITY", "DISZ 150")
        .replace("ENPD 8", "OBNA 0.03")
        .replace("FTYP 0 0", "FTYP 1 1")
}

/// What a file must give: its focal length, mm, and a loss that is reported; or the reason why it is refused.
enum Wanted {
    Read(f64, Option<&'static str>),
    Refused(&'static str),
}
use Wanted::{Read, Refused};

fn efl_mm(import: &Import) -> f64 {
    let lens = &import.file.lens;
    first_order(&lens.at_wavelength(lens.reference_um)).efl_mm
}

#[test]
fn files_in_the_styles_of_other_programs() {
    let plain = 88.674_060_730_266_43;
    let successor = Some("its successor");
    let by_numbers = Some("by Cauchy's formula");
    let cases: Vec<(&str, String, Wanted)> = vec![
        ("as written", DOUBLET.to_owned(), Read(plain, None)),
        ("BK7 with its numbers", first_glass("BK7 0 0 1.5168 64.17 0 0"), Read(plain, successor)),
        ("BK7 alone", first_glass("BK7"), Read(plain, successor)),
        ("the program's own numbers", first_glass("BK7 0 0 1.5 40 0 0"), Read(plain, successor)),
        ("K5", first_glass("K5 0 0 1.52249 59.48"), Read(87.168_482_922_837_5, successor)),
        ("BAK4", first_glass("BAK4 0 0 1.56883 56.13"), Read(76.587_736_196_284_74, successor)),
        ("LAK9", first_glass("LAK9"), Read(58.057_557_970_057_64, successor)),
        ("SK5", first_glass("SK5"), Read(72.724_964_154_881_02, successor)),
        ("BAF10", first_glass("BAF10"), Read(60.569_323_066_792_53, successor)),
        ("SSK4, which has no successor", first_glass("SSK4"), Read(67.916_188_819_708_65, by_numbers)),
        (
            "a successor that contradicts the file",
            first_glass("BK7 0 0 1.6 50"),
            Read(70.813_461_953_364_25, by_numbers),
        ),
        ("a melt", first_glass("MELT17 0 0 1.6 50 0 0"), Read(70.813_461_953_364_25, by_numbers)),
        ("B270", first_glass("B270 0 0 1.523 58.6"), Read(87.036_044_071_610_95, None)),
        ("water", first_glass("WATER"), Read(201.511_998_2, None)),
        ("acrylic", first_glass("ACRYLIC"), Read(96.002_032_333_891_22, None)),
        ("sapphire", first_glass("SAPPHIRE"), Read(50.378_5, None)),
        ("a model glass", first_glass("___BLANK 1 0 1.489 57.4 0 0"), Read(96.852_153_686_934_2, by_numbers)),
        (
            "a model glass with a solve",
            first_glass("___BLANK 2 1 1.489 57.4 0 0"),
            Read(96.852_153_686_934_2, by_numbers),
        ),
        ("a glass of which nothing is known", first_glass("MELT17 0 0 1.5 40 0 0"), Refused("--glasses")),
        (
            "planes in front",
            with_in_front(DOUBLET, 2, PLANES),
            Read(plain, Some("a plane without effect is left out")),
        ),
        ("a stop at the rim of the first surface", behind_stop_at_rim(), Read(plain, None)),
        (
            "an image in front of the last surface",
            DOUBLET.replace("DISZ 48", "DISZ -5"),
            Refused("goes against the light"),
        ),
        ("a virtual object", DOUBLET.replace("DISZ INFINITY", "DISZ -200"), Read(plain, None)),
        ("telecentric without an object", DOUBLET.replace("FTYP 0 0", "FTYP 0 1"), Refused("near object")),
        ("telecentric, with the stop elsewhere", telecentric(60.0), Refused("parallel: 84.36")),
        ("telecentric, with the stop at the focus", telecentric(84.368), Read(plain, Some("parallel"))),
        (
            "fields along x",
            DOUBLET.replace("XFLN 0 0", "XFLN 0 5").replace("YFLN 0 5", "YFLN 0 0"),
            Read(plain, Some("off the y axis")),
        ),
        ("weights of fields", DOUBLET.replace("FWGN 1 1", "FWGN 1 2"), Read(plain, None)),
        (
            "weights of fields below 0",
            DOUBLET.replace("FWGN 1 1", "FWGN 1 -2"),
            Read(plain, Some("weights of fields below 0")),
        ),
        (
            "vignetting factors",
            DOUBLET.replace("PWAV 2", "VCYN 0 0.2\nPWAV 2"),
            Read(plain, Some("vignetting factors")),
        ),
        (
            "a rectangular aperture",
            DOUBLET.replace("  DISZ 5\n", "  DISZ 5\n  SQAP 7 7 0\n"),
            Read(plain, Some("circle")),
        ),
        (
            "an obscuration",
            DOUBLET.replace("  DISZ 5\n", "  DISZ 5\n  OBSC 0 2 0\n"),
            Read(plain, Some("obscuration")),
        ),
        ("the stop's size", DOUBLET.replace("ENPD 8", "FLOA"), Read(plain, None)),
    ];
    let catalog = catalog();
    let (mut read, mut refused, mut wrong) = (0, 0, Vec::new());
    for (what, text, wanted) in cases {
        match (parse_zmx(&text, &catalog), wanted) {
            (Ok(import), Read(efl, loss)) => {
                read += 1;
                let losses: Vec<String> = import.losses.iter().map(ToString::to_string).collect();
                // A changed glass or picture is never silent.
                let is_said = match loss {
                    Some(words) => losses.iter().any(|l| l.contains(words)),
                    None => import.losses.iter().all(|l| l.effect != Effect::Approximated),
                };
                if !((efl_mm(&import) / efl - 1.0).abs() < 2e-5 && is_said) {
                    wrong.push(format!("{what}: {} against {efl}, {losses:?}", efl_mm(&import)));
                }
            }
            (Err(error), Refused(words)) => {
                refused += 1;
                if !error.to_string().contains(words) || error.line.is_none() {
                    wrong.push(format!("{what}: {error}"));
                }
            }
            (Ok(import), Refused(_)) => wrong.push(format!("{what}: read, {} mm", efl_mm(&import))),
            (Err(error), Read(..)) => wrong.push(format!("{what}: {error}")),
        }
    }
    assert!(wrong.is_empty(), "{read} read, {refused} refused, and these are wrong:\n{}", wrong.join("\n"));
    assert_eq!((read, refused), (29, 4));
}

/// A catalogue whose glass `N-BK7` of a maker was left out, and that has those of other makers.
fn without(maker: &str, others: &[&str]) -> Catalog {
    let mut catalog = catalog();
    catalog.refuse("N-BK7", maker, "its numbers contradict each other".to_owned());
    for other in others {
        let glass = Glass { maker: (*other).into(), ..Glass::new("N-BK7", Dispersion::Constant(1.6)) };
        catalog.insert("N-BK7", Arc::new(glass));
    }
    catalog
}

#[test]
fn no_glass_stands_in_for_one_of_the_files_maker_that_was_left_out() {
    let refused = |catalogs: &str, catalog: &Catalog| {
        let text = DOUBLET.replace("GCAT SCHOTT MISC", &format!("GCAT {catalogs}"));
        parse_zmx(&text, catalog).err().map(|error| error.to_string())
    };
    for (catalogs, others) in [("SCHOTT MISC", &["Other"][..]), ("SCHOTT OTHER", &["Other"]), ("SCHOTT", &[])]
    {
        let said =
            refused(catalogs, &without("Schott", others)).unwrap_or_else(|| panic!("{catalogs}: read"));
        assert!(said.contains("its numbers contradict each other"), "{catalogs}: {said}");
    }
    // A maker that the file does not name, or names later.
    assert_eq!(refused("OTHER SCHOTT", &without("Schott", &["Other"])), None);
    assert_eq!(refused("SCHOTT", &without("Third", &["Schott"])), None);
    assert_eq!(refused("SCHOTT THIRD OTHER", &without("Third", &["Schott", "Other"])), None);
    // A glass that the file names with its maker is of the GCAT that names this one.
    let named = DOUBLET.replace("GLAS N-BK7", "GLAS schott:N-BK7");
    let losses = parse_zmx(&named, &catalog()).unwrap().losses;
    assert!(losses.iter().all(|loss| !loss.to_string().contains("GCAT")), "{losses:?}");
    // A glass of the user's own.
    assert_eq!(refused("SCHOTT", &without("Schott", &[""])), None);
    assert!(refused("SCHOTT", &without("", &[])).is_some());
}

/// Whether a hair's breadth in front of the focus or behind it, a stop at the focus makes parallel chief rays of the right heights, and a cone of
/// the right aperture.
#[test]
fn a_telecentric_object_is_seen_by_parallel_chief_rays() {
    let mut seen = Vec::new();
    for stop_mm in [84.3, 84.368 - 1e-5, 84.368, 84.368 + 1e-5, 84.45] {
        let lens = parse_zmx(&telecentric(stop_mm), &catalog()).unwrap().file.lens;
        let sequence = lens.at_wavelength(lens.reference_um);
        let field_rad = lens.fields_deg[1].to_radians();
        assert!((150.0 * field_rad.tan() - 5.0).abs() < 1e-9);
        let stop_radius_mm = first_order(&sequence).stop_radius_mm;
        let points = [[0.0, 0.0], [0.0, 1.0], [0.0, -1.0], [1.0, 0.0]];
        let aimed = aim_at_pupil(&sequence, field_rad, stop_radius_mm, &points, None);
        let slope_at = |i: usize| {
            let ray = launch(&sequence, field_rad, aimed.launch_of(i)).ray;
            [ray.direction[0], ray.direction[1]]
        };
        let chief = slope_at(0);
        // Pupil aberration of the doublet is what is left.
        assert!(chief[0] == 0.0 && chief[1].abs() < 2e-3, "{stop_mm}: {chief:?}");
        let cone = slope_at(3)[0].abs();
        assert!((cone / 0.03 - 1.0).abs() < 0.02, "{stop_mm}: {cone}");
        seen.push([chief[1], cone, SpotResiduals::new(&lens).value(&lens).unwrap()]);
    }
    for now in &seen {
        assert!(
            (now[1] / seen[2][1] - 1.0).abs() < 2e-3 && (now[2] / seen[2][2] - 1.0).abs() < 2e-2,
            "{seen:?}"
        );
    }
}

/// A file with a solve has the stop at the focus to the last bit, where the entrance pupil is at infinity.
#[test]
fn a_stop_exactly_at_the_focus_is_as_telecentric_as_one_beside_it() {
    let read = |stop_mm: f64| parse_zmx(&telecentric(stop_mm), &catalog()).unwrap();
    let order = |lens: &Lens| first_order(&lens.at_wavelength(lens.reference_um));
    let focus_mm = 84.3 + order(&read(84.3).file.lens).bfl_mm;
    assert!((focus_mm - 84.368).abs() < 1e-3, "{focus_mm}");
    let (exact, beside) = (read(focus_mm), read(focus_mm + 1e-3));
    let said =
        |import: &Import| import.losses.iter().any(|loss| loss.message.contains("exactly at the focus"));
    assert!(said(&exact) && !said(&beside), "{:?}", exact.losses);
    let (lens, other) = (&exact.file.lens, &beside.file.lens);
    assert!(order(lens).entrance_pupil_at_mm.abs() > 1e6 && lens.entrance_pupil_mm.is_finite());
    assert!((order(lens).stop_radius_mm / order(other).stop_radius_mm - 1.0).abs() < 1e-4);
    assert!((lens.total_track_mm() - other.total_track_mm()).abs() < 1e-9);
    // A far object has no such lens: its light would pass the stop in a point.
    let far = telecentric(focus_mm).replace("DISZ 150", "DISZ INFINITY");
    let far = far.replace("OBNA 0.03", "ENPD 8").replace("FTYP 1 1", "FTYP 0 0");
    let said = parse_zmx(&far, &catalog()).unwrap_err().to_string();
    assert!(
        said.contains("`TYPE STANDARD`")
            && said.contains("the entrance pupil of a far object lies at infinity"),
        "{said}"
    );
    let spot_um = |lens: &Lens| SpotResiduals::new(lens).value(lens).unwrap();
    assert!((spot_um(lens) / spot_um(other) - 1.0).abs() < 1e-3, "{} {}", spot_um(lens), spot_um(other));
}

/// Indices as the sources print them; infrared materials have none for visible light.
#[test]
fn materials_for_the_infrared_have_the_indices_of_their_sources() {
    let catalog = catalog();
    for (name, um, index) in [
        ("GERMANIUM", 10.6, 4.0036),
        ("ZNSE", 10.6, 2.4028),
        ("SILICON", 4.5, 3.4275),
        ("ZNS", 10.6, 2.1925),
        ("IRG24", 10.0, 2.6089),
        ("SAPPHIRE", 0.5875618, 1.76817),
        ("WATER", 0.5892938, 1.33300),
        ("B270", 0.54607, 1.5251),
    ] {
        let found = catalog.get(name).unwrap().dispersion.index(um);
        assert!((found - index).abs() < 1e-4, "{name} at {um} um: {found} against {index}");
    }
    let text = DOUBLET
        .replace("0.4861 1", "4.0 1")
        .replace("0.5875618 1", "4.5 1")
        .replace("0.6563 1", "5.0 1")
        .replace("CURV 0.02", "CURV 0.004")
        .replace("N-BK7 0 0 1.5168 64.17 0 0 0 0 0 0", "GERMANIUM 0 0 0 0 0 0")
        .replace("N-SF5 0 0 1.67271 32.25 0 0", "ZNSE");
    assert!(parse_zmx(&text, &catalog).unwrap().losses.is_empty());
}

#[test]
fn code_v_names_of_old_glasses() {
    let catalog = catalog();
    let file = |glass: &str| {
        format!(
            "LEN NEW\nRDM\nDIM M\nEPD 8\nWL 656.3 587.5618 486.1\nREF 2\nYAN 0 5\nSO 0 1e11\n\
             S 50 5 {glass}\nS -66.666666666666667 3 NSF5_SCHOTT\nS -200 48\nSTO\nSI 0 0\nGO\n"
        )
    };
    for (glass, efl, loss) in [
        ("NBK7_SCHOTT", 88.674_060_730_266_43, None),
        ("BK7_SCHOTT", 88.674_060_730_266_43, Some("its successor")),
        ("SSK4_SCHOTT", 67.916_188_819_708_65, Some("by Cauchy's formula")),
    ] {
        let import = parse_seq(&file(glass), &catalog).unwrap_or_else(|e| panic!("{e}"));
        assert!((efl_mm(&import) / efl - 1.0).abs() < 2e-5, "{glass}: {}", efl_mm(&import));
        let losses: Vec<String> = import.losses.iter().map(ToString::to_string).collect();
        assert_eq!(
            losses.iter().any(|l| loss.is_some_and(|words| l.contains(words))),
            loss.is_some(),
            "{losses:?}"
        );
    }
    let unknown = parse_seq(&file("NOSUCH_OHARA"), &catalog).unwrap_err().to_string();
    assert!(unknown.contains("--glasses"), "{unknown}");
}
