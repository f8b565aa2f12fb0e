//! The tables of an experiment: every number with its unit, range, default and sentence.

use petzval_base::parameters;
use std::path::Path;

use petzval_camera::develop::{Demosaic, Domain, Interpolation};
use petzval_camera::isp::IspParameter;
use petzval_camera::sensor::{Exposure, NoiseMode};
use petzval_learn::detection::{BackboneKind, DetectorKind};
use petzval_optics::constraint::Constraint;
use petzval_optics::lens::Lens;
use petzval_optics::optimize::Limits;
use petzval_optics::psf::PsfKind;
use petzval_street::{Families, Light};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::names::{NetworkKind, PsfsBy};

parameters! {
    /// Exposure of every camera of the experiment.
    pub struct ExposureConfig {
        /// Photoelectrons that white gives in a green pixel on the axis, behind the experiment's lens.
        white_e: f32 = 16000.0, "e-", 1..1e7, Log, "photoelectrons of white in green";
        /// Exposure time.
        time_s: f32 = 0.005, "s", 1e-6..1e4, Log, "seconds; 5 ms is 0.005";
        /// Linear analogue gain.
        linear_gain: f32 = 1.0, "", 0.1..1e3, Log, "1 is 0 dB, 31.62 is 30 dB";
        /// Where the exposure time moves: its shortest and longest. What moves in the scene sets the longest, which no photograph shows.
        times_s: [f64; 2] = [1e-4, 0.03], "s", 1e-6..1e4, Log, "shortest and longest: [0.0001, 0.03]";
        /// Where the gain moves: its lowest and highest.
        gains: [f64; 2] = [1.0, 31.62], "", 0.1..1e3, Log, "lowest and highest: [1.0, 31.62]";
        /// Exposure steps of a stage that moves the exposure.
        steps: usize = 100, "", 0..1e8, Log, "a hundred; each takes three frames for each setting that moves";
        /// First learning rate of Adam, as a share of a setting's range; it falls along a half cosine.
        learning_rate: f64 = 0.02, "", 1e-8..1, Log, "0.02 of a range of 1";
        /// Learning rate at the end over that at the start.
        final_learning_rate: f64 = 0.05, "", 0..1, Linear, "a share of the first";
        /// Weight of the exposure's proximal term.
        proximal: f64 = 0.0, "", 0..1e6, Log, "0 leaves the proximal term out";
    } also {
        /// Settings that stages with the block `exposure` move: "time", "gain", both or none. The light of the scene stays: a camera that is exposed
        /// for longer has more electrons of white than are stated.
        vary: Vec<ExposureSetting> = Vec::new();
        /// What every camera of the experiment has the same amount of.
        same: SameOf = SameOf::Electrons;
    }
}

/// A setting of the exposure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ExposureSetting {
    /// The exposure time.
    Time,
    /// The linear analogue gain.
    Gain,
}

/// What cameras with different lenses have the same amount of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SameOf {
    /// Photoelectrons: behind a lens that gathers less light, a camera is exposed for longer.
    #[default]
    Electrons,
    /// Exposure time: a camera whose lens gathers more light has more electrons.
    Time,
}

