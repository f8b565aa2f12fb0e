//! The contents of the report, as plain data.

use petzval_optics::analysis::{FieldMtf, FirstOrderTable, Layout};
use petzval_optics::psf::{FieldPsf, PsfOptions};

use crate::palette;
use crate::prescription::SurfaceView;

/// The contents of a report.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Headline.
    pub title: String,
    /// One line below it: the optimised parts and the goal.
    pub subtitle: String,
    /// The command that made the run.
    pub command_line: String,
    /// The scores of the pictures, the most important one first.
    pub scores: Vec<Score>,
    /// Each camera's scores on held-out pictures, the baseline (`nominal`) first.
    pub table: Vec<TableRow>,
    /// The cameras that are compared, the baseline first.
    pub cameras: Vec<CameraView>,
    /// Fields of the rays in the layouts, degrees.
    pub layout_fields_deg: Vec<f64>,
    /// Wavelength of those rays and of the first-order properties, um.
    pub reference_um: f64,
    /// Wavelengths of the colour channels, um, in the order of [`PsfView::values`].
    pub wavelengths_um: Vec<f64>,
    /// Half of the diagonal of the sensor, mm.
    pub half_diagonal_mm: f64,
    /// The Nyquist frequency of the sensor, half a cycle a pixel, cycles/mm.
    pub nyquist_per_mm: f64,
    /// The scores of every held-out picture.
    pub held_out: Vec<HeldOutScores>,
    /// Held-out pictures, taken by each camera, those with a role first.
    pub pictures: Vec<PictureView>,
    /// Which pictures are not shown because their files are missing or damaged, in words; none where all are there.
    pub left_out: Option<String>,
    /// Whole frames of one photograph: the scene first, then one of each camera; or none.
    pub frames: Vec<FrameView>,
    /// Number of all held-out pictures.
    pub pictures_in_all: usize,
    /// Whether a hardware ISP, not a network, finishes the pictures.
    pub has_isp: bool,
    /// What is known of other seeds, if this run has one.
    pub one_seed: Option<OneSeed>,
    /// What the task of the run adds.
    pub task: TaskPart,
    /// Most training steps of a camera, and those that the experiment has, if the run was made shorter than that.
    pub short: Option<ShortRun>,
    /// What casts doubt on the scores of cameras.
    pub warnings: Vec<String>,
    /// How far the run has come, if it has not ended.
    pub progress: Option<Progress>,
    /// Cameras as they are made, if the run was evaluated with tolerances.
    pub made: Option<MadeCameras>,
    /// Losses over the run; curves of the same block and label share a chart.
    pub losses: Vec<LossCurve>,
    /// The resolved configuration, as it can be run again.
    pub config_toml: String,
    /// The machine: names and values.
    pub environment: Vec<(String, String)>,
    /// Remarks for the interpretation of the numbers.
    pub notes: Vec<String>,
}

/// What the task of a run adds to its report, which knows no task by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TaskPart {
    /// Its sections, the first of the result.
    pub sections: Vec<TaskSection>,
    /// The score of all held-out windows together that answers which camera is best; none where the mean over pictures answers it.
    pub ranking: Option<Ranking>,
    /// What is drawn over the pictures.
    pub legend: Option<String>,
    /// What [`HeldOutScores::found`] counts, as in `objects found`.
    pub counted: String,
}

/// A section that a task adds to its report.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskSection {
    /// Its headline.
    pub title: String,
    /// Its body in HTML, as it stands on the page.
    pub html: String,
}

/// Cameras by a score of all held-out windows together, as average precision is. Its ranges are those of 95 % of draws of the windows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ranking {
    /// The title of the score among [`Report::scores`].
    pub score: String,
    /// Titles of further scores that the sentences compare.
    pub further: Vec<String>,
    /// The words of its sentence.
    pub words: RankingWords,
    /// The camera that the others are compared with.
    pub baseline: String,
    /// The camera that is designed, which is compared with each other one.
    pub design: String,
    /// Each camera.
    pub cameras: Vec<RankedCamera>,
}

