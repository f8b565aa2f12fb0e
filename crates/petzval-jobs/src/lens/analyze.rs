//! `lens analyze`: everything that a designer looks at, as pictures and as data.

use std::path::{Path, PathBuf};

use petzval_base::{Tally, pasted};
use petzval_design::lens::view::surfaces;
use petzval_optics::analysis::{AnalysisError, AnalysisOptions, analyze};
use petzval_optics::lens::Lens;
use petzval_optics::pupil::where_lost;
use petzval_optics::wave::NoWaves;
use petzval_report::lens_sheet::{PICTURES, Picture, page};
use schemars::JsonSchema;
use serde::Serialize;

use super::analysis_csv::TABLES;
use super::focus::{FocusAt, check_image, colours_out_of_focus, focused, out_of_focus};
use super::show::of_one_field;
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder, write_file};
use crate::event::WarningKind;
use crate::glass_range::warn_of_wavelengths;
use crate::input::{LensInput, SensorInput};
use crate::range::check_ranges;
use crate::results::check_folder;

pub use petzval_optics::analysis::Analysis;

/// Names of the page, of the data and of the tables among [`names`].
const PAGE: &str = "html";
const DATA: &str = "json";
const CSV: &str = "csv";

/// Most fields and most wavelengths that are analysed: of more, so many are taken evenly. More make no curve smoother and no picture clearer, but
/// take minutes.
const MOST: usize = 31;

petzval_base::parameters! {
    /// What to compute of a lens, and what to write.
    ///
    /// Files: one SVG for every [`Picture`]; `analysis.html`, all of them on one page; `analysis.json`, the data; the curves as CSV. Of fields and
    /// wavelengths 31 each are analysed at most; rays are aimed at the real stop.
    pub struct Request {
        /// Field angles, degrees; those of the lens if empty.
        fields: Vec<f64> = Vec::new(), "degrees", -180.0..180.0, Linear, "degrees from the axis";
        /// Wavelengths, um; those of the lens if empty. First-order properties stay those of the lens's reference wavelength.
        wavelengths: Vec<f64> = Vec::new(), "um", 0.2..20.0, Log, "um: 550 nm is 0.55";
        /// Pixel pitch, um, 0.1 to 1000, in place of a sensor.
        pixel_um: Option<f64> = None, "um", 0.1..1e3, Log, "in um, 0.1 to 1000; many sensors have pixels of 2 to 6 um";
        /// Highest frequency of MTF curves, cycles/mm; if left out, 100, or about half of the cutoff if that is less, but beyond the Nyquist
        /// frequency.
        max_frequency: Option<f64> = None, "cycles/mm", 1e-6..2e4, Log, "a pixel of 5.86 um resolves 85.32 cycles/mm";
        /// Frequency of MTF through focus, cycles/mm; half of the highest, or of the Nyquist frequency, if left out.
        frequency: Option<f64> = None, "cycles/mm", 1e-6..2e4, Log, "a pixel of 5.86 um resolves 85.32 cycles/mm";
    }
    also {
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = LensInput::default();
        /// Folder for the results; `NAME-analysis` if left out.
        out: Option<PathBuf> = None;
        /// Write only these of [`names`]; all if empty.
        only: Vec<String> = Vec::new();
        /// Where the image plane goes.
        focus: FocusAt = FocusAt::default();
        /// Sensor, by name, by path, or itself: its pixels' Nyquist frequency is marked in MTF curves.
        sensor: Option<SensorInput> = None;
    }
}

/// The analyses, and the files that show them.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Response {
    /// Folder of the files.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub folder: PathBuf,
    /// The files that were written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub files: Vec<PathBuf>,
    /// The page among them, if it was written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub page: Option<PathBuf>,
    /// The analyses.
    pub analysis: Analysis,
}

/// Names of everything that can be written: the pictures, `html` for the page, `json` for the data and `csv` for the curves as tables.
pub fn names() -> Vec<&'static str> {
    PICTURES.iter().map(|picture| picture.name).chain([PAGE, DATA, CSV]).collect()
}

