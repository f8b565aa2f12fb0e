//! `lens list`: the built-in lenses.

use petzval_optics::paraxial::first_order;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::Result;
use crate::finite::finite;

/// The built-in lenses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {}

/// All of them, by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The lenses in the order of their names.
    pub lenses: Vec<Entry>,
}

/// A lens in a few numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Entry {
    /// The name by which other requests find it.
    pub name: String,
    /// Its name in its file.
    pub lens: String,
    /// Surfaces, the stop among them.
    pub surfaces: usize,
    /// Focal length at the reference wavelength, mm; none if it is afocal.
    pub efl_mm: Option<f64>,
    /// Focal length over the diameter of the entrance pupil.
    pub f_number: Option<f64>,
    /// Largest field, degrees from the axis.
    pub field_deg: f64,
    /// Where the numbers come from.
    pub source: String,
}

/// Lists the built-in lenses.
pub fn run(_: &Request, context: &Context) -> Result<Response> {
    let entry = |name: &str| {
        let lens = context.assets.lens(name)?.lens;
        let order = first_order(&lens.at_wavelength(lens.reference_um));
        Ok(Entry {
            name: name.to_owned(),
            surfaces: lens.surfaces.len(),
            efl_mm: finite(order.efl_mm),
            f_number: finite(order.f_number),
            field_deg: lens.outermost_field_deg(),
            source: lens.source,
            lens: lens.name,
        })
    };
    let lenses = context.assets.names("lenses").into_iter().map(entry).collect::<Result<_>>()?;
    Ok(Response { lenses })
}
