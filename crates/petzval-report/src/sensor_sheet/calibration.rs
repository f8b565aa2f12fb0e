//! The calibration over all gains: each gain, the parameters of the model compared with the tables of the paper, and
//! the agreement of the histograms.

use maud::{Markup, html};
use petzval_lab::emva::captures::Kind;
use petzval_lab::emva::joint::{GAINS, GainRow};
use petzval_lab::emva::{Characterization, Measured};

use super::reasons::Reasons;
use super::style::{short, symbol, with_error};
use crate::number;
use crate::page::caption;
use crate::table::{Column, Row, Table};

/// Contributions of the gains to the joint fit.
pub(super) fn gains(all: &Characterization) -> Markup {
    let mut reasons = Reasons::default();
    let columns = [
        Column::new("gain"),
        Column::new(symbol("K_g")).unit("DN/e⁻"),
        Column::new(html! { (symbol("K_g")) "/g" }).unit("DN/e⁻"),
        Column::new(html! { (symbol("μ_I")) ", mean" }).unit("e⁻/s"),
        Column::new(html! { (symbol("μ_I")) ", variance" }).unit("e⁻/s"),
        Column::new("dark variance").unit("DN² at 0 s"),
        Column::new("dark mean").unit("DN at 0 s"),
    ];
    let row = |row: &GainRow| {
        let values = [
            &row.gain_dn_per_e,
            &row.gain_at_unit_dn_per_e,
            &row.dark_current_mean_e_per_s,
            &row.dark_current_variance_e_per_s,
            &row.dark_variance_dn2,
            &row.dark_mean_dn,
        ];
        Row::new(short(row.linear_gain, 2), values.map(|value| reasons.cell(value)))
    };
    let table = Table::new(columns).class("figures").rows(all.joint.rows.iter().map(row));
    html! { (table.html()) (reasons.list()) }
}

/// Symbol, quantity and unit of a parameter, its value by the joint fit and by the fit to histograms, and the values of
/// tables 3, 4 and 5 of the paper.
type Parameter<'a> = (&'a str, &'a str, &'a str, Markup, Option<String>, [&'a str; 3]);

/// Parameters of the model by the joint fit and by the fit to histograms, beside the values of Tseng et al. for their
/// camera.
pub(super) fn model(all: &Characterization) -> Markup {
    let (joint, fit) = (&all.joint, all.histogram_fit.as_ref());
    let mut reasons = Reasons::default();
    let mosaic = all.sensor.cfa.colours().len() > 1;
    let mut measured = |value: &Measured| reasons.cell(value);
    let is_paper_camera = {
        let name = all.sensor.name.to_uppercase();
        ["IMX249", "23S6"].iter().any(|part| name.contains(part))
    };
    let stated = |v: f64| Measured::exact(v);
    // A parameter that the histograms do not resolve was held and has no error. If the fit does not describe the
    // histograms, no parameter has an error.
    let fitted = |of: fn(&petzval_lab::emva::HistogramFit) -> Measured| {
        let (fit, value) = (fit?, of(fit?));
        let held = match value.standard_error() {
            Some(_) => "",
            None if fit.is_sound() => " (held)",
            None => " (no error)",
        };
        Some(with_error(&value)? + held)
    };
    let black_level = joint.black_level_dn.map_or(html! { "not stated" }, |v| measured(&stated(v)));
    let mut rows: Vec<Parameter<'_>> = vec![
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
            fitted(|f| f.read_noise_e.squared()),
            ["", "σ: 16", "16"],
        ),
        ("", "temporal noise of rows", "e⁻", measured(&joint.row_noise_e), None, ["", "", ""]),
        ("", "temporal noise of columns", "e⁻", measured(&joint.column_noise_e), None, ["", "", ""]),
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
    ];
    if mosaic {
        rows.extend([
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
        ]);
    }
    let mut columns = vec![
        Column::new("symbol"),
        Column::new("parameter").note(),
        Column::new("unit").units(),
        Column::new("all gains together"),
    ];
    if fit.is_some() {
        columns.push(Column::new("fit to histograms"));
    }
    if is_paper_camera {
        columns.extend(["Table 3", "Table 4", "Table 5"].map(Column::new));
    }
    let row = |(text, meaning, unit, value, fitted, paper): Parameter<'_>| {
        let mut cells = vec![html! { (meaning) }, html! { (unit) }, value];
        if fit.is_some() {
            cells.push(html! { (fitted.as_deref().unwrap_or("–")) });
        }
        if is_paper_camera {
            cells.extend(paper.map(|cell| html! { (if cell.is_empty() { "–" } else { cell }) }));
        }
        Row::new(symbol(text), cells)
    };
    let table = Table::new(columns).class("figures").rows(rows.into_iter().map(row));
    html! {
        (table.html())
        (reasons.list())
        @if all.gains.len() < GAINS {
            (caption("Captures at three or more linear gains separate read noise from electronics noise."))
        }
        @if is_paper_camera {
            (caption(html! {
                "Tables 3 to 5: supplement of Tseng et al. 2021, as printed, for a camera with the Sony IMX249. Table 4 calls σ"
                sub { "r" } " 16 e⁻, its text and Table 5 call the variance 16 e⁻²; the electronics noise, printed in electrons, acts after the "
                "converter and is in DN."
            }))
        }
        @if let Some(fit) = fit { (agreement(fit)) }
    }
}

