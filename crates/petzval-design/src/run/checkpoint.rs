//! Checkpoints: a folder per step, complete or not there at all.

use std::fs;
use std::path::{Path, PathBuf};

use super::folder::PARTIAL;
use super::{Digests, EventsDigest, RunFolder, write_file};
use crate::block::{Block, BlockState};
use crate::error::{DesignError, Result};
use crate::experiment::BlockName;

const PREFIX: &str = "step-";

/// Writes a checkpoint with `fill`, which writes whole files, into a hidden folder, then moves it to `checkpoints/step-N`; removes
/// all but the `keep` latest. `events`: the digest of the events until then.
pub fn save_checkpoint(
    run: &RunFolder,
    step: u64,
    keep: usize,
    events: Option<EventsDigest>,
    fill: impl FnOnce(&Path) -> Result<()>,
) -> Result<()> {
    let root = run.checkpoints();
    let hidden = root.join(format!("{PARTIAL}{step:06}"));
    let last = root.join(format!("{PREFIX}{step:06}"));
    // A run is a function of its experiment: a checkpoint of this step already holds the same.
    if last.exists() {
        return Ok(());
    }
    // A leftover of a killed run gives way.
    if hidden.exists() {
        fs::remove_dir_all(&hidden).map_err(DesignError::io(&hidden))?;
    }
    fs::create_dir_all(&hidden).map_err(DesignError::io(&hidden))?;
    fill(&hidden)?;
    let mut digests = Digests::of_folder(&hidden)?;
    digests.events = events;
    digests.write(&hidden)?;
    fs::rename(&hidden, &last).map_err(DesignError::io(&last))?;
    for (_, old) in all_checkpoints(run)?.iter().rev().skip(keep) {
        fs::remove_dir_all(old).map_err(DesignError::io(old))?;
    }
    Ok(())
}

/// The latest complete checkpoint and its step.
pub fn latest_checkpoint(run: &RunFolder) -> Result<Option<(u64, PathBuf)>> {
    Ok(all_checkpoints(run)?.pop())
}

/// All checkpoints with their steps, the latest last; none if their folder was taken away.
pub fn all_checkpoints(run: &RunFolder) -> Result<Vec<(u64, PathBuf)>> {
    let root = &run.checkpoints();
    let mut found = Vec::new();
    let entries = match fs::read_dir(root) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(found),
        entries => entries.map_err(DesignError::io(root))?,
    };
    for entry in entries {
        let path = entry.map_err(DesignError::io(root))?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("");
        if let Some(step) = name.strip_prefix(PREFIX).and_then(|s| s.parse().ok()) {
            found.push((step, path));
        }
    }
    found.sort();
    Ok(found)
}

/// Puts a damaged checkpoint out of the way: the run comes by its step again. Returns its new name.
pub fn set_aside(checkpoint: &Path) -> Result<PathBuf> {
    let name = checkpoint.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let aside = checkpoint.with_file_name(format!("damaged-{name}"));
    if aside.exists() {
        fs::remove_dir_all(&aside).map_err(DesignError::io(&aside))?;
    }
    fs::rename(checkpoint, &aside).map_err(DesignError::io(&aside))?;
    Ok(aside)
}

/// Writes blocks that have free numbers into a folder: `blocks/NAME/PART`. A finished camera keeps their free numbers; a checkpoint also keeps how far
/// their stage has come.
pub fn save_blocks<'b>(
    folder: &Path,
    blocks: impl IntoIterator<Item = &'b dyn Block>,
    kept: Kept,
) -> Result<()> {
    for block in blocks.into_iter().filter(|block| block.free_numbers() > 0) {
        let mut parts = block.save_numbers()?;
        if kept == Kept::NumbersAndProgress {
            parts.extend(block.save_progress()?);
        }
        save_state(folder, block.name(), &parts)?;
    }
    Ok(())
}

/// Restores blocks from what [`save_blocks`] wrote into a folder.
pub fn load_blocks<'b>(
    folder: &Path,
    blocks: impl IntoIterator<Item = &'b mut dyn Block>,
    kept: Kept,
) -> Result<()> {
    for block in blocks.into_iter().filter(|block| block.free_numbers() > 0) {
        let state = load_state(folder, block.name())?;
        let loaded = block.load_numbers(&state).and_then(|()| match kept {
            Kept::Numbers => Ok(()),
            Kept::NumbersAndProgress => block.load_progress(&state),
        });
        let path = block_folder(folder, block.name());
        loaded.map_err(|problem| DesignError::Run { path, problem })?;
    }
    Ok(())
}

/// Writes a state of a block into a folder: `blocks/NAME/PART`.
pub fn save_state(folder: &Path, block: BlockName, state: &BlockState) -> Result<()> {
    let folder = block_folder(folder, block);
    fs::create_dir_all(&folder).map_err(DesignError::io(&folder))?;
    state.iter().try_for_each(|(part, bytes)| write_file(&folder.join(part), bytes))
}

/// Reads what [`save_state`] wrote.
pub fn load_state(folder: &Path, block: BlockName) -> Result<BlockState> {
    let folder = block_folder(folder, block);
    let mut state = BlockState::new();
    for entry in fs::read_dir(&folder).map_err(DesignError::io(&folder))? {
        let path = entry.map_err(DesignError::io(&folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        state.insert(name, petzval_base::read_whole(&path).map_err(DesignError::io(&path))?);
    }
    Ok(state)
}

/// What is kept of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// Its free numbers.
    Numbers,
    /// Its free numbers, and how far its stage has come.
    NumbersAndProgress,
}

fn block_folder(folder: &Path, block: BlockName) -> PathBuf {
    folder.join("blocks").join(block.name())
}
