//! What a run shows while it works: a bar with losses and the time left, and a line for each finished camera.

use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use petzval::design::design_loop::Observer;
use petzval::design::run::{CameraMetrics, Event};

/// Steps between two plain lines where there is no terminal.
const PLAIN_EVERY: u64 = 50;

/// A progress bar on a terminal, plain lines elsewhere.
pub struct Progress {
    bar: ProgressBar,
    plain: bool,
    total: u64,
    /// When this process took the run up, and at which step.
    began: (Instant, u64),
}

impl Progress {
    /// Nothing is shown until the run starts.
    pub fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = "{msg}\n[{elapsed_precise}] {bar:40} {pos}/{len} steps, {eta} left";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style);
        }
        let plain = bar.is_hidden();
        Self { bar, plain, total: 0, began: (Instant::now(), 0) }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Observer for Progress {
    fn start(&mut self, done: u64, total: u64) {
        self.total = total;
        self.began = (Instant::now(), done);
        self.bar.set_length(total);
        self.bar.set_position(done);
        self.bar.reset_eta();
        if done > 0 {
            self.line(&format!("going on from step {done} of {total}"));
        }
    }

    fn step(&mut self, event: &Event) {
        let losses: Vec<String> =
            event.losses.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
        let text = format!("{} | {} | {}", event.camera, event.block, losses.join("  "));
        if self.plain {
            if event.step.is_multiple_of(PLAIN_EVERY) {
                let (elapsed, taken) = (self.began.0.elapsed(), event.step - self.began.1);
                let left = elapsed.as_secs_f64() * (self.total - event.step) as f64 / taken.max(1) as f64;
                eprintln!("step {}/{}, about {left:.0} s left: {text}", event.step, self.total);
            }
        } else {
            self.bar.set_message(text);
            self.bar.set_position(event.step);
        }
    }

    fn camera(&mut self, m: &CameraMetrics) {
        self.line(&format!(
            "{}: 1-LPIPS {:.4}, PSNR {:.2} dB, SSIM {:.4}, RMS spot {:.2} um",
            m.camera, m.one_minus_lpips, m.psnr_db, m.ssim, m.rms_spot_um
        ));
    }
}

impl Progress {
    fn line(&self, text: &str) {
        if self.plain {
            eprintln!("{text}");
        } else {
            self.bar.println(text);
        }
    }
}
