//! What a manufacturer or a camera needs of a lens: constraints, each with its violation and the gradient of that.

mod clear_radii;
mod light;
mod rim;
mod stated;

use std::fmt;

use clear_radii::direction_of_light;
pub use clear_radii::{ClearRadii, SemiDiameters};
pub use light::passing_share;
use rim::{Rim, reach, thinnest};
pub use stated::Stated;

use crate::gradient::LensGradient;
use crate::lens::{Lens, azimuths, pull_back_track};
use crate::number::Number;
use crate::paraxial::{
    FirstOrderCotangent, first_order, image_height_per_tangent, pull_back_first_order, pull_back_image_height,
};
use crate::pupil::{chief_ray, pull_back_chief};

/// A constraint on a lens; surfaces from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constraint {
    /// Least edge thickness of the element behind a surface: at the larger of its two clear radii, and nowhere less at the smaller. A surface that
    /// is clear to a smaller radius goes on from there as a flat.
    Edge {
        /// Surface in front.
        surface: usize,
        /// Least thickness, mm.
        least_mm: f64,
    },
    /// Least thickness of the element behind a surface, on the axis.
    Centre {
        /// Surface in front.
        surface: usize,
        /// Least thickness, mm.
        least_mm: f64,
    },
    /// Least air behind a surface, on the axis.
    Air {
        /// Surface in front.
        surface: usize,
        /// Least air, mm.
        least_mm: f64,
    },
    /// Least air behind a surface, at the smaller of the two clear radii.
    AirEdge {
        /// Surface in front.
        surface: usize,
        /// Least air, mm.
        least_mm: f64,
    },
    /// The shape of a surface does not end inside its clear radius: a conic ends at `1 / (|c| sqrt(1 + k))` from its vertex.
    Reach {
        /// Surface.
        surface: usize,
    },
    /// Bounds of a radius that a solve computes; violated by a sag at the clear radius, mm.
    SolvedRadius {
        /// Surface.
        surface: usize,
        /// Bounds of the radius, mm.
        radius_mm: [f64; 2],
    },
    /// Least and greatest effective focal length.
    FocalLength {
        /// Bounds, mm.
        between_mm: [f64; 2],
    },
    /// Least and greatest paraxial back focal length, positive in the direction of the light.
    BackFocal {
        /// Bounds, mm.
        between_mm: [f64; 2],
    },
    /// Least distance from the last vertex to the image plane.
    ImageDistance {
        /// Least distance, mm.
        least_mm: f64,
    },
    /// Greatest [track](Lens::track_mm).
    Track {
        /// Greatest distance, mm.
        most_mm: f64,
    },
    /// Greatest clear diameter of a surface, mount included. The stop has no mount.
    ClearDiameter {
        /// Surface.
        surface: usize,
        /// Greatest diameter, mm.
        most_mm: f64,
    },
    /// Greatest distortion of a field; violated by a height on the image, mm.
    Distortion {
        /// Field angle, rad.
        field_rad: f64,
        /// Greatest distortion, as a share of the ideal image height.
        share: f64,
    },
    /// Steepest slope of a surface at its clear radius; violated by a tangent times that radius, mm.
    Slope {
        /// Surface.
        surface: usize,
        /// Steepest angle to the plane of the vertex, rad.
        steepest_rad: f64,
    },
    /// Greatest angle of a field's chief ray to the axis at the image; violated by a tangent times the back focal length, mm.
    ChiefRayAngle {
        /// Field angle, rad.
        field_rad: f64,
        /// Greatest angle, rad.
        greatest_rad: f64,
    },
    /// The height at which a field's chief ray lands: it holds the field of view.
    ChiefHeight {
        /// Field angle, rad.
        field_rad: f64,
        /// Wanted height on the image, mm.
        wanted_mm: f64,
        /// Greatest distance from it, mm.
        tolerance_mm: f64,
    },
    /// Least share of a field's light that the clear apertures let through, see [`passing_share`]; violated by a share times a length, mm.
    Light {
        /// Field angle, rad.
        field_rad: f64,
        /// Least share.
        least: f64,
        /// Length that all of the light counts as, mm.
        scale_mm: f64,
    },
}

impl Constraint {
    /// By how much a lens violates it, mm, at most 0 where it keeps it; `None` if a ray that it needs is lost.
    pub fn excess_mm(&self, lens: &Lens, clear: &dyn ClearRadii) -> Option<f64> {
        self.evaluate(lens, clear, None)
    }

