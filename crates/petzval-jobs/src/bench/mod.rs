//! `bench`: measures the speed of standard workloads.

mod camera;
mod joint;
mod optics;
mod tolerance;
mod workload;

use std::time::Instant;

use cpu_time::ProcessTime;
use petzval_base::statistics::median;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::workload::Workload;
use crate::context::Context;
use crate::error::JobError;
use crate::range::check_ranges;

petzval_base::parameters! {
    /// A workload to measure.
    pub struct Request {
        /// Seconds to spend on it; it runs at least three times.
        seconds: f64 = 2.0, "s", 1e-6..3600, Log, "2 is usual";
    }
    also {
        /// Its name, one of [`names`].
        workload: String = "psf_rgb".to_owned();
    }
}

/// What was measured: medians over the runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Name of the workload.
    pub name: String,
    /// CPU time of a run on all threads, s.
    pub cpu_s: f64,
    /// Time of a run by the clock, s.
    pub wall_s: f64,
    /// Threads that it may use.
    pub threads: usize,
    /// The instruction set of its hot loops.
    pub simd: String,
    /// What a run does.
    pub work: String,
}

fn workloads() -> Vec<Workload> {
    let mut all = optics::workloads();
    all.extend(tolerance::workloads());
    all.extend(camera::workloads());
    all.extend(joint::workloads());
    all
}

/// Names of the workloads, in the order of the light.
pub fn names() -> Vec<&'static str> {
    workloads().iter().map(|w| w.name).collect()
}

/// Runs a workload once to warm up, then for the time of the request.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let Request { workload: name, seconds } = request;
    let Some(workload) = workloads().into_iter().find(|w| w.name == *name) else {
        return Err(JobError::setting("only", name, "no such workload", names().join(", ")));
    };
    check_ranges(request)?;
    let mut prepared = (workload.prepare)()?;
    (prepared.run)()?;
    let (mut cpu, mut wall) = (Vec::new(), Vec::new());
    let began = Instant::now();
    while wall.len() < 3 || began.elapsed().as_secs_f64() < *seconds {
        context.check(|| format!("stopped after {} runs", wall.len()))?;
        let (start_cpu, start) = (ProcessTime::now(), Instant::now());
        (prepared.run)()?;
        cpu.push(start_cpu.elapsed().as_secs_f64());
        wall.push(start.elapsed().as_secs_f64());
    }
    let (cpu_s, wall_s) = (median(cpu), median(wall));
    let work = match prepared.units {
        Some((units, what)) => {
            format!("{}; {:.1} M {what} per CPU second", prepared.work, 1e-6 * units / cpu_s)
        }
        None => prepared.work,
    };
    let threads = if prepared.single_thread { 1 } else { rayon::current_num_threads() };
    let simd = (workload.simd)().to_owned();
    Ok(Response { name: workload.name.to_owned(), cpu_s, wall_s, threads, simd, work })
}
