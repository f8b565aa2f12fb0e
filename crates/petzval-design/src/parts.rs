//! The parts of a step between PSFs and loss, each alone, forward and back: for measuring what each costs.

use burn::prelude::*;
use petzval_camera::render::Window;
use petzval_camera::sensor::{Capture, Noise};
use petzval_camera::tape::{Frames, expose_op};

use crate::camera::{Camera, PsfLeaves, Shot, cut};
use crate::error::Result;
use crate::task::Objective;

/// A part of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// From scenes and PSFs to light on the pixels; back to the PSFs.
    Render,
    /// From light on the pixels to raw frames.
    Sensor,
    /// From raw frames to developed pictures, and their blur divided out; back to the frames and the PSFs.
    Development,
    /// From developed to finished pictures through a network that is held.
    Network,
    /// From finished pictures to the loss.
    Loss,
}

/// A batch as it enters every part of a camera.
pub struct PartInputs {
    objective: Box<dyn Objective>,
    camera: Camera,
    shots: Vec<Shot>,
    captures: Vec<Capture>,
    kept: Vec<Window>,
    noise: Noise,
    /// Before the pixels around the windows are cut off.
    irradiance: Tensor<4>,
    illumination: Tensor<4>,
    raw: Tensor<4>,
    frames: Frames,
}

impl PartInputs {
    /// Takes a batch through a camera without a hardware ISP.
    pub fn new(
        objective: Box<dyn Objective>,
        camera: Camera,
        shots: Vec<Shot>,
        noise: Noise,
    ) -> Result<Self> {
        let psfs = PsfLeaves::new(camera.psfs().bank(), &camera.body().device);
        let (irradiance, illumination) = camera.image(&psfs, &shots)?;
        let captures: Vec<Capture> = shots.iter().map(|s| camera.capture(s)).collect();
        let kept: Vec<Window> = shots.iter().map(|s| camera.kept(s)).collect();
        let raw = expose_op(irradiance.clone(), &camera.body().sensor, &captures, &noise)?;
        let light = [irradiance.clone(), illumination.clone()];
        let frames = camera.expose(&psfs, light, &captures, &kept, &noise)?;
        Ok(Self { objective, camera, shots, captures, kept, noise, irradiance, illumination, raw, frames })
    }

    /// Runs a part forward, and the sum of what it gives back to its inputs.
    pub fn run(&self, part: Part) -> Result<()> {
        let Self { camera, captures, kept, .. } = self;
        let tracked = |tensor: &Tensor<4>| tensor.clone().detach().require_grad();
        let psfs = || PsfLeaves::new(camera.psfs().bank(), &camera.body().device).tracked();
        let out = match part {
            // A step that follows one of the lens makes its kernels anew.
            Part::Render => camera.without_kernels().image(&psfs(), &self.shots)?.0.sum(),
            Part::Sensor => {
                expose_op(tracked(&self.irradiance), &camera.body().sensor, captures, &self.noise)?.sum()
            }
            Part::Development => {
                let illumination = tracked(&self.illumination);
                let developed = camera.develop(tracked(&self.raw), illumination, captures)?;
                let restored = camera.restore(&psfs(), developed.clone(), captures)?;
                let developed = cut(developed, captures, kept).sum();
                restored.map_or(developed.clone(), |r| developed + cut(r, captures, kept).sum())
            }
            Part::Network => {
                let restored = self.frames.restored.as_ref().map(tracked);
                camera.finish(tracked(&self.frames.developed), restored, kept)?.sum()
            }
            Part::Loss => {
                let frames = Frames { finished: tracked(&self.frames.finished), ..self.frames.clone() };
                self.objective.loss(camera, &frames, &self.shots)?.total
            }
        };
        std::hint::black_box(out.backward());
        Ok(())
    }
}
