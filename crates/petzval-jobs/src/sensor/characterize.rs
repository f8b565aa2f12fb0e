//! `sensor characterize`: a sensor measured from captures.

use std::path::{Path, PathBuf};

use petzval_base::{csv_number, csv_text};
use petzval_design::error::DesignError;
use petzval_lab::emva::captures::milliseconds;
use petzval_lab::emva::{Captures, Done, Options, characterize, result_xml, warning_lines};
use petzval_report::sensor_sheet;
use schemars::JsonSchema;
use serde::Serialize;

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder, write_file};
use crate::event::WarningKind;
use crate::frames::Frames;
use crate::range::check_ranges;
use crate::results::{check_folder, what_is};

pub use petzval_camera::sensor::Colour;
pub use petzval_lab::emva::joint::GAINS;
pub use petzval_lab::emva::{
    Characterization, Figure, HighPass, HistogramComparison, Limit, Measured, NamedFit, Unresolved, Values,
    Verdict, colour_name, fits, sensor_toml,
};

petzval_base::parameters! {
    /// Captures from which to measure a sensor: EMVA 1288, and the paper's calibration over all gains.
    pub struct Request {
        /// Pixel pitch, um, 0.1 to 1000, if the list does not state it.
        pixel_um: Option<f64> = None, "um", 0.1..1000.0, Log, "the pitch in um";
    }
    also {
        /// Folder of the captures, or its `captures.toml`.
        dir: PathBuf = PathBuf::new();
        /// Folder for the results, which are not written without it: `sensor.toml` if K is resolved, `results.json`, `emva-*.xml`
        /// for each gain and colour, `histograms.csv`, `report.html`, and its plots as `.svg`.
        out: Option<PathBuf> = None;
        /// High-pass before DSNU and PRNU.
        highpass: HighPass = HighPass::R4;
        /// Which values the XML files hold.
        values: Values = Values::Corrected;
        /// Whether the difference of the frames' means is taken from the temporal variance; without it, Eq. 6 of
        /// Tseng et al. 2021.
        mean_difference: bool = true;
        /// Whether the remaining parameters of the model are fitted to the captured histograms.
        fit_histograms: bool = false;
    }
}

/// What was measured.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Response {
    /// Every number with its standard error, or with the reason why the captures do not determine it.
    pub characterization: Characterization,
    /// The files that were written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub files: Vec<PathBuf>,
}

/// Files of every measurement; pages and XML files stand beside them.
const RESULTS: [&str; 3] = ["results.json", "sensor.toml", "histograms.csv"];

/// Reads the captures and measures the sensor; writes nothing.
pub fn characterization(request: &Request, context: &Context) -> Result<Characterization> {
    check_ranges(request)?;
    let mut captures = Captures::open(&request.dir)?;
    captures.sensor.pixel_um = captures.sensor.pixel_um.or(request.pixel_um);
    let options = Options {
        high_pass: request.highpass,
        mean_difference: request.mean_difference,
        fit_histograms: request.fit_histograms,
    };
    let frames = Frames::new(context, captures.frames());
    let done = |done: Done| match done {
        Done::Frame => frames.add("reading"),
        Done::Histogram => context.cancel().check(),
    };
    let characterization = characterize(&captures, &options, &done)?;
    warning_lines(&characterization.warnings)
        .iter()
        .for_each(|line| context.warning(WarningKind::Measurement, line));
    Ok(characterization)
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::placed(|request, folder| request.out = request.out.take().map(|_| folder.to_owned()));

/// Reads the captures, measures the sensor, and keeps the results in the folder of the request, if it names one.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    if let Some(out) = &request.out {
        check_folder(out, RESULTS, context)?;
    }
    let characterization = characterization(request, context)?;
    let files = match &request.out {
        Some(out) => keep(&characterization, request.values, out, context)?,
        None => Vec::new(),
    };
    Ok(Response { characterization, files })
}

/// Writes every file of the results, each whole or not at all; returns their paths.
pub fn keep(found: &Characterization, values: Values, out: &Path, context: &Context) -> Result<Vec<PathBuf>> {
    check_folder(out, RESULTS, context)?;
    make_folder(out)?;
    let mut files = Vec::new();
    let mut write = |name: &str, text: &str| -> Result<()> {
        let path = out.join(name);
        write_file(&path, text)?;
        context.wrote(&path, what_is(&path));
        files.push(path);
        Ok(())
    };
    // Without K there is no sensor file. One of an earlier run must not pass for that of this run.
    let sensor = out.join("sensor.toml");
    match sensor_toml(found) {
        Ok(text) => {
            if found.sensor.pixel_um.is_none() {
                let warning = "the captures do not state the pixel pitch, and sensor.toml has 1 um in its place; give --pixel-um, or edit the file";
                context.warning(WarningKind::Measurement, warning.to_owned());
            }
            write("sensor.toml", &text)?
        }
        Err(_) if sensor.is_file() => std::fs::remove_file(&sensor).map_err(DesignError::io(&sensor))?,
        Err(_) => {}
    }
    // In the order of the fields, which is that of the measurement.
    let results = serde_json::to_string_pretty(found).map_err(|e| JobError::failed(e.to_string()))?;
    write("results.json", &results)?;
    write("histograms.csv", &histograms_csv(found))?;
    for (name, text) in sensor_sheet::files(found) {
        write(&name, &text)?;
    }
    for gain in &found.gains {
        for channel in &gain.channels {
            let name = format!("emva-gain-{}-{}.xml", gain.linear_gain, colour_name(channel.colour));
            let xml = result_xml(channel, values).map_err(|e| JobError::failed(format!("{name}: {e}")))?;
            write(&name, &xml)?;
        }
    }
    Ok(files)
}

/// The captured histograms, a line for each digital number that occurs.
fn histograms_csv(found: &Characterization) -> String {
    let head = ["kind", "linear_gain", "exposure_ms", "photons", "colour", "dn", "samples"];
    let lines = found.histograms.iter().flat_map(|h| {
        let kind = if h.colour.is_some() { "flat" } else { "dark" };
        let (gain, ms) = (h.linear_gain.to_string(), milliseconds(h.exposure_s).to_string());
        let colour = h.colour.map_or("all", colour_name);
        let about = [kind.to_owned(), gain, ms, csv_number(h.photons), colour.to_owned()];
        let occurring = h.counts.counts.iter().enumerate().filter(|(_, count)| **count > 0);
        occurring.map(move |(i, count)| {
            let dn = h.counts.first_dn as usize + i;
            about.iter().cloned().chain([dn.to_string(), count.to_string()]).collect()
        })
    });
    csv_text([head.map(str::to_owned).to_vec()].into_iter().chain(lines))
}
