//! The store of units: what several processes, late and full file systems do to it, and the jobs that look at it.

mod faulty;
mod jobs;
mod keys;
mod late;
mod layers;
#[path = "../../../petzval-jobs/tests/jobs/row_check.rs"]
mod row_check;
mod runs;
#[path = "../../../petzval-jobs/tests/jobs/schema_check.rs"]
mod schema_check;

use std::sync::Arc;

use petzval_jobs::{Call, Context, Silent, built_in_assets};
use petzval_units::unit::{Digests, Prepared, Unit};
use serde_json::{Value, json};

/// A context without a watcher.
fn context() -> Context {
    Context::new(built_in_assets(), Arc::new(Silent))
}

/// A unit of the instruction set of this machine.
fn unit(name: &str, job: &str, request: Value) -> Unit {
    let simd = petzval_base::simd::level().to_owned();
    Unit { simd, ..Unit::new(name, Call::new(job, request)) }
}

/// A unit that shows a built-in lens: it takes no time.
fn trivial(name: &str, field_deg: f64) -> Unit {
    let request =
        json!({"lens": "cooke-triplet-nominal", "field": field_deg, "wavelength": 0.55, "pupil": [0.0, 1.0]});
    unit(name, "lens-trace", request)
}

fn prepared(unit: &Unit) -> Prepared {
    Prepared::new(unit, &context(), &Digests::default()).unwrap()
}