parameters! {
    /// How point-spread functions are computed.
    pub struct PsfConfig {
        /// Number of fields from the axis to the sensor's corner.
        fields: usize = 13, "", 2..201, Linear, "the paper takes 13";
        /// Wavelengths of the red, green and blue channel.
        wavelengths_um: [f64; 3] = [0.62, 0.55, 0.486], "um", 0.2..20, Linear, "wavelengths are in um: 550 nm is 0.55";
        /// Cells a side of a PSF; an even number.
        grid: usize = 128, "", 16..1024, Log, "the paper takes 128";
        /// Cell size.
        pitch_um: f64 = 1.0, "um", 0.05..50, Log, "the paper takes 1";
        /// Patches of constant PSF on the sensor while the lens moves: rows, columns.
        patches: [usize; 2] = [7, 7], "", 1..101, Linear, "the paper takes 7 x 7";
        /// Fields for the pictures of lenses at rest and for scoring, between which PSFs are mixed.
        scoring_fields: usize = 31, "", 2..201, Linear, "31 mix to an error of 0.01, 13 to 0.05";
        /// Largest median error of the blend of patches for lenses at rest and for scoring, which sets their number: the sum of absolute
        /// differences between the blended PSF and that of the place, both of unit sum.
        scoring_blend_error: f64 = 0.03, "", 0.003..2, Log, "0.03 takes about 21 patch rows, 2 the fewest";
        /// Pupil cells a side while the lens moves; an even number.
        pupil_cells: usize = 96, "", 16..1024, Log, "32 is quick, 256 is accurate";
        /// Fewest pupil cells a side for lenses at rest and for scoring; an even number.
        scoring_pupil_cells: usize = 256, "", 16..1024, Log, "32 is quick, 256 is accurate";
        /// Largest error of their PSFs, for which the pupil cells are doubled up to 2048: the sum of absolute differences, of unit sum.
        scoring_pupil_error: f64 = 0.02, "", 0.001..2, Log, "0.02, or 2 to keep the fewest cells";
    } also {
        /// Rays, right where aberrations spread light over many times the Airy disk; waves; or a file, whose PSFs every camera has.
        kind: PsfsBy = PsfsBy::Geometric;
        /// The PSFs of the kind "file": a folder or its psf.json, as `petzval psf` and `petzval psf-calibrate` write them. They are held, so that no
        /// lens moves. "none" for the other kinds.
        file: String = NO_FILE.to_owned();
    }
}

/// No file of PSFs.
pub(crate) const NO_FILE: &str = "none";

impl PsfConfig {
    /// The file of PSFs that it names.
    pub fn named_file(&self) -> Option<&str> {
        Some(self.file.as_str()).filter(|file| *file != NO_FILE)
    }
}

parameters! {
    /// The network behind the development.
    pub struct NetworkConfig {
        /// Channels of the first level.
        base_channels: usize = 16, "", 1..256, Log, "16 trains in minutes on a CPU";
        /// Levels of halved resolution.
        levels: usize = 3, "", 1..6, Linear, "3 or 4";
    } also {
        /// A U-Net that sees the picture alone, a U-Net or NAF network behind a restoration that is trained with it, or a class in Python.
        kind: NetworkKind = NetworkKind::RestorationNaf;
        /// The weights from which the network of every camera starts. "built-in": those that come with the program, of a network that has learnt behind
        /// many lenses and at many exposures, if the network is of their kind and sizes (restoration-naf, 16 channels, 3 levels), else drawn
        /// from the seed. It learnt by rays or by waves, as `psf.kind` says; "built-in-rays" or "built-in-waves" takes one of the two in any case.
        /// "none": drawn from the seed. Or a file `cameras/NAME/network.safetensors` of a run.
        weights: String = BUILT_IN_WEIGHTS.to_owned();
    }
}

/// No weights to start from.
const NO_WEIGHTS: &str = "none";

/// The weights that come with the program, for the PSFs of the experiment.
const BUILT_IN_WEIGHTS: &str = "built-in";

/// Those of a network that learnt behind PSFs by rays, whatever those of the experiment.
const BUILT_IN_BY_RAYS: &str = "built-in-rays";

/// Those of a network that learnt behind PSFs by waves, whatever those of the experiment.
const BUILT_IN_BY_WAVES: &str = "built-in-waves";

impl NetworkConfig {
    /// Whether its weights are drawn whatever its kind.
    pub fn draws_weights(&self) -> bool {
        self.weights == NO_WEIGHTS
    }

    /// Whether it starts from weights that come with the program, if it can.
    pub fn has_built_in_weights(&self) -> bool {
        [BUILT_IN_WEIGHTS, BUILT_IN_BY_RAYS, BUILT_IN_BY_WAVES].contains(&self.weights.as_str())
    }

    /// Takes the weights of PSFs of this kind from now on, whatever kind those of the experiment become.
    pub fn pin_weights(&mut self, psfs: PsfKind) {
        if self.weights == BUILT_IN_WEIGHTS {
            let pinned = match psfs {
                PsfKind::Geometric => BUILT_IN_BY_RAYS,
                PsfKind::Diffraction => BUILT_IN_BY_WAVES,
            };
            self.weights = pinned.to_owned();
        }
    }

