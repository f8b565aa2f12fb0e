//! Writes a file; reading it gives the same bits.

use super::out::Out;
use super::write_surface::write_surface;
use crate::decimal::shifted_text;
use crate::export::{lose_the_rest, object_heights, weighted_wavelengths, with_open_stop};
use crate::loss::{Effect, Losses};
use crate::toml_number::{exact_reciprocal, number};
use crate::{Export, LensFile};
use petzval_base::FileError;
use petzval_optics::glass::Catalog;
use petzval_optics::lens::{Departure, Lens, ObjectDistance};

/// The distance of an object at infinity, as the program writes it.
const INFINITY: &str = "0.1e14";

/// A lens as a file in mm: with radii if all of them are exact, else with curvatures. Glasses of `catalog` have the program's
/// names. Other glasses with Schott's formula, a constant index or a table go into a private catalogue.
///
/// # Errors
///
/// Fails if the format cannot represent a part of the lens that affects rays. The message names the surface.
pub fn write_seq(file: &LensFile, catalog: &Catalog) -> Result<Export, FileError> {
    let mut losses = Losses::default();
    let lens: &Lens = &with_open_stop(&file.lens, &mut losses);
    let mut out = Out {
        text: String::new(),
        losses,
        catalog,
        radii: lens.surfaces.iter().all(|s| has_radii(&s.shape.departure, s.shape.curvature)),
        private: Vec::new(),
    };
    out.lens(lens, &file.field_weights)?;
    lose_the_rest(file, &mut out.losses);
    if !lens.source.is_empty() {
        out.losses.add(0, "source", Effect::NoRay, "the format has no place for this");
    }
    Ok(Export { text: out.text, losses: out.losses.into_list() })
}

/// Whether the curvatures of a surface are exact as radii.
fn has_radii(departure: &Departure, curvature: f64) -> bool {
    // A plane is 0; negative zero is not.
    let exact = |c: f64| c.to_bits() == 0 || (c != 0.0 && exact_reciprocal(c).is_some());
    let x = match departure {
        Departure::Biconic { curvature_x, .. } | Departure::Toroid { curvature_x } => *curvature_x,
        _ => 0.0,
    };
    exact(curvature) && exact(x)
}

impl<'a> Out<'a> {
    /// The whole lens.
    fn lens(&mut self, lens: &'a Lens, field_weights: &[f64]) -> Result<(), FileError> {
        self.line(format_args!("RDM {};LEN", if self.radii { "Y" } else { "N" }));
        let title = self.quoted("name", &lens.name);
        self.line(format_args!("TITLE {title}"));
        self.line(format_args!("EPD {}\nDIM M", number(lens.entrance_pupil_mm)));
        let (wavelengths, reference) = weighted_wavelengths(lens);
        let nm: Vec<String> = wavelengths.iter().map(|(um, _)| shifted_text(*um, 3)).collect();
        let weights: Vec<String> = wavelengths.iter().map(|(_, weight)| weight.to_string()).collect();
        self.list("WL", &nm);
        self.line(format_args!("REF {}", reference + 1));
        self.list("WTW", &weights);
        let (key, values) = match lens.object {
            ObjectDistance::Infinity => ("AN", lens.fields_deg.clone()),
            ObjectDistance::Finite(distance) => ("OB", object_heights(lens, distance, &mut self.losses)),
        };
        self.list(&format!("X{key}"), &vec!["0.0".to_owned(); values.len()]);
        self.list(&format!("Y{key}"), &values.iter().map(|v| number(*v)).collect::<Vec<_>>());
        if !field_weights.is_empty() {
            self.list("WTF", &field_weights.iter().map(|w| number(*w)).collect::<Vec<_>>());
        }
        self.private_catalog(lens)?;
        let object = match lens.object {
            ObjectDistance::Infinity => INFINITY.to_owned(),
            ObjectDistance::Finite(distance) => number(distance),
        };
        self.line(format_args!("SO 0.0 {object}"));
        for (i, surface) in lens.surfaces.iter().enumerate() {
            write_surface(self, i, surface, i == lens.stop)?;
        }
        self.line(format_args!("SI 0.0 0.0\nGO"));
        Ok(())
    }
}
