//! `lens show`: what a lens is, in numbers.

use petzval_design::assets::glass_warnings::glass_warnings;
use petzval_files::lens_toml::special_lines;
use petzval_optics::analysis::{Cone, first_order_table, leaves_parallel, paraxial_image_mm};
use petzval_optics::lens::{Action, Lens, ObjectDistance};
use petzval_optics::paraxial::{FirstOrder, first_order};
use petzval_optics::pupil::{PupilRefinement, Quadrature, Refined, trace_beam};
use petzval_optics::seidel::seidel_total;
use petzval_optics::spot::{FieldSpot, PrintedSpot, spot_converged, spot_paraxial_pupil};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::focus::{FocusAt, colours_out_of_focus, focused, image_at_infinity, out_of_focus, virtual_image};
use super::lost::no_ray_at;
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::finite::finite;
use crate::input::LensInput;

/// The accuracy of spots and illumination: 0.1 %.
const SPOTS: PupilRefinement = PupilRefinement { tolerance: 1e-3, first_cells: 64, most_cells: 1024 };

/// A stop with a clear radius of so many times that of the beam gets a warning.
const WIDE_STOP: f64 = 3.0;

/// Length over focal length of a lens that is nearly afocal.
const NEARLY_AFOCAL: f64 = 1e-4;

/// Which lens to show.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Lens: a built-in name, the path of a file, or the lens itself.
    pub lens: LensInput,
    /// Where the image plane goes.
    pub focus: FocusAt,
}

/// The figures of a lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The figures.
    pub figures: Figures,
    /// The warnings among those of the figures that were reported to the watcher when the lens was read.
    pub reported_warnings: Vec<String>,
}

/// Figures of a lens. What does not exist, such as the focal length of an afocal lens, is `None`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Name of the lens.
    pub name: String,
    /// Where its prescription is from.
    pub source: String,
    /// Focal length, mm.
    pub efl_mm: Option<f64>,
    /// From the last vertex to the rear focal point along z, mm: negative behind an odd number of mirrors, as the last thickness.
    pub bfl_mm: Option<f64>,
    /// Focal length over entrance pupil diameter.
    pub f_number: Option<f64>,
    /// Entrance pupil diameter, mm.
    pub epd_mm: f64,
    /// From the object to the first vertex, mm; `None` at infinity.
    pub object_distance_mm: Option<f64>,
    /// Lateral magnification of a near object.
    pub magnification: Option<f64>,
    /// Numerical aperture at the image by real marginal rays; 0 where light leaves parallel.
    pub image_na: f64,
    /// `1 / (2 NA)`.
    pub working_f_number: Option<f64>,
    /// Of an afocal lens: tangent of the angle at which a field leaves over that at which it comes.
    pub angular_magnification: Option<f64>,
    /// Greatest distance between any two of the vertices and the paraxial image, mm: in space where mirrors bend the axis.
    pub total_track_mm: Option<f64>,
    /// Whether mirrors bend the axis.
    pub is_folded: bool,
    /// From the last vertex to the image plane, mm.
    pub image_distance_mm: f64,
    /// Image plane from the paraxial image, mm; positive away from the lens.
    pub defocus_mm: Option<f64>,
    /// Entrance pupil from the first vertex, mm.
    pub entrance_pupil_from_first_vertex_mm: Option<f64>,
    /// Exit pupil from the last vertex, mm.
    pub exit_pupil_from_last_vertex_mm: Option<f64>,
    /// Exit pupil diameter, mm.
    pub exit_pupil_mm: Option<f64>,
    /// Wavelength of first-order properties, um.
    pub reference_um: f64,
    /// Wavelengths, um.
    pub wavelengths_um: Vec<f64>,
    /// Field angles, degrees.
    pub fields_deg: Vec<f64>,
    /// RMS spot radius over the paraxial entrance pupil, as lens programs print it, by field and wavelength, um. `None` for a field
    /// whose rays through that pupil are lost. This list and the next four are empty where light leaves parallel.
    pub rms_spot_um: Vec<Option<Vec<f64>>>,
    /// The same of all wavelengths together, by field, um.
    pub rms_spot_poly_um: Vec<Option<f64>>,
    /// RMS spot radius through the real stop, each ray weighted by its light: what a sensor sees, by field and wavelength, um.
    pub rms_spot_real_stop_um: Vec<Vec<f64>>,
    /// The same of all wavelengths together, by field, um.
    pub rms_spot_poly_real_stop_um: Vec<f64>,
    /// Illumination relative to the axis, by field and wavelength.
    pub relative_illumination: Vec<Vec<f64>>,
    /// Seidel sums; `None` where third-order theory has no formulas for a surface.
    pub seidel: Option<Seidel>,
    /// What a designer should know before believing the rest.
    pub warnings: Vec<String>,
    /// The prescription.
    pub surfaces: Vec<Surface>,
}