    /// The file of the weights that come with the program, for PSFs of this kind, below the folder of built-in data.
    pub fn built_in_file(&self, psfs: PsfKind) -> &'static str {
        let learnt_behind = match self.weights.as_str() {
            BUILT_IN_BY_RAYS => PsfKind::Geometric,
            BUILT_IN_BY_WAVES => PsfKind::Diffraction,
            _ => psfs,
        };
        match learnt_behind {
            PsfKind::Geometric => "weights/restoration_naf.safetensors",
            PsfKind::Diffraction => "weights/restoration_naf_waves.safetensors",
        }
    }
}

/// What looks for objects in the finished pictures.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DetectorConfig {
    /// Two stages, or one.
    pub kind: DetectorKind,
    /// What turns pictures into features.
    pub backbone: BackboneKind,
    /// The file of weights from which the detector starts, in place of drawn ones. It is `cameras/NAME/blocks/network/weights.bin` or
    /// `cameras/NAME/network.safetensors` of a run with the same detector and classes, or a safetensors file. Such a file has the weights
    /// of torchvision's Faster R-CNN on the same backbone, or those of a classifier, which are for the backbone alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
}

impl DetectorConfig {
    /// The file of weights, if it is a safetensors file.
    pub(crate) fn safetensors(&self) -> Option<&Path> {
        let path = Path::new(self.weights.as_ref()?);
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("safetensors")).then_some(path)
    }
}

parameters! {
    /// The streets in which objects are to be found: made by seed, seen through the chief rays of each lens.
    pub struct StreetConfig {
        /// Training windows, each a place of a street of its own; steps draw from them, half of the time mirrored.
        windows: usize = 384, "", 1..1e6, Log, "a few hundred on a CPU";
        /// Windows in streets that nothing is trained on, in which cameras are scored.
        held_out: usize = 96, "", 1..1e6, Log, "96 for a figure, 400 for a claim";
        /// Samples along a side of a pixel.
        samples: usize = 2, "", 1..16, Linear, "2 to 4";
        /// Luminance that gives `exposure.white_e` at the longest exposure; in brighter streets the automatic exposure takes less, until the
        /// geometric mean of the luminance is 18 % of white.
        white_cd_m2: f64 = 3.0, "cd/m^2", 1e-4..1e7, Log, "a lit road at night has 1, a white wall in sunshine 20000";
        /// Traffic and people, of those in a busy town. The more there are, the more they hide each other.
        busy: f64 = 0.4, "", 0..1, Linear, "0.4; 1 for a town at noon";
        /// Share of the windows that are placed on an object; the others lie anywhere.
        on_objects: f64 = 0.9, "", 0..1, Linear, "0.9";
        /// By how much training windows are larger than `training.crop`, as a share of it: every step takes another part of a window, on one of its
        /// objects.
        spare: f64 = 0.5, "", 0..3, Linear, "0.5";
        /// Least longer side of an object that counts. Smaller ones are ignored: neither misses nor false positives.
        least_side_px: f64 = 24.0, "pixels", 1..1e4, Log, "24 pixels";
        /// Least share of an object that must be seen for it to count.
        least_visible: f64 = 0.6, "", 0..1, Linear, "0.6";
    } also {
        /// Time of day.
        light: Light = Light::Day;
        /// Families of shapes and textures in training.
        families: Families = Families::All;
        /// Families of shapes and textures in scores.
        held_out_families: Families = Families::All;
    }
}

/// How raw frames become pictures before the network.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DevelopmentConfig {
    /// How colours are interpolated.
    pub demosaic: Demosaic,
    /// The values between which they are interpolated.
    pub domain: Domain,
    /// Whether the blur of the lens is divided out with the PSFs of every place, before the network.
    pub restore: bool,
}

impl Default for DevelopmentConfig {
    fn default() -> Self {
        Self { demosaic: Demosaic::Menon, domain: Domain::Stabilised, restore: true }
    }
}

impl DevelopmentConfig {
    /// As the linear ISP takes it.
    pub fn interpolation(&self) -> Interpolation {
        Interpolation { demosaic: self.demosaic, domain: self.domain }
    }
}

