//! `petzval raw`, and the formats of `petzval simulate`.

use std::path::Path;

use crate::common::{data, read, run_fails, run_ok};

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

    // Black levels by pixel of the tile are shown one by one, not as their mean.
    let sidecar = std::fs::read_to_string(at("g.tiff.toml")).unwrap();
    let tile = sidecar.replace("black_level_dn = 119.0", "black_level_dn = [118.0, 119.5, 121.0, 119.0]");
    assert_ne!(sidecar, tile);
    std::fs::write(at("g.tiff.toml"), tile).unwrap();
    let text = run_ok(folder.path(), &["raw", "show", "g.tiff"]).stdout;
    let words = "black level   118, 119.5, 121, 119 DN, by pixel of the tile\n";
    assert!(text.contains(words), "{words}\n{text}");
    std::fs::write(at("g.tiff.toml"), sidecar).unwrap();

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
    // 1 x 2 numbers of 32 bits.
    let head = format!("{:<117}\n", "{'descr': '<u4', 'fortran_order': False, 'shape': (1, 2), }");
    write(
        "wide.npy",
        &[&b"\x93NUMPY\x01\x00\x76\x00"[..], head.as_bytes(), &[0, 0, 1, 0, 7, 0, 0, 0]].concat(),
    );
    let colour = data("photos/coffee.png").display().to_string();
    for (args, needles) in [
        (&["show", "notes.tiff"][..], ["notes.tiff: ", "gray TIFF or PNG"]),
        (&["show", "nowhere.tiff"], ["nowhere.tiff", "No such file"]),
        (&["show", "."], [".: ", "this is a folder"]),
        (&["show", &colour], ["coffee.png: a colour picture of 8 bits a sample", "a NumPy array"]),
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
            &["convert", "wide.npy", "a.tiff"],
            ["wide.npy: numbers of more than 16 bits", "`raw convert` writes numbers of up to 16 bits"],
        ),
        (
            &["convert", "frame.tiff", "a.raw", "--bits", "10"],
            ["the value 1157 at row 1, column 0", "10 bits"],
        ),
        (
            &["convert", "frame.tiff", "a.raw", "--bits", "99"],
            ["--bits 99: must lie between 1 and 24", "1 to 24"],
        ),
        (&["convert", "frame.tiff", "a.raw", "--packing", "mipi"], ["has no 16 bits", "packing"]),
        (
            &["convert", "frame.tiff", "a.png", "--packing", "mipi"],
            ["--packing mipi: only .raw files are packed", "leave"],
        ),
        (&["convert", "frame.tiff", "a.png", "--cfa", "RGX"], ["RGX", "RGGB"]),
        (
            &["convert", "frame.tiff", "a.png", "--cfa", "RGBG"],
            ["no Bayer array", "LibRaw lists colours as RGBG"],
        ),
        (
            &["convert", "frame.tiff", "none/a.png"],
            ["none/a.png: nothing can be written there: none is no folder", "make the folder"],
        ),
    ] {
        run_fails(folder.path(), &[&["raw"], args].concat(), 2, &needles);
    }
}

#[test]
fn a_simulated_photograph_comes_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = read(&data("sensors/imx249-fitted.toml")).replace("width = 1920", "width = 160");
    std::fs::write(folder.path().join("small.toml"), sensor.replace("height = 1200", "height = 120"))
        .unwrap();
    let photo = data("photos/coffee.png").display().to_string();
    let take = |raw: &str, picture: &str| {
        let formats = ["--raw-format", raw, "--picture-format", picture, "--gain", "2", "--json"];
        let simulate = ["simulate", &photo, "--sensor", "small.toml", "--out", raw];
        run_ok(folder.path(), &[&simulate[..], &formats[..]].concat()).json()
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
        120 * 160 * 3 / 2
    );
    let light = std::fs::read(folder.path().join("packed/coffee-developed.npy")).unwrap();
    assert_eq!(npyz::NpyFile::new(&light[..]).unwrap().shape(), [3, 120, 160]);
}

