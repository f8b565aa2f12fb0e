//! The report of a small simulated series.

use petzval_camera::image::LinearImage;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, Exposure, Noise, NoiseMode, expose};
use petzval_files::raw_file::{RawFormat, RawFrame, save_raw};
use petzval_lab::emva::{Captures, Options, characterize};

use std::path::Path;

use super::*;

/// Flat and dark pairs at two gains and three exposures, dark pairs at two more, and stacks, of a sensor of 48 x 64 pixels.
fn series(folder: &Path, fit_histograms: bool) -> Characterization {
    let mut sensor =
        petzval_files::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml"))
            .unwrap();
    (sensor.height, sensor.width) = (48, 64);
    let mut list = "[sensor]\nname = \"Sony IMX249 <simulated> & \\\"small\\\"\"\nbits = 12\npixel_um = 5.86\ncfa = \"RGGB\"\n\
                    black_level_dn = 119.0\nfull_well_e = 33723.0\n"
        .to_owned();
    let mut number = 0;
    let mut take = |kind: &str, gain: f32, time_s: f32, frames: usize| {
        let light = LinearImage::filled(3, 48, 64, if kind == "flat" { 1.0 } else { 0.0 });
        let exposure = Exposure { white_e: 4e5 * time_s, time_s, linear_gain: gain };
        let mut names = Vec::new();
        for _ in 0..frames {
            let capture = Capture { exposure, placement: Placement { row: 0, col: 0 }, frame: number };
            let noise = Noise { mode: NoiseMode::Exact, seed: 7 };
            let raw = expose(&light, &sensor, &capture, &noise).unwrap();
            let name = format!("{number}.tiff");
            save_raw(&RawFrame::from_raw(&raw, &sensor), &folder.join(&name), RawFormat::Tiff).unwrap();
            names.push(name);
            number += 1;
        }
        let photons = match kind {
            "flat" => format!("photons = {}\n", 6e5 * time_s),
            _ => String::new(),
        };
        list += &format!(
            "[[point]]\nkind = \"{kind}\"\nlinear_gain = {gain}\nexposure_ms = {}\n{photons}frames = {names:?}\n",
            1e3 * time_s
        );
    };
    for gain in [1.0, 2.0, 4.0] {
        for time_s in [0.0025, 0.005, 0.0075] {
            take("flat", gain, time_s, 2);
            take("dark", gain, time_s, 2);
        }
        take("dark", gain, 0.03, 2);
    }
    take("flat", 1.0, 0.005, 8);
    take("dark", 1.0, 0.005, 8);
    std::fs::write(folder.join("captures.toml"), list).unwrap();
    let captures = Captures::open(folder).unwrap();
    characterize(&captures, &Options { fit_histograms, ..Options::default() }, &|_| Ok(())).unwrap()
}

#[test]
fn every_picture_is_described_and_holds_its_points() {
    let folder = tempfile::tempdir().unwrap();
    let found = series(folder.path(), true);
    let names = picture_names(&found);
    assert_eq!(names.len(), 16, "{names:?}");
    let svg = |class: &str| sheets(&found).into_iter().find(|s| s.class == class).unwrap().svg();
    let count = |class: &str, what: &str| svg(class).matches(&format!("class=\"{what}\"")).count();
    // Three colours, with their lines.
    assert_eq!((count("sensitivity", "points"), count("sensitivity", "curve")), (3, 3));
    assert_eq!((count("photon-transfer", "points"), count("photon-transfer", "curve")), (3, 3));
    // Three gains in one frame; three panels of a series and a line each.
    assert_eq!((count("gain-fit", "points"), count("gain-fit", "curve")), (3, 3));
    assert_eq!((count("dark-variance", "points"), count("dark-variance", "curve")), (3, 3));
    // Three colours at three exposures; four exposures with linear and logarithmic counts.
    assert_eq!((count("histograms-flat", "steps"), count("histograms-flat", "curve")), (9, 9));
    assert_eq!((count("histograms-dark", "steps"), count("histograms-dark", "curve")), (8, 8));
    // Two directions, three colours, the temporal noise of each, and in the dark the noise of rounding.
    assert_eq!((count("spectrogram-dsnu", "curve"), count("spectrogram-prnu", "curve")), (14, 12));
    assert_eq!((count("defects", "steps"), count("defects-accumulated", "steps")), (6, 6));
    assert_eq!(count("profiles-prnu", "curve"), 8);
    for sheet in sheets(&found) {
        let svg = sheet.svg();
        assert!(svg.contains("role=\"img\"") && svg.contains("aria-label=\""), "{}", sheet.class);
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{}", sheet.class);
    }
}

