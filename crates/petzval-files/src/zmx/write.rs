//! Writes a file; reading it gives the same bits.

use super::out::Out;
use super::write_shape::write_shape;
use crate::draft::undone;
use crate::export::{
    degrees, lose_the_rest, object_heights, one_line, one_word, surface_error, weighted_wavelengths,
    with_open_stop,
};
use crate::loss::{Effect, Losses};
use crate::toml_number::number;
use crate::{Export, LensFile};
use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{Action, Axis, Lens, ObjectDistance, Placement, Surface};

/// Words with another meaning in the place of a glass.
const TAKEN: &[&str] = &["MIRROR", "AIR", "___BLANK"];

/// A lens as a file in mm. Glasses are written by name and must be in `catalog` with the same dispersion. A constant index,
/// or an index with an Abbe number, becomes a model glass.
///
/// # Errors
///
/// Fails if the format cannot represent a part of the lens that affects rays. The message names the surface.
pub fn write_zmx(file: &LensFile, catalog: &Catalog) -> Result<Export, FileError> {
    let mut losses = Losses::default();
    let lens = with_open_stop(&file.lens, &mut losses);
    let mut out = Out { text: String::new(), losses, catalog };
    out.lens(&lens, &file.field_weights)?;
    lose_the_rest(file, &mut out.losses);
    Ok(Export { text: out.text, losses: out.losses.into_list() })
}

