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
    /// Further names; no name may occur twice in a file.
    #[serde(default)]
    pub(super) aliases: Vec<Spanned<String>>,
    /// Who makes it.
    #[serde(default)]
    pub(super) maker: String,
    /// Where the figures come from, or the maker's remark.
    #[serde(default)]
    pub(super) source: String,
    /// "preferred", "standard", "special", "obsolete" or "melt".
    pub(super) status: Option<Spanned<String>>,
    /// Index of the d line: with `vd` alone the glass has a Cauchy formula through both, beside a formula the printed value.
    pub(super) nd: Option<Placed>,
    /// Abbe number of the d line.
    pub(super) vd: Option<Placed>,
    /// The same index at every wavelength.
    pub(super) n: Option<Placed>,
    /// `n^2 = 1 + sum_i b_i w^2 / (w^2 - c_i)`, with the wavelength w in um.
    pub(super) sellmeier: Option<Spanned<SellmeierText>>,
    /// `n^2 = a0 + a1 w^2 + a2 w^-2 + a3 w^-4 + a4 w^-6 + a5 w^-8`.
    pub(super) schott: Option<Spanned<[Number; 6]>>,
    /// `n^2 = sum_i a_i w^p_i + sum_j b_j w^q_j / (w^2 - c_j^r_j)`.
    pub(super) square: Option<Spanned<SquareText>>,
    /// `n = sum_i a_i w^p_i`, as pairs `[a, p]`.
    pub(super) powers: Option<Spanned<Vec<[Number; 2]>>>,
    /// `n = a0 + a1 L + a2 L^2 + a3 w^2 + a4 w^4 + a5 w^6` with `L = 1 / (w^2 - 0.028)`.
    pub(super) herzberger: Option<Spanned<[Number; 6]>>,
    /// `n = 1 + a + sum_i b_i / (c_i - w^-2)`.
    pub(super) gas: Option<Spanned<GasText>>,
    /// `(n^2 - 1) / (n^2 + 2) = a0 + a1 w^2 / (w^2 - a2) + a3 w^2`.
    pub(super) lorentz_lorenz: Option<Spanned<[Number; 4]>>,
    /// `n^2 = a0 + a1 / (w^2 - a2) + a3 (w - a4) / ((w - a4)^2 + a5)`.
    pub(super) exotic: Option<Spanned<[Number; 6]>>,
    /// Measured indices: linear between the points, constant beyond them.
    pub(super) table: Option<Spanned<TableText>>,
    /// Where the formula holds; a lens that uses other wavelengths gives a warning. Unit: um.
    pub(super) range_um: Option<Spanned<[Number; 2]>>,
    /// Internal transmittance, without the reflections at the faces.
    pub(super) transmission: Option<Spanned<TransmissionText>>,
    /// The same as extinction coefficient; the absorption is `4 pi k / w`.
    pub(super) extinction: Option<Spanned<ExtinctionText>>,
    /// Change of the index with temperature, by Schott's formula.
    pub(super) thermal: Option<Spanned<ThermalText>>,
    /// Mean linear expansion between two temperatures.
    #[serde(default)]
    pub(super) expansion: Vec<Spanned<ExpansionText>>,
    /// Density. Unit: g/cm^3.
    pub(super) density_g_cm3: Option<Placed>,
    /// Price relative to the maker's reference glass.
    pub(super) relative_cost: Option<Placed>,
}

/// Sellmeier's formula.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ b = [...], c_um2 = [...] }")]
pub(super) struct SellmeierText {
    /// Strengths.
    pub b: Vec<Number>,
    /// Squares of the resonance wavelengths. Unit: um^2.
    pub c_um2: Vec<Number>,
}

/// Powers and resonances of the square of the index.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ powers = [[a, p], ...], resonances = [[b, q, c, r], ...] }")]
pub(super) struct SquareText {
    /// Pairs `[a, p]`.
    #[serde(default)]
    pub powers: Vec<[Number; 2]>,
    /// Rows `[b, q, c, r]`.
    #[serde(default)]
    pub resonances: Vec<[Number; 4]>,
}

/// The formula of gases.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ a = ..., terms = [[b, c], ...] }")]
pub(super) struct GasText {
    /// The constant.
    pub a: Number,
    /// Pairs `[b, c]`.
    pub terms: Vec<[Number; 2]>,
}

/// Measured indices.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ wavelength_um = [...], index = [...] }")]
pub(super) struct TableText {
    /// Wavelengths, ascending. Unit: um.
    pub wavelength_um: Vec<Number>,
    /// Index at each.
    pub index: Vec<Number>,
}

/// Internal transmittance.
#[derive(Deserialize, JsonSchema)]
#[serde(
    deny_unknown_fields,
    expecting = "{ thickness_mm = ..., wavelength_um = [...], transmittance = [...] }"
)]
pub(super) struct TransmissionText {
    /// Thickness of the sample, or one for each wavelength. Unit: mm.
    pub thickness_mm: Thickness,
    /// Wavelengths, ascending. Unit: um.
    pub wavelength_um: Vec<Number>,
    /// Transmittance at each, 0 to 1.
    pub transmittance: Vec<Number>,
}

/// One thickness for all rows, or one per row.
#[derive(Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a thickness in mm, or one for each wavelength")]
pub(super) enum Thickness {
    All(Number),
    Each(Vec<Number>),
}

/// Extinction coefficients.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ wavelength_um = [...], k = [...] }")]
pub(super) struct ExtinctionText {
    /// Wavelengths, ascending. Unit: um.
    pub wavelength_um: Vec<Number>,
    /// Extinction coefficient at each.
    pub k: Vec<Number>,
}

/// Schott's formula of the index over temperature.
#[derive(Deserialize, JsonSchema)]
#[serde(
    deny_unknown_fields,
    expecting = "{ d = [d0, d1, d2], e = [e0, e1], lambda_tk_um = ..., reference_c = ... }"
)]
pub(super) struct ThermalText {
    /// D0, D1 and D2.
    pub d: [Number; 3],
    /// E0 and E1.
    pub e: [Number; 2],
    /// The resonance wavelength. Unit: um.
    pub lambda_tk_um: Number,
    /// Temperature of the formula of the index. Unit: degrees Celsius.
    pub reference_c: Number,
}

/// Linear expansion.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "{ range_c = [from, to], per_k = ... }")]
pub(super) struct ExpansionText {
    /// From and to. Unit: degrees Celsius.
    pub range_c: [Number; 2],
    /// Mean expansion. Unit: 1/K.
    pub per_k: Number,
}

/// Glass tables by name; the names have their place in the file.
pub(crate) type GlassTables = BTreeMap<Spanned<String>, GlassText>;
