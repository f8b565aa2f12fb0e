//! PSFs of a network beside those of exact tracing, on one self-contained page.

use image::{Rgb, RgbImage};
use maud::{Markup, html};

use crate::page::{Page, Section, Tile, caption, figure, numbers, section, with_contents};
use crate::plot::{Chart, Series, chart_svg, plain};
use crate::table::{Column, Row, Table};
use crate::{number, palette, png};

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
    /// How far the network is from exact tracing.
    pub gap: Gap,
}

/// How far a network is from exact tracing: means over lenses that training has not seen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gap {
    /// Lenses.
    pub lenses: usize,
    /// Sum of absolute differences between both PSFs of unit sum, 0..2.
    pub l1: f64,
    /// RMS spot radius of the exact PSFs, um.
    pub exact_rms_um: f64,
    /// Absolute error of the RMS spot radius, um.
    pub rms_um: f64,
    /// Distance between the centroids, um.
    pub centroid_um: f64,
    /// Absolute error of the relative illumination.
    pub illumination: f64,
    /// Cosine between both gradients by the lens: the median over lenses, and what a tenth of them stays below.
    pub gradient_cosine: [f64; 2],
    /// CPU time of the PSFs of one lens, s: exact, network.
    pub psfs_s: [f64; 2],
    /// CPU time of a gradient by the lens, s: exact, network.
    pub gradient_s: [f64; 2],
    /// Each field.
    pub fields: Vec<FieldGap>,
}

/// The errors at one field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldGap {
    /// Image radius, mm.
    pub radius_mm: f64,
    /// Of the PSFs, 0..2.
    pub l1: f64,
    /// RMS spot radius of the exact PSFs, um.
    pub exact_rms_um: f64,
    /// Of the RMS spot radius, um.
    pub rms_um: f64,
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
    let gap = &sheet.gap;
    let side_by_side = html! {
        @for (i, pair) in sheet.rows.chunks(2).enumerate() {
            h3 { "Lens " (i + 1) }
            (lens(sheet, pair))
        }
        (caption(html! {
            "Each picture is " (side_um) " × " (side_um) " µm; from left to right the image point lies " (fields.join(", ")) " mm from the "
            "axis. Brightness is the square root of the light, relative to the largest exact value of the field, so that core and tails "
            "are both visible."
        }))
    };
    let sections: [Section; 2] = [section("Side by side", side_by_side), section("Gap", gap_table(gap))];
    let [cosine, low] = gap.gradient_cosine;
    let tiles = [
        (number::with_unit(100.0 * gap.l1 / 2.0, 1, "%"), "light that lies in another cell, mean".to_owned()),
        (
            number::with_unit(gap.rms_um, 2, "µm"),
            format!("error of the RMS spot radius, of {} µm", number::fixed(gap.exact_rms_um, 2)),
        ),
        (
            number::fixed(cosine, 2),
            format!(
                "cosine between both gradients, median; a tenth of the lenses is below {}",
                number::fixed(low, 2)
            ),
        ),
    ];
    let tiles = tiles.map(|(value, label)| Tile { value, label, is_gain: None });
    let sentence = format!(
        "On {} lenses that training has not seen the network puts {} % of the light of a PSF into another cell than exact tracing; half of its \
         gradients have a cosine of {} or more with the exact one.",
        gap.lenses,
        number::fixed(100.0 * gap.l1 / 2.0, 1),
        number::fixed(cosine, 2)
    );
    Page {
        title: format!("PSFs of a network and of ray tracing: {}", plain(&sheet.lens)),
        style: "img.psfs { image-rendering: pixelated; width: 100%; max-width: 60rem; display: block; margin-bottom: .9rem; }
                h3 { margin: 1.6rem 0 .4rem; } img.psfs + p, h3 + p { margin-bottom: .3rem; }",
        headline: "PSFs of a network beside exact ones".to_owned(),
        subtitle: html! { "Random lenses about " (plain(&sheet.lens)) "." },
        lead: html! { p.lead { (sentence) } (numbers(&tiles)) },
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}

/// The errors as a table and over the field, and what the network saves.
fn gap_table(gap: &Gap) -> Markup {
    let [psfs, gradient] = [gap.psfs_s, gap.gradient_s];
    let rows = [
        ("sum of absolute differences, 0 to 2", number::fixed(gap.l1, 3)),
        ("distance between the centroids, µm", number::fixed(gap.centroid_um, 2)),
        ("error of the RMS spot radius, µm", number::fixed(gap.rms_um, 2)),
        ("error of the relative illumination", number::fixed(gap.illumination, 4)),
    ];
    let rows = rows.map(|(name, value)| Row::new(name, [value]));
    let seconds = |v: f64| number::fixed(1e3 * v, 1);
    let times = [("PSFs of one lens", psfs), ("gradient by the lens", gradient)]
        .map(|(name, [exact, network])| Row::new(name, [seconds(exact), seconds(network)]));
    let series = |name: &str, i: usize, of: fn(&FieldGap) -> f64| Series {
        name: name.into(),
        colour: palette::camera(i).into(),
        points: gap.fields.iter().map(|f| (f.radius_mm, of(f))).collect(),
        ..Series::default()
    };
    let chart = Chart {
        alt: "RMS spot radius of the exact PSFs, and the error of the network, over the image radius".into(),
        x_axis: "image radius, mm".into(),
        y_axis: "RMS spot radius, µm".into(),
        series: vec![series("exact", 0, |f| f.exact_rms_um), series("error of the network", 2, |f| f.rms_um)],
        ..Chart::default()
    };
    let columns = [Column::new("mean over lenses, fields and colours"), Column::new("value")];
    let time_columns =
        [Column::new("CPU time"), Column::new("exact").unit("ms"), Column::new("network").unit("ms")];
    html! {
        (Table::new(columns).class("narrow").rows(rows).html())
        (Table::new(time_columns).class("narrow").rows(times).html())
        @if !gap.fields.is_empty() { (figure(&chart_svg(&chart))) }
    }
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
            gap: Gap {
                lenses: 50,
                l1: 0.126,
                exact_rms_um: 7.5,
                rms_um: 0.314,
                gradient_cosine: [0.9312, 0.71],
                fields: vec![
                    FieldGap { radius_mm: 0.0, l1: 0.1, exact_rms_um: 5.0, rms_um: 0.2 },
                    FieldGap { radius_mm: 6.5, l1: 0.2, exact_rms_um: 10.0, rms_um: 0.5 },
                ],
                ..Gap::default()
            },
        };
        let network = picture(&sheet, &sheet.rows[1], &sheet.rows[0]);
        // Cell 5 is column 1 of row 1, the third from the top; a quarter of the light is half as bright.
        assert_eq!(network.get_pixel(1, 2), &Rgb([128, 0, 0]));
        assert_eq!(network.get_pixel(9, 2), &Rgb([128, 0, 0]));
        let page = page(&sheet);
        crate::page::assert_readable(&page);
        // Gap and cosine come first, then the pictures.
        let (front, rest) = page.split_once("<nav").unwrap();
        for text in ["50 lenses", "6.3", "0.31\u{a0}µm", ">0.93<", "below 0.71"] {
            assert!(front.contains(text), "{text}: {front}");
        }
        assert!(rest.find("<img").unwrap() < rest.find("<svg").unwrap());
        assert_eq!(page.matches("<img").count(), 2);
        assert!(
            page.contains("lens 1, network")
                && page.contains("0.00, 6.50 mm")
                && page.contains("a &lt;lens&gt;")
        );
    }
}