/// What cameras do, in the words of a task. A camera is the subject of each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RankingWords {
    /// What the best of several does: `finds most`.
    pub most: &'static str,
    /// What one does whose score is 0: `finds no object`.
    pub nothing: &'static str,
    /// What no camera does where the scores of all are 0: `finds an object`.
    pub anything: &'static str,
}

/// A camera in a ranking.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RankedCamera {
    /// Its name.
    pub camera: String,
    /// Its score; none where there is nothing to score.
    pub value: Option<f64>,
    /// The range of the score.
    pub range: Option<[f64; 2]>,
    /// Its score less that of the baseline over the same windows; none for the baseline.
    pub against_baseline: Option<Range>,
    /// The score of the design less its own over the same windows; none for the design.
    pub design_against: Option<Range>,
}

/// A run with fewer steps than its experiment has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShortRun {
    /// Most steps of the network of a camera, or of its hardware ISP where that is trained last.
    pub steps: usize,
    /// The same of the experiment.
    pub usual: usize,
}

impl ShortRun {
    /// `12 of 400 training steps`.
    pub fn in_words(self) -> String {
        format!("{} of {} training steps", self.steps, self.usual)
    }
}

/// A run that has not ended.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Every camera of the run, in the order in which they are made.
    pub cameras: Vec<CameraProgress>,
    /// How long the rest takes at the pace of the latest steps, in words; none before the first step.
    pub time_left: Option<String>,
}

/// How far a camera has come.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraProgress {
    /// Its name.
    pub camera: String,
    /// Where it stands.
    pub state: CameraState,
    /// What moves in its steps, the steps that were taken, and those that are planned at most.
    pub steps: Vec<(String, usize, usize)>,
    /// The latest sum of all losses; NaN without one.
    pub loss: f64,
}

/// Where a camera of a run stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraState {
    /// Scored.
    Finished,
    /// Being made.
    AtWork,
    /// Not begun.
    Waiting,
}

/// What is known of other seeds of a run that has one.
#[derive(Clone, Debug, PartialEq)]
pub enum OneSeed {
    /// The experiment was run with several.
    Studied(SeedStudy),
    /// Nothing; with the seed of the run.
    Alone(u64),
}

/// How far differences between cameras scatter with the seed.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedStudy {
    /// The experiment that was repeated.
    pub experiment: String,
    /// Number of seeds.
    pub seeds: usize,
    /// Network steps of each camera.
    pub network_steps: usize,
    /// Differences between its cameras.
    pub differences: Vec<SeedDifference>,
}

/// The difference between two cameras over several seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedDifference {
    /// The camera from whose scores those of the other are taken.
    pub camera: String,
    /// The other.
    pub against: String,
    /// In each score that was measured.
    pub spreads: Vec<Spread>,
}

/// Mean and standard deviation of a difference over the seeds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Index of the score in [`Report::scores`].
    pub score: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

/// A score of pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Its name, as a heading.
    pub title: String,
    /// Its unit; empty for a plain number.
    pub unit: String,
    /// Digits after the decimal point in tables.
    pub decimals: usize,
    /// Whether larger values are better.
    pub higher_is_better: bool,
    /// Whether cameras are compared by it in words; the first score is, where none is marked.
    pub leads: bool,
}

/// Scores of one camera, means over the held-out pictures; NaN if not measured.
#[derive(Clone, Debug)]
pub struct TableRow {
    /// Name of the camera: `nominal`, `spot-optimised`, `end-to-end`, ...
    pub camera: String,
    /// The scores, in the order of [`Report::scores`].
    pub scores: Vec<f64>,
    /// Whether its lens has no aberrations, so that it is the ceiling of the others.
    pub is_ceiling: bool,
    /// Root of the expected squared error after the best linear restoration of raw frames, % of white.
    pub restored_error_percent: f64,
    /// RMS spot radius over fields and wavelengths, um.
    pub rms_spot_um: f64,
    /// Effective focal length, mm.
    pub efl_mm: f64,
    /// Focal length divided by the entrance pupil diameter.
    pub f_number: f64,
    /// Full diagonal field of view, degrees.
    pub fov_deg: f64,
    /// Illumination in the sensor's corner relative to the axis, %; NaN if it is not known.
    pub corner_light_percent: f64,
    /// Steps that its network, or its hardware ISP, got.
    pub steps: usize,
}

