//! `glass show`: all that is known of a glass.

use petzval_files::write_catalog;
use petzval_optics::glass::{Glass, LINE_C_UM, LINE_D_UM, LINE_F_UM, LINE_G_UM};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{at_lines, named, p_gf, status};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::range::check_ranges;

/// Path of [`Line::transmission_10_mm`], mm.
pub const PATH_MM: f64 = 10.0;

/// Spectral lines at which catalogues print indices: letter, um.
const LINES: [(&str, f64); 14] = [
    ("i", 0.365_014_6),
    ("h", 0.404_656_1),
    ("g", LINE_G_UM),
    ("F'", 0.479_991_4),
    ("F", LINE_F_UM),
    ("e", 0.546_074),
    ("d", LINE_D_UM),
    ("C'", 0.643_846_9),
    ("C", LINE_C_UM),
    ("r", 0.706_518_8),
    ("s", 0.852_11),
    ("t", 1.013_98),
    ("", 1.529_582),
    ("", 2.325_42),
];

/// Temperatures between which dn/dT is measured, as on data sheets, degrees Celsius.
pub const DN_DT_C: [f64; 2] = [20.0, 40.0];

/// The partial dispersion of ordinary glasses, through K7 and F2: `P_gF = 0.6438 - 0.001682 V_d`.
const NORMAL_LINE: [f64; 2] = [0.6438, -0.001682];

petzval_base::parameters! {
    /// Which glass to show, and in which air.
    pub struct Request {
        /// Temperature of the glass and of the air around it, degrees Celsius, -200 to 1000, for [`Line::index_at`].
        temperature: Option<f64> = None, "degrees Celsius", -200..1000, Linear, "degrees Celsius, -200 to 1000";
        /// Pressure of that air, atm, 0 (vacuum) to 100; 1 if left out. Needs a temperature.
        pressure: Option<f64> = None, "atm", 0..100, Linear, "atm, 0 to 100";
    }
    also {
        /// Its name, or `MAKER:NAME` where several makers have one of that name.
        name: String = String::new();
    }
}

/// All that is known of a glass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Its figures.
    pub glass: Figures,
    /// The printed index with all its digits.
    pub printed_nd: Option<String>,
    /// The printed Abbe number with all its digits.
    pub printed_vd: Option<String>,
}

/// Figures of a glass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Its name.
    pub name: String,
    /// Its maker; may be empty.
    pub maker: String,
    /// Where the figures are from; may be empty.
    pub source: String,
    /// How the maker offers it: preferred, standard, special, obsolete or melt.
    pub status: Option<String>,
    /// Index at the d line.
    pub nd: Option<f64>,
    /// Abbe number `(nd - 1) / (nF - nC)`; `None` without dispersion.
    pub vd: Option<f64>,
    /// Index at the F line.
    pub n_f: Option<f64>,
    /// Index at the C line.
    pub n_c: Option<f64>,
    /// Partial dispersion `(ng - nF) / (nF - nC)`; `None` without dispersion.
    pub p_gf: Option<f64>,
    /// Distance of the partial dispersion from the normal line.
    pub p_gf_anomaly: Option<f64>,
    /// The index that the maker prints.
    pub printed_nd: Option<f64>,
    /// The Abbe number that the maker prints.
    pub printed_vd: Option<f64>,
    /// Wavelengths between which the formula holds, um.
    pub range_um: Option<[f64; 2]>,
    /// Density, g/cm^3.
    pub density_g_cm3: Option<f64>,
    /// Price relative to the maker's reference glass.
    pub relative_cost: Option<f64>,
    /// Linear expansion by range of temperature.
    pub expansion: Vec<Expansion>,
    /// Temperature of [`Line::index_at`], degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Pressure of [`Line::index_at`], atm.
    pub pressure_atm: Option<f64>,
    /// Spectral lines at which the formula holds.
    pub lines: Vec<Line>,
    /// Glasses of other makers with the same name, as `MAKER:NAME`.
    pub others_of_this_name: Vec<String>,
    /// The glass as a table of a glass file.
    pub table: String,
}

/// Linear expansion between two temperatures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Expansion {
    /// The temperatures, degrees Celsius.
    pub range_c: [f64; 2],
    /// Expansion, 1/K.
    pub per_k: f64,
}