/// Seidel sums of the full field, mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "UPPERCASE")]
pub struct Seidel {
    /// Spherical aberration.
    pub s1: f64,
    /// Coma.
    pub s2: f64,
    /// Astigmatism.
    pub s3: f64,
    /// Field curvature (Petzval).
    pub s4: f64,
    /// Distortion.
    pub s5: f64,
}

/// A surface of the prescription.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Surface {
    /// Its number, from 1.
    pub surface: usize,
    /// Its label; may be empty.
    pub label: String,
    /// Radius, mm, positive when the centre of curvature is to the right; `None` if plane.
    pub radius_mm: Option<f64>,
    /// Conic constant.
    pub conic: f64,
    /// Coefficients of `r^2`, `r^4`, ... `r^16` in `mm^-1`, `mm^-3`, ...
    pub asphere_a2_to_a16: Vec<f64>,
    /// Distance to the next vertex, mm.
    pub thickness_mm: f64,
    /// Name of the medium behind it.
    pub glass: String,
    /// Its index at the d line.
    pub nd: Option<f64>,
    /// Its Abbe number; `None` without dispersion.
    pub vd: Option<f64>,
    /// Clear semi-diameter, mm.
    pub semi_diameter_mm: f64,
    /// Whether it is the stop.
    pub stop: bool,
    /// Other properties, such as a mirror, a grating or a tilt, as lines of a lens file.
    pub special: Vec<String>,
}

impl Surface {
    /// Whether the medium behind it is air.
    pub fn is_before_air(&self) -> bool {
        self.vd.is_none() && self.nd == Some(1.0)
    }
}

/// The surfaces of a lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prescription {
    /// Name of the lens.
    pub name: String,
    /// In the order in which light meets them.
    pub surfaces: Vec<Surface>,
}

/// Reads the lens and nothing more: the prescription of a lens that [`run`] refuses may show why no light reaches its image.
pub fn prescription(request: &Request, context: &Context) -> Result<Prescription> {
    let (name, context) = &request.lens.placed(context)?;
    let lens = focused(context.assets.lens(name)?.lens, request.focus)?;
    Ok(Prescription { surfaces: surfaces(&lens), name: lens.name })
}

/// Computes the figures.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let (name, context) = &request.lens.placed(context)?;
    let lens = focused(context.assets.lens(name)?.lens, request.focus)?;
    let reference = lens.at_wavelength(lens.reference_um);
    let order = first_order(&reference);
    // Light that leaves parallel in both sections makes no image, and no spots.
    let spots = if leaves_parallel(&lens) == [true; 2] { Vec::new() } else { spots(name, &lens)? };
    let full_field = lens.outermost_field_deg().to_radians();
    let seidel = seidel_total(&reference, full_field)
        .map(|total| total.s)
        .map(|[s1, s2, s3, s4, s5]| Seidel { s1, s2, s3, s4, s5 });
    let reported_warnings = glass_warnings(&lens, context.assets.catalog()?.as_ref());
    let mut warnings = warnings(&lens, &order, &spots);
    match request.focus {
        FocusAt::File => warnings.extend(out_of_focus(name, &lens)),
        FocusAt::Best => warnings.extend(colours_out_of_focus(&lens)),
        FocusAt::Paraxial => {}
    }
    let relative_illumination = match axis_spot(&lens, &spots) {
        Some(axis) => spots.iter().map(|s| s.real_stop.value.relative_illumination(&axis)).collect(),
        None => {
            if !spots.is_empty() {
                warnings.push(
                    "no light of the axis reaches the image: illumination is relative to that of the paraxial entrance pupil"
                        .to_owned(),
                );
            }
            spots.iter().map(|s| s.real_stop.value.illumination.clone()).collect()
        }
    };
    warnings.extend(reported_warnings.iter().cloned());
    let table = first_order_table(&lens);
    let image_distance_mm = lens.image_distance_mm();
    Ok(Response {
        reported_warnings,
        figures: Figures {
            efl_mm: finite(order.efl_mm),
            bfl_mm: finite(order.bfl_mm),
            f_number: finite(order.f_number),
            epd_mm: lens.entrance_pupil_mm,
            object_distance_mm: match lens.object {
                ObjectDistance::Infinity => None,
                ObjectDistance::Finite(distance) => Some(distance),
            },
            magnification: table.magnification,
            image_na: table.image_na,
            working_f_number: table.working_f_number,
            angular_magnification: table.angular_magnification,
            total_track_mm: paraxial_image_mm(&lens)
                .and_then(|at_mm| finite(lens.with_image_distance(at_mm).track_mm())),
            is_folded: lens.is_folded(),
            image_distance_mm,
            defocus_mm: table.defocus_mm,
            entrance_pupil_from_first_vertex_mm: finite(order.entrance_pupil_at_mm),
            exit_pupil_from_last_vertex_mm: finite(order.exit_pupil_at_mm),
            exit_pupil_mm: finite(order.exit_pupil_mm),
            rms_spot_um: spots.iter().map(|s| Some(s.paraxial_pupil.as_ref()?.rms_um.clone())).collect(),
            rms_spot_poly_um: spots.iter().map(|s| Some(s.paraxial_pupil.as_ref()?.rms_poly_um)).collect(),
            rms_spot_real_stop_um: spots.iter().map(|s| s.real_stop.value.rms_um.clone()).collect(),
            rms_spot_poly_real_stop_um: spots.iter().map(|s| s.real_stop.value.rms_poly_um).collect(),
            relative_illumination,
            seidel,
            warnings,
            surfaces: surfaces(&lens),
            reference_um: lens.reference_um,
            wavelengths_um: lens.wavelengths_um,
            fields_deg: lens.fields_deg,
            name: lens.name,
            source: lens.source,
        },
    })
}

