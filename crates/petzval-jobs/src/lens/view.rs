//! `lens-view`: a lens and what a designer looks at while it changes, in one call and as values alone.

use petzval_files::lens_toml::{parameter_name, special_lines};
use petzval_files::{LensFile, Loss};
use petzval_optics::analysis::{
    AnalysisError, AnalysisOptions, Fan, FieldCurves, FieldMtf, FirstOrderTable, Layout, SpotDiagram, fan,
    field_curves, field_mtf, first_order_table, layout, mtf_at, spot_diagram,
};
use petzval_optics::constraint::{Constraint, SemiDiameters};
use petzval_optics::lens::{Action, Lens, LensDefect, ObjectDistance, Surface, validate};
use petzval_optics::number::Number;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::edit::{Edit, Edited, edited};
use super::focus::{Defocus, defocus};
use super::optimize::Goal;
use super::show::{of_one_field, of_one_section, unshadowed};
use crate::context::Context;
use crate::error::Result;
use crate::input::LensInput;
use crate::range::check_ranges;

/// Most fields, and most wavelengths, that are looked at: of more, so many are taken evenly.
const MOST: usize = 12;

/// Excess from which a limit counts as violated, mm.
const VIOLATED_MM: f64 = 1e-6;

petzval_base::parameters! {
    /// A lens, how it changes, and what to look at.
    pub struct Request {
        /// Highest frequency of MTF curves, cycles/mm; if left out, 100, or about half of the cutoff if that is less.
        max_frequency: Option<f64> = None, "cycles/mm", 1e-6..2e4, Log, "a pixel of 5.86 um resolves 85.32 cycles/mm";
    }
    also {
        /// Lens: a built-in name, the path of a file, or the lens itself. It may be one that cannot be built.
        lens: LensInput = LensInput::default();
        /// Changes that come first, in this order.
        edits: Vec<Edit> = Vec::new();
        /// What to look at, beside the prescription and the first-order data; everything if empty.
        parts: Vec<Part> = Vec::new();
        /// Few rays and few points, for a lens that is being dragged.
        quick: bool = false;
        /// Limits of the lens, as an optimisation has them. Its other keys do not matter.
        goal: Box<Goal> = Box::default();
    }
}

/// A part of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// The cross-section with rays.
    Layout,
    /// Spot diagrams.
    Spots,
    /// Ray and wavefront aberrations.
    Fans,
    /// Modulation over frequency.
    Mtf,
    /// Field curvature, distortion, lateral colour and illumination.
    FieldCurves,
}

/// A lens as it is seen. What does not exist or cannot be traced is `None` or missing, and `problems` says why.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Response {
    /// Its text in Petzval's format: reading it gives the same lens to the last bit.
    pub toml: String,
    /// Its name.
    pub name: String,
    /// Where its numbers come from.
    pub source: String,
    /// Its prescription.
    pub surfaces: Vec<Row>,
    /// Entrance pupil diameter, mm.
    pub entrance_pupil_mm: f64,
    /// From the object to the first vertex, mm; `None` for infinity.
    pub object_distance_mm: Option<f64>,
    /// Wavelengths that are looked at, um.
    pub wavelengths_um: Vec<f64>,
    /// All wavelengths of the lens, um.
    pub stated_wavelengths_um: Vec<f64>,
    /// Wavelength of first-order properties and of the layout's rays, um.
    pub reference_um: f64,
    /// Fields that are looked at, degrees.
    pub fields_deg: Vec<f64>,
    /// All fields of the lens, degrees.
    pub stated_fields_deg: Vec<f64>,
    /// Weights of all fields in optimisations; empty if all are the same.
    pub field_weights: Vec<f64>,
    /// The focal length that a radius holds, mm.
    pub solved_efl_mm: Option<f64>,
    /// First-order data.
    pub first_order: FirstOrderTable,
    /// Whether few rays were traced.
    pub is_quick: bool,
    /// The cross-section.
    pub layout: Option<Layout>,
    /// Spot diagrams by field.
    pub spots: Vec<SpotDiagram>,
    /// Aberrations by field.
    pub fans: Vec<Fan>,
    /// Modulation by field.
    pub mtf: Vec<FieldMtf>,
    /// Curves over the field.
    pub field_curves: Option<FieldCurves>,
    /// Why the lens cannot be built, and limits that it violates.
    pub violations: Vec<Violation>,
    /// What could not be traced, and why; and what the figures leave out.
    pub problems: Vec<String>,
    /// How far the image plane lies from the best focus; `None` if the lens is in focus or has none, and in a quick view.
    pub out_of_focus: Option<Defocus>,
    /// Records of its file that the lens does not represent.
    pub losses_of_reading: Vec<Loss>,
}

