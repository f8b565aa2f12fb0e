//! One change of a lens, and what it does to the lens file around it.

use petzval_files::lens_toml::parameter_name;
use petzval_files::{LensFile, WeightFault, uneven_weights};
use petzval_optics::design_space::{EflSolve, MagnificationSolve, Pickup, Variable};
use petzval_optics::glass::{Catalog, Glass};
use petzval_optics::lens::{Action, Lens, ObjectDistance, Surface, SurfaceShape};
use petzval_optics::number::{ASPHERE_TERMS, Number};
use petzval_optics::paraxial::first_order;
use petzval_optics::solve::magnification;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::super::focus::{FocusAt, focused};
use crate::error::{JobError, Result};

/// Most surfaces of a lens that is edited; real lenses have a tenth of it.
const MOST_SURFACES: usize = 500;

/// Share by which a radius varies about its own value where no bounds are given.
const BEND: f64 = 0.2;

/// How far a conic constant varies about its own value where no bounds are given.
const CONIC: f64 = 1.0;

/// A change of a lens. Surfaces are counted from 1. As JSON, `edit` names which it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "edit", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Edit {
    /// Sets a radius of curvature.
    Radius {
        /// Surface.
        surface: usize,
        /// Radius, mm; null for a plane.
        radius_mm: Option<f64>,
    },
    /// Sets a vertex curvature.
    Curvature {
        /// Surface.
        surface: usize,
        /// Curvature, 1/mm.
        curvature_per_mm: f64,
    },
    /// Bends an element: the same change of both curvatures, so that its power as a thin lens stays.
    Bend {
        /// Surface in front of the glass.
        surface: usize,
        /// What is added to both curvatures, 1/mm.
        by_per_mm: f64,
    },
    /// Sets the curvature with which the conic has a given sag at a given height; the even polynomial and what else departs from it stay.
    Sag {
        /// Surface.
        surface: usize,
        /// Height above the axis, mm.
        height_mm: f64,
        /// Sag of the whole surface there, mm.
        sag_mm: f64,
    },
    /// Sets a conic constant.
    Conic {
        /// Surface.
        surface: usize,
        /// Conic constant.
        conic: f64,
    },
    /// Sets a coefficient of the even polynomial.
    Asphere {
        /// Surface.
        surface: usize,
        /// Power of r: 2, 4, ..., 16.
        power: usize,
        /// Coefficient, mm^(1 - power).
        value: f64,
    },
    /// Sets the distance to the next surface; of the last one, to the image plane.
    Thickness {
        /// Surface.
        surface: usize,
        /// Distance, mm.
        thickness_mm: f64,
    },
    /// Sets the clear semi-diameter.
    SemiDiameter {
        /// Surface.
        surface: usize,
        /// Clear semi-diameter, mm.
        semi_diameter_mm: f64,
    },
    /// Sets the medium behind a surface.
    Glass {
        /// Surface.
        surface: usize,
        /// Name of a glass, or `MAKER:NAME`; `AIR` or nothing for air.
        glass: String,
    },
    /// Names a surface.
    Label {
        /// Surface.
        surface: usize,
        /// What it is called.
        label: String,
    },
    /// Makes a surface the aperture stop.
    Stop {
        /// Surface.
        surface: usize,
    },
    /// Inserts a plane without effect in front of a surface, in the middle of the gap; the other surfaces stay in place.
    Insert {
        /// The surface that comes behind it; one more than the last surface inserts behind all.
        before: usize,
    },
    /// Deletes a surface; the others stay in place.
    Delete {
        /// Surface.
        surface: usize,
    },
    /// Sets the diameter of the entrance pupil.
    Aperture {
        /// Diameter, mm.
        entrance_pupil_mm: f64,
    },
    /// Sets the fields.
    Fields {
        /// Fields, degrees, in any order.
        fields_deg: Vec<f64>,
    },
    /// Sets the wavelengths.
    Wavelengths {
        /// Wavelengths, um, in any order.
        wavelengths_um: Vec<f64>,
        /// The reference wavelength, um.
        reference_um: f64,
    },
    /// Moves the object plane.
    Object {
        /// Distance from the object to the first vertex, mm; null for infinity.
        distance_mm: Option<f64>,
    },
    /// Names the lens.
    Name {
        /// What it is called.
        name: String,
    },
    /// Moves the image plane to a focus, once.
    Focus {
        /// To which.
        at: FocusAt,
    },
    /// Scales every length of the lens, so that its focal length becomes a given one.
    ScaleTo {
        /// Focal length, mm.
        efl_mm: f64,
    },
    /// Lets a number vary in optimisations.
    Vary {
        /// Surface.
        surface: usize,
        /// The number as lens files name it: `radius_mm`, `thickness_mm`, `conic`, `a4`, ...
        parameter: String,
        /// Lower bound; about the own value if both are left out.
        #[serde(default)]
        min: Option<f64>,
        /// Upper bound.
        #[serde(default)]
        max: Option<f64>,
    },
    /// Holds a number in optimisations.
    Hold {
        /// Surface.
        surface: usize,
        /// The number as lens files name it.
        parameter: String,
    },
    /// Lets a number follow the same number of another surface, now and after each further edit: `scale * other + offset`. The other one varies in
    /// optimisations from now on, if it does not yet.
    Pickup {
        /// Surface that follows.
        surface: usize,
        /// The number as lens files name it; radii follow as curvatures.
        parameter: String,
        /// Surface that it follows.
        of: usize,
        /// Factor; 1 if it is left out.
        #[serde(default)]
        scale: Option<f64>,
        /// Offset in the unit of the number, of radii in 1/mm, of tilts in degrees; 0 if it is left out.
        #[serde(default)]
        offset: Option<f64>,
    },
    /// Weights the fields in optimisations.
    FieldWeights {
        /// One weight per field of the lens, in ascending order of the fields; empty for all the same.
        weights: Vec<f64>,
    },
    /// Lets a radius hold the magnification of a near object, now and after each further edit.
    SolveMagnification {
        /// Surface; null ends the solve.
        surface: Option<usize>,
        /// Magnification, negative for an inverted image; the own one if left out.
        #[serde(default)]
        magnification: Option<f64>,
    },
    /// Lets a thickness hold the distance from the first vertex to the last, now and after each further edit.
    SolveLength {
        /// Surface; null ends the solve.
        surface: Option<usize>,
        /// Distance, mm; the own one if left out.
        #[serde(default)]
        length_mm: Option<f64>,
    },
    /// Lets a radius hold the focal length, now and after each further edit.
    SolveEfl {
        /// Surface; null ends the solve.
        surface: Option<usize>,
        /// Focal length, mm; the own one if left out.
        #[serde(default)]
        efl_mm: Option<f64>,
    },
}

