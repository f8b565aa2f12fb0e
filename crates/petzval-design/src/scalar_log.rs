//! The curves of a run for other programs: event files of TensorBoard, and `scalars.csv`.
//!
//! Both follow from `events.jsonl` and the lenses of the run. They are written anew when a run begins or goes on, up to where it stands, and every step is added;
//! so no step stands in them twice.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, UNIX_EPOCH};

use petzval_base::{csv_text, write_whole};
use petzval_optics::glass::Catalog;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::spot::spot;

use crate::error::{DesignError, Result};
use crate::run::{Event, RunFolder, RunRecord, read_events};
use crate::setup::Setup;
use crate::tensorboard::{FILE_MARK, scalar_record, version_record};

/// Head of `scalars.csv`: a line for each number. `step` counts steps of the run, `tag_step` those of the camera that the tag counts.
const HEAD: [&str; 6] = ["step", "seconds", "camera", "tag", "tag_step", "value"];

/// Numbers of a camera at one step of its own.
struct Point {
    step: u64,
    camera: String,
    tag_step: u64,
    scalars: Vec<(String, f64)>,
}

/// The curves of a run, open for its next steps.
pub struct ScalarLog {
    setup: Arc<Setup>,
    run: RunFolder,
    csv: fs::File,
    /// The file of each camera.
    files: BTreeMap<String, fs::File>,
    counted: Counted,
}

/// What numbers the steps of a run.
struct Counted {
    /// When the run was begun: seconds since 1970.
    begun_s: f64,
    /// Seconds of its steps so far.
    seconds: f64,
    /// Steps of every camera by block; those of all blocks under the empty name.
    steps: BTreeMap<(String, String), u64>,
    /// The last step, and its camera.
    last: Option<(u64, String)>,
    /// Steps whose lens is noted.
    lenses: Vec<u64>,
}

impl ScalarLog {
    /// Whether a run has such files.
    pub fn is_there(run: &RunFolder) -> bool {
        run.scalars_csv().is_file()
    }

    /// Writes the curves of a run as far as its events go, and opens them for the next ones.
    pub fn open(setup: Arc<Setup>, run: &RunFolder) -> Result<Self> {
        let begun = RunRecord::read(run)?.and_then(|record| humantime::parse_rfc3339(&record.begun).ok());
        let begun_s =
            begun.and_then(|at| at.duration_since(UNIX_EPOCH).ok()).unwrap_or(Duration::ZERO).as_secs_f64();
        let mut counted =
            Counted { begun_s, seconds: 0.0, steps: BTreeMap::new(), last: None, lenses: Vec::new() };
        let mut rows = csv_text([HEAD]);
        let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
        let events = if run.events().is_file() { read_events(&run.events())? } else { Vec::new() };
        for (place, event) in events.iter().enumerate() {
            let is_last_of_step = events.get(place + 1).is_none_or(|next| next.step != event.step);
            let of_event = counted.event(event);
            let of_lens = is_last_of_step.then(|| counted.lens(event.step, &setup, run)).flatten();
            for point in of_event.into_iter().chain(of_lens) {
                rows += &counted.csv(&point);
                let file = files.entry(point.camera.clone()).or_insert_with(|| version_record(begun_s));
                file.extend(counted.record(&point));
            }
        }
        write(&run.scalars_csv(), rows.as_bytes())?;
        let csv = appended(&run.scalars_csv())?;
        let mut log = Self { setup, run: run.clone(), csv, files: BTreeMap::new(), counted };
        for (camera, bytes) in files {
            let file = log.file(&camera, &bytes)?;
            log.files.insert(camera, file);
        }
        Ok(log)
    }

    /// Adds an event.
    pub fn event(&mut self, event: &Event) -> Result<()> {
        match self.counted.event(event) {
            Some(point) => self.add(&point),
            None => Ok(()),
        }
    }

    /// Adds the figures of the lens that the run has written after its last step.
    pub fn lens(&mut self) -> Result<()> {
        let Some((step, _)) = self.counted.last else { return Ok(()) };
        match self.counted.lens(step, &self.setup, &self.run) {
            Some(point) => self.add(&point),
            None => Ok(()),
        }
    }

