//! Bad input: exit code 2, a message with file, line, key, value and hint, and nothing left behind.

use std::path::Path;

use crate::common::{self, *};

/// A changed text with the message that it must give.
struct Case {
    from: &'static str,
    to: &'static str,
    needles: &'static [&'static str],
}

const fn case(from: &'static str, to: &'static str, needles: &'static [&'static str]) -> Case {
    Case { from, to, needles }
}

/// Writes `text`, changed as the case says, to `file`; returns `FILE:LINE:` of the first change.
fn write_changed(folder: &Path, file: &str, text: &str, case: &Case) -> String {
    let at = text.find(case.from).unwrap_or_else(|| panic!("{:?} is not in the file", case.from));
    // Find the first line that the change touches.
    let kept = case.from.bytes().zip(case.to.bytes()).take_while(|(a, b)| a == b).count();
    let line = text[..at].matches('\n').count() + case.to[..kept].matches('\n').count() + 1;
    std::fs::write(folder.join(file), text.replacen(case.from, case.to, 1)).unwrap();
    format!("{file}:{line}:")
}

#[test]
fn experiments() {
    let text = tiny_experiment();
    for case in [
        case(
            "batch = 1",
            "batchsize = 1",
            &["`batchsize = 1`", "no such key", "help: did you mean `batch`?"],
        ),
        case("white_e = ", "white = ", &["`white = 16000.0`", "no such key", "did you mean `white_e`?"]),
        case("l1_weight = ", "l1_wieght = ", &["no such key", "help: did you mean `l1_weight`?"]),
        case("batch = 1", "batch = 0", &["`batch = 0`", "must lie between 1 and 1024", "help: 2 to 8"]),
        case(
            "places_per_side = 1\n",
            "places_per_side = 1\nscores = [\"ssim\", \"psnr\"]\n",
            &[
                "`scores = \"psnr\"`: `psnr` is no score of pictures",
                "did you mean \"psnr_db\"?",
                "scores of pictures are one_minus_lpips, psnr_db, ssim",
            ],
        ),
        case(
            "name = \"nominal\"",
            "name = \"scene\"",
            &["`scene` is no name for a camera", "give it another name"],
        ),
        case("name = \"spot-optimised\"", "name = \"Nominal\"", &["`Nominal` and `nominal` are one folder"]),
        case(
            "batch = 1",
            "batch = -1",
            &["`batch = -1`: expected a number from 0", "help: write a whole number"],
        ),
        case(
            "batch = 1",
            "batch = \"one\"",
            &["`batch = \"one\"`: expected a number from 0", "found a text", "help: write a whole number"],
        ),
        case(
            "batch = 1",
            "batch = 99999999999999999999",
            &["must lie between 0 and 9223372036854775807", "help: write a smaller whole number"],
        ),
        case("batch = 1", "batch = 1.5", &["`batch = 1.5`", "without a decimal point, found a number with"]),
        case(
            "time_s = 0.005",
            "time_s = \"5 ms\"",
            &["`time_s = \"5 ms\"`: expected a number, found a text", "help: write a number without quotes"],
        ),
        case("\"built-in\"", "[\"a\"]", &["`photos = [\"a\"]`: expected text in quotes, found a list"]),
        case(
            "patches = [2, 2]",
            "patches = [2]",
            &["expected a list of 2 values, found 1", "help: write as many values"],
        ),
        case(
            "pupil_cells = 16",
            "pupil_cells = 17",
            &["`pupil_cells = 17`", "must be even", "help: take 18"],
        ),
        case("0.55", "550", &["wavelengths_um", "550", "help: wavelengths are in um: 550 nm is 0.55"]),
        case("time_s = 0.005", "time_s = nan", &["`time_s = nan`", "must lie between", "5 ms is 0.005"]),
        case("moving_share = ", "moving_share = 1", &["moving_share", "must lie between 0 and 1", "help:"]),
        case(
            "task = \"image-quality\"",
            "task = \"racing\"",
            &["`task = \"racing\"`: `racing` is no task", "tasks are image-quality, objects"],
        ),
        case(
            "noise = \"dequantised\"",
            "noise = \"pink\"",
            &["`noise = \"pink\"`: no such value", "\"dequantised\""],
        ),
        case(
            "task = \"image-quality\"",
            "task = 3",
            &["`task = 3`: expected text in quotes", "help: put the value in quotes"],
        ),
        case(
            "seed = 1\n",
            "seed = 1\nreading.memory_mb = 0\n",
            &["`memory_mb = 0`", "must lie between 64", "help: 1024 MB"],
        ),
        case("seed = 1", "seed = = 1", &["seed"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let place = write_changed(folder.path(), "bad.toml", &text, &case);
        let args = ["design", "bad.toml", "--out", "run"];
        run_fails(folder.path(), &args, 2, &[&[place.as_str()], case.needles].concat());
    }
}

#[test]
fn a_misspelled_header_is_suspected_where_the_reader_stumbles() {
    let text = tiny_experiment();
    let before = text.split("[[variant]]").next().unwrap();
    let staged = format!(
        "{before}[[variant]]\nname = \"a\"\n[[variant.stge]]\nmoves = [\"network\"]\n[variant.stage.schedule.network]\nsteps = 3\n"
    );
    for (text, needles) in [
        (
            text.replacen("[[variant]]", "[[varant]]", 1),
            ["`varant`: no such key here", "help: did you mean `variant`?"],
        ),
        (staged, ["`stge`: no such key here", "help: did you mean `stage`?"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("bad.toml"), text).unwrap();
        run_fails(folder.path(), &["design", "bad.toml", "--out", "run"], 2, &needles);
    }
}

/// A loss without weight has no gradient, and a negative one the wrong one.
#[test]
fn losses() {
    let text = tiny_experiment();
    for case in [
        case("l1_weight = 1.0", "l1_weight = -1.0", &["`l1_weight = -1.0`", "help:"]),
        case("lpips_weight = 0.5", "lpips_weight = nan", &["`lpips_weight = nan`", "help:"]),
        case("lpips_weight = 0.5", "ssim_weight = -0.5", &["`ssim_weight = -0.5`", "help:"]),
        case("l1_weight = 1.0\nlpips_weight = 0.5", "l1_weight = 0.0\nlpips_weight = 0.0", &["l1_weight"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let place = write_changed(folder.path(), "bad.toml", &text, &case);
        let args = ["design", "bad.toml", "--out", "run"];
        run_fails(folder.path(), &args, 2, &[&[place.as_str()], case.needles].concat());
    }
}

/// What an experiment names must be there, and fit.
#[test]
fn experiments_that_do_not_fit_together() {
    let text = tiny_experiment();
    for case in [
        case(
            "\"cooke-triplet-nominal\"",
            "\"no-such\"",
            &["bad.toml:1:", "`lens = \"no-such\"`", "neither a file nor built in", "cooke-triplet-nominal"],
        ),
        case(
            "\"imx249-fitted\"",
            "\"imx249-fited\"",
            &["`sensor = \"imx249-fited\"`", "did you mean \"imx249-fitted\"?"],
        ),
        case(
            "\"built-in\"",
            "\"nowhere\"",
            &["`photos = \"nowhere\"`", "neither a file nor built in", "a folder of pictures"],
        ),
        case(
            "crop = 64",
            "crop = 1000",
            &[".png", "cannot hold a window", "the larger of `training.crop` and `scoring.crop` counts"],
        ),
        case("grid = 64\n", "grid = 1024\n", &["cannot hold a window"]),
        case(
            "white_e = 16000.0",
            "white_e = 30000.0",
            &[
                "bad.toml:",
                "`exposure.white_e = 30000`",
                "saturates at 28",
                "linear gain 1",
                "help: give less",
            ],
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        write_changed(folder.path(), "bad.toml", &text, &case);
        run_fails(folder.path(), &["design", "bad.toml", "--out", "run"], 2, case.needles);
    }
    // A monochrome sensor: its array first, then what it cannot see.
    let mono = text.replace("\"imx249-fitted\"", "\"imx250-mono\"");
    let bilinear = mono.replace("\"menon\"", "\"bilinear\"");
    for (name, text, needles) in [
        ("mono.toml", &mono, &["a Bayer array for menon", "help: write \"bilinear\""][..]),
        (
            "bilinear.toml",
            &bilinear,
            &["is monochrome", "photographs are in colour", "help: name a sensor with colour filters"],
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(name), text).unwrap();
        run_fails(folder.path(), &["design", name, "--out", "run"], 2, needles);
    }
    // A PSF wider than the renderer takes.
    let folder = tempfile::tempdir().unwrap();
    let wide = text.replace("pitch_um = 1.0", "pitch_um = 50.0").replace("grid = 64", "grid = 1024");
    std::fs::write(folder.path().join("wide.toml"), wide).unwrap();
    let needles = ["imx249-fitted: the PSF grid reaches 6176 pixels", "help: the experiment's psf.grid"];
    run_fails(folder.path(), &["design", "wide.toml", "--out", "run"], 2, &needles);
}

#[test]
fn lenses() {
    let text = read(&data("lenses/cooke-triplet-nominal.toml"));
    for case in [
        case(
            "radius_mm = 11.34",
            "radius_um = 11340",
            &["`radius_um = 11340`", "convert from um to mm", "`radius_mm`"],
        ),
        case(
            "thickness_mm = 4.014",
            "thicknes_mm = 4.014",
            &["`thicknes_mm = 4.014`", "did you mean `thickness_mm`?"],
        ),
        case("units = \"mm\"", "units = \"inch\"", &["units", "\"inch\"", "help: convert to mm"]),
        case(
            "thickness_mm = 3.0",
            "thickness_mm = -3.0",
            &["`thickness_mm = -3.0`", "surface 3", "help: it is at least 0"],
        ),
        case(
            "thickness_mm = 2.698",
            "thickness_mm = 0.5",
            &["`thickness_mm = 0.5`", "edge thickness of PMMA is -", "help: raise the thickness"],
        ),
        case("radius_mm = 11.34", "radius_mm = 0", &["radius_mm", "0", "help:"]),
        case("radius_mm = 11.34", "radius_mm = nan", &["radius_mm", "nan"]),
        case("glass = \"N-SF11\"", "glass = \"N-SF111\"", &["glass", "N-SF111", "N-SF11"]),
        case("um = [0.486, 0.55", "um = [486, 0.55", &["486", "0.486"]),
        case(
            "entrance_pupil_diameter_mm = 5.7",
            "entrance_pupil_diameter_mm = -5.7",
            &["`entrance_pupil_diameter_mm = -5.7`", "positive"],
        ),
        case(
            "semi_diameter_mm = 7.733",
            "semi_diameter_mm = 12.0",
            &["`semi_diameter_mm = 12.0`", "help: lower the semi-diameter"],
        ),
        case("semi_diameter_mm = 4.161", "semi_diameter_mm = \"4\"", &["semi_diameter_mm", "\"4\""]),
        case("[aperture]", "[apertur]", &["apertur", "did you mean `aperture`?"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let place = write_changed(folder.path(), "bad.toml", &text, &case);
        let needles = [&[place.as_str()], case.needles].concat();
        run_fails(folder.path(), &["lens", "show", "bad.toml"], 2, &needles);
        run_fails(folder.path(), &["psf", "bad.toml", "--out", "psf"], 2, &needles);
    }
}

#[test]
fn an_impossible_lens_stops_a_design_before_it_starts() {
    let folder = tempfile::tempdir().unwrap();
    let lens = read(&data("lenses/cooke-triplet-nominal.toml"));
    let change = case("thickness_mm = 2.698", "thickness_mm = 0.5", &[]);
    let place = write_changed(folder.path(), "bad.toml", &lens, &change);
    let text = tiny_experiment().replace("\"cooke-triplet-nominal\"", "\"bad.toml\"");
    std::fs::write(folder.path().join("tiny.toml"), text).unwrap();
    let args = ["design", "tiny.toml", "--out", "run"];
    run_fails(folder.path(), &args, 2, &[&place, "edge thickness", "help: raise the thickness"]);
}

/// A possible lens through which no ray passes.
#[test]
fn a_lens_without_light() {
    let folder = tempfile::tempdir().unwrap();
    let lens = read(&data("lenses/cooke-triplet-nominal.toml"));
    // A pinhole in front of the stop, through which no light reaches the stop.
    let dark = lens.replacen("semi_diameter_mm = 6.415", "semi_diameter_mm = 0.01", 1);
    assert_ne!(dark, lens);
    std::fs::write(folder.path().join("dark.toml"), dark).unwrap();
    let needles = ["dark.toml", "no ray reaches the image", "help:"];
    run_fails(folder.path(), &["lens", "show", "dark.toml"], 2, &needles);
    let needles = ["no light reaches the image", "help:"];
    run_fails(folder.path(), &["psf", "dark.toml", "--out", "psf"], 2, &needles);
    // A grid on which waves would need more nodes of the pupil than there are.
    let args = ["--kind", "diffraction", "--grid", "1024", "--pitch-um", "4", "--out", "psf"];
    let needles = ["no light reaches the image", "help: waves may need a smaller grid than 4096 um"];
    run_fails(folder.path(), &[&["psf", "cooke-triplet-nominal"], &args[..]].concat(), 2, &needles);
    let text = tiny_experiment().replace("\"cooke-triplet-nominal\"", "\"dark.toml\"");
    std::fs::write(folder.path().join("tiny.toml"), text).unwrap();
    let needles = ["dark.toml: no light reaches the image", "help: `petzval lens show`"];
    run_fails(folder.path(), &["design", "tiny.toml", "--out", "run"], 2, &needles);

    // A hole that takes the light of the corner alone: the ray through the middle of the stop passes surface 2 there 3.8 mm from the axis.
    let vignetted = lens.replacen("semi_diameter_mm = 6.415", "semi_diameter_mm = 1.0", 1);
    std::fs::write(folder.path().join("dark.toml"), vignetted).unwrap();
    let lost = "degrees: the ray through the middle of the stop is clipped at surface 2";
    let needles = ["dark.toml: no light reaches the image at 1", lost, "help: `petzval lens show`"];
    run_fails(folder.path(), &["design", "tiny.toml", "--out", "run"], 2, &needles);
    run_fails(folder.path(), &["design", "tiny.toml", "--check"], 2, &needles);
    let photo = data("photos/coffee.png").display().to_string();
    let needles = ["no light reaches the image at 1", lost, "help: let the light through there"];
    run_fails(folder.path(), &["simulate", &photo, "--lens", "dark.toml", "--out", "taken"], 2, &needles);
    let lost = "at 15 degrees no ray reaches the image: the ray through the middle of the stop is clipped at surface 2";
    run_fails(folder.path(), &["lens", "focus", "dark.toml", "near.toml"], 2, &[lost, "help:"]);

    // An image plane far out of focus leaves nothing to optimise from.
    let blurred = lens.replacen("thickness_mm = 24.525171110552694", "thickness_mm = 27.0", 1);
    assert_ne!(blurred, lens);
    std::fs::write(folder.path().join("dark.toml"), blurred).unwrap();
    let needles = ["dark.toml: the image plane is", "from the paraxial focus", "help: correct the lens file"];
    run_fails(folder.path(), &["design", "tiny.toml", "--out", "run"], 2, &needles);
}

#[test]
fn missing_files_and_folders() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_tiny(here);
    std::fs::create_dir(here.join("empty")).unwrap();
    std::fs::write(here.join("noise.toml"), [0xff, 0xfe, 0x00, 0x80]).unwrap();
    for (args, needles) in [
        (
            &["lens", "show", "nowhere.toml"][..],
            &["no lens called `nowhere.toml`", "cooke-triplet-nominal"][..],
        ),
        (
            &["lens", "show", "noise.toml"],
            &["noise.toml: cannot be read: this is not text in UTF-8", "help:"],
        ),
        (&["lens", "show", "empty"], &["no lens called `empty`"]),
        (
            &["design", "nowhere.toml", "--out", "run"],
            &["no experiment called `nowhere.toml`", "cooke-triplet-image-quality"],
        ),
        (
            &["design", "noise.toml", "--out", "run"],
            &["noise.toml: cannot be read: this is not text in UTF-8", "help:"],
        ),
        (
            &["design", "tiny.toml", "--photos", "nowhere", "--out", "run"],
            &["nowhere: No such file", "help:"],
        ),
        (
            &["design", "tiny.toml", "--steps", "0", "--out", "run"],
            &["--steps 0: must lie between 1 and 1e7", "help:"],
        ),
        (
            &["design", "tiny.toml", "--steps", "99999999999", "--out", "run"],
            &["--steps 99999999999", "help:"],
        ),
        (
            &["design", "tiny.toml", "--device", "abacus", "--out", "run"],
            &["--device abacus", "this build has cpu"],
        ),
        (&["design", "--resume", "nowhere"], &["nowhere: not a run folder", "no such folder"]),
        (&["design", "--resume", "empty"], &["empty: not a run folder", "config.toml"]),
        (&["design", "--resume", "empty", "--out", "run"], &["--resume", "cannot be used with"]),
        (&["report", "empty"], &["empty: not a run folder"]),
        (&["evaluate", "nowhere"], &["nowhere: not a run folder"]),
    ] {
        run_fails(here, args, 2, needles);
    }
}

#[test]
fn photographs() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_tiny(here);
    let coffee = data("photos/coffee.png");
    for name in ["empty", "one", "broken", "small", "same"] {
        std::fs::create_dir(here.join(name)).unwrap();
    }
    std::fs::copy(&coffee, here.join("one/a.png")).unwrap();
    std::fs::copy(&coffee, here.join("broken/a.png")).unwrap();
    std::fs::write(here.join("broken/b.png"), &std::fs::read(&coffee).unwrap()[..1000]).unwrap();
    for name in ["a.png", "b.png"] {
        image::RgbImage::from_fn(40, 50, |x, y| image::Rgb([x as u8, y as u8, name.as_bytes()[0]]))
            .save(here.join("small").join(name))
            .unwrap();
        std::fs::copy(&coffee, here.join("same").join(name)).unwrap();
    }
    for (photos, needles) in [
        ("empty", &["empty: no PNG", "name a folder of pictures"][..]),
        ("one", &["one: only one picture", "help: at least two are needed"]),
        ("broken", &["broken/b.png: cannot decode", "use an undamaged PNG"]),
        (
            "small",
            &[
                "a.png: 40 x 50 pixels cannot hold a window",
                "the larger of `training.crop` and `scoring.crop` counts",
            ],
        ),
        ("same", &["b.png", "a.png", "same picture"]),
        (
            "tiny.toml",
            &["tiny.toml line 1: ", "is no file that can be read", "help: one path of a picture a line"],
        ),
    ] {
        run_fails(here, &["design", "tiny.toml", "--photos", photos, "--out", "run"], 2, needles);
    }
}

/// A few bad pictures among good ones do not end a run.
#[test]
fn bad_photographs_are_skipped_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_tiny(here);
    std::fs::create_dir(here.join("mine")).unwrap();
    for photo in ["astronaut.png", "chelsea.png", "coffee.png"] {
        std::fs::copy(data("photos").join(photo), here.join("mine").join(photo)).unwrap();
    }
    let coffee = std::fs::read(data("photos/coffee.png")).unwrap();
    std::fs::write(here.join("mine/b.png"), &coffee[..1000]).unwrap();
    std::fs::write(here.join("mine/copy.png"), &coffee).unwrap();
    image::RgbImage::new(40, 50).save(here.join("mine/small.png")).unwrap();
    // A colour profile that is not obeyed.
    for photo in ["astronaut.png", "chelsea.png"] {
        let picture = image::open(data("photos").join(photo)).unwrap().into_rgb8();
        let file = std::fs::File::create(here.join("mine").join(photo)).unwrap();
        let mut encoder = image::codecs::png::PngEncoder::new(file);
        image::ImageEncoder::set_icc_profile(&mut encoder, vec![7; 300]).unwrap();
        picture.write_with_encoder(encoder).unwrap();
    }
    let done = run_ok(here, &["design", "tiny.toml", "--photos", "mine", "--steps", "1", "--out", "run"]);
    for needle in [
        "warning: 3 of 6 pictures cannot be used and are skipped; the first: ",
        "mine/b.png: cannot decode the picture",
        "training pictures (2): astronaut.png, chelsea.png",
        "held-out pictures (1): coffee.png",
        "skipped pictures (3): b.png, small.png, copy.png",
        "warning: astronaut.png and another picture: its ICC profile (that cannot be read) is ignored",
    ] {
        assert!(done.says(needle), "{needle}: {}", done.stderr);
    }
    assert_eq!(read_json(&here.join("run/metrics.json"))["held_out_images"], 1);
}

/// What makes a comparison doubtful is said before the first step.
#[test]
fn comparisons_that_are_not_like_for_like_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let lens = read(&data("lenses/cooke-triplet-nominal.toml"));
    let solve = lens.lines().find(|line| line.starts_with("efl = ")).unwrap();
    std::fs::write(folder.path().join("free.toml"), lens.replace("[solve]\n", "").replace(solve, ""))
        .unwrap();
    let text = tiny_experiment().replace("\"cooke-triplet-nominal\"", "\"free.toml\"");
    let text = text.replacen("white_e = 16000.0", "white_e = 25000.0", 1);
    let text = text.replacen("moves = [\"network\"]", "moves = [\"network\"]\nschedule.network.steps = 2", 1);
    std::fs::write(folder.path().join("mine.toml"), text).unwrap();
    let run = run_ok(folder.path(), &["design", "mine.toml", "--out", "run"]);
    for needle in [
        "it has no focal-length solve",
        "[solve] efl = { surface = 7, efl_mm = 25.0400 }",
        "not like for like: the variants get different numbers of network steps (nominal 2, spot-optimised 4, end-to-end 4)",
        "white gives blue pixels 31250 e-, and they saturate at 28",
    ] {
        assert!(run.says(needle), "{needle}: {}", run.stderr);
    }
    let html = read(&folder.path().join("run/report.html"));
    assert!(
        html.contains("Not like for like: end-to-end differs from nominal")
            && html.contains("4 steps, not 2")
    );
}

#[test]
fn a_folder_that_cannot_be_made() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let design = |out, needle| {
        run_fails(folder.path(), &["design", "tiny.toml", "--out", out], 2, &[out, needle]);
    };
    design("tiny.toml", "give a folder");
    design("tiny.toml/run", "tiny.toml is no folder");
}

/// A run that was interrupted in its last score: its last checkpoint is that of the step before, the last one of a stage.
fn interrupted(folder: &Path) {
    let run = folder.join("whole");
    std::fs::rename(finished_run(folder), &run).unwrap();
    for gone in ["metrics.json", "report.html"] {
        std::fs::remove_file(run.join(gone)).unwrap();
    }
    std::fs::remove_dir_all(run.join(format!("checkpoints/step-{ALL_STEPS:06}"))).unwrap();
    assert!(run.join(CHECKPOINT).is_dir());
}

const CHECKPOINT: &str = "checkpoints/step-000020";

/// Resumes a copy of the run in which one file was changed; it must be refused with a message that names the file.
fn refuses(folder: &Path, file: &str, change: impl FnOnce(&[u8]) -> Option<Vec<u8>>) {
    let run = folder.join("run");
    let _ = std::fs::remove_dir_all(&run);
    copy_folder(&folder.join("whole"), &run);
    let path = run.join(file);
    match change(&std::fs::read(&path).unwrap()) {
        Some(contents) => std::fs::write(&path, contents).unwrap(),
        None => std::fs::remove_file(&path).unwrap(),
    }
    let before = snapshot(&run);
    let refused = common::run(folder, &["design", "--resume", "run"]);
    assert!(matches!(refused.code, Some(1 | 2)), "{file}: {:?}\n{}", refused.code, refused.stderr);
    let name = Path::new(file).file_name().unwrap().to_str().unwrap();
    assert!(refused.says(name), "{file} is not named:\n{}", refused.stderr);
    assert_same_files(&before, &snapshot(&run));
}

#[test]
fn a_damaged_experiment_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    interrupted(folder.path());
    let edit = |from: &'static str, to: &'static str| {
        move |text: &[u8]| Some(String::from_utf8_lossy(text).replacen(from, to, 1).into_bytes())
    };
    refuses(folder.path(), "config.toml", |_| Some(b"{{{".to_vec()));
    refuses(folder.path(), "config.toml", |_| Some(vec![0xff; 100]));
    refuses(folder.path(), "config.toml", |text| Some(text[..text.len() / 2].to_vec()));
    refuses(folder.path(), "config.toml", edit("batch = 1", "batch = 0"));
    refuses(folder.path(), "config.toml", |_| None);
    // A missing key would take its default, and the run would continue with another experiment.
    refuses(folder.path(), "config.toml", edit("batch = 1\n", ""));
    refuses(folder.path(), "config.toml", |_| Some(Vec::new()));
}

#[test]
fn a_damaged_checkpoint_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    interrupted(folder.path());
    for file in [
        "position.json",
        "blocks/network/weights.bin",
        "blocks/network/optimizer.bin",
        "blocks/optics/coordinates.json",
    ] {
        let file = format!("{CHECKPOINT}/{file}");
        refuses(folder.path(), &file, |_| Some(b"{{{".to_vec()));
        refuses(folder.path(), &file, |_| Some(Vec::new()));
        refuses(folder.path(), &file, |whole| Some(whole[..whole.len() / 2].to_vec()));
        refuses(folder.path(), &file, |_| None);
    }
}

/// A well-formed but impossible position: the run must not continue from it.
#[test]
fn an_impossible_position_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    interrupted(folder.path());
    let file = format!("{CHECKPOINT}/position.json");
    let edit = |change: fn(&mut serde_json::Value)| {
        move |text: &[u8]| {
            let mut position = serde_json::from_slice(text).unwrap();
            change(&mut position);
            Some(position.to_string().into_bytes())
        }
    };
    refuses(folder.path(), &file, edit(|p| p["variant"] = "nobody".into()));
    refuses(folder.path(), &file, edit(|p| p["stage"] = 99.into()));
    refuses(folder.path(), &file, edit(|p| p["taken"]["network"] = 99.into()));
    refuses(folder.path(), &file, edit(|p| p["step"] = 3.into()));
    let file = format!("{CHECKPOINT}/blocks/optics/coordinates.json");
    refuses(folder.path(), &file, edit(|p| *p = serde_json::json!([0.0])));
    let file = format!("{CHECKPOINT}/blocks/optics/progress.json");
    refuses(folder.path(), &file, edit(|p| p["anchor"] = serde_json::json!([0.0])));
    refuses(folder.path(), &file, edit(|p| p["adam"]["first"] = serde_json::json!([0.0])));
}