/// What an edit needs to know.
pub(super) struct Editor<'a> {
    pub catalog: &'a Catalog,
}

impl Editor<'_> {
    /// Applies an edit. What solves and pickups settle is settled by [`settle`] afterwards.
    pub fn apply(&self, edit: &Edit, file: &mut LensFile) -> Result<()> {
        // What a source publishes is of the lens as it was.
        file.expect = None;
        let index = |surface: usize| index(surface, &file.lens);
        match edit {
            Edit::Radius { surface, radius_mm } => {
                let i = shaped(index(*surface)?, &file.lens)?;
                let curvature = radius_mm.map_or(0.0, |radius| 1.0 / radius);
                if *radius_mm == Some(0.0) || !curvature.is_finite() {
                    let hint = "null is a plane; a radius is positive if its centre lies behind the surface";
                    return Err(JobError::setting("radius_mm", "0", "no surface has such a radius", hint));
                }
                file.lens.surfaces[i].shape.curvature = curvature;
            }
            Edit::Curvature { surface, curvature_per_mm } => {
                let i = shaped(index(*surface)?, &file.lens)?;
                file.lens.surfaces[i].shape.curvature = *curvature_per_mm;
            }
            Edit::Bend { surface, by_per_mm } => {
                let i = shaped(index(*surface)?, &file.lens)?;
                let back = shaped(index(*surface + 1)?, &file.lens)?;
                for i in [i, back] {
                    file.lens.surfaces[i].shape.curvature += by_per_mm;
                }
            }
            Edit::Sag { surface, height_mm, sag_mm } => {
                let i = shaped(index(*surface)?, &file.lens)?;
                let shape = &mut file.lens.surfaces[i].shape;
                // z = c h^2 / (1 + sqrt(1 - (1 + k) c^2 h^2)) holds for c = 2 z / (h^2 + (1 + k) z^2), up to the equator.
                let rest =
                    SurfaceShape { curvature: 0.0, ..*shape }.sag_at_mm([0.0, *height_mm]).unwrap_or(0.0);
                let of_conic = sag_mm - rest;
                let square = height_mm.powi(2) + (1.0 + shape.conic) * of_conic.powi(2);
                shape.curvature = 2.0 * of_conic / square;
            }
            Edit::Conic { surface, conic } => {
                let i = index(*surface)?;
                if !file.lens.surfaces[i].has_number(Number::Conic) {
                    let message = format!("surface {surface} has no conic constant");
                    return Err(JobError::input(message, "a thin lens and a Q_bfs asphere have none"));
                }
                file.lens.surfaces[i].shape.conic = *conic;
            }
            Edit::Asphere { surface, power, value } => {
                let i = shaped(index(*surface)?, &file.lens)?;
                if *power < 2 || *power > 2 * ASPHERE_TERMS || power % 2 != 0 {
                    let hint = format!("an even power from 2 to {}", 2 * ASPHERE_TERMS);
                    return Err(JobError::setting("power", power, "the polynomial has no such term", hint));
                }
                file.lens.surfaces[i].shape.asphere[power / 2 - 1] = *value;
            }
            Edit::Thickness { surface, thickness_mm } => {
                let i = index(*surface)?;
                file.lens.surfaces[i].thickness_mm = *thickness_mm;
            }
            Edit::SemiDiameter { surface, semi_diameter_mm } => {
                let i = index(*surface)?;
                file.lens.surfaces[i].semi_diameter_mm = *semi_diameter_mm;
                file.lens.surfaces[i].is_open = false;
            }
            Edit::Glass { surface, glass } => self.set_glass(index(*surface)?, glass, &mut file.lens)?,
            Edit::Label { surface, label } => {
                let i = index(*surface)?;
                file.lens.surfaces[i].label.clone_from(label);
            }
            Edit::Stop { surface } => file.lens.stop = index(*surface)?,
            Edit::Insert { before } => insert(*before, file)?,
            Edit::Delete { surface } => delete(index(*surface)?, file)?,
            Edit::Aperture { entrance_pupil_mm } => file.lens.entrance_pupil_mm = *entrance_pupil_mm,
            Edit::Fields { fields_deg } => file.set_fields(ascending("fields_deg", fields_deg)?),
            Edit::Wavelengths { wavelengths_um, reference_um } => {
                file.lens.wavelengths_um = ascending("wavelengths_um", wavelengths_um)?;
                file.lens.reference_um = *reference_um;
            }
            Edit::Object { distance_mm } => {
                file.lens.object = distance_mm.map_or(ObjectDistance::Infinity, ObjectDistance::Finite);
                // From another distance the lens has another magnification, which is held from now on.
                let found = magnification(&file.lens);
                file.magnification_solve = file
                    .magnification_solve
                    .and_then(|solve| Some(MagnificationSolve { magnification: found?, ..solve }));
            }
            Edit::Name { name } => file.lens.name.clone_from(name),
            Edit::Focus { at } => file.lens = focused(file.lens.clone(), *at)?,
            Edit::ScaleTo { efl_mm } => scale_to(*efl_mm, file)?,
            Edit::Vary { surface, parameter, min, max } => {
                let i = index(*surface)?;
                let number = named(parameter, &file.lens.surfaces[i], *surface)?;
                hold(i, number, file);
                file.variables.push(variable(i, number, [*min, *max], &file.lens)?);
            }
            Edit::Hold { surface, parameter } => {
                let i = index(*surface)?;
                let number = named(parameter, &file.lens.surfaces[i], *surface)?;
                hold(i, number, file);
            }
            Edit::Pickup { surface, parameter, of, scale, offset } => {
                let places = [index(*surface)?, index(*of)?];
                follow(places, parameter, [scale.unwrap_or(1.0), offset.unwrap_or(0.0)], file)?;
            }
            Edit::FieldWeights { weights } => set_weights(weights, file)?,
            Edit::SolveEfl { surface: None, .. } | Edit::SolveMagnification { surface: None, .. } => {
                (file.efl_solve, file.magnification_solve) = (None, None);
            }
            Edit::SolveLength { surface: None, .. } => file.length_solve = None,
            Edit::SolveLength { surface: Some(surface), length_mm } => {
                let i = index(*surface)?;
                let own_mm = file.lens.total_track_mm() - file.lens.image_distance_mm();
                hold(i, Number::Thickness, file);
                file.length_solve = Some((i, length_mm.unwrap_or(own_mm)));
            }
            Edit::SolveMagnification { surface: Some(surface), magnification: wanted } => {
                let i = shaped(index(*surface)?, &file.lens)?;
                let own = magnification(&file.lens).ok_or_else(|| {
                    let hint = "hold the focal length, or give the lens an object at a finite distance";
                    JobError::input("the lens has no near object, and so no magnification", hint)
                })?;
                let magnification = wanted.unwrap_or(own);
                if !magnification.is_finite() || magnification == 0.0 {
                    let hint = format!("the lens has {own}");
                    return Err(JobError::setting(
                        "magnification",
                        magnification,
                        "no lens has this magnification",
                        hint,
                    ));
                }
                let radius_mm = bounds_of_solved(i, file);
                hold(i, Number::Curvature, file);
                file.magnification_solve = Some(MagnificationSolve { surface: i, magnification, radius_mm });
                file.efl_solve = None;
            }
            Edit::SolveEfl { surface: Some(surface), efl_mm } => {
                let i = shaped(index(*surface)?, &file.lens)?;
                let own_mm = || first_order(&file.lens.at_wavelength(file.lens.reference_um)).efl_mm;
                let efl_mm = efl_mm.unwrap_or_else(own_mm);
                if !efl_mm.is_finite() || efl_mm == 0.0 {
                    let hint = "give the focal length that the lens is to have, in mm";
                    return Err(JobError::setting("efl_mm", efl_mm, "no lens has this focal length", hint));
                }
                let radius_mm = bounds_of_solved(i, file);
                hold(i, Number::Curvature, file);
                file.efl_solve = Some(EflSolve { surface: i, efl_mm, radius_mm });
                file.magnification_solve = None;
            }
        }
        Ok(())
    }

    fn set_glass(&self, i: usize, name: &str, lens: &mut Lens) -> Result<()> {
        if lens.surfaces[i].action == Action::Reflect {
            let message = format!("surface {} is a mirror: the medium behind it is that of its front", i + 1);
            return Err(JobError::input(message, "change the glass of the surface in front of it"));
        }
        let name = name.trim();
        let is_air = name.is_empty() || name.eq_ignore_ascii_case("air");
        // A glass of the lens file need not be in the catalogue.
        let own = lens.surfaces.iter().find(|s| s.glass.name == name).map(|s| s.glass.clone());
        let glass = match own {
            _ if is_air => Glass::air(),
            Some(glass) => glass,
            None => self.catalog.get(name).map_err(|unknown| {
                let hint = format!("the nearest names are {}", unknown.nearest.join(", "));
                JobError::input(unknown.reason(), hint)
            })?,
        };
        lens.surfaces[i].glass = glass;
        Ok(())
    }
}

