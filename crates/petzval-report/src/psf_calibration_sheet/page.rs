//! The page: a summary with warnings, PSFs side by side, and errors compared with the effects of noise and demosaicing.
//! One self-contained file.

use std::collections::BTreeMap;

use maud::{Markup, html};
use petzval_camera::image::CHANNELS;
use petzval_lab::psf_calibration::CalibratedPosition;
use petzval_lab::psf_calibration::compare::Comparison;
use petzval_lab::psf_calibration::estimate::FieldEstimate;
use petzval_lab::psf_calibration::held_out::HeldOutBy;

use super::sheet::{DECADES, Tone, kinds, picture};
use super::{Calibration, by_direction};
use crate::number::fixed;
use crate::page::{Page, Tile, caption, facts, numbers, section, with_contents};
use crate::plot::{plain, span};
use crate::png;
use crate::table::{Column, Row, Table};
use crate::words::capitalised;

/// The page. It is self-contained and suitable for printing.
pub fn page(calibration: &Calibration) -> String {
    let mut sections = vec![section("Summary", html! { (answer(calibration)) (summary(calibration)) })];
    sections.push(section("PSFs", side_by_side(calibration)));
    if calibration.lens.is_some() {
        sections.push(section("L1 distance from the simulated PSF", distances(calibration)));
    }
    sections.extend([
        section("Centroids", centroids(calibration)),
        section("Light", light(calibration)),
        section("Exposures", exposures(calibration)),
        section("Bank for the renderer", fields(calibration)),
    ]);
    Page {
        title: format!("PSF calibration – {}", calibration.captures),
        style: include_str!("page.css"),
        headline: "PSF calibration".into(),
        subtitle: subtitle(calibration),
        main: with_contents(&sections),
        ..Page::default()
    }
    .html()
}

/// Whether measured and simulated PSFs differ by more than noise, with three numbers. Nothing without a lens to compare with.
fn answer(calibration: &Calibration) -> Markup {
    let compared: Vec<(&CalibratedPosition, &Comparison)> =
        calibration.positions.iter().filter_map(|(p, c)| Some((p, c.as_ref()?))).collect();
    if compared.is_empty() {
        return html! {};
    }
    let median = |of: fn(&(&CalibratedPosition, &Comparison)) -> f64| {
        petzval_base::statistics::median(compared.iter().map(of).collect::<Vec<f64>>())
    };
    let (found, noise) = (median(|(_, c)| c.l1[1]), median(|(p, _)| p.measured.floor.l1[1]));
    let ratio = found / noise;
    let verdict = if ratio <= BY_NOISE {
        "no more than noise alone makes them".to_owned()
    } else {
        format!("{} times as much as noise alone makes them", fixed(ratio, 1))
    };
    let tile = |value: String, label: &str| Tile { value, label: label.to_owned(), is_gain: None };
    html! {
        p.lead.answer { "Measured and simulated PSFs differ " (verdict) "." }
        (numbers(&[
            tile(fixed(found, 3), "L1 distance, green, median over the positions"),
            tile(fixed(noise, 3), "the same by noise alone"),
            tile(
                format!("{} of {}", compared.iter().filter(|(p, c)| c.l1[1] <= BY_NOISE * p.measured.floor.l1[1]).count(), compared.len()),
                "positions where noise explains the distance",
            ),
        ]))
    }
}

/// Distances up to this many times that of noise alone are its own: floors of a few frames are known to a fifth.
const BY_NOISE: f64 = 1.5;

