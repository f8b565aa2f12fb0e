//! `petzval lens convert`, and lens files of other programs as input of other verbs.

use std::path::Path;

use crate::common::*;

const ZMX: &str = "\
MODE SEQ
NAME achromat
UNIT MM X W X CM MR CPMM
ENPD 20
FTYP 0 0 2 1 0 0 0
YFLN 0 1
WAVM 1 0.5876 1
PWAV 1
SURF 0
  TYPE STANDARD
  DISZ INFINITY
SURF 1
  STOP
  TYPE STANDARD
  CURV 1.626809825931349E-02 0 0 0 0 \"\"
  COAT AR
  DISZ 6
  GLAS N-BK7 0 0 1.5168 64.17
SURF 2
  CURV -2.240143369175627E-02 1 0 0 0 \"\"
  DISZ 2.5
  GLAS N-SF5 0 0 1.67271 32.25
SURF 3
  CURV -7.695859627520394E-03
  DISZ 95.95
SURF 4
  TYPE STANDARD
EFFL 0 1 0 0 0 0 100 1
";

fn folder_with(name: &str, bytes: &[u8]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), bytes).unwrap();
    folder
}

#[test]
fn a_zemax_lens_is_converted_to_each_format_and_back() {
    let utf16: Vec<u8> =
        "\u{feff}".encode_utf16().chain(ZMX.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let folder = folder_with("a.zmx", &utf16);
    let at = folder.path();
    let out = run_ok(at, &["lens", "convert", "a.zmx", "a.toml"]);
    assert_eq!(out.stdout, "a.toml\n");
    assert!(out.says("no-ray: a.zmx:16: `COAT AR`: coatings are not read"), "{}", out.stderr);
    assert!(out.says("no-ray: a.zmx:28: `EFFL"), "{}", out.stderr);
    for (from, to) in [("a.toml", "b.seq"), ("b.seq", "c.zmx"), ("c.zmx", "d.toml")] {
        run_ok(at, &["lens", "convert", from, to]);
    }
    assert_eq!(read(&at.join("a.toml")), read(&at.join("d.toml")));
    let shown = run_ok(at, &["lens", "show", "d.toml", "--json"]).json();
    assert!((shown["efl_mm"].as_f64().unwrap() - 100.0).abs() < 0.05, "{shown}");
    assert_eq!(std::fs::read_dir(at).unwrap().count(), 5, "something is left behind");
}

#[test]
fn the_report_for_machines() {
    let folder = folder_with("a.zmx", ZMX.as_bytes());
    let out = run_ok(folder.path(), &["lens", "convert", "a.zmx", "a.seq", "--json"]);
    let report = out.json();
    assert_eq!((report["name"].as_str(), report["from"].as_str()), (Some("achromat"), Some("a.zmx")));
    assert!((report["efl_mm"].as_f64().unwrap() - 100.0).abs() < 0.05);
    let lost = &report["losses_of_reading"][0];
    assert_eq!((lost["line"].as_u64(), lost["record"].as_str()), (Some(16), Some("COAT AR")));
    assert_eq!((lost["effect"].as_str(), lost["more"].as_u64()), (Some("no-ray"), Some(0)));
    assert_eq!(report["losses_of_writing"].as_array().unwrap().len(), 0, "{report}");
    let built_in =
        run_ok(folder.path(), &["lens", "convert", "cooke-triplet-nominal", "t.zmx", "--json"]).json();
    let records: Vec<_> = built_in["losses_of_writing"]
        .as_array()
        .unwrap()
        .iter()
        .map(|l| l["record"].as_str().unwrap())
        .collect();
    assert_eq!(records, ["[[variable]]", "[solve]", "[expect]"]);
}

#[test]
fn text_that_is_not_ascii_is_written_as_zemax_reads_it() {
    let folder = folder_with("a.zmx", ZMX.replace("achromat", "Achromat für Gauß").as_bytes());
    run_ok(folder.path(), &["lens", "convert", "a.zmx", "b.zmx"]);
    let bytes = std::fs::read(folder.path().join("b.zmx")).unwrap();
    assert_eq!(bytes[..2], [0xff, 0xfe]);
    let shown = run_ok(folder.path(), &["lens", "show", "b.zmx"]).stdout;
    assert!(shown.starts_with("Achromat für Gauß\n"), "{shown}");
}

#[test]
fn other_verbs_read_the_files_and_report_losses() {
    let folder = folder_with("a.zmx", ZMX.replace("NAME achromat", "NAME").as_bytes());
    let shown = run_ok(folder.path(), &["lens", "show", "a.zmx"]);
    assert!(shown.stdout.starts_with("a\n"), "a lens without a name has that of its file: {}", shown.stdout);
    assert!(shown.says("warning: a.zmx:16: `COAT AR`: coatings are not read"), "{}", shown.stderr);
    let args =
        ["lens", "trace", "a.zmx", "--field", "1", "--wavelength", "0.5876", "--pupil", "0,0.5", "--json"];
    assert_eq!(run_ok(folder.path(), &args).json()["status"], "ok");
}

#[test]
fn a_refused_conversion_leaves_no_file() {
    let fails = |folder: &Path, to: &str, needles: &[&str]| {
        let args = ["lens", "convert", "a.zmx", to];
        run_fails(folder, &args, 2, needles);
    };
    let folder =
        folder_with("a.zmx", ZMX.replace("TYPE STANDARD\n  CURV", "TYPE GRINSUR1\n  CURV").as_bytes());
    fails(
        folder.path(),
        "b.toml",
        &["a.zmx:14: `TYPE GRINSUR1`: surfaces of type GRINSUR1 are not traced", "help:"],
    );
    let folder = folder_with("a.zmx", ZMX.replace("N-SF5 0 0 1.67271 32.25", "N-SF55").as_bytes());
    fails(folder.path(), "b.seq", &["a.zmx:22: `GLAS N-SF55", "no glass is called", "N-SF5"]);
    let folder = folder_with("a.zmx", ZMX.as_bytes());
    fails(
        folder.path(),
        "b.zemax",
        &["b.zemax: no lens format that is written has this ending", "help: write .toml, .zmx or .seq"],
    );
    run_fails(folder.path(), &["lens", "convert", "a.zmx", "no/such/b.seq"], 2, &["no/such/b.seq"]);
    run_fails(
        folder.path(),
        &["lens", "convert", "missing.zmx", "b.seq"],
        2,
        &["missing.zmx", "cannot be read"],
    );
    // Properties that the target format does not support.
    let lens = read(&data("lenses/cooke-triplet-nominal.toml")).replacen(
        "radius_mm = 11.45",
        "radius_mm = 11.45\nq_con = { norm_radius_mm = 7.0, a = [1e-6] }",
        1,
    );
    std::fs::write(folder.path().join("q.toml"), lens).unwrap();
    for to in ["q.zmx", "q.seq"] {
        let needles =
            ["nothing is written: `surface 2`: Forbes surfaces are not written", "help: convert to .toml"];
        run_fails(folder.path(), &["lens", "convert", "q.toml", to], 2, &needles);
    }
}

/// A singlet of N-BK7 with a coated first surface, in Optiland's format.
const OPTILAND: &str = r#"{
  "version": 1.0,
  "aperture": {"type": "imageFNO", "value": 5, "object_space_telecentric": false},
  "fields": {"fields": [{"x": 0.0, "y": 0}, {"x": 0.0, "y": 3}], "telecentric": false, "field_type": "angle"},
  "wavelengths": {"wavelengths": [{"value": 0.5876, "is_primary": true, "unit": "um"}], "polarization": "ignore"},
  "pickups": [],
  "solves": {"solves": []},
  "surface_group": {"surfaces": [
    {"type": "ObjectSurface", "geometry": {"type": "Plane", "cs": {"z": -Infinity}, "radius": Infinity},
     "material_post": {"type": "IdealMaterial", "index": 1.0}},
    {"type": "Surface", "geometry": {"type": "StandardGeometry", "cs": {"z": 0.0}, "radius": 50.0, "conic": -0.5},
     "material_post": {"type": "Material", "filename": "/optiland/database/data-nk/glass/schott/N-BK7.yml", "name": "N-BK7"},
     "is_stop": true, "is_reflective": false, "coating": {"type": "FresnelCoating"}},
    {"type": "Surface", "geometry": {"type": "Plane", "cs": {"z": 4.0}, "radius": Infinity},
     "material_post": {"type": "IdealMaterial", "index": 1.0}, "is_stop": false},
    {"type": "Surface", "geometry": {"type": "Plane", "cs": {"z": 98.0}, "radius": Infinity},
     "material_post": {"type": "IdealMaterial", "index": 1.0}, "is_stop": false}
  ]}
}"#;

