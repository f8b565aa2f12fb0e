//! The structure of a lens file for serde, before its values are checked.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::glass_toml::GlassTables;
use crate::spanned::Spanned;
use crate::toml_number::Number;

/// A number with its place in the file.
pub(super) type Placed = Spanned<Number>;

/// A lens.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct LensText {
    /// Name of the lens in tables and reports.
    pub name: String,
    /// Where the numbers of the lens come from.
    #[serde(default)]
    pub source: String,
    /// Always "mm": a file in inches cannot be read as mm.
    pub units: Spanned<String>,
    /// The aperture.
    pub aperture: ApertureText,
    /// A near object; without the table the object is far away.
    pub object: Option<ObjectText>,
    /// Wavelengths at which the lens is evaluated.
    pub wavelengths: WavelengthsText,
    /// Fields at which the lens is evaluated.
    pub fields: FieldsText,
    /// Glasses of the file, `[glass.NAME]`, with the keys of a glass catalogue.
    #[serde(default)]
    pub glass: GlassTables,
    /// The surfaces, in the order of the light.
    pub surface: Vec<Spanned<SurfaceText>>,
    /// Numbers that an optimisation may change, with their bounds.
    #[serde(default)]
    pub variable: Vec<VariableText>,
    /// Numbers that follow those of another surface.
    #[serde(default)]
    pub pickup: Vec<PickupText>,
    /// Numbers that keep a property of the lens.
    pub solve: Option<SolveText>,
    /// Published properties, with which the tests of built-in lenses compare; nothing else reads them.
    pub expect: Option<ExpectText>,
}

/// The aperture of a lens.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ApertureText {
    /// Diameter of the paraxial entrance pupil at the reference wavelength. Unit: mm.
    pub entrance_pupil_diameter_mm: Placed,
}

/// A near object.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ObjectText {
    /// From the object to the first vertex; negative for a virtual object, `inf` for a far one. Unit: mm.
    pub distance_mm: Placed,
}

/// Wavelengths of a lens.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct WavelengthsText {
    /// Wavelengths, ascending, 0.2 to 20. Unit: um.
    pub um: Spanned<Vec<Placed>>,
    /// Wavelength of first-order properties and of the reference chief ray; 0.5876 if it is left out. Unit: um.
    pub reference_um: Option<Placed>,
}

/// Fields of a lens.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct FieldsText {
    /// Field angles, ascending, from 0 to below 90; for a near object, the angle of the object point as seen from the first vertex. Negative angles are for lenses without rotational symmetry. Unit: degrees.
    pub angle_deg: Spanned<Vec<Placed>>,
    /// Weights of the fields in `lens optimize`, one per angle; all the same if they are left out.
    pub weight: Option<Spanned<Vec<Placed>>>,
}

/// A surface.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SurfaceText {
    /// Name of the surface.
    #[serde(default)]
    pub label: String,
    /// Radius of curvature at the vertex, `inf` for a plane; this or `curvature_per_mm`. Unit: mm.
    pub radius_mm: Option<Placed>,
    /// Curvature at the vertex, in place of the radius. Unit: 1/mm.
    pub curvature_per_mm: Option<Placed>,
    /// Conic constant: 0 for a sphere, -1 for a paraboloid.
    pub conic: Option<Placed>,
    /// Coefficients of even powers of r.
    #[serde(default)]
    pub asphere: AsphereText,
    /// Coefficients `b1`, `b3`, ... `b15` of odd powers of r, in mm^(1-n); `b1` makes the vertex the tip of a cone.
    pub odd: Option<Spanned<Terms>>,
    /// An XY polynomial up to total degree 8: `norm_radius_mm`, and coefficients `x0y1`, `x1y0`, ... in mm.
    pub xy: Option<Spanned<Terms>>,
    /// Forbes's slope-orthogonal polynomials about the best-fit sphere.
    pub q_bfs: Option<Spanned<ForbesText>>,
    /// Forbes's polynomials about a conic.
    pub q_con: Option<Spanned<ForbesText>>,
    /// Another conic in the x-z section; `radius_mm` and `conic` describe the y-z section.
    pub biconic: Option<Spanned<BiconicText>>,
    /// The y-z section turned about an axis along y.
    pub toroid: Option<Spanned<ToroidText>>,
    /// Distance to the next vertex; that of the last surface reaches to the image plane. Unit: mm.
    pub thickness_mm: Placed,
    /// The medium behind the surface; air if it is left out.
    pub glass: Option<Spanned<String>>,
    /// Clear semi-diameter, beyond which light is lost. Left out, the surface is made large enough for the beams of all fields, and cuts none. Unit: mm.
    pub semi_diameter_mm: Option<Placed>,
    /// `true` where light beyond the clear semi-diameter passes: it is a size for drawings and edges alone. It grows for the beams of all fields.
    pub open: Option<Spanned<bool>>,
    /// `true` on exactly one surface, the aperture stop.
    pub stop: Option<Spanned<bool>>,
    /// `true` for a mirror. Distances behind an odd number of mirrors are negative.
    pub mirror: Option<Spanned<bool>>,
    /// A plane that acts as a thin lens without aberrations.
    pub thin_lens: Option<Spanned<ThinLensText>>,
    /// A grating of straight lines along x.
    pub grating: Option<Spanned<GratingText>>,
    /// A radial phase `A1 v + A2 v^2 + ...` with `v = (r / norm_radius_mm)^2`.
    pub binary: Option<Spanned<BinaryText>>,
    /// A shift and a tilt of the surface.
    pub placement: Option<Spanned<PlacementText>>,
}

