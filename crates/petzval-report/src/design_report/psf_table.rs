//! The PSF table: one row a camera, one column a field, each PSF as a colour picture.

use image::{Rgb, RgbImage};
use maud::{Markup, html};

use super::view::{CameraView, PsfView, Report};
use crate::page::caption;
use crate::{number, palette, png};

/// Columns, as shares of the half-diagonal.
const SHARES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// Length of the scale bar, um.
const BAR_UM: f64 = 20.0;

/// Share of each channel's light within the shown window.
const SHOWN_LIGHT: f64 = 0.985;

/// The table, and a sentence on how to read it.
pub(super) fn psf_table(report: &Report) -> Markup {
    let columns = columns(&report.cameras, report.half_diagonal_mm);
    let shown: Vec<&PsfView> = columns.iter().flat_map(|c| &c.psfs).flatten().copied().collect();
    let Some(window_um) = window_um(&shown) else { return html! {} };
    let channels = rgb_order(&report.wavelengths_um);
    html! {
        div.psf-grid style=(format!("--columns:{}", columns.len())) {
            div.corner {}
            @for column in &columns {
                div.column-head {
                    b { (number::fixed(100.0 * column.share, 0)) " %" }
                    " " (number::fixed(column.field_deg, 1)) "°"
                }
            }
            @for (row, camera) in report.cameras.iter().enumerate() {
                div.row-head style=(palette::camera_style(palette::camera(row))) { (camera.name) }
                @for column in &columns {
                    (cell(camera, column.psfs[row], column.peak, window_um, channels))
                }
            }
        }
        (caption(html! {
            "Columns are fields, nearest to these shares of the sensor's half-diagonal ("
            (number::fixed(report.half_diagonal_mm, 2)) " mm) in the first camera; each picture is "
            (number::fixed(window_um, 0)) " µm wide and up is away from the axis. Red, green and blue are "
            (wavelength(report, channels[0])) ", " (wavelength(report, channels[1])) " and "
            (wavelength(report, channels[2])) " µm. Every channel holds the same light; brightness is the "
            "square root of the irradiance, on one scale in each column. RMS radii are traced, about the "
            "centroid of the three colours; light is the relative illumination."
        }))
    }
}

/// A field, with the PSF of each camera nearest to it.
struct Column<'a> {
    share: f64,
    field_deg: f64,
    psfs: Vec<Option<&'a PsfView>>,
    /// The highest value of any channel of any camera.
    peak: f64,
}

/// The first camera determines the fields, so that all cameras of a column show the same point.
fn columns(cameras: &[CameraView], half_diagonal_mm: f64) -> Vec<Column<'_>> {
    let nearest = |camera: &'_ CameraView, miss: &dyn Fn(&PsfView) -> f64| {
        let order = |a: &usize, b: &usize| miss(&camera.psfs[*a]).total_cmp(&miss(&camera.psfs[*b]));
        (0..camera.psfs.len()).min_by(order)
    };
    let Some(first) = cameras.iter().find(|c| !c.psfs.is_empty()) else { return Vec::new() };
    SHARES
        .iter()
        .filter_map(|share| {
            let wanted_mm = share * half_diagonal_mm;
            let field = nearest(first, &|p| (p.chief_y_mm.abs() - wanted_mm).abs())?;
            let field_deg = first.psfs[field].field_deg;
            let psfs: Vec<_> = cameras
                .iter()
                .map(|c| Some(&c.psfs[nearest(c, &|p| (p.field_deg - field_deg).abs())?]))
                .collect();
            let values = psfs.iter().flatten().flat_map(|p| p.values.iter().flatten());
            let peak = values.copied().fold(0.0, f64::max);
            Some(Column { share: *share, field_deg, psfs, peak })
        })
        .collect()
}

/// The smallest window, in steps of 8 um, that holds nearly all light of every PSF; at most the
/// smallest grid.
fn window_um(psfs: &[&PsfView]) -> Option<f64> {
    let most = psfs.iter().map(|p| p.grid as f64 * p.pitch_um).reduce(f64::min)?;
    let needed = psfs.iter().map(|p| spread_um(p)).fold(2.0 * BAR_UM, f64::max);
    Some((8.0 * (needed / 8.0).ceil()).min(most))
}