/// A surface of a prescription.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Row {
    /// Its number, from 1.
    pub surface: usize,
    /// What it is called; may be empty.
    pub label: String,
    /// What it does to light.
    pub action: RowAction,
    /// Radius of curvature, mm; `None` for a plane.
    pub radius_mm: Option<f64>,
    /// Vertex curvature, 1/mm.
    pub curvature_per_mm: f64,
    /// Conic constant.
    pub conic: f64,
    /// Coefficients of r^2, r^4, ..., r^16.
    pub asphere: Vec<f64>,
    /// Distance to the next vertex, mm; of the last surface, to the image plane.
    pub thickness_mm: f64,
    /// The medium behind it; empty for air.
    pub glass: String,
    /// Its index at the d line.
    pub nd: Option<f64>,
    /// Its Abbe number.
    pub vd: Option<f64>,
    /// Clear semi-diameter, mm.
    pub semi_diameter_mm: f64,
    /// Whether it is the stop.
    pub is_stop: bool,
    /// Its vertex in the layout, (z, y), mm; `None` where the axis is folded or the surface is shifted or turned.
    pub vertex: Option<[f64; 2]>,
    /// Its sag at the clear semi-diameter, mm; `None` where the shape ends before.
    pub edge_sag_mm: Option<f64>,
    /// Everything else of it, as lines of a lens file.
    pub special: Vec<String>,
    /// Its numbers that vary in optimisations.
    pub varies: Vec<Varies>,
    /// Its numbers that follow others or are solved for.
    pub settled: Vec<Settled>,
}

/// A number that follows another or is solved for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Settled {
    /// Its name in lens files.
    pub parameter: String,
    /// What settles it.
    pub by: SettledBy,
}

/// What settles a number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SettledBy {
    /// The same number of another surface: `scale * other + offset`. Radii follow as curvatures.
    Pickup {
        /// That surface, from 1.
        of: usize,
        /// Factor.
        scale: f64,
        /// Offset in the unit of the number; of radii in 1/mm, of tilts in degrees.
        offset: f64,
    },
    /// The focal length that it holds.
    Efl {
        /// Focal length, mm.
        efl_mm: f64,
    },
    /// The magnification of a near object that it holds.
    Magnification {
        /// Magnification.
        magnification: f64,
    },
    /// The distance from the first vertex to the last that it holds.
    Length {
        /// Distance, mm.
        length_mm: f64,
    },
}

/// What a surface does to light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RowAction {
    /// It refracts.
    Refract,
    /// It is a mirror.
    Reflect,
    /// It is a thin lens.
    ThinLens,
}

/// A number that varies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Varies {
    /// Its name in lens files.
    pub parameter: String,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
}

/// A limit that the lens violates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Violation {
    /// The surface, from 1; `None` where it is the lens as a whole.
    pub surface: Option<usize>,
    /// What is violated.
    pub what: String,
    /// By how much, mm; `None` where that is no length.
    pub excess_mm: Option<f64>,
}

/// Looks at the lens.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    let Edited { file, toml, losses, .. } = edited(&request.lens, &request.edits, context)?;
    let (shown, mut problems) = thinned(&file.lens);
    let options = options(request);
    let wants = |part: Part| request.parts.is_empty() || request.parts.contains(&part);
    let (by_field, curves) = rayon::join(
        || {
            let of_field = |field: &f64| at_field(&shown, *field, &wants, &options);
            shown.fields_deg.par_iter().map(of_field).collect::<Vec<_>>()
        },
        || wants(Part::FieldCurves).then(|| field_curves(&shown, &options)),
    );
    let mut note = |error: AnalysisError| {
        let text = error.to_string();
        if !problems.contains(&text) {
            problems.push(text);
        }
    };
    let (mut spots, mut fans, mut mtf) = (Vec::new(), Vec::new(), Vec::new());
    for field in by_field {
        keep(field.spot, &mut spots, &mut note);
        keep(field.fan, &mut fans, &mut note);
        keep(field.mtf, &mut mtf, &mut note);
    }
    let mut field_curves = Vec::new();
    keep(curves, &mut field_curves, &mut note);
    let lens = &file.lens;
    problems.extend([unshadowed(lens), of_one_section(lens), of_one_field(lens)].into_iter().flatten());
    // A lens that cannot be built has no focus.
    let is_whole = !request.quick && validate(lens).is_ok();
    Ok(Response {
        out_of_focus: if is_whole { defocus(lens) } else { None },
        toml,
        surfaces: rows(&file),
        entrance_pupil_mm: lens.entrance_pupil_mm,
        object_distance_mm: match lens.object {
            ObjectDistance::Infinity => None,
            ObjectDistance::Finite(mm) => Some(mm),
        },
        solved_efl_mm: file.efl_solve.map(|solve| solve.efl_mm),
        first_order: first_order_table(lens),
        is_quick: request.quick,
        layout: wants(Part::Layout).then(|| layout(&shown, &options)),
        spots,
        fans,
        mtf,
        field_curves: field_curves.pop(),
        violations: violations(lens, &request.goal)?,
        problems,
        losses_of_reading: losses,
        name: lens.name.clone(),
        source: lens.source.clone(),
        stated_wavelengths_um: lens.wavelengths_um.clone(),
        wavelengths_um: shown.wavelengths_um,
        reference_um: lens.reference_um,
        stated_fields_deg: lens.fields_deg.clone(),
        field_weights: file.field_weights.clone(),
        fields_deg: shown.fields_deg,
    })
}