/// Coefficients by name.
pub(super) type Terms = BTreeMap<String, Placed>;

/// A Forbes asphere.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ norm_radius_mm = ..., a = [...] }")]
pub(super) struct ForbesText {
    /// Radius at which the polynomials are normalised. Unit: mm.
    pub norm_radius_mm: Placed,
    /// Up to 13 coefficients. Unit: mm.
    pub a: Spanned<Vec<Placed>>,
}

/// The x-z section of a biconic.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ radius_x_mm = ... }")]
pub(super) struct BiconicText {
    /// Radius of curvature in the x-z section; `inf` makes it straight. Unit: mm.
    pub radius_x_mm: Option<Placed>,
    /// Its curvature, in place of the radius. Unit: 1/mm.
    pub curvature_x_per_mm: Option<Placed>,
    /// Its conic constant.
    pub conic_x: Option<Placed>,
}

/// The x-z section of a toroid, a circle.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ radius_x_mm = ... }")]
pub(super) struct ToroidText {
    /// Radius of the turn about the axis along y; `inf` makes a cylinder. Unit: mm.
    pub radius_x_mm: Option<Placed>,
    /// Its curvature, in place of the radius. Unit: 1/mm.
    pub curvature_x_per_mm: Option<Placed>,
    /// Read for an error that says what has one; no part of the format.
    #[schemars(skip)]
    pub conic_x: Option<Placed>,
}

/// A thin lens without aberrations.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ focal_length_mm = ... }")]
pub(super) struct ThinLensText {
    /// Focal length. Unit: mm.
    pub focal_length_mm: Option<Placed>,
    /// Power, in place of the focal length. Unit: 1/mm.
    pub power_per_mm: Option<Placed>,
}

/// A grating.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ lines_per_mm = ..., order = ... }")]
pub(super) struct GratingText {
    /// Lines per mm, seen along the axis. Unit: 1/mm.
    pub lines_per_mm: Placed,
    /// Order of diffraction.
    pub order: i32,
}

/// A diffractive surface with a radial phase.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ norm_radius_mm = ..., order = ..., a_rad = [...] }")]
pub(super) struct BinaryText {
    /// Radius at which v is 1. Unit: mm.
    pub norm_radius_mm: Placed,
    /// Order of diffraction.
    pub order: i32,
    /// Coefficients of the phase. Unit: rad.
    pub a_rad: Spanned<Vec<Placed>>,
}

/// A placement: the vertex is shifted, then the surface is turned about its own x, y and z.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ decenter_mm = [x, y], tilt_deg = [x, y, z], axis = ... }")]
pub(super) struct PlacementText {
    /// Shift along x and y. Unit: mm.
    pub decenter_mm: Option<Spanned<Vec<Placed>>>,
    /// Turns about x, y and z. Unit: degrees.
    pub tilt_deg: Option<Spanned<Vec<Placed>>>,
    /// The same in radians. Unit: rad.
    pub tilt_rad: Option<Spanned<Vec<Placed>>>,
    /// The axis behind the surface: it "returns" (the default), "follows" the surface, or "bends" as a mirror reflects it.
    pub axis: Option<Spanned<String>>,
}

