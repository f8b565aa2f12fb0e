//! Photographs, their split, and the positions of crops.

use std::{collections::HashSet, fs};

use petzval_base::Cancel;
use petzval_camera::image::{LinearImage, srgb_decode};
use petzval_learn::dataset::{
    CropPlan, DatasetError, NamedPhoto, PhotoSet, PhotoSplit, held_out_placements, load_folder, training_crop,
};
use proptest::prelude::*;

fn photo(name: &str, height: usize, width: usize, value: f32) -> NamedPhoto {
    let image = LinearImage::filled(3, height, width, value);
    NamedPhoto { name: name.to_string(), image }
}

fn split(training: &[&str], held_out: &[&str]) -> PhotoSplit {
    let own = |names: &[&str]| names.iter().map(|n| n.to_string()).collect();
    PhotoSplit { training: own(training), held_out: own(held_out) }
}

fn three() -> Vec<NamedPhoto> {
    vec![photo("a.png", 200, 300, 0.1), photo("b.png", 256, 256, 0.2), photo("c.png", 180, 190, 0.3)]
}

#[test]
fn a_split_keeps_pictures_apart() {
    let set = PhotoSet::new(three(), &split(&["b.png", "a.png"], &["c.png"])).unwrap();
    let names: Vec<&str> = set.training().iter().map(|p| p.name.as_str()).collect();
    assert_eq!((names, set.held_out()[0].name.as_str()), (vec!["b.png", "a.png"], "c.png"));
}

#[test]
fn splits_with_a_repeated_unknown_or_shared_picture_are_refused() {
    let error = |photos, split: PhotoSplit| PhotoSet::new(photos, &split).err().unwrap();
    let both = error(three(), split(&["a.png"], &["b.png", "a.png"]));
    assert!(matches!(&both, DatasetError::InBothLists { name } if name == "a.png"), "{both}");

    let mut copies = three();
    copies.push(photo("renamed.png", 200, 300, 0.1));
    let copied = error(copies, split(&["a.png"], &["renamed.png"]));
    assert!(
        matches!(&copied, DatasetError::SameContent { training, held_out }
        if training == "a.png" && held_out == "renamed.png"),
        "{copied}"
    );

    let unknown = error(three(), split(&["a.png"], &["x.png"])).to_string();
    assert!(
        unknown.contains("held_out") && unknown.contains("x.png") && unknown.contains("b.png"),
        "{unknown}"
    );
    assert!(matches!(error(three(), split(&[], &["a.png"])), DatasetError::EmptyList { list: "training" }));
    assert!(matches!(
        error(three(), split(&["a.png", "a.png"], &["b.png"])),
        DatasetError::DuplicateName { .. }
    ));
    let twice = vec![photo("a.png", 9, 9, 0.0), photo("a.png", 9, 9, 0.5)];
    assert!(matches!(error(twice, split(&["a.png"], &["a.png"])), DatasetError::DuplicateName { .. }));
}

#[test]
fn a_folder_is_read_in_order_and_a_damaged_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(load_folder(folder.path(), &Cancel::default()), Err(DatasetError::EmptyFolder { .. })));
    assert!(matches!(
        load_folder(folder.path().join("none"), &Cancel::default()),
        Err(DatasetError::Io { .. })
    ));

    let gray = image::GrayImage::from_fn(5, 4, |x, y| image::Luma([(40 * x + 10 * y) as u8]));
    for name in ["b.png", "a.JPG", "c.tiff"] {
        gray.save(folder.path().join(name)).unwrap();
    }
    fs::write(folder.path().join("notes.txt"), "not a picture").unwrap();
    let photos = load_folder(folder.path(), &Cancel::default()).unwrap().photos;
    let names: Vec<&str> = photos.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["a.JPG", "b.png", "c.tiff"]);
    let png = &photos[1].image;
    assert_eq!([png.channels, png.height, png.width], [3, 4, 5]);
    for channel in 0..3 {
        assert!((png.get(channel, 2, 3) - srgb_decode(140.0 / 255.0)).abs() < 1e-6);
    }

    fs::write(folder.path().join("d.png"), b"\x89PNG\r\n\x1a\nbroken").unwrap();
    std::fs::copy(folder.path().join("b.png"), folder.path().join("e.png")).unwrap();
    let mut found = load_folder(folder.path(), &Cancel::default()).unwrap();
    assert_eq!(found.photos.len(), 4, "a damaged file does not spoil the others");
    let [(name, error)] = &found.skipped[..] else { panic!("one is skipped: {:?}", found.skipped) };
    assert!(
        name == "d.png"
            && matches!(error, DatasetError::Unreadable(_))
            && error.to_string().contains("d.png")
    );
    found.skip_copies();
    let (name, error) = found.skipped.last().unwrap();
    assert!(name == "e.png" && error.to_string().contains("e.png is the same picture as"), "{error}");
}