/// The resolution of a view.
fn options(request: &Request) -> AnalysisOptions {
    let max_frequency_per_mm = request.max_frequency;
    if request.quick {
        AnalysisOptions {
            pupil_cells: 24,
            spot_rings: 6,
            fan_points: 21,
            layout_rays: 5,
            field_points: 9,
            max_frequency_per_mm,
            frequency_points: 31,
            ..AnalysisOptions::default()
        }
    } else {
        AnalysisOptions {
            spot_rings: 8,
            layout_rays: 7,
            field_points: 25,
            frequency_points: 81,
            max_frequency_per_mm,
            ..AnalysisOptions::default()
        }
    }
}

/// A lens with few enough fields and wavelengths to be looked at, and what to say if some are left out.
fn thinned(lens: &Lens) -> (Lens, Vec<String>) {
    let mut notes = Vec::new();
    let mut thin = |what: &str, values: &[f64]| -> Vec<f64> {
        if values.len() <= MOST {
            return values.to_vec();
        }
        notes.push(format!("of {} {what}, {MOST} are shown", values.len()));
        (0..MOST).map(|i| values[i * (values.len() - 1) / (MOST - 1)]).collect()
    };
    let fields_deg = thin("fields", &lens.fields_deg);
    let wavelengths_um = thin("wavelengths", &lens.wavelengths_um);
    (Lens { fields_deg, wavelengths_um, ..lens.clone() }, notes)
}

/// What is seen of a field; `None` where it was not requested.
struct AtField {
    spot: Option<Result<SpotDiagram, AnalysisError>>,
    fan: Option<Result<Fan, AnalysisError>>,
    mtf: Option<Result<FieldMtf, AnalysisError>>,
}

fn at_field(
    lens: &Lens,
    field_deg: f64,
    wants: &impl Fn(Part) -> bool,
    options: &AnalysisOptions,
) -> AtField {
    let mtf = || match options.max_frequency_per_mm {
        Some(most) => {
            let last = (options.frequency_points - 1) as f64;
            let frequencies: Vec<f64> =
                (0..options.frequency_points).map(|i| most * i as f64 / last).collect();
            mtf_at(lens, field_deg, &frequencies, options)
        }
        None => field_mtf(lens, field_deg, options),
    };
    AtField {
        spot: wants(Part::Spots).then(|| spot_diagram(lens, field_deg, options)),
        fan: wants(Part::Fans).then(|| fan(lens, field_deg, options)),
        mtf: wants(Part::Mtf).then(mtf),
    }
}

/// Keeps a result, or says why there is none.
fn keep<T>(found: Option<Result<T, AnalysisError>>, all: &mut Vec<T>, note: &mut impl FnMut(AnalysisError)) {
    match found {
        Some(Ok(found)) => all.push(found),
        Some(Err(error)) => note(error),
        None => {}
    }
}

