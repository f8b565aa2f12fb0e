//! The structure of a glass table for serde, before its values are checked.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::spanned::Spanned;
use crate::toml_number::Number;

/// A number with its place in the file.
pub(super) type Placed = Spanned<Number>;

/// A table `[glass.NAME]`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(crate) struct GlassText {
    #[serde(default)]
    pub(super) aliases: Vec<Spanned<String>>,
    #[serde(default)]
    pub(super) maker: String,
    #[serde(default)]
    pub(super) source: String,
    pub(super) status: Option<Spanned<String>>,
    pub(super) nd: Option<Placed>,
    pub(super) vd: Option<Placed>,
    pub(super) n: Option<Placed>,
    pub(super) sellmeier: Option<Spanned<SellmeierText>>,
    pub(super) schott: Option<Spanned<[Number; 6]>>,
    pub(super) square: Option<Spanned<SquareText>>,
    pub(super) powers: Option<Spanned<Vec<[Number; 2]>>>,
    pub(super) herzberger: Option<Spanned<[Number; 6]>>,
    pub(super) gas: Option<Spanned<GasText>>,
    pub(super) lorentz_lorenz: Option<Spanned<[Number; 4]>>,
    pub(super) exotic: Option<Spanned<[Number; 6]>>,
    pub(super) table: Option<Spanned<TableText>>,
    pub(super) range_um: Option<Spanned<[Number; 2]>>,
    pub(super) transmission: Option<Spanned<TransmissionText>>,
    pub(super) extinction: Option<Spanned<ExtinctionText>>,
    pub(super) thermal: Option<Spanned<ThermalText>>,
    #[serde(default)]
    pub(super) expansion: Vec<Spanned<ExpansionText>>,
    pub(super) density_g_cm3: Option<Placed>,
    pub(super) relative_cost: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ b = [...], c_um2 = [...] }")]
pub(super) struct SellmeierText {
    pub b: Vec<Number>,
    pub c_um2: Vec<Number>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ powers = [[a, p], ...], resonances = [[b, q, c, r], ...] }")]
pub(super) struct SquareText {
    #[serde(default)]
    pub powers: Vec<[Number; 2]>,
    #[serde(default)]
    pub resonances: Vec<[Number; 4]>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ a = ..., terms = [[b, c], ...] }")]
pub(super) struct GasText {
    pub a: Number,
    pub terms: Vec<[Number; 2]>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ wavelength_um = [...], index = [...] }")]
pub(super) struct TableText {
    pub wavelength_um: Vec<Number>,
    pub index: Vec<Number>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(
    deny_unknown_fields,
    expecting = "{ thickness_mm = ..., wavelength_um = [...], transmittance = [...] }"
)]
pub(super) struct TransmissionText {
    pub thickness_mm: Thickness,
    pub wavelength_um: Vec<Number>,
    pub transmittance: Vec<Number>,
}

/// One thickness for all rows, or one per row.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a thickness in mm, or one for each wavelength")]
pub(super) enum Thickness {
    All(Number),
    Each(Vec<Number>),
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ wavelength_um = [...], k = [...] }")]
pub(super) struct ExtinctionText {
    pub wavelength_um: Vec<Number>,
    pub k: Vec<Number>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(
    deny_unknown_fields,
    expecting = "{ d = [d0, d1, d2], e = [e0, e1], lambda_tk_um = ..., reference_c = ... }"
)]
pub(super) struct ThermalText {
    pub d: [Number; 3],
    pub e: [Number; 2],
    pub lambda_tk_um: Number,
    pub reference_c: Number,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ range_c = [from, to], per_k = ... }")]
pub(super) struct ExpansionText {
    pub range_c: [Number; 2],
    pub per_k: Number,
}

/// Glass tables by name; the names have their place in the file.
pub(crate) type GlassTables = BTreeMap<Spanned<String>, GlassText>;
