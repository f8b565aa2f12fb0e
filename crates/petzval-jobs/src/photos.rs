//! `photo-list`: the built-in photographs and scenes, which stand in place of pictures of one's own.

use petzval_camera::spectral::SceneKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::built_in::photographs;
use crate::context::Context;
use crate::error::Result;

/// Nothing to choose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {}

/// What is built in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Photographs, by the names that `camera-view` takes.
    pub photos: Vec<String>,
    /// Scenes, as `scene:NAME`.
    pub scenes: Vec<String>,
}

/// Lists them.
pub fn run(_: &Request, _: &Context) -> Result<Response> {
    let scenes = SceneKind::ALL.into_iter().map(|kind| format!("scene:{}", kind.name())).collect();
    Ok(Response { photos: photographs(), scenes })
}