parameters! {
    /// A hardware ISP in place of linear development and network, the same for every variant.
    pub struct IspConfig {
        /// ISP steps of a stage that moves the ISP.
        steps: usize = 300, "", 0..1e8, Log, "a few hundred on a CPU";
        /// First learning rate of Adam, as a share of a parameter's range; it falls along a half cosine.
        learning_rate: f64 = 0.02, "", 1e-8..1, Log, "0.02 of a range of 1";
        /// Learning rate at the end over that at the start.
        final_learning_rate: f64 = 0.05, "", 0..1, Linear, "a share of the first";
        /// Weight of the ISP's proximal term.
        proximal: f64 = 0.0, "", 0..1e6, Log, "0 leaves the proximal term out";
        /// Where a network imitates the ISP (the method "proxy"): its training steps before each step of the ISP.
        proxy_steps: usize = 8, "", 1..1e4, Log, "4 to 20";
        /// Steps of the ISP, from the first by the method "proxy", in which the network learns and the parameters rest.
        proxy_warm_up: usize = 150, "", 0..1e6, Log, "with 8 training steps each, 150 are 1200";
    } also {
        /// Name or file of a preset of the built-in automotive ISP, or the description of an external ISP; "none" for linear development and a
        /// network.
        preset: String = NO_ISP.to_owned();
        /// Parameters that move, by name or stage.
        vary: Vec<String> = VARIED.map(str::to_owned).to_vec();
    }
}

/// The preset of an experiment without a hardware ISP.
pub const NO_ISP: &str = "none";

/// Stages whose parameters an experiment with a hardware ISP moves: those that trade noise and sharpness, and the tones. Levels, balance
/// and colour matrix come from calibration.
const VARIED: [&str; 8] = [
    "bayer_denoise",
    "luma_denoise",
    "chroma_denoise",
    "sharpen",
    "false_colour",
    "purple_fringe",
    "green_balance",
    "defects",
];

/// A parameter that no experiment moves: it grows with the distance from the middle of the frame, and experiments develop windows.
pub(crate) const OF_THE_WHOLE_FRAME: &str = "bayer_denoise.radial";

/// The places, among the parameters of an ISP, that a name stands for: a parameter, or a stage with all of its own.
pub(crate) fn places_of(name: &str, parameters: &[IspParameter]) -> Vec<usize> {
    let is_meant = |p: &IspParameter| {
        (p.name == name || p.name.split('.').next() == Some(name)) && p.name != OF_THE_WHOLE_FRAME
    };
    (0..parameters.len()).filter(|i| is_meant(&parameters[*i])).collect()
}

impl IspConfig {
    /// Whether there is a hardware ISP.
    pub fn is_used(&self) -> bool {
        self.preset != NO_ISP
    }

    /// Whether it is in a file, which may describe an ISP with other parameters than the built-in one.
    pub fn is_in_file(&self) -> bool {
        Path::new(&self.preset).extension().is_some()
    }
}

parameters! {
    /// Training of the network, the same for every variant.
    pub struct TrainingConfig {
        /// Network steps of a stage that trains the network.
        steps: usize = 400, "", 1..1e8, Log, "a few hundred on a CPU";
        /// Windows a step.
        batch: usize = 4, "", 1..1024, Log, "2 to 8 on a CPU";
        /// Side of a window; in streets behind the experiment's lens.
        crop: usize = 96, "pixels", 32..1200, Linear, "64 to 256 pixels";
        /// First learning rate of Adam; it falls along a half cosine.
        learning_rate: f64 = 4e-3, "", 1e-8..1, Log, "1e-3 is Adam's usual start";
        /// Learning rate at the end over that at the start.
        final_learning_rate: f64 = 0.02, "", 0..1, Linear, "a share of the first";
        /// Weight of the network's proximal term.
        proximal: f64 = 0.0, "", 0..1e6, Log, "0 leaves the proximal term out";
        /// Decay of Adam's mean of squared gradients, beta 2: a mean over `1 / (1 - beta2)` steps.
        beta2: f64 = 0.99, "", 0.5..0.9999, Linear, "0.99 for hundreds of steps, 0.999 for many thousands";
        /// Training photographs are darkened at random by up to this exposure, and their red and blue changed against green by up to a
        /// quarter of it. Then all colours are darkened until none is brighter than the exposure. So there are other exposures and colours
        /// than the few photographs have. 0 leaves them as they are.
        relight_ev: f64 = 1.0, "EV", 0..4, Linear, "1 EV is half of the light";
        /// Share of the windows that are generated pictures of dead leaves in place of photographs.
        dead_leaves: f64 = 0.5, "", 0..1, Linear, "0.5 for every other window";
        /// Largest norm of the gradient of each weight tensor of a network for pictures; a larger gradient is scaled down to it. 0 sets no limit,
        /// with which a training of more than some 300 steps near the first rate can diverge.
        largest_gradient: f64 = 0.05, "", 0..1e6, Log, "0.05; 0 for no limit";
    } also {
        /// How noise is sampled and differentiated.
        noise: NoiseMode = NoiseMode::Dequantised;
    }
}

