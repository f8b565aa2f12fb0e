//! PSFs as a picture: one column a field, the channels together in colour and then each alone.

use image::{Rgb, RgbImage};
use petzval_optics::psf::{FieldPsf, PsfOptions};

use crate::raster_text::{CHARACTER_PX, LINE_PX, draw_text};
use crate::{number, png};

/// Pixels between two PSFs, and around all.
const GAP: u32 = 6;

/// Least width of a PSF, px: its labels fit above it.
const LEAST_PX: u32 = 88;

/// Longest text at the left of the rows, characters.
const ROW_NAME: u32 = 8;

/// Share of the width of a PSF that the scale bar takes, about.
const BAR: f64 = 0.3;

const PAPER: Rgb<u8> = Rgb([32, 32, 32]);
const INK: Rgb<u8> = Rgb([224, 224, 224]);

/// Where things are on a sheet, px.
struct Places {
    /// Picture pixels along a cell of a PSF.
    zoom: u32,
    /// Width of a PSF.
    side: u32,
    /// Left edge of the first PSF, and upper edge of the first row.
    first: [u32; 2],
}

impl Places {
    fn new(grid: usize) -> Self {
        let zoom = LEAST_PX.div_ceil(grid as u32);
        Self {
            zoom,
            side: zoom * grid as u32,
            first: [ROW_NAME * CHARACTER_PX + 2 * GAP, 2 * LINE_PX + 2 * GAP],
        }
    }

    /// The upper left corner of a PSF.
    fn corner(&self, column: usize, row: usize) -> [u32; 2] {
        [self.first[0] + column as u32 * (self.side + GAP), self.first[1] + row as u32 * (self.side + GAP)]
    }
}

/// A row of a sheet.
struct SheetRow {
    name: &'static str,
    /// Its wavelength, if it shows one alone.
    um: Option<f64>,
    tint: Tint,
}

/// How the tones of a cell become a colour.
enum Tint {
    /// The first three channels as red, green and blue.
    Together,
    /// The first channel.
    Red,
    /// The second.
    Green,
    /// The third, lightened: blue alone is dark.
    Blue,
    /// A channel in gray.
    Gray(usize),
}

impl Tint {
    fn of(&self, tone: impl Fn(usize) -> u8) -> Rgb<u8> {
        match *self {
            Self::Together => Rgb([tone(0), tone(1), tone(2)]),
            Self::Red => Rgb([tone(0), 0, 0]),
            Self::Green => Rgb([0, tone(1), 0]),
            Self::Blue => Rgb([tone(2) / 3, tone(2) / 2, tone(2)]),
            Self::Gray(channel) => Rgb([tone(channel); 3]),
        }
    }
}

/// Draws PSFs on one sheet, a PNG. Rows are colour, red, green and blue with their wavelengths, um. Brightness is the square root of the
/// value relative to the largest of its field, so that cores and tails are both visible. Above each column stand its field and where its
/// chief ray lands, below the sheet a scale bar.
pub fn psf_sheet(psfs: &[FieldPsf], options: &PsfOptions, wavelengths_um: [f64; 3]) -> Vec<u8> {
    png::encode(&sheet(psfs, options, &rows_of_three(wavelengths_um)))
}

/// [`psf_sheet`] for any number of wavelengths. Where they are not three, each has a row in gray.
pub fn psf_sheet_of(psfs: &[FieldPsf], options: &PsfOptions, wavelengths_um: &[f64]) -> Vec<u8> {
    if let Ok(three) = wavelengths_um.try_into() {
        return psf_sheet(psfs, options, three);
    }
    let row = |(channel, um): (usize, &f64)| SheetRow { name: "", um: Some(*um), tint: Tint::Gray(channel) };
    png::encode(&sheet(psfs, options, &wavelengths_um.iter().enumerate().map(row).collect::<Vec<_>>()))
}

fn rows_of_three([red, green, blue]: [f64; 3]) -> [SheetRow; 4] {
    [
        SheetRow { name: "together", um: None, tint: Tint::Together },
        SheetRow { name: "red", um: Some(red), tint: Tint::Red },
        SheetRow { name: "green", um: Some(green), tint: Tint::Green },
        SheetRow { name: "blue", um: Some(blue), tint: Tint::Blue },
    ]
}