/// What was measured, how good it is, and where it does not hold.
fn summary(calibration: &Calibration) -> Markup {
    let positions = || calibration.positions.iter().map(|(position, _)| position);
    let exposures = || positions().flat_map(|p| &p.exposures);
    let (frames, dark) = exposures().fold((0, 0), |(a, b), e| (a + e.frames, b + e.dark_frames));
    let range = |values: Option<(f64, f64)>, decimals: usize, unit: &str| {
        let (low, high) = values?;
        let [low, high] = [low, high].map(|v| fixed(v, decimals));
        Some(if low == high { format!("{low} {unit}") } else { format!("{low} to {high} {unit}") })
    };
    let greatest = |values: &mut dyn Iterator<Item = f64>| span(values).map(|(_, high)| high);
    let middle = |values: Vec<f64>| petzval_base::statistics::median(values);
    let compared: Vec<(&CalibratedPosition, &Comparison)> =
        calibration.positions.iter().filter_map(|(p, c)| Some((p, c.as_ref()?))).collect();
    let green = |of: fn(&(&CalibratedPosition, &Comparison)) -> f64| -> Option<f64> {
        (!compared.is_empty()).then(|| middle(compared.iter().map(of).collect()))
    };
    let worst = compared.iter().max_by(|a, b| a.1.l1[1].total_cmp(&b.1.l1[1]));
    let of_bank = |of: fn(&FieldEstimate) -> f64| -> Option<f64> {
        (!calibration.fields.is_empty()).then(|| middle(calibration.fields.iter().map(of).collect()))
    };
    let l1 = |value: Option<f64>| value.map(|v| fixed(v, 3));
    let radii = span(positions().map(|p| p.field_radius_mm));
    html! {
        h3 { "What was measured" }
        (facts([
            ("positions", Some(calibration.positions.len().to_string())),
            ("field radii", range(radii, 2, "mm")),
            ("exposure times", range(span(exposures().map(|e| e.exposure_ms)), 1, "ms")),
            ("frames", Some(frames.to_string())),
            ("dark frames", Some(dark.to_string())),
            ("fields of the bank", Some(calibration.fields.len().to_string())),
        ]))
        h3 { "How good it is" }
        (facts([
            (
                "standard error of a centroid, at most",
                greatest(&mut positions().flat_map(|p| p.measured.centroid_se_px)).map(|v| format!("{} px", fixed(v, 4))),
            ),
            (
                "standard error of the green light, at most",
                greatest(&mut positions().map(|p| p.measured.floor.light[1])).map(|v| format!("{} %", fixed(100.0 * v, 2))),
            ),
            ("L1 distance from the simulated PSF, green, median", l1(green(|(_, c)| c.l1[1]))),
            ("the same by noise alone", l1(green(|(p, _)| p.measured.floor.l1[1]))),
            (
                "largest distance",
                worst.map(|(p, c)| format!("{} at {}", fixed(c.l1[1], 3), p.name)),
            ),
            ("L1 distance of held-out green pixels from the bank, median", l1(of_bank(|f| f.held_out.score[1].l1()))),
            ("the same by noise alone", l1(of_bank(|f| f.held_out.score[1].noise_l1()))),
        ]))
        h3 { "Where it does not hold" }
        (warnings(calibration, radii))
    }
}

fn subtitle(calibration: &Calibration) -> Markup {
    html! {
        (plain(&calibration.captures)) ": " (calibration.positions.len()) " positions through "
        (plain(&calibration.sensor))
        @if let Some(lens) = &calibration.lens { ", beside " (plain(lens)) " as traced" }
        "."
        @if calibration.fields.iter().any(|f| f.is_mono) {
            " The sensor is monochrome: its one channel is used for red, green and blue."
        }
    }
}

/// What the pictures are.
fn how_to_read_pictures(calibration: &Calibration) -> Markup {
    caption(html! {
        "Each picture is 23 × 23 pixels around the green centroid, rows as on the sensor, every channel of unit sum. "
        "Linear brightness above, below it the logarithm over " (DECADES) " decades. "
        @if calibration.lens.is_some() {
            "“Same mosaic”: the simulated PSF at its best-fitting position, sampled by the same mosaic and "
            "demosaiced. “Ideal pixels”: every colour in every pixel."
        }
    })
}

/// The PSFs of all directions.
fn side_by_side(calibration: &Calibration) -> Markup {
    html! {
        div.directions {
            @for (direction, members) in by_direction(calibration) {
                div { h3 { (direction) } (pictures(calibration, &members)) }
            }
        }
        (how_to_read_pictures(calibration))
    }
}

/// The PSFs of one direction: a column for each field radius, a row for each kind of picture.
fn pictures(calibration: &Calibration, members: &[usize]) -> Markup {
    let names: Vec<&str> =
        members.first().map_or(Vec::new(), |i| kinds(calibration, *i).into_iter().map(|k| k.0).collect());
    let radius =
        |i: &usize| Column::new(format!("{} mm", fixed(calibration.positions[*i].0.field_radius_mm, 2)));
    let mut rows = Vec::new();
    for tone in [Tone::Linear, Tone::Log] {
        for (k, name) in names.iter().enumerate() {
            let head = html! { (name) br; @if tone == Tone::Log { "log" } @else { "linear" } };
            let row = Row::new(head, members.iter().map(|i| cell(calibration, *i, k, tone)));
            rows.push(if tone == Tone::Log && k == 0 { row.class("log-first") } else { row });
        }
    }
    Table::new([Column::new("")].into_iter().chain(members.iter().map(radius)))
        .class("psfs")
        .rows(rows)
        .html()
}