/// The scores of a held-out picture by every camera: the figures of `pictures.csv`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeldOutScores {
    /// Photograph of which it is a part.
    pub photograph: String,
    /// Distance of its centre from the axis over that of the sensor's corner, 0..1.
    pub relative_field: f64,
    /// `[camera][score]`, in the order of [`Report::table`] and [`Report::scores`]; NaN if not measured.
    pub scores: Vec<Vec<f64>>,
    /// Objects that each camera finds in it, in the order of [`Report::table`]; empty if none are looked for.
    pub found: Vec<usize>,
}

/// Place of the camera with which the others are compared: the first whose lens is no ceiling, or the first.
pub(super) fn baseline(rows: &[TableRow]) -> usize {
    rows.iter().position(|row| !row.is_ceiling).unwrap_or(0)
}

/// One camera: its lens, spots and PSFs.
#[derive(Clone, Debug)]
pub struct CameraView {
    /// Name, as in [`TableRow::camera`].
    pub name: String,
    /// First-order properties of the lens.
    pub first_order: FirstOrderTable,
    /// The surfaces of the lens, in the order of the light.
    pub surfaces: Vec<SurfaceView>,
    /// The lens in cross-section, with rays of [`Report::layout_fields_deg`].
    pub layout: Layout,
    /// Modulation over frequency at [`Report::layout_fields_deg`], those where the lens has an image.
    pub mtf: Vec<FieldMtf>,
    /// Spots and light from the axis to the full field.
    pub over_field: Vec<FieldPoint>,
    /// PSFs at some fields; the table shows those nearest to 0, 25, 50, 75 and 100 % of the
    /// half-diagonal.
    pub psfs: Vec<PsfView>,
    /// Its numbers that differ from those of the lens from which the design started.
    pub changes: Vec<Change>,
    /// What moved of its exposure and of the parameters of its hardware ISP.
    pub setting_changes: Vec<Change>,
    /// What each coordinate of its lens did to the loss; empty for a lens that did not move for the task.
    pub attribution: Vec<Attribution>,
}

/// What a coordinate of a lens did to the loss.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribution {
    /// Its surface, or the image plane.
    pub surface: String,
    /// Which number of it.
    pub number: String,
    /// By how much its changes lowered the loss to first order: the sum of `-dL/dx dx` over the steps of the lens.
    pub lowered: f64,
}

/// Cameras as they are made: scores of random cameras whose lenses are off by their tolerances.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MadeCameras {
    /// How they were made and scored, in a sentence or two.
    pub conditions: String,
    /// The limit of each score of [`Report::scores`].
    pub limits: Vec<f64>,
    /// Each camera.
    pub rows: Vec<MadeCamera>,
}

/// Random cameras of one design.
#[derive(Clone, Debug, PartialEq)]
pub struct MadeCamera {
    /// Name, as in [`TableRow::camera`].
    pub camera: String,
    /// How many of them have no image.
    pub failed: usize,
    /// Figures of each score of [`Report::scores`].
    pub scores: Vec<MadeScore>,
}

/// A score of random cameras of one design.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MadeScore {
    /// Score of the camera as drawn.
    pub drawn: f64,
    /// Mean.
    pub mean: f64,
    /// What nine in ten reach.
    pub of_90_percent: f64,
    /// Share that reaches the limit, 0..1.
    pub share: f64,
}

