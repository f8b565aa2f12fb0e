//! Where the PSFs of a camera come from, and how a loss's derivatives by them go back to the lens.

use std::sync::Arc;

use petzval_camera::psf::PsfBank;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::psf::PsfKind;

use crate::camera::optics_proxy::{ProxyOptics, ProxyPsfs};
use crate::error::{DesignError, Result};
use crate::lens::psf_plan::{BankWithTape, PsfPlan};

/// Where the PSFs of a camera come from.
#[derive(Clone)]
pub enum PsfSource {
    /// Exact tracing of the camera's lens: by rays or by diffraction, according to [`PsfPlan::options`].
    Traced {
        /// The lens.
        lens: Box<Lens>,
        /// Fields, wavelengths, grids.
        plan: PsfPlan,
    },
    /// A network in place of tracing.
    Proxy {
        /// The lens.
        lens: Box<Lens>,
        /// Image radii of the fields, mm.
        field_radius_mm: Vec<f64>,
        /// The network.
        proxy: Arc<ProxyOptics>,
    },
    /// PSFs from a file, whatever the lens: they were measured, or made elsewhere.
    Given {
        /// The PSFs.
        bank: Arc<PsfBank>,
        /// The lens through whose chief rays scenes are seen, and whose brightness counts, if it is known.
        lens: Option<Box<Lens>>,
    },
}

/// The derivatives of a loss by the lens that forms the PSFs.
pub enum ByLens {
    /// By every number of the lens: from exact tracing.
    Numbers(LensGradient),
    /// By the coordinates of the design space alone, with all that pickups and solves settle: from a network.
    Coordinates(Vec<f64>),
}

/// The PSFs of a camera, with what their gradient needs.
pub struct Psfs {
    kind: Kind,
}

enum Kind {
    Traced { lens: Box<Lens>, plan: Box<PsfPlan>, traced: Box<BankWithTape> },
    Proxy { lens: Box<Lens>, predicted: Box<ProxyPsfs> },
    Given { bank: Arc<PsfBank>, lens: Option<Box<Lens>> },
}

impl PsfSource {
    /// Forms the PSFs.
    pub fn psfs(self) -> Result<Psfs> {
        let kind = match self {
            Self::Traced { lens, plan } => {
                let traced = Box::new(plan.trace(&lens)?);
                Kind::Traced { lens, plan: Box::new(plan), traced }
            }
            Self::Proxy { lens, field_radius_mm, proxy } => {
                let predicted = Box::new(proxy.psfs(&lens, &field_radius_mm)?);
                Kind::Proxy { lens, predicted }
            }
            Self::Given { bank, lens } => Kind::Given { bank, lens },
        };
        Ok(Psfs { kind })
    }
}

impl Psfs {
    /// The PSFs as the renderer takes them.
    pub fn bank(&self) -> &PsfBank {
        match &self.kind {
            Kind::Traced { traced, .. } => &traced.bank,
            Kind::Proxy { predicted, .. } => &predicted.bank,
            Kind::Given { bank, .. } => bank,
        }
    }

    /// The lens that forms them, or in place of whose PSFs they stand, if it is known.
    pub fn lens(&self) -> Option<&Lens> {
        match &self.kind {
            Kind::Traced { lens, .. } | Kind::Proxy { lens, .. } => Some(lens),
            Kind::Given { lens, .. } => lens.as_deref(),
        }
    }

    /// The plan by which they are traced; `None` where they are not.
    pub fn plan(&self) -> Option<&PsfPlan> {
        match &self.kind {
            Kind::Traced { plan, .. } => Some(plan),
            Kind::Proxy { .. } | Kind::Given { .. } => None,
        }
    }

    /// Least share of a PSF's light that its grid holds, over fields and colours; 1 where the PSFs are given, whose grid is all that is known;
    /// `None` of a network.
    pub fn captured(&self) -> Option<f64> {
        self.captured_range().map(|[least, _]| least)
    }

    /// The same, and that of the field which loses least.
    pub fn captured_range(&self) -> Option<[f64; 2]> {
        match &self.kind {
            Kind::Traced { traced, .. } => Some([traced.captured(), traced.most_captured()]),
            Kind::Given { .. } => Some([1.0; 2]),
            Kind::Proxy { .. } => None,
        }
    }

    /// Share of the fields whose PSFs are by rays although those of their plan are by waves.
    pub fn by_rays(&self) -> f64 {
        match &self.kind {
            Kind::Traced { plan, traced, .. } if plan.options.kind == PsfKind::Diffraction => {
                traced.by_rays()
            }
            Kind::Traced { .. } | Kind::Proxy { .. } | Kind::Given { .. } => 0.0,
        }
    }

    /// The lens gradient of the relative illumination of each field; `None` where the PSFs are not traced.
    pub fn light_gradients(&self) -> Option<Vec<LensGradient>> {
        match &self.kind {
            Kind::Traced { plan, traced, .. } => Some(plan.light_gradients(traced)),
            Kind::Proxy { .. } | Kind::Given { .. } => None,
        }
    }

    /// Pulls the cotangents of the PSFs, laid out as in [`PsfBank`], back to the lens: by the adjoint of ray tracing, or through the
    /// network. With ray tracing, the cotangents of the radii are those of the landing points of the chief rays, at fixed fields. The radii
    /// of the network are fixed. Where no lens forms the PSFs, the chain ends at them, and this is an error.
    pub fn pull_back(&self, by_values: &[f32], by_illumination: &[f32], by_radius: &[f32]) -> Result<ByLens> {
        match &self.kind {
            Kind::Traced { plan, traced, .. } => {
                Ok(ByLens::Numbers(plan.gradient(traced, by_values, by_illumination, by_radius)))
            }
            Kind::Proxy { predicted, .. } => {
                Ok(ByLens::Coordinates(predicted.by_coordinates(by_values, by_illumination)?))
            }
            Kind::Given { .. } => Err(DesignError::NoLens),
        }
    }
}
