//! `petzval doctor`: shows what this machine and this build offer.

use std::time::Duration;

use crate::cli::code::Code;
use crate::jobs::threads::Source;
use crate::jobs::{DeviceReport, Verdict, compiled_in_devices, doctor};

use super::failure::Failure;
use super::signals;
use super::terminal::{Terminal, print_json};

/// Show what this machine and this build offer, and read every built-in file.
///
/// With --device it also checks a device: every convolution of the networks, detectors and losses at its real size, forward and back, against the
/// CPU; and the memory of the device over 300 steps of a training. However few the seconds, these steps and one convolution are taken. The exit code is 1
/// if the device fails. A training checks its own convolutions before its first step, and is refused on a device that fails.
///
/// `cpu` compares our kernels with those of the tensor framework. `wgpu` and `cuda` are features of the build:
/// `cargo install --locked --path crates/petzval --features wgpu`. The build of `cuda` downloads a compiler.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Check a device: cpu, wgpu or cuda
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Seconds after which the check begins nothing new; what it leaves out is listed
    #[arg(long, default_value_t = doctor::Request::default().seconds, value_name = "S", requires = "device")]
    seconds: usize,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, threads_from: Source, terminal: &Terminal) -> Result<Code, Failure> {
    let request = doctor::Request { device: args.device, seconds: args.seconds };
    let found =
        doctor::run(&request, &terminal.context().with_cancellation(signals::end_within(ONE_CONVOLUTION)?))?;
    let code = match &found.check {
        Some(check) if check.verdict == Verdict::Failed => Code::FAILURE,
        _ => Code::SUCCESS,
    };
    if args.json {
        print_json(&found)?;
        return Ok(code);
    }
    let machine = &found.environment;
    outln!("petzval      {}", machine.version);
    outln!("system       {} {}", machine.os, machine.architecture);
    // An environment variable or an old CPU may limit the kernels to a narrower unit than the CPU reports.
    let narrowed = if machine.simd_used == machine.simd {
        String::new()
    } else {
        format!("; {} used", machine.simd_used)
    };
    outln!("SIMD         {}{narrowed}", machine.simd);
    outln!("threads      {} of {} cores, by {threads_from}", machine.threads, machine.cores);
    for (name, what) in compiled_in_devices() {
        outln!("device       {name}: {what}");
    }
    outln!("lenses       {}", found.lenses.join(", "));
    outln!("sensors      {}", found.sensors.join(", "));
    outln!("experiments  {}", found.experiments.join(", "));
    outln!("built-in files: all readable");
    found.check.iter().for_each(print_check);
    Ok(code)
}

/// How long the convolution in work may take after a signal.
const ONE_CONVOLUTION: Duration = Duration::from_secs(20);

/// Prints what the check of a device found: a line for each convolution, its memory, and the verdict.
fn print_check(check: &DeviceReport) {
    let DeviceReport { device, name, driver, tolerance, convolutions, left_out, memory, .. } = check;
    let title = [&**device, name, driver].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>();
    outln!();
    outln!("check of {}; differences by the largest value, {tolerance:.0e} is allowed", title.join(", "));
    outln!("  forward  by input by weight  device ms     CPU ms  convolution");
    for one in convolutions {
        let errors = one.errors.map_or_else(
            || format!("{:>9} {:>9} {:>9}", "-", "-", "-"),
            |e| format!("{:>9.1e} {:>9.1e} {:>9.1e}", e.forward, e.by_input, e.by_weights),
        );
        let problem = one.problem.as_ref().map(|problem| format!("  {problem}")).unwrap_or_default();
        outln!("{errors} {:>10.2} {:>10.2}  {}{problem}", one.device_ms, one.cpu_ms, one.convolution);
    }
    if let Some(memory) = memory {
        let [pictures, channels, height, width] = memory.input;
        let [before, after] = [memory.bytes_at_a_third, memory.most_bytes].map(|bytes| bytes as f64 / 1e6);
        outln!(
            "memory: {before:.1} MB after a third of {} steps, {after:.1} MB at most since; {:.1} ms a step of a restoration network \
             ({pictures} x {channels} x {height} x {width})",
            memory.steps,
            memory.step_ms
        );
    }
    if check.is_software {
        outln!(
            "this device is a program on the CPU: batches are one picture, and memory is looked at on small ones"
        );
    }
    if !left_out.is_empty() {
        outln!(
            "left out for want of time: {} convolutions, from {}; --seconds gives more",
            left_out.len(),
            left_out[0]
        );
    }
    if !check.networks_left_out.is_empty() {
        outln!("no time to look at {}", check.networks_left_out.join("; "));
    }
    let count = convolutions.len();
    match check.verdict {
        Verdict::Passed => {
            outln!("passed: {count} convolutions agree with the CPU, in {:.0} s", check.seconds)
        }
        Verdict::Unfinished => {
            outln!("unfinished: {count} convolutions agree with the CPU, {} are not tried", left_out.len());
        }
        Verdict::Failed => {
            outln!("FAILED: nothing may be trained on this device");
            check.problems().iter().for_each(|problem| outln!("  {problem}"));
        }
    }
}