impl Request {
    fn check(&self) -> Result<()> {
        check_ranges(self)?;
        if let (Some(pitch), Some(_)) = (self.pixel_um, &self.sensor) {
            let hint = "a sensor has a pixel pitch of its own: leave one of the two out";
            return Err(JobError::setting("pixel_um", pitch, "there is a sensor too", hint));
        }
        let names = names();
        match self.only.iter().find(|name| !names.contains(&name.as_str())) {
            Some(name) => {
                let hint = format!("the names are {}", names.join(", "));
                Err(JobError::setting("only", name, "nothing of this name can be written", hint))
            }
            None => Ok(()),
        }
    }

    /// A lens at the fields and wavelengths at which it is looked at.
    fn looked_at(&self, mut lens: Lens) -> Result<Lens> {
        let limit_deg = lens.object.field_limit_deg();
        if let Some(field) = self.fields.iter().find(|field| field.abs() >= limit_deg) {
            let hint = format!("degrees from the axis, less than {limit_deg}");
            return Err(JobError::setting("fields", field, "out of range", hint));
        }
        for (given, own) in
            [(&self.fields, &mut lens.fields_deg), (&self.wavelengths, &mut lens.wavelengths_um)]
        {
            if !given.is_empty() {
                own.clone_from(given);
                own.sort_by(f64::total_cmp);
                own.dedup();
            }
        }
        Ok(lens)
    }

    fn is_wanted(&self, name: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|n| n == name)
    }

    /// The folder for the results: `NAME-analysis` after a built-in name or the name of a file, unless the request names one.
    fn folder(&self) -> PathBuf {
        self.out.clone().unwrap_or_else(|| {
            let stem = Path::new(self.lens.short_name())
                .file_stem()
                .map_or_else(|| "lens".into(), |s| s.to_string_lossy());
            PathBuf::from(format!("{stem}-analysis"))
        })
    }
}

/// Analyses the lens; writes nothing.
pub fn analysis(request: &Request, context: &Context) -> Result<Analysis> {
    Prepared::new(request, context)?.analysed(context)
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::placed(|request, folder| request.out = Some(folder.to_owned()));

/// Analyses the lens and writes the files.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let prepared = Prepared::new(request, context)?;
    let folder = request.folder();
    let wanted: Vec<&Picture> = PICTURES.iter().filter(|picture| request.is_wanted(picture.name)).collect();
    let pictures = wanted.iter().map(|picture| format!("{}.svg", picture.name));
    let others = [(PAGE, "analysis.html"), (DATA, "analysis.json")];
    let others = others.into_iter().chain(TABLES.map(|(file, _)| (CSV, file)));
    let others = others.filter(|(name, _)| request.is_wanted(name)).map(|(_, file)| file.to_owned());
    check_folder(&folder, pictures.chain(others), context)?;
    let analysis = prepared.analysed(context)?;
    let data = serde_json::to_string(&analysis).map_err(|e| JobError::failed(e.to_string()))?;

    make_folder(&folder)?;
    let mut files = Vec::new();
    for picture in &wanted {
        let path = folder.join(format!("{}.svg", picture.name));
        write_file(&path, picture.svg(&analysis))?;
        context.wrote(&path, "picture");
        files.push(path);
    }
    let mut page_file = None;
    if request.is_wanted(PAGE) {
        // A page that is written without pictures beside it shows all of them.
        let shown = if wanted.is_empty() { PICTURES.iter().collect() } else { wanted };
        let path = folder.join("analysis.html");
        write_file(&path, page(&analysis, &surfaces(&prepared.lens), shown))?;
        context.wrote(&path, "page");
        files.push(path.clone());
        page_file = Some(path);
    }
    if request.is_wanted(DATA) {
        let path = folder.join("analysis.json");
        write_file(&path, data)?;
        context.wrote(&path, "figures");
        files.push(path);
    }
    if request.is_wanted(CSV) {
        for (name, table) in TABLES {
            let path = folder.join(name);
            write_file(&path, table(&analysis))?;
            context.wrote(&path, "table");
            files.push(path);
        }
    }
    Ok(Response { folder, files, page: page_file, analysis })
}