#[test]
fn the_page_is_self_contained_and_states_values_with_their_errors() {
    let folder = tempfile::tempdir().unwrap();
    let found = series(folder.path(), true);
    let page = page(&found);
    crate::page::assert_readable(&page);
    assert!(page.contains("Sony IMX249 &lt;simulated&gt; &amp; "));
    assert_eq!(page.matches("<figure").count(), 16);
    let elsewhere = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!elsewhere.contains("http") && !elsewhere.contains("url(") && !elsewhere.contains("@import"));
    // The printed tables of the paper stand beside what was measured.
    for words in
        ["Table 5", "0.122", "33723 e⁻", "fit to histograms", "mean χ²/ν", "black level, as set", "PRNU"]
    {
        assert!(page.contains(words), "{words}");
    }
    // Each fit states its test.
    let fits = page.split("Goodness of the fits").last().unwrap();
    for fit in ["K over the gains", "dark mean over K", "dark variance over time", "histograms"] {
        assert!(fits.contains(fit), "{fit}");
    }
    assert!(fits.contains("level of 1e-4") && fits.contains("3 of 3 hold"), "{fits}");
    let gain = style::with_error(&found.joint.gain_dn_per_e).unwrap();
    assert!(gain.contains(" ± ") && page.contains(&gain), "{gain}");
    // Six figures with their errors and two plots stand in front of everything.
    let (front, rest) = page.split_once("<nav").unwrap();
    let figures = front.split("class=\"numbers\"").nth(1).unwrap().split("</dl>").next().unwrap();
    let count = figures.matches("<dd>").count();
    assert!((3..=6).contains(&count) && figures.matches(" ± ").count() == count, "{figures}");
    for name in ["quantum efficiency", "system gain", "temporal dark noise"] {
        assert!(figures.contains(name), "{name}: {figures}");
    }
    let classes = |part: &str| {
        ["photon-transfer", "snr"].map(|class| part.matches(&format!("class=\"{class}\"")).count())
    };
    assert_eq!((classes(front), front.matches("<figure").count()), ([1, 1], 2));
    assert_eq!(classes(rest), [0, 0]);
    assert!(front.contains("the green pixels"));
    // The sheet of the standard comes first; differing values of the library are folded away.
    let at = |words: &str| page.find(words).unwrap_or_else(|| panic!("{words}"));
    assert!(at("Plots of EMVA 1288") < at("Calibration over all gains"));
    assert!(at("Different values of the EMVA 1288 Python library") > at("<details>"));
    assert!(!page.contains("library:"));
}

#[test]
fn the_front_has_the_first_six_figures_that_are_resolved() {
    use petzval_lab::emva::{Measured, Unresolved};
    let folder = tempfile::tempdir().unwrap();
    let mut found = series(folder.path(), false);
    let mut set = |name: &str, value: Measured| {
        for channel in found.gains.iter_mut().flat_map(|gain| &mut gain.channels) {
            for figure in channel.figures.iter_mut().filter(|figure| figure.name == name) {
                (figure.value, figure.corrected) = (value, None);
            }
        }
    };
    for (name, value, error) in [
        ("QE", 67.123, 1.8),
        ("K", 0.13912, 0.0041),
        ("sigma_d", 7.812, 0.23),
        ("DR_dB", 61.7, 0.21),
        ("PRNU1288", 0.7123, 0.033),
        ("DSNU1288", 3.712, 0.12),
        ("u_e_min", 6.1, 0.2),
    ] {
        set(name, Measured::new(value, error));
    }
    // What is not resolved is no figure of the front, and the next ones take its place.
    set("u_e_sat", Measured::none(Unresolved::NoStack));
    let tiles = front::figures(&shown::Shown::choose(&found).unwrap());
    let texts: Vec<(String, &str)> =
        tiles.iter().map(|tile| (tile.value.replace('\u{a0}', " "), &*tile.label)).collect();
    let wanted = [
        ("67.1 ± 1.8 %", "quantum efficiency"),
        ("0.139 ± 0.004 DN/e⁻", "system gain"),
        ("7.8 ± 0.2 e⁻", "temporal dark noise"),
        ("61.7 ± 0.2 dB", "dynamic range"),
        ("0.71 ± 0.03 %", "PRNU"),
        ("3.71 ± 0.12 e⁻", "DSNU"),
    ];
    assert_eq!(texts, wanted.map(|(value, label)| (value.to_owned(), label)));
}