/// Agreement of all histograms before and after the fit.
fn agreement(fit: &petzval_lab::emva::HistogramFit) -> Markup {
    let rows = [(Kind::Flat, "flat"), (Kind::Dark, "dark")];
    let of = |kind: Kind, value: fn(&petzval_lab::emva::HistogramComparison) -> f64| {
        let all: Vec<f64> = fit.histograms.iter().filter(|h| h.kind == kind).map(value).collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    let columns = [
        Column::new("histograms"),
        Column::new("number"),
        Column::new("mean χ²/ν").unit("before the fit"),
        Column::new("mean χ²/ν").unit("after"),
        Column::new("mean TV, %").unit("before"),
        Column::new("mean TV, %").unit("after"),
        Column::new("mean KS, %").unit("after"),
    ];
    let row = |(kind, name): (Kind, &str)| {
        let count = fit.histograms.iter().filter(|h| h.kind == kind).count();
        let cells = [
            count.to_string(),
            number::fixed(of(kind, |h| h.before.reduced_chi2), 3),
            number::fixed(of(kind, |h| h.after.reduced_chi2), 3),
            number::fixed(100.0 * of(kind, |h| h.before.total_variation), 3),
            number::fixed(100.0 * of(kind, |h| h.after.total_variation), 3),
            number::fixed(100.0 * of(kind, |h| h.after.kolmogorov_smirnov), 3),
        ];
        (count > 0).then(|| Row::new(name, cells))
    };
    let table = Table::new(columns).rows(rows.into_iter().filter_map(row));
    let size = |m: &Measured, unit: &str| with_error(m).map_or("no resolved size".to_owned(), |v| v + unit);
    html! {
        (table.html())
        (caption(html! {
            "χ²/ν: reduced chi-square, about 1 if only chance is left. TV: total variation. KS: Kolmogorov-Smirnov distance. "
            @if fit.converged { "The fit converged in " (fit.steps) " steps." }
            @else { "The fit had not converged after " (fit.steps) " steps." }
            @if fit.left_out > 0 {
                " " (fit.left_out) " histograms that are clipped or near saturation do not count."
            }
            " Read noise is that of temporal noise; beyond it the histograms have a DSNU of " (size(&fit.dsnu_e, " e⁻"))
            " and a PRNU of " (size(&fit.prnu_percent, " %")) "."
        }))
    }
}
