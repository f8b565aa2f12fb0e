//! What scores a camera by its pictures of held-out windows.

use std::collections::BTreeMap;
use std::path::Path;

use burn::prelude::*;
use petzval_camera::image::LinearImage;
use petzval_camera::tape::Frames;
use petzval_learn::score::ScoreDescription;

use super::HeldOut;
use crate::camera::Camera;
use crate::error::{DesignError, Result};
use crate::run::PictureScore;

/// Scores cameras.
pub trait Judge: Send + Sync {
    /// The scores that are computed.
    fn scores(&self) -> Vec<ScoreDescription>;

    /// Why a camera has no value of a score, by the name of the score; none of scores that always have one.
    fn reasons_for_none(&self) -> BTreeMap<String, String> {
        BTreeMap::new()
    }

    /// What is found of one camera, before its first picture.
    fn begin(&self, depth: Depth) -> Box<dyn Findings>;
}

/// What is found of one camera.
pub trait Findings {
    /// Takes up a picture.
    fn add(&mut self, taken: Taken) -> Result<ScoredPicture>;

    /// The scores over all pictures, without those for which there is nothing to find.
    fn scores(&self) -> BTreeMap<String, f64>;

    /// The 95 % ranges of scores if other windows had been drawn; none of scores of single pictures.
    fn intervals(&self) -> BTreeMap<String, [f64; 2]> {
        BTreeMap::new()
    }

    /// The scores in each of these draws of windows: those of cameras that took the same windows are compared draw by draw. None of scores of
    /// single pictures.
    fn draws(&self) -> BTreeMap<String, Vec<Option<f64>>> {
        BTreeMap::new()
    }

    /// Keeps in the folder of a finished camera what its report needs besides.
    fn save(&self, _folder: &Path) -> Result<()> {
        Ok(())
    }
}

/// How closely a camera is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// For its report: at each stage of the camera.
    EveryStage,
    /// For its scores alone: in the finished picture.
    Finished,
}

/// What a camera took of a held-out window.
pub struct Taken<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// The window.
    pub window: HeldOut,
    /// Its frames.
    pub frames: Frames,
    /// The finished picture as it would be stored, `[1, 3, height, width]`, sRGB-encoded, 0..1.
    pub finished: Tensor<4>,
    /// The developed raw frame, sRGB-encoded.
    pub developed: LinearImage,
}

/// A scored picture in its three states, sRGB-encoded.
pub struct ScoredPicture {
    /// Its scores.
    pub score: PictureScore,
    /// The scene, with its labels if it has any.
    pub truth: LinearImage,
    /// The developed raw frame, before the network.
    pub developed: LinearImage,
    /// The finished picture, with what the network reads in it.
    pub output: LinearImage,
}

/// Those of the known scores that are named, in that order.
pub fn named_scores<S>(names: &[String], known: Vec<S>, name_of: impl Fn(&S) -> &str) -> Result<Vec<S>> {
    let all = known.iter().map(&name_of).collect::<Vec<_>>().join(", ");
    let mut known: Vec<Option<S>> = known.into_iter().map(Some).collect();
    let mut scores = Vec::new();
    for name in names {
        let is_it = |s: &&mut Option<S>| s.as_ref().is_some_and(|s| name_of(s) == name);
        match known.iter_mut().find(is_it).and_then(Option::take) {
            Some(score) => scores.push(score),
            None => return Err(DesignError::UnknownScore { name: name.clone(), known: all }),
        }
    }
    Ok(scores)
}
