//! Settings that are tuned to references, and proxies of an ISP.

use std::path::Path;

use super::{TRUTH, write_raws, write_references};
use crate::common::{data, read, read_json, run_fails, run_ok};

#[test]
fn what_cannot_be_developed_or_tuned_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    write_references(folder.path());
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("bad.toml", "[settings.white_balance]\nred = 99.0\n");
    write(
        "lab.toml",
        "name = \"a\"\ncommand = [\"true\"]\n[[parameter]]\nname = \"a.b\"\nmin = 0\nmax = 1\ndefault = 2\n",
    );
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    std::fs::create_dir(folder.path().join("small")).unwrap();
    for name in ["left", "right"] {
        image::RgbImage::new(30, 30).save(folder.path().join(format!("small/{name}.png"))).unwrap();
    }
    write_mosaics(folder.path());
    let raw = "raws/left.tiff";
    let develop = |more: &[&'static str]| [&["develop", raw, "--out", "out"], more].concat();
    let tune = |reference: &'static str, more: &[&'static str]| {
        [&["tune", "raws", "--reference", reference, "--out", "out"], more].concat()
    };
    for (args, needles) in [
        (
            develop(&["--set", "white_balance.rde=2"]),
            ["--set white_balance.rde=2", "did you mean white_balance.red"],
        ),
        (develop(&["--set", "white_balance.red=99"]), ["--set white_balance.red=99", "must lie between"]),
        (develop(&["--set", "white_balance.red"]), ["--set white_balance.red", "stage.key=value"]),
        (develop(&["--preset", "nowhere"]), ["nowhere", "built-in ones (neutral, "]),
        (develop(&["--preset", "neutrl"]), ["neutrl", "did you mean `neutral`?"]),
        (develop(&["--isp", "bad.toml"]), ["bad.toml:2:7", "must lie between"]),
        (develop(&["--isp", "lab.toml"]), ["lab.toml:3", "the key `sentence` is missing"]),
        (develop(&["--bits", "9"]), ["--bits 9", "8, 10 or 16"]),
        (develop(&["--white-dn", "50"]), ["--white-dn 50", "black level of 119 DN"]),
        (develop(&["raws/left.tiff.toml"]), ["left.tiff.toml", "gray TIFF or PNG"]),
        (develop(&["--sensor", "imx999"]), ["imx999", "neither a file nor"]),
        (tune("empty", &[]), ["--reference empty", "holds no file"]),
        (tune("nothere", &[]), ["--reference nothere", "the pictures that the frames should become"]),
        (tune("reference", &["--vary", "sharpn"]), ["--vary sharpn", "did you mean sharpen?"]),
        (tune("small", &[]), ["left.png: 30 x 30 pixels", "48 x 32"]),
        (tune("mosaic", &[]), ["mosaic/left.png", "tuning would lead to"]),
        (
            tune("coloured", &[]),
            ["coloured/left.png: it is a raw mosaic saved in colour", "give the picture"],
        ),
        (tune("gray", &[]), ["gray/left.png: its three colours are equal", "give the picture"]),
        (tune("reference", &["--vary", "gain.grün"]), ["--vary gain.grün", "did you mean"]),
        (
            tune("reference", &["--objective", "beauty"]),
            ["--objective beauty", "give one of lpips, psnr, ssim"],
        ),
        (tune("reference", &["--evaluations", "3"]), ["--evaluations 3", "one generation"]),
        (vec!["tune", "--resume", "empty"], ["search.json", "--out folder"]),
        (vec!["tune", "raws"], ["--reference", "required"]),
    ] {
        run_fails(folder.path(), &[&["isp"], &args[..]].concat(), 2, &needles);
    }
}

/// Writes references that are refused: the raws with all colours equal, the raws with the colour of the filter alone, and a gray ramp.
fn write_mosaics(folder: &Path) {
    let at = |name: &str| folder.join(name);
    for name in ["mosaic", "coloured", "gray"] {
        std::fs::create_dir(at(name)).unwrap();
    }
    for name in ["left", "right"] {
        let raw = image::open(at(&format!("raws/{name}.tiff"))).unwrap().into_luma16();
        let value = |x: u32, y: u32| (raw.get_pixel(x, y).0[0] / 16) as u8;
        let save = |to: &str, colours: &dyn Fn(u32, u32) -> [u8; 3]| {
            let picture =
                image::RgbImage::from_fn(raw.width(), raw.height(), |x, y| image::Rgb(colours(x, y)));
            picture.save(at(&format!("{to}/{name}.png"))).unwrap();
        };
        save("mosaic", &|x, y| [value(x, y); 3]);
        save("coloured", &|x, y| match (x % 2, y % 2) {
            (1, 0) => [value(x, y), 0, 0],
            (0, 1) => [0, 0, value(x, y)],
            _ => [0, value(x, y), 0],
        });
        save("gray", &|x, y| [(40 + 2 * x + y) as u8; 3]);
    }
}

