//! The calibration over all gains: each gain, the parameters of the model compared with the tables of the paper, and
//! the agreement of the histograms.

use maud::{Markup, html};
use petzval_lab::emva::captures::Kind;
use petzval_lab::emva::joint::{GAINS, GainRow};
use petzval_lab::emva::{Characterization, HistogramComparison, HistogramFit, Measured};

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

/// A parameter of the model in the table.
struct ModelRow {
    /// Symbol, quantity and unit.
    names: [&'static str; 3],
    /// By the joint fit.
    joint: Measured,
    /// The cell of a fact that is not measured.
    fact: Option<String>,
    /// By the fit to the histograms.
    fitted: Option<fn(&HistogramFit) -> Measured>,
    /// In tables 3, 4 and 5 of the paper; empty where a table lacks it.
    paper: [&'static str; 3],
}

impl ModelRow {
    fn new(symbol: &'static str, quantity: &'static str, unit: &'static str, joint: Measured) -> Self {
        Self { names: [symbol, quantity, unit], joint, fact: None, fitted: None, paper: [""; 3] }
    }

    fn fact(self, fact: impl Into<Option<String>>) -> Self {
        Self { fact: fact.into(), ..self }
    }

    fn fitted(self, fitted: fn(&HistogramFit) -> Measured) -> Self {
        Self { fitted: Some(fitted), ..self }
    }

    fn paper(self, paper: [&'static str; 3]) -> Self {
        Self { paper, ..self }
    }
}

/// The parameters of the model, in the order of the table.
fn model_rows(all: &Characterization) -> Vec<ModelRow> {
    let joint = &all.joint;
    let row = ModelRow::new;
    let no_number = Measured::exact(f64::NAN);
    let black_level = joint.black_level_dn.map_or(no_number, Measured::exact);
    let mut rows = vec![
        row("", "columns × rows", "pixels", no_number)
            .fact(format!("{} × {}", all.width, all.height))
            .paper(["1920 × 1200", "", ""]),
        row("", "bits", "", Measured::exact(f64::from(all.sensor.bits))).paper(["12", "", ""]),
        row("BL", "black level, as set", "DN", black_level)
            .fact(joint.black_level_dn.is_none().then(|| "not stated".to_owned()))
            .paper(["119", "", ""]),
        row("K", "system gain at linear gain 1", "DN/e⁻", joint.gain_dn_per_e)
            .fitted(|f| f.gain_dn_per_e)
            .paper(["", "0.122", "0.14"]),
        row("μ_I", "dark current, from the mean of all pixels", "e⁻/s", joint.dark_current_e_per_s)
            .fitted(|f| f.dark_current_e_per_s)
            .paper(["", "25", "25"]),
        row("μ_I", "dark current, from the variance", "e⁻/s", joint.dark_current_variance_e_per_s),
        row("", "dark current, median of the pixels", "e⁻/s", joint.dark_current_median_e_per_s),
        row(
            "",
            "dark current, mean of the pixels that are not hot",
            "e⁻/s",
            joint.dark_current_ordinary_e_per_s,
        ),
        row("", "share of hot pixels", "%", joint.hot_pixel_share.scale(100.0)),
        row("", "dark current of hot pixels above the others, mean", "e⁻/s", joint.hot_pixel_e_per_s),
        row("μ_r", "mean of the read noise", "e⁻", joint.read_noise_mean_e)
            .fitted(|f| f.read_noise_mean_e)
            .paper(["", "", "3.25"]),
        row("σ²_r", "variance of the read noise", "e⁻²", joint.read_variance_e2)
            .fitted(|f| f.read_noise_e.squared())
            .paper(["", "σ: 16", "16"]),
        row("", "temporal noise of rows", "e⁻", joint.row_noise_e),
        row("", "temporal noise of columns", "e⁻", joint.column_noise_e),
        row("σ_el", "electronics noise", "DN", joint.electronics_noise_dn)
            .fitted(|f| f.electronics_noise_dn)
            .paper(["", "", "0.92"]),
        row("μ_el", "mean of the electronics noise", "DN", joint.electronics_mean_dn).paper(["", "", "1.15"]),
    ];
    if all.sensor.cfa.colours().len() > 1 {
        rows.extend([
            row("α", "red over green", "", joint.red_over_green)
                .fitted(|f| f.red_over_green)
                .paper(["", "", "0.82"]),
            row("β", "blue over green", "", joint.blue_over_green)
                .fitted(|f| f.blue_over_green)
                .paper(["", "", "1.25"]),
        ]);
    }
    rows
}

/// Parameters of the model by the joint fit and by the fit to histograms, beside the values of Tseng et al. for their
/// camera.
pub(super) fn model(all: &Characterization) -> Markup {
    let fit = all.histogram_fit.as_ref();
    let mut reasons = Reasons::default();
    let is_paper_camera = {
        let name = all.sensor.name.to_uppercase();
        ["IMX249", "23S6"].iter().any(|part| name.contains(part))
    };
    // A parameter that the histograms do not resolve was held and has no error. If the fit does not describe the
    // histograms, no parameter has an error.
    let fitted = |of: fn(&HistogramFit) -> Measured| {
        let (fit, value) = (fit?, of(fit?));
        let held = match value.standard_error() {
            Some(_) => "",
            None if fit.is_sound() => " (held)",
            None => " (no error)",
        };
        Some(with_error(&value)? + held)
    };
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
    let row = |row: ModelRow| {
        let [text, quantity, unit] = row.names;
        let value = row.fact.map_or_else(|| reasons.cell(&row.joint), |fact| html! { (fact) });
        let mut cells = vec![html! { (quantity) }, html! { (unit) }, value];
        if fit.is_some() {
            cells.push(html! { (row.fitted.and_then(fitted).as_deref().unwrap_or("–")) });
        }
        if is_paper_camera {
            cells.extend(row.paper.map(|cell| html! { (if cell.is_empty() { "–" } else { cell }) }));
        }
        Row::new(symbol(text), cells)
    };
    let table = Table::new(columns).class("figures").rows(model_rows(all).into_iter().map(row));
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
fn agreement(fit: &HistogramFit) -> Markup {
    let rows = [(Kind::Flat, "flat"), (Kind::Dark, "dark")];
    let of = |kind: Kind, value: fn(&HistogramComparison) -> f64| {
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
