//! The page: PSFs side by side, errors beside what noise and demosaicing do, and what was odd. One self-contained file.

use std::collections::BTreeMap;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};
use petzval_camera::image::CHANNELS;
use petzval_lab::psf_calibration::held_out::HeldOutBy;

use super::sheet::{DECADES, Tone, kinds, picture, png};
use super::{Calibration, by_direction};
use crate::page::Page;
use crate::plot::plain;

const STYLE: &str = include_str!("page.css");

/// The page. It needs nothing but itself, and prints well.
pub fn page(calibration: &Calibration) -> String {
    let title = plain(&calibration.captures);
    let main = html! {
        @for (direction, members) in by_direction(calibration) {
            section { h2 { "PSFs, " (direction) } (pictures(calibration, &members)) }
        }
        p.caption {
            "Each picture is 23 × 23 pixels around the green centroid, rows as on the sensor, every channel of unit sum. "
            "Linear brightness above, below it the logarithm over " (DECADES) " decades. "
            @if calibration.lens.is_some() {
                "“Same mosaic”: the simulated PSF landed where it fits best, kept by the same colours and "
                "demosaiced. “Ideal pixels”: every colour in every pixel."
            }
        }
        @if calibration.lens.is_some() {
            section { h2 { "L1 distance from the simulated PSF" } (distances(calibration)) }
        }
        section { h2 { "Centroids" } (centroids(calibration)) }
        section { h2 { "Light" } (light(calibration)) }
        section { h2 { "Exposures" } (exposures(calibration)) }
        section { h2 { "Bank for the renderer" } (fields(calibration)) }
        section { h2 { "Warnings" } (warnings(calibration)) }
    };
    Page {
        title: html! { "PSF calibration – " (title) },
        style: STYLE,
        headline: html! { "PSF calibration" },
        subtitle: html! { (subtitle(calibration)) },
        main,
    }
    .html()
}

fn subtitle(calibration: &Calibration) -> Markup {
    html! {
        (plain(&calibration.captures)) ": " (calibration.positions.len()) " positions through "
        (plain(&calibration.sensor))
        @if let Some(lens) = &calibration.lens { ", beside " (plain(lens)) " as traced" }
        "."
        @if calibration.fields.iter().any(|f| f.is_mono) {
            " The sensor is monochrome: its one channel stands for red, green and blue."
        }
    }
}

