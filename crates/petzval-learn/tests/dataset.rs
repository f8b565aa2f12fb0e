//! Photographs, their split, and the positions of crops.

use std::collections::HashSet;
use std::fs;
use std::path::Path;

use petzval_base::Cancel;
use petzval_camera::image::{LinearImage, srgb_decode};
use petzval_learn::dataset::{
    CropPlan, DatasetError, FoundPhotos, List, Photo, PhotoSearch, PhotoSet, PhotoSplit, READ_AT_ONCE,
    Readers, find_photos, held_out_placements, training_crop,
};
use proptest::prelude::*;

fn photo(name: &str, height: usize, width: usize, value: f32) -> Photo {
    Photo::here(name, LinearImage::filled(3, height, width, value))
}

/// The photographs of a place of any size, in a set of up to so many bytes read at the start.
fn found(place: &Path, read_at_once: u64) -> Result<FoundPhotos, DatasetError> {
    let search = PhotoSearch { window: 1, most_bytes: 1 << 20, read_at_once, cancel: &Cancel::default() };
    find_photos(place, &search)
}

fn split(training: &[&str], held_out: &[&str]) -> PhotoSplit {
    let own = |names: &[&str]| names.iter().map(|n| n.to_string()).collect();
    PhotoSplit { training: own(training), held_out: own(held_out) }
}

fn three() -> Vec<Photo> {
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

/// Rows and columns of pictures of 5 x 4 pixels are not halved where windows have 3.
fn searched(place: &Path, read_at_once: u64) -> Result<FoundPhotos, DatasetError> {
    let search = PhotoSearch { window: 3, most_bytes: 1 << 20, read_at_once, cancel: &Cancel::default() };
    find_photos(place, &search)
}

fn names(found: &FoundPhotos) -> Vec<&str> {
    found.photos.iter().map(|photo| photo.name.as_str()).collect()
}

#[test]
fn a_folder_is_listed_in_order_and_a_damaged_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let empty = searched(folder.path(), READ_AT_ONCE).unwrap_err();
    assert!(empty.to_string().contains("tar shards"), "{empty}");
    assert!(searched(&folder.path().join("none"), READ_AT_ONCE).is_err());

    let gray = image::GrayImage::from_fn(5, 4, |x, y| image::Luma([(40 * x + 10 * y) as u8]));
    for name in ["b.png", "a.JPG", "c.tiff"] {
        gray.save(folder.path().join(name)).unwrap();
    }
    fs::write(folder.path().join("notes.txt"), "not a picture").unwrap();
    fs::write(folder.path().join("d.png"), b"\x89PNG\r\n\x1a\nbroken").unwrap();
    fs::copy(folder.path().join("b.png"), folder.path().join("e.png")).unwrap();
    image::GrayImage::new(2, 2).save(folder.path().join("f.png")).unwrap();
    for read_at_once in [READ_AT_ONCE, 0] {
        let found = searched(folder.path(), read_at_once).unwrap();
        let all = names(&found);
        // Read as a whole, the TIFF of the same pixels is a copy, too: its file is another one.
        let expected: &[&str] =
            if found.are_read_later() { &["a.JPG", "b.png", "c.tiff"] } else { &["a.JPG", "b.png"] };
        assert_eq!(all, expected);
        let light = found.photos[1].light(&found.readers).unwrap();
        assert_eq!([light.channels, light.height, light.width], [3, 4, 5]);
        assert_eq!([found.photos[1].height, found.photos[1].width], [4, 5]);
        for channel in 0..3 {
            assert!((light.get(channel, 2, 3) - srgb_decode(140.0 / 255.0)).abs() < 1e-6);
        }
        let skipped: Vec<String> = found.skipped.iter().map(|(name, why)| format!("{name}: {why}")).collect();
        let says =
            |name: &str, why: &str| skipped.iter().any(|text| text.starts_with(name) && text.contains(why));
        assert!(says("d.png", "d.png"), "{skipped:?}");
        assert!(says("e.png", "e.png is the same picture as b.png"), "{skipped:?}");
        assert!(says("f.png", "cannot hold a window of 3 x 3"), "{skipped:?}");
    }
}