parameters! {
    /// How the lens moves for the task.
    pub struct OpticsConfig {
        /// Lens steps of a stage that moves the lens for the task.
        steps: usize = 150, "", 0..1e8, Log, "0 keeps the lens";
        /// Share of the stage's network steps over which the lens steps are spread evenly; then the lens rests.
        moving_share: f64 = 0.7, "", 0..1, Linear, "0.7 leaves the network time to settle";
        /// First learning rate of Adam in the bounded coordinates.
        learning_rate: f64 = 0.02, "rad of the bounding sine", 1e-8..1, Log, "0.01 of a coordinate's range of 3.1";
        /// Learning rate at the end over that at the start.
        final_learning_rate: f64 = 0.1, "", 0..1, Linear, "a share of the first";
        /// Half-range of the image plane around the paraxial focus.
        defocus_mm: f64 = 0.5, "mm", 1e-3..100, Log, "half-range around the paraxial focus";
        /// Weight of the lens's proximal term, per squared coordinate.
        proximal: f64 = 0.0, "", 0..1e6, Log, "0 leaves the proximal term out";
        /// Standard deviation of random errors of the lens in each of its steps for the task, as a share of the range between the bounds of each
        /// number; 0 for the lens as drawn.
        error_share: f64 = 0.0, "", 0..0.1, Log, "0 for none; 0.002 of a range of 5 mm is 10 um";
    }
}

parameters! {
    /// How a lens is improved alone, for its spot or its error after restoration, within the same bounds.
    pub struct SpotConfig {
        /// Iterations of Levenberg and Marquardt's method after which a stage with the goal spot or restored ends, converged or not.
        iterations: usize = 200, "", 1..1e6, Log, "a few dozen to a few hundred until it converges";
        /// Rounds of a global search before a stage with the goal spot goes downhill from the best lens that it found; 0 starts from the lens as
        /// it stands. A round makes up to 16 descents from random lenses within the bounds and from the best so far.
        rounds: usize = 0, "", 0..1e5, Linear, "5 take a few seconds";
    }
}

parameters! {
    /// What a lens must keep to be manufactured and to fit its camera: penalties.
    pub struct ConstraintConfig {
        /// Weight of the penalty in the loss.
        weight: f64 = 100.0, "1/mm^2", 0..1e9, Log, "1 is one unit of loss per mm^2";
        /// Least edge thickness of an element.
        element_edge_mm: f64 = 0.8, "mm", 0..1e3, Linear, "a length in mm";
        /// Least air gap.
        air_gap_mm: f64 = 0.05, "mm", 0..1e3, Linear, "a length in mm";
        /// Least distance of the last vertex from the image.
        back_focal_mm: f64 = 15.0, "mm", 0..1e3, Linear, "a length in mm";
        /// How far the image of the sensor corner's field may move from where the nominal lens has it, as a share of its height.
        distortion_tolerance: f64 = 0.003, "", 0..1, Log, "0.003 is 0.3 %";
        /// By how much the share of light that clear apertures let through may fall below that of the nominal lens, at fields where they cut it.
        light_tolerance: f64 = 0.02, "", 0..1, Log, "0.02 is 2 %; 1 lets a lens lose all light";
    }
}

