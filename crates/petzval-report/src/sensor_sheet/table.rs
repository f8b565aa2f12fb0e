//! Tables: basic data, the figures of EMVA 1288, warnings.

use maud::{Markup, html};
use petzval_camera::sensor::Colour;
use petzval_lab::emva::defects::Defect;
use petzval_lab::emva::{ChannelResult, Characterization, HighPass, Measured};

use super::reasons::Reasons;
use super::shown::Shown;
use super::style::{colour_name, short, significant, symbol, with_error};
use crate::number;
use crate::page::{caption, facts};
use crate::plot::plain;
use crate::table::{Column, Row, Table};

/// Figures of the table that release 4.0 requires: computer name and symbol, in the order of its report.
const FIGURES: [(&str, &str); 32] = [
    ("QE", "η"),
    ("R", "R"),
    ("K", "K"),
    ("inverse_K", "1/K"),
    ("sigma_d", "σ_d"),
    ("sigma_y_dark", "σ_y.dark"),
    ("SNR_max", "SNR_max"),
    ("SNR_max_dB", "SNR_max"),
    ("SNR_max_bit", "SNR_max"),
    ("inverse_SNR_max", "1/SNR_max"),
    ("u_p_min", "μ_p.min"),
    ("u_p_min_area", "μ_p.min"),
    ("u_e_min", "μ_e.min"),
    ("u_e_min_area", "μ_e.min"),
    ("u_p_sat", "μ_p.sat"),
    ("u_p_sat_area", "μ_p.sat"),
    ("u_e_sat", "μ_e.sat"),
    ("u_e_sat_area", "μ_e.sat"),
    ("DR", "DR"),
    ("DR_dB", "DR"),
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

/// A unit as it is printed: `e-/um2` becomes e⁻/µm².
pub(super) fn unit(text: &str) -> String {
    text.replace("e-", "e⁻").replace("um2", "µm²").replace("DN2", "DN²")
}

/// Basic data of the sensor.
pub(super) fn basic_data(all: &Characterization) -> Markup {
    let s = &all.sensor;
    let number = |v: Option<f64>, unit: &str| v.map(|v| format!("{} {unit}", significant(v, 6)));
    let diagonal = s.pixel_um.map(|pitch| 1e-3 * pitch * (all.height as f64).hypot(all.width as f64));
    let colour = if s.cfa.colours().len() > 1 { s.cfa.to_string() } else { "none (monochrome)".to_owned() };
    facts([
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

/// The setting of the plots and figures.
pub(super) fn operating_point(shown: &Shown<'_>) -> Markup {
    let (all, gain) = (shown.all, shown.gain);
    let s = &all.sensor;
    let range = |values: Vec<f64>, unit: &str| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let text = if high > low {
            format!("{} … {} {unit}", significant(low, 4), significant(high, 4))
        } else {
            format!("{} {unit}", significant(low, 4))
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
    let varied = if times.windows(2).any(|t| t[0] != t[1]) { "exposure time" } else { "irradiance" };
    facts([
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

/// One row: the figure of every colour; `None` for one that was not derived.
fn row(head: Markup, name: &str, channels: &[ChannelResult], reasons: &mut Reasons) -> Option<Row> {
    let first = channels.first().and_then(|c| c.figure(name))?;
    let value = |channel: &ChannelResult| {
        let Some(figure) = channel.figure(name) else { return html! { "–" } };
        let cell = reasons.cell(&figure.best());
        html! { @if let Some(limit) = figure.limit { (limit.sign()) " " } (cell) }
    };
    let mut cells: Vec<Markup> = channels.iter().map(value).collect();
    cells.push(html! { (first.meaning) });
    Some(Row::new(html! { (head) span.unit { (unit(first.unit)) } }, cells))
}

/// A table of figures, one column for each colour. The values stand next to symbol and unit, so that a narrow screen shows them together.
fn figure_table(head: &str, channels: &[ChannelResult], rows: impl IntoIterator<Item = Row>) -> Markup {
    let colours = channels.iter().map(|c| Column::new(colour_name(c.colour)));
    let columns = [Column::new(head)].into_iter().chain(colours).chain([Column::new("figure").note()]);
    Table::new(columns).class("figures").rows(rows).html()
}

/// Most defect pixels whose places the page lists.
const MOST_LISTED: usize = 50;

/// The pixels that do not answer light at the shown gain, with their places, and the figures with and without them; nothing where there are none.
pub(super) fn defect_pixels(shown: &Shown<'_>) -> Option<Markup> {
    let mut reasons = Reasons::default();
    let mut figures = Vec::new();
    let mut places = Vec::new();
    for channel in shown.channels() {
        let (Some(spatial), Some(with)) = (&channel.spatial, channel.non_uniformity_with_defects()) else {
            continue;
        };
        for ((name, text), with) in [("DSNU1288", "DSNU"), ("PRNU1288", "PRNU")].into_iter().zip(with) {
            let Some(figure) = channel.figure(name) else { continue };
            let without = reasons.cell(&figure.best());
            let cells = [without, reasons.cell(&with), html! { (unit(figure.unit)) }];
            figures.push(Row::new(html! { (symbol(text)) " " (colour_name(channel.colour)) }, cells));
        }
        for (name, text) in [("R", "R"), ("QE", "η"), ("u_e_sat", "μ_e.sat")] {
            let (Some(figure), Some(without)) = (channel.figure(name), channel.without_defects(name)) else {
                continue;
            };
            let cells = [reasons.cell(&without), reasons.cell(&figure.best()), html! { (unit(figure.unit)) }];
            figures.push(Row::new(html! { (symbol(text)) " " (colour_name(channel.colour)) }, cells));
        }
        places.extend(spatial.defects.iter().map(|defect| (channel.colour, defect)));
    }
    places.sort_by_key(|(_, defect)| (defect.row, defect.column));
    let row = |(colour, defect): &(Colour, &Defect)| {
        let dn = |value: f64| html! { (number::fixed(value, 1)) };
        let place = [html! { (defect.column) }, html! { (colour.name()) }];
        Row::new(defect.row, place.into_iter().chain([dn(defect.dark_dn), dn(defect.flat_dn)]))
    };
    let listed = [
        Column::new("row"),
        Column::new("column"),
        Column::new("colour").text(),
        Column::new("dark").unit("DN"),
        Column::new("flat").unit("DN"),
    ];
    let compared = ["figure", "without them", "with them"].map(Column::new);
    (!places.is_empty()).then(|| html! {
        p { "Pixels that do not answer light as their neighbours do: " (places.len()) ". DSNU and PRNU above leave them out. Signals are means over all pixels in EMVA 1288, and so are R, η and μ_e.sat above." }
        (Table::new(compared.into_iter().chain([Column::new("unit").units()])).class("narrow").rows(figures).html())
        (reasons.list())
        (Table::new(listed).class("narrow").rows(places.iter().take(MOST_LISTED).map(row)).html())
        @if places.len() > MOST_LISTED {
            (caption(format!("The first {MOST_LISTED}; results.json lists all.")))
        }
    })
}

/// The figures of EMVA 1288 at the shown gain. All other figures, and differing values of the library, are folded away.
pub(super) fn figures(shown: &Shown<'_>) -> Markup {
    let channels = shown.channels();
    let Some(first) = channels.first() else {
        return caption("There are no flat frames: no figure of the light can be derived.");
    };
    let (mut of_standard, mut of_all) = (Reasons::default(), Reasons::default());
    let standard: Vec<Row> = FIGURES
        .iter()
        .filter_map(|(name, text)| row(symbol(text), name, channels, &mut of_standard))
        .collect();
    let all: Vec<Row> = first
        .figures
        .iter()
        .filter_map(|f| row(html! { code { (f.name) } }, f.name, channels, &mut of_all))
        .collect();
    html! {
        (figure_table("symbol", channels, standard))
        (of_standard.list())
        (caption("Value ± standard error."))
        details {
            summary { "All figures under their computer names" }
            (figure_table("name", channels, all))
            (of_all.list())
        }
        (library(channels))
    }
}

/// Values of the EMVA 1288 Python library from the same captures, if they differ.
fn library(channels: &[ChannelResult]) -> Markup {
    let of = |c: &ChannelResult, i: usize| c.figures.get(i).filter(|f| f.corrected.is_some()).cloned();
    let number = channels.first().map_or(0, |c| c.figures.len());
    let differing: Vec<usize> =
        (0..number).filter(|i| channels.iter().any(|c| of(c, *i).is_some())).collect();
    if differing.is_empty() {
        return html! {};
    }
    let text = |m: &Measured| with_error(m).unwrap_or_else(|| "not resolved".to_owned());
    let row = |i: &usize| {
        let first = &channels[0].figures[*i];
        let mut cells = vec![first.meaning.to_owned(), unit(first.unit)];
        for c in channels {
            cells.extend(match of(c, *i) {
                Some(figure) => [text(&figure.best()), text(&figure.value)],
                None => ["=", "="].map(str::to_owned),
            });
        }
        Row::new(html! { code { (first.name) } }, cells)
    };
    let explained = [Column::new("name"), Column::new("figure").note(), Column::new("unit").units()];
    let pairs = channels
        .iter()
        .flat_map(|c| ["here", "library"].map(|whose| Column::new(colour_name(c.colour)).unit(whose)));
    let table = Table::new(explained.into_iter().chain(pairs)).class("figures");
    html! {
        details {
            summary { "Different values of the EMVA 1288 Python library" }
            (table.rows(differing.iter().map(row)).html())
            (caption("The library takes the brightest point for saturation, and non-uniformity without a high-pass."))
        }
    }
}

/// Warnings about the captures: one entry for each kind. The first of a kind is shown, the others are folded away.
pub(super) fn warnings(all: &Characterization) -> Markup {
    let mut kinds: Vec<(&str, Vec<String>)> = Vec::new();
    for warning in &all.warnings {
        let said = plain(&warning.to_string());
        match kinds.iter_mut().find(|(name, _)| *name == warning.name()) {
            Some((_, of_kind)) => of_kind.push(said),
            None => kinds.push((warning.name(), vec![said])),
        }
    }
    html! {
        @if kinds.is_empty() {
            (caption("The captures gave no warnings."))
        } @else {
            ul.warnings {
                @for (name, of_kind) in &kinds {
                    li {
                        (of_kind[0])
                        @if of_kind.len() > 1 {
                            details {
                                summary { (of_kind.len() - 1) " more of the kind " (name) }
                                ul { @for said in &of_kind[1..] { li { (said) } } }
                            }
                        }
                    }
                }
            }
        }
    }
}
