//! The structure of a lens file for serde, before its values are checked.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use crate::glass_toml::GlassTables;
use crate::toml_number::Number;

/// A number with its place in the file.
pub(super) type Placed = Spanned<Number>;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct LensText {
    pub name: String,
    #[serde(default)]
    pub source: String,
    #[schemars(with = "String")]
    pub units: Spanned<String>,
    pub aperture: ApertureText,
    pub object: Option<ObjectText>,
    pub wavelengths: WavelengthsText,
    pub fields: FieldsText,
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, crate::glass_toml::GlassText>")]
    pub glass: GlassTables,
    #[schemars(with = "Vec<SurfaceText>")]
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
    #[schemars(with = "f64")]
    pub entrance_pupil_diameter_mm: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ObjectText {
    #[schemars(with = "f64")]
    pub distance_mm: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct WavelengthsText {
    #[schemars(with = "Vec<f64>")]
    pub um: Spanned<Vec<Placed>>,
    #[schemars(with = "Option<f64>")]
    pub reference_um: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct FieldsText {
    #[schemars(with = "Vec<f64>")]
    pub angle_deg: Spanned<Vec<Placed>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SurfaceText {
    #[serde(default)]
    pub label: String,
    #[schemars(with = "Option<f64>")]
    pub radius_mm: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub curvature_per_mm: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub conic: Option<Placed>,
    #[serde(default)]
    pub asphere: AsphereText,
    #[schemars(with = "Option<BTreeMap<String, f64>>")]
    pub odd: Option<Spanned<Terms>>,
    #[schemars(with = "Option<BTreeMap<String, f64>>")]
    pub xy: Option<Spanned<Terms>>,
    #[schemars(with = "Option<ForbesText>")]
    pub q_bfs: Option<Spanned<ForbesText>>,
    #[schemars(with = "Option<ForbesText>")]
    pub q_con: Option<Spanned<ForbesText>>,
    #[schemars(with = "Option<SectionText>")]
    pub biconic: Option<Spanned<SectionText>>,
    #[schemars(with = "Option<SectionText>")]
    pub toroid: Option<Spanned<SectionText>>,
    #[schemars(with = "f64")]
    pub thickness_mm: Placed,
    #[schemars(with = "Option<String>")]
    pub glass: Option<Spanned<String>>,
    /// Left out, the surface is made large enough for the beams of all fields.
    #[schemars(with = "Option<f64>")]
    pub semi_diameter_mm: Option<Placed>,
    #[schemars(with = "Option<bool>")]
    pub stop: Option<Spanned<bool>>,
    #[schemars(with = "Option<bool>")]
    pub mirror: Option<Spanned<bool>>,
    #[schemars(with = "Option<ThinLensText>")]
    pub thin_lens: Option<Spanned<ThinLensText>>,
    #[schemars(with = "Option<GratingText>")]
    pub grating: Option<Spanned<GratingText>>,
    #[schemars(with = "Option<BinaryText>")]
    pub binary: Option<Spanned<BinaryText>>,
    #[schemars(with = "Option<PlacementText>")]
    pub placement: Option<Spanned<PlacementText>>,
}

/// Coefficients by name.
pub(super) type Terms = BTreeMap<String, Placed>;

/// A Forbes asphere.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ norm_radius_mm = ..., a = [...] }")]
pub(super) struct ForbesText {
    #[schemars(with = "f64")]
    pub norm_radius_mm: Placed,
    #[schemars(with = "Vec<f64>")]
    pub a: Spanned<Vec<Placed>>,
}

/// The x-z section of a biconic or a toroid.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ radius_x_mm = ... }")]
pub(super) struct SectionText {
    #[schemars(with = "Option<f64>")]
    pub radius_x_mm: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub curvature_x_per_mm: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub conic_x: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ focal_length_mm = ... }")]
pub(super) struct ThinLensText {
    #[schemars(with = "Option<f64>")]
    pub focal_length_mm: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub power_per_mm: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ lines_per_mm = ..., order = ... }")]
pub(super) struct GratingText {
    #[schemars(with = "f64")]
    pub lines_per_mm: Placed,
    pub order: i32,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ norm_radius_mm = ..., order = ..., a_rad = [...] }")]
pub(super) struct BinaryText {
    #[schemars(with = "f64")]
    pub norm_radius_mm: Placed,
    pub order: i32,
    #[schemars(with = "Vec<f64>")]
    pub a_rad: Spanned<Vec<Placed>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ decenter_mm = [x, y], tilt_deg = [x, y, z], axis = ... }")]
pub(super) struct PlacementText {
    #[schemars(with = "Option<Vec<f64>>")]
    pub decenter_mm: Option<Spanned<Vec<Placed>>>,
    #[schemars(with = "Option<Vec<f64>>")]
    pub tilt_deg: Option<Spanned<Vec<Placed>>>,
    #[schemars(with = "Option<Vec<f64>>")]
    pub tilt_rad: Option<Spanned<Vec<Placed>>>,
    #[schemars(with = "Option<String>")]
    pub axis: Option<Spanned<String>>,
}

/// Coefficients of r^2, r^4, ..., r^16 in mm^(1-n).
#[derive(Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ a4 = ..., a6 = ... }")]
pub(super) struct AsphereText {
    #[schemars(with = "Option<f64>")]
    pub a2: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub a4: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub a6: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub a8: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub a10: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub a12: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub a14: Option<Placed>,
    #[schemars(with = "Option<f64>")]
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
    #[schemars(with = "usize")]
    pub surface: Spanned<usize>,
    #[schemars(with = "String")]
    pub parameter: Spanned<String>,
    #[schemars(with = "f64")]
    pub min: Placed,
    #[schemars(with = "f64")]
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
    #[schemars(with = "usize")]
    pub surface: Spanned<usize>,
    #[schemars(with = "f64")]
    pub length_mm: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct PickupText {
    #[schemars(with = "usize")]
    pub surface: Spanned<usize>,
    #[schemars(with = "usize")]
    pub follows: Spanned<usize>,
    #[schemars(with = "String")]
    pub parameter: Spanned<String>,
    #[schemars(with = "Option<f64>")]
    pub scale: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub offset: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ surface = ..., efl_mm = ... }")]
pub(super) struct EflSolveText {
    #[schemars(with = "usize")]
    pub surface: Spanned<usize>,
    #[schemars(with = "f64")]
    pub efl_mm: Placed,
    #[schemars(with = "Option<[f64; 2]>")]
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
    #[schemars(with = "f64")]
    pub value: Placed,
    #[schemars(with = "f64")]
    pub tolerance: Placed,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ values = [...], relative_tolerance = ... }")]
pub(super) struct ExpectedSpotsText {
    #[schemars(with = "Vec<f64>")]
    pub values: Spanned<Vec<Placed>>,
    #[schemars(with = "f64")]
    pub relative_tolerance: Placed,
}