#[test]
fn spoiled_settings_are_tuned_back_and_a_resumed_search_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    write_references(folder.path());
    let tune = |out: &str, evaluations: &str| {
        let args = ["isp", "tune", "raws", "--reference", "reference", "--vary", "gain,white_balance"];
        run_ok(folder.path(), &[&args[..], &["--evaluations", evaluations, "--out", out, "--json"]].concat())
            .json()
    };
    let whole = tune("whole", "320");
    let [start, best] = ["start", "best"].map(|key| whole[key].as_f64().unwrap());
    assert!(best > start + 15.0 && best > 45.0, "{start} {best}: {whole}");
    for p in whole["parameters"].as_array().unwrap() {
        let truth: f64 = TRUTH
            .iter()
            .find_map(|t| t.split_once('=').filter(|(name, _)| *name == p["name"]))
            .map_or(f64::NAN, |(_, value)| value.parse().unwrap());
        let tuned = p["best"].as_f64().unwrap();
        assert!((tuned - truth).abs() < 0.02, "{p}");
    }
    // The tuned settings give the score again.
    let args =
        ["isp", "develop", "raws/left.tiff", "--isp", "whole/tuned.toml", "--bits", "16", "--out", "again"];
    run_ok(folder.path(), &args);

    // In two parts.
    tune("parts", "130");
    let more = ["isp", "tune", "--resume", "parts", "--evaluations", "320", "--json"];
    let parts = run_ok(folder.path(), &more).json();
    assert_eq!(parts["best"], whole["best"]);
    let at = |name: &str, file: &str| folder.path().join(name).join(file);
    assert_eq!(read(&at("parts", "tuned.toml")), read(&at("whole", "tuned.toml")));
    let without_time = |name: &str| {
        let mut history = read_json(&at(name, "history.json"));
        for generation in history.as_array_mut().unwrap() {
            generation.as_object_mut().unwrap().remove("seconds").unwrap();
        }
        history
    };
    assert_eq!(without_time("parts"), without_time("whole"));

    // A finished search stays as it is: its budget is kept with it.
    let finished = run_ok(folder.path(), &["isp", "tune", "--resume", "parts", "--json"]);
    assert!(finished.says("nothing is left"), "{}", finished.stderr);
    assert_eq!(finished.json()["evaluations"], whole["evaluations"]);
    assert_eq!(without_time("parts"), without_time("whole"));
    run_fails(
        folder.path(),
        &["isp", "tune", "--resume", "parts", "--evaluations", "0"],
        2,
        &["--evaluations 0"],
    );

    // A chart among pictures in colour is gray, and may be.
    std::fs::create_dir(folder.path().join("mixed")).unwrap();
    std::fs::copy(at("reference", "left.png"), at("mixed", "left.png")).unwrap();
    image::RgbImage::from_fn(48, 32, |x, y| image::Rgb([(40 + 2 * x + y) as u8; 3]))
        .save(at("mixed", "right.png"))
        .unwrap();
    let mixed = [
        "isp",
        "tune",
        "raws",
        "--reference",
        "mixed",
        "--vary",
        "gain",
        "--evaluations",
        "40",
        "--out",
        "gray",
    ];
    let said = run_ok(folder.path(), &mixed);
    assert!(said.says("1 of 2 references are gray, the first is mixed/right.png"), "{}", said.stderr);

    // A folder that holds a search, and one whose frames have changed.
    let again = ["isp", "tune", "raws", "--reference", "reference", "--out", "whole"];
    run_fails(folder.path(), &again, 2, &["--out whole", "already holds a search"]);
    write_raws(&folder.path().join("raws"));
    let state = read(&at("parts", "search.json"));
    std::fs::write(at("parts", "search.json"), state.replacen("\"start\":", "\"start\":1", 1)).unwrap();
    run_fails(folder.path(), &more, 2, &["search.json: is not as the search wrote it"]);
    std::fs::write(at("parts", "search.json"), state).unwrap();
    std::fs::remove_file(folder.path().join("raws/right.tiff")).unwrap();
    run_fails(folder.path(), &more, 2, &["have changed since the search began"]);
}

