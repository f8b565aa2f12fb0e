//! `petzval simulate`: raw frame and developed picture of a photograph.

mod common;

use std::path::Path;

use common::{data, run_fails, run_ok};

fn raw(path: &Path) -> Vec<u16> {
    let picture = image::open(path).unwrap();
    let image::DynamicImage::ImageLuma16(samples) = picture else {
        panic!("{} is not 16-bit gray but {:?}", path.display(), picture.color());
    };
    assert_eq!((samples.width(), samples.height()), (1920, 1200));
    samples.into_raw()
}

#[test]
fn a_photograph_becomes_a_raw_frame_and_a_picture() {
    let folder = tempfile::tempdir().unwrap();
    let photo = data("photos/coffee.png").display().to_string();
    let take = |out: &str, more: &[&str]| {
        let written =
            run_ok(folder.path(), &[&["simulate", &photo, "--out", out, "--json"], more].concat()).json();
        assert_eq!(written.as_array().unwrap().len(), 1);
        assert_eq!(written[0]["image"], "coffee");
        assert_eq!(written[0]["raw"], format!("{out}/coffee-raw.tiff"));
        assert_eq!(written[0]["developed"], format!("{out}/coffee-developed.png"));
        folder.path().join(out)
    };
    let (once, again) = (take("once", &["--seed", "5"]), take("again", &["--seed", "5", "--threads", "1"]));
    let (other, clean) = (take("other", &["--seed", "6"]), take("clean", &["--no-noise"]));

    // The same seed gives the same bytes, whatever the number of threads.
    for file in ["coffee-raw.tiff", "coffee-developed.png"] {
        let bytes = |folder: &Path| std::fs::read(folder.join(file)).unwrap();
        assert!(bytes(&once) == bytes(&again), "{file} differs between two runs");
        assert!(bytes(&once) != bytes(&other), "{file} does not depend on the seed");
    }

    // 12-bit numbers on a black level of 119, and a mean that noise does not move.
    let (noisy, clean_dn) = (raw(&once.join("coffee-raw.tiff")), raw(&clean.join("coffee-raw.tiff")));
    assert!(noisy.iter().all(|dn| *dn < 4096));
    assert!(clean_dn.iter().all(|dn| *dn >= 119));
    let mean = |dn: &[u16]| dn.iter().map(|v| f64::from(*v)).sum::<f64>() / dn.len() as f64;
    assert!((mean(&noisy) - mean(&clean_dn)).abs() < 2.0, "{} {}", mean(&noisy), mean(&clean_dn));
    // Shot noise of some thousand electrons at 0.14 DN/e is a few DN.
    let square = |(a, b): (&u16, &u16)| (f64::from(*a) - f64::from(*b)).powi(2);
    let spread = (noisy.iter().zip(&clean_dn).map(square).sum::<f64>() / noisy.len() as f64).sqrt();
    assert!(spread > 2.0 && spread < 20.0, "{spread}");

    let developed = image::open(clean.join("coffee-developed.png")).unwrap();
    assert_eq!((developed.width(), developed.height()), (1920, 1200));
    assert_eq!(developed.color(), image::ColorType::Rgb8);
    // The coffee is brown: red above blue.
    let pixels = developed.to_rgb8();
    let sum = |c: usize| pixels.pixels().map(|p| f64::from(p[c])).sum::<f64>();
    assert!(sum(0) > 1.2 * sum(2));
}

#[test]
fn what_cannot_be_read_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let good = data("photos/coffee.png").display().to_string();
    std::fs::write(folder.path().join("notes.png"), "no picture").unwrap();
    std::fs::write(folder.path().join("cut.png"), &std::fs::read(&good).unwrap()[..2000]).unwrap();
    std::fs::create_dir(folder.path().join("twin")).unwrap();
    std::fs::copy(&good, folder.path().join("twin/coffee.png")).unwrap();
    for (args, needles) in [
        (&["notes.png"][..], ["notes.png: cannot decode the picture", "hint: give a PNG, JPEG or TIFF"]),
        (&[&good, "cut.png"], ["cut.png: cannot decode", "hint"]),
        (&["nowhere.png"], ["nowhere.png", "No such file"]),
        (&["twin"], ["twin", "directory"]),
        (&[&good, "twin/coffee.png"], ["twin/coffee.png: another image is called `coffee`", "--out"]),
        (&[&good, "--lens", "no-such"], ["no lens called `no-such`", "cooke-triplet-nominal"]),
        (&[&good, "--sensor", "no-such"], ["no sensor called `no-such`", "imx249-fitted"]),
        (&[&good, "--white-e=-1"], ["--white-e -1", "a positive number"]),
        (&[&good, "--gain", "nan"], ["--gain", "positive"]),
        (&[], ["IMAGE", "Usage"]),
    ] {
        run_fails(folder.path(), &[&["simulate", "--out", "out"], args].concat(), 2, &needles);
    }
}

#[test]
fn a_result_that_cannot_be_written_leaves_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let photo = data("photos/coffee.png").display().to_string();
    let args = ["simulate", photo.as_str(), "--out", "out", "--picture-format", "npy"];
    for blocked in ["coffee-raw.tiff", "coffee-raw.tiff.toml", "coffee-developed.npy"] {
        let folder_there = folder.path().join("out").join(blocked);
        std::fs::create_dir_all(&folder_there).unwrap();
        let needles =
            [&format!("{blocked}: cannot be written: this is a folder"), "choose a folder with --out"];
        run_fails(folder.path(), &args, 2, &needles);
        std::fs::remove_dir(folder_there).unwrap();
    }
    // With the way free all of them come, and nothing else.
    run_ok(folder.path(), &args);
    let mut files: Vec<String> = std::fs::read_dir(folder.path().join("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files, ["coffee-developed.npy", "coffee-raw.tiff", "coffee-raw.tiff.toml"]);
}

#[test]
fn a_long_thin_picture_is_laid_on_the_sensor() {
    let folder = tempfile::tempdir().unwrap();
    image::RgbImage::from_fn(200_000, 2, |x, _| image::Rgb([if x < 100_000 { 40 } else { 200 }; 3]))
        .save(folder.path().join("thin.png"))
        .unwrap();
    run_ok(folder.path(), &["simulate", "thin.png", "--no-noise"]);
    // Its middle: dark on the left, bright on the right.
    let dn = raw(&folder.path().join("thin-raw.tiff"));
    let mean = |columns: std::ops::Range<usize>| {
        let sum: f64 = dn.chunks(1920).flat_map(|row| &row[columns.clone()]).map(|v| f64::from(*v)).sum();
        sum / (1200 * columns.len()) as f64
    };
    let (left, right) = (mean(400..500), mean(1420..1520));
    assert!(right - 119.0 > 5.0 * (left - 119.0), "{left} {right}");
}