/// A lens that can be analysed, and how.
struct Prepared {
    /// What errors call it.
    name: String,
    lens: Lens,
    options: AnalysisOptions,
}

impl Prepared {
    /// The lens of a request, once every setting is known to be possible.
    fn new(request: &Request, context: &Context) -> Result<Self> {
        request.check()?;
        let name = request.lens.name().into_owned();
        let lens = request.lens.read(&context.assets)?.lens;
        warn_of_wavelengths(&lens, &request.wavelengths, context);
        let lens = request.looked_at(lens)?;
        let mut lens = focused(lens, request.focus)?;
        for (what, list) in [("fields", &mut lens.fields_deg), ("wavelengths", &mut lens.wavelengths_um)] {
            if list.len() > MOST {
                context.note(format!("{} of the {} {what} are analysed, evenly chosen", MOST, list.len()));
                *list = thinned(list);
            }
        }
        check_image(&name, &lens)?;
        let warning = match request.focus {
            FocusAt::File => out_of_focus(&name, &lens),
            FocusAt::Best => colours_out_of_focus(&lens),
            FocusAt::Paraxial => None,
        };
        if let Some(warning) = warning {
            context.warning(WarningKind::OutOfFocus, format!("{name}: {warning}"));
        }
        if let Some(no_waves) = NoWaves::of(&lens) {
            context.note(format!(
                "{name}: {no_waves}: MTF and encircled energy are by rays, and there is no Strehl ratio"
            ));
        }
        if let Some(said) = of_one_field(&lens) {
            context.note(format!("{name}: {said}"));
        }
        let pixel_pitch_um = match &request.sensor {
            Some(sensor) => Some(sensor.read(&context.assets)?.pixel_um),
            None => request.pixel_um,
        };
        let options = AnalysisOptions {
            pixel_pitch_um,
            max_frequency_per_mm: request.max_frequency,
            focus_frequency_per_mm: request.frequency,
            ..AnalysisOptions::default()
        };
        Ok(Self { name, lens, options })
    }

    fn analysed(&self, context: &Context) -> Result<Analysis> {
        let Self { name, lens, options } = self;
        let (done, fields) = (Tally::default(), lens.fields_deg.len() as u64);
        let tick = || {
            done.add(1, |done| context.progress(done, fields, "fields"));
            context.cancel().check()
        };
        let analysis = analyze(lens, options, &tick).map_err(|error| {
            let lost = match &error {
                AnalysisError::Stopped(cancelled) => return (*cancelled).into(),
                AnalysisError::NoChiefRay { field_deg, wavelength_um } => {
                    where_lost(lens, field_deg.to_radians(), &[*wavelength_um])
                }
                AnalysisError::NoLight { field_deg } => {
                    where_lost(lens, field_deg.to_radians(), &lens.wavelengths_um)
                }
            };
            match lost {
                Some(lost) => JobError::input(
                    format!("{name}: {error}: {lost}"),
                    "leave that field out, or let its light through there",
                ),
                None => JobError::input(
                    format!("{name}: {error}"),
                    format!(
                        "`petzval lens show {}` says where light is lost; or leave that field out",
                        pasted(Path::new(name))
                    ),
                ),
            }
        })?;
        if let Some(reason) = &analysis.no_curves {
            context.note(format!("{name}: no curves over the field: {reason}"));
        }
        Ok(analysis)
    }
}

/// [`MOST`] of a longer list, evenly from the first to the last.
fn thinned(list: &[f64]) -> Vec<f64> {
    (0..MOST).map(|i| list[i * (list.len() - 1) / (MOST - 1)]).collect()
}