/// Six numbers of a preset at the ends of their ranges, and what 500 settings make of them on noisy frames, against a search three times as long
/// from the preset itself.
#[test]
fn six_spoiled_numbers_are_recovered_within_500_settings() {
    let folder = tempfile::tempdir().unwrap();
    let photos = [data("photos/coffee.png"), data("photos/chelsea.png")];
    let taken = "--place centre --size 64x96 --gain 4 --white-e 4000 --no-distortion --out";
    let simulate = |out: &[&str]| {
        let photos = photos.iter().map(|p| p.to_str().unwrap());
        let args: Vec<&str> = ["simulate"]
            .into_iter()
            .chain(photos)
            .chain(taken.split(' '))
            .chain(out.iter().copied())
            .collect();
        run_ok(folder.path(), &args);
    };
    simulate(&["raws"]);
    simulate(&["clean", "--no-noise", "--isp", "neutral"]);
    let reference = folder.path().join("reference");
    std::fs::create_dir(&reference).unwrap();
    for name in ["coffee", "chelsea"] {
        let clean = folder.path().join(format!("clean/{name}-isp.png"));
        std::fs::copy(clean, reference.join(format!("{name}.png"))).unwrap();
    }

    let spoiled = [
        "bayer_denoise.strength=0",
        "luma_denoise.strength=1",
        "luma_denoise.threshold=10",
        "chroma_denoise.strength=0",
        "sharpen.amount=4",
        "sharpen.sigma=2.5",
    ];
    let names: Vec<&str> = spoiled.iter().map(|set| set.split_once('=').unwrap().0).collect();
    let vary = names.join(",");
    let tune = |evaluations: &str, out: &str, set: &[&str]| {
        let args =
            ["isp", "tune", "raws", "--reference", "reference", "--preset", "quality", "--vary", &vary];
        let more = ["--evaluations", evaluations, "--out", out, "--json"];
        let set = set.iter().flat_map(|change| ["--set", change]);
        run_ok(folder.path(), &args.into_iter().chain(more).chain(set).collect::<Vec<_>>()).json()
    };
    let tuned = tune("1500", "tuned", &[]);
    let recovered = tune("500", "recovered", &spoiled);
    assert!(recovered["evaluations"].as_u64().unwrap() <= 500, "{recovered}");
    let squared_error =
        |result: &serde_json::Value, key: &str| 10f64.powf(-result[key].as_f64().unwrap() / 10.0);
    let best = squared_error(&tuned, "best");
    assert!(squared_error(&recovered, "start") > 10.0 * best, "{recovered}");
    assert!(squared_error(&recovered, "best") < 1.05 * best, "{recovered} {tuned}");
}

#[test]
#[ignore = "trains a network for half a minute; `cargo xtask full` runs it"]
fn a_proxy_is_trained_described_and_developed_with() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    let settings = folder.path().join("mine.toml");
    std::fs::write(&settings, "about = \"A preset of one's own.\"\n").unwrap();
    let train = [
        "train",
        "isp-proxy",
        "--isp",
        "mine.toml",
        "--vary",
        "gain.stops,gamma",
        "--steps",
        "3",
        "--base-channels",
        "8",
        "--levels",
        "2",
    ];
    let done = run_ok(folder.path(), &[&train[..], &["--out", "proxy", "--json"]].concat()).json();
    let gap = &done["gap"];
    assert_eq!((&done["steps"], &done["varied"], &gap["frames"]), (&3.into(), &3.into(), &27.into()));
    assert!(gap["gradient_cosine"].as_f64().unwrap().abs() <= 1.0, "{gap}");
    assert_eq!(gap["scores"].as_array().unwrap().len(), 3);
    let card: toml::Table = read(&folder.path().join("proxy/proxy.toml")).parse().unwrap();
    assert_eq!(card["gap"]["frames"].as_integer(), Some(27));
    assert!(read(&folder.path().join("proxy/proxy.html")).contains("proxy, frame 1"));

    // It is an ISP like others, in the parameters that it knows.
    let develop = ["isp", "develop", "raws/left.tiff", "--isp", "proxy/proxy.toml", "--out", "out"];
    run_ok(folder.path(), &[&develop[..], &["--set", "gain.stops=0.5"]].concat());
    assert_eq!(image::open(folder.path().join("out/left.png")).unwrap().width(), 48);
    let unknown = [&develop[..], &["--set", "sharpen.amount=0.7", "--force"]].concat();
    run_fails(folder.path(), &unknown, 2, &["sharpen.amount"]);

    // A finished training stays as it is, and another does not overwrite it.
    let again = run_ok(folder.path(), &["train", "isp-proxy", "--resume", "proxy", "--json"]).json();
    assert_eq!(again["gap"], done["gap"]);
    run_fails(folder.path(), &[&train[..], &["--out", "proxy"]].concat(), 2, &["already holds a training"]);
    run_fails(folder.path(), &["train", "isp-proxy", "--resume", "raws"], 2, &["training.json"]);

    // The ISP is no longer the one that is imitated.
    std::fs::write(&settings, "about = \"Brighter.\"\n[settings.gain]\nstops = 0.5\n").unwrap();
    let changed = ["mine.toml", "no longer those with which this training began"];
    run_fails(folder.path(), &["train", "isp-proxy", "--resume", "proxy"], 2, &changed);
}