/// Coefficients of r^2, r^4, ..., r^16 in mm^(1-n).
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ a4 = ..., a6 = ... }")]
pub(super) struct AsphereText {
    /// Coefficient of r^2. Unit: mm^-1.
    pub a2: Option<Placed>,
    /// Coefficient of r^4. Unit: mm^-3.
    pub a4: Option<Placed>,
    /// Coefficient of r^6. Unit: mm^-5.
    pub a6: Option<Placed>,
    /// Coefficient of r^8. Unit: mm^-7.
    pub a8: Option<Placed>,
    /// Coefficient of r^10. Unit: mm^-9.
    pub a10: Option<Placed>,
    /// Coefficient of r^12. Unit: mm^-11.
    pub a12: Option<Placed>,
    /// Coefficient of r^14. Unit: mm^-13.
    pub a14: Option<Placed>,
    /// Coefficient of r^16. Unit: mm^-15.
    pub a16: Option<Placed>,
}

impl AsphereText {
    /// The terms in ascending order.
    pub fn terms(&self) -> [&Option<Placed>; petzval_optics::lens::ASPHERE_TERMS] {
        [&self.a2, &self.a4, &self.a6, &self.a8, &self.a10, &self.a12, &self.a14, &self.a16]
    }
}

/// A number that an optimisation may change.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct VariableText {
    /// Number of the surface, from 1.
    pub surface: Spanned<usize>,
    /// The number: `radius_mm`, `curvature_per_mm`, `conic`, `thickness_mm`, `a2` to `a16`, or one of a special surface such as `xy.x2y0`.
    pub parameter: Spanned<String>,
    /// Least value, in the unit of the parameter.
    pub min: Placed,
    /// Greatest value, in the unit of the parameter.
    pub max: Placed,
}

/// Numbers that keep a property of the lens.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SolveText {
    /// The curvature of a surface keeps the focal length.
    pub efl: Option<EflSolveText>,
    /// The curvature of a surface keeps the magnification of a near object; this or `efl`.
    pub magnification: Option<MagnificationSolveText>,
    /// The gap behind a surface keeps the length of the lens.
    pub length: Option<LengthSolveText>,
}

/// A gap that keeps the length of the lens.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ surface = ..., length_mm = ... }")]
pub(super) struct LengthSolveText {
    /// Number of the surface, from 1.
    pub surface: Spanned<usize>,
    /// Distance from the first vertex to the last; negative if mirrors make it so. Unit: mm.
    pub length_mm: Placed,
}

/// A number that follows another.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct PickupText {
    /// Number of the surface that follows, from 1.
    pub surface: Spanned<usize>,
    /// Number of the surface that it follows, from 1.
    pub follows: Spanned<usize>,
    /// The number, by the same name in both surfaces; for a radius, scale and offset act on the curvature.
    pub parameter: Spanned<String>,
    /// Factor; 1 if it is left out.
    pub scale: Option<Placed>,
    /// Added after the factor, in the unit of the number; 0 if it is left out.
    pub offset: Option<Placed>,
}

/// A curvature that keeps the focal length.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ surface = ..., efl_mm = ... }")]
pub(super) struct EflSolveText {
    /// Number of the surface, from 1.
    pub surface: Spanned<usize>,
    /// Focal length. Unit: mm.
    pub efl_mm: Placed,
    /// Bounds of the radius, which a design keeps by a penalty. Unit: mm.
    pub radius_mm: Option<Spanned<[f64; 2]>>,
}

/// A curvature that keeps the magnification of a near object.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ surface = ..., magnification = ... }")]
pub(super) struct MagnificationSolveText {
    /// Number of the surface, from 1.
    pub surface: Spanned<usize>,
    /// Paraxial magnification, negative for an inverted image.
    pub magnification: Placed,
    /// Bounds of the radius, which a design keeps by a penalty. Unit: mm.
    pub radius_mm: Option<Spanned<[f64; 2]>>,
}

/// Published properties of a lens.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ExpectText {
    /// Focal length. Unit: mm.
    pub efl_mm: Option<ExpectedText>,
    /// Back focal length. Unit: mm.
    pub bfl_mm: Option<ExpectedText>,
    /// F-number.
    pub f_number: Option<ExpectedText>,
    /// Track. Unit: mm.
    pub total_track_mm: Option<ExpectedText>,
    /// RMS spot radii. Unit: um.
    pub rms_spot_um: Option<ExpectedSpotsText>,
}

/// A value with its tolerance.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ value = ..., tolerance = ... }")]
pub(super) struct ExpectedText {
    /// The value.
    pub value: Placed,
    /// How far it may be off, either way.
    pub tolerance: Placed,
}

/// Spots with their tolerance.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ values = [...], relative_tolerance = ... }")]
pub(super) struct ExpectedSpotsText {
    /// RMS spot radius of each field. Unit: um.
    pub values: Spanned<Vec<Placed>>,
    /// How far each may be off, as a share of itself.
    pub relative_tolerance: Placed,
}
