//! Validation: the loss of the camera as it stands on windows that no block is trained on, and the numbers of the blocks where it was least.

use std::collections::BTreeMap;
use std::path::Path;

use petzval_base::Cancel;
use petzval_camera::sensor::Noise;
use serde::{Deserialize, Serialize};

use crate::block::{Batch, Block, BlockState, Blocks, losses_of};
use crate::camera::{Camera, Shot};
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, Keep};
use crate::objective::Objective;
use crate::run::{load_state, save_state};

/// Name of the figure among the losses of a step.
pub const VALIDATION: &str = "validation";

/// Name of the loss itself among its parts.
const TOTAL: &str = "total";

/// Where a checkpoint keeps the best numbers.
const BEST: &str = "best";

/// The mean total loss of a camera over batches of windows. Fails with [`DesignError::Stopped`] before the next window once it is cancelled.
pub fn validation_loss(
    camera: &Camera,
    batches: &[Vec<Shot>],
    noise: &Noise,
    loss: &dyn Objective,
    cancel: &Cancel,
) -> Result<f64> {
    let (mut sum, mut windows) = (0.0, 0);
    for shots in batches {
        let batch = Batch { cancel: cancel.clone(), ..Batch::new(camera, shots, *noise, loss) };
        let total = losses_of(&batch, camera, shots)?[TOTAL];
        sum += total * shots.len() as f64;
        windows += shots.len();
    }
    Ok(sum / windows as f64)
}

/// How the validations of a stage have gone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Course {
    /// The least loss.
    least: f64,
    /// Validations since then.
    misses: usize,
}

/// The validations of the stage in work.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Validations {
    course: Option<Course>,
    /// The numbers of the blocks at the least loss, where a stage ends with them.
    best: BTreeMap<BlockName, BlockState>,
}

impl Validations {
    /// Those of a checkpoint.
    pub fn load(folder: &Path, course: Option<Course>, keep: Keep, blocks: &Blocks) -> Result<Self> {
        let mut found = Self { course, best: BTreeMap::new() };
        if course.is_some() && keep == Keep::Best {
            for block in with_numbers(blocks) {
                found.best.insert(block.name(), load_state(&folder.join(BEST), block.name())?);
            }
        }
        Ok(found)
    }

    /// Keeps the best numbers in a checkpoint, whose position keeps the course.
    pub fn save(&self, folder: &Path) -> Result<()> {
        let folder = folder.join(BEST);
        self.best.iter().try_for_each(|(block, state)| save_state(&folder, *block, state))
    }

    /// How they have gone; none before the first.
    pub fn course(&self) -> Option<Course> {
        self.course
    }

    /// Takes up the loss of the blocks as they stand.
    pub fn add(&mut self, loss: f64, blocks: &Blocks, keep: Keep) -> Result<()> {
        if let Some(course) = self.course.as_mut().filter(|course| course.least <= loss) {
            course.misses += 1;
            return Ok(());
        }
        self.course = Some(Course { least: loss, misses: 0 });
        if keep == Keep::Best {
            for block in with_numbers(blocks) {
                self.best.insert(block.name(), block.save_numbers()?);
            }
        }
        Ok(())
    }

    /// Whether so many validations in a row have brought nothing; never for a patience of 0.
    pub fn have_run_out(&self, patience: usize) -> bool {
        patience > 0 && self.course.is_some_and(|course| course.misses >= patience)
    }

    /// Ends the stage: gives the blocks their best numbers, if those were kept, and forgets all validations.
    pub fn end(&mut self, blocks: &mut Blocks) -> Result<()> {
        let best = std::mem::take(self).best;
        best.iter().try_for_each(|(name, state)| {
            let problem = |problem| DesignError::Unwritable { what: "the best numbers of a stage", problem };
            blocks.get_mut(*name).load_numbers(state).map_err(problem)
        })
    }
}

/// The blocks that the camera has.
fn with_numbers(blocks: &Blocks) -> impl Iterator<Item = &dyn Block> {
    blocks.all().into_iter().filter(|block| block.free_numbers() > 0)
}
