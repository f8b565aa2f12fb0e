//! `bench`: measures the speed of standard workloads.

mod camera;
mod joint;
mod optics;
mod tolerance;
mod workload;

use std::time::Instant;

use cpu_time::ProcessTime;
use petzval_base::statistics::median;
use rayon::{ThreadPool, ThreadPoolBuilder};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::workload::{Prepared, Workload};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::range::check_ranges;
use crate::threads::MOST_THREADS;

petzval_base::parameters! {
    /// A workload to measure.
    pub struct Request {
        /// Seconds to spend on it; it runs at least three times.
        seconds: f64 = 2.0, "s", 1e-6..3600, Log, "2 is usual";
    }
    also {
        /// Its name, one of [`names`].
        workload: String = "psf_rgb".to_owned();
        /// Numbers of threads to compare, which take turns in one process; none for those of the process.
        threads: Vec<usize> = Vec::new();
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
    /// The same for each number of threads of the request. The figures above are those of the first one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<OnThreads>,
}

/// A workload on a number of threads: medians over the runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OnThreads {
    /// Threads of the pool.
    pub threads: usize,
    /// CPU time of a run on all threads, s.
    pub cpu_s: f64,
    /// Time of a run by the clock, s.
    pub wall_s: f64,
    /// How many times as fast as on the first number of threads, by the clock.
    pub speedup: f64,
}

/// Times of runs on a pool.
struct Measured<'p> {
    /// None for the threads of the process.
    pool: Option<&'p ThreadPool>,
    cpu_s: Vec<f64>,
    wall_s: Vec<f64>,
}

impl Measured<'_> {
    /// Runs once, and keeps the times.
    fn run(&mut self, prepared: &mut Prepared) -> Result<()> {
        let mut timed = || {
            let (cpu, wall) = (ProcessTime::now(), Instant::now());
            (prepared.run)()?;
            Ok::<_, JobError>((cpu.elapsed().as_secs_f64(), wall.elapsed().as_secs_f64()))
        };
        let (cpu_s, wall_s) = match self.pool {
            Some(pool) => pool.install(timed),
            None => timed(),
        }?;
        self.cpu_s.push(cpu_s);
        self.wall_s.push(wall_s);
        Ok(())
    }
}

/// A pool for each number of threads.
fn pools(threads: &[usize]) -> Result<Vec<ThreadPool>> {
    let pool = |&threads: &usize| {
        if !(1..=MOST_THREADS).contains(&threads) {
            let hint = format!("1 to {MOST_THREADS}; give each number with which to compare");
            return Err(JobError::setting("threads", threads.to_string(), "out of range", hint));
        }
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map_err(|e| JobError::failed(format!("{threads} threads: {e}")))
    };
    threads.iter().map(pool).collect()
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

/// Runs a workload once to warm up, then for the time of the request. Several numbers of threads take turns, so that a machine which slows
/// down meanwhile slows all of them.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let Request { workload: name, seconds, threads } = request;
    let Some(workload) = workloads().into_iter().find(|w| w.name == *name) else {
        return Err(JobError::setting("only", name, "no such workload", names().join(", ")));
    };
    check_ranges(request)?;
    let pools = pools(threads)?;
    let mut prepared = (workload.prepare)()?;
    (prepared.run)()?;
    let measured = |pool| Measured { pool, cpu_s: Vec::new(), wall_s: Vec::new() };
    let mut all: Vec<Measured> = pools.iter().map(|pool| measured(Some(pool))).collect();
    if all.is_empty() {
        all.push(measured(None));
    }
    let began = Instant::now();
    let mut rounds = 0;
    while rounds < 3 || began.elapsed().as_secs_f64() < *seconds * all.len() as f64 {
        for one in &mut all {
            context.check(|| format!("stopped after {rounds} runs"))?;
            one.run(&mut prepared)?;
        }
        rounds += 1;
    }
    let medians: Vec<[f64; 2]> = all.into_iter().map(|one| [median(one.cpu_s), median(one.wall_s)]).collect();
    let [cpu_s, wall_s] = medians[0];
    let on_threads = |(&threads, &[cpu_s, own_s]): (&usize, &[f64; 2])| OnThreads {
        threads,
        cpu_s,
        wall_s: own_s,
        speedup: wall_s / own_s,
    };
    let curve = threads.iter().zip(&medians).map(on_threads).collect();
    let work = match prepared.units {
        Some((units, what)) => {
            format!("{}; {:.1} M {what} per CPU second", prepared.work, 1e-6 * units / cpu_s)
        }
        None => prepared.work,
    };
    let all_threads = || threads.first().copied().unwrap_or_else(rayon::current_num_threads);
    let threads = if prepared.single_thread { 1 } else { all_threads() };
    let simd = (workload.simd)().to_owned();
    Ok(Response { name: workload.name.to_owned(), cpu_s, wall_s, threads, simd, work, curve })
}
