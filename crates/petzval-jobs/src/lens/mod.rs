//! `lens`: looks at a lens, converts it, or makes it better.

mod analysis_csv;
pub mod analyze;
pub mod convert;
pub mod edit;
pub mod focus;
pub mod list;
mod lost;
pub mod optimize;
pub mod show;
pub mod tolerance;
pub mod trace;
pub mod view;

pub use focus::FocusAt;
