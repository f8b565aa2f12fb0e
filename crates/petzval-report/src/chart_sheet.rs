//! The sheet of a developed test chart: measured patches inside wanted ones, noise, and the response at slanted edges.

use maud::{Markup, html};
use petzval_camera::image::srgb_encode;
use petzval_camera::spectral::{CHART_COLUMNS, apply, d65_white, xyz_of_lab};
use petzval_lab::chart::{ChartFigures, EdgeFigures, PatchFigures};
use petzval_lab::sfr::FREQUENCY_STEP;

use crate::number::{fixed, with_error};
use crate::page::{Page, caption, facts, figure, section, with_contents};
use crate::plot::{Chart, Series, chart_svg, plain};
use crate::rgb_picture::{rgb_picture, shrunk};
use crate::table::{Column, Row, Table};
use crate::{palette, png};

/// A measured chart.
#[derive(Clone, Debug)]
pub struct ChartSheet<'a> {
    /// Name of the ISP.
    pub isp: String,
    /// Names and values of camera and exposure.
    pub facts: Vec<(&'a str, String)>,
    /// Names of the 24 patches.
    pub names: Vec<&'a str>,
    /// What was measured.
    pub figures: &'a ChartFigures,
    /// Rows of the picture.
    pub height: usize,
    /// Columns of the picture.
    pub width: usize,
    /// The picture: red, then green, then blue, sRGB-encoded, 0..1.
    pub encoded: Vec<f32>,
}

/// Columns of the shown picture, pixels.
const WIDTH: u32 = 900;

/// Side of a patch, and of the measured square in it, px.
const PATCH_PX: f64 = 100.0;
const MEASURED_PX: f64 = 60.0;

/// Highest frequency that is drawn, cycles per pixel.
const HIGHEST: f64 = 0.75;

/// The page of a sheet.
pub fn page(sheet: &ChartSheet) -> String {
    let figures = sheet.figures;
    let shown = shrunk(&rgb_picture(&sheet.encoded, sheet.height, sheet.width), WIDTH);
    let picture = html! { img.chart src=(png::address(&png::encode(&shown))) alt="the developed chart"; };
    let sections = [
        section("Picture", picture),
        section("Colours", colours(sheet)),
        section("Noise", noise(sheet)),
        section("Sharpness", sharpness(&figures.edges)),
    ];
    let main = html! {
        (facts(sheet.facts.iter().map(|(name, value)| (*name, Some(value.clone())))))
        (with_contents(&sections))
    };
    Page {
        title: format!("Test chart – {}", plain(&sheet.isp)),
        style: "img.chart { width: 100%; max-width: 900px; display: block; }",
        headline: format!("Test chart, developed by {}", sheet.isp),
        subtitle: html! {
            "ΔE00 " (fixed(figures.as_developed.mean_delta_e_2000, 2)) " in the mean, "
            (fixed(figures.as_developed.max_delta_e_2000, 2)) " at most; with normalised lightness "
            (fixed(figures.normalised.mean_delta_e_2000, 2)) " and " (fixed(figures.normalised.max_delta_e_2000, 2)) "."
        },
        main,
        ..Page::default()
    }
    .html()
}

