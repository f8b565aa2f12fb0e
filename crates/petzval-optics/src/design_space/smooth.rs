//! Coordinates without bounds over a design space, for gradient steps.

use super::space::defocus_mm;
use super::{DesignSpace, DesignSpaceError, Focus, Variable};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::number::Number;

/// A design space whose bounded coordinates follow free ones by the smooth map `value = middle + half-range sin(x)`.
///
/// A radius is mapped as a radius where its bounds have one sign, and as a curvature where they pass through the plane.
#[derive(Clone, Debug)]
pub struct SmoothSpace {
    space: DesignSpace,
    maps: Vec<SmoothMap>,
    start: Vec<f64>,
}

/// The map of one coordinate.
#[derive(Clone, Copy, Debug)]
struct SmoothMap {
    min: f64,
    max: f64,
    /// Whether the bounds are those of the reciprocal of the coordinate: of a radius.
    is_reciprocal: bool,
}

impl SmoothMap {
    fn of(v: &Variable) -> Self {
        if v.number == Number::Curvature && v.min * v.max > 0.0 {
            return Self { min: v.min, max: v.max, is_reciprocal: true };
        }
        let [min, max] = v.bounds();
        Self { min, max, is_reciprocal: false }
    }

    /// The coordinate of the design space at x, with its number off by an error, in the unit of the bounds.
    fn value(&self, x: f64, error: f64) -> f64 {
        let Self { min, max, .. } = *self;
        if !(max - min).is_finite() {
            return x + error;
        }
        let value = 0.5 * (min + max) + 0.5 * (max - min) * x.sin() + error;
        if self.is_reciprocal { 1.0 / value } else { value }
    }

    /// The derivative by x, from that by the coordinate of the design space, which is `at`.
    fn pull_back(&self, x: f64, at: f64, by: f64) -> f64 {
        if !(self.max - self.min).is_finite() {
            return by;
        }
        // dc/dR = -1/R^2 = -c^2
        let by_value = if self.is_reciprocal { -at.powi(2) * by } else { by };
        0.5 * (self.max - self.min) * x.cos() * by_value
    }

    /// The x of a coordinate of the design space.
    fn free(&self, at: f64) -> f64 {
        let Self { min, max, .. } = *self;
        if !(max - min).is_finite() {
            return at;
        }
        let value = if self.is_reciprocal { 1.0 / at } else { at };
        let s = (2.0 * value - min - max) / (max - min);
        s.clamp(-1.0, 1.0).asin()
    }

    /// An x on a bound, or near it, moved inside by a ten-thousandth of the range: the map has no slope on the bound itself. One that has run past
    /// a bound, where the number comes back inside, is taken back to where its number lies.
    fn off_bounds(&self, x: f64) -> f64 {
        if !(self.max - self.min).is_finite() {
            return x;
        }
        const NEAREST: f64 = 0.9998;
        if x.abs() <= NEAREST.asin() { x } else { x.sin().clamp(-NEAREST, NEAREST).asin() }
    }
}

impl SmoothSpace {
    /// Free coordinates over a space whose lens lies within the bounds.
    pub fn new(space: DesignSpace) -> Result<Self, DesignSpaceError> {
        let base = space.base();
        for v in space.variables() {
            // A radius comes back from its curvature with a rounding error, hence the slack.
            let (value, slack) = (v.number.read_stated(base, v.surface), 1e-9 * (v.max - v.min));
            let [low, high] = v.bounds();
            let at = v.number.read(base, v.surface);
            let is_inside = value >= v.min - slack && value <= v.max + slack || at >= low && at <= high;
            if !is_inside {
                let Variable { surface, number, min, max } = *v;
                let surface = surface + 1;
                return Err(DesignSpaceError::OutsideBounds { surface, number, value, min, max });
            }
        }
        let mut maps: Vec<SmoothMap> = space.variables().iter().map(SmoothMap::of).collect();
        if let Some([min, max]) = space.bounds().get(maps.len()) {
            maps.push(SmoothMap { min: *min, max: *max, is_reciprocal: false });
        }
        if let Focus::Paraxial { range_mm } = space.focus() {
            let value_mm = defocus_mm(base);
            if value_mm.abs() > range_mm {
                return Err(DesignSpaceError::DefocusOutsideRange { value_mm, range_mm });
            }
        }
        let mut smooth = Self { space, maps, start: Vec::new() };
        smooth.start = smooth.off_bounds(&smooth.free(&smooth.space.start()));
        smooth.lens_at(&smooth.start)?;
        Ok(smooth)
    }

