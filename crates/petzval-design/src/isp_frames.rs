//! Raw frames on which a proxy is trained and judged: several lenses, gains and scenes.

use petzval_camera::sensor::Exposure;
use petzval_optics::lens::Lens;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::camera::Camera;
use crate::camera::isp_proxy::{Frame, take};
use crate::error::Result;
use crate::setup::Setup;

/// Lenses beside the experiment's own: its free coordinates moved at random by this standard deviation. A quarter of a coordinate is about
/// an eighth of its range.
const OTHER_LENSES: usize = 3;
const LENS_DEVIATION: f64 = 0.25;

/// Lenses that are drawn until [`OTHER_LENSES`] of them image the whole sensor.
const MOST_DRAWN: u64 = 60;

/// Least light that a PSF must keep on its grid.
const LEAST_CAPTURED: f64 = 0.9;

/// Gains of the sensor: at each, white gives as many times fewer electrons.
const GAINS: [f32; 4] = [1.0, 2.0, 4.0, 8.0];

/// Keeps these draws apart from all else that is drawn from a seed.
const OWN: u64 = 0x0070_726f_7879_2331;

/// Cameras that take raw frames.
pub struct FrameSource {
    setup: Setup,
    /// Each lens at each gain.
    cameras: Vec<Camera>,
}

impl FrameSource {
    /// The cameras of an experiment: its lens and others near it, its sensor at several gains.
    pub fn new(setup: Setup) -> Result<Self> {
        let base = setup.body.exposure;
        let mut cameras = Vec::new();
        for lens in lenses(&setup)? {
            let camera = setup.camera(lens, true)?;
            let at = |gain: f32| Exposure {
                white_e: base.white_e / gain,
                linear_gain: base.linear_gain * gain,
                ..base
            };
            cameras.extend(GAINS.map(|gain| camera.with_exposure(at(gain))));
        }
        Ok(Self { setup, cameras })
    }

    /// The experiment.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The training frames of a step, all by one camera. They depend on experiment and step alone.
    pub fn training(&self, step: u64) -> Result<Vec<Frame>> {
        let mut random = ChaCha8Rng::seed_from_u64(self.setup.experiment.seed ^ OWN);
        random.set_stream(step);
        let camera = &self.cameras[random.random_range(0..self.cameras.len())];
        take(camera, &self.setup.training_shots(camera, step)?, self.setup.experiment.seed)
    }

    /// Frames of photographs that training never sees: each at every place of the experiment's scoring, by one camera after the other.
    pub fn held_out(&self) -> Result<Vec<Frame>> {
        let shots = self.setup.held_out_shots(&self.cameras[0], &|_| true)?;
        let mut frames = Vec::new();
        for (i, held_out) in shots.into_iter().enumerate() {
            self.setup.cancel.check()?;
            let camera = &self.cameras[i % self.cameras.len()];
            frames.extend(take(camera, &[held_out.shot], !self.setup.experiment.seed)?);
        }
        Ok(frames)
    }
}

/// The experiment's lens and others near it.
fn lenses(setup: &Setup) -> Result<Vec<Lens>> {
    let start = setup.nominal();
    let mut lenses = vec![start.lens_file.lens.clone()];
    for draw in 0..MOST_DRAWN {
        if lenses.len() > OTHER_LENSES || start.space.dimension() == 0 {
            break;
        }
        let mut random = ChaCha8Rng::seed_from_u64(setup.experiment.seed ^ OWN);
        random.set_stream(u64::MAX - draw);
        let moved: Vec<f64> = (start.space.start().iter())
            .map(|x| x + LENS_DEVIATION * Distribution::<f64>::sample(&StandardNormal, &mut random))
            .collect();
        // A lens that is no lens, or whose light does not arrive, is left out.
        let Ok(lens) = start.space.lens_at(&moved) else { continue };
        let images = |camera: &Camera| camera.psfs().captured().is_some_and(|share| share >= LEAST_CAPTURED);
        if setup.camera(lens.clone(), true).is_ok_and(|camera| images(&camera)) {
            lenses.push(lens);
        }
    }
    Ok(lenses)
}
