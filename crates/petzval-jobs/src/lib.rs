//! What Petzval does, one module per verb: a `Request` comes in, a `Response` goes out.
//!
//! Requests and responses are plain data that serde can write and read. The command parses its arguments into a request
//! and prints the response; a studio, another language or a work unit on a cluster use the same two types. A job prints
//! nothing and parses no arguments: it reports warnings and progress to the [`Watcher`] of its [`Context`], stops when
//! [`Context::is_cancelled`] is true, and fails with a [`JobError`] that names the setting or the place in the file.
//!
//! Two equal requests give equal results to the last bit: budgets count steps or rounds, and a limit in seconds is only
//! an additional stop.

pub mod apply;
pub mod bench;
mod built_in;
mod call;
pub mod compare;
mod context;
pub mod data;
pub mod design;
pub mod detect;
mod device;
pub mod doctor;
mod error;
pub mod evaluate;
pub mod experiment;
mod finite;
mod frames;
pub mod glass;
pub mod init;
pub mod isp;
mod job;
pub mod lens;
pub mod machine;
mod named_isp;
mod own_lens;
pub mod pinhole;
pub mod psf;
pub mod psf_calibrate;
pub mod psf_capture;
pub mod raw;
pub mod report;
mod results;
pub mod run_all;
mod run_page;
pub mod sensor;
pub mod simulate;
pub mod table;
pub mod train;
mod usual;

pub use built_in::built_in_assets;
pub use call::{CALL_FORMAT, Call, MOST_THREADS, row};
pub use context::{Context, Progress, Silent, Watcher};
pub use device::compiled_in_devices;
pub use error::{Fault, JobError, json, text_of_file};
pub use job::{Job, Row};
pub use petzval_design::library::Library;
pub use table::jobs;
