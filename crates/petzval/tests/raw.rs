//! `petzval raw`, and the formats of `petzval simulate`.

mod common;

use std::path::Path;

use common::{data, read, run_fails, run_ok};

/// A mosaic of 4 rows and 6 columns of 12 bits as a 16-bit TIFF.
fn write_tiff(path: &Path) -> Vec<u16> {
    let dn: Vec<u16> = (0..24).map(|i| (119 + 173 * i).min(4095)).collect();
    image::ImageBuffer::<image::Luma<u16>, _>::from_raw(6, 4, dn.clone()).unwrap().save(path).unwrap();
    dn
}

#[test]
fn a_frame_goes_through_every_format_without_loss() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let dn = write_tiff(&at("frame.tiff"));
    let settings =
        ["--bits", "12", "--cfa", "GRBG", "--black-level-dn", "119", "--time-s", "0.0025", "--gain", "1.77"];
    let first = run_ok(folder.path(), &[&["raw", "convert", "frame.tiff", "a.raw"], &settings[..]].concat());
    assert_eq!(first.stdout, "a.raw\na.raw.toml\n");
    // 12 bits in MIPI: 6 columns take 9 bytes.
    assert_eq!(std::fs::read(at("a.raw")).unwrap().len(), 4 * 9);
    let sidecar = read(&at("a.raw.toml"));
    for line in
        ["height = 4", "width = 6", "bits = 12", "packing = \"mipi\"", "cfa = \"GRBG\"", "linear_gain = 1.77"]
    {
        assert!(sidecar.lines().any(|l| l == line), "{line}\n{sidecar}");
    }
    let steps: [&[&str]; 6] = [
        &["a.raw", "b.png"],
        &["b.png", "c.npy"],
        &["c.npy", "d.raw", "--packing", "lsb"],
        &["d.raw", "e.raw", "--packing", "u16be"],
        &["e.raw", "f.raw", "--packing", "u16le"],
        &["f.raw", "g.tiff"],
    ];
    for step in steps {
        run_ok(folder.path(), &[&["raw", "convert"], step].concat());
    }
    let picture = image::open(at("g.tiff")).unwrap();
    assert_eq!(picture.into_luma16().into_raw(), dn);
    // The metadata of the frame are kept through all formats.
    let shown = run_ok(folder.path(), &["raw", "show", "g.tiff", "--json"]).json();
    assert_eq!((&shown["height"], &shown["width"]), (&4.into(), &6.into()));
    assert_eq!(shown["info"]["bits"], 12);
    assert_eq!(shown["info"]["cfa"], "GRBG");
    assert_eq!(shown["info"]["exposure_s"], 0.0025);
    let green: Vec<f64> = (0..24).filter(|i| (i / 6 + i % 6) % 2 == 0).map(|i| f64::from(dn[i])).collect();
    let colours = shown["colours"].as_array().unwrap();
    assert_eq!(
        colours.iter().map(|c| c["colour"].as_str().unwrap()).collect::<Vec<_>>(),
        ["red", "green", "blue"]
    );
    assert_eq!(colours[1]["mean_dn"], green.iter().sum::<f64>() / green.len() as f64);
    assert_eq!(colours[1]["saturated"], 1);

    let text = run_ok(folder.path(), &["raw", "show", "g.tiff"]).stdout;
    for words in ["4 rows x 6 columns", "GRBG", "black level   119 DN", "0.0025 s", "saturated"] {
        assert!(text.contains(words), "{words}\n{text}");
    }

    // OpenEXR holds the same numbers as floats.
    run_ok(folder.path(), &["raw", "convert", "g.tiff", "h.exr"]);
    assert!(std::fs::read(at("h.exr")).unwrap().starts_with(&[0x76, 0x2f, 0x31, 0x01]));
}

