//! What several tests of designs share.

use petzval_design::design_loop::Observer;
use petzval_design::run::{CameraMetrics, Event};

/// An observer that looks at nothing.
pub struct Silent;

impl Observer for Silent {
    fn start(&mut self, _: u64, _: u64) {}
    fn step(&mut self, _: &Event) {}
    fn camera(&mut self, _: &CameraMetrics) {}
}
