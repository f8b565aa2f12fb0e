//! The request of a training: to begin, or to go on.

use std::path::{Path, PathBuf};

use petzval_design::path_text::path_text;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::folder::{Kept, TrainingFolder};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result};

/// A training that begins, or one that is continued.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Request<P> {
    /// From untrained weights.
    New {
        /// What is imitated, and how.
        plan: P,
        /// Folder for results and state; it must not hold a training.
        out: PathBuf,
    },
    /// Where the training in a folder ended.
    Resume {
        /// The folder.
        folder: PathBuf,
    },
}

impl<P> Request<P> {
    /// As a unit of work whose plan takes a seed by a function.
    pub(super) const fn unit(seed: fn(&mut Self, u64)) -> AsUnit<Self> {
        AsUnit {
            seed: Some(seed),
            place: Some(|request, folder| {
                if let Self::New { out, .. } = request {
                    *out = folder.to_owned();
                }
            }),
            going_on: Some(|_, folder| {
                TrainingFolder::is_in(folder).then(|| Self::Resume { folder: folder.to_owned() })
            }),
            out_in: Some("/new"),
            ..AsUnit::PLAIN
        }
    }
}

impl<P: Clone + DeserializeOwned> Request<P> {
    /// The plan; of a training that is continued the one in its folder.
    pub(super) fn plan(&self) -> Result<P> {
        #[derive(Deserialize)]
        struct Planned<P> {
            plan: P,
        }
        match self {
            Self::New { plan, .. } => Ok(plan.clone()),
            Self::Resume { folder } => {
                let (_, Planned { plan }) = TrainingFolder::open(folder)?;
                Ok(plan)
            }
        }
    }

    /// The folder of the training and what is kept in it. `inputs` is what the names in the plan stand for: a training goes on only from
    /// the inputs with which it began, which are `what` in words.
    pub(super) fn open<I, L>(&self, plan: P, inputs: I, what: &str) -> Result<(TrainingFolder, Kept<P, I, L>)>
    where
        I: PartialEq + DeserializeOwned,
        L: DeserializeOwned,
    {
        let root = match self {
            Self::New { out, .. } => return Ok((TrainingFolder::create(out)?, Kept::new(plan, inputs))),
            Self::Resume { folder } => folder,
        };
        let (folder, kept): (_, Kept<P, I, L>) = TrainingFolder::open(root)?;
        if kept.inputs != inputs {
            let message =
                format!("{}: {what} are no longer those with which this training began", root.display());
            return Err(JobError::input(message, "put them back, or begin another training"));
        }
        Ok((folder, kept))
    }
}

/// The error of a training that was cancelled after so many steps. `response` is what is known of it.
pub(super) fn stopped<P: Serialize>(
    folder: &TrainingFolder,
    steps: usize,
    response: &impl Serialize,
    context: &Context,
) -> JobError {
    let again: Request<P> = Request::Resume { folder: folder.root().to_owned() };
    let stopped = context.stopped(format!("stopped after {steps} steps")).keeping(folder.root());
    stopped.going_on_with(&again).with_response(response).into()
}

/// A name, made an absolute path if it is that of a file, so that a training can be resumed from any folder.
pub(super) fn located(name: &str) -> Result<String> {
    let path = Path::new(name);
    if !path.is_file() {
        return Ok(name.to_owned());
    }
    let path = std::path::absolute(path).map_err(|e| JobError::failed(e.to_string()))?;
    Ok(path_text(&path)?)
}
