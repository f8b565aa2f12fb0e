//! A raw frame on which a proxy is trained or judged.

use petzval_camera::isp::RawInput;
use petzval_camera::sensor::{Capture, Noise, NoiseMode};

use crate::camera::{Camera, Shot, ideal_input, raw_inputs};
use crate::error::Result;

/// A raw frame with its calibration, and what it would be with perfect optics and without noise.
pub struct Frame {
    /// What the ISP receives.
    pub raw: RawInput,
    /// The frame without blur, shading and noise of photons and electronics. The ISP makes of it the picture that the other should become.
    pub ideal: RawInput,
}

/// The raw frames of shots, and those of perfect optics.
pub fn take(camera: &Camera, shots: &[Shot], seed: u64) -> Result<Vec<Frame>> {
    let frames = camera.take(shots, &Noise { mode: NoiseMode::Exact, seed })?;
    let sensor = &camera.body().sensor;
    let capture = |shot: &Shot| {
        let placement = shot.kept.map_or(shot.placement, |kept| kept.placement);
        Capture { placement, ..camera.capture(shot) }
    };
    let captures: Vec<Capture> = shots.iter().map(capture).collect();
    let raws = raw_inputs(&frames.raw, &frames.illumination, &captures, sensor)?;
    let scenes = camera.scenes(shots)?;
    let pairs = raws.into_iter().zip(&scenes).zip(&captures);
    pairs
        .map(|((raw, scene), capture)| Ok(Frame { raw, ideal: ideal_input(scene, capture, sensor)? }))
        .collect()
}