/// What the cameras find.
#[derive(Clone, Debug)]
pub struct DetectionView {
    /// The camera that the others are compared with.
    pub baseline: String,
    /// The camera that is designed, which is compared with each other one: the last whose lens has aberrations.
    pub design: String,
    /// Number of held-out windows.
    pub windows: usize,
    /// Each camera.
    pub cameras: Vec<CameraDetection>,
}

/// What a camera finds.
#[derive(Clone, Debug, Default)]
pub struct CameraDetection {
    /// Name of the camera.
    pub camera: String,
    /// Its place among the cameras of the run, which gives its colour.
    pub number: usize,
    /// Precision over recall of each class that has objects, at an overlap of 0.5.
    pub curves: Vec<PrecisionCurve>,
    /// Average precision of all objects, and of groups of them.
    pub groups: Vec<GroupFigure>,
    /// Its AP50 less that of the baseline over the same windows; none for the baseline.
    pub against_baseline: Option<Range>,
    /// The AP50 of the design less its own over the same windows; none for the design.
    pub design_against: Option<Range>,
    /// AP50 of its detector at four places: the picture of perfect optics without noise, the light on the pixels, the raw frame in a plain
    /// development, and the finished picture. None if there are no objects.
    pub ap50_at_stages: [Option<f64>; 4],
    /// Where objects are lost.
    pub lost: LostObjects,
    /// The largest objects that it misses.
    pub misses: Vec<Mistake>,
    /// What it surely finds where nothing is.
    pub false_alarms: Vec<Mistake>,
}

/// Precision over recall of a class.
#[derive(Clone, Debug)]
pub struct PrecisionCurve {
    /// The class.
    pub class: String,
    /// Recall and precision, 0..1, in ascending recall.
    pub points: Vec<(f64, f64)>,
}

/// A figure of a group of objects.
#[derive(Clone, Debug)]
pub struct GroupFigure {
    /// Name of the group.
    pub name: String,
    /// Its average precision.
    pub value: f64,
    /// Low and high end of the range that it has in 95 % of draws of the windows; none where all windows are of one film.
    pub range: Option<[f64; 2]>,
}

/// A figure, and the range that it has in 95 % of draws of the windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The figure.
    pub value: f64,
    /// Lower end of the range.
    pub low: f64,
    /// Upper end of the range.
    pub high: f64,
}

/// How many objects are found, and at which stage the others are lost.
#[derive(Clone, Copy, Debug, Default)]
pub struct LostObjects {
    /// All objects.
    pub objects: usize,
    /// Found in the finished picture.
    pub found: usize,
    /// Beside the picture: the lens shows less of the scene than that of the experiment.
    pub beside: usize,
    /// Not found even in the picture of perfect optics without noise.
    pub in_scene: usize,
    /// Found there, but no more in the light behind the lens.
    pub by_lens: usize,
    /// Found there, but no more in the raw frame.
    pub by_sensor: usize,
    /// Found there, but no more in the finished picture.
    pub by_isp: usize,
}

/// A miss or a false alarm.
#[derive(Clone, Debug)]
pub struct Mistake {
    /// The whole picture, PNG.
    pub picture_png: Vec<u8>,
    /// Where it is: left, upper, right and lower edge, pixels of the picture.
    pub bbox: [f32; 4],
    /// What was missed, or thought to be there.
    pub title: String,
}

/// A lens at one field, over all colour channels.
#[derive(Clone, Copy, Debug)]
pub struct FieldPoint {
    /// Field angle, degrees.
    pub field_deg: f64,
    /// RMS spot radius about the common centroid of the channels, um.
    pub rms_um: f64,
    /// Relative illumination, mean of the channels.
    pub illumination: f64,
}

