//! The structure of a glass table for serde, before its values are checked.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Deserialize;
use toml::Spanned;

use crate::toml_number::Number;

/// A number with its place in the file.
pub(super) type Placed = Spanned<Number>;

/// A table `[glass.NAME]`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(crate) struct GlassText {
    #[serde(default)]
    #[schemars(with = "Vec<String>")]
    pub(super) aliases: Vec<Spanned<String>>,
    #[serde(default)]
    pub(super) maker: String,
    #[serde(default)]
    pub(super) source: String,
    #[schemars(with = "Option<String>")]
    pub(super) status: Option<Spanned<String>>,
    #[schemars(with = "Option<f64>")]
    pub(super) nd: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub(super) vd: Option<Placed>,
    #[schemars(with = "Option<f64>")]
    pub(super) n: Option<Placed>,
    #[schemars(with = "Option<SellmeierText>")]
    pub(super) sellmeier: Option<Spanned<SellmeierText>>,
    #[schemars(with = "Option<[f64; 6]>")]
    pub(super) schott: Option<Spanned<[Number; 6]>>,
    #[schemars(with = "Option<SquareText>")]
    pub(super) square: Option<Spanned<SquareText>>,
    #[schemars(with = "Option<Vec<[f64; 2]>>")]
    pub(super) powers: Option<Spanned<Vec<[Number; 2]>>>,
    #[schemars(with = "Option<[f64; 6]>")]
    pub(super) herzberger: Option<Spanned<[Number; 6]>>,
    #[schemars(with = "Option<GasText>")]
    pub(super) gas: Option<Spanned<GasText>>,
    #[schemars(with = "Option<[f64; 4]>")]
    pub(super) lorentz_lorenz: Option<Spanned<[Number; 4]>>,
    #[schemars(with = "Option<[f64; 6]>")]
    pub(super) exotic: Option<Spanned<[Number; 6]>>,
    #[schemars(with = "Option<TableText>")]
    pub(super) table: Option<Spanned<TableText>>,
    #[schemars(with = "Option<[f64; 2]>")]
    pub(super) range_um: Option<Spanned<[Number; 2]>>,
    #[schemars(with = "Option<TransmissionText>")]
    pub(super) transmission: Option<Spanned<TransmissionText>>,
    #[schemars(with = "Option<ExtinctionText>")]
    pub(super) extinction: Option<Spanned<ExtinctionText>>,
    #[schemars(with = "Option<ThermalText>")]
    pub(super) thermal: Option<Spanned<ThermalText>>,
    #[serde(default)]
    #[schemars(with = "Vec<ExpansionText>")]
    pub(super) expansion: Vec<Spanned<ExpansionText>>,
    #[schemars(with = "Option<f64>")]
    pub(super) density_g_cm3: Option<Placed>,
    #[schemars(with = "Option<f64>")]
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
