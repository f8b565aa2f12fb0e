//! The run folder: what a design leaves behind, and what it is resumed from.
//!
//! `config.toml` (resolved, re-runnable), `run.json` (what the run was begun with, and when), `environment.json`, `inputs/`, `events.jsonl` (one line a step),
//! `checkpoints/step-N/`, `lens/step-N.toml`, `cameras/<name>/` (lens and network of each finished
//! camera), `pictures/` (held-out pictures), `metrics.json`, `tolerance.json` (scores of cameras as
//! made, if the run was evaluated with tolerances), `report.html`. `digests.json` in a checkpoint, in a camera and in the run folder
//! itself has the SHA-256 of the files there.

mod beginning;
mod checkpoint;
mod date;
mod digests;
mod events;
pub(crate) mod first_reads;
mod folder;
mod holder;
pub mod input_list;
mod made;
mod metrics;
pub mod picture_names;
mod record;

pub use beginning::BegunRun;
pub use checkpoint::{
    Kept, all_checkpoints, latest_checkpoint, load_blocks, load_state, save_blocks, save_checkpoint,
    save_state, set_aside,
};
pub use date::date;
pub use digests::{
    ChangedFile, DigestCheck, Digests, EventsDigest, check_accepted, forget_digests, hex, note_digests,
    sha256_of_file,
};
pub use events::{Event, EventLog, SCORE, read_events, seconds_of};
pub use folder::{RunFolder, write_file};
pub(crate) use folder::{read_json, read_json_if_there};
pub use holder::Holder;
pub use made::{MadeFigures, MadeMetrics, MadeRow};
pub use metrics::{CameraMetrics, Metrics, PictureScore};
pub use record::{Finish, RunRecord, VERSION, extend_run, forget_most_memory};
pub(crate) use record::{config_text, json_record};