/// A frame of 120 x 160 pixels with an upright edge, 5 degrees from the columns, of 16 bits: smooth enough for a known response.
fn write_edge(path: &Path, value: impl Fn(f64) -> u16) {
    let (sin, cos) = 5f64.to_radians().sin_cos();
    let at = |x: u32, y: u32| value((f64::from(x) - 79.5) * cos - (f64::from(y) - 59.5) * sin);
    image::ImageBuffer::from_fn(160, 120, |x, y| image::Luma([at(x, y)])).save(path).unwrap();
}

/// From 0 to 1 over an edge blurred to a logistic profile of width 0.6 pixel: its modulation is `u / sinh u` with `u = 2 pi^2 0.6 f`.
fn rise(distance: f64) -> f64 {
    1.0 / (1.0 + (-distance / 0.6).exp())
}

#[test]
fn mtf_of_an_edge_is_printed_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let edge = folder.path().join("edge.png");
    write_edge(&edge, |d| (1000.0 + 20_000.0 * rise(d)).round() as u16);
    let sidecar = "black_level_dn = 500.0\nwhite_level_dn = 65535.0\npixel_um = 2.0\ncfa = \"mono\"\n";
    std::fs::write(folder.path().join("edge.png.toml"), sidecar).unwrap();
    let region = ["--region", "20,40,80,80"];
    let args = [&["raw", "mtf", "edge.png", "--out", "found"], &region[..]].concat();
    let text = run_ok(folder.path(), &args).stdout;
    for words in
        ["digital numbers above black, linear", "20,40,80,80", "upright 5.0°", "MTF50, 1/mm", "found/mtf.svg"]
    {
        assert!(text.contains(words), "{words}\n{text}");
    }
    let json: serde_json::Value = serde_json::from_str(&read(&folder.path().join("found/mtf.json"))).unwrap();
    let channel = &json["edges"][0]["channels"][0];
    let wanted = |f: f64| {
        let u = 2.0 * std::f64::consts::PI.powi(2) * 0.6 * f;
        if u == 0.0 { 1.0 } else { u / u.sinh() }
    };
    assert!((channel["mtf_at_half_nyquist"].as_f64().unwrap() - wanted(0.25)).abs() < 0.01, "{channel}");
    assert!((channel["levels"][0].as_f64().unwrap() - 500.0).abs() < 5.0, "black is subtracted: {channel}");
    // The curves: a line a frequency, in cycles per pixel and per mm.
    let csv = read(&folder.path().join("found/mtf.csv"));
    let mut lines = csv.lines();
    let head = "row_px,col_px,height_px,width_px,channel,frequency_cycles_per_px,frequency_cycles_per_mm,modulation,standard_error";
    assert_eq!(lines.next(), Some(head));
    assert_eq!(lines.clone().count(), 101);
    for line in lines.take(50) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |i: usize| cells[i].parse::<f64>().unwrap();
        assert!(
            (number(6) - 500.0 * number(5)).abs() < 1e-9 && (number(7) - wanted(number(5))).abs() < 0.01,
            "{line}"
        );
    }
    // Found without a region; results are not overwritten; as a picture the curve of sRGB is undone, and the response is another.
    let found = run_ok(folder.path(), &["raw", "mtf", "edge.png", "--json"]).json();
    let half =
        |json: &serde_json::Value| json["edges"][0]["channels"][0]["mtf_at_half_nyquist"].as_f64().unwrap();
    assert!((half(&found) - wanted(0.25)).abs() < 0.01, "{found}");
    run_fails(folder.path(), &args, 2, &["exists already", "--force"]);
    let picture =
        run_ok(folder.path(), &[&["raw", "mtf", "edge.png", "--picture", "--json"], &region[..]].concat())
            .json();
    assert_eq!(picture["light"], "srgb-undone");
    // A dead column is left out, so that no light counts as cut off.
    let mut dead = image::open(&edge).unwrap().into_luma16();
    (0..120).for_each(|y| dead.put_pixel(60, y, image::Luma([0])));
    dead.save(folder.path().join("dead.png")).unwrap();
    std::fs::write(folder.path().join("dead.png.toml"), sidecar).unwrap();
    let run = run_ok(folder.path(), &[&["raw", "mtf", "dead.png"], &region[..]].concat());
    assert!(run.says("80 pixels that do not fit the profile are left out"), "{}", run.stderr);
    assert!(!run.says("the least value"), "{}", run.stderr);
    // A gray picture, encoded: undone, it has the response of its light.
    write_edge(&folder.path().join("shown.png"), |d| {
        let light = 0.05 + 0.6 * rise(d);
        (65535.0 * (1.055 * light.powf(1.0 / 2.4) - 0.055)).round() as u16
    });
    let picture =
        run_ok(folder.path(), &[&["raw", "mtf", "shown.png", "--picture", "--json"], &region[..]].concat())
            .json();
    assert!((half(&picture) - wanted(0.25)).abs() < 0.01, "{picture}");
}