    /// The width of its range, mm, where it bounds a figure from both sides: what it is beyond the end further away is the negative of
    /// [`Constraint::excess_mm`], less this.
    pub fn range_mm(&self) -> Option<f64> {
        match *self {
            Self::FocalLength { between_mm: [min, max] } | Self::BackFocal { between_mm: [min, max] } => {
                Some(max - min)
            }
            Self::ChiefHeight { tolerance_mm, .. } => Some(2.0 * tolerance_mm),
            _ => None,
        }
    }

    /// The gradient of [`Constraint::excess_mm`] times a factor.
    pub fn gradient(&self, lens: &Lens, clear: &dyn ClearRadii, factor: f64) -> Option<LensGradient> {
        let mut gradient = LensGradient::zero(lens.surfaces.len());
        self.evaluate(lens, clear, Some((factor, &mut gradient)))?;
        Some(gradient)
    }

    /// The excess; with `pull` = (its cotangent, a gradient), adds to the gradient.
    fn evaluate(
        &self,
        lens: &Lens,
        clear: &dyn ClearRadii,
        pull: Option<(f64, &mut LensGradient)>,
    ) -> Option<f64> {
        let sequence = || lens.at_wavelength(lens.reference_um);
        let last = lens.surfaces.len() - 1;
        match *self {
            Self::Edge { surface: i, least_mm } | Self::AirEdge { surface: i, least_mm } => {
                let element = matches!(self, Self::Edge { .. });
                let Rim { thickness_mm, direction, heights } = thinnest(lens, clear, i, element)?;
                if let Some((bar, g)) = pull {
                    let light = direction_of_light(lens, i);
                    g[(i, Number::Thickness)] -= light * bar;
                    // The edge moves with both sags, and outwards with the beams.
                    for (surface, height, sign) in [(i, heights[0], light), (i + 1, heights[1], -light)] {
                        let at = direction.map(|v| v * height.mm);
                        sag_gradient(lens, surface, at, sign * bar, g);
                        let [x, y] = lens.surfaces[surface].shape.sag_jet(at).slope;
                        let outwards = x * direction[0] + y * direction[1];
                        if let Some(followed) = height.follows {
                            clear.pull_back(followed, bar * (sign * outwards), g)?;
                        }
                    }
                }
                Some(least_mm - thickness_mm)
            }
            Self::Reach { surface } => {
                let shape = &lens.surfaces[surface].shape;
                let needed_mm = clear.radius_mm(surface) + clear.mount_mm();
                let Some(reach_mm) = reach(shape) else { return Some(-needed_mm) };
                if let Some((bar, g)) = pull {
                    // d reach / dc = -reach / c, and d reach / dk = -reach / (2 (1 + k)).
                    g[(surface, Number::Curvature)] += bar * reach_mm / shape.curvature;
                    g[(surface, Number::Conic)] += bar * reach_mm / (2.0 * (1.0 + shape.conic));
                    clear.pull_back(surface, bar, g)?;
                }
                Some(needed_mm - reach_mm)
            }
            Self::Centre { surface: i, least_mm } | Self::Air { surface: i, least_mm } => {
                let sign = direction_of_light(lens, i);
                if let Some((bar, g)) = pull {
                    g[(i, Number::Thickness)] -= sign * bar;
                }
                Some(least_mm - sign * lens.surfaces[i].thickness_mm)
            }
            Self::SolvedRadius { surface, radius_mm } => {
                let [low, high] = curvature_bounds(radius_mm);
                let c = lens.surfaces[surface].shape.curvature;
                let beyond = (c - high).max(low - c);
                // The sag at the edge of the clear aperture.
                let scale = 0.5 * clear.radius_mm(surface).powi(2);
                if let Some((bar, g)) = pull {
                    let sign = if c > high { 1.0 } else { -1.0 };
                    g[(surface, Number::Curvature)] += bar * (sign * scale);
                    clear.pull_back(surface, bar * (beyond * clear.radius_mm(surface)), g)?;
                }
                Some(scale * beyond)
            }
            Self::FocalLength { between_mm: [min, max] } => {
                let sequence = sequence();
                let found = first_order(&sequence).efl_mm;
                if let Some((bar, g)) = pull {
                    let efl = if found - max > min - found { bar } else { -bar };
                    pull_back_first_order(&sequence, FirstOrderCotangent { efl, ..Default::default() }, g);
                }
                Some((found - max).max(min - found))
            }
            Self::BackFocal { between_mm: [min, max] } => {
                let (sequence, direction) = (sequence(), direction_of_light(lens, last));
                let found = direction * first_order(&sequence).bfl_mm;
                if let Some((bar, g)) = pull {
                    let sign = if found - max > min - found { direction } else { -direction };
                    let bars = FirstOrderCotangent { bfl: bar * sign, ..Default::default() };
                    pull_back_first_order(&sequence, bars, g);
                }
                Some((found - max).max(min - found))
            }
            Self::ImageDistance { least_mm } => {
                let sign = direction_of_light(lens, last);
                if let Some((bar, g)) = pull {
                    g[(last, Number::Thickness)] -= sign * bar;
                }
                Some(least_mm - sign * lens.image_distance_mm())
            }
            Self::Track { most_mm } => {
                if let Some((bar, g)) = pull {
                    pull_back_track(lens, bar, g);
                }
                Some(lens.track_mm() - most_mm)
            }
            Self::ClearDiameter { surface, most_mm } => {
                if let Some((bar, g)) = pull {
                    clear.pull_back(surface, bar, g)?;
                }
                let mount_mm = if surface == lens.stop { 0.0 } else { clear.mount_mm() };
                Some(clear.radius_mm(surface) + mount_mm - 0.5 * most_mm)
            }
            Self::Distortion { field_rad, share } => {
                let sequence = sequence();
                let chief = chief_ray(&sequence, field_rad)?;
                let ideal = image_height_per_tangent(&sequence) * field_rad.tan();
                if let Some((bar, g)) = pull {
                    let sign = (chief.y_mm - ideal).signum();
                    pull_back_chief(&sequence, &chief, [0.0, bar * sign], g);
                    let by_ideal = -sign - share * ideal.signum();
                    pull_back_image_height(&sequence, bar * (by_ideal * field_rad.tan()), g);
                }
                Some((chief.y_mm - ideal).abs() - share * ideal.abs())
            }
            Self::Slope { surface, steepest_rad } => {
                let radius = clear.radius_mm(surface);
                let Section { direction, slope } = steepest_section(lens, surface, radius)?;
                let steepest = steepest_rad.tan();
                if let Some((bar, g)) = pull {
                    let at = direction.map(|v| v * radius);
                    let shape = &lens.surfaces[surface].shape;
                    let jet = shape.sag_jet(at);
                    // Unit vector of the gradient, and how its length grows outwards.
                    let [x, y] = jet.slope.map(|v| v / slope);
                    let [xx, xy, yy] = jet.second;
                    let [dx, dy] = direction;
                    let outwards = x * (xx * dx + xy * dy) + y * (xy * dx + yy * dy);
                    // The excess is (|grad z| - tan) r.
                    clear.pull_back(surface, bar * (slope + radius * outwards - steepest), g)?;
                    for (number, by) in shape.sensitivities(at) {
                        let by_slope = x * by.slope[0] + y * by.slope[1];
                        g[(surface, number)] += bar * (radius * by_slope);
                    }
                }
                Some((slope.abs() - steepest) * radius)
            }
            Self::ChiefRayAngle { field_rad, greatest_rad } => {
                // The tangent is what the height gains over a millimetre.
                let beyond = lens.with_image_distance(lens.image_distance_mm() + 1.0);
                let beyond = beyond.at_wavelength(lens.reference_um);
                let here = sequence();
                let (further, nearer) = (chief_ray(&beyond, field_rad)?, chief_ray(&here, field_rad)?);
                let slope = further.y_mm - nearer.y_mm;
                let bfl_mm = first_order(&here).bfl_mm;
                let over = slope.abs() - greatest_rad.tan();
                if let Some((bar, g)) = pull {
                    let by_slope = bar * (slope.signum() * bfl_mm.abs());
                    pull_back_chief(&beyond, &further, [0.0, by_slope], g);
                    pull_back_chief(&here, &nearer, [0.0, -by_slope], g);
                    let bars =
                        FirstOrderCotangent { bfl: bar * (over * bfl_mm.signum()), ..Default::default() };
                    pull_back_first_order(&here, bars, g);
                }
                Some(over * bfl_mm.abs())
            }
            Self::ChiefHeight { field_rad, wanted_mm, tolerance_mm } => {
                let sequence = sequence();
                let chief = chief_ray(&sequence, field_rad)?;
                let miss = chief.y_mm - wanted_mm;
                if let Some((bar, g)) = pull {
                    pull_back_chief(&sequence, &chief, [0.0, bar * miss.signum()], g);
                }
                Some(miss.abs() - tolerance_mm)
            }
            Self::Light { field_rad, least, scale_mm } => {
                let pull = pull.map(|(bar, g)| (-bar * scale_mm, g));
                Some(scale_mm * (least - light::share(lens, field_rad, pull)?))
            }
        }
    }
}

