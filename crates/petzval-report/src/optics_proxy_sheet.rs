//! PSFs of a network beside those of exact tracing, on one self-contained page.

use image::{Rgb, RgbImage};
use maud::{Markup, html};

use crate::page::{Page, caption, section};
use crate::plot::plain;
use crate::png;

/// PSFs of several lenses at several fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Name of the lens about which the others were drawn.
    pub lens: String,
    /// Cells a side of a PSF.
    pub grid: usize,
    /// Size of a cell, um.
    pub pitch_um: f64,
    /// Image radii of the fields, mm.
    pub fields_mm: Vec<f64>,
    /// The PSFs, a row for each lens and source. Rows that belong together follow each other in pairs.
    pub rows: Vec<PsfRow>,
}

/// The PSFs of a lens from one source.
#[derive(Clone, Debug, PartialEq)]
pub struct PsfRow {
    /// Lens and source.
    pub name: String,
    /// For each field, the three colours `[3][row][column]`, each of unit sum.
    pub psfs: Vec<Vec<f32>>,
}

/// Pixels between two PSFs.
const GAP: usize = 4;

/// The page of a sheet.
pub fn page(sheet: &Sheet) -> String {
    let fields: Vec<String> = sheet.fields_mm.iter().map(|r| format!("{r:.2}")).collect();
    let side_um = sheet.grid as f64 * sheet.pitch_um;
    let main = html! {
        @for (i, pair) in sheet.rows.chunks(2).enumerate() {
            (section(format!("Lens {}", i + 1), lens(sheet, pair)))
        }
        (caption(html! {
            "Each picture is " (side_um) " × " (side_um) " µm; from left to right the image point lies " (fields.join(", ")) " mm from the "
            "axis. Brightness is the square root of the light, relative to the largest exact value of the field, so that core and tails "
            "are both visible."
        }))
    };
    Page {
        title: format!("PSFs of a network and of ray tracing: {}", plain(&sheet.lens)),
        style: "img.psfs { image-rendering: pixelated; width: 100%; max-width: 60rem; display: block; }",
        headline: "PSFs of a network beside exact ones".to_owned(),
        subtitle: html! { "Random lenses about " (plain(&sheet.lens)) ", which training has not seen." },
        main,
        ..Page::default()
    }
    .html()
}

fn lens(sheet: &Sheet, pair: &[PsfRow]) -> Markup {
    html! {
        @for row in pair {
            p { (plain(&row.name)) }
            img.psfs src=(png::address(&png::encode(&picture(sheet, row, &pair[0])))) alt=(plain(&row.name));
        }
    }
}

/// The PSFs of a row side by side, as bright as those of `exact` make them.
fn picture(sheet: &Sheet, row: &PsfRow, exact: &PsfRow) -> RgbImage {
    let (grid, step) = (sheet.grid, sheet.grid + GAP);
    let mut picture = RgbImage::from_pixel((row.psfs.len() * step) as u32, grid as u32, Rgb([32, 32, 32]));
    for (column, (psf, exact)) in row.psfs.iter().zip(&exact.psfs).enumerate() {
        let largest = exact.iter().fold(f32::MIN_POSITIVE, |a, b| a.max(*b));
        for y in 0..grid {
            for x in 0..grid {
                // Draw y upwards, as in lens drawings.
                let cell = (grid - 1 - y) * grid + x;
                let tone = |colour: usize| {
                    let value = psf.get(colour * grid * grid + cell).copied().unwrap_or(0.0) / largest;
                    (255.0 * value.clamp(0.0, 1.0).sqrt()).round() as u8
                };
                let pixel = Rgb([tone(0), tone(1), tone(2)]);
                picture.put_pixel((column * step + x) as u32, y as u32, pixel);
            }
        }
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_follows_the_exact_psf_and_rows_come_in_pairs() {
        let row = |name: &str, peak: f32| {
            let mut psf = vec![0.0; 3 * 16];
            psf[5] = peak;
            PsfRow { name: name.into(), psfs: vec![psf; 2] }
        };
        let sheet = Sheet {
            lens: "a <lens>".into(),
            grid: 4,
            pitch_um: 1.0,
            fields_mm: vec![0.0, 6.5],
            rows: vec![row("lens 1, exact", 0.8), row("lens 1, network", 0.2)],
        };
        let network = picture(&sheet, &sheet.rows[1], &sheet.rows[0]);
        // Cell 5 is column 1 of row 1, the third from the top; a quarter of the light is half as bright.
        assert_eq!(network.get_pixel(1, 2), &Rgb([128, 0, 0]));
        assert_eq!(network.get_pixel(9, 2), &Rgb([128, 0, 0]));
        let page = page(&sheet);
        crate::page::assert_readable(&page);
        assert_eq!(page.matches("<img").count(), 2);
        assert!(
            page.contains("lens 1, network")
                && page.contains("0.00, 6.50 mm")
                && page.contains("a &lt;lens&gt;")
        );
    }
}
