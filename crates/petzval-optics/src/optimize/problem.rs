//! What may move, what is solved for, and what is asked.

use std::sync::Arc;

use crate::design_space::{EflSolve, Pickup, Variable};
use crate::glass::Glass;
use crate::lens::{Action, Lens};
use crate::pupil::{PupilSampling, Sides};

/// Numbers that algebra settles, whatever the variables are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Solves {
    /// A curvature holds the focal length.
    pub efl: Option<EflSolve>,
    /// The thickness of this surface holds the distance from the first vertex to the last, mm.
    pub length: Option<(usize, f64)>,
}

/// A glass that a search may exchange for others; a descent leaves it.
#[derive(Clone, Debug, PartialEq)]
pub struct GlassChoice {
    /// The surface in front of it.
    pub surface: usize,
    /// What it may be.
    pub candidates: Vec<Arc<Glass>>,
}

/// Where the image plane goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImagePlane {
    /// It stays.
    Fixed,
    /// Where the spots are smallest: the distance from the last vertex is a variable without bounds.
    Best,
}

/// Requirements on the lens as a piece of glass, mm; what is `None` is not asked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Least edge thickness of an element, at the larger of its clear semi-diameters.
    pub element_edge_mm: Option<f64>,
    /// Least thickness of an element on the axis.
    pub element_centre_mm: Option<f64>,
    /// Least air between two surfaces, on the axis and at the smaller of their semi-diameters.
    pub air_gap_mm: Option<f64>,
    /// Least and greatest back focal length (paraxial).
    pub back_focal_mm: Option<[f64; 2]>,
    /// Greatest distance from the first vertex to the image plane.
    pub track_mm: Option<f64>,
    /// Greatest clear diameter: no ray of any field may need more.
    pub clear_diameter_mm: Option<f64>,
    /// Greatest distortion of the outermost field, a share of its ideal image height.
    pub distortion: Option<f64>,
    /// Steepest surface within its clear aperture, rad from the plane of its vertex.
    pub slope_rad: Option<f64>,
    /// Greatest angle of a chief ray to the axis at the image, rad.
    pub chief_ray_angle_rad: Option<f64>,
}

/// An optimisation problem.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The lens as far as it does not move.
    pub base: Lens,
    /// What may move, within bounds.
    pub variables: Vec<Variable>,
    /// Numbers that follow variables.
    pub pickups: Vec<Pickup>,
    /// Glasses that a search may exchange.
    pub glasses: Vec<GlassChoice>,
    /// Numbers that are solved for.
    pub solves: Solves,
    /// Where the image plane goes.
    pub image: ImagePlane,
    /// Field angles, rad.
    pub fields_rad: Vec<f64>,
    /// Weight of each field.
    pub field_weights: Vec<f64>,
    /// Wavelengths, um, all of the same weight.
    pub wavelengths_um: Vec<f64>,
    /// Rays.
    pub sampling: PupilSampling,
    /// The mean over the fields of RMS^p is made small: 1 for the mean RMS spot, 2 for the mean square.
    pub power: f64,
    /// What the glass must be.
    pub limits: Limits,
    /// Residual of a violation, um per mm.
    pub stiffness_um_per_mm: f64,
}

impl Problem {
    /// The mean RMS spot over the lens's own fields and wavelengths, with nothing to move yet.
    pub fn new(base: Lens) -> Self {
        let fields_rad: Vec<f64> = base.fields_deg.iter().map(|f| f.to_radians()).collect();
        Self {
            variables: Vec::new(),
            pickups: Vec::new(),
            glasses: Vec::new(),
            solves: Solves::default(),
            image: ImagePlane::Best,
            field_weights: vec![1.0; fields_rad.len()],
            fields_rad,
            wavelengths_um: base.wavelengths_um.clone(),
            sampling: PupilSampling::Degree(6),
            power: 1.0,
            limits: Limits::default(),
            stiffness_um_per_mm: 1e4,
            base,
        }
    }

    /// The field furthest from the axis, rad.
    pub fn outermost_field_rad(&self) -> f64 {
        self.fields_rad.iter().fold(0.0_f64, |a, b| if b.abs() > a.abs() { *b } else { a })
    }

    /// Whether a gap of air is none that has to be kept: the lens itself has nothing there, beside a plane that divides
    /// nothing, such as a stop on a vertex or a coordinate break.
    pub(super) fn has_open_gap(&self, surface: usize) -> bool {
        let is_dummy = |i: usize| {
            let s = &self.base.surfaces[i];
            let front = if i > 0 { self.base.surfaces[i - 1].glass.clone() } else { Glass::air() };
            s.glass == front && s.action == Action::Refract && s.phase.is_none()
        };
        self.base.surfaces[surface].thickness_mm == 0.0 && (is_dummy(surface) || is_dummy(surface + 1))
    }

    /// Which halves of the pupil have to be looked at.
    pub(super) fn sides(&self) -> Sides {
        let breaks = |v: &Variable| v.number.breaks_mirror_symmetry(&self.base, v.surface);
        let follows = |p: &Pickup| {
            self.variables.get(p.variable).is_some_and(|v| breaks(&Variable { surface: p.surface, ..*v }))
        };
        let moved = self.variables.iter().any(breaks) || self.pickups.iter().any(follows);
        let symmetric = self.base.is_mirror_symmetric() && !moved;
        if symmetric { Sides::Mirrored } else { Sides::Both }
    }

    /// The problem with other glasses: an index into the candidates of each choice.
    pub(super) fn with_glasses(&self, chosen: &[usize]) -> Self {
        let mut problem = self.clone();
        for (choice, index) in self.glasses.iter().zip(chosen) {
            let glass = &choice.candidates[*index];
            problem.base.surfaces[choice.surface].glass = glass.clone();
            // Mirrors have the glass of their front behind them.
            let behind = problem.base.surfaces[choice.surface + 1..].iter_mut();
            for mirror in behind.take_while(|s| s.action == Action::Reflect) {
                mirror.glass = glass.clone();
            }
        }
        problem
    }
}