#[test]
fn what_a_picture_of_a_folder_says_and_is_not_obeyed_is_noted_by_name() {
    use image::ImageEncoder;
    let folder = tempfile::tempdir().unwrap();
    for (name, profile) in [("a.png", None), ("b.png", Some(vec![7; 300]))] {
        let mut encoder =
            image::codecs::png::PngEncoder::new(fs::File::create(folder.path().join(name)).unwrap());
        if let Some(profile) = profile {
            encoder.set_icc_profile(profile).unwrap();
        }
        encoder.write_image(&[100; 12], 2, 2, image::ExtendedColorType::Rgb8).unwrap();
    }
    let found = load_folder(folder.path(), &Cancel::default()).unwrap();
    assert_eq!((found.photos.len(), found.notes.len()), (2, 1));
    let (name, note) = &found.notes[0];
    assert!(name == "b.png" && note.contains("ICC profile"), "{name}: {note}");
}

#[test]
fn a_training_crop_depends_on_its_arguments_only() {
    let (plan, photos) = (CropPlan::on_1920x1200(128, 12), three());
    let later = training_crop(&plan, &photos, 4, 900, 2).unwrap();
    for step in 0..50 {
        training_crop(&plan, &photos, 4, step, 0).unwrap();
    }
    assert_eq!(training_crop(&plan, &photos, 4, 900, 2).unwrap(), later);
    let draws: HashSet<_> = [(4, 900, 2), (5, 900, 2), (4, 901, 2), (4, 900, 3)]
        .map(|(seed, step, item)| training_crop(&plan, &photos, seed, step, item).unwrap())
        .into();
    assert_eq!(draws.len(), 4);
}

#[test]
fn the_whole_field_and_every_photo_are_drawn_evenly() {
    let (plan, photos) = (CropPlan::on_1920x1200(128, 12), three());
    let (row_cell, column_cell) = (|row: usize| row * 4 / 1073, |column: usize| column * 6 / 1793);
    let (mut field, mut chosen, mut flips) = ([0_u32; 24], [0_u32; 3], 0_u32);
    let draws = 24_000;
    for step in 0..draws {
        let crop = training_crop(&plan, &photos, 1, step, 0).unwrap();
        field[row_cell(crop.sensor_row) * 6 + column_cell(crop.sensor_column)] += 1;
        chosen[crop.photo] += 1;
        flips += u32::from(crop.flip);
    }
    // Chi-squared tests at alpha = 1e-4: 23 degrees of freedom 58.6, 2 degrees 18.4, 1 degree 15.1.
    let chi_squared = |counts: &[u32], share: &dyn Fn(usize) -> f64| -> f64 {
        let expected = |i: usize| draws as f64 * share(i);
        counts.iter().enumerate().map(|(i, &n)| (f64::from(n) - expected(i)).powi(2) / expected(i)).sum()
    };
    // The centre is uniform over the sensor and the crop is moved inside: count the centres that lead to each cell.
    let along = |cells: usize, sensor: usize, cell: &dyn Fn(usize) -> usize| {
        let mut shares = vec![0.0; cells];
        for centre in 0..sensor {
            shares[cell(centre.saturating_sub(64).min(sensor - 128))] += 1.0 / sensor as f64;
        }
        shares
    };
    let (rows, columns) = (along(4, 1200, &row_cell), along(6, 1920, &column_cell));
    let field_share = |i: usize| rows[i / 6] * columns[i % 6];
    assert!(chi_squared(&field, &field_share) < 58.6, "{field:?}");
    assert!(chi_squared(&chosen, &|_| 1.0 / 3.0) < 18.4, "{chosen:?}");
    assert!(chi_squared(&[flips, draws as u32 - flips], &|_| 0.5) < 15.1, "{flips}");
}

#[test]
fn too_small_photos_and_sensors_are_refused() {
    let photos = three();
    let error = training_crop(&CropPlan::on_1920x1200(160, 12), &photos, 1, 0, 0).err().unwrap();
    assert!(
        matches!(&error, DatasetError::PhotoTooSmall { name, needed: 184, .. } if name == "c.png"),
        "{error}"
    );
    let wide = CropPlan { crop: 64, margin: usize::MAX, surround: 0, sensor_rows: 100, sensor_columns: 100 };
    assert!(matches!(training_crop(&wide, &photos, 1, 0, 0), Err(DatasetError::PhotoTooSmall { .. })));
    let tall = CropPlan { crop: 128, margin: 0, surround: 0, sensor_rows: 100, sensor_columns: 500 };
    assert!(matches!(training_crop(&tall, &photos, 1, 0, 0), Err(DatasetError::SensorTooSmall { .. })));
    assert!(held_out_placements(&tall, 3).is_err());
    assert!(training_crop(&CropPlan::on_1920x1200(128, 0), &[], 1, 0, 0).is_err());
}

#[test]
fn held_out_places_run_from_centre_to_corner() {
    let plan = CropPlan::on_1920x1200(128, 12);
    let places = held_out_placements(&plan, 3).unwrap();
    assert_eq!(places.len(), 9);
    assert_eq!((places[0].sensor_row, places[0].sensor_column), (536, 896));
    let last = places[8];
    assert!(last.sensor_row == 0 || last.sensor_row == 1072, "{last:?}");
    assert!(last.sensor_column == 0 || last.sensor_column == 1792, "{last:?}");
    let fields: Vec<f64> = places.iter().map(|p| p.relative_field).collect();
    assert!(fields.is_sorted() && fields[0] == 0.0 && (fields[8] - 1.0).abs() < 1e-12, "{fields:?}");
    assert_eq!(held_out_placements(&plan, 1).unwrap().len(), 1);
    assert!(held_out_placements(&plan, 0).unwrap().is_empty());
}