fn pictures(calibration: &Calibration, members: &[usize]) -> Markup {
    let names: Vec<&str> =
        members.first().map_or(Vec::new(), |i| kinds(calibration, *i).into_iter().map(|k| k.0).collect());
    html! {
        div.scroll {
            table.psfs {
                thead {
                    tr {
                        th {}
                        @for i in members { th { (format!("{:.2}", calibration.positions[*i].0.field_radius_mm)) " mm" } }
                    }
                }
                tbody {
                    @for tone in [Tone::Linear, Tone::Log] {
                        @for (k, name) in names.iter().enumerate() {
                            tr class=[(tone == Tone::Log && k == 0).then_some("log-first")] {
                                th { (name) br; @if tone == Tone::Log { "log" } @else { "linear" } }
                                @for i in members {
                                    td { (cell(calibration, *i, k, tone)) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn cell(calibration: &Calibration, index: usize, kind: usize, tone: Tone) -> Markup {
    let shown = kinds(calibration, index);
    let Some((name, values)) = shown.get(kind) else { return html! { "–" } };
    let alt = format!("{}: {name}", plain(&calibration.positions[index].0.name));
    let data = STANDARD.encode(png(&picture(values, tone)));
    html! { img src=(format!("data:image/png;base64,{data}")) alt=(alt); }
}

/// Three numbers, one per channel.
fn triple(values: [f64; CHANNELS], digits: usize) -> Markup {
    html! { @for v in values { td { (format!("{v:.digits$}")) } } }
}

fn distances(calibration: &Calibration) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "position" }
                        th colspan="3" { "same mosaic" }
                        th colspan="3" { "noise floor" }
                        th colspan="3" { "ideal pixels" }
                        th colspan="3" { "demosaicing alone" }
                    }
                    tr { th {} @for _ in 0..4 { th { "R" } th { "G" } th { "B" } } }
                }
                tbody {
                    @for (position, comparison) in &calibration.positions {
                        @if let Some(c) = comparison {
                            tr {
                                th { (plain(&position.name)) }
                                (triple(c.l1, 4)) (triple(position.measured.floor.l1, 4)) (triple(c.l1_ideal, 4))
                                (triple(c.demosaic_l1, 4))
                            }
                        }
                    }
                }
            }
        }
        p.caption {
            "Sum of absolute differences of PSFs of unit sum: 0 for equal, 2 for disjoint ones. Right sensor, lens and model put “same "
            "mosaic” on the noise floor. The floor is the mean distance that draws of the merged noise cause, background and "
            "normalisation included."
        }
    }
}

fn centroids(calibration: &Calibration) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "position" }
                        th { "row" span.unit { "px" } }
                        th { "column" span.unit { "px" } }
                        th { "standard error" span.unit { "10⁻³ px" } }
                        @if calibration.lens.is_some() {
                            th { "green error" span.unit { "ideal pixels, 10⁻³ px" } }
                            th { "green error" span.unit { "same mosaic, 10⁻³ px" } }
                            th { "red – green" span.unit { "same mosaic, 10⁻³ px" } }
                            th { "blue – green" span.unit { "same mosaic, 10⁻³ px" } }
                        }
                    }
                }
                tbody {
                    @for (position, comparison) in &calibration.positions {
                        @let m = &position.measured;
                        tr {
                            th { (plain(&position.name)) }
                            td { (format!("{:.3}", position.frame.placement.row as f64 + m.psf.centroid_px[1][0])) }
                            td { (format!("{:.3}", position.frame.placement.col as f64 + m.psf.centroid_px[1][1])) }
                            td { (pair(m.centroid_se_px)) }
                            @if calibration.lens.is_some() {
                                @match comparison {
                                    Some(c) => {
                                        @let e = c.centroid_error_px;
                                        @for error in [c.centroid_error_ideal_px[1], e[1]] {
                                            td { @if c.is_placed { (pair(error)) } @else { "–" } }
                                        }
                                        @for channel in [0, 2] {
                                            td { (pair([0, 1].map(|axis| e[channel][axis] - e[1][axis]))) }
                                        }
                                    }
                                    None => { @for _ in 0..4 { td { "–" } } }
                                }
                            }
                        }
                    }
                }
            }
        }
        p.caption { "Row and column are those of the green centroid on the sensor; the standard error is that of both. "
            @if calibration.lens.is_some() {
                "Pairs are row and column. Errors are measured less simulated; a dash where the manifest does not say where the chief ray "
                "should land. “Ideal pixels” is the error of the measured centroid, that of demosaicing included; “same mosaic” leaves "
                "demosaicing out and shows what noise does."
            }
        }
    }
}

fn light(calibration: &Calibration) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "position" }
                        th { "light" span.unit { "R, G, B, Me⁻/s" } }
                        th { "standard error" span.unit { "R, G, B, %" } }
                    }
                }
                tbody {
                    @for (position, _) in &calibration.positions {
                        @let m = &position.measured;
                        tr {
                            th { (plain(&position.name)) }
                            td { (m.psf.light_e_per_s.map(|v| format!("{:.3}", 1e-6 * v)).join(", ")) }
                            td { (m.floor.light.map(|v| format!("{:.2}", 100.0 * v)).join(", ")) }
                        }
                    }
                }
            }
        }
        p.caption { "The sum of the demosaiced PSF: of spots no wider than a few pixels it depends on where they fall on the mosaic, which the "
            "bank's relative illumination does not." }
    }
}

fn pair(values: [f64; 2]) -> String {
    values.map(|v| format!("{:.1}", 1e3 * v)).join(", ")
}