#[test]
fn what_cannot_be_read_or_written_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write_tiff(&folder.path().join("frame.tiff"));
    write("notes.tiff", b"no picture");
    write("lonely.raw", &[0; 36]);
    write("short.raw", &[0; 35]);
    write("short.raw.toml", b"height = 4\nwidth = 6\nbits = 12\npacking = \"mipi\"\n");
    write("odd.raw", &[0; 36]);
    write("odd.raw.toml", b"height = 4\nwidth = 6\nbits = 13\npacking = \"mipi\"\n");
    write("typo.raw", &[0; 36]);
    write("typo.raw.toml", b"height = 4\nwdth = 6\nbits = 12\npacking = \"mipi\"\n");
    let colour = data("photos/coffee.png").display().to_string();
    for (args, needles) in [
        (&["show", "notes.tiff"][..], ["notes.tiff: ", "gray TIFF or PNG"]),
        (&["show", "nowhere.tiff"], ["nowhere.tiff", "No such file"]),
        (&["show", "."], [".: ", "this is a folder"]),
        (&["show", &colour], ["coffee.png: a picture of Rgb8", "gray TIFF or PNG"]),
        (&["show", "lonely.raw"], ["no sidecar lonely.raw.toml", "packing = \"mipi\""]),
        (&["show", "short.raw"], ["short.raw: the file has 35 bytes", "take 36"]),
        (&["show", "odd.raw"], ["odd.raw.toml:3:8: `bits = 13`", "8, 10, 12 and 14"]),
        (&["show", "typo.raw"], ["typo.raw.toml:2:1: `wdth = 6`", "did you mean `width`?"]),
        (
            &["convert", "frame.tiff", "a.jpg"],
            ["a.jpg: the name does not end with a format", ".tiff, .png, .npy, .raw or .exr"],
        ),
        (&["convert", "frame.tiff", "a.dng"], ["a.dng", "end it with"]),
        (
            &["convert", "frame.tiff", "a.raw", "--bits", "10"],
            ["the value 1157 at row 1, column 0", "10 bits"],
        ),
        (&["convert", "frame.tiff", "a.raw", "--bits", "99"], ["--bits 99: outside 1..16", "1 to 16"]),
        (&["convert", "frame.tiff", "a.raw", "--packing", "mipi"], ["has no 16 bits", "packing"]),
        (
            &["convert", "frame.tiff", "a.png", "--packing", "mipi"],
            ["--packing mipi: only .raw files are packed", "leave"],
        ),
        (&["convert", "frame.tiff", "a.png", "--cfa", "RGX"], ["RGX", "RGGB"]),
        (&["convert", "frame.tiff", "none/a.png"], ["none/a.png", "No such file"]),
    ] {
        run_fails(folder.path(), &[&["raw"], args].concat(), 2, &needles);
    }
}

#[test]
fn a_simulated_photograph_comes_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let photo = data("photos/coffee.png").display().to_string();
    let take = |raw: &str, picture: &str| {
        let formats = ["--raw-format", raw, "--picture-format", picture, "--gain", "2", "--json"];
        run_ok(folder.path(), &[&["simulate", &photo, "--out", raw], &formats[..]].concat()).json()
    };
    let show = |file: &str| run_ok(folder.path(), &["raw", "show", file, "--json"]).json();
    let written = take("tiff", "exr");
    let tiff = show(written[0]["raw"].as_str().unwrap());
    assert_eq!(written[0]["sidecar"], "tiff/coffee-raw.tiff.toml");
    assert_eq!((&tiff["info"]["bits"], &tiff["info"]["cfa"]), (&12.into(), &"RGGB".into()));
    assert_eq!((&tiff["info"]["linear_gain"], &tiff["info"]["black_level_dn"]), (&2.0.into(), &119.0.into()));
    let exr = std::fs::read(folder.path().join("tiff/coffee-developed.exr")).unwrap();
    assert!(exr.starts_with(&[0x76, 0x2f, 0x31, 0x01]));
    let packed = show(take("packed", "npy")[0]["raw"].as_str().unwrap());
    assert_eq!((&packed["colours"], &packed["info"]), (&tiff["colours"], &tiff["info"]));
    assert_eq!(
        std::fs::metadata(folder.path().join("packed/coffee-raw.raw")).unwrap().len(),
        1200 * 1920 * 3 / 2
    );
    let light = std::fs::read(folder.path().join("packed/coffee-developed.npy")).unwrap();
    assert_eq!(npyz::NpyFile::new(&light[..]).unwrap().shape(), [3, 1200, 1920]);
}
