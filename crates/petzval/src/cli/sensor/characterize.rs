//! `petzval sensor characterize`: measures a sensor from captures.

use std::fmt::Write;
use std::path::PathBuf;

use crate::jobs::sensor::characterize::{
    self, Characterization, Colour, Figure, GAINS, HighPass, HistogramComparison, Measured, NamedFit, Values,
    Verdict, colour_name, fits,
};

use crate::cli::choice::choice;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::terminal::{Terminal, print_response};

/// Measure a sensor from captures.
///
/// DIR holds frames and a list of them: captures.toml, whose names of frames may have wildcards (flat-*.tiff), or the
/// EMVA1288descriptor.txt of the EMVA 1288 Python library. Each page of a TIFF file is a frame. Numbers are printed with their standard
/// errors. A number that the captures do not determine is named with the reason. Warnings report oddities, one line for each kind;
/// results.json names every point. With --out the results are written too: sensor.toml, which `simulate --sensor` loads (if K is resolved),
/// and results.json with everything. For each gain and colour there is an emva-*.xml under the names of the library. Further files are
/// histograms.csv; report.html, one page of all tables and plots; and the plots as .svg.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the captures, or its captures.toml
    dir: PathBuf,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// High-pass before DSNU and PRNU; the values of --compatible have none
    #[arg(long, value_parser = choice::<HighPass>(), default_value = word(characterize::Request::default().highpass))]
    highpass: HighPass,
    /// Derive every number as the EMVA 1288 Python library does, including its mistakes
    #[arg(long)]
    compatible: bool,
    /// Leave the difference of the frames' means in the temporal variance (Eq. 6 of Tseng et al. 2021)
    #[arg(long)]
    no_mean_difference: bool,
    /// Fit K, mu_r, mu_el, sigma_el, colour ratios and light to the captured histograms
    #[arg(long)]
    fit_histograms: bool,
    /// Pixel pitch, um, if the list does not state it
    #[arg(long, value_name = "UM")]
    pixel_um: Option<f64>,
    /// Print everything as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = characterize::Request {
        dir: args.dir,
        out: args.out,
        highpass: args.highpass,
        values: if args.compatible { Values::Library } else { Values::Corrected },
        mean_difference: !args.no_mean_difference,
        fit_histograms: args.fit_histograms,
        pixel_um: args.pixel_um,
    };
    let found = characterize::run(&request, &terminal.context())?.characterization;
    print_response(args.json, &found, || out!("{}", table(&found, request.values)))
}

/// Lines of numbers. Unresolved numbers are collected, one line for each reason.
#[derive(Default)]
struct Lines {
    text: String,
    unresolved: Vec<(String, Vec<String>)>,
}

impl Lines {
    /// Adds a number with as many digits as its error justifies.
    fn add(&mut self, name: &str, measured: Measured, unit: &str) {
        // Writing to a string cannot fail.
        let _ = match (measured.value(), measured.standard_error().filter(|se| *se > 0.0)) {
            (Some(v), Some(se)) => {
                let digits = (1.0 - se.log10().floor()).clamp(0.0, 9.0) as usize;
                writeln!(self.text, "{name:<29} {v:>14.digits$} +- {se:<12.digits$} {unit}")
            }
            (Some(v), None) => writeln!(self.text, "{name:<29} {v:>14.6}    {:<12} {unit}", ""),
            (None, _) => {
                let why = measured.reason().map_or(String::new(), |why| why.to_string());
                let name = name.trim().to_owned();
                match self.unresolved.iter_mut().find(|(reason, _)| *reason == why) {
                    Some((_, names)) => names.push(name),
                    None => self.unresolved.push((why, vec![name])),
                }
                Ok(())
            }
        };
    }

    /// Adds a figure. A limit is printed as one: it has no error, and is no measurement.
    fn add_figure(&mut self, figure: &Figure, measured: Measured) {
        let name = format!("  {}", figure.name);
        match (figure.limit, measured.value()) {
            (Some(limit), Some(value)) => {
                let digits = (3.0 - value.abs().max(1e-6).log10().floor()).clamp(0.0, 9.0) as usize;
                let text = format!("{} {value:.digits$}", limit.sign());
                let _ = writeln!(self.text, "{name:<29} {text:>14}    {:<12} {}", "", figure.unit);
            }
            _ => self.add(&name, measured, figure.unit),
        }
    }

