//! An optimisation problem: what may move, what is solved for, what is minimised, and the limits.

use std::sync::Arc;

use crate::constraint::Constraint;
use crate::design_space::{DesignSpace, DesignSpaceError, Focus, Pickup, Solves, Variable};
use crate::glass::Glass;
use crate::lens::{Action, Lens};
use crate::merit::{Better, Merit, SpotResiduals};
use crate::number::Number;
use crate::pupil::Sides;

/// A glass that a search may exchange for others; a descent leaves it.
#[derive(Clone, Debug, PartialEq)]
pub struct GlassChoice {
    /// The surface in front of it.
    pub surface: usize,
    /// What it may be.
    pub candidates: Vec<Arc<Glass>>,
}

/// A figure of the lens that should come near a target.
///
/// It adds the square of `weight_um * (value - target)` to what is minimised. A figure that is better than its target adds nothing.
#[derive(Clone)]
pub struct Goal {
    /// The figure; it must have a gradient.
    pub merit: Arc<dyn Merit>,
    /// What it should be, in its unit.
    pub target: f64,
    /// Weight: one unit beyond the target costs as much as this many um of RMS spot.
    pub weight_um: f64,
}

impl std::fmt::Debug for Goal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { merit, target, weight_um } = self;
        write!(f, "Goal({}: {target} {}, weight {weight_um} um)", merit.name(), merit.unit())
    }
}

impl Goal {
    /// The residual of a value, um.
    pub(super) fn residual_um(&self, value: f64) -> f64 {
        let beyond = match self.merit.better() {
            Better::Lower => (value - self.target).max(0.0),
            Better::Higher => (value - self.target).min(0.0),
        };
        self.weight_um * beyond
    }
}

/// Limits of the lens as a piece of glass, mm; `None` is no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Least edge thickness of an element, see [`Constraint::Edge`]. With it or with a least gap no shape may end inside its clear radius.
    pub element_edge_mm: Option<f64>,
    /// Least thickness of an element on the axis.
    pub element_centre_mm: Option<f64>,
    /// Least air between two surfaces, on the axis and at the smaller of their semi-diameters.
    pub air_gap_mm: Option<f64>,
    /// Least and greatest back focal length (paraxial), positive in the direction of the light.
    pub back_focal_mm: Option<[f64; 2]>,
    /// Greatest [track](Lens::track_mm): distance between any two of the vertices and the image plane.
    pub track_mm: Option<f64>,
    /// Greatest clear diameter of any surface, with the margin of the mount beyond the beams.
    pub clear_diameter_mm: Option<f64>,
    /// Greatest distortion of the outermost field, a share of its ideal image height.
    pub distortion: Option<f64>,
    /// Steepest surface within its clear aperture, rad from the plane of its vertex.
    pub slope_rad: Option<f64>,
    /// Greatest angle of a chief ray to the axis at the image, rad.
    pub chief_ray_angle_rad: Option<f64>,
}

impl Limits {
    /// The constraints that they are for a lens, behind every surface from the first on; `field_rad` is its outermost field.
    pub fn constraints(&self, lens: &Lens, field_rad: f64) -> Vec<Constraint> {
        let mut all = Vec::new();
        let last = lens.surfaces.len() - 1;
        for surface in 0..last {
            if lens.surfaces[surface].glass.is_air() {
                if let Some(least_mm) = self.air_gap_mm.filter(|_| !has_open_gap(lens, surface)) {
                    all.push(Constraint::AirEdge { surface, least_mm });
                    all.push(Constraint::Air { surface, least_mm });
                }
            } else {
                all.extend(self.element_edge_mm.map(|least_mm| Constraint::Edge { surface, least_mm }));
                all.extend(self.element_centre_mm.map(|least_mm| Constraint::Centre { surface, least_mm }));
            }
        }
        if self.element_edge_mm.is_some() || self.air_gap_mm.is_some() {
            all.extend((0..=last).map(|surface| Constraint::Reach { surface }));
        }
        all.extend(self.back_focal_mm.map(|between_mm| Constraint::BackFocal { between_mm }));
        all.extend(self.track_mm.map(|most_mm| Constraint::Track { most_mm }));
        let of_clear =
            |surface| self.clear_diameter_mm.map(|most_mm| Constraint::ClearDiameter { surface, most_mm });
        all.extend((0..=last).filter_map(of_clear));
        all.extend(self.distortion.map(|share| Constraint::Distortion { field_rad, share }));
        let of_slope =
            |surface| self.slope_rad.map(|steepest_rad| Constraint::Slope { surface, steepest_rad });
        all.extend((0..=last).filter_map(of_slope));
        let greatest = self.chief_ray_angle_rad;
        all.extend(greatest.map(|greatest_rad| Constraint::ChiefRayAngle { field_rad, greatest_rad }));
        all
    }
}

/// True if a gap of air needs no least width: the stop stands at the rim of a surface, or the lens itself has no gap there beside a dummy
/// plane, or steps back to one. Such a plane divides nothing: a stop on a vertex, a coordinate break, or a plane to measure from.
fn has_open_gap(lens: &Lens, surface: usize) -> bool {
    let is_closed = lens.surfaces[surface].thickness_mm == 0.0;
    lens.is_beside_stop_at_rim(surface)
        || lens.steps_back_at_idle_plane(surface)
        || is_closed && (lens.is_dummy(surface) || lens.is_dummy(surface + 1))
}