#[test]
fn the_embedded_photographs_match_their_list() {
    #[derive(serde::Deserialize)]
    struct Entry {
        file: String,
        title: String,
        author: String,
        licence: String,
        source: String,
    }
    #[derive(serde::Deserialize)]
    struct List {
        training: Vec<Entry>,
        held_out: Vec<Entry>,
    }
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/photos");
    let list: List = toml::from_str(&fs::read_to_string(format!("{folder}/photos.toml")).unwrap()).unwrap();
    for entry in list.training.iter().chain(&list.held_out) {
        assert!(![&entry.title, &entry.author, &entry.licence, &entry.source].iter().any(|s| s.is_empty()));
    }
    let names = |entries: &[Entry]| entries.iter().map(|e| e.file.clone()).collect::<Vec<_>>();
    let split = PhotoSplit { training: names(&list.training), held_out: names(&list.held_out) };
    let photos = load_folder(folder, &Cancel::default()).unwrap().photos;
    assert_eq!(photos.len(), split.training.len() + split.held_out.len(), "every picture is in one list");
    let set = PhotoSet::new(photos, &split).unwrap();

    // Every photograph can hold the default crop with its margins, and the held-out photographs are in colour.
    let plan = CropPlan::on_1920x1200(96, 15);
    plan.check(set.training()).unwrap();
    plan.check(set.held_out()).unwrap();
    for photo in set.held_out() {
        let pixels = photo.image.height * photo.image.width;
        let (red, rest) = photo.image.data.split_at(pixels);
        assert!(red.iter().zip(rest).any(|(r, g)| (r - g).abs() > 0.1), "{} is gray", photo.name);
    }
}

proptest! {
    #[test]
    fn crops_lie_inside_photograph_and_sensor(seed: u64, step: u64, item: u32, crop in 1_usize..150, margin in 0_usize..15) {
        let (plan, photos) = (CropPlan::on_1920x1200(crop, margin), three());
        let draw = training_crop(&plan, &photos, seed, step, item).unwrap();
        let image = &photos[draw.photo].image;
        prop_assert!(image.crop(draw.row, draw.column, plan.window(), plan.window()).is_ok());
        prop_assert!(draw.sensor_row + crop <= 1200 && draw.sensor_column + crop <= 1920);
    }
}

#[test]
fn a_crop_grows_with_the_image_as_far_as_the_sensor_reaches() {
    let plan = CropPlan { surround: 8, ..CropPlan::on_1920x1200(257, 15) };
    let side = |by: f64| plan.scaled(by).crop;
    assert_eq!([side(1.0), side(1.0 + 1e-9), side(1.1), side(0.75)], [257, 257, 283, 193]);
    // The largest odd side that the sensor holds.
    assert_eq!(side(9.0), 1200 - 16 - 1);
    assert_eq!(plan.scaled(1.1), CropPlan { crop: 283, ..plan });
    assert_eq!(plan.of_window(plan.scaled(1.1).window()), plan.scaled(1.1));
}

#[test]
fn what_is_exposed_around_a_crop_stays_on_the_sensor() {
    let plan = CropPlan { surround: 16, ..CropPlan::on_1920x1200(96, 15) };
    assert_eq!((plan.exposed(), plan.window()), (128, 158));
    assert_eq!(plan.exposed_at(500, 700), (484, 684));
    assert_eq!(plan.exposed_at(0, 5), (0, 0));
    assert_eq!(plan.exposed_at(1200 - 96, 1920 - 100), (1200 - 128, 1920 - 128));
    let photos = three();
    for step in 0..50 {
        let crop = training_crop(&plan, &photos, 3, step, 0).unwrap();
        let (row, column) = plan.exposed_at(crop.sensor_row, crop.sensor_column);
        assert!(
            (0..=32).contains(&(crop.sensor_row - row)) && (0..=32).contains(&(crop.sensor_column - column))
        );
        assert!(row + 128 <= 1200 && column + 128 <= 1920);
    }
}

/// Windows and the crops that are cut out of them are scaled each by itself.
#[test]
fn a_scaled_crop_fits_into_its_scaled_window() {
    for crop in [64, 96, 97, 128] {
        for more in [0, 2, 4, 48, 64] {
            let [small, large] = [crop, crop + more].map(|crop| CropPlan::on_1920x1200(crop, 12));
            for by in (30..1500).map(|percent| 0.01 * f64::from(percent)) {
                let [small, large] = [small, large].map(|plan| plan.scaled(by));
                assert!(small.crop <= large.crop, "{crop} and {more}, {by}: {small:?} {large:?}");
                assert_eq!(small.crop % 2, crop % 2);
            }
        }
    }
}
