//! Where the PSFs of a camera come from, and how a loss's derivatives by them go back to the lens.

use petzval_camera::psf::PsfBank;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;

use crate::error::DesignError;
use crate::psf_plan::{BankWithTape, PsfPlan};

/// Where the PSFs of a camera come from.
#[derive(Clone, Debug)]
pub enum PsfSource {
    /// Exact tracing of the camera's lens: by rays or by diffraction, according to [`PsfPlan::options`].
    Traced {
        /// The lens.
        lens: Box<Lens>,
        /// Fields, wavelengths, grids.
        plan: PsfPlan,
    },
    /// PSFs that were measured from captures; no lens is known.
    Measured(PsfBank),
}

/// The PSFs of a camera, with what their gradient needs.
pub struct Psfs {
    kind: Kind,
}

enum Kind {
    Traced { lens: Box<Lens>, plan: PsfPlan, traced: Box<BankWithTape> },
    Measured(PsfBank),
}

impl PsfSource {
    /// Forms the PSFs.
    pub fn psfs(self) -> Result<Psfs, DesignError> {
        let kind = match self {
            Self::Traced { lens, plan } => {
                let traced = Box::new(plan.trace(&lens)?);
                Kind::Traced { lens, plan, traced }
            }
            Self::Measured(bank) => Kind::Measured(bank),
        };
        Ok(Psfs { kind })
    }
}

impl Psfs {
    /// The PSFs as the renderer takes them.
    pub fn bank(&self) -> &PsfBank {
        match &self.kind {
            Kind::Traced { traced, .. } => &traced.bank,
            Kind::Measured(bank) => bank,
        }
    }

    /// The lens that forms them, if it is known.
    pub fn lens(&self) -> Option<&Lens> {
        match &self.kind {
            Kind::Traced { lens, .. } => Some(lens),
            Kind::Measured(_) => None,
        }
    }

    /// Least share of a PSF's light that its grid holds, over fields and colours; `None` where no lens forms the PSFs.
    pub fn captured(&self) -> Option<f64> {
        match &self.kind {
            Kind::Traced { traced, .. } => Some(traced.captured()),
            Kind::Measured(_) => None,
        }
    }

    /// Pulls a loss's derivatives by the PSFs, laid out as in [`PsfBank`], back to the lens by the adjoint of ray tracing; those by
    /// the radii are the derivatives by where the chief rays land, at fixed fields. `None` where no lens forms the PSFs: then the chain ends at them.
    pub fn pull_back(
        &self,
        by_values: &[f32],
        by_illumination: &[f32],
        by_radius: &[f32],
    ) -> Option<LensGradient> {
        match &self.kind {
            Kind::Traced { plan, traced, .. } => {
                Some(plan.gradient(traced, by_values, by_illumination, by_radius))
            }
            Kind::Measured(_) => None,
        }
    }
}
