//! The structure of a lens file for serde, before its values are checked.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::glass_toml::GlassTables;
use crate::spanned::Spanned;
use crate::toml_number::Number;

/// A number with its place in the file.
pub(super) type Placed = Spanned<Number>;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct LensText {
    pub name: String,
    #[serde(default)]
    pub source: String,
    pub units: Spanned<String>,
    pub aperture: ApertureText,
    pub object: Option<ObjectText>,
    pub wavelengths: WavelengthsText,
    pub fields: FieldsText,
    #[serde(default)]
    pub glass: GlassTables,
    pub surface: Vec<Spanned<SurfaceText>>,
    #[serde(default)]
    pub variable: Vec<VariableText>,
    #[serde(default)]
    pub pickup: Vec<PickupText>,
    pub solve: Option<SolveText>,
    pub expect: Option<ExpectText>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ApertureText {
    pub entrance_pupil_diameter_mm: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ObjectText {
    pub distance_mm: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct WavelengthsText {
    pub um: Spanned<Vec<Placed>>,
    pub reference_um: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct FieldsText {
    pub angle_deg: Spanned<Vec<Placed>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SurfaceText {
    #[serde(default)]
    pub label: String,
    pub radius_mm: Option<Placed>,
    pub curvature_per_mm: Option<Placed>,
    pub conic: Option<Placed>,
    #[serde(default)]
    pub asphere: AsphereText,
    pub odd: Option<Spanned<Terms>>,
    pub xy: Option<Spanned<Terms>>,
    pub q_bfs: Option<Spanned<ForbesText>>,
    pub q_con: Option<Spanned<ForbesText>>,
    pub biconic: Option<Spanned<SectionText>>,
    pub toroid: Option<Spanned<SectionText>>,
    pub thickness_mm: Placed,
    pub glass: Option<Spanned<String>>,
    /// Left out, the surface is made large enough for the beams of all fields.
    pub semi_diameter_mm: Option<Placed>,
    pub stop: Option<Spanned<bool>>,
    pub mirror: Option<Spanned<bool>>,
    pub thin_lens: Option<Spanned<ThinLensText>>,
    pub grating: Option<Spanned<GratingText>>,
    pub binary: Option<Spanned<BinaryText>>,
    pub placement: Option<Spanned<PlacementText>>,
}

/// Coefficients by name.
pub(super) type Terms = BTreeMap<String, Placed>;

/// A Forbes asphere.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ norm_radius_mm = ..., a = [...] }")]
pub(super) struct ForbesText {
    pub norm_radius_mm: Placed,
    pub a: Spanned<Vec<Placed>>,
}

/// The x-z section of a biconic or a toroid.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ radius_x_mm = ... }")]
pub(super) struct SectionText {
    pub radius_x_mm: Option<Placed>,
    pub curvature_x_per_mm: Option<Placed>,
    pub conic_x: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ focal_length_mm = ... }")]
pub(super) struct ThinLensText {
    pub focal_length_mm: Option<Placed>,
    pub power_per_mm: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ lines_per_mm = ..., order = ... }")]
pub(super) struct GratingText {
    pub lines_per_mm: Placed,
    pub order: i32,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ norm_radius_mm = ..., order = ..., a_rad = [...] }")]
pub(super) struct BinaryText {
    pub norm_radius_mm: Placed,
    pub order: i32,
    pub a_rad: Spanned<Vec<Placed>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ decenter_mm = [x, y], tilt_deg = [x, y, z], axis = ... }")]
pub(super) struct PlacementText {
    pub decenter_mm: Option<Spanned<Vec<Placed>>>,
    pub tilt_deg: Option<Spanned<Vec<Placed>>>,
    pub tilt_rad: Option<Spanned<Vec<Placed>>>,
    pub axis: Option<Spanned<String>>,
}

/// Coefficients of r^2, r^4, ..., r^16 in mm^(1-n).
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ a4 = ..., a6 = ... }")]
pub(super) struct AsphereText {
    pub a2: Option<Placed>,
    pub a4: Option<Placed>,
    pub a6: Option<Placed>,
    pub a8: Option<Placed>,
    pub a10: Option<Placed>,
    pub a12: Option<Placed>,
    pub a14: Option<Placed>,
    pub a16: Option<Placed>,
}

impl AsphereText {
    /// The terms in ascending order.
    pub fn terms(&self) -> [&Option<Placed>; petzval_optics::lens::ASPHERE_TERMS] {
        [&self.a2, &self.a4, &self.a6, &self.a8, &self.a10, &self.a12, &self.a14, &self.a16]
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct VariableText {
    pub surface: Spanned<usize>,
    pub parameter: Spanned<String>,
    pub min: Placed,
    pub max: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SolveText {
    pub efl: Option<EflSolveText>,
    pub length: Option<LengthSolveText>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ surface = ..., length_mm = ... }")]
pub(super) struct LengthSolveText {
    pub surface: Spanned<usize>,
    pub length_mm: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct PickupText {
    pub surface: Spanned<usize>,
    pub follows: Spanned<usize>,
    pub parameter: Spanned<String>,
    pub scale: Option<Placed>,
    pub offset: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ surface = ..., efl_mm = ... }")]
pub(super) struct EflSolveText {
    pub surface: Spanned<usize>,
    pub efl_mm: Placed,
    pub radius_mm: Option<Spanned<[f64; 2]>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ExpectText {
    pub efl_mm: Option<ExpectedText>,
    pub bfl_mm: Option<ExpectedText>,
    pub f_number: Option<ExpectedText>,
    pub total_track_mm: Option<ExpectedText>,
    pub rms_spot_um: Option<ExpectedSpotsText>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ value = ..., tolerance = ... }")]
pub(super) struct ExpectedText {
    pub value: Placed,
    pub tolerance: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ values = [...], relative_tolerance = ... }")]
pub(super) struct ExpectedSpotsText {
    pub values: Spanned<Vec<Placed>>,
    pub relative_tolerance: Placed,
}
