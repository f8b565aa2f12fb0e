//! Derivatives of the loss of a batch by the PSFs of its camera.

use burn::prelude::*;
use burn::tensor::Gradients;
use petzval_camera::sensor::Noise;
use petzval_camera::tape::Frames;

use super::by_window::By;
use crate::camera::{ByLens, Camera, OpticsLeaves, PsfLeaves, Psfs, Shot, to_host};
use crate::error::{DesignError, Result};

/// Derivatives by the optics of a camera.
#[derive(Default)]
pub(super) struct ByOptics {
    /// By what forms its images.
    pub own: ByPsfs,
    /// By what development takes that for; none where it knows it.
    pub taken_for: Option<ByPsfs>,
}

/// Derivatives by PSFs, in the shapes of [`PsfLeaves`]; none where the loss does not depend on them.
#[derive(Default)]
pub(super) struct ByPsfs {
    pub values: Option<Vec<f32>>,
    pub illumination: Option<Vec<f32>>,
    pub radius_mm: Option<Vec<f32>>,
    pub light: Option<Vec<f32>>,
}

impl ByOptics {
    /// Derivatives of a loss that is no number.
    pub fn not_a_number(camera: &Camera) -> Self {
        let of = |psfs: &Psfs| {
            let nan = |count: usize| Some(vec![f32::NAN; count]);
            let bank = psfs.bank();
            ByPsfs {
                values: nan(bank.values.len()),
                illumination: nan(bank.illumination.len()),
                ..ByPsfs::default()
            }
        };
        Self { own: of(camera.psfs()), taken_for: camera.psfs_taken_for().map(of) }
    }

    fn of(leaves: &OpticsLeaves, gradients: &Gradients) -> Result<Self> {
        let taken_for = leaves.taken_for.as_ref().map(|leaves| ByPsfs::of(leaves, gradients));
        Ok(Self { own: ByPsfs::of(&leaves.own, gradients)?, taken_for: taken_for.transpose()? })
    }

    fn plus(self, other: Self) -> Self {
        let taken_for = match (self.taken_for, other.taken_for) {
            (Some(a), Some(b)) => Some(a.plus(b)),
            (a, b) => a.or(b),
        };
        Self { own: self.own.plus(other.own), taken_for }
    }
}

impl ByPsfs {
    fn of(leaves: &PsfLeaves, gradients: &Gradients) -> Result<Self> {
        fn by<const D: usize>(leaf: &Tensor<D>, all: &Gradients) -> Result<Option<Vec<f32>>> {
            leaf.grad(all).map(to_host).transpose()
        }
        Ok(Self {
            values: by(&leaves.values, gradients)?,
            illumination: by(&leaves.illumination, gradients)?,
            radius_mm: by(&leaves.radius_mm, gradients)?,
            light: by(&leaves.light, gradients)?,
        })
    }

    fn plus(self, other: Self) -> Self {
        let plus = |a: Option<Vec<f32>>, b: Option<Vec<f32>>| match (a, b) {
            (Some(mut a), Some(b)) => {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                Some(a)
            }
            (a, b) => a.or(b),
        };
        Self {
            values: plus(self.values, other.values),
            illumination: plus(self.illumination, other.illumination),
            radius_mm: plus(self.radius_mm, other.radius_mm),
            light: plus(self.light, other.light),
        }
    }

    /// The derivatives by the lens that forms the PSFs. Where the lens is taken for another, development that does not restore takes nothing
    /// but the illumination from the other's: what is not on the tape counts as 0.
    pub fn pulled_back(&self, psfs: &Psfs) -> Result<ByLens> {
        let bank = psfs.bank();
        let illumination = self.illumination.as_ref().ok_or(DesignError::NoGradient("the illumination"))?;
        let or_zeros = |by: &Option<Vec<f32>>, count: usize| by.clone().unwrap_or_else(|| vec![0.0; count]);
        let values = or_zeros(&self.values, bank.values.len());
        let by_radius = or_zeros(&self.radius_mm, bank.field_radius_mm.len());
        psfs.pull_back(&values, illumination, &by_radius)
    }
}

/// The PSFs of a camera, and those for which development takes them.
pub(super) struct TheOptics<'a>(pub &'a Camera);

impl By for TheOptics<'_> {
    type Leaves = OpticsLeaves;
    type Derivatives = ByOptics;

    fn leaves(&self) -> OpticsLeaves {
        self.0.tracked_leaves()
    }

    fn camera(&self, _: &OpticsLeaves) -> Camera {
        self.0.clone()
    }

    fn take(&self, camera: &Camera, leaves: &OpticsLeaves, shots: &[Shot], noise: &Noise) -> Result<Frames> {
        camera.take_through(leaves, shots, noise)
    }

    fn read(&self, leaves: &OpticsLeaves, gradients: Gradients) -> Result<ByOptics> {
        ByOptics::of(leaves, &gradients)
    }

    fn plus(&self, sum: ByOptics, own: ByOptics) -> ByOptics {
        sum.plus(own)
    }
}