#[test]
fn defect_pixels_are_listed_with_what_they_do_to_the_figures() {
    use petzval_lab::emva::Measured;
    use petzval_lab::emva::defects::Defect;
    let folder = tempfile::tempdir().unwrap();
    let mut found = series(folder.path(), false);
    assert!(!page(&found).contains("Defect pixels"));
    // Sixty pixels that stay at 4095; with them the dark variance is a hundred times as large.
    for spatial in found.gains.iter_mut().flat_map(|gain| &mut gain.channels[0].spatial) {
        let defect = |i: usize| Defect { row: 1000 + i, column: 77, flat_dn: 4095.0, dark_dn: 4094.5 };
        spatial.defects = (0..60).map(defect).collect();
        let mut dark = spatial.dark_components;
        dark.total = Measured::new(2500.0, 1.0);
        spatial.components_with_defects = Some([dark, dark]);
        spatial.signal_bias = Some(-0.2);
    }
    let shown = shown::Shown::choose(&found).unwrap();
    let channel = &shown.channels()[0];
    let gain = channel.figure("K").unwrap().best().value().unwrap();
    let [dsnu, _] = channel.non_uniformity_with_defects().unwrap();
    assert!((dsnu.value().unwrap() - 50.0 / gain).abs() < 1e-9);
    let page = page(&found);
    crate::page::assert_readable(&page);
    assert!(page.contains("do: 60.") && page.contains("The first 50; results.json lists all."));
    assert_eq!(page.matches("4094.5").count(), 50);
    assert!(page.contains(&style::with_error(&dsnu).unwrap()), "{dsnu:?}");
    // A fifth of the signal is missing from the means over all pixels.
    let of_all = channel.figure("R").unwrap().best().value().unwrap();
    let of_others = channel.without_defects("R").unwrap();
    assert!((of_others.value().unwrap() - 1.25 * of_all).abs() < 1e-12, "{of_others:?} of {of_all}");
    assert!(page.contains(&style::with_error(&of_others).unwrap()), "{of_others:?}");
}

#[test]
fn each_reason_is_listed_once_below_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let found = series(folder.path(), false);
    let page = page(&found);
    let saturation = "the series does not reach saturation";
    // The table of the standard, and that of all figures.
    assert_eq!(page.matches(saturation).count(), 2, "{}", page.matches(saturation).count());
    assert!(page.matches("not resolved").count() > 20);
}

#[test]
fn warnings_of_a_kind_are_one_entry() {
    use petzval_lab::emva::Warning;
    let folder = tempfile::tempdir().unwrap();
    let mut found = series(folder.path(), false);
    let dark = |i: usize| Warning::NoDark { point: format!("point {i}") };
    found.warnings = (0..5).map(dark).collect();
    found.warnings.insert(2, Warning::TooFewPoints { linear_gain: 2.0, points: 1 });
    let listed = table::warnings(&found).into_string();
    assert_eq!(listed.matches("<details>").count(), 1, "{listed}");
    assert!(listed.contains("4 more of the kind no-dark") && listed.contains("point 4"), "{listed}");
    assert!(listed.find("point 4") < listed.find("too-few-points"), "{listed}");
}

#[test]
fn a_single_gain_has_no_plot_of_gains() {
    let folder = tempfile::tempdir().unwrap();
    let mut found = series(folder.path(), false);
    found.gains.truncate(1);
    assert!(!picture_names(&found).contains(&"gain-fit"));
    assert!(page(&found).contains("three or more linear gains"));
}

#[test]
fn missing_captures_are_stated() {
    let folder = tempfile::tempdir().unwrap();
    let mut found = series(folder.path(), false);
    assert!(page(&found).contains("--fit-histograms"));
    found.sensor.name = "another".into();
    assert!(!page(&found).contains("Table 5"));
    // A list need not state the black level.
    let frames = |page: &str| page.matches("64 × 48").count();
    let before = frames(&page(&found));
    found.joint.black_level_dn = None;
    let without = page(&found);
    assert!(without.contains("not stated") && frames(&without) == before, "{before}");
    for gain in &mut found.gains {
        gain.channels.iter_mut().for_each(|c| c.spatial = None);
    }
    assert_eq!(picture_names(&found).len(), 10);
    found.gains.iter_mut().for_each(|gain| gain.channels.clear());
    assert!(page(&found).contains("no flat frames"));
    found.gains.clear();
    found.histograms.clear();
    assert!(picture_names(&found).is_empty() && page(&found).contains("another"));
}

#[test]
fn a_report_is_a_page_and_its_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let found = series(folder.path(), false);
    let files = files(&found);
    assert_eq!(files[0].0, "report.html");
    assert_eq!(files.len(), 17);
    assert!(files.iter().all(|(_, text)| text.len() > 500));
}

#[test]
fn values_end_where_their_errors_begin() {
    use petzval_lab::emva::{Measured, Unresolved};
    let text = |value, error| style::with_error(&Measured::new(value, error)).unwrap();
    assert_eq!(text(0.140_234, 0.000_312), "0.1402 ± 0.0003");
    assert_eq!(text(24_913.05, 120.0), "24910 ± 120");
    assert_eq!(text(-0.5, 0.25), "\u{2212}0.5 ± 0.2");
    assert_eq!(style::with_error(&Measured::exact(12.0)).unwrap(), "12");
    assert_eq!(style::with_error(&Measured::none(Unresolved::NoStack)), None);
}
