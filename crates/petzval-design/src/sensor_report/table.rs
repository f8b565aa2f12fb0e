//! Tables: what was known, the figures of EMVA 1288, the fit over all gains beside the paper's tables, warnings.

use maud::{Markup, html};
use petzval_camera::emva::captures::Kind;
use petzval_camera::emva::{ChannelResult, Characterization, Figure, HighPass, Measured};

use super::Shown;
use super::style::{colour_name, short, significant, with_error};
use crate::plot::plain;
use crate::report::number;

/// Figures of the table that release 4.0 asks for: computer name and symbol, in the order of its report.
const FIGURES: [(&str, &str); 32] = [
    ("QE", "η"),
    ("R", "R"),
    ("K", "K"),
    ("inverse_K", "1/K"),
    ("sigma_d", "σ_d"),
    ("sigma_y_dark", "σ_y.dark"),
    ("SNR_max", "SNR_max"),
    ("SNR_max_dB", ""),
    ("SNR_max_bit", ""),
    ("inverse_SNR_max", "1/SNR_max"),
    ("u_p_min", "μ_p.min"),
    ("u_p_min_area", ""),
    ("u_e_min", "μ_e.min"),
    ("u_e_min_area", ""),
    ("u_p_sat", "μ_p.sat"),
    ("u_p_sat_area", ""),
    ("u_e_sat", "μ_e.sat"),
    ("u_e_sat_area", ""),
    ("DR", "DR"),
    ("DR_dB", ""),
    ("DSNU1288", "DSNU"),
    ("DSNU1288_row", "DSNU_row"),
    ("DSNU1288_col", "DSNU_col"),
    ("DSNU1288_pixel", "DSNU_pixel"),
    ("PRNU1288", "PRNU"),
    ("PRNU1288_row", "PRNU_row"),
    ("PRNU1288_col", "PRNU_col"),
    ("PRNU1288_pixel", "PRNU_pixel"),
    ("LE_min", "LE_min"),
    ("LE_max", "LE_max"),
    ("u_I_mean", "μ_I.mean"),
    ("u_I_var", "μ_I.var"),
];

/// A symbol with its index as a subscript: `σ_d`.
fn symbol(text: &str) -> Markup {
    match text.split_once('_') {
        Some((base, index)) => html! { (base) sub { (index) } },
        None => html! { (text) },
    }
}

/// A unit as it is printed: `e-/um2` becomes e⁻/µm².
fn unit(text: &str) -> String {
    text.replace("e-", "e⁻").replace("um2", "µm²").replace("DN2", "DN²")
}

/// A measured value, or why there is none.
fn measured(value: &Measured) -> Markup {
    html! {
        @match (with_error(value), value.reason()) {
            (Some(text), _) => (text),
            (None, Some(why)) => { span.unresolved { "not resolved" span.why { (why.to_string()) } } }
            (None, None) => { "–" }
        }
    }
}

/// Rows of two columns; what is not stated has no row.
fn facts(rows: &[(&str, Option<String>)]) -> Markup {
    html! {
        dl.first-order {
            @for (name, value) in rows {
                @if let Some(value) = value { div { dt { (name) } dd { (plain(value)) } } }
            }
        }
    }
}

/// What is known of the sensor.
pub(super) fn basic_data(all: &Characterization) -> Markup {
    let s = &all.sensor;
    let number = |v: Option<f64>, unit: &str| v.map(|v| format!("{} {unit}", significant(v, 6)));
    let diagonal = s.pixel_um.map(|pitch| 1e-3 * pitch * (all.height as f64).hypot(all.width as f64));
    let colour = if s.cfa.colours().len() > 1 { s.cfa.to_string() } else { "none (monochrome)".to_owned() };
    facts(&[
        ("sensor", Some(s.name.clone())),
        ("type of data", Some("single".to_owned())),
        ("size of the frames", Some(format!("{} × {} pixels", all.width, all.height))),
        ("pixel pitch", number(s.pixel_um, "µm")),
        ("diagonal of the frames", diagonal.map(|d| format!("{} mm", short(d, 2)))),
        ("colour filter array", Some(colour)),
        ("bits", Some(s.bits.to_string())),
        ("black level, as set", number(s.black_level_dn, "DN")),
        ("full well, as stated", number(s.full_well_e, "e⁻")),
    ])
}