#[test]
fn a_mosaic_is_no_reference_and_pairs_are_named() {
    let folder = tempfile::tempdir().unwrap();
    write_raws(&folder.path().join("raws"));
    write_references(folder.path());
    let args = ["isp", "tune", "raws", "--reference", "raws", "--vary", "gain", "--out", "out"];
    run_fails(folder.path(), &args, 2, &["left.tiff", "raw frame, not a picture", "left.png in colour"]);
    assert!(!folder.path().join("out").exists());
    // A mosaic without a sidecar, in another folder, under another ending.
    std::fs::create_dir(folder.path().join("mosaics")).unwrap();
    for name in ["left", "right"] {
        let raw = image::open(folder.path().join(format!("raws/{name}.tiff"))).unwrap().into_luma16();
        raw.save(folder.path().join(format!("mosaics/{name}.png"))).unwrap();
    }
    let args = ["isp", "tune", "raws", "--reference", "mosaics", "--vary", "gain", "--out", "out"];
    run_fails(folder.path(), &args, 2, &["mosaics/left.png", "raw frame, not a picture"]);

    // Pictures beside the frames are taken, and every pair is named.
    for name in ["left", "right"] {
        let at = |name: String| folder.path().join("raws").join(name);
        for ending in ["tiff", "tiff.toml"] {
            std::fs::rename(at(format!("{name}.{ending}")), at(format!("{name}-raw.{ending}"))).unwrap();
        }
        std::fs::copy(folder.path().join(format!("reference/{name}.png")), at(format!("{name}.png")))
            .unwrap();
    }
    std::fs::create_dir(folder.path().join("frames")).unwrap();
    for name in ["left-raw.tiff", "left-raw.tiff.toml"] {
        std::fs::copy(folder.path().join("raws").join(name), folder.path().join("frames").join(name))
            .unwrap();
    }
    let args = [
        "isp",
        "tune",
        "frames",
        "--reference",
        "raws",
        "--vary",
        "gain",
        "--evaluations",
        "8",
        "--out",
        "out",
    ];
    let run = run_ok(folder.path(), &[&args[..], &["--json"]].concat());
    assert!(run.stderr.contains("frames/left-raw.tiff -> raws/left.png"), "{}", run.stderr);
    assert_eq!(run.json()["pairs"][0]["reference"], "raws/left.png");
    let again = ["isp", "tune", "--resume", "out"];
    let again = run_ok(folder.path(), &again).stdout;
    let generations = run.json()["generations"].as_u64().unwrap();
    assert_eq!(again.contains(" in 1 generation, 0 restarts, "), generations == 1, "{again}");

    // Two pictures of one name: nothing says which of them counts.
    let picture = image::open(folder.path().join("raws/left.png")).unwrap().into_rgb8();
    picture.save(folder.path().join("raws/left.jpg")).unwrap();
    let args = ["isp", "tune", "frames", "--reference", "raws", "--vary", "gain", "--out", "none"];
    let both = "raws/left.jpg and raws/left.png are both named like a reference of frames/left-raw.tiff";
    run_fails(folder.path(), &args, 2, &[both, "keep one of them"]);
}