/// The patches as they should be, with what was measured inside each.
fn colours(sheet: &ChartSheet) -> Markup {
    let patches = &sheet.figures.patches;
    let rows = patches.len().div_ceil(CHART_COLUMNS);
    let (width, height) = (PATCH_PX * CHART_COLUMNS as f64, PATCH_PX * rows as f64);
    let inset = 0.5 * (PATCH_PX - MEASURED_PX);
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {width} {height}")) role="img" aria-label="patches" {
            @for (i, patch) in patches.iter().enumerate() {
                @let (x, y) = ((i % CHART_COLUMNS) as f64 * PATCH_PX, (i / CHART_COLUMNS) as f64 * PATCH_PX);
                rect x=(x) y=(y) width=(PATCH_PX) height=(PATCH_PX) fill=(colour(patch.wanted_lab)) {}
                rect x=(x + inset) y=(y + inset) width=(MEASURED_PX) height=(MEASURED_PX) fill=(colour(patch.lab)) {}
            }
        }
    };
    let row = |(name, patch): (&&str, &PatchFigures)| {
        let lab = |v: [f64; 3]| v.map(|v| fixed(v, 1)).join(", ");
        Row::new(
            plain(name),
            [
                lab(patch.wanted_lab),
                lab(patch.lab),
                fixed(patch.delta_e_2000, 2),
                fixed(patch.normalised_delta_e_2000, 2),
            ],
        )
    };
    let columns = [
        Column::new("patch"),
        Column::new("wanted").unit("L*, a*, b*"),
        Column::new("measured").unit("L*, a*, b*"),
        Column::new("ΔE00"),
        Column::new("ΔE00").unit("lightness normalised"),
    ];
    html! {
        // Measured colours do not follow the colour scheme.
        figure.patches { (svg) }
        (caption(html! {
            "Inside each patch as it should be, as it was developed. Colours relative to D65; the lightness is normalised by one factor of the "
            "light, " (fixed(sheet.figures.normalised.factor, 3)) ", for all patches."
        }))
        (Table::new(columns).rows(sheet.names.iter().zip(patches).map(row)).html())
    }
}

fn noise(sheet: &ChartSheet) -> Markup {
    let row = |(name, patch): (&&str, &PatchFigures)| {
        let noise = patch.noise;
        let share = |v: f64| fixed(255.0 * v, 2);
        Row::new(
            plain(name),
            [
                share(noise.luma),
                share(noise.cb),
                share(noise.cr),
                noise.snr_db.map_or("–".to_owned(), |v| fixed(v, 1)),
            ],
        )
    };
    let columns = [
        Column::new("patch"),
        Column::new("luma").unit("of 255"),
        Column::new("Cb").unit("of 255"),
        Column::new("Cr").unit("of 255"),
        Column::new("signal to noise").unit("dB, linear luminance"),
    ];
    html! {
        (Table::new(columns).rows(sheet.names.iter().zip(&sheet.figures.patches).map(row)).html())
        (caption("Standard deviations of the encoded picture over each patch, without its linear gradient."))
    }
}

fn sharpness(edges: &[EdgeFigures]) -> Markup {
    let Some(axis) = edges.first() else { return html! {} };
    let standard = |edge: &&EdgeFigures| edge.contrast == axis.contrast;
    let corner = edges.iter().filter(standard).max_by(|a, b| a.field.total_cmp(&b.field)).unwrap_or(axis);
    let series = [("axis", axis), ("corner", corner)];
    let mut curves = Vec::new();
    for (name, edge) in series {
        for (side, modulation) in [("upright", &edge.across_upright), ("lying", &edge.across_lying)] {
            let points = modulation.iter().enumerate().map(|(k, v)| (k as f64 * FREQUENCY_STEP, *v));
            curves.push(Series {
                name: format!("{name}, {side} edges"),
                colour: palette::camera(curves.len() + 1).to_owned(),
                points: points.filter(|(frequency, _)| *frequency <= HIGHEST).collect(),
                ..Series::default()
            });
        }
    }
    let chart = Chart {
        alt: "Modulation over frequency".to_owned(),
        x_axis: "frequency, cycles per pixel".to_owned(),
        y_axis: "modulation".to_owned(),
        series: curves,
        ..Chart::default()
    };
    let percent = |value: Option<f64>, error: Option<f64>| {
        let value = value.map(|value| with_error(100.0 * value, 100.0 * error.unwrap_or(f64::NAN), 2));
        value.unwrap_or_else(|| "–".to_owned())
    };
    let row = |edge: &EdgeFigures| {
        let [overshoot_error, undershoot_error] =
            [0, 1].map(|i| edge.overshoot_error.map(|errors| errors[i]));
        Row::new(
            fixed(edge.field, 2),
            [
                edge.contrast.clone(),
                edge.mtf50_per_px.map_or("–".to_owned(), |v| {
                    with_error(v, edge.mtf50_standard_error.unwrap_or(f64::NAN), 4)
                }),
                percent(edge.overshoot, overshoot_error),
                percent(edge.undershoot, undershoot_error),
            ],
        )
    };
    let columns = [
        Column::new("field").unit("of the half diagonal"),
        Column::new("contrast"),
        Column::new("MTF50").unit("cycles per pixel"),
        Column::new("overshoot").unit("%"),
        Column::new("undershoot").unit("%"),
    ];
    let profile = |(k, (name, edge)): (usize, (&str, &EdgeFigures))| Series {
        name: name.to_owned(),
        colour: palette::camera(2 * k + 1).to_owned(),
        points: edge.profile.iter().filter(|(at, _)| at.abs() <= PROFILE_PX).copied().collect(),
        ..Series::default()
    };
    let profiles = Chart {
        alt: "Profile across an edge".to_owned(),
        x_axis: "distance from the edge, pixels".to_owned(),
        y_axis: "share of the step".to_owned(),
        series: series.into_iter().enumerate().map(profile).collect(),
        ..Chart::default()
    };
    html! {
        (figure(&chart_svg(&chart)))
        (caption(html! {
            "Slanted-edge response (ISO 12233) of the linear luminance; the corner is the target furthest from the axis, at "
            (fixed(corner.field, 2)) " of the half diagonal."
        }))
        @if series.iter().any(|(_, edge)| !edge.profile.is_empty()) {
            (figure(&chart_svg(&profiles)))
            (caption("Profile across one side of both targets, from dark, 0, to light, 1."))
        }
        (Table::new(columns).rows(edges.iter().map(row)).html())
        (caption("± are standard errors from the noise of the pixels."))
    }
}