/// At which setting the plots and figures hold.
pub(super) fn operating_point(shown: &Shown<'_>) -> Markup {
    let (all, gain) = (shown.all, shown.gain);
    let s = &all.sensor;
    let range = |values: Vec<f64>, unit: &str| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let text = match high > low {
            true => format!("{} … {} {unit}", significant(low, 4), significant(high, 4)),
            false => format!("{} {unit}", significant(low, 4)),
        };
        (!values.is_empty()).then_some(text)
    };
    let points = shown.channels().first().map_or(&[][..], |c| &c.points[..]);
    let times = points.iter().map(|p| 1e3 * p.exposure_s).collect::<Vec<f64>>();
    let photons: Option<Vec<f64>> = points.iter().map(|p| p.photons).collect();
    let dark_times = gain.dark.points.iter().map(|p| 1e3 * p.exposure_s).collect::<Vec<f64>>();
    let spatial = shown.channels().iter().find_map(|c| c.spatial.as_ref());
    let high_pass = match all.options.high_pass {
        HighPass::None => "none",
        HighPass::R31 => "release 3.1",
        HighPass::R4 => "release 4",
    };
    let varied = match times.windows(2).any(|t| t[0] != t[1]) {
        true => "exposure time",
        false => "irradiance",
    };
    facts(&[
        ("linear gain", Some(short(gain.linear_gain, 3))),
        ("wavelength", s.wavelength_um.map(|um| format!("{} nm", short(1e3 * um, 1)))),
        ("f-number", s.f_number.map(|f| short(f, 2))),
        ("temperature", s.temperature_c.map(|c| format!("{} °C", number::fixed(c, 1)))),
        ("light varied by", (points.len() > 1).then(|| varied.to_owned())),
        ("flat points", Some(points.len().to_string())),
        ("exposure times, flat", range(times, "ms")),
        ("photons per pixel", photons.and_then(|p| range(p, ""))),
        ("dark points", Some(gain.dark.points.len().to_string())),
        ("exposure times, dark", range(dark_times, "ms")),
        ("stacks, flat and dark", spatial.map(|s| format!("{} and {} frames", s.flat.frames, s.dark.frames))),
        ("exposure time of the stacks", spatial.map(|s| format!("{} ms", short(1e3 * s.exposure_s, 3)))),
        ("high-pass for DSNU, PRNU", spatial.map(|_| high_pass.to_owned())),
    ])
}

/// One row: the corrected value, and the library's beside it where that differs.
fn row(name: &str, channels: &[ChannelResult], shown_symbol: &str) -> Markup {
    let of = |c: &ChannelResult| c.figure(name).cloned();
    let Some(first) = channels.first().and_then(of) else { return html! {} };
    let cell = |figure: Option<Figure>| {
        html! {
            @if let Some(figure) = figure {
                td {
                    (measured(&figure.best()))
                    @if figure.corrected.is_some() {
                        span.library { "library: " (with_error(&figure.value).unwrap_or_else(|| "not resolved".into())) }
                    }
                }
            } @else { td { "–" } }
        }
    };
    html! {
        tr {
            th { (symbol(shown_symbol)) }
            td.meaning { (first.meaning) }
            td.unit-cell { (unit(first.unit)) }
            @for channel in channels { (cell(of(channel))) }
        }
    }
}

fn head(channels: &[ChannelResult]) -> Markup {
    html! {
        thead {
            tr {
                th { "symbol" }
                th.meaning { "figure" }
                th.unit-cell { "unit" }
                @for channel in channels { th { (colour_name(channel.colour)) } }
            }
        }
    }
}

/// The figures of EMVA 1288 at the shown gain, and all others folded away.
pub(super) fn figures(shown: &Shown<'_>) -> Markup {
    let channels = shown.channels();
    let Some(first) = channels.first() else {
        return html! { p.caption { "There are no flat frames: no figure of the light can be told." } };
    };
    html! {
        div.scroll {
            table.figures {
                (head(channels))
                tbody { @for (name, text) in FIGURES { (row(name, channels, text)) } }
            }
        }
        p.caption {
            "Value ± standard error. " b { "library" } ": what the EMVA 1288 Python library derives from the same captures, where "
            "that differs; it takes the brightest point for saturation, and non-uniformity without a high-pass."
        }
        details {
            summary { "All figures under their computer names" }
            div.scroll {
                table.figures {
                    (head(channels))
                    tbody {
                        @for figure in &first.figures {
                            (row(figure.name, channels, ""))
                            tr.name { td colspan=(3 + channels.len()) { code { (figure.name) } } }
                        }
                    }
                }
            }
        }
    }
}

