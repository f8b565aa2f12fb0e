//! `glass list`: every glass.

use std::sync::Arc;

use petzval_optics::glass::{Catalog, Glass};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{is_made_by, status};
use crate::context::Context;
use crate::error::{JobError, Result};

/// Which glasses to list.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Only glasses of this maker: any part of the name, in upper or lower case.
    pub maker: Option<String>,
}

/// The glasses of the catalogue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// In the order of the catalogue.
    pub glasses: Vec<Listed>,
}

/// A glass of the catalogue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Listed {
    /// What a lens file has to call it: its name, or `MAKER:NAME` where the name alone means another glass.
    pub name: String,
    /// Its maker; may be empty.
    pub maker: String,
    /// How the maker offers it: preferred, standard, special, obsolete or melt.
    pub status: Option<String>,
    /// Index at the d line.
    pub nd: Option<f64>,
    /// Abbe number; `None` without dispersion.
    pub vd: Option<f64>,
    /// The index that the maker prints.
    pub printed_nd: Option<f64>,
    /// The Abbe number that the maker prints.
    pub printed_vd: Option<f64>,
    /// Whether the formula gives the printed numbers to their last digit; `None` where nothing is printed.
    pub agrees_with_print: Option<bool>,
    /// Wavelengths between which the formula holds, um.
    pub range_um: Option<[f64; 2]>,
}

impl Listed {
    fn new(glass: &Glass, catalog: &Catalog) -> Self {
        let name = match catalog.get(&glass.name) {
            Ok(meant) if *meant == *glass => glass.name.clone(),
            _ => format!("{}:{}", glass.maker.to_uppercase(), glass.name),
        };
        let [nd, vd] = glass.known_nd_and_vd();
        Self {
            name,
            maker: glass.maker.clone(),
            status: status(glass),
            nd,
            vd,
            printed_nd: glass.printed_nd.map(|p| p.value),
            printed_vd: glass.printed_vd.map(|p| p.value),
            agrees_with_print: agrees_with_print(glass),
            range_um: glass.known_range_um(),
        }
    }
}

/// Lists the glasses.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let catalog = context.assets.catalog()?;
    let glasses: Vec<&Arc<Glass>> =
        catalog.glasses().filter(|glass| is_made_by(glass, request.maker.as_deref())).collect();
    if glasses.is_empty() {
        return Err(JobError::input("there is no such glass", "leave --maker out to see all makers"));
    }
    Ok(Response { glasses: glasses.into_iter().map(|glass| Listed::new(glass, &catalog)).collect() })
}

fn agrees_with_print(glass: &Glass) -> Option<bool> {
    let [nd, vd] = glass.known_nd_and_vd();
    let nd = glass.printed_nd.zip(nd).map(|(printed, nd)| printed.agrees(nd));
    let vd = glass.printed_vd.zip(vd).map(|(printed, vd)| printed.agrees(vd));
    match (nd, vd) {
        (None, None) => None,
        (nd, vd) => Some(nd != Some(false) && vd != Some(false)),
    }
}