/// Settles what follows other numbers: pickups, then the solve for the length, then that for the focal length. Bounds of variables are widened to
/// enclose the lens.
pub(super) fn settle(file: &mut LensFile) -> Result<()> {
    use petzval_optics::solve::{with_efl, with_length, with_magnification};
    for pickup in &file.pickups {
        let followed = file.variables[pickup.variable];
        let value = followed.number.read(&file.lens, followed.surface);
        followed.number.write(&mut file.lens, pickup.surface, pickup.scale * value + pickup.offset);
    }
    if let Some((surface, length_mm)) = file.length_solve {
        file.lens = with_length(&file.lens, surface, length_mm);
    }
    if let Some(solve) = file.efl_solve {
        let solved = with_efl(&file.lens, solve.surface, solve.efl_mm).ok_or_else(|| {
            JobError::input(
                format!(
                    "no radius of surface {} gives a focal length of {} mm",
                    solve.surface + 1,
                    solve.efl_mm
                ),
                "end the solve, or move it to a surface at which the marginal ray is high",
            )
        })?;
        file.lens = solved;
    }
    if let Some(solve) = file.magnification_solve {
        let (number, wanted) = (solve.surface + 1, solve.magnification);
        let solved = with_magnification(&file.lens, solve.surface, wanted).ok_or_else(|| {
            JobError::input(
                format!("no radius of surface {number} gives a magnification of {wanted}"),
                "end the solve, or move it to a surface at which the marginal ray is high",
            )
        })?;
        file.lens = solved;
    }
    let lens = &file.lens;
    file.variables.iter_mut().for_each(|variable| enclose(variable, lens));
    Ok(())
}