/// What each gain contributes to the joint fit.
pub(super) fn gains(all: &Characterization) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "gain" }
                        th { (symbol("K_g")) span.unit { "DN/e⁻" } }
                        th { (symbol("K_g")) "/g" span.unit { "DN/e⁻" } }
                        th { (symbol("μ_I")) ", mean" span.unit { "e⁻/s" } }
                        th { (symbol("μ_I")) ", variance" span.unit { "e⁻/s" } }
                        th { "dark variance" span.unit { "DN² at 0 s" } }
                        th { "dark mean" span.unit { "DN at 0 s" } }
                    }
                }
                tbody {
                    @for row in &all.joint.rows {
                        tr {
                            th { (short(row.linear_gain, 2)) }
                            @for value in [
                                &row.gain_dn_per_e,
                                &row.gain_at_unit_dn_per_e,
                                &row.dark_current_mean_e_per_s,
                                &row.dark_current_variance_e_per_s,
                                &row.dark_variance_dn2,
                                &row.dark_mean_dn,
                            ] { td { (measured(value)) } }
                        }
                    }
                }
            }
        }
    }
}

/// Parameters of the model by the joint fit and by the fit to histograms, beside what Tseng et al. print for their camera.
pub(super) fn model(all: &Characterization) -> Markup {
    let (joint, fit) = (&all.joint, all.histogram_fit.as_ref());
    let is_paper_camera = {
        let name = all.sensor.name.to_uppercase();
        ["IMX249", "23S6"].iter().any(|part| name.contains(part))
    };
    let stated = |v: f64| Measured::exact(v);
    // What the histograms do not tell was held, and has no error.
    let fitted = |of: fn(&petzval_camera::emva::HistogramFit) -> Measured| {
        let value = of(fit?);
        let held = if value.standard_error().is_none() { " (held)" } else { "" };
        Some(with_error(&value)? + held)
    };
    // Symbol, quantity, unit, joint fit, histogram fit, tables 3, 4 and 5.
    let black_level = joint.black_level_dn.map_or(html! { "not stated" }, |v| measured(&stated(v)));
    type Row<'a> = (&'a str, &'a str, &'a str, Markup, Option<String>, [&'a str; 3]);
    let rows: [Row<'_>; 16] = [
        (
            "",
            "columns × rows",
            "pixels",
            html! { (all.width) " × " (all.height) },
            None,
            ["1920 × 1200", "", ""],
        ),
        ("", "bits", "", measured(&stated(f64::from(all.sensor.bits))), None, ["12", "", ""]),
        ("BL", "black level, as set", "DN", black_level, None, ["119", "", ""]),
        (
            "K",
            "system gain at linear gain 1",
            "DN/e⁻",
            measured(&joint.gain_dn_per_e),
            fitted(|f| f.gain_dn_per_e),
            ["", "0.122", "0.14"],
        ),
        (
            "μ_I",
            "dark current, from the mean of all pixels",
            "e⁻/s",
            measured(&joint.dark_current_e_per_s),
            fitted(|f| f.dark_current_e_per_s),
            ["", "25", "25"],
        ),
        (
            "μ_I",
            "dark current, from the variance",
            "e⁻/s",
            measured(&joint.dark_current_variance_e_per_s),
            None,
            ["", "", ""],
        ),
        (
            "",
            "dark current, median of the pixels",
            "e⁻/s",
            measured(&joint.dark_current_median_e_per_s),
            None,
            ["", "", ""],
        ),
        (
            "",
            "dark current, mean of the pixels that are not hot",
            "e⁻/s",
            measured(&joint.dark_current_ordinary_e_per_s),
            None,
            ["", "", ""],
        ),
        ("", "share of hot pixels", "%", measured(&joint.hot_pixel_share.scale(100.0)), None, ["", "", ""]),
        (
            "",
            "dark current of hot pixels above the others, mean",
            "e⁻/s",
            measured(&joint.hot_pixel_e_per_s),
            None,
            ["", "", ""],
        ),
        (
            "μ_r",
            "mean of the read noise",
            "e⁻",
            measured(&joint.read_noise_mean_e),
            fitted(|f| f.read_noise_mean_e),
            ["", "", "3.25"],
        ),
        (
            "σ²_r",
            "variance of the read noise",
            "e⁻²",
            measured(&joint.read_variance_e2),
            fitted(|f| f.read_noise_e.map(|v| v * v, |v| 2.0 * v)),
            ["", "σ: 16", "16"],
        ),
        (
            "σ_el",
            "electronics noise",
            "DN",
            measured(&joint.electronics_noise_dn),
            fitted(|f| f.electronics_noise_dn),
            ["", "", "0.92"],
        ),
        (
            "μ_el",
            "mean of the electronics noise",
            "DN",
            measured(&joint.electronics_mean_dn),
            None,
            ["", "", "1.15"],
        ),
        (
            "α",
            "red over green",
            "",
            measured(&joint.red_over_green),
            fitted(|f| f.red_over_green),
            ["", "", "0.82"],
        ),
        (
            "β",
            "blue over green",
            "",
            measured(&joint.blue_over_green),
            fitted(|f| f.blue_over_green),
            ["", "", "1.25"],
        ),
    ];
    let mosaic = all.sensor.cfa.colours().len() > 1;
    html! {
        div.scroll {
            table.figures {
                thead {
                    tr {
                        th { "symbol" }
                        th.meaning { "parameter" }
                        th.unit-cell { "unit" }
                        th { "all gains together" }
                        @if fit.is_some() { th { "fit to histograms" } }
                        @if is_paper_camera { th { "Table 3" } th { "Table 4" } th { "Table 5" } }
                    }
                }
                tbody {
                    @for (text, meaning, unit, value, fitted, paper) in &rows {
                        @if mosaic || !matches!(*text, "α" | "β") {
                            tr {
                                th { (symbol(text)) }
                                td.meaning { (meaning) }
                                td.unit-cell { (unit) }
                                td { (value) }
                                @if fit.is_some() { td { (fitted.as_deref().unwrap_or("–")) } }
                                @if is_paper_camera { @for cell in paper { td { (if cell.is_empty() { "–" } else { *cell }) } } }
                            }
                        }
                    }
                }
            }
        }
        @if is_paper_camera {
            p.caption {
                "Tables 3 to 5: supplement of Tseng et al. 2021, as printed, for a camera with the Sony IMX249. Table 4 calls σ"
                sub { "r" } " 16 e⁻, its text and Table 5 call the variance 16 e⁻²; the electronics noise, printed in electrons, acts after the "
                "converter and is in DN."
            }
        }
        @if let Some(fit) = fit { (agreement(fit)) }
    }
}

/// How well all histograms agree before and after the fit.
fn agreement(fit: &petzval_camera::emva::HistogramFit) -> Markup {
    let rows = [(Kind::Flat, "flat"), (Kind::Dark, "dark")];
    let of = |kind: Kind, value: fn(&petzval_camera::emva::HistogramComparison) -> f64| {
        let all: Vec<f64> = fit.histograms.iter().filter(|h| h.kind == kind).map(value).collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th { "histograms" }
                        th { "number" }
                        th { "mean χ²/ν" span.unit { "before the fit" } }
                        th { "mean χ²/ν" span.unit { "after" } }
                        th { "mean TV, %" span.unit { "before" } }
                        th { "mean TV, %" span.unit { "after" } }
                        th { "mean KS, %" span.unit { "after" } }
                    }
                }
                tbody {
                    @for (kind, name) in rows {
                        @if fit.histograms.iter().any(|h| h.kind == kind) {
                            tr {
                                th { (name) }
                                td { (fit.histograms.iter().filter(|h| h.kind == kind).count()) }
                                td { (number::fixed(of(kind, |h| h.before.reduced_chi2), 3)) }
                                td { (number::fixed(of(kind, |h| h.after.reduced_chi2), 3)) }
                                td { (number::fixed(100.0 * of(kind, |h| h.before.total_variation), 3)) }
                                td { (number::fixed(100.0 * of(kind, |h| h.after.total_variation), 3)) }
                                td { (number::fixed(100.0 * of(kind, |h| h.after.kolmogorov_smirnov), 3)) }
                            }
                        }
                    }
                }
            }
        }
        p.caption {
            "χ²/ν: reduced chi-square, about 1 where only chance is left. TV: total variation. KS: Kolmogorov-Smirnov distance. "
            @if fit.converged { "The fit converged in " (fit.steps) " steps." }
            @else { "The fit had not converged after " (fit.steps) " steps." }
            @if fit.left_out > 0 {
                " " (fit.left_out) " histograms that are clipped or near saturation do not count."
            }
            " Read noise is that of temporal noise; beyond it the histograms have a DSNU of "
            (with_error(&fit.dsnu_e).map_or("no resolved size".to_owned(), |v| v + " e⁻"))
            " and a PRNU of " (with_error(&fit.prnu_percent).map_or("no resolved size".to_owned(), |v| v + " %")) "."
        }
    }
}

/// What is odd about the captures.
pub(super) fn warnings(all: &Characterization) -> Markup {
    html! {
        @if all.warnings.is_empty() {
            p.caption { "Nothing odd was found in the captures." }
        } @else {
            ul.warnings { @for warning in &all.warnings { li { (plain(&warning.to_string())) } } }
        }
    }
}