fn cell(calibration: &Calibration, index: usize, kind: usize, tone: Tone) -> Markup {
    let shown = kinds(calibration, index);
    let Some((name, values)) = shown.get(kind) else { return html! { "–" } };
    let alt = format!("{}: {name}", plain(&calibration.positions[index].0.name));
    html! { img.pixels src=(png::address(&png::encode(&picture(values, tone)))) alt=(alt); }
}

/// Numbers between commas: those of red, green and blue, or of row and column.
fn list<const N: usize>(values: [f64; N], decimals: usize) -> String {
    values.map(|v| fixed(v, decimals)).join(", ")
}

/// Row and column, 10^-3 pixels.
fn pair(values_px: [f64; 2]) -> String {
    list(values_px.map(|v| 1e3 * v), 1)
}

fn distances(calibration: &Calibration) -> Markup {
    let groups = ["same mosaic", "noise floor", "ideal pixels", "demosaicing alone"];
    let channels = groups.iter().flat_map(|_| ["R", "G", "B"].map(Column::new));
    let rows = calibration.positions.iter().filter_map(|(position, comparison)| {
        let c = comparison.as_ref()?;
        let distances: [[f64; CHANNELS]; 4] = [c.l1, position.measured.floor.l1, c.l1_ideal, c.demosaic_l1];
        Some(Row::new(plain(&position.name), distances.into_iter().flatten().map(|v| fixed(v, 4))))
    });
    let table = Table::new([Column::new("position")].into_iter().chain(channels))
        .groups(groups.map(|name| (name, CHANNELS)))
        .rows(rows);
    html! {
        (table.html())
        (caption(
            "Sum of absolute differences of PSFs of unit sum: 0 for equal, 2 for disjoint ones. Right sensor, lens and model put “same \
             mosaic” on the noise floor. The floor is the mean distance that draws of the merged noise cause, background and \
             normalisation included.",
        ))
    }
}

fn centroids(calibration: &Calibration) -> Markup {
    let mut columns = vec![
        Column::new("position"),
        Column::new("row").unit("px"),
        Column::new("column").unit("px"),
        Column::new("standard error").unit("10⁻³ px"),
    ];
    if calibration.lens.is_some() {
        columns.extend([
            Column::new("green error").unit("ideal pixels, 10⁻³ px"),
            Column::new("green error").unit("same mosaic, 10⁻³ px"),
            Column::new("red – green").unit("same mosaic, 10⁻³ px"),
            Column::new("blue – green").unit("same mosaic, 10⁻³ px"),
        ]);
    }
    let rows = calibration.positions.iter().map(|(position, comparison)| {
        let (m, placement) = (&position.measured, &position.frame.placement);
        let mut cells = vec![
            fixed(placement.row as f64 + m.psf.centroid_px[1][0], 3),
            fixed(placement.col as f64 + m.psf.centroid_px[1][1], 3),
            pair(m.centroid_se_px),
        ];
        if calibration.lens.is_some() {
            cells.extend(match comparison {
                Some(c) => {
                    let e = c.centroid_error_px;
                    let placed = |error| if c.is_placed { pair(error) } else { "–".to_owned() };
                    let from_green = |channel: usize| pair([0, 1].map(|axis| e[channel][axis] - e[1][axis]));
                    [placed(c.centroid_error_ideal_px[1]), placed(e[1]), from_green(0), from_green(2)]
                }
                None => ["–"; 4].map(str::to_owned),
            });
        }
        Row::new(plain(&position.name), cells)
    });
    html! {
        (Table::new(columns).rows(rows).html())
        (caption(html! {
            "Row and column are those of the green centroid on the sensor; the standard error is that of both. "
            @if calibration.lens.is_some() {
                "Pairs are row and column. Errors are measured minus simulated; a dash if the manifest does not state where the chief ray "
                "should land. “Ideal pixels” is the error of the measured centroid, that of demosaicing included; “same mosaic” leaves "
                "demosaicing out and shows what noise does."
            }
        }))
    }
}

fn light(calibration: &Calibration) -> Markup {
    let columns = [
        Column::new("position"),
        Column::new("light").unit("R, G, B, Me⁻/s"),
        Column::new("standard error").unit("R, G, B, %"),
    ];
    let rows = calibration.positions.iter().map(|(position, _)| {
        let m = &position.measured;
        let cells =
            [list(m.psf.light_e_per_s.map(|v| 1e-6 * v), 3), list(m.floor.light.map(|v| 100.0 * v), 2)];
        Row::new(plain(&position.name), cells)
    });
    html! {
        (Table::new(columns).rows(rows).html())
        (caption(
            "The sum of the demosaiced PSF: of spots no wider than a few pixels it depends on where they fall on the mosaic, which the \
             bank's relative illumination does not.",
        ))
    }
}

