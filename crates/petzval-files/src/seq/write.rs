//! Writes a file; reading it gives the same bits.

use std::fmt::Write;

use super::write_surface::write_surface;
use crate::decimal::shifted_text;
use crate::export::{lose_the_rest, object_heights, one_word, surface_error, weighted_wavelengths};
use crate::lens_toml::{exact_reciprocal, number};
use crate::loss::{Effect, Losses};
use crate::{Export, LensFile};
use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{Departure, Lens, ObjectDistance};

/// The distance of an object at infinity, as the program writes it.
const INFINITY: &str = "0.1e14";

/// Words with another meaning in the place of a glass.
const TAKEN: &[&str] = &["AIR", "REFL", "REFR", "PWL", "END"];

/// A lens as a file in mm: with radii if all of them are exact, else with curvatures. Glasses of `catalog` have the program's
/// names. Other glasses with Schott's formula, a constant index or a table go into a private catalogue.
///
/// # Errors
///
/// Fails if the format cannot represent a part of the lens that affects rays. The message names the surface.
pub fn write_seq(file: &LensFile, catalog: &Catalog) -> Result<Export, FileError> {
    let lens = &file.lens;
    let mut out = Out {
        text: String::new(),
        losses: Losses::default(),
        catalog,
        radii: lens.surfaces.iter().all(|s| has_radii(&s.shape.departure, s.shape.curvature)),
        private: Vec::new(),
    };
    out.lens(lens)?;
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

/// The text and the losses so far.
pub(super) struct Out<'a> {
    pub text: String,
    pub losses: Losses,
    catalog: &'a Catalog,
    pub radii: bool,
    /// Private glasses with their names in the file.
    private: Vec<(String, &'a Glass)>,
}

impl<'a> Out<'a> {
    /// Adds a line.
    pub fn line(&mut self, line: std::fmt::Arguments<'_>) {
        self.text
            .write_fmt(line)
            .and_then(|()| self.text.write_char('\n'))
            .expect("a string takes whatever is written");
    }

    /// A radius or a curvature, by the mode of the file.
    pub fn curved(&self, curvature: f64) -> String {
        match self.radii {
            false => number(curvature),
            true if curvature == 0.0 => "0.0".into(),
            true => number(exact_reciprocal(curvature).unwrap_or(1.0 / curvature)),
        }
    }

    /// Text in quotes; quotes of the same kind inside it are replaced.
    pub fn quoted(&mut self, what: &str, text: &str) -> String {
        let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
        match (line.contains('\''), line.contains('"')) {
            (false, _) => format!("'{line}'"),
            (true, false) => format!("\"{line}\""),
            (true, true) => {
                self.losses.add(0, what, Effect::NoRay, "double quotes become single ones");
                format!("\"{}\"", line.replace('"', "'"))
            }
        }
    }

    fn lens(&mut self, lens: &'a Lens) -> Result<(), FileError> {
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
            ObjectDistance::Finite(distance) => {
                let (heights, exact) = object_heights(lens, distance);
                if !exact {
                    let message = "as heights of the object, fields change in their last digit";
                    self.losses.add(0, "fields", Effect::Approximated, message);
                }
                ("OB", heights)
            }
        };
        self.list(&format!("X{key}"), &vec!["0.0".to_owned(); values.len()]);
        self.list(&format!("Y{key}"), &values.iter().map(|v| number(*v)).collect::<Vec<_>>());
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

    /// A command with many values, six on each line.
    fn list(&mut self, name: &str, values: &[String]) {
        const A_LINE: usize = 6;
        let lines: Vec<String> = values.chunks(A_LINE).map(|chunk| chunk.join(" ")).collect();
        self.line(format_args!("{name} {}", lines.join(" &\n ")));
    }

    /// The name of a glass that needs no private catalogue.
    fn known_name(&self, glass: &Glass) -> Option<String> {
        if let Dispersion::NdVd { nd, vd } = &glass.dispersion {
            return Some(format!("{}:{}", number(*nd), number(*vd)));
        }
        let same = |known: &&std::sync::Arc<Glass>| known.dispersion == glass.dispersion;
        let known = self.catalog.all(&glass.name).iter().rfind(same)?;
        // Check that the reader finds the same glass. A glass without a maker has its exact name, in quotes.
        let found = |text: &str, quoted: bool| {
            let word = super::command::Word { text: text.to_owned(), quoted };
            let found =
                super::glass::PrivateGlasses::default().medium(&word, self.catalog, &Default::default());
            found.is_ok_and(|found| found.dispersion == glass.dispersion)
        };
        if known.maker.is_empty() {
            let fits = one_word(&glass.name) == glass.name && !glass.name.contains(['\'', '"']);
            return (fits && found(&glass.name, true)).then(|| format!("'{}'", glass.name));
        }
        let name =
            format!("{}_{}", super::glass::bare(&glass.name), super::glass::maker_suffix(&known.maker));
        found(&name, false).then_some(name)
    }

    /// The name of the glass behind a surface; empty for air.
    pub fn glass_name(&mut self, surface: usize, glass: &Glass) -> String {
        if glass.is_air() {
            return String::new();
        }
        if let Some((name, _)) = self.private.iter().find(|(_, known)| *known == glass) {
            return format!("'{name}'");
        }
        if matches!(glass.dispersion, Dispersion::NdVd { .. }) {
            let message = format!("{} keeps its nd and Vd and loses its name", glass.name);
            self.losses.add(0, &format!("surface {}", surface + 1), Effect::NoRay, message);
        }
        self.known_name(glass).unwrap_or_default()
    }

    /// Writes the private catalogue of the glasses that are in no catalogue.
    fn private_catalog(&mut self, lens: &'a Lens) -> Result<(), FileError> {
        let mut lines = Vec::new();
        for (i, surface) in lens.surfaces.iter().enumerate() {
            let glass: &Glass = &surface.glass;
            let is_new = !glass.is_air() && !self.private.iter().any(|(_, known)| *known == glass);
            if !is_new || self.known_name(glass).is_some() {
                continue;
            }
            // Give the glass a unique name that the format accepts.
            let mut name = one_word(&glass.name.to_uppercase()).replace(['\'', '"', '!', ';', '&'], "_");
            while name.is_empty()
                || TAKEN.contains(&name.as_str())
                || self.private.iter().any(|(known, _)| *known == name)
            {
                name.push('-');
                name.push('2');
            }
            if name != glass.name {
                let message = format!("the glass {} is called {name}", glass.name);
                self.losses.add(0, &format!("surface {}", i + 1), Effect::NoRay, message);
            }
            match &glass.dispersion {
                Dispersion::Schott(a) => {
                    let a: Vec<String> = a.iter().map(|v| number(*v)).collect();
                    lines.push(format!("  '{name}' LAU {}", a.join(" ")));
                }
                Dispersion::Constant(n) => lines.push(format!("  PWL 587.6\n  '{name}' {}", number(*n))),
                Dispersion::Table { wavelength_um, index }
                    if wavelength_um.len() <= crate::draft::MOST_VALUES =>
                {
                    let message = format!(
                        "programs interpolate the index of {name} between its wavelengths in different ways"
                    );
                    self.losses.add(0, &format!("surface {}", i + 1), Effect::Approximated, message);
                    let nm: Vec<String> = wavelength_um.iter().map(|um| shifted_text(*um, 3)).collect();
                    let index: Vec<String> = index.iter().map(|n| number(*n)).collect();
                    lines.push(format!("  PWL {}\n  '{name}' {}", nm.join(" "), index.join(" ")));
                }
                _ => {
                    let message =
                        format!("the glass {} is not in the catalogue as it is in the lens", glass.name);
                    let hint = "of formulas the format holds Schott's; give `nd` and `vd`, or name a catalogue glass";
                    return Err(surface_error(i + 1, message).hint(hint));
                }
            }
            self.private.push((name, glass));
        }
        if !lines.is_empty() {
            self.line(format_args!("PRV\n{}\nEND", lines.join("\n")));
        }
        Ok(())
    }
}