#[test]
fn results_need_a_folder_and_pictures_must_exist() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("taken"), "a file").unwrap();
    let lens = "cooke-triplet-nominal";
    run_fails(folder.path(), &["psf", lens, "--out", "taken"], 2, &["taken", "help:", "folder"]);
    run_fails(folder.path(), &["design", "--steps", "1", "--out", "taken"], 2, &["taken", "folder"]);
    run_fails(folder.path(), &["lens", "optimize", lens, "--out", "taken"], 2, &["taken", "help:", "folder"]);
    run_fails(
        folder.path(),
        &["simulate", "missing.png", "--out", "sim"],
        2,
        &["missing.png", "help:", "PNG"],
    );
}

#[test]
fn an_instruction_set_that_is_not_known_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let list = |value: &str| {
        let output = petzval(folder.path()).env("PETZVAL_SIMD", value).args(["lens", "list"]).output();
        outcome(output.expect("the command starts"))
    };
    assert_eq!(list("scalar").code, Some(0));
    for value in ["foo", "avx1024", "AVX2"] {
        let refused = list(value);
        assert_eq!(refused.code, Some(2));
        assert!(
            refused.says(&format!("PETZVAL_SIMD={value}: there is no")) && refused.says("avx2 or scalar")
        );
    }
}

/// Names that no file system holds are refused before hours of work, and long lines are cut.
#[test]
fn names_that_are_too_long_fail_first() {
    let folder = tempfile::tempdir().unwrap();
    write_tiny(folder.path());
    let long = "x".repeat(300);
    run_fails(folder.path(), &["design", "tiny.toml", "--out", &long], 2, &["300 bytes is too long"]);
    run_fails(
        folder.path(),
        &["lens", "analyze", "cooke-triplet-nominal", "--out", &long],
        2,
        &["300 bytes is too long"],
    );
    let text = read(&folder.path().join("tiny.toml"));
    let text = text.replacen("name = \"end-to-end\"", &format!("name = \"{}\"", "e".repeat(120)), 1);
    std::fs::write(folder.path().join("long.toml"), text).unwrap();
    run_fails(
        folder.path(),
        &["design", "long.toml", "--out", "run"],
        2,
        &["name has 120 letters", "at most 100"],
    );
}

#[test]
fn lines_of_messages_are_cut() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{} = 3\n", "k".repeat(50_000));
    std::fs::write(folder.path().join("bad.toml"), text).unwrap();
    for args in [
        &["design", "bad.toml", "--out", "run"][..],
        &["lens", "show", &"y".repeat(20_000)],
        &["lens", "show", "bad.toml"],
    ] {
        let refused = run(folder.path(), args);
        assert_eq!(refused.code, Some(2), "{}", refused.stderr);
        let longest = refused.stderr.lines().map(|line| line.chars().count()).max().unwrap();
        assert!(longest < 1200, "{longest} characters");
    }
}