/// The PSFs of one field in all colour channels.
#[derive(Clone, Debug)]
pub struct PsfView {
    /// Field angle, degrees.
    pub field_deg: f64,
    /// Height of the chief ray on the sensor, mm.
    pub chief_y_mm: f64,
    /// Cells a side.
    pub grid: usize,
    /// Cell size, um.
    pub pitch_um: f64,
    /// `[channel][row * grid + column]`, each of unit sum, rows away from the axis, in the order of
    /// [`Report::wavelengths_um`].
    pub values: [Vec<f64>; 3],
    /// Relative illumination, mean of the channels, 1 on the axis of an unvignetted lens.
    pub illumination: f64,
    /// RMS radius about the common centroid of the channels, um; NaN if it is not known.
    pub rms_um: f64,
}

impl PsfView {
    /// The view of a traced PSF with its RMS radius; `None` unless it has three channels.
    pub fn new(psf: &FieldPsf, options: &PsfOptions, rms_um: f64) -> Option<Self> {
        let values = <[Vec<f64>; 3]>::try_from(psf.values.clone()).ok()?;
        Some(Self {
            field_deg: psf.field_rad.to_degrees(),
            chief_y_mm: psf.chief_y_mm,
            grid: options.grid,
            pitch_um: options.pitch_um,
            values,
            illumination: psf.illumination.iter().sum::<f64>() / psf.illumination.len() as f64,
            rms_um,
        })
    }
}

/// A number of a lens before and after.
#[derive(Clone, Debug)]
pub struct Change {
    /// Which number, e.g. `V1 front radius`.
    pub parameter: String,
    /// Its value in the lens from which the design started.
    pub from: f64,
    /// Its value in this camera.
    pub to: f64,
    /// Its unit, empty for a plain number.
    pub unit: String,
    /// Lower bound; infinite if it has none.
    pub min: f64,
    /// Upper bound; infinite if it has none.
    pub max: f64,
}

/// Why a picture is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// At the place of most gain, the picture that gains most.
    MostGain,
    /// On the axis, or as near to it as pictures are.
    Axis,
    /// In the corner, or as near to it as pictures are.
    Corner,
    /// In the zone between them.
    Zone,
    /// Of all pictures, that of median gain.
    MedianGain,
    /// Of all pictures, that of the least gain.
    LeastGain,
}

/// One held-out picture.
#[derive(Clone, Debug)]
pub struct PictureView {
    /// Title.
    pub title: String,
    /// Its place in [`Report::held_out`].
    pub number: usize,
    /// Why it is shown; none for one that is shown because it is there.
    pub role: Option<Role>,
    /// The middle of the part that is enlarged, shares of width and height; none for the part with the most detail.
    pub focus: Option<[f64; 2]>,
    /// The scene, PNG.
    pub truth_png: Vec<u8>,
    /// The picture of each camera, in the order of [`Report::cameras`].
    pub cameras: Vec<CameraPicture>,
}

/// The whole frame of a camera, or the scene as it lies on the sensor.
#[derive(Clone, Debug)]
pub struct FrameView {
    /// Name of the camera; that of the scene.
    pub name: String,
    /// The picture, PNG.
    pub png: Vec<u8>,
}

/// A picture taken by one camera.
#[derive(Clone, Debug)]
pub struct CameraPicture {
    /// Name of the camera.
    pub camera: String,
    /// The raw frame, developed but not yet processed by the network, PNG.
    pub developed_png: Vec<u8>,
    /// The output of the network, PNG.
    pub output_png: Vec<u8>,
    /// The scores of the output, in the order of [`Report::scores`].
    pub scores: Vec<f64>,
}

/// A loss over the steps of the run.
#[derive(Clone, Debug)]
pub struct LossCurve {
    /// Name of the camera that was being optimised.
    pub camera: String,
    /// Block of the optimisation: `optics`, `network`, ...
    pub block: String,
    /// Name of the loss with its unit, for the axis.
    pub label: String,
    /// Step and value.
    pub points: Vec<(u64, f64)>,
}

/// Colour of a camera by its name; an unknown name gets the next colour.
pub(super) fn camera_colour(cameras: &[CameraView], name: &str, i: usize) -> &'static str {
    palette::camera(cameras.iter().position(|c| c.name == name).unwrap_or(cameras.len() + i))
}
