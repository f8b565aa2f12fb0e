//! Tolerances of good practice, for a lens that has none yet.
//!
//! The figures are of the order that shops offer, for a first study before a maker is consulted. They are not those of a certain maker. The
//! steps are those of published charts (commercial, precision, high precision), of which index and Abbe number of the first two grades were
//! compared with that of Optimax Systems. Radius is in percent or in fringes, whichever is wider; wedge is the difference of edge
//! thicknesses; glass of the high grade is bought with melt data. How well elements sit in a barrel (distances, decentres, tilts) is of the
//! order of turned barrels.

use super::freedom::{ARCMIN_PER_RAD, FRINGE_UM, Freedom, Quantity, elements};
use super::{Distribution, Perturbation};
use crate::glass::Glass;
use crate::lens::{Action, Lens};

/// How exactly a lens is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grade {
    /// What any shop holds.
    Commercial,
    /// Good optics.
    #[default]
    Precision,
    /// As well as can be had at a price.
    High,
}

/// The figures of a grade.
struct Figures {
    index: f64,
    abbe_percent: f64,
    centre_mm: f64,
    radius_percent: f64,
    power_fringes: f64,
    irregularity_fringes: f64,
    /// Difference of edge thicknesses.
    wedge_mm: f64,
    air_mm: f64,
    decenter_mm: f64,
    tilt_arcmin: f64,
}

impl Grade {
    fn figures(self) -> Figures {
        match self {
            Self::Commercial => Figures {
                index: 1e-3,
                abbe_percent: 0.8,
                centre_mm: 0.150,
                radius_percent: 0.2,
                power_fringes: 5.0,
                irregularity_fringes: 2.0,
                wedge_mm: 0.050,
                air_mm: 0.100,
                decenter_mm: 0.100,
                tilt_arcmin: 5.0,
            },
            Self::Precision => Figures {
                index: 5e-4,
                abbe_percent: 0.5,
                centre_mm: 0.050,
                radius_percent: 0.1,
                power_fringes: 3.0,
                irregularity_fringes: 0.5,
                wedge_mm: 0.010,
                air_mm: 0.025,
                decenter_mm: 0.025,
                tilt_arcmin: 2.0,
            },
            Self::High => Figures {
                index: 1e-4,
                abbe_percent: 0.1,
                centre_mm: 0.025,
                radius_percent: 0.05,
                power_fringes: 1.0,
                irregularity_fringes: 0.1,
                wedge_mm: 0.005,
                air_mm: 0.010,
                decenter_mm: 0.010,
                tilt_arcmin: 0.5,
            },
        }
    }
}

/// Every tolerance of a grade for a lens. A surface that bends light has one on its radius or power and one on its irregularity. An element
/// has tolerances on thickness, glass, decentre and tilt in both directions, and on the wedge of each of its later surfaces. The distances
/// between elements have one each. What a lens does not allow (an element on a fold mirror that leads the axis elsewhere) is left out.
///
/// The distance to the image plane is among them only if `with_image`: where the focus is set on each lens, it has no tolerance.
pub fn default_tolerances(
    lens: &Lens,
    grade: Grade,
    distribution: Distribution,
    with_image: bool,
) -> Vec<Perturbation> {
    let figures = grade.figures();
    let mut all: Vec<Perturbation> = Vec::new();
    let mut add = |freedom: Freedom, tolerance: f64| {
        if freedom.check(lens).is_ok() {
            all.push(Perturbation { freedom, tolerance, distribution });
        }
    };
    let last = lens.surfaces.len().saturating_sub(1);
    let bends_light = |i: usize| {
        let s = &lens.surfaces[i];
        let front = if i == 0 { Glass::air() } else { lens.surfaces[i - 1].glass.clone() };
        s.action == Action::Reflect || front != s.glass
    };
    for (i, s) in lens.surfaces.iter().enumerate() {
        if bends_light(i) {
            // The change of curvature that either allows: percent of itself, or fringes over the clear aperture.
            let by_percent = (0.01 * figures.radius_percent * s.shape.curvature).abs();
            let by_fringes = figures.power_fringes * 1e-3 * FRINGE_UM / s.semi_diameter_mm.powi(2);
            if by_percent > by_fringes {
                add(Freedom::of_surface(Quantity::RadiusPercent, i), figures.radius_percent);
            } else {
                add(Freedom::of_surface(Quantity::Power, i), figures.power_fringes);
            }
            add(Freedom::of_surface(Quantity::Irregularity, i), figures.irregularity_fringes);
        }
        if s.action != Action::Reflect && !s.glass.is_air() {
            add(Freedom::of_surface(Quantity::Index, i), figures.index);
            add(Freedom::of_surface(Quantity::Abbe, i), figures.abbe_percent);
        }
        if i < last || with_image {
            let tolerance = if s.glass.is_air() { figures.air_mm } else { figures.centre_mm };
            add(Freedom::of_surface(Quantity::Thickness, i), tolerance);
        }
    }
    for (first, end) in elements(lens) {
        for i in first + 1..=end {
            // An edge that is thicker by w on one side turns the surface by w over its diameter.
            let wedge_arcmin = figures.wedge_mm / (2.0 * lens.surfaces[i].semi_diameter_mm) * ARCMIN_PER_RAD;
            add(Freedom::of_surface(Quantity::TiltX, i), wedge_arcmin);
            add(Freedom::of_surface(Quantity::TiltY, i), wedge_arcmin);
        }
        for (quantity, tolerance) in [
            (Quantity::DecenterX, figures.decenter_mm),
            (Quantity::DecenterY, figures.decenter_mm),
            (Quantity::TiltX, figures.tilt_arcmin),
            (Quantity::TiltY, figures.tilt_arcmin),
        ] {
            add(Freedom::of_element(quantity, first, end), tolerance);
        }
    }
    all
}
