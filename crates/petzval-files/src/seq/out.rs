//! The lines, glasses and losses of a CODE V file while it is written.

use std::fmt::Write;

use crate::decimal::shifted_text;
use crate::export::{one_word, surface_error};
use crate::loss::{Effect, Losses};
use crate::toml_number::{exact_reciprocal, number};
use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::Lens;

/// Words with another meaning in the place of a glass name.
const TAKEN: &[&str] = &["AIR", "REFL", "REFR", "PWL", "END"];

/// The file as written so far.
pub(super) struct Out<'a> {
    pub text: String,
    pub losses: Losses,
    pub catalog: &'a Catalog,
    pub radii: bool,
    /// The private glasses with their names in the file.
    pub private: Vec<(String, &'a Glass)>,
}

impl<'a> Out<'a> {
    /// Adds a line.
    pub fn line(&mut self, line: std::fmt::Arguments<'_>) {
        let written = self.text.write_fmt(line).and_then(|()| self.text.write_char('\n'));
        written.expect("a string takes whatever is written");
    }

    /// A radius or a curvature, by the mode of the file.
    pub fn curved(&self, curvature: f64) -> String {
        match self.radii {
            false => number(curvature),
            true if curvature == 0.0 => "0.0".into(),
            true => number(exact_reciprocal(curvature).unwrap_or(1.0 / curvature)),
        }
    }

    /// Text in quotes. Quotes cannot be escaped, so text with both kinds of quotes loses the double ones.
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

    /// A command with many values, a few on each line.
    pub fn list(&mut self, name: &str, values: &[String]) {
        const A_LINE: usize = 6;
        let lines: Vec<String> = values.chunks(A_LINE).map(|chunk| chunk.join(" ")).collect();
        self.line(format_args!("{name} {}", lines.join(" &\n ")));
    }

    /// Name of a glass that needs no private catalogue.
    fn known_name(&self, glass: &Glass) -> Option<String> {
        if let Dispersion::NdVd { nd, vd } = &glass.dispersion {
            return Some(format!("{}:{}", number(*nd), number(*vd)));
        }
        let same = |known: &&std::sync::Arc<Glass>| known.dispersion == glass.dispersion;
        let known = self.catalog.all(&glass.name).iter().rfind(same)?;
        // Keep a name only if the reader finds the same glass by it. A glass without a maker has its plain name in quotes.
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

    /// Name of the glass behind a surface; empty for air.
    pub fn glass_name(&mut self, surface: usize, glass: &Glass) -> String {
        if glass.is_air() {
            return String::new();
        }
        if let Some((name, _)) = self.private.iter().find(|(_, known)| *known == glass) {
            return format!("'{name}'");
        }
        if matches!(glass.dispersion, Dispersion::NdVd { .. }) {
            let message = format!("{} keeps its nd and Vd and loses its name", glass.name);
            self.losses.of_surface(surface + 1, Effect::NoRay, message);
        }
        self.known_name(glass).unwrap_or_default()
    }

    /// Writes the private catalogue: every glass that no catalogue has.
    pub fn private_catalog(&mut self, lens: &'a Lens) -> Result<(), FileError> {
        let mut lines = Vec::new();
        for (i, surface) in lens.surfaces.iter().enumerate() {
            let glass: &Glass = &surface.glass;
            let is_new = !glass.is_air() && !self.private.iter().any(|(_, known)| *known == glass);
            if !is_new || self.known_name(glass).is_some() {
                continue;
            }
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
                self.losses.of_surface(i + 1, Effect::NoRay, message);
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
                        "between its wavelengths, programs compute the index of {name} in ways of their own"
                    );
                    self.losses.of_surface(i + 1, Effect::Approximated, message);
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
            // A table's range is that of its wavelengths, which are written.
            let read_again = Glass::new(&name, glass.dispersion.clone()).known_range_um();
            if let Some([least, most]) = glass.known_range_um().filter(|range| Some(*range) != read_again) {
                let message = format!(
                    "the glass {name} loses the wavelengths from which its index is known, {} to {} um",
                    number(least),
                    number(most)
                );
                self.losses.of_surface(i + 1, Effect::NoRay, message);
            }
            self.private.push((name, glass));
        }
        if !lines.is_empty() {
            self.line(format_args!("PRV\n{}\nEND", lines.join("\n")));
        }
        Ok(())
    }
}
