//! `glass find`: the glasses nearest to an index and an Abbe number.

use petzval_optics::glass::{Near, Status, nearest};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{is_made_by, p_gf, status};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::range::check_ranges;

petzval_base::parameters! {
    /// Which glasses to look for. The distance is `sqrt((dnd / 0.01)^2 + dVd^2)`: 0.01 of index counts as much as 1 of Abbe
    /// number.
    pub struct Request {
        /// Index at the d line, 587.6 nm, 1 to 5.
        nd: f64 = 1.5168, "", 1..5, Linear, "an index is between 1 and 5; for example --nd 1.6 --vd 50";
        /// Abbe number `(nd - 1) / (nF - nC)`, 1 to 1000.
        vd: f64 = 64.17, "", 1..1000, Log, "an Abbe number is between 1 and 1000; for example --nd 1.6 --vd 50";
        /// Largest number of glasses in the response.
        count: usize = 10, "", 0..1_000_000, Linear, "10 are usual";
    }
    also {
        /// Only glasses of this maker: any part of the name, in upper or lower case.
        maker: Option<String> = None;
        /// Whether obsolete glasses count too.
        obsolete: bool = false;
    }
}

/// The glasses that were found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The nearest first.
    pub glasses: Vec<Found>,
}

/// A glass that was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Found {
    /// Its name.
    pub name: String,
    /// Its maker; may be empty.
    pub maker: String,
    /// How the maker offers it: preferred, standard, special, obsolete or melt.
    pub status: Option<String>,
    /// Index at the d line.
    pub nd: Option<f64>,
    /// Abbe number; `None` without dispersion.
    pub vd: Option<f64>,
    /// Partial dispersion `(ng - nF) / (nF - nC)`; `None` without dispersion.
    pub p_gf: Option<f64>,
    /// Price relative to the maker's reference glass.
    pub relative_cost: Option<f64>,
    /// Distance on the glass map.
    pub distance: f64,
}

impl From<&Near> for Found {
    fn from(near: &Near) -> Self {
        let glass = &near.glass;
        let [nd, vd] = glass.known_nd_and_vd();
        Self {
            name: glass.name.clone(),
            maker: glass.maker.clone(),
            status: status(glass),
            nd,
            vd,
            p_gf: p_gf(glass),
            relative_cost: glass.relative_cost,
            distance: near.distance,
        }
    }
}

/// Finds the glasses.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    let found =
        nearest(context.assets.catalog()?.as_ref(), [request.nd, request.vd], request.count, |glass| {
            is_made_by(glass, request.maker.as_deref())
                && (request.obsolete || glass.status != Some(Status::Obsolete))
        });
    if found.is_empty() && request.count > 0 {
        return Err(JobError::input(
            "there is no such glass",
            "`petzval glass list` shows every glass with its maker",
        ));
    }
    Ok(Response { glasses: found.iter().map(Found::from).collect() })
}