impl Out<'_> {
    fn lens(&mut self, lens: &Lens, field_weights: &[f64]) -> Result<(), FileError> {
        self.line(format_args!("VERS 140124 258 36214"));
        self.line(format_args!("MODE SEQ"));
        self.line(format_args!("NAME {}", one_line(&lens.name)));
        for note in lens.source.lines() {
            self.line(format_args!("NOTE 0 {}", one_line(note)));
        }
        self.line(format_args!("UNIT MM X W X CM MR CPMM"));
        self.line(format_args!("ENPD {}", number(lens.entrance_pupil_mm)));
        self.catalogs(lens);
        self.fields(lens, field_weights);
        let (wavelengths, primary) = weighted_wavelengths(lens);
        for (i, (um, weight)) in wavelengths.iter().enumerate() {
            self.line(format_args!("WAVM {} {} {weight}", i + 1, number(*um)));
        }
        self.line(format_args!("PWAV {}", primary + 1));

        self.line(format_args!("SURF 0\n  TYPE STANDARD\n  CURV 0.0 0 0 0 0 \"\""));
        match lens.object {
            ObjectDistance::Infinity => self.line(format_args!("  DISZ INFINITY")),
            ObjectDistance::Finite(distance) => self.line(format_args!("  DISZ {}", number(distance))),
        }
        let mut next = 1;
        for (i, surface) in lens.surfaces.iter().enumerate() {
            self.surface(i, surface, i == lens.stop, &mut next)?;
        }
        self.line(format_args!("SURF {next}\n  TYPE STANDARD\n  CURV 0.0 0 0 0 0 \"\"\n  DISZ 0"));
        Ok(())
    }

    /// Writes the names of the catalogues that contain the glasses.
    fn catalogs(&mut self, lens: &Lens) {
        let mut makers: Vec<String> = Vec::new();
        for surface in &lens.surfaces {
            let maker = one_word(&surface.glass.maker.to_uppercase());
            let maker = if maker == "GENERIC" { "MISC".to_owned() } else { maker };
            if !maker.is_empty() && !makers.contains(&maker) {
                makers.push(maker);
            }
        }
        if !makers.is_empty() {
            self.line(format_args!("GCAT {}", makers.join(" ")));
        }
    }

    fn fields(&mut self, lens: &Lens, weights: &[f64]) {
        let (kind, values) = match lens.object {
            ObjectDistance::Infinity => (0, lens.fields_deg.clone()),
            ObjectDistance::Finite(distance) => (1, object_heights(lens, distance, &mut self.losses)),
        };
        let (count, waves) = (values.len(), weighted_wavelengths(lens).0.len());
        self.line(format_args!("FTYP {kind} 0 {count} {waves} 0 0 0"));
        let list = |value: &dyn Fn(usize) -> String| (0..count).map(value).collect::<Vec<_>>().join(" ");
        self.line(format_args!("XFLN {}", list(&|_| "0".into())));
        self.line(format_args!("YFLN {}", list(&|i| number(values[i]))));
        self.line(format_args!("FWGN {}", list(&|i| weights.get(i).map_or("1".into(), |w| number(*w)))));
    }

    /// Writes a surface with the coordinate breaks of its placement.
    fn surface(&mut self, index: usize, s: &Surface, stop: bool, next: &mut usize) -> Result<(), FileError> {
        let behind = match s.placement {
            None => None,
            Some(placed) => {
                self.coordinate_break(index, &placed.decenter_mm, &placed.tilt_rad, false, 0.0, next);
                self.break_behind(&placed)
            }
        };
        self.line(format_args!("SURF {next}"));
        *next += 1;
        if stop {
            self.line(format_args!("  STOP"));
        }
        if !s.label.is_empty() {
            self.line(format_args!("  COMM {}", one_line(&s.label)));
        }
        write_shape(self, index + 1, s)?;
        let thickness_mm = if behind.is_some() { 0.0 } else { s.thickness_mm };
        self.line(format_args!("  DISZ {}", number(thickness_mm)));
        if s.action == Action::Reflect {
            self.line(format_args!("  GLAS MIRROR 0 0 1.5 40 0 0 0 0 0 0"));
        } else if !s.glass.is_air() {
            self.glass(index + 1, &s.glass)?;
        }
        let semi = number(s.semi_diameter_mm);
        // A semi-diameter that the program fits to its rays cuts nothing.
        if s.is_open {
            self.line(format_args!("  DIAM {semi} 0 0 0 1 \"\""));
        } else {
            self.line(format_args!("  DIAM {semi} 1 0 0 1 \"\"\n  FLAP 0 {semi} 0"));
        }
        if let Some((decenter, tilt)) = behind {
            self.coordinate_break(index, &decenter, &tilt, true, s.thickness_mm, next);
        }
        Ok(())
    }

    /// Shift and rotations of the break behind a surface, in reverse order; `None` if the axis follows the surface.
    fn break_behind(&self, placed: &Placement) -> Option<([f64; 2], [f64; 3])> {
        let [x, y, z] = placed.tilt_rad;
        match placed.axis {
            Axis::Follows => None,
            Axis::Returns => Some(undone(placed)),
            Axis::Bends => Some(([0.0; 2], [x, y, 0.0 - z])),
        }
    }

    fn coordinate_break(
        &mut self,
        index: usize,
        decenter_mm: &[f64; 2],
        tilt_rad: &[f64; 3],
        tilt_first: bool,
        thickness_mm: f64,
        next: &mut usize,
    ) {
        self.line(format_args!("SURF {next}\n  TYPE COORDBRK\n  CURV 0.0 0 0 0 0 \"\""));
        *next += 1;
        for (i, mm) in decenter_mm.iter().enumerate() {
            self.line(format_args!("  PARM {} {}", i + 1, number(*mm)));
        }
        for (i, rad) in tilt_rad.iter().enumerate() {
            let (deg, exact) = degrees(*rad);
            if !exact {
                let message = "in degrees, a tilt changes in its last digit";
                self.losses.of_surface(index + 1, Effect::Approximated, message);
            }
            self.line(format_args!("  PARM {} {}", i + 3, number(deg)));
        }
        self.line(format_args!("  PARM 6 {}\n  DISZ {}", u8::from(tilt_first), number(thickness_mm)));
    }

    fn glass(&mut self, surface: usize, glass: &Glass) -> Result<(), FileError> {
        let mut name = one_word(&glass.name);
        if TAKEN.contains(&name.as_str()) {
            name.push_str("-2");
        }
        if name != glass.name {
            let message = format!("the glass {} is called {name}", one_line(&glass.name));
            self.losses.of_surface(surface, Effect::NoRay, message);
        }
        let known = self.catalog.get(&name).is_ok_and(|known| known.dispersion == glass.dispersion);
        let state = match (&glass.dispersion, known) {
            (_, true) => 0,
            (Dispersion::NdVd { .. } | Dispersion::Constant(_), false) => 1,
            _ => {
                let message =
                    format!("the glass {} is not in the catalogue as it is in the lens", glass.name);
                let hint = format!(
                    "a .zmx file names glasses and holds no formula: put `[glass.{}]`, as in a .toml of the lens, into a catalogue for --glasses, \
                     or give `nd` and `vd` alone for a model glass; a .seq file holds some formulas",
                    one_line(&glass.name)
                );
                return Err(surface_error(surface, message).hint(hint));
            }
        };
        let [nd, vd] = match &glass.dispersion {
            Dispersion::NdVd { nd, vd } => [*nd, *vd],
            Dispersion::Constant(n) => [*n, 0.0],
            _ => [glass.nd(), glass.abbe_vd()],
        };
        if state == 1 && matches!(glass.dispersion, Dispersion::NdVd { .. }) {
            let message =
                format!("{name} becomes a model glass, whose dispersion programs compute in different ways");
            self.losses.of_surface(surface, Effect::Approximated, message);
        }
        let name = if name.is_empty() { "___BLANK" } else { name.as_str() };
        self.line(format_args!("  GLAS {name} {state} 0 {} {} 0 0 0 0 0 0", number(nd), number(vd)));
        Ok(())
    }
}
