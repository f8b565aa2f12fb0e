//! Workloads of tolerances: random lenses.

use petzval_base::simd::level;
use petzval_optics::merit::RmsSpot;
use petzval_optics::tolerance::{
    Distribution, Freedom, Grade, Study, Tolerances, default_tolerances, monte_carlo,
};

use super::optics::nominal;
use super::workload::{Prepared, Workload};
use crate::error::{JobError, Result};

/// Number of lenses.
const TRIALS: usize = 1000;

pub(super) fn workloads() -> Vec<Workload> {
    vec![Workload { name: "tolerance_1000", simd: level, prepare: random_lenses }]
}

fn random_lenses() -> Result<Prepared> {
    let lens = nominal()?;
    let tolerances = Tolerances {
        perturbations: default_tolerances(&lens, Grade::Commercial, Distribution::Normal, false),
        compensators: vec![(Freedom::focus(&lens), None)],
    };
    let merit = RmsSpot::new(&lens);
    let count = tolerances.perturbations.len();
    let work = format!(
        "{TRIALS} triplets with {count} perturbations, decentres and tilts among them, focused; RMS spot of 7 fields (4, on \
             both sides) x 3 wavelengths"
    );
    Ok(Prepared::new(work, move || {
        let study = Study::new(&lens, &tolerances, &merit).map_err(|e| JobError::failed(e.to_string()))?;
        let found = monte_carlo(&study, 1, TRIALS, &|| Ok(()))?;
        if found.failed() > 0 {
            return Err(JobError::failed(format!(
                "{} lenses have no image or cannot be built",
                found.failed()
            )));
        }
        Ok(found)
    }))
}
