//! `petzval sensor show`: a sensor in numbers.

use crate::jobs::sensor::show::{self, Colour, Electronics, SensorModel};

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::number::six_digits;
use crate::cli::terminal::{Terminal, print_response};

/// Show a sensor: a file, or the name of a built-in one.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sensor file, or a built-in name such as imx249-fitted
    sensor: String,
    /// Linear gains to show; without it those of the file, or 1
    #[arg(long, value_name = "G,G,...", value_delimiter = ',')]
    gains: Vec<f64>,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// The numbers of the sensor file, a line each.
fn facts(s: &SensorModel) -> String {
    let mut text = format!("{}\n{}\n\n", s.name, s.source);
    let mut line = |name: &str, value: String| text += &format!("{name:<27} {value}\n");
    let with_unit =
        |value: f64, unit: &str| format!("{:>12} {unit}", six_digits(value)).trim_end().to_owned();
    let [width_mm, height_mm] = [s.width, s.height].map(|n| 1e-3 * s.pixel_um * n as f64);
    line(
        "pixels",
        format!(
            "{} x {} of {} um: {width_mm:.2} x {height_mm:.2} mm, diagonal {:.2} mm",
            s.width,
            s.height,
            six_digits(s.pixel_um),
            width_mm.hypot(height_mm)
        ),
    );
    let colours = s.cfa.colours();
    let is_mono = colours == [Colour::Clear];
    line("colour filters", if is_mono { "none (monochrome)".to_owned() } else { s.cfa.to_string() });
    line("converter", format!("{} bits, 0 to {} DN", s.bits, s.max_dn()));
    let steps: Vec<String> = s.gain_steps.iter().map(|g| six_digits(*g)).collect();
    line("linear gains", if steps.is_empty() { "any".to_owned() } else { steps.join(", ") });
    for (name, value, unit) in [
        ("system gain K", s.gain_dn_per_e, "DN/e-"),
        ("black level", s.black_level_dn, "DN"),
        ("full well", s.full_well_e, "e-"),
        ("dark current mu_I", s.dark_current_e_per_s, "e-/s"),
        ("read noise sigma_r", s.read_noise_e, "e-"),
        ("read noise mean mu_r", s.read_noise_mean_e, "e-"),
        ("electronics noise sigma_el", s.electronics_noise_dn, "DN"),
        ("electronics mean mu_el", s.electronics_mean_dn, "DN"),
    ] {
        line(name, with_unit(value, unit));
    }
    if s.electronics == Electronics::AfterAdc {
        line("electronics noise enters", "after the converter, and is rounded a second time".to_owned());
    }
    let [red, green, blue] = s.relative_qe;
    for (colour, name, value) in
        [(Colour::Red, "red over green", red / green), (Colour::Blue, "blue over green", blue / green)]
    {
        if colours.contains(&colour) {
            line(name, with_unit(value, ""));
        }
    }
    if !is_mono && colours.contains(&Colour::Clear) {
        let of_white: f64 = s.clear_response.iter().sum();
        line("clear over green", with_unit(of_white, ""));
    }
    match &s.quantum_efficiency {
        None => line("quantum efficiency", "not stated".to_owned()),
        Some(curves) => {
            for (colour, (um, peak)) in colours.iter().filter_map(|c| Some((c, curves.peak(*c)?))) {
                let of = if is_mono { String::new() } else { format!(", {}", colour.name()) };
                let peak = with_unit(100.0 * peak, &format!("% at {} um, the highest", six_digits(um)));
                line(&format!("quantum efficiency{of}"), peak);
            }
            for (name, factor) in [
                ("its scale", curves.scale),
                ("its alpha (red)", curves.alpha),
                ("its beta (blue)", curves.beta),
            ] {
                if factor != 1.0 {
                    line(name, with_unit(factor, ""));
                }
            }
        }
    }
    let n = &s.nonuniformity;
    let parts = [
        ("DSNU, pixels", n.dsnu_pixel_e, "e-"),
        ("DSNU, rows", n.dsnu_row_e, "e-"),
        ("DSNU, columns", n.dsnu_column_e, "e-"),
        ("PRNU, pixels", n.prnu_pixel_percent, "%"),
        ("PRNU, rows", n.prnu_row_percent, "%"),
        ("PRNU, columns", n.prnu_column_percent, "%"),
        ("hot pixels", 100.0 * n.hot_pixel_share, "% of all"),
        ("their dark current, mean", n.hot_pixel_e_per_s, "e-/s above the others"),
        ("row noise", n.row_noise_e, "e-, from frame to frame"),
        ("column noise", n.column_noise_e, "e-, from frame to frame"),
    ];
    if parts.iter().all(|(_, value, _)| *value == 0.0) {
        line("non-uniformity", "none: all pixels are alike".to_owned());
    }
    for (name, value, unit) in parts.into_iter().filter(|(_, value, _)| *value != 0.0) {
        line(name, with_unit(value, unit));
    }
    text
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let response =
        show::run(&show::Request { sensor: args.sensor.into(), gains: args.gains }, &terminal.context())?;
    print_response(args.json, &response, || {
        out!("{}", facts(&response.sensor));
        outln!(
            "\n    gain       K g  dark noise  dark noise   threshold saturation   SNR max    dynamic    range"
        );
        outln!(
            "             DN/e-          DN          e-          e-         e-        dB                  dB"
        );
        for d in &response.derived {
            outln!(
                "{:>8} {:>9.5} {:>11.4} {:>11.3} {:>11.3} {:>10.0} {:>9.2} {:>10.1} {:>8.2}{}",
                six_digits(d.linear_gain),
                d.gain_dn_per_e,
                d.dark_noise_dn,
                d.dark_noise_e,
                d.threshold_e,
                d.saturation_e,
                d.snr_max_db,
                d.dynamic_range,
                d.dynamic_range_db,
                if d.converter_limits { "  converter" } else { "  full well" }
            );
        }
    })
}