fn exposures(calibration: &Calibration) -> Markup {
    let columns = [
        Column::new("position"),
        Column::new("exposure").unit("ms"),
        Column::new("frames"),
        Column::new("dark frames"),
        Column::new("saturated").unit("pixels"),
        Column::new("variance").unit("measured / modelled"),
        Column::new("light").unit("over the other exposures"),
        Column::new("χ²").unit("against the others"),
    ];
    let unknown = || "–".to_owned();
    let rows = calibration.positions.iter().flat_map(|(position, _)| {
        position.exposures.iter().enumerate().map(move |(k, e)| {
            let cells = [
                e.exposure_ms.to_string(),
                e.frames.to_string(),
                e.dark_frames.to_string(),
                e.saturated_pixels.to_string(),
                e.variance_ratio.map_or_else(unknown, |r| fixed(r, 3)),
                e.agreement.map_or_else(unknown, |a| fixed(a.ratio, 4)),
                e.agreement.map_or_else(unknown, |a| fixed(a.chi2, 2)),
            ];
            Row::new(if k == 0 { plain(&position.name) } else { String::new() }, cells)
        })
    });
    html! {
        (Table::new(columns).rows(rows).html())
        (caption(
            "Variance: that of the frames of one exposure over what the sensor model says, 1 for the right sensor. Light and χ² compare the \
             bright pixels of an exposure with all other exposures of its position; both are 1 where they show the same light. A dash: \
             one frame, or no bright pixel that is usable in another exposure.",
        ))
    }
}

fn fields(calibration: &Calibration) -> Markup {
    let columns = [
        Column::new("field radius").unit("mm"),
        Column::new("positions"),
        Column::new("held out"),
        Column::new("held-out L1").unit("R, G, B"),
        Column::new("L1 of noise").unit("R, G, B"),
        Column::new("held-out χ²").unit("R, G, B"),
        Column::new("fitted χ²").unit("R, G, B"),
        Column::new("blobs").unit("R, G, B, px"),
    ];
    let rows = calibration.fields.iter().map(|f| {
        let by = match f.held_out.by {
            HeldOutBy::Positions => "positions",
            HeldOutBy::Pixels => "pixels",
        };
        let cells = [
            f.positions.to_string(),
            by.to_owned(),
            list(f.held_out.score.map(|s| s.l1()), 3),
            list(f.held_out.score.map(|s| s.noise_l1()), 3),
            list(f.held_out.score.map(|s| s.chi2()), 1),
            list(f.chi2, 2),
            list(f.blob_px, 2),
        ];
        Row::new(fixed(f.field_radius_mm, 3), cells)
    });
    html! {
        (Table::new(columns).rows(rows).html())
        (caption(
            "Light on cells of a third of a pixel that predicts best the mosaics of directions that took no part in the fit. Held-out \
             L1 and χ² say how well it does: L1 is the sum of absolute differences over the light on the colour’s pixels, middle and light \
             of the held-out position free. They hold for the directions and sub-pixel phases captured, and are a little flattered, because \
             smoothness was chosen by them. Held out is each position in turn, or of a lone one each fifth of its pixels, which says nothing \
             about another phase. Fitted χ² well above 1 says that positions disagree or that no smooth PSF explains them: a lens that is not \
             rotationally symmetric, a wrong azimuth, detail below the pixel.",
        ))
    }
}

fn warnings(calibration: &Calibration, radii_mm: Option<(f64, f64)>) -> Markup {
    // Print equal warnings about several positions once.
    let mut said: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (position, _) in &calibration.positions {
        for warning in &position.warnings {
            said.entry(warning).or_default().push(&position.name);
        }
    }
    let of_bank: Vec<(f64, String)> = calibration
        .fields
        .iter()
        .map(|f| (f.field_radius_mm, f.warnings().join("; ")))
        .filter(|(_, warnings)| !warnings.is_empty())
        .collect();
    html! {
        ul.warnings {
            @if let Some((_, farthest)) = radii_mm {
                li { "Nothing was measured farther than " (fixed(farthest, 2)) " mm from the axis, nor in other directions than those below." }
            }
            @for (warning, positions) in said {
                li {
                    (plain(&capitalised(warning))) " ("
                    @if positions.len() == calibration.positions.len() { "all positions" } @else { (plain(&positions.join(", "))) }
                    ")"
                }
            }
            @for (radius_mm, warnings) in &of_bank { li { "Bank, " (format!("{radius_mm:.2}")) " mm: " (warnings) } }
        }
    }
}