#[test]
fn a_lens_of_optiland_is_read_by_every_verb() {
    let folder = folder_with("a.json", OPTILAND.as_bytes());
    let out = run_ok(folder.path(), &["lens", "convert", "a.json", "b.toml", "--json"]).json();
    // A plano-convex lens: f = R / (n - 1), with n = 1.51680 of N-BK7 in yellow light.
    assert!((out["efl_mm"].as_f64().unwrap() - 50.0 / 0.5168).abs() < 0.01, "{out}");
    assert_eq!(out["losses_of_reading"][0]["message"], "coatings are not read");
    assert_eq!(out["losses_of_reading"][0]["line"], 13);
    let shown = |file: &str| run_ok(folder.path(), &["lens", "show", file, "--json"]).json();
    let (a, b) = (shown("a.json"), shown("b.toml"));
    assert_eq!((&a["name"], &a["first_order"]), (&b["name"], &b["first_order"]));
    run_ok(folder.path(), &["lens", "convert", "a.json", "c.zmx"]);
    assert_eq!(shown("c.zmx")["first_order"], a["first_order"]);

    // What would bend light otherwise is refused with its line, and nothing is written.
    let mirror = OPTILAND.replace("\"is_reflective\": false", "\"is_reflective\": true");
    let folder = folder_with("a.json", mirror.as_bytes());
    let args = ["lens", "convert", "a.json", "b.toml"];
    run_fails(folder.path(), &args, 2, &["a.json:13", "surface 1: mirrors are not read from this format"]);
    let args = ["lens", "convert", "cooke-triplet-nominal", "b.json"];
    run_fails(folder.path(), &args, 2, &["b.json: no lens format that is written has this ending"]);
}
