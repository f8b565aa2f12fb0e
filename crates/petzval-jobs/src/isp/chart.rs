//! `isp chart`: the test chart through a lens onto a sensor, developed by an ISP, and measured.

use std::path::PathBuf;

use petzval_camera::isp::{DewarpMap, IspParameter, RgbPicture};
use petzval_camera::spectral::{ChartData, TestChart, colour_checker, seen_under};
use petzval_design::error::DesignError;
use petzval_files::isp_file::picture_png_bytes;
use petzval_lab::chart::{ChartFigures, measure};
use petzval_report::chart_sheet::{ChartSheet, page};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder, write_file};
use crate::event::WarningKind;
use crate::named_isp::isp_by_name;
use crate::results::{check_folder, what_is};
use crate::simulate;
use crate::simulate::spectral::scene_frame;

/// Bits of the picture: its noise is measured, and that of rounding to 8 bits is not the ISP's.
const BITS: u32 = 16;

/// Quantum efficiency where the sensor has none and none is named.
const DEFAULT_QE: &str = "imx219";

/// Samples of the chart along a side of a pixel, unless the camera of the request says how many. With two, which show the light at their middles,
/// MTFs are right to 0.01 below 0.5 cycles a pixel.
pub const SAMPLES: usize = 2;

/// The white patch among those of the chart.
const WHITE: usize = 18;

/// L* above which a patch shows nothing but the end of the range.
const CLIPPED_LIGHTNESS: f64 = 99.9;

petzval_base::parameters! {
    /// A camera and an ISP to measure. What is left out has the default of the command.
    pub struct Request {
        /// Name of a preset, or a file of settings or of the description of an external ISP.
        isp: String = super::NEUTRAL.to_owned();
        /// Further values, each `stage.key=value`.
        set: Vec<String> = Vec::new();
        /// The camera and its exposure. Images, formats and the other developments of a simulation are not used.
        camera: simulate::Request = simulate::Request { samples: Some(SAMPLES), ..simulate::Request::default() };
        /// Folder for the results.
        out: PathBuf = PathBuf::new();
    }
}

/// What was measured, and the files that hold it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Name of the ISP, as in the request.
    pub isp: String,
    /// Lens.
    pub lens: String,
    /// Sensor.
    pub sensor: String,
    /// Quantum efficiency in place of the sensor's own.
    pub qe: Option<String>,
    /// Light on the chart.
    pub illuminant: String,
    /// Illuminance of the chart, lux.
    pub illuminance_lux: f64,
    /// Photoelectrons of white in a green pixel on the axis.
    pub white_e: f64,
    /// Linear analogue gain.
    pub gain: f32,
    /// Rows of the picture.
    pub height: usize,
    /// Columns of the picture.
    pub width: usize,
    /// The figures.
    pub figures: ChartFigures,
    /// The developed picture.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub picture: PathBuf,
    /// The page with patches and curves.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub page: PathBuf,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    out_in: Some(""),
    ..AsUnit::seeded(
        |request, seed| request.camera.seed = seed,
        |request, folder| request.out = folder.to_owned(),
    )
};