    /// Writes one line for each reason, with the numbers that it leaves unresolved.
    fn reasons(&mut self, indent: &str) {
        for (why, names) in std::mem::take(&mut self.unresolved) {
            let _ = writeln!(self.text, "{indent}not resolved: {why}: {}", names.join(", "));
        }
    }
}

/// The compact table: all gains together, then each gain and colour.
fn table(found: &Characterization, values: Values) -> String {
    let mut lines = Lines::default();
    let j = &found.joint;
    for (name, measured, unit) in [
        ("K at linear gain 1", j.gain_dn_per_e, "DN/e-"),
        ("dark current mu_I (mean)", j.dark_current_e_per_s, "e-/s"),
        ("dark current mu_I (variance)", j.dark_current_variance_e_per_s, "e-/s"),
        ("dark current, median", j.dark_current_median_e_per_s, "e-/s"),
        ("dark current, not hot", j.dark_current_ordinary_e_per_s, "e-/s"),
        ("hot pixels", j.hot_pixel_share.scale(100.0), "% of the pixels"),
        ("hot pixels, mean excess", j.hot_pixel_e_per_s, "e-/s"),
        ("read noise sigma_r^2", j.read_variance_e2, "e-^2"),
        ("temporal noise of rows", j.row_noise_e, "e-"),
        ("temporal noise of columns", j.column_noise_e, "e-"),
        ("read noise mean mu_r", j.read_noise_mean_e, "e-"),
        ("electronics noise sigma_el", j.electronics_noise_dn, "DN"),
        ("BL + mu_el", j.dark_offset_dn, "DN"),
        ("electronics mean mu_el", j.electronics_mean_dn, "DN"),
    ] {
        lines.add(name, measured, unit);
    }
    let colours = found.sensor.cfa.colours();
    for (colour, name, measured) in [
        (Colour::Red, "red over green (alpha)", j.red_over_green),
        (Colour::Blue, "blue over green (beta)", j.blue_over_green),
    ] {
        if colours.contains(&colour) {
            lines.add(name, measured, "");
        }
    }
    lines.reasons("");
    if found.gains.len() < GAINS {
        lines.text += "captures at three or more linear gains separate read noise from electronics noise \
                       (`sensor capture --gains 1,2,4`)\n";
    }
    if let Some(fit) = &found.histogram_fit {
        let after = |f: fn(&HistogramComparison) -> f64| {
            let all: Vec<f64> = fit.histograms.iter().map(f).collect();
            all.iter().sum::<f64>() / all.len().max(1) as f64
        };
        let _ =
            writeln!(lines.text, "\nfitted to {} histograms in {} steps", fit.histograms.len(), fit.steps);
        for (name, measured, unit) in [
            ("  K at linear gain 1", fit.gain_dn_per_e, "DN/e-"),
            ("  read noise mean mu_r", fit.read_noise_mean_e, "e-"),
            ("  BL + mu_el", fit.dark_offset_dn, "DN"),
            ("  electronics noise sigma_el", fit.electronics_noise_dn, "DN"),
            ("  dark noise with DSNU", fit.dark_noise_e, "e-"),
            ("  read noise (temporal)", fit.read_noise_e, "e-"),
            ("  DSNU", fit.dsnu_e, "e-"),
            ("  PRNU", fit.prnu_percent, "%"),
            ("  dark current mu_I", fit.dark_current_e_per_s, "e-/s"),
            ("  red over green (alpha)", fit.red_over_green, ""),
            ("  blue over green (beta)", fit.blue_over_green, ""),
        ] {
            lines.add(name, measured, unit);
        }
        lines.reasons("  ");
        let _ = writeln!(
            lines.text,
            "  mean reduced chi^2 of the cores {:.3}; of whole histograms {:.3}, before {:.3}; mean total variation {:.4}, before {:.4}",
            after(|h| h.core_reduced_chi2),
            after(|h| h.after.reduced_chi2),
            after(|h| h.before.reduced_chi2),
            after(|h| h.after.total_variation),
            after(|h| h.before.total_variation)
        );
    }
    for gain in &found.gains {
        for channel in &gain.channels {
            let _ = writeln!(lines.text, "\ngain {}, {}", gain.linear_gain, colour_name(channel.colour));
            for figure in SHOWN.iter().filter_map(|name| channel.figure(name)) {
                let measured = if values == Values::Library { figure.value } else { figure.best() };
                lines.add_figure(figure, measured);
            }
            lines.reasons("  ");
        }
    }
    let _ = write!(lines.text, "\n{}", tests(&fits(found)));
    lines.text
}

