//! Writes PNG pictures of streets, plain, with boxes and as class maps, to a folder, and all of them on one sheet, `sheet.jpg`:
//! `cargo run --release -p petzval-street --example gallery -- FOLDER [STREETS] [FOCAL_MM] [FIRST_SEQUENCE] [SHRINK]`.
//!
//! Frames have 1920 x 1200 pixels, or SHRINK times fewer along each side, with as many samples in all.

use std::path::Path;
use std::time::Instant;

use image::RgbImage;
use petzval_street::{Light, ObjectKind, Projection, Seen, Street, StreetSettings, SurfaceClass, Window};

const ROWS: usize = 1200;
const COLUMNS: usize = 1920;
const PIXEL_UM: f64 = 5.86;

/// Traffic and people, as in the experiments.
const BUSY: f64 = 0.4;

/// Frames beside each other on the sheet, and pixels between them.
const SHEET_COLUMNS: u32 = 4;
const GAP: u32 = 4;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = arguments.first().ok_or("the first argument is the folder of the pictures")?;
    let number = |place: usize, default: f64| arguments.get(place).map_or(Ok(default), |text| text.parse());
    let (streets, focal_mm, first) = (number(1, 2.0)? as u64, number(2, 25.0)?, number(3, 0.0)? as u64);
    let shrink = (number(4, 1.0)? as usize).max(1);
    std::fs::create_dir_all(folder)?;
    let (rows, columns) = (ROWS / shrink, COLUMNS / shrink);
    let focal_px = focal_mm * 1000.0 / PIXEL_UM / shrink as f64;
    let projection = Projection::rectilinear(focal_px, 1400.0 / shrink as f64, rows, columns)?;
    let window = Window { row: 0, col: 0, height: rows, width: columns };
    let mut frames: Vec<RgbImage> = Vec::new();
    for (name, light) in [("day", Light::Day), ("dusk", Light::Dusk), ("night", Light::Night)] {
        for sequence in first..first + streets {
            let settings = StreetSettings { moment: 3, busy: BUSY, ..StreetSettings::new(sequence, light) };
            let street = Street::new(&settings);
            let start = Instant::now();
            let seen = street.see(&projection, &street.pose(), window, (2 * shrink).min(16))?;
            let seconds = start.elapsed().as_secs_f64();
            let labelled = seen.objects.iter().filter(|object| worth_a_box(object)).count();
            println!("{name} {sequence}: {seconds:.2} s, {labelled} objects");
            let path =
                |kind: &str| Path::new(folder).join(format!("{name}-{sequence}-{focal_mm}mm{kind}.png"));
            let mut picture = developed(&seen);
            picture.save(path(""))?;
            frames.push(picture.clone());
            draw_boxes(&mut picture, &seen);
            picture.save(path("-boxes"))?;
            class_map(&seen).save(path("-classes"))?;
        }
    }
    sheet(&frames).save(Path::new(folder).join("sheet.jpg"))?;
    Ok(())
}

/// The class of each pixel as a colour.
fn class_map(seen: &Seen) -> RgbImage {
    RgbImage::from_fn(seen.width as u32, seen.height as u32, |x, y| {
        image::Rgb(match seen.classes[y as usize * seen.width + x as usize] {
            SurfaceClass::Road => [90, 60, 110],
            SurfaceClass::Pavement => [190, 120, 190],
            SurfaceClass::Building => [120, 100, 80],
            SurfaceClass::Vegetation => [70, 140, 50],
            SurfaceClass::Pole => [170, 170, 170],
            SurfaceClass::Signal => [250, 170, 30],
            SurfaceClass::Sign => [220, 220, 0],
            SurfaceClass::Furniture => [110, 40, 40],
            SurfaceClass::Pedestrian => [220, 20, 60],
            SurfaceClass::Vehicle => [20, 60, 160],
            SurfaceClass::Sky => [130, 190, 240],
        })
    })
}

/// All frames in rows.
fn sheet(frames: &[RgbImage]) -> RgbImage {
    let (width, height) = frames.first().map_or((1, 1), RgbImage::dimensions);
    let rows = (frames.len() as u32).div_ceil(SHEET_COLUMNS);
    let mut sheet =
        RgbImage::new(SHEET_COLUMNS * (width + GAP) - GAP, (rows * (height + GAP)).max(GAP + 1) - GAP);
    for (i, frame) in frames.iter().enumerate() {
        let (row, column) = (i as u32 / SHEET_COLUMNS, i as u32 % SHEET_COLUMNS);
        image::imageops::replace(
            &mut sheet,
            frame,
            (column * (width + GAP)).into(),
            (row * (height + GAP)).into(),
        );
    }
    sheet
}

/// Whether a detector should find an object: of the three tasks, visible, larger than 12 pixels.
fn worth_a_box(object: &petzval_street::SeenObject) -> bool {
    let kind = matches!(object.kind, ObjectKind::Pedestrian | ObjectKind::Vehicle | ObjectKind::TrafficLight);
    kind && object.visible_share > 0.25
        && object.visible.is_some_and(|[x1, y1, x2, y2]| (x2 - x1).max(y2 - y1) > 12.0)
}

/// Exposes for the mean of the logarithm, compresses highlights, and encodes as sRGB.
fn developed(seen: &Seen) -> RgbImage {
    let area = seen.height * seen.width;
    let logs: f64 = seen.planes[area..2 * area].iter().map(|l| f64::from(l.max(1e-4)).ln()).sum();
    // A dark picture is shown darker than a bright one.
    let mean = (logs / area as f64).exp() as f32;
    let gain = 0.18 / mean * (mean / 1000.0).powf(0.08);
    RgbImage::from_fn(seen.width as u32, seen.height as u32, |x, y| {
        let place = y as usize * seen.width + x as usize;
        image::Rgb([0, 1, 2].map(|channel| {
            let light = gain * seen.planes[channel * area + place];
            let shown = light * (1.0 + light / 16.0) / (1.0 + light);
            let encoded =
                if shown < 0.0031308 { 12.92 * shown } else { 1.055 * shown.powf(1.0 / 2.4) - 0.055 };
            (255.0 * encoded.clamp(0.0, 1.0)).round() as u8
        }))
    })
}

fn draw_boxes(picture: &mut RgbImage, seen: &Seen) {
    for object in seen.objects.iter().filter(|object| object.visible_share > 0.25) {
        let colour = image::Rgb(match object.kind {
            ObjectKind::Pedestrian => [255, 220, 0],
            ObjectKind::Vehicle => [0, 200, 255],
            ObjectKind::TrafficLight => [0, 255, 80],
            ObjectKind::PedestrianLight | ObjectKind::TurnedLight => [255, 0, 255],
        });
        let [x1, y1, x2, y2] = object.whole.map(|edge| edge.round() as i64);
        let mut dot = |x: i64, y: i64| {
            if x >= 0 && y >= 0 && x < i64::from(picture.width()) && y < i64::from(picture.height()) {
                picture.put_pixel(x as u32, y as u32, colour);
            }
        };
        (x1..=x2).for_each(|x| [y1, y2].into_iter().for_each(|y| dot(x, y)));
        (y1..=y2).for_each(|y| [x1, x2].into_iter().for_each(|x| dot(x, y)));
    }
}