/// The prescription.
fn rows(file: &LensFile) -> Vec<Row> {
    let lens = &file.lens;
    let is_straight = lens.surfaces.iter().all(|s| s.placement.is_none());
    let mut z_mm = 0.0;
    let vertices: Vec<f64> = lens
        .surfaces
        .iter()
        .map(|s| {
            let here = z_mm;
            z_mm += s.thickness_mm;
            here
        })
        .collect();
    let row = |(i, s): (usize, &Surface)| {
        let [nd, vd] = if s.glass.is_air() { [None; 2] } else { s.glass.known_nd_and_vd() };
        let of_surface = file.variables.iter().filter(|v| v.surface == i);
        let varies =
            of_surface.map(|v| Varies { parameter: parameter_name(s, v.number), min: v.min, max: v.max });
        Row {
            surface: i + 1,
            label: s.label.clone(),
            action: match s.action {
                Action::Refract => RowAction::Refract,
                Action::Reflect => RowAction::Reflect,
                Action::ThinLens { .. } => RowAction::ThinLens,
            },
            radius_mm: (s.shape.curvature != 0.0).then(|| 1.0 / s.shape.curvature),
            curvature_per_mm: s.shape.curvature,
            conic: s.shape.conic,
            asphere: s.shape.asphere.to_vec(),
            thickness_mm: s.thickness_mm,
            glass: if s.glass.is_air() { String::new() } else { s.glass.name.clone() },
            nd,
            vd,
            semi_diameter_mm: s.semi_diameter_mm,
            is_stop: i == lens.stop,
            vertex: is_straight.then_some([vertices[i], 0.0]),
            edge_sag_mm: s.shape.sag_at_mm([0.0, s.semi_diameter_mm]),
            special: special_lines(s).lines().map(str::to_owned).collect(),
            varies: varies.collect(),
            settled: settled(i, s, file),
        }
    };
    lens.surfaces.iter().enumerate().map(row).collect()
}

/// The numbers of a surface that follow others or are solved for.
fn settled(i: usize, s: &Surface, file: &LensFile) -> Vec<Settled> {
    let settled = |number: Number, by: SettledBy| Settled { parameter: parameter_name(s, number), by };
    let followers = file.pickups.iter().filter(|p| p.surface == i);
    let pickups = followers.map(|p| {
        let followed = &file.variables[p.variable];
        let offset = followed.number.stated_difference(p.offset);
        let by = SettledBy::Pickup { of: followed.surface + 1, scale: p.scale, offset };
        settled(followed.number, by)
    });
    let efl = file.efl_solve.filter(|solve| solve.surface == i);
    let efl = efl.map(|solve| settled(Number::Curvature, SettledBy::Efl { efl_mm: solve.efl_mm }));
    let magnification = file.magnification_solve.filter(|solve| solve.surface == i).map(|solve| {
        settled(Number::Curvature, SettledBy::Magnification { magnification: solve.magnification })
    });
    let length = file.length_solve.filter(|(surface, _)| *surface == i);
    let length = length.map(|(_, length_mm)| settled(Number::Thickness, SettledBy::Length { length_mm }));
    pickups.chain(efl).chain(magnification).chain(length).collect()
}

/// Why the lens cannot be built, and the limits of a goal that it violates at its clear semi-diameters.
fn violations(lens: &Lens, goal: &Goal) -> Result<Vec<Violation>> {
    let mut found: Vec<Violation> =
        validate(lens).err().map(|defect| of_defect(&defect)).into_iter().collect();
    let field_rad = lens.outermost_field_deg().to_radians();
    for constraint in goal.limits()?.constraints(lens, field_rad) {
        let excess_mm = constraint.excess_mm(lens, &SemiDiameters(lens));
        if let Some(excess_mm) = excess_mm.filter(|excess| *excess > VIOLATED_MM) {
            let surface = surface_of(&constraint).map(|i| i + 1);
            found.push(Violation { surface, what: constraint.to_string(), excess_mm: Some(excess_mm) });
        }
    }
    Ok(found)
}

fn of_defect(defect: &LensDefect) -> Violation {
    Violation { surface: defect.surface(), what: defect.to_string(), excess_mm: None }
}

/// The surface that a constraint is about, from 0.
fn surface_of(constraint: &Constraint) -> Option<usize> {
    match *constraint {
        Constraint::Edge { surface, .. }
        | Constraint::Centre { surface, .. }
        | Constraint::Air { surface, .. }
        | Constraint::AirEdge { surface, .. }
        | Constraint::Reach { surface }
        | Constraint::SolvedRadius { surface, .. }
        | Constraint::ClearDiameter { surface, .. }
        | Constraint::Slope { surface, .. } => Some(surface),
        Constraint::FocalLength { .. }
        | Constraint::BackFocal { .. }
        | Constraint::ImageDistance { .. }
        | Constraint::Track { .. }
        | Constraint::Distortion { .. }
        | Constraint::ChiefRayAngle { .. }
        | Constraint::ChiefHeight { .. }
        | Constraint::Light { .. } => None,
    }
}