/// A glass at a spectral line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Line {
    /// Letter of the line; may be empty.
    pub line: String,
    /// Wavelength, um.
    pub um: f64,
    /// Index relative to air at the temperature of the formula.
    pub index: f64,
    /// Index relative to air at the temperature and pressure of the request.
    pub index_at: Option<f64>,
    /// Change of the index relative to air with temperature between 20 and 40 degrees Celsius, 1/K.
    pub dn_dt_per_k: Option<f64>,
    /// Internal transmittance of 10 mm.
    pub transmission_10_mm: Option<f64>,
}

/// Temperature, degrees Celsius, and pressure, atm, of glass and air.
type Air = (f64, f64);

impl Request {
    /// The air in which indices are computed, once every setting is in its range.
    fn air(&self) -> Result<Option<Air>> {
        check_ranges(self)?;
        let atm = self.pressure.unwrap_or(1.0);
        let Some(c) = self.temperature else {
            return match self.pressure {
                None => Ok(None),
                Some(atm) => Err(JobError::setting("pressure", atm, "needs a temperature", "for example 20")),
            };
        };
        Ok(Some((c, atm)))
    }
}

/// Looks the glass up and computes its figures.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let glass = named(&request.name, &context.assets)?;
    let air = request.air()?;
    if air.is_some() && glass.index_at(LINE_D_UM, DN_DT_C[0], 1.0).is_none() {
        let message = format!("the catalogue does not say how {} changes with temperature", glass.name);
        return Err(JobError::input(message, "leave --temperature out"));
    }
    let others = (context.assets.catalog()?.all(&glass.name).iter())
        .filter(|other| **other != glass && !other.maker.is_empty())
        .map(|other| format!("{}:{}", other.maker.to_uppercase(), other.name))
        .collect();
    Ok(Response {
        glass: figures(&glass, air, others),
        printed_nd: glass.printed_nd.map(|printed| printed.to_string()),
        printed_vd: glass.printed_vd.map(|printed| printed.to_string()),
    })
}

fn figures(glass: &Glass, air: Option<Air>, others_of_this_name: Vec<String>) -> Figures {
    let [nd, vd] = glass.known_nd_and_vd();
    let p_gf = p_gf(glass);
    let on_normal_line = NORMAL_LINE[0] + NORMAL_LINE[1] * glass.abbe_vd();
    let has_formula = |um: f64| !glass.is_outside_range(um) && glass.index(um).is_finite();
    Figures {
        name: glass.name.clone(),
        maker: glass.maker.clone(),
        source: glass.source.clone(),
        status: status(glass),
        nd,
        vd,
        n_f: at_lines(glass, &[LINE_F_UM], glass.index(LINE_F_UM)),
        n_c: at_lines(glass, &[LINE_C_UM], glass.index(LINE_C_UM)),
        p_gf,
        p_gf_anomaly: p_gf.map(|p_gf| p_gf - on_normal_line),
        printed_nd: glass.printed_nd.map(|printed| printed.value),
        printed_vd: glass.printed_vd.map(|printed| printed.value),
        range_um: glass.known_range_um(),
        density_g_cm3: glass.density_g_cm3,
        relative_cost: glass.relative_cost,
        expansion: (glass.expansion.iter())
            .map(|e| Expansion { range_c: e.range_c, per_k: e.per_k })
            .collect(),
        temperature_c: air.map(|(c, _)| c),
        pressure_atm: air.map(|(_, atm)| atm),
        lines: (LINES.iter().filter(|(_, um)| has_formula(*um)))
            .map(|(name, um)| line(glass, name, *um, air))
            .collect(),
        others_of_this_name,
        table: write_catalog([glass]).trim().to_owned(),
    }
}

fn line(glass: &Glass, name: &str, um: f64, air: Option<Air>) -> Line {
    let [from, to] = DN_DT_C;
    let dn_dt = || Some((glass.index_at(um, to, 1.0)? - glass.index_at(um, from, 1.0)?) / (to - from));
    Line {
        line: name.to_owned(),
        um,
        index: glass.index(um),
        index_at: air.and_then(|(c, atm)| glass.index_at(um, c, atm)),
        dn_dt_per_k: dn_dt(),
        transmission_10_mm: glass.internal_transmission(um, PATH_MM),
    }
}
