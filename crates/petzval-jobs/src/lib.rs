//! What Petzval does, one module per verb: a `Request` comes in, a `Response` goes out.
//!
//! Requests and responses are plain data that serde can write and read. The command parses its arguments into a request
//! and prints the response; a studio, another language or a work unit on a cluster use the same two types. A job prints
//! nothing and parses no arguments: it reports every [`Event`] to the [`Watcher`] of its [`Context`], and fails with a
//! [`JobError`] that names the setting or the place in the file. A job that is cancelled ends with [`JobError::Stopped`],
//! within a second or at the end of the running step.
//!
//! Two equal requests give equal results to the last bit: budgets count steps or rounds, and a limit in seconds is only
//! an additional stop.

pub mod apply;
mod as_unit;
pub mod bench;
mod built_in;
mod call;
pub mod compare;
mod context;
pub mod data;
pub mod design;
pub mod design_config;
pub mod design_stop;
pub mod detect;
mod device;
mod device_check;
mod distinct_keys;
pub mod doctor;
mod error;
pub mod evaluate;
mod event;
pub mod experiment;
mod finite;
mod frames;
mod given_psfs;
pub mod glass;
mod glass_range;
pub mod guest;
pub mod init;
pub mod input;
pub mod isp;
mod job;
mod kept;
mod keys;
pub mod lens;
pub mod machine;
mod missing_scores;
mod named_inputs;
mod named_isp;
mod noted;
mod noted_pictures;
mod own_lens;
mod own_pictures;
mod panic_place;
pub mod photos;
mod pile;
pub mod pinhole;
mod pixels;
pub mod psf;
pub mod psf_calibrate;
pub mod psf_capture;
mod range;
pub mod raw;
pub mod report;
pub mod report_so_far;
mod results;
pub mod run_all;
pub mod run_figures;
mod run_page;
pub mod run_view;
mod schema_range;
pub mod sensor;
mod settings;
pub mod simulate;
mod state_file;
pub mod table;
pub mod task_view;
mod temporary_folder;
pub mod threads;
pub mod train;
pub mod usual;
pub mod weights;

pub use as_unit::AsUnit;
pub use built_in::built_in_assets;
pub use call::{CALL_FORMAT, Call};
pub use context::{Context, Silent};
pub use device::{DEVICES, compiled_in_devices};
pub use device_check::{DeviceReport, Verdict};
pub use error::{ErrorReport, Fault, JobError, Place, Result, Stopped, json, text_of_file};
pub use event::{CameraScore, Event, TimeLeft, WarningKind, Watcher};
pub use input::{ExperimentInput, LensInput, SensorInput};
pub use job::{Job, Row, guarded};
pub use keys::error_in_keys;
pub use named_inputs::{InputKind, NamedInput};
pub use own_lens::is_lens_text;
pub use petzval_design::library::Library;
pub use results::NOWHERE;
pub use settings::settings_of;
pub use table::{Table, jobs, row};
pub use temporary_folder::TemporaryFolder;
pub use threads::MOST_THREADS;

/// What outlives a call may go from thread to thread: a server keeps it.
const _: () = {
    const fn is_shared<T: Send + Sync>() {}
    is_shared::<Context>();
    is_shared::<Call>();
    is_shared::<JobError>();
    is_shared::<apply::Cameras>();
    is_shared::<simulate::Photographer>();
};