/// The spots of a field.
struct Spots {
    /// Through the real stop, on as many pupil cells as it needs.
    real_stop: Refined<FieldSpot>,
    /// Over the paraxial entrance pupil on the same cells; `None` if rays are lost.
    paraxial_pupil: Option<PrintedSpot>,
    /// The pupil cells of both.
    quadrature: Quadrature,
}

/// The spots of every field.
fn spots(name: &str, lens: &Lens) -> Result<Vec<Spots>> {
    let of_field = |field_deg: &f64| {
        let field = field_deg.to_radians();
        let real_stop = spot_converged(lens, field, &SPOTS).ok_or_else(|| {
            JobError::input(
                format!("{name}: {}", no_ray_at(lens, *field_deg)),
                "a surface is missed, or a clear semi-diameter blocks the whole beam",
            )
        })?;
        let quadrature = Quadrature::grid(real_stop.cells).map_err(|e| JobError::failed(e.to_string()))?;
        let paraxial_pupil = spot_paraxial_pupil(lens, field, &quadrature);
        Ok(Spots { real_stop, paraxial_pupil, quadrature })
    };
    lens.fields_deg.iter().map(of_field).collect()
}

/// The spot on the axis, to which illumination is relative, or of the field that stands for it; `None` if no light arrives there.
fn axis_spot(lens: &Lens, spots: &[Spots]) -> Option<FieldSpot> {
    let axis_deg = lens.reference_field_deg();
    let known = lens.fields_deg.iter().position(|field_deg| *field_deg == axis_deg);
    match known.and_then(|i| spots.get(i)) {
        Some(spots) => Some(spots.real_stop.value.clone()),
        None => Some(spot_converged(lens, axis_deg.to_radians(), &SPOTS)?.value),
    }
}

/// Warns of mirrors that would stand in the light of others.
pub(super) fn unshadowed(lens: &Lens) -> Option<String> {
    let mirrors = lens.surfaces.iter().filter(|s| s.action == Action::Reflect && s.placement.is_none());
    (mirrors.count() > 1)
        .then(|| "a mirror in front of another takes no light from it: there are no obscurations".to_owned())
}

/// Warns of first-order figures that hold in one section only.
pub(super) fn of_one_section(lens: &Lens) -> Option<String> {
    (!lens.is_rotationally_symmetric()).then(|| {
        "the lens is not rotationally symmetric: first-order figures and Seidel sums are those of its y-z section \
         with every surface on the axis"
            .to_owned()
    })
}

/// Says which field stands for the axis in a lens without a field near it.
pub(super) fn of_one_field(lens: &Lens) -> Option<String> {
    let field_deg = lens.reference_field_deg();
    (field_deg != 0.0).then(|| {
        format!(
            "the fields lie on one side of the axis: NA, working f-number and Airy disk are those of the nearest field, {} degrees, \
             and illumination is relative to it",
            shown_deg(field_deg)
        )
    })
}

/// A field as warnings show it, degrees: one that another program states as a height has all digits of an angle.
fn shown_deg(field_deg: f64) -> f64 {
    (field_deg * 1e4).round() / 1e4
}