impl fmt::Display for Constraint {
    /// As a person names it; surfaces from 1.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Edge { surface, .. } => write!(f, "edge thickness behind surface {}", surface + 1),
            Self::Centre { surface, .. } => write!(f, "centre thickness behind surface {}", surface + 1),
            Self::Air { surface, .. } => write!(f, "air behind surface {}", surface + 1),
            Self::AirEdge { surface, .. } => write!(f, "air at the edge behind surface {}", surface + 1),
            Self::Reach { surface } => write!(f, "reach of the shape of surface {}", surface + 1),
            Self::SolvedRadius { .. } => {
                write!(f, "radius that is solved for")
            }
            Self::FocalLength { .. } => write!(f, "focal length"),
            Self::BackFocal { .. } => write!(f, "back focal length"),
            Self::ImageDistance { .. } => write!(f, "distance from the last vertex to the image"),
            Self::Track { .. } => write!(f, "track"),
            Self::ClearDiameter { surface, .. } => write!(f, "clear diameter of surface {}", surface + 1),
            Self::Distortion { .. } => write!(f, "distortion"),
            Self::Slope { surface, .. } => write!(f, "slope of surface {}", surface + 1),
            Self::ChiefRayAngle { .. } => write!(f, "chief-ray angle"),
            Self::ChiefHeight { .. } => write!(f, "image height of a chief ray"),
            Self::Light { field_rad, .. } => {
                let field_deg = field_rad.to_degrees();
                write!(f, "light at {field_deg:.1} degrees that apertures let through")
            }
        }
    }
}