/// Place of a surface in the list.
fn index(surface: usize, lens: &Lens) -> Result<usize> {
    surface.checked_sub(1).filter(|i| *i < lens.surfaces.len()).ok_or_else(|| {
        let hint = format!("the lens has the surfaces 1 to {}", lens.surfaces.len());
        JobError::setting("surface", surface, "the lens has no such surface", hint)
    })
}

/// Refuses a surface without a shape.
fn shaped(i: usize, lens: &Lens) -> Result<usize> {
    if lens.surfaces[i].has_number(Number::Curvature) {
        return Ok(i);
    }
    let message = format!("surface {} is a thin lens, which has no curvature", i + 1);
    Err(JobError::input(message, "change its focal length in the lens file"))
}

/// Numbers in ascending order, of which at least one must be there and none twice.
fn ascending(key: &'static str, values: &[f64]) -> Result<Vec<f64>> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    if sorted.is_empty() {
        return Err(JobError::setting(key, "", "a lens is judged at one at least", "give a number"));
    }
    Ok(sorted)
}

/// The number of a surface that lens files call by a name.
fn named(parameter: &str, surface: &Surface, number: usize) -> Result<Number> {
    let all = || Number::ALL.into_iter().filter(|number| !parameter_name(surface, *number).is_empty());
    all().find(|number| parameter_name(surface, *number) == parameter).ok_or_else(|| {
        let known: Vec<String> = all().map(|number| parameter_name(surface, number)).collect();
        let message = format!("surface {number} has no such number");
        JobError::setting("parameter", parameter, message, format!("it has {}", known.join(", ")))
    })
}