/// Width of the centred square that holds [`SHOWN_LIGHT`] of every channel, um.
fn spread_um(psf: &PsfView) -> f64 {
    let (grid, centre) = (psf.grid, 0.5 * (psf.grid as f64 - 1.0));
    let half_cells = |channel: &Vec<f64>| {
        let total: f64 = channel.iter().sum();
        // Light by its distance from the centre, in whole cells.
        let mut rings = vec![0.0; grid + 1];
        for (i, v) in channel.iter().enumerate().take(grid * grid) {
            let [row, column] = [i / grid, i % grid].map(|k| (k as f64 - centre).abs());
            rings[row.max(column) as usize] += v;
        }
        let mut inside = 0.0;
        rings.iter().position(|v| {
            inside += v;
            inside >= SHOWN_LIGHT * total
        })
    };
    let widest = psf.values.iter().filter_map(half_cells).max().unwrap_or(grid / 2);
    2.0 * (widest + 1) as f64 * psf.pitch_um
}

/// Indices of the red, green and blue channel: longest wavelength first.
fn rgb_order(wavelengths_um: &[f64]) -> [usize; 3] {
    let mut order = [0, 1, 2];
    if wavelengths_um.len() == 3 {
        order.sort_by(|a, b| wavelengths_um[*b].total_cmp(&wavelengths_um[*a]));
    }
    order
}

fn wavelength(report: &Report, channel: usize) -> String {
    number::fixed(report.wavelengths_um.get(channel).copied().unwrap_or(f64::NAN), 3)
}

fn cell(
    camera: &CameraView,
    psf: Option<&PsfView>,
    peak: f64,
    window_um: f64,
    channels: [usize; 3],
) -> Markup {
    let Some(psf) = psf else { return html! { div.psf { "–" } } };
    let rms = number::fixed(psf.rms_um, if psf.rms_um < 9.95 { 1 } else { 0 });
    let (deg, light) = (number::fixed(psf.field_deg, 1), number::fixed(100.0 * psf.illumination, 0));
    let alt = format!("PSF of {} at {deg} degrees, RMS radius {rms} um", camera.name);
    let cells = ((window_um / psf.pitch_um).round() as usize).min(psf.grid);
    let source = png::address(&psf_png(psf, cells, peak, channels));
    let bar = format!("width:{:.2}%", 100.0 * BAR_UM / window_um);
    html! {
        div.psf {
            div.psf-picture {
                img.pixels src=(source) alt=(alt) width="160" height="160";
                span.psf-bar style=(bar) {}
                span.psf-bar-text { (number::fixed(BAR_UM, 0)) " µm" }
            }
            div.psf-text { b { (rms) " µm" } " RMS" br; span.muted { "light " (light) " %" } }
        }
    }
}

/// The middle `cells` x `cells` of a PSF as a PNG: square root of `value / peak`, top row outermost.
fn psf_png(psf: &PsfView, cells: usize, peak: f64, channels: [usize; 3]) -> Vec<u8> {
    let offset = (psf.grid - cells) / 2;
    let tone = |channel: usize, row: usize, column: usize| {
        let value = psf.values[channel].get(row * psf.grid + column).copied().unwrap_or(0.0);
        (255.0 * (value / peak).clamp(0.0, 1.0).sqrt()).round() as u8
    };
    let picture = RgbImage::from_fn(cells as u32, cells as u32, |x, y| {
        let (row, column) = (offset + cells - 1 - y as usize, offset + x as usize);
        Rgb(channels.map(|c| tone(c, row, column)))
    });
    png::encode(&picture)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Light in one cell per channel of an 8 x 8 grid, 10 um a cell.
    fn view(cells: [usize; 3]) -> PsfView {
        let point = |i: usize| (0..64).map(|k| if k == i { 1.0 } else { 0.0 }).collect();
        PsfView {
            field_deg: 0.0,
            chief_y_mm: 0.0,
            grid: 8,
            pitch_um: 10.0,
            values: cells.map(point),
            illumination: 1.0,
            rms_um: 1.0,
        }
    }

    #[test]
    fn channels_are_coloured_by_wavelength_and_up_is_outwards() {
        assert_eq!(rgb_order(&[0.486, 0.55, 0.62]), [2, 1, 0]);
        assert_eq!(rgb_order(&[0.62, 0.55, 0.486]), [0, 1, 2]);
        // The blue channel comes first and lights the outermost row, third column.
        let png = psf_png(&view([7 * 8 + 2, 0, 0]), 8, 4.0, [2, 1, 0]);
        let picture = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!(*picture.get_pixel(2, 0), Rgb([0, 0, 128]));
        assert_eq!(*picture.get_pixel(0, 7), Rgb([128, 128, 0]));
    }

    #[test]
    fn the_window_holds_the_light() {
        let centred = view([3 * 8 + 3; 3]);
        assert_eq!(spread_um(&centred), 20.0);
        assert_eq!(window_um(&[&centred]), Some(40.0));
        let wide = view([0; 3]);
        assert_eq!(window_um(&[&centred, &wide]), Some(80.0));
        assert_eq!(window_um(&[]), None);
    }
}