/// Pixels of a profile that are shown on either side of the edge.
const PROFILE_PX: f64 = 8.0;

/// The nearest colour of a display.
fn colour(lab: [f64; 3]) -> String {
    let (white, _, srgb_of_xyz) = d65_white();
    let rgb = apply(&srgb_of_xyz, xyz_of_lab(lab, white));
    let [r, g, b] = rgb.map(|v| (srgb_encode(v.clamp(0.0, 1.0) as f32) * 255.0).round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use petzval_lab::chart::{Lightness, PatchNoise};

    use super::*;
    use crate::page::assert_readable;

    #[test]
    fn the_page_shows_every_patch_twice_and_both_ends_of_the_field() {
        let noise = PatchNoise { luma: 0.01, cb: 0.002, cr: 0.002, snr_db: Some(31.5) };
        let patch = PatchFigures {
            wanted_lab: [50.0, 0.0, 0.0],
            lab: [60.0, 0.0, 0.0],
            delta_e_2000: 9.5,
            normalised_delta_e_2000: 0.5,
            noise,
        };
        let edge = |field: f64| EdgeFigures {
            contrast: "4.1:1".into(),
            field,
            mtf50_per_px: Some(0.31),
            mtf50_standard_error: Some(0.0021),
            across_upright: vec![1.0; 101],
            across_lying: vec![0.9; 101],
            across_upright_error: vec![0.01; 101],
            across_lying_error: vec![0.01; 101],
            overshoot: Some(0.12),
            undershoot: Some(0.04),
            overshoot_error: Some([0.003, 0.002]),
            profile: vec![(-1.0, 0.0), (1.0, 1.0)],
            failures: vec![],
        };
        let lightness = Lightness { factor: 0.8, mean_delta_e_2000: 9.5, max_delta_e_2000: 9.5 };
        let figures = ChartFigures {
            as_developed: lightness,
            normalised: lightness,
            patches: vec![patch; 24],
            edges: vec![edge(0.0), edge(0.84)],
        };
        let page = page(&ChartSheet {
            isp: "a <chip>".into(),
            facts: vec![("lens", "triplet".into())],
            names: vec!["dark skin"; 24],
            figures: &figures,
            height: 20,
            width: 30,
            encoded: vec![0.5; 1800],
        });
        // L* = 50 and 60 of gray.
        assert_eq!((page.matches("#777777").count(), page.matches("#919191").count()), (24, 24));
        assert_readable(&page);
        for words in [
            "a &lt;chip&gt;",
            "axis, upright edges",
            "corner, lying edges",
            "0.84",
            "0.310 ± 0.002",
            "12.0 ± 0.3",
            "4.0 ± 0.2",
            "31.5",
        ] {
            assert!(page.contains(words), "{words}");
        }
    }
}