/// The bounds of a radius that is solved for already, mm.
fn bounds_of_solved(surface: usize, file: &LensFile) -> Option<[f64; 2]> {
    file.solves().curvature().filter(|(solved, _)| *solved == surface).and_then(|(_, radius_mm)| radius_mm)
}

/// Lets a number of a surface follow that of another.
fn follow(
    [surface, of]: [usize; 2],
    parameter: &str,
    [scale, offset]: [f64; 2],
    file: &mut LensFile,
) -> Result<()> {
    let number = named(parameter, &file.lens.surfaces[surface], surface + 1)?;
    // Indices of different shapes do not correspond: the name counts.
    let followed = named(parameter, &file.lens.surfaces[of], of + 1)?;
    if surface == of || number != followed {
        let message = format!("{parameter} of surface {} cannot follow surface {}", surface + 1, of + 1);
        return Err(JobError::setting("of", of + 1, message, "name another surface with this number"));
    }
    let [scale, offset] = finite([("scale", scale), ("offset", offset)])?;
    if number == Number::Thickness && surface + 1 == file.lens.surfaces.len() {
        let message = "the last thickness cannot follow another";
        return Err(JobError::input(message, "the image plane is placed at the image"));
    }
    if is_settled(of, number, file) {
        let message = format!("{parameter} of surface {} follows another or is solved for", of + 1);
        return Err(JobError::setting("of", of + 1, message, "name a surface whose number is free"));
    }
    hold(surface, number, file);
    let is_followed = |v: &Variable| (v.surface, v.number) == (of, number);
    let variable = match file.variables.iter().position(is_followed) {
        Some(variable) => variable,
        None => {
            file.variables.push(variable(of, number, [None, None], &file.lens)?);
            file.variables.len() - 1
        }
    };
    file.pickups.push(Pickup { surface, variable, scale, offset: number.from_stated_difference(offset) });
    Ok(())
}