fn exposures(calibration: &Calibration) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "position" } th { "exposure" span.unit { "ms" } } th { "frames" } th { "dark frames" }
                        th { "saturated" span.unit { "pixels" } }
                        th { "variance" span.unit { "measured / modelled" } }
                        th { "light" span.unit { "over the other exposures" } }
                        th { "χ²" span.unit { "against the others" } }
                    }
                }
                tbody {
                    @for (position, _) in &calibration.positions {
                        @for (k, e) in position.exposures.iter().enumerate() {
                            tr {
                                th { @if k == 0 { (plain(&position.name)) } } td { (e.exposure_ms) } td { (e.frames) } td { (e.dark_frames) }
                                td { (e.saturated_pixels) }
                                td { @match e.variance_ratio { Some(r) => (format!("{r:.3}")), None => "–" } }
                                @let agreement = e.agreement.map(|a| [format!("{:.4}", a.ratio), format!("{:.2}", a.chi2)]);
                                @for figure in agreement.unwrap_or_else(|| ["–", "–"].map(String::from)) { td { (figure) } }
                            }
                        }
                    }
                }
            }
        }
        p.caption { "Variance: that of the frames of one exposure over what the sensor model says, 1 for the right sensor. Light and χ² compare the "
            "bright pixels of an exposure with all other exposures of its position; both are 1 where they show the same light. A dash: "
            "one frame, or no bright pixel that is usable in another exposure." }
    }
}

fn fields(calibration: &Calibration) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "field radius" span.unit { "mm" } } th { "positions" } th { "held out" }
                        th { "held-out L1" span.unit { "R, G, B" } } th { "L1 of noise" span.unit { "R, G, B" } }
                        th { "held-out χ²" span.unit { "R, G, B" } } th { "fitted χ²" span.unit { "R, G, B" } }
                        th { "blobs" span.unit { "R, G, B, px" } }
                    }
                }
                tbody {
                    @for f in &calibration.fields {
                        tr {
                            th { (format!("{:.3}", f.field_radius_mm)) } td { (f.positions) }
                            td { @match f.held_out.by { HeldOutBy::Positions => "positions", HeldOutBy::Pixels => "pixels" } }
                            td { (f.held_out.score.map(|s| format!("{:.3}", s.l1())).join(", ")) }
                            td { (f.held_out.score.map(|s| format!("{:.3}", s.noise_l1())).join(", ")) }
                            td { (f.held_out.score.map(|s| format!("{:.1}", s.chi2())).join(", ")) }
                            td { (f.chi2.map(|v| format!("{v:.2}")).join(", ")) }
                            td { (f.blob_px.map(|v| format!("{v:.2}")).join(", ")) }
                        }
                    }
                }
            }
        }
        p.caption { "Light on cells of a third of a pixel that predicts best the mosaics of directions that took no part in the fit. Held-out "
            "L1 and χ² say how well it does: L1 is the sum of absolute differences over the light on the colour’s pixels, middle and light of the "
            "held-out position free. They hold for the directions and sub-pixel phases captured, and are a little flattered, because smoothness was "
            "chosen by them. Held out is each position in turn, or of a lone one each fifth of its pixels, which says nothing about another phase. Fitted χ² well above 1 says that "
            "positions disagree or that no smooth PSF explains them: a lens that is not rotationally symmetric, a wrong azimuth, detail below "
            "the pixel." }
    }
}

fn warnings(calibration: &Calibration) -> Markup {
    // The same words about several positions are said once.
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
        @if said.is_empty() && of_bank.is_empty() { p { "None." } }
        ul.warnings {
            @for (warning, positions) in said {
                li {
                    (plain(warning)) " ("
                    @if positions.len() == calibration.positions.len() { "all positions" } @else { (plain(&positions.join(", "))) }
                    ")"
                }
            }
            @for (radius_mm, warnings) in &of_bank { li { "Bank, " (format!("{radius_mm:.2}")) " mm: " (warnings) } }
        }
    }
}