#[test]
fn an_mtf_that_cannot_be_measured_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_edge(&folder.path().join("edge.png"), |d| (1000.0 + 20_000.0 * rise(d)).round() as u16);
    write_edge(&folder.path().join("flat.png"), |_| 1000);
    write_edge(&folder.path().join("clip.png"), |d| {
        (1000.0 + 40_000.0 * rise(d)).min(32_000.0).round() as u16
    });
    for (args, needles) in [
        (&["flat.png"][..], ["flat.png: no slanted edge was found", "--region ROW,COL,HEIGHT,WIDTH"]),
        (
            &["clip.png"],
            ["clip.png: no slanted edge was found that can be measured", "the bright side is clipped"],
        ),
        (&["flat.png", "--region", "0,0,60,60"], ["--region 0,0,60,60: clear: no edge", "5 degrees"]),
        (
            &["edge.png", "--region", "100,0,60,60"],
            ["the frame has 120 rows and 160 columns", "counted from 0"],
        ),
        (&["edge.png", "--region", "20,40,80"], ["20,40,80", "ROW,COL,HEIGHT,WIDTH"]),
        (&["edge.png", "--region", "20,40,8,80"], ["--region 20,40,8,80", "at least 16"]),
        (&["edge.png", "--pixel-um", "0"], ["--pixel-um 0: must lie between 0.1 and 1000", "um"]),
        (
            &["edge.png", "--cfa", "RRGG/RRGG/GGBB/GGBB"],
            [
                "the mosaic RRGG/RRGG/GGBB/GGBB is not measured",
                "average each 2 x 2 pixels of one colour into one pixel, state cfa = \"RGGB\"",
            ],
        ),
        (
            &["edge.png", "--cfa", "RGBG/GRGB/BGRG/GBGR"],
            ["the mosaic RGBG/GRGB/BGRG/GBGR is not measured", "write one pixel of each tile of 4 x 4"],
        ),
        (
            &["edge.png", "--picture", "--cfa", "RGGB"],
            ["--cfa RGGB: a picture has no mosaic", "leave it out"],
        ),
        (&["nowhere.png"], ["nowhere.png", "No such file"]),
    ] {
        run_fails(folder.path(), &[&["raw", "mtf"], args].concat(), 2, &needles);
    }
}

/// Near the upper end of a tall sensor, 3.4 mm from the axis, the MTF at 0.25 cycles per pixel is 0.42 with one sample a pixel, 0.55 with 4 x 4 and 0.56
/// with 8 x 8.
#[test]
fn a_scene_of_an_edge_is_drawn_more_finely_than_the_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = read(&data("sensors/imx249-fitted.toml")).replace("width = 1920", "width = 240");
    std::fs::write(folder.path().join("tall.toml"), sensor).unwrap();
    let modulation = |out: &str, more: &[&str]| {
        let scene =
            ["simulate", "scene:slanted-edge", "--qe", "imx219", "--bands", "4", "--sensor", "tall.toml"];
        let taken = run_ok(folder.path(), &[&scene[..], &["--out", out], more].concat());
        assert!(!taken.says("one sample a pixel"), "{}", taken.stderr);
        let raw = format!("{out}/slanted-edge-raw.tiff");
        let found = run_ok(folder.path(), &["raw", "mtf", &raw, "--region", "24,120,96,96", "--json"]).json();
        let channels = found["edges"][0]["channels"].as_array().unwrap().clone();
        let green = channels.iter().find(|channel| channel["channel"] == "green").unwrap();
        green["mtf_at_half_nyquist"].as_f64().unwrap()
    };
    let usual = modulation("usual", &[]);
    assert!((usual - 0.559).abs() < 0.05, "{usual}");
    let coarse = modulation("coarse", &["--samples", "1"]);
    assert!(coarse < usual - 0.08, "{coarse} {usual}");
}