/// Takes, develops and measures the chart. The folder `out` gets `chart.json` (the response), `chart.png` and `chart.html`.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_folder(&request.out, ["chart.png", "chart.html", "chart.json"], context)?;
    let mut isp = isp_by_name(&request.isp, &context.assets, context.cancel())?;
    isp.set(&request.set)?;
    isp.set_bits(BITS);
    let sensor = request.camera.sensor.read(&context.assets)?;
    if !sensor.cfa.is_bayer() {
        let message = format!("{}: the ISP needs a Bayer array, not {}", request.camera.sensor, sensor.cfa);
        return Err(JobError::input(message, "name another sensor"));
    }
    let mut camera = request.camera.clone();
    camera.samples.get_or_insert(SAMPLES);
    if sensor.quantum_efficiency.is_none() && camera.spectral.qe.is_none() {
        context.note(format!("{}: no quantum efficiency: that of {DEFAULT_QE} is taken", camera.sensor));
        camera.spectral.qe = Some(DEFAULT_QE.to_owned());
    }
    // The chart has the size of the sensor; what the lens sees beyond repeats its gray edge.
    camera.place = simulate::Place::Centre;
    let taken = scene_frame(&camera, |height, width| TestChart { height, width }.draw(), context)?;
    let frame = &taken.frame;

    let values = isp.values(frame.about.gain_ev)?;
    for clipped in isp.clipped(&frame.about, &values).map_err(DesignError::from)? {
        context.warning(WarningKind::RawFrame, format!("the chart: its {clipped}"));
    }
    let picture = isp.isp().develop(frame, &values).map_err(DesignError::from)?;

    // An ISP that keeps some of the distortion shows the chart where the lens brings it.
    let chart = TestChart { height: frame.height, width: frame.width };
    let size = (frame.height, frame.width);
    let (mesh, strength) = (frame.about.warp.as_ref(), dewarp_strength(&isp.parameters, &values));
    let (lens, dewarp) = (DewarpMap::new(mesh, 1.0, size), DewarpMap::new(mesh, strength, size));
    let place = |at: [f64; 2]| dewarp.picture_from_raw(lens.raw_from_picture(at)).unwrap_or(at);
    let wanted: Vec<[f64; 3]> = colour_checker(ChartData::Ohta)
        .iter()
        .map(|(_, reflectance)| seen_under(reflectance, &taken.illuminant))
        .collect();
    let figures = measure(&picture, &chart, &wanted, place);
    let white = &figures.patches[WHITE];
    if white.lab[0] > CLIPPED_LIGHTNESS {
        let text = format!(
            "the white patch is clipped: it has L* {:.1} and should have {:.1}; give the chart less light with --white-e",
            white.lab[0], white.wanted_lab[0]
        );
        context.warning(WarningKind::Picture, text);
    }

    make_folder(&request.out)?;
    let path = |name: &str| request.out.join(name);
    let response = Response {
        isp: request.isp.clone(),
        lens: camera.lens.to_string(),
        sensor: camera.sensor.to_string(),
        qe: camera.spectral.qe,
        illuminant: taken.illuminant.name.clone(),
        illuminance_lux: taken.lux,
        white_e: taken.white_e,
        gain: camera.gain,
        height: picture.height,
        width: picture.width,
        figures,
        picture: path("chart.png"),
        page: path("chart.html"),
    };
    write_file(&response.picture, &picture_png_bytes(&picture, BITS).map_err(JobError::failed)?)?;
    write_file(&response.page, page(&sheet(&response, &picture)).as_bytes())?;
    let json = serde_json::to_string_pretty(&response).map_err(|e| JobError::failed(e.to_string()))?;
    write_file(&path("chart.json"), json.as_bytes())?;
    let files = [response.picture.clone(), response.page.clone(), path("chart.json")];
    files.iter().for_each(|path| context.wrote(path, what_is(path)));
    Ok(response)
}

/// The share of the distortion that an ISP undoes; all of it unless it has a parameter that says otherwise.
fn dewarp_strength(parameters: &[IspParameter], values: &[f64]) -> f64 {
    let found = parameters.iter().zip(values).find(|(p, _)| p.name == "dewarp.strength");
    found.map_or(1.0, |(_, value)| *value)
}

/// The page of a measurement.
fn sheet<'a>(response: &'a Response, picture: &RgbPicture) -> ChartSheet<'a> {
    let names = colour_checker(ChartData::Ohta).iter().map(|(name, _)| name.as_str()).collect();
    let facts = vec![
        ("lens", response.lens.clone()),
        ("sensor", response.sensor.clone()),
        ("light", format!("{}, {:.0} lux", response.illuminant, response.illuminance_lux)),
        ("electrons of white", format!("{:.0}", response.white_e)),
        ("gain", response.gain.to_string()),
    ];
    let RgbPicture { height, width, .. } = *picture;
    ChartSheet {
        isp: response.isp.clone(),
        facts,
        names,
        figures: &response.figures,
        height,
        width,
        encoded: picture.encoded(),
    }
}