/// The clear radii at which constraints are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Apertures {
    /// As the beams need them, with a margin for the mount.
    #[default]
    Fitted,
    /// As the lens has them; they do not move.
    Drawn,
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
    pub focus: Focus,
    /// The spots that are made small. Their rays also measure how far beams reach on the surfaces.
    pub merit: SpotResiduals,
    /// How much the spots count beside the goals: 1, or 0 if the goals alone are minimised.
    pub spot_weight: f64,
    /// Further figures that should reach a target.
    pub goals: Vec<Goal>,
    /// Limits of the lens.
    pub limits: Limits,
    /// Constraints beside those that the limits make.
    pub further: Vec<Constraint>,
    /// Where constraints are measured.
    pub apertures: Apertures,
    /// Clear semi-diameters that surfaces keep although beams of the stop need more, mm, by surface; empty if there are none. Rays of the merit pass them all the
    /// same: a merit must not improve by losing rays.
    pub kept_apertures_mm: Vec<Option<f64>>,
    /// Residual of a violation, um per mm.
    pub stiffness_um_per_mm: f64,
}

impl Problem {
    /// The mean RMS spot over the lens's own fields and wavelengths, with nothing to move yet.
    pub fn new(base: Lens) -> Self {
        Self {
            variables: Vec::new(),
            pickups: Vec::new(),
            glasses: Vec::new(),
            solves: Solves::default(),
            focus: Focus::Free,
            merit: SpotResiduals::new(&base),
            spot_weight: 1.0,
            goals: Vec::new(),
            limits: Limits::default(),
            further: Vec::new(),
            apertures: Apertures::Fitted,
            kept_apertures_mm: Vec::new(),
            stiffness_um_per_mm: 1e4,
            base,
        }
    }

    /// The space of its variables and solves. A least thickness of a variable is a bound, which costs nothing to keep.
    pub fn space(&self) -> Result<DesignSpace, DesignSpaceError> {
        let (fields, weights) = (self.merit.fields_rad.len(), self.merit.field_weights.len());
        let wavelengths = self.merit.wavelengths_um.len();
        if fields == 0 || weights != fields || wavelengths == 0 {
            return Err(DesignSpaceError::NothingToSee { fields, weights, wavelengths });
        }
        let count = self.base.surfaces.len();
        for g in &self.glasses {
            let surface = g.surface + 1;
            if g.surface >= count {
                return Err(DesignSpaceError::NoSuchSurface { surface, count });
            }
            if g.candidates.is_empty() {
                return Err(DesignSpaceError::NoGlass { surface });
            }
        }
        let variables = self.variables.iter().map(|v| self.with_least_thickness(*v)).collect();
        DesignSpace::new(self.base.clone(), variables, self.pickups.clone(), self.solves, self.focus)
    }

    /// The further constraints, those of its limits, and the bounds of its solves.
    pub fn constraints(&self) -> Vec<Constraint> {
        let mut all = self.further.clone();
        all.extend(self.limits.constraints(&self.base, self.merit.outermost_field_rad()));
        let solved = self.solves.curvature().and_then(|(surface, radius_mm)| Some((surface, radius_mm?)));
        all.extend(solved.map(|(surface, radius_mm)| Constraint::SolvedRadius { surface, radius_mm }));
        all
    }

    /// A lens as goals see it: at the wavelengths of the spots, which need not be its own.
    pub(super) fn seen(&self, lens: &Lens) -> Lens {
        Lens { wavelengths_um: self.merit.wavelengths_um.clone(), ..lens.clone() }
    }

    /// The clear semi-diameter that a surface keeps, mm.
    pub(super) fn kept_aperture_mm(&self, surface: usize) -> Option<f64> {
        self.kept_apertures_mm.get(surface).copied().flatten()
    }

    /// Whether some surface keeps a clear semi-diameter that cuts beams.
    pub fn keeps_apertures(&self) -> bool {
        self.kept_apertures_mm.iter().any(Option::is_some)
    }

    /// Whether nothing but the spots says where the image plane goes.
    pub fn has_image_plane_for_spots(&self) -> bool {
        self.focus == Focus::Free
            && self.goals.is_empty()
            && self.further.is_empty()
            && self.limits.track_mm.is_none()
    }

    fn with_least_thickness(&self, mut v: Variable) -> Variable {
        let count = self.base.surfaces.len();
        if v.number != Number::Thickness || v.surface + 1 >= count {
            return v;
        }
        let least = if !self.base.surfaces[v.surface].glass.is_air() {
            self.limits.element_centre_mm
        } else if has_open_gap(&self.base, v.surface) {
            None
        } else {
            self.limits.air_gap_mm
        };
        match (least, self.base.light_goes_forwards(v.surface)) {
            (None, _) => {}
            (Some(least), true) => v.min = v.min.max(least).min(v.max - 1e-9 * v.max.abs()),
            (Some(least), false) => v.max = v.max.min(-least).max(v.min + 1e-9 * v.min.abs()),
        }
        v
    }

    /// Which halves of the pupil have to be looked at.
    pub(super) fn sides(&self) -> Sides {
        let breaks = |v: &Variable| v.number.breaks_mirror_symmetry(&self.base.surfaces[v.surface].shape);
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
