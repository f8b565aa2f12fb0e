//! `petzval isp chart`: colours, noise and sharpness of a developed test chart.

use std::path::PathBuf;

use crate::jobs::isp::chart::{self, Response};
use crate::jobs::simulate;

use super::inputs::IspArgs;
use crate::cli::code::Code;
use crate::cli::defaults::word;
use crate::cli::failure::Failure;
use crate::cli::plain::shown;
use crate::cli::signals;
use crate::cli::terminal::{Terminal, print_response};

/// Take a test chart through a lens onto a sensor, develop it with an ISP, and measure the picture.
///
/// The chart has the 24 patches of a ColorChecker and slanted edges of three contrasts over the field (scene:test-chart). Measured are the
/// colour differences CIEDE2000, the noise of every patch, and the response at the edges after ISO 12233.
///
/// Files: chart.json, all figures; chart.png, the picture, 16 bit; chart.html, a page with patches and curves.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    isp: IspArgs,
    /// Change a parameter; may be repeated
    #[arg(long, value_name = "STAGE.KEY=VALUE")]
    set: Vec<String>,
    /// Lens file, or a built-in name
    #[arg(long, default_value = word(chart::Request::default().camera.lens))]
    lens: String,
    /// Sensor file, or a built-in name
    #[arg(long, default_value = word(chart::Request::default().camera.sensor))]
    sensor: String,
    /// Quantum efficiency curves in place of the sensor's own, as `petzval simulate` takes them [default: imx219 where the sensor has none]
    #[arg(long, value_name = "CURVES")]
    qe: Option<String>,
    /// Light on the chart: D65, A, FL11, LED-B3, ..., daylight:KELVIN, blackbody:KELVIN, or a CSV file [default: D65]
    #[arg(long, value_name = "LIGHT")]
    illuminant: Option<String>,
    /// Illuminance of the chart, lux [default: the value that gives --white-e]
    #[arg(long, value_name = "LUX", conflicts_with = "white_e")]
    illuminance_lux: Option<f64>,
    /// Photoelectrons of white in a green pixel on the axis [default: 70 % of the number at which white saturates the first colour at
    /// this gain]
    #[arg(long, value_name = "E")]
    white_e: Option<f32>,
    /// Linear analogue gain
    #[arg(long, default_value_t = chart::Request::default().camera.gain)]
    gain: f32,
    /// Exposure time, s
    #[arg(long, default_value_t = chart::Request::default().camera.time_s, value_name = "S")]
    time_s: f32,
    /// Samples of the chart along a side of a pixel, 1 to 8
    #[arg(long, default_value_t = chart::SAMPLES, value_name = "K")]
    samples: usize,
    /// Leave out the distortion of the lens
    #[arg(long)]
    no_distortion: bool,
    /// Leave out temporal noise; the fixed pattern (DSNU, PRNU, hot pixels) stays
    #[arg(long)]
    no_noise: bool,
    /// Seed of the noise
    #[arg(long, default_value_t = chart::Request::default().camera.seed)]
    seed: u64,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let spectral = simulate::Spectral {
        illuminant: args.illuminant,
        illuminance_lux: args.illuminance_lux,
        qe: args.qe,
        ..simulate::Spectral::default()
    };
    let camera = simulate::Request {
        lens: args.lens.into(),
        sensor: args.sensor.into(),
        white_e: args.white_e,
        gain: args.gain,
        time_s: args.time_s,
        samples: Some(args.samples),
        no_distortion: args.no_distortion,
        no_noise: args.no_noise,
        seed: args.seed,
        spectral,
        ..simulate::Request::default()
    };
    let request = chart::Request { isp: args.isp.name(), set: args.set, camera, out: args.out };
    let context = terminal.context().with_cancellation(signals::end_on_signal()?);
    let response = chart::run(&request, &context)?;
    drop(context);
    print_response(args.json, &response, || out!("{}", table(&response)))
}

/// The gray patches of the ColorChecker.
const GRAYS: [(usize, &str); 6] = [
    (18, "white"),
    (19, "neutral 8"),
    (20, "neutral 6.5"),
    (21, "neutral 5"),
    (22, "neutral 3.5"),
    (23, "black"),
];

/// Colours, noise of the grays, and sharpness.
fn table(response: &Response) -> String {
    let figures = &response.figures;
    let mut text =
        format!("{}, white of {:.0} electrons at gain {}\n\n", response.isp, response.white_e, response.gain);
    text += "dE00                    mean     max\n";
    for (name, of) in [("as developed", figures.as_developed), ("lightness normalised", figures.normalised)] {
        text += &format!("{name:<20}  {:>6.2}  {:>6.2}\n", of.mean_delta_e_2000, of.max_delta_e_2000);
    }
    text += "\nnoise           SNR dB  luma/255  chroma/255\n";
    for (i, name) in GRAYS {
        let noise = &figures.patches[i].noise;
        let chroma = 255.0 * noise.cb.hypot(noise.cr);
        let snr = noise.snr_db.map_or("-".to_owned(), |v| format!("{v:.1}"));
        text += &format!("{name:<14}  {snr:>6}  {:>8.2}  {chroma:>10.2}\n", 255.0 * noise.luma);
    }
    text += "\nedge at field   contrast         MTF50/px     overshoot %\n";
    for edge in &figures.edges {
        let mtf50 = match (edge.mtf50_per_px, edge.mtf50_standard_error) {
            (Some(value), Some(error)) => format!("{value:.4} ± {error:.4}"),
            _ => "-".to_owned(),
        };
        let overshoot = match (edge.overshoot, edge.overshoot_error) {
            (Some(value), Some([error, _])) => format!("{:.1} ± {:.1}", 100.0 * value, 100.0 * error),
            _ => "-".to_owned(),
        };
        text += &format!("{:<14.2}  {:>8}  {mtf50:>15}  {overshoot:>14}\n", edge.field, edge.contrast);
    }
    text + &format!("\n{}\n", shown(&response.page))
}