/// Warns of what is odd about a lens that can be traced all the same.
fn warnings(lens: &Lens, order: &FirstOrder, spots: &[Spots]) -> Vec<String> {
    let mut found = Vec::new();
    let stop = &lens.surfaces[lens.stop];
    if stop.semi_diameter_mm < 0.99 * order.stop_radius_mm {
        found.push(format!(
            "an entrance pupil of {} mm needs a stop of {:.3} mm radius, the stop's clear semi-diameter is {} mm; \
             the entrance pupil counts",
            lens.entrance_pupil_mm, order.stop_radius_mm, stop.semi_diameter_mm
        ));
    }
    if stop.semi_diameter_mm > WIDE_STOP * order.stop_radius_mm.abs() {
        found.push(format!(
            "an entrance pupil of {} mm fills {:.4} mm of the stop's radius, its clear semi-diameter is {} mm; \
             the entrance pupil counts",
            lens.entrance_pupil_mm, order.stop_radius_mm, stop.semi_diameter_mm
        ));
    }
    found.extend(unshadowed(lens));
    let paraxial_image_mm = paraxial_image_mm(lens);
    found.extend(virtual_image(lens).map(str::to_owned));
    if !order.efl_mm.is_finite() {
        found.push("the lens is afocal in the y-z plane: it has no focal length".to_owned());
    } else if (lens.track_mm() / order.efl_mm).abs() < NEARLY_AFOCAL {
        let of_beams = if lens.object == ObjectDistance::Infinity && paraxial_image_mm.is_some() {
            "; light leaves it nearly parallel, and spots are little else than beam widths on the plane of the file"
        } else {
            ""
        };
        found.push(format!(
            "the lens is nearly afocal: its focal length is {:.0} times its length{of_beams}",
            (order.efl_mm / lens.track_mm()).abs()
        ));
    }
    if matches!(lens.object, ObjectDistance::Finite(_)) && paraxial_image_mm.is_none() {
        found.push(image_at_infinity(lens, order.image_distance_mm).to_owned());
    }
    if leaves_parallel(lens) == [true; 2] {
        found.push(
            "light leaves the lens parallel: it makes no image, and neither spots nor illumination are listed"
                .to_owned(),
        );
    } else if paraxial_image_mm.is_none() {
        found.push(
            "light leaves the lens parallel in its paraxial y-z section alone: spots are those of real rays on the plane of the file".to_owned(),
        );
    } else if !Cone::of(lens).is_real {
        let axis_deg = lens.reference_field_deg();
        let place = if axis_deg == 0.0 {
            "on the axis".to_owned()
        } else {
            format!("at {} degrees", shown_deg(axis_deg))
        };
        found.push(format!(
            "a ray through the rim of the stop is lost {place}: NA and working f-number are those of the paraxial \
             marginal ray"
        ));
    }
    found.extend(of_one_section(lens));
    found.extend(of_one_field(lens));
    let reference = lens.at_wavelength(lens.reference_um);
    for (field_deg, spots) in lens.fields_deg.iter().zip(spots) {
        let shown_deg = shown_deg(*field_deg);
        if !spots.real_stop.is_converged {
            found.push(format!(
                "at {shown_deg} degrees spot and illumination are uncertain by {:.1} %, on {} pupil cells a side",
                100.0 * spots.real_stop.error, spots.real_stop.cells
            ));
        }
        let beam = trace_beam(&reference, field_deg.to_radians(), order.stop_radius_mm, &spots.quadrature);
        let lost = beam.fate.iter().filter(|fate| !fate.reaches_image()).count();
        if lost > 0 {
            let share = 100.0 * lost as f64 / beam.fate.len() as f64;
            found.push(format!(
                "at {shown_deg} degrees {share:.1} % of the rays through the stop miss a surface or are totally \
                 reflected; spots and illumination are those of the rest"
            ));
        }
    }
    found
}

fn surfaces(lens: &Lens) -> Vec<Surface> {
    let surfaces = lens.surfaces.iter().enumerate().map(|(i, s)| {
        let [nd, vd] = s.glass.known_nd_and_vd();
        Surface {
            surface: i + 1,
            label: s.label.clone(),
            radius_mm: (s.shape.curvature != 0.0).then(|| 1.0 / s.shape.curvature),
            conic: s.shape.conic,
            asphere_a2_to_a16: s.shape.asphere.to_vec(),
            thickness_mm: s.thickness_mm,
            glass: s.glass.name.clone(),
            nd,
            vd,
            semi_diameter_mm: s.semi_diameter_mm,
            stop: i == lens.stop,
            special: special_lines(s).lines().map(str::to_owned).collect(),
        }
    });
    surfaces.collect()
}