/// `sum max(0, excess)^2` over constraints, mm^2, and its gradient, at the clear semi-diameters of the lens; `None` if a ray is
/// lost.
pub fn penalty(constraints: &[Constraint], lens: &Lens) -> Option<(f64, LensGradient)> {
    let clear = SemiDiameters(lens);
    let (mut value, mut gradient) = (0.0, LensGradient::zero(lens.surfaces.len()));
    for constraint in constraints {
        let excess = constraint.excess_mm(lens, &clear)?;
        if excess > 0.0 {
            value += excess * excess;
            gradient += &constraint.gradient(lens, &clear, 2.0 * excess)?;
        }
    }
    Some((value, gradient))
}

/// Adds the gradient of a loss that depends on the sag of a surface at a point, `bar` per mm.
fn sag_gradient(lens: &Lens, surface: usize, at: [f64; 2], bar: f64, gradient: &mut LensGradient) {
    for (number, by) in lens.surfaces[surface].shape.sensitivities(at) {
        gradient[(surface, number)] += bar * by.value;
    }
}

/// Bounds of a curvature from those of its radius, a ten-thousandth of their distance inside: a penalty ends a little beyond
/// its limit, and that must not be beyond the bounds.
fn curvature_bounds([min_mm, max_mm]: [f64; 2]) -> [f64; 2] {
    let (a, b) = (1.0 / min_mm, 1.0 / max_mm);
    let inside = 1e-4 * (a - b).abs();
    [a.min(b) + inside, a.max(b) - inside]
}

/// Where a surface is steepest at a height, of some directions across the axis.
struct Section {
    direction: [f64; 2],
    /// Length of the gradient of the sag.
    slope: f64,
}

fn steepest_section(lens: &Lens, surface: usize, height_mm: f64) -> Option<Section> {
    let shape = &lens.surfaces[surface].shape;
    let of = |direction: [f64; 2]| {
        let [x, y] = shape.sag_jet(direction.map(|v| v * height_mm)).slope;
        Section { direction, slope: x.hypot(y) }
    };
    let all = azimuths(&[&lens.surfaces[surface]]).into_iter().map(of);
    all.max_by(|a, b| a.slope.total_cmp(&b.slope)).filter(|s| s.slope.is_finite())
}