/// Whether a number follows another or is solved for.
fn is_settled(surface: usize, number: Number, file: &LensFile) -> bool {
    let follows = |p: &Pickup| p.surface == surface && file.variables[p.variable].number == number;
    file.pickups.iter().any(follows)
        || number == Number::Curvature
            && file.solves().curvature().is_some_and(|(solved, _)| solved == surface)
        || number == Number::Thickness && file.length_solve.is_some_and(|(solved, _)| solved == surface)
}

/// Numbers of a request that must be finite.
fn finite<const N: usize>(all: [(&'static str, f64); N]) -> Result<[f64; N]> {
    for (key, value) in all {
        if !value.is_finite() {
            return Err(JobError::setting(key, value, "this must be a finite number", "give a number"));
        }
    }
    Ok(all.map(|(_, value)| value))
}

/// Sets the weights of the fields.
fn set_weights(weights: &[f64], file: &mut LensFile) -> Result<()> {
    let count = file.lens.fields_deg.len();
    let wrong = |message: String, hint: &str| Err(JobError::setting("weights", list(weights), message, hint));
    if !weights.is_empty() && weights.len() != count {
        return wrong(format!("the lens has {count} fields"), "give one weight per field");
    }
    if let Some(fault) = WeightFault::of(weights) {
        let (message, hint) = fault.in_words();
        return wrong(message, hint);
    }
    file.field_weights = uneven_weights(weights.to_vec());
    Ok(())
}

/// Numbers in words.
fn list(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
}

/// Ends the variable of a number, with what follows it, and whatever settles the number.
fn hold(surface: usize, number: Number, file: &mut LensFile) {
    let variables = &file.variables;
    file.pickups.retain(|p| p.surface != surface || variables[p.variable].number != number);
    keep_variables(file, |v| (v.surface, v.number) != (surface, number));
    if number == Number::Curvature && file.solves().curvature().is_some_and(|(solved, _)| solved == surface) {
        (file.efl_solve, file.magnification_solve) = (None, None);
    }
    if number == Number::Thickness && file.length_solve.is_some_and(|(solved, _)| solved == surface) {
        file.length_solve = None;
    }
}

/// Keeps some variables; pickups of the others end.
fn keep_variables(file: &mut LensFile, is_kept: impl Fn(&Variable) -> bool) {
    let places: Vec<Option<usize>> = file
        .variables
        .iter()
        .scan(0, |next, v| {
            let place = is_kept(v).then_some(*next);
            *next += usize::from(place.is_some());
            Some(place)
        })
        .collect();
    file.variables.retain(is_kept);
    file.pickups.retain(|p| places[p.variable].is_some());
    for pickup in &mut file.pickups {
        if let Some(place) = places[pickup.variable] {
            pickup.variable = place;
        }
    }
}

/// A variable within bounds; those that are not given lie about the own value.
fn variable(surface: usize, number: Number, bounds: [Option<f64>; 2], lens: &Lens) -> Result<Variable> {
    if let [Some(min), Some(max)] = bounds {
        if min < max {
            return Ok(Variable { surface, number, min, max });
        }
        return Err(JobError::setting("max", max, format!("is not above `min`, {min}"), "exchange the two"));
    }
    if bounds != [None, None] {
        return Err(JobError::input("one bound alone", "give `min` and `max`, or neither"));
    }
    let own = number.read(lens, surface);
    let (low, high) = match number {
        Number::Curvature if own == 0.0 => {
            let strongest = lens.surfaces.iter().map(|s| s.shape.curvature.abs()).fold(0.0, f64::max);
            let reach = if strongest > 0.0 { BEND * strongest } else { 1e-3 };
            (-reach, reach)
        }
        Number::Curvature => (own - BEND * own.abs(), own + BEND * own.abs()),
        Number::Thickness => {
            let (near, far) = (0.5 * own, 2.0 * own + 0.1_f64.copysign(own));
            (near.min(far), near.max(far))
        }
        Number::Conic => (own - CONIC, own + CONIC),
        Number::SemiDiameter => (0.5 * own, 2.0 * own),
        _ if own != 0.0 => (own - 0.5 * own.abs(), own + 0.5 * own.abs()),
        _ => {
            let hint = "a number that is 0 says nothing of how far it may move";
            return Err(JobError::input("bounds are missing: give `min` and `max`", hint));
        }
    };
    Ok(stated(surface, number, [low, high]))
}

/// A variable between ascending bounds of the number itself. A curvature on both sides of the plane has radii of both signs.
fn stated(surface: usize, number: Number, [low, high]: [f64; 2]) -> Variable {
    let [a, b] = [low, high].map(|bound| number.stated(bound));
    let (min, max) =
        if number == Number::Curvature && low < 0.0 && high > 0.0 { (a, b) } else { (a.min(b), a.max(b)) };
    Variable { surface, number, min, max }
}

/// Widens the bounds of a variable until they enclose the lens.
fn enclose(variable: &mut Variable, lens: &Lens) {
    let Variable { surface, number, min, max } = *variable;
    let own = number.read(lens, surface);
    let [a, b] = [min, max].map(|bound| number.from_stated(bound));
    let (low, high) = (a.min(b), a.max(b));
    if (low..=high).contains(&own) || !own.is_finite() {
        return;
    }
    let (mut low, mut high) = (low.min(own), high.max(own));
    if number == Number::Curvature {
        // No radius states a plane: the bounds go on to its other side.
        let beyond = 0.1 * low.abs().max(high.abs());
        low = if low == 0.0 { -beyond } else { low };
        high = if high == 0.0 { beyond } else { high };
    }
    let widened = stated(surface, number, [low, high]);
    if widened.min.is_finite() && widened.max.is_finite() && widened.min < widened.max {
        *variable = widened;
    }
}

/// Moves every mention of the surfaces from `from` on by one place.
fn move_mentions(file: &mut LensFile, from: usize, to: impl Fn(usize) -> usize) {
    let moved = |surface: &mut usize| {
        if *surface >= from {
            *surface = to(*surface);
        }
    };
    moved(&mut file.lens.stop);
    file.variables.iter_mut().for_each(|v| moved(&mut v.surface));
    file.pickups.iter_mut().for_each(|p| moved(&mut p.surface));
    if let Some(solve) = &mut file.efl_solve {
        moved(&mut solve.surface);
    }
    if let Some(solve) = &mut file.magnification_solve {
        moved(&mut solve.surface);
    }
    if let Some((surface, _)) = &mut file.length_solve {
        moved(surface);
    }
}

/// Inserts a plane without effect.
fn insert(before: usize, file: &mut LensFile) -> Result<()> {
    let count = file.lens.surfaces.len();
    if count >= MOST_SURFACES {
        let message = format!("a lens has {MOST_SURFACES} surfaces at most");
        return Err(JobError::input(message, "delete a surface first"));
    }
    let at = before.checked_sub(1).filter(|at| *at <= count).ok_or_else(|| {
        let hint = format!("from 1 to {}", count + 1);
        JobError::setting("before", before, "the lens has no such place", hint)
    })?;
    let new = match at.checked_sub(1) {
        // In front of all: as far as the first surface is high.
        None => {
            let first = &file.lens.surfaces[0];
            let Surface { semi_diameter_mm, is_open, .. } = *first;
            Surface { thickness_mm: 0.2 * semi_diameter_mm, semi_diameter_mm, is_open, ..Surface::default() }
        }
        Some(front) => {
            let front = &mut file.lens.surfaces[front];
            let half_mm = 0.5 * front.thickness_mm;
            front.thickness_mm -= half_mm;
            Surface {
                shape: SurfaceShape::PLANE,
                thickness_mm: half_mm,
                glass: front.glass.clone(),
                semi_diameter_mm: front.semi_diameter_mm,
                is_open: front.is_open,
                ..Surface::default()
            }
        }
    };
    move_mentions(file, at, |surface| surface + 1);
    file.lens.surfaces.insert(at, new);
    Ok(())
}

/// Deletes a surface, with its variables and solves.
fn delete(i: usize, file: &mut LensFile) -> Result<()> {
    if file.lens.surfaces.len() == 1 {
        return Err(JobError::input("a lens has one surface at least", "insert another one first"));
    }
    if i == file.lens.stop {
        let message = format!("surface {} is the stop", i + 1);
        return Err(JobError::input(message, "make another surface the stop first"));
    }
    keep_variables(file, |v| v.surface != i);
    file.pickups.retain(|p| p.surface != i);
    file.efl_solve = file.efl_solve.filter(|solve| solve.surface != i);
    file.magnification_solve = file.magnification_solve.filter(|solve| solve.surface != i);
    file.length_solve = file.length_solve.filter(|(surface, _)| *surface != i);
    let gone = file.lens.surfaces.remove(i);
    if let Some(front) = i.checked_sub(1) {
        file.lens.surfaces[front].thickness_mm += gone.thickness_mm;
    }
    move_mentions(file, i, |surface| surface - 1);
    // The length is that between the vertices, and the last distance is to the image.
    let last = file.lens.surfaces.len() - 1;
    file.length_solve = file.length_solve.filter(|(surface, _)| *surface < last);
    Ok(())
}

/// Scales a lens to a focal length.
fn scale_to(efl_mm: f64, file: &mut LensFile) -> Result<()> {
    let own_mm = first_order(&file.lens.at_wavelength(file.lens.reference_um)).efl_mm;
    let factor = efl_mm / own_mm;
    let refused = |message: String, hint: &str| Err(JobError::input(message, hint));
    if !(factor.is_finite() && factor > 0.0) {
        let message = format!("a focal length of {own_mm} mm cannot be scaled to {efl_mm} mm");
        return refused(message, "both are finite, and have the same sign");
    }
    let is_plain = |s: &Surface| {
        s.action == Action::Refract
            && s.phase.is_none()
            && s.placement.is_none()
            && s.shape.departure == SurfaceShape::PLANE.departure
    };
    if let Some(i) = file.lens.surfaces.iter().position(|s| !is_plain(s)) {
        let message = format!("surface {} is no conic with an even polynomial on the axis", i + 1);
        return refused(message, "scale such a lens in its own program");
    }
    for s in &mut file.lens.surfaces {
        s.shape.curvature /= factor;
        for (term, a) in s.shape.asphere.iter_mut().enumerate() {
            // A coefficient of r^p is in mm^(1 - p).
            *a *= factor.powi(1 - 2 * (term as i32 + 1));
        }
        s.thickness_mm *= factor;
        s.semi_diameter_mm *= factor;
    }
    file.lens.entrance_pupil_mm *= factor;
    if let ObjectDistance::Finite(distance_mm) = &mut file.lens.object {
        *distance_mm *= factor;
    }
    // Bounds that were given in mm are of the lens as it was.
    file.variables.clear();
    file.pickups.clear();
    file.length_solve = file.length_solve.map(|(surface, length_mm)| (surface, length_mm * factor));
    file.efl_solve = file.efl_solve.map(|solve| EflSolve { efl_mm, radius_mm: None, ..solve });
    file.magnification_solve =
        file.magnification_solve.map(|solve| MagnificationSolve { radius_mm: None, ..solve });
    Ok(())
}