fn sheet(psfs: &[FieldPsf], options: &PsfOptions, rows: &[SheetRow]) -> RgbImage {
    let (grid, places) = (options.grid, Places::new(options.grid));
    let [width, bottom] = places.corner(psfs.len(), rows.len());
    let mut sheet = RgbImage::from_pixel(width, bottom + 2 * LINE_PX, PAPER);
    for (column, psf) in psfs.iter().enumerate() {
        let [left, _] = places.corner(column, 0);
        let labels = [
            format!("{}°", number::fixed(psf.field_rad.to_degrees(), 2)),
            format!("{} mm", number::fixed(psf.chief_x_mm.hypot(psf.chief_y_mm), 2)),
        ];
        for (line, label) in labels.iter().enumerate() {
            draw_text(&mut sheet, [left, GAP + line as u32 * LINE_PX], label, INK);
        }
        let largest = psf.values.iter().flatten().fold(0.0_f64, |a, b| a.max(*b)).max(f64::MIN_POSITIVE);
        let tone = |channel: usize, cell: usize| {
            let value = psf.values.get(channel).map_or(0.0, |v| v[cell]);
            (255.0 * (value / largest).sqrt()).round() as u8
        };
        for (row, SheetRow { tint, .. }) in rows.iter().enumerate() {
            let [left, top] = places.corner(column, row);
            for (x, y) in (0..places.side).flat_map(|y| (0..places.side).map(move |x| (x, y))) {
                // Draw y upwards, as in lens drawings.
                let cell = (grid - 1 - (y / places.zoom) as usize) * grid + (x / places.zoom) as usize;
                sheet.put_pixel(left + x, top + y, tint.of(|channel| tone(channel, cell)));
            }
        }
    }
    for (row, SheetRow { name, um, .. }) in rows.iter().enumerate() {
        let top = places.corner(0, row)[1] + places.side / 2 - LINE_PX;
        draw_text(&mut sheet, [GAP, top], name, INK);
        if let Some(um) = um {
            draw_text(&mut sheet, [GAP, top + LINE_PX], &format!("{} µm", number::fixed(*um, 3)), INK);
        }
    }
    let bar_um = number::round_length(BAR * grid as f64 * options.pitch_um);
    let bar_px = (bar_um / options.pitch_um * f64::from(places.zoom)).round() as u32;
    let [left, top] = [places.first[0], bottom + LINE_PX / 2];
    for (x, y) in (0..bar_px.min(width - left)).flat_map(|x| (0..3).map(move |y| (x, y))) {
        sheet.put_pixel(left + x, top + y, INK);
    }
    let text = format!("{} µm", number::short(bar_um, 3));
    draw_text(&mut sheet, [left + bar_px + GAP, top + 1 - LINE_PX / 2], &text, INK);
    sheet
}

#[cfg(test)]
mod tests {
    use petzval_optics::psf::psf;
    use petzval_optics::pupil::Quadrature;

    use super::*;
    use crate::sample::triplet;

    #[test]
    fn wavelengths_that_are_not_three_have_gray_rows() {
        let options = PsfOptions { grid: 40, pitch_um: 2.0, ..PsfOptions::default() };
        let psf = psf(&triplet(), 0.1, &[0.62, 0.5], &Quadrature::grid(16).unwrap(), &options).unwrap();
        let picture =
            image::load_from_memory(&psf_sheet_of(&[psf], &options, &[0.62, 0.5])).unwrap().into_rgb8();
        let places = Places::new(40);
        assert_eq!(picture.height(), places.corner(1, 2)[1] + 2 * LINE_PX);
        assert!(picture.pixels().all(|pixel| pixel[0] == pixel[1] && pixel[1] == pixel[2]));
        assert!(picture.pixels().any(|pixel| pixel[0] == 255));
    }

    #[test]
    fn the_scale_bar_is_as_long_as_it_says_and_psfs_stand_below_their_labels() {
        let options = PsfOptions { grid: 40, pitch_um: 2.0, ..PsfOptions::default() };
        let wavelengths_um = [0.62, 0.55, 0.486];
        let psfs: Vec<FieldPsf> = [0.0_f64, 10.0]
            .iter()
            .filter_map(|deg| {
                psf(&triplet(), deg.to_radians(), &wavelengths_um, &Quadrature::grid(16).unwrap(), &options)
            })
            .collect();
        let sheet = sheet(&psfs, &options, &rows_of_three(wavelengths_um));
        let places = Places::new(40);
        assert_eq!((places.zoom, places.side), (3, 120));
        // 0.3 of 80 um is 24 um: the bar has 20 um, ten cells.
        let bar = places.corner(0, 4)[1] + LINE_PX / 2;
        let row: Vec<bool> = (0..sheet.width()).map(|x| *sheet.get_pixel(x, bar) == INK).collect();
        let first = row.iter().position(|lit| *lit).unwrap();
        assert_eq!(first as u32, places.first[0]);
        assert_eq!(row[first..].iter().take_while(|lit| **lit).count(), 30);
        // The brightest cell of a field is white in its channel, in the row of all colours and in its own.
        for column in 0..2 {
            let brightest = |row: usize| {
                let [left, top] = places.corner(column, row);
                let pixels = (0..places.side).flat_map(|y| (0..places.side).map(move |x| (x, y)));
                pixels.map(|(x, y)| *sheet.get_pixel(left + x, top + y).0.iter().max().unwrap()).max()
            };
            assert_eq!(brightest(0), Some(255));
            assert_eq!((1..4).filter_map(brightest).max(), Some(255));
        }
        // Labels: something is written above the columns and beside the rows.
        let is_written = |x: std::ops::Range<u32>, y: std::ops::Range<u32>| {
            y.into_iter().any(|y| x.clone().any(|x| sheet.get_pixel(x, y)[0] > 128))
        };
        for column in 0..2 {
            let [left, top] = places.corner(column, 0);
            assert!(is_written(left..left + places.side, 0..top));
        }
        for row in 0..4 {
            let [left, top] = places.corner(0, row);
            assert!(is_written(0..left - GAP, top..top + places.side));
        }
    }
}