parameters! {
    /// Scoring on held-out pictures with exact noise.
    pub struct ScoringConfig {
        /// Each held-out picture is scored at this many places squared, from the sensor's centre to its corner.
        places_per_side: usize = 4, "", 1..15, Linear, "3 gives 9 places";
        /// Side of a scored window; in streets behind the experiment's lens.
        crop: usize = 120, "pixels", 64..1200, Linear, "LPIPS needs at least 64 pixels";
        /// Held-out photographs that are scored, spread evenly over all by name. 0 scores them all, and so does a number above theirs.
        /// Windows of scenes with labels are counted by `street.held_out`.
        pictures: usize = 0, "", 0..1e7, Log, "0 for all; 100 scores 100 of a large set";
    } also {
        /// Names of the scores: one_minus_lpips, psnr_db, ssim; where objects are to be found, ap50, ap and ap75 by default.
        scores: Vec<String> = ["one_minus_lpips", "psnr_db", "ssim"].map(str::to_owned).to_vec();
    }
}

parameters! {
    /// Validation: the loss, now and then in a stage, on windows of photographs that no block is trained on and no camera is scored on.
    pub struct ValidationConfig {
        /// Steps between two validations, of the network or the hardware ISP, or of a lens that moves alone; 0 for none.
        every: usize = 0, "", 0..1e8, Log, "0 for none; 25 gives 16 in 400 steps";
        /// Windows of a validation, the same each time with the same noise.
        windows: usize = 16, "", 1..1e4, Log, "16 windows, or more for a steadier figure";
        /// Validations in a row without a lower loss after which a stage ends; 0 for never.
        patience: usize = 0, "", 0..1e6, Linear, "0 takes every step; 4 ends a stage that no longer gains";
    } also {
        /// Which numbers a stage ends with.
        keep: Keep = Keep::Last;
    }
}

/// Which numbers of its blocks a stage ends with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Keep {
    /// Those of its last step.
    #[default]
    Last,
    /// Those of the least loss in a validation.
    Best,
}

impl ValidationConfig {
    /// Whether there are validations.
    pub fn is_used(&self) -> bool {
        self.every > 0
    }

    /// Whether there is one once a block has taken so many of its steps in a stage: regularly, and at the end.
    pub fn is_due(&self, taken: usize, steps: usize) -> bool {
        self.is_used() && (taken.is_multiple_of(self.every) || taken == steps)
    }
}

parameters! {
    /// How often a run can be resumed from.
    pub struct CheckpointConfig {
        /// Steps between checkpoints.
        every: usize = 50, "", 1..1e8, Log, "steps between checkpoints";
        /// Checkpoints kept.
        keep: usize = 3, "", 1..1e4, Log, "checkpoints kept";
    }
}

parameters! {
    /// How the pictures of a user are read. Windows and figures do not depend on it.
    pub struct ReadingConfig {
        /// Memory for decoded pictures and for windows that are made ahead. A set that has more is read beside the steps.
        memory_mb: usize = 1024, "MB", 64..1e6, Log, "1024 MB are 40 photographs of 1920 x 1080, or 400 windows of 450 x 450";
    }
}

impl ReadingConfig {
    /// The memory in bytes.
    pub fn bytes(&self) -> u64 {
        (self.memory_mb as u64) << 20
    }
}

impl ExposureConfig {
    /// As the sensor takes it.
    pub fn exposure(&self) -> Exposure {
        Exposure { white_e: self.white_e, time_s: self.time_s, linear_gain: self.linear_gain }
    }
}

impl ConstraintConfig {
    /// What it demands of a lens, apart from its field of view.
    pub fn of_lens(&self, lens: &Lens) -> Vec<Constraint> {
        let limits = Limits {
            element_edge_mm: Some(self.element_edge_mm),
            element_centre_mm: Some(self.element_edge_mm),
            air_gap_mm: Some(self.air_gap_mm),
            ..Limits::default()
        };
        let mut all = limits.constraints(lens, 0.0);
        all.push(Constraint::ImageDistance { least_mm: self.back_focal_mm });
        all
    }
}