    /// The space under it.
    pub fn space(&self) -> &DesignSpace {
        &self.space
    }

    /// Number of coordinates.
    pub fn dimension(&self) -> usize {
        self.start.len()
    }

    /// The coordinates of the lens that the space was made around.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// The coordinates of the lens whose every number lies in the middle of its bounds.
    pub fn centre(&self) -> Vec<f64> {
        vec![0.0; self.dimension()]
    }

    /// The free coordinates of coordinates of the space under it, which lie within their bounds.
    pub fn free(&self, at: &[f64]) -> Vec<f64> {
        self.maps.iter().zip(at).map(|(map, at)| map.free(*at)).collect()
    }

    /// Free coordinates of the same lens, from which a gradient step can start: those on a bound, where the map has no slope, are moved inside by a
    /// ten-thousandth of their range.
    pub fn off_bounds(&self, x: &[f64]) -> Vec<f64> {
        self.maps.iter().zip(x).map(|(map, x)| map.off_bounds(*x)).collect()
    }

    /// How far apart the bounds of each coordinate's number lie, in the unit in which they are given; 0 for one without bounds.
    pub fn ranges(&self) -> Vec<f64> {
        let range =
            |map: &SmoothMap| Some(map.max - map.min).filter(|range| range.is_finite()).unwrap_or(0.0);
        self.maps.iter().map(range).collect()
    }

    /// The lens at free coordinates.
    pub fn lens_at(&self, x: &[f64]) -> Result<Lens, DesignSpaceError> {
        self.lens_off(x, &[])
    }

    /// The lens at free coordinates as it comes out of a workshop: the number of each coordinate is off by an error, in the unit of its bounds,
    /// which it may pass. Coordinates behind the last error are exact. Pickups and solves follow, as a lens that is focused.
    pub fn lens_off(&self, x: &[f64], errors: &[f64]) -> Result<Lens, DesignSpaceError> {
        self.space.lens_at(&self.coordinates_off(x, errors))
    }

    /// Derivatives by the free coordinates, from those by the numbers of `lens`, which is the lens at `x`.
    pub fn pull_back(&self, x: &[f64], lens: &Lens, gradient: &LensGradient) -> Vec<f64> {
        self.pull_back_off(x, &[], lens, gradient)
    }

    /// [`SmoothSpace::pull_back`] from a lens with errors, of [`SmoothSpace::lens_off`]: the errors stay when the coordinates change.
    pub fn pull_back_off(&self, x: &[f64], errors: &[f64], lens: &Lens, gradient: &LensGradient) -> Vec<f64> {
        self.pull_back_coordinates_off(x, errors, &self.space.pull_back(lens, gradient))
    }

    /// Derivatives by the free coordinates, from those by the coordinates of the space under it.
    pub fn pull_back_coordinates(&self, x: &[f64], by: &[f64]) -> Vec<f64> {
        self.pull_back_coordinates_off(x, &[], by)
    }

    /// [`SmoothSpace::pull_back_coordinates`] from a lens with errors.
    pub fn pull_back_coordinates_off(&self, x: &[f64], errors: &[f64], by: &[f64]) -> Vec<f64> {
        let at = self.coordinates_off(x, errors);
        let maps = self.maps.iter().zip(x).zip(at.iter().zip(by));
        maps.map(|((map, x), (at, by))| map.pull_back(*x, *at, *by)).collect()
    }

    /// The coordinates of the space under it.
    fn coordinates_off(&self, x: &[f64], errors: &[f64]) -> Vec<f64> {
        let errors = errors.iter().copied().chain(std::iter::repeat(0.0));
        self.maps.iter().zip(x).zip(errors).map(|((map, x), error)| map.value(*x, error)).collect()
    }
}