    fn add(&mut self, point: &Point) -> Result<()> {
        let record = self.counted.record(point);
        if !self.files.contains_key(&point.camera) {
            let file = self.file(&point.camera, &version_record(self.counted.begun_s))?;
            self.files.insert(point.camera.clone(), file);
        }
        let path = self.run.tensorboard();
        if let Some(file) = self.files.get_mut(&point.camera) {
            file.write_all(&record).map_err(DesignError::io(&path))?;
        }
        let row = self.counted.csv(point);
        self.csv.write_all(row.as_bytes()).map_err(DesignError::io(&self.run.scalars_csv()))
    }

    /// The file of a camera with its first bytes, open for more.
    fn file(&self, camera: &str, bytes: &[u8]) -> Result<fs::File> {
        let folder = self.run.tensorboard().join(camera);
        fs::create_dir_all(&folder).map_err(DesignError::io(&folder))?;
        // The same name each time: a run that goes on does so in its file.
        let path = folder.join(format!("events.out.{FILE_MARK}.{:.0}.petzval", self.counted.begun_s));
        write(&path, bytes)?;
        appended(&path)
    }
}

impl Counted {
    /// The numbers of an event; none where it has none.
    fn event(&mut self, event: &Event) -> Option<Point> {
        self.seconds += event.seconds;
        self.last = Some((event.step, event.camera.clone()));
        let count = |steps: &mut BTreeMap<(String, String), u64>, block: &str| {
            let count = steps.entry((event.camera.clone(), block.to_owned())).or_default();
            *count += 1;
            *count
        };
        let (of_all, of_block) = (count(&mut self.steps, ""), count(&mut self.steps, &event.block));
        let is_score = event.block == crate::run::SCORE;
        let losses = event.losses.iter().filter(|(_, value)| value.is_finite());
        let mut scalars: Vec<(String, f64)> =
            losses.map(|(name, value)| (format!("{}/{name}", event.block), *value)).collect();
        if event.learning_rate > 0.0 {
            scalars.push((format!("{}/learning_rate", event.block), event.learning_rate));
        }
        let tag_step = if is_score { of_all } else { of_block };
        let point = Point { step: event.step, camera: event.camera.clone(), tag_step, scalars };
        Some(point).filter(|point| !point.scalars.is_empty())
    }

    /// The figures of the lens after a step of the run; none if no lens was written there, or has no image.
    fn lens(&mut self, step: u64, setup: &Setup, run: &RunFolder) -> Option<Point> {
        let (_, camera) = self.last.clone()?;
        let path = run.lens_at_step(step);
        if self.lenses.contains(&step) || !path.is_file() {
            return None;
        }
        self.lenses.push(step);
        let text = petzval_base::read_text(&path).ok()?;
        // A lens that we wrote carries its glasses with it.
        let lens = petzval_files::parse_lens(&text, &Catalog::default()).ok()?.lens;
        let scalars = lens_figures(setup, &lens)?;
        let tag_step = self.steps.get(&(camera.clone(), String::new())).copied().unwrap_or(0);
        Some(Point { step, camera, tag_step, scalars })
    }

    fn record(&self, point: &Point) -> Vec<u8> {
        scalar_record(self.begun_s + self.seconds, point.tag_step, &point.scalars)
    }

    fn csv(&self, point: &Point) -> String {
        let Point { step, camera, tag_step, scalars } = point;
        csv_text(scalars.iter().map(|(tag, value)| {
            let seconds = format!("{:.3}", self.seconds);
            [step.to_string(), seconds, camera.clone(), tag.clone(), tag_step.to_string(), value.to_string()]
        }))
    }
}

/// Focal length, f-number, and the mean over the fields of the polychromatic RMS spot radius.
fn lens_figures(setup: &Setup, lens: &Lens) -> Option<Vec<(String, f64)>> {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    let angles = setup.fixed_plan.field_angles(lens).ok()?;
    let spots: Option<Vec<f64>> = angles
        .iter()
        .map(|field| Some(spot(lens, *field, &setup.fixed_plan.quadrature)?.rms_poly_um))
        .collect();
    let spots = spots?;
    let figures = [
        ("efl_mm", order.efl_mm),
        ("f_number", order.f_number),
        ("rms_spot_um", spots.iter().sum::<f64>() / spots.len() as f64),
    ];
    Some(
        figures
            .map(|(name, value)| (format!("lens/{name}"), value))
            .into_iter()
            .filter(|(_, value)| value.is_finite())
            .collect(),
    )
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, bytes).map_err(DesignError::io(path))
}

fn appended(path: &Path) -> Result<fs::File> {
    fs::OpenOptions::new().append(true).open(path).map_err(DesignError::io(path))
}