/// Whether the points of the fits lie on their models: a line for each kind of fit with its worst chi^2, and one for each fit that departs.
fn tests(all: &[NamedFit]) -> String {
    let alpha = all.first().map_or(0.0, |fit| fit.test.alpha);
    let mut text = format!(
        "fits, tested at {alpha:e}: chi^2 over its degrees of freedom, curvature in standard errors\n"
    );
    let mut names: Vec<&str> = Vec::new();
    for fit in all.iter().filter(|fit| fit.test.verdict != Verdict::Untested) {
        if !names.contains(&fit.name) {
            names.push(fit.name);
        }
    }
    for name in names {
        let of_name = || all.iter().filter(|fit| fit.name == name && fit.test.verdict != Verdict::Untested);
        let Some(worst) = of_name().min_by(|a, b| a.test.p_value.total_cmp(&b.test.p_value)) else {
            continue;
        };
        let holds = of_name().filter(|fit| fit.test.verdict == Verdict::Holds).count();
        let _ = writeln!(text, "  {name:<27} {holds} of {} hold; worst: {}", of_name().count(), test(worst));
        for fit in of_name().filter(|fit| fit.test.verdict != Verdict::Holds) {
            let _ = writeln!(text, "    {} {}: {}", fit.place(), fit.test.verdict.words(), test(fit));
        }
    }
    text
}

/// One test in words.
fn test(fit: &NamedFit) -> String {
    let test = &fit.test;
    let curvature = test.curvature_sigmas.map_or(String::new(), |sigmas| format!(", curvature {sigmas:+.1}"));
    let share = match fit.model_share.filter(|share| *share > 0.0) {
        Some(share) => format!(", errors contain {:.2} %", 100.0 * share),
        None => String::new(),
    };
    format!("{:.2} of {}{curvature}{share}", test.reduced_chi2, test.degrees_of_freedom)
}

/// Figures of the table, by their names.
const SHOWN: [&str; 21] = [
    "K",
    "QE",
    "R",
    "sigma_d",
    "sigma_y_dark",
    "u_e_min",
    "u_e_sat",
    "SNR_max_dB",
    "DR_dB",
    "LE_min",
    "LE_max",
    "DSNU1288",
    "DSNU1288_row",
    "DSNU1288_col",
    "DSNU1288_pixel",
    "PRNU1288",
    "PRNU1288_row",
    "PRNU1288_col",
    "PRNU1288_pixel",
    "u_I_mean",
    "u_I_var",
];

#[cfg(test)]
mod tests {
    use crate::jobs::sensor::characterize::{Limit, Unresolved};

    use super::*;

    #[test]
    fn numbers_with_the_same_reason_share_a_line() {
        let mut lines = Lines::default();
        lines.add("  K", Measured::new(0.14, 0.001), "DN/e-");
        for name in ["  u_e_sat", "  DR_dB"] {
            lines.add(name, Measured::none(Unresolved::NotSaturated), "e-");
        }
        lines.add("  QE", Measured::none(Unresolved::NoPhotons), "%");
        lines.reasons("  ");
        let text: Vec<&str> = lines.text.lines().collect();
        assert_eq!(text.len(), 3, "{text:?}");
        assert!(text[0].contains("0.1400 +- 0.0010"), "{}", text[0]);
        assert_eq!(text[1], "  not resolved: the series does not reach saturation: u_e_sat, DR_dB");
        assert_eq!(text[2], "  not resolved: no point states its photons per pixel: QE");
    }

    #[test]
    fn limits_have_a_sign_in_place_of_an_error() {
        let figure = |name, value, limit| Figure {
            name,
            section: "sensitivity",
            meaning: "",
            unit: "e-",
            value: Measured::exact(value),
            corrected: None,
            limit,
        };
        let mut lines = Lines::default();
        for (name, value, limit) in [
            ("sigma_d", 7.949_587, Some(Limit::Upper)),
            ("DR_dB", 77.875_598, Some(Limit::Lower)),
            ("index_start", 3.0, None),
        ] {
            lines.add_figure(&figure(name, value, limit), Measured::exact(value));
        }
        let words: Vec<Vec<&str>> =
            lines.text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(words[0], ["sigma_d", "<", "7.950", "e-"]);
        assert_eq!(words[1], ["DR_dB", ">", "77.88", "e-"]);
        assert_eq!(words[2], ["index_start", "3.000000", "e-"]);
    }
}