/// A large set differs from a small one only in when its pictures are read.
#[test]
fn pictures_that_are_read_later_are_those_that_are_read_at_once() {
    let folder = tempfile::tempdir().unwrap();
    for k in 0..6_u8 {
        let value = |x: u32, y: u32| image::Luma([(17 * x + 29 * y) as u8 ^ (k * 37)]);
        image::GrayImage::from_fn(7 + u32::from(k), 9, value)
            .save(folder.path().join(format!("{k}.png")))
            .unwrap();
    }
    let [at_once, later] = [READ_AT_ONCE, 0].map(|most| searched(folder.path(), most).unwrap());
    assert!(later.are_read_later() && !at_once.are_read_later());
    assert_eq!(names(&at_once), names(&later));
    for (own, other) in at_once.photos.iter().zip(&later.photos) {
        // Both sides are twice that of the window: every photograph is halved.
        assert_eq!((own.height, own.width), (4, own.light(&at_once.readers).unwrap().width));
        assert_eq!((own.height, own.width), (other.height, other.width));
        assert_eq!(own.light(&at_once.readers).unwrap(), other.light(&later.readers).unwrap());
    }
    // What was read is known by its digest, and nothing else.
    let known = later.readers.reads.as_ref().unwrap().take_fresh();
    assert_eq!(known.len(), 6);
    let again = searched(folder.path(), 0).unwrap();
    again.readers.reads.as_ref().unwrap().expect(known);
    again.photos[0].light(&again.readers).unwrap();
    // A picture of the same size with other pixels.
    image::GrayImage::new(8, 9).save(folder.path().join("1.png")).unwrap();
    let changed = again.photos[1].light(&again.readers).unwrap_err().to_string();
    assert!(changed.contains("1.png") && changed.contains("put it back"), "{changed}");
    // One that is damaged behind its head is named when it is read.
    let bytes = fs::read(folder.path().join("2.png")).unwrap();
    fs::write(folder.path().join("2.png"), &bytes[..bytes.len() - 20]).unwrap();
    let damaged = searched(folder.path(), 0).unwrap();
    assert_eq!(damaged.photos.len(), 6);
    let error = damaged.photos[2].light(&damaged.readers).unwrap_err();
    assert!(matches!(error, DatasetError::Unreadable(_)) && error.to_string().contains("2.png"), "{error}");
}

#[test]
fn fewer_held_out_pictures_are_spread_over_all() {
    let photos =
        |count: usize| (0..count).map(|k| photo(&format!("{k}.png"), 9, 9, k as f32)).collect::<Vec<_>>();
    let set = PhotoSet::for_scores(photos(10), Readers::default()).unwrap();
    let names = |most: usize| -> Vec<String> {
        set.clone().with_held_out(most).list(List::HeldOut).iter().map(|photo| photo.name.clone()).collect()
    };
    assert_eq!(names(4), ["0.png", "2.png", "5.png", "7.png"]);
    assert_eq!((names(0).len(), names(10).len(), names(11).len()), (10, 10, 10));
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
        let gray = if name == "a.png" { 100 } else { 120 };
        encoder.write_image(&[gray; 12], 2, 2, image::ExtendedColorType::Rgb8).unwrap();
    }
    let found = found(folder.path(), READ_AT_ONCE).unwrap();
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
    let remedy =
        "use larger pictures, or, for a new run, a smaller `psf.grid` or a smaller crop: the larger of";
    assert!(error.to_string().contains(remedy), "{error}");
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
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../petzval-data/data/photos");
    let list: List = toml::from_str(&fs::read_to_string(format!("{folder}/photos.toml")).unwrap()).unwrap();
    for entry in list.training.iter().chain(&list.held_out) {
        assert!(![&entry.title, &entry.author, &entry.licence, &entry.source].iter().any(|s| s.is_empty()));
    }
    let names = |entries: &[Entry]| entries.iter().map(|e| e.file.clone()).collect::<Vec<_>>();
    let split = PhotoSplit { training: names(&list.training), held_out: names(&list.held_out) };
    // No picture is twice as large as such a window.
    let search =
        PhotoSearch { window: 4000, most_bytes: 0, read_at_once: READ_AT_ONCE, cancel: &Cancel::default() };
    assert!(find_photos(Path::new(folder), &search).unwrap().photos.is_empty());
    let files = petzval_files::stored_pictures(Path::new(folder)).unwrap();
    let photos: Vec<Photo> =
        files.iter().map(|file| Photo::here(file.name.clone(), file.load().unwrap().light)).collect();
    assert_eq!(photos.len(), split.training.len() + split.held_out.len(), "every picture is in one list");
    let set = PhotoSet::new(photos, &split).unwrap();

    // Every photograph can hold the default crop with its margins, and the held-out photographs are in colour.
    let plan = CropPlan::on_1920x1200(96, 15);
    plan.check(set.training()).unwrap();
    plan.check(set.held_out()).unwrap();
    for photo in set.held_out() {
        let light = set.light(photo).unwrap();
        let (red, rest) = light.data.split_at(photo.height * photo.width);
        assert!(red.iter().zip(rest).any(|(r, g)| (r - g).abs() > 0.1), "{} is gray", photo.name);
    }
}

proptest! {
    #[test]
    fn crops_lie_inside_photograph_and_sensor(seed: u64, step: u64, item: u32, crop in 1_usize..150, margin in 0_usize..15) {
        let (plan, photos) = (CropPlan::on_1920x1200(crop, margin), three());
        let draw = training_crop(&plan, &photos, seed, step, item).unwrap();
        let image = photos[draw.photo].light(&Readers::default()).unwrap();
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
