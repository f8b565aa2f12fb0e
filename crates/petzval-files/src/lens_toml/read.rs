//! Reads a lens file and checks every number, so that errors name its line.

use std::ops::Range;

use super::parameter::{CURVATURE, parameters};
use super::text::{
    ExpectText, ExpectedText, FieldsText, LensText, PickupText, Placed, SolveText, SurfaceText, VariableText,
    WavelengthsText,
};
use super::{Expect, Expected, ExpectedSpots, LensFile};
use crate::draft::{FAR_PUPIL, Import, has_pupil_at_infinity, with_open_surfaces, with_stop_beside_focus};
use crate::field_weights::{WeightFault, uneven_weights};
use crate::glass_toml::read_glasses;
use crate::impossible::{Culprit, hint, measured_surfaces};
use crate::loss::{Effect, Loss};
use crate::spanned::Spanned;
use crate::wavelength::{OPTICAL_UM, wavelength_hint, wavelength_message};
use petzval_base::FileError;
use petzval_optics::design_space::{EflSolve, MagnificationSolve, Pickup, Variable};
use petzval_optics::glass::Catalog;
use petzval_optics::lens::{Lens, LensDefect, ObjectDistance, Surface, traceable, validate};
use petzval_optics::number::Number;
use petzval_optics::paraxial::first_order;
use petzval_optics::solve::{magnification, with_length};

/// Default reference wavelength, the helium d line, um.
const DEFAULT_REFERENCE_UM: f64 = 0.5876;

/// Two numbers are the same up to this share: files have rounded ones.
const SAME_NUMBER: f64 = 1e-6;

/// A lens has what its solve makes of it up to this share: solves are often written with four digits.
const SOLVED: f64 = 1e-4;

/// Adds what to write to an error of which the reader of TOML knows only that a key is missing, or its value of another type.
fn with_hint(error: FileError) -> FileError {
    match error.key.as_str() {
        "units" if error.message.ends_with("is missing") => error.hint("add a line `units = \"mm\"`"),
        "glass" if error.message.starts_with("expected text in quotes") => error.hint(
            "name a glass of a catalogue, as `glass = \"N-BK7\"`; one of your own stands in a table [glass.NAME] with nd and vd",
        ),
        _ => error,
    }
}

/// A number as a message shows it, with twelve significant digits: the sum of 0.1 and 0.2 is 0.30000000000000004, and a radius is computed back from
/// its curvature. The lens keeps its numbers as they are. Numbers that are not the same by [`SAME_NUMBER`] are shown as different ones.
fn for_message(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// Reads a lens file. Glasses are looked up first in the file's own tables, then in `catalog`.
pub fn parse_lens(text: &str, catalog: &Catalog) -> Result<LensFile, FileError> {
    Ok(parse_lens_start(text, catalog)?.buildable()?.file)
}

/// Reads a lens file to start an optimisation from. The error beside the lens says why it cannot be built: its glass is thinner than nothing, or its
/// surfaces cross. Clear semi-diameters that the file leaves out follow from the beams of its fields.
pub fn parse_lens_start(text: &str, catalog: &Catalog) -> Result<Import, FileError> {
    let file: LensText = FileError::read_toml(text).map_err(with_hint)?;
    let reader = Reader { text };

    if file.units.get_ref() != "mm" {
        return Err(reader
            .error("units", file.units.span(), "lengths in a lens file are in mm")
            .hint("convert to mm and write `units = \"mm\"`"));
    }
    let mut glasses = catalog.clone();
    glasses.merge(read_glasses(text, &file.glass)?);

    let pupil = &file.aperture.entrance_pupil_diameter_mm;
    let mut surfaces = Vec::with_capacity(file.surface.len());
    for (i, surface) in file.surface.iter().enumerate() {
        let front = surfaces.last().map(|s: &Surface| s.glass.clone());
        surfaces.push(reader.surface(i + 1, surface, &glasses, front)?);
    }
    // Assemble and check the lens, then read the tables that refer to its surfaces.
    let (wavelengths_um, reference_um) = reader.wavelengths(&file.wavelengths)?;
    let mut lens = Lens {
        name: file.name.clone(),
        source: file.source.clone(),
        surfaces,
        stop: reader.stop(&file.surface)?,
        entrance_pupil_mm: reader.positive("entrance_pupil_diameter_mm", pupil)?,
        object: reader.object(&file)?,
        wavelengths_um,
        reference_um,
        fields_deg: Vec::new(),
    };
    lens.fields_deg = reader.fields(&file.fields.angle_deg, lens.object, lens.is_rotationally_symmetric())?;
    let field_weights = reader.field_weights(&file.fields, lens.fields_deg.len())?;
    traceable(&lens).map_err(|defect| reader.defect(&defect, &file))?;
    reader.check_entrance_pupil(&lens, &file)?;
    let open: Vec<usize> = (0..file.surface.len()).filter(|i| is_open(&file, *i)).collect();
    let (lens, mut losses, flaw) =
        with_open_surfaces(&lens, &open).map_err(|defect| reader.defect(&defect, &file))?;
    let unbuildable = flaw.map(|defect| reader.defect(&defect, &file));

    let variables = reader.variables(&file.variable, &lens)?;
    let lens_file = LensFile {
        field_weights,
        pickups: reader.pickups(&file, &lens, &variables)?,
        length_solve: reader.length_solve(&file, &lens, &variables)?,
        efl_solve: reader.efl_solve(&file, &lens, &variables)?,
        magnification_solve: reader.magnification_solve(&file, &lens, &variables)?,
        expect: file.expect.as_ref().map(|e| reader.expect(e, &lens)).transpose()?,
        variables,
        lens,
    };
    losses.extend(reader.contradicting_pickups(&file, &lens_file));
    losses.extend(reader.contradicting_solves(&file, &lens_file.lens));
    Ok(Import { file: lens_file, losses, unbuildable })
}

/// The text that is being read, for the places of errors.
pub(super) struct Reader<'a> {
    text: &'a str,
}

impl Reader<'_> {
    pub(super) fn error(&self, key: &str, span: Range<usize>, message: impl Into<String>) -> FileError {
        FileError::at(self.text, span, key, message)
    }

    /// An error about a missing value; `span` is the place where it belongs.
    pub(super) fn missing(&self, key: &str, span: Range<usize>, message: impl Into<String>) -> FileError {
        self.error(key, span, message).without_value()
    }

    pub(super) fn finite(&self, key: &str, number: &Placed) -> Result<f64, FileError> {
        let value = number.get_ref().0;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.error(key, number.span(), "this must be a finite number"))
        }
    }

    pub(super) fn positive(&self, key: &str, number: &Placed) -> Result<f64, FileError> {
        let value = self.finite(key, number)?;
        if value > 0.0 { Ok(value) } else { Err(self.error(key, number.span(), "this must be positive")) }
    }

    /// Index of the one surface with `stop = true`.
    fn stop(&self, surfaces: &[Spanned<SurfaceText>]) -> Result<usize, FileError> {
        let mut stops = surfaces.iter().enumerate().filter_map(|(i, surface)| {
            surface.get_ref().stop.as_ref().filter(|stop| *stop.get_ref()).map(|stop| (i, stop.span()))
        });
        let Some((first, _)) = stops.next() else {
            let start = surfaces.first().map_or(0..0, |s| s.span());
            let error = self.missing("stop", start, "no surface is the aperture stop");
            return Err(error.hint("write `stop = true` into one [[surface]]"));
        };
        match stops.next() {
            None => Ok(first),
            Some((second, span)) => {
                let message = format!("surfaces {} and {} both are the aperture stop", first + 1, second + 1);
                Err(self.error("stop", span, message).hint("a lens has one stop"))
            }
        }
    }

    /// Refuses an entrance pupil at infinity, whose diameter says nothing; the hint has the numbers of one that is far away.
    fn check_entrance_pupil(&self, lens: &Lens, file: &LensText) -> Result<(), FileError> {
        if !has_pupil_at_infinity(lens) {
            return Ok(());
        }
        let in_front = lens.stop.checked_sub(1).and_then(|i| file.surface.get(i));
        if let (ObjectDistance::Infinity, Some(in_front)) = (lens.object, in_front) {
            let thickness = &in_front.get_ref().thickness_mm;
            let error = self.error("thickness_mm", thickness.span(), FAR_PUPIL);
            return Err(
                error.hint(format!("another thickness_mm of surface {} moves it off that focus", lens.stop))
            );
        }
        let key = "entrance_pupil_diameter_mm";
        let message = "the stop is exactly at the focus in front of it (telecentric): an entrance pupil at infinity has no diameter";
        let error = self.error(key, file.aperture.entrance_pupil_diameter_mm.span(), message);
        let Some((moved, _)) = with_stop_beside_focus(lens) else {
            return Err(error.hint("move the stop a little off the focus of what is in front of it"));
        };
        let [before, stop] = [lens.stop - 1, lens.stop];
        let thickness_mm = |surface: usize| moved.surfaces[surface].thickness_mm;
        // The radius of the stop is in proportion to the diameter of the pupil.
        let radius_mm = first_order(&moved.at_wavelength(moved.reference_um)).stop_radius_mm.abs();
        let clear_mm = file.surface[stop].get_ref().semi_diameter_mm.as_ref().map(|semi| semi.get_ref().0);
        let filled_mm = clear_mm.unwrap_or(1.0);
        Err(error.hint(format!(
            "with thickness_mm = {} on surface {} and {} on surface {}, {key} = {:.6e} fills {filled_mm} mm of the stop's radius",
            thickness_mm(before),
            before + 1,
            thickness_mm(stop),
            stop + 1,
            moved.entrance_pupil_mm * filled_mm / radius_mm
        )))
    }

    fn object(&self, file: &LensText) -> Result<ObjectDistance, FileError> {
        let Some(object) = &file.object else { return Ok(ObjectDistance::Infinity) };
        match object.distance_mm.get_ref().0 {
            f64::INFINITY => Ok(ObjectDistance::Infinity),
            _ => match self.finite("distance_mm", &object.distance_mm)? {
                0.0 => {
                    let message = "the object must lie apart from the first vertex";
                    Err(self.error("distance_mm", object.distance_mm.span(), message))
                }
                distance_mm => Ok(ObjectDistance::Finite(distance_mm)),
            },
        }
    }

    /// Wavelengths and the reference wavelength.
    fn wavelengths(&self, text: &WavelengthsText) -> Result<(Vec<f64>, f64), FileError> {
        let optical = |key: &str, number: &Placed| {
            let value = number.get_ref().0;
            if OPTICAL_UM.contains(&value) {
                return Ok(value);
            }
            let error = self.error(key, number.span(), wavelength_message(value));
            Err(error.hint(wavelength_hint(value)))
        };
        let mut list = Vec::new();
        for number in text.um.get_ref() {
            list.push(optical("um", number)?);
        }
        self.check_ascending("um", &text.um)?;
        let reference = text.reference_um.as_ref();
        let reference = reference.map(|r| optical("reference_um", r)).transpose()?;
        Ok((list, reference.unwrap_or(DEFAULT_REFERENCE_UM)))
    }

    /// Field angles, degrees. Negative angles are allowed only if the lens is not rotationally symmetric.
    fn fields(
        &self,
        angles: &Spanned<Vec<Placed>>,
        object: ObjectDistance,
        lens_is_symmetric: bool,
    ) -> Result<Vec<f64>, FileError> {
        let limit = object.field_limit_deg();
        let mut list = Vec::new();
        for number in angles.get_ref() {
            let value = number.get_ref().0;
            if !(0.0..limit).contains(&value.abs()) {
                let message = match object {
                    ObjectDistance::Infinity => "a field is an angle below 180 degrees",
                    ObjectDistance::Finite(_) => "a field of a near object is an angle below 90 degrees",
                };
                return Err(self.error("angle_deg", number.span(), message));
            }
            if value < 0.0 && lens_is_symmetric {
                let message = format!("a field is an angle from 0 to below {limit} degrees");
                let error = self.error("angle_deg", number.span(), message);
                return Err(error.hint("the lens is symmetric: a negative field is the mirror image"));
            }
            list.push(value);
        }
        self.check_ascending("angle_deg", angles)?;
        Ok(list)
    }

    /// Weights of the fields; empty if all are the same.
    fn field_weights(&self, text: &FieldsText, count: usize) -> Result<Vec<f64>, FileError> {
        let Some(text) = &text.weight else { return Ok(Vec::new()) };
        let found = text.get_ref().len();
        if found != count {
            let message = format!("{found} weights do not fit the {count} fields");
            return Err(self.error("weight", text.span(), message).hint("one per field"));
        }
        let weights = text.get_ref().iter().map(|number| self.finite("weight", number));
        let weights = weights.collect::<Result<Vec<_>, _>>()?;
        if let Some(fault) = WeightFault::of(&weights) {
            let span = match fault {
                WeightFault::Range(place) => text.get_ref()[place].span(),
                WeightFault::Nothing => text.span(),
            };
            let (message, hint) = fault.in_words();
            return Err(self.error("weight", span, message).hint(hint));
        }
        Ok(uneven_weights(weights))
    }

    fn check_ascending(&self, key: &str, list: &Spanned<Vec<Placed>>) -> Result<(), FileError> {
        if list.get_ref().is_empty() {
            return Err(self.error(key, list.span(), "the list is empty"));
        }
        for pair in list.get_ref().windows(2) {
            if pair[0].get_ref().0 >= pair[1].get_ref().0 {
                let error = self.error(key, pair[1].span(), "the list does not ascend");
                return Err(error.hint("sort it, each value once"));
            }
        }
        Ok(())
    }

    /// A 1-based surface number as an index.
    fn surface_index(&self, number: &Spanned<usize>, lens: &Lens) -> Result<usize, FileError> {
        let count = lens.surfaces.len();
        match *number.get_ref() {
            n if (1..=count).contains(&n) => Ok(n - 1),
            n => {
                let message = format!("there is no surface {n}");
                Err(self
                    .error("surface", number.span(), message)
                    .hint(format!("surfaces are counted from 1 to {count}")))
            }
        }
    }

    fn variables(&self, texts: &[VariableText], lens: &Lens) -> Result<Vec<Variable>, FileError> {
        let mut variables: Vec<Variable> = Vec::with_capacity(texts.len());
        for text in texts {
            let surface = self.surface_index(&text.surface, lens)?;
            let key = text.parameter.get_ref();
            let number = self.parameter(&text.parameter, &lens.surfaces[surface])?;
            let (min, max) = (self.finite("min", &text.min)?, self.finite("max", &text.max)?);
            let variable = if key == CURVATURE {
                self.curvature_variable(text, surface, [min, max], lens)?
            } else {
                Variable { surface, number, min, max }
            };
            if key != CURVATURE {
                self.check_bounds(text, &variable, lens)?;
            }
            if variables.iter().any(|v| (v.surface, v.number) == (surface, number)) {
                let message = format!("{key} of surface {} is a variable already", surface + 1);
                return Err(self.error("parameter", text.parameter.span(), message));
            }
            variables.push(variable);
        }
        Ok(variables)
    }

    /// A curvature between bounds in 1/mm: a surface that may be flat has no bounds of its radius.
    fn curvature_variable(
        &self,
        text: &VariableText,
        surface: usize,
        [min, max]: [f64; 2],
        lens: &Lens,
    ) -> Result<Variable, FileError> {
        let name = format!("{CURVATURE} of surface {}", surface + 1);
        if min >= max {
            let message = format!("the bounds of {name} are reversed: {min} is not below {max}");
            return Err(self.error("max", text.max.span(), message).hint("exchange `min` and `max`"));
        }
        if min >= 0.0 || max <= 0.0 {
            let message = format!("the bounds of {name} are both on one side of the plane");
            let hint = "vary `radius_mm` of a surface that stays curved to one side";
            return Err(self.error("parameter", text.parameter.span(), message).hint(hint));
        }
        let own = Number::Curvature.read(lens, surface);
        let slack = 1e-9 * (max - min);
        if !(min - slack..=max + slack).contains(&own) {
            let (key, place) = if own < min { ("min", &text.min) } else { ("max", &text.max) };
            let message = format!("{name} is {own} in this lens, outside its bounds {min} to {max}");
            return Err(self.error(key, place.span(), message).hint("widen the bounds or change the lens"));
        }
        Ok(Variable { surface, number: Number::Curvature, min: 1.0 / min, max: 1.0 / max })
    }

    /// The number of a surface with the name that the file gives.
    fn parameter(&self, name: &Spanned<String>, surface: &Surface) -> Result<Number, FileError> {
        let key = name.get_ref();
        let known = parameters(surface);
        known.iter().find(|(known, _)| known == key).map(|(_, number)| *number).ok_or_else(|| {
            let distance = |known: &str| strsim::damerau_levenshtein(key, known);
            let nearest = known.iter().map(|(k, _)| k.as_str()).min_by_key(|known| distance(known));
            let error = self.error("parameter", name.span(), format!("the surface has no parameter `{key}`"));
            let of_placement = ["tilt", "decenter"].iter().any(|word| key.starts_with(word));
            if of_placement && surface.placement.is_none() {
                return error
                    .hint("only a placement is tilted or shifted: give the surface `placement = { tilt_deg = [0.0, 0.0, 0.0] }`");
            }
            match nearest.filter(|nearest| distance(nearest) <= 2) {
                Some(nearest) => error.hint(format!("did you mean `{nearest}`?")),
                None => {
                    let all: Vec<&str> = known.iter().map(|(k, _)| k.as_str()).collect();
                    error.hint(format!("it has {}", all.join(", ")))
                }
            }
        })
    }

    fn pickups(
        &self,
        file: &LensText,
        lens: &Lens,
        variables: &[Variable],
    ) -> Result<Vec<Pickup>, FileError> {
        let mut pickups: Vec<Pickup> = Vec::with_capacity(file.pickup.len());
        for text in &file.pickup {
            let surface = self.surface_index(&text.surface, lens)?;
            let followed = self.surface_index(&text.follows, lens)?;
            let number = self.parameter(&text.parameter, &lens.surfaces[followed])?;
            let is_named = |v: &Variable| (v.surface, v.number) == (followed, number);
            let name = text.parameter.get_ref();
            let Some(variable) = variables.iter().position(is_named) else {
                let message = format!("{name} of surface {} is not a variable", followed + 1);
                let error = self.error("follows", text.follows.span(), message);
                return Err(error.hint("a pickup follows a number that a [[variable]] names"));
            };
            // The following surface must have a number of the same name: indices of different shapes do not correspond.
            if !parameters(&lens.surfaces[surface]).iter().any(|(known, _)| known == name) {
                let message = format!("surface {} has no {name}", surface + 1);
                return Err(self.error("surface", text.surface.span(), message));
            }
            let is_last = number == Number::Thickness && surface + 1 == lens.surfaces.len();
            let settled = match (file.solve.as_ref(), number) {
                _ if is_last => Some("the image plane is placed at the image"),
                (Some(SolveText { efl: Some(efl), .. }), Number::Curvature)
                    if *efl.surface.get_ref() == surface + 1 =>
                {
                    Some("[solve] efl computes it")
                }
                (Some(SolveText { length: Some(length), .. }), Number::Thickness)
                    if *length.surface.get_ref() == surface + 1 =>
                {
                    Some("[solve] length computes it")
                }
                _ => None,
            };
            if let Some(why) = settled {
                let message = format!("{name} of surface {} cannot follow", surface + 1);
                return Err(self.error("surface", text.surface.span(), message).hint(why));
            }
            let taken = variables.iter().any(|v| (v.surface, v.number) == (surface, number))
                || pickups.iter().any(|p| p.surface == surface && variables[p.variable].number == number);
            if taken {
                let message = format!("{name} of surface {} is a variable or follows already", surface + 1);
                return Err(self.error("surface", text.surface.span(), message));
            }
            let factor = |key: &str, text: &Option<Placed>, default: f64| {
                text.as_ref().map_or(Ok(default), |value| self.finite(key, value))
            };
            let scale = factor("scale", &text.scale, 1.0)?;
            let offset = number.from_stated_difference(factor("offset", &text.offset, 0.0)?);
            pickups.push(Pickup { surface, variable, scale, offset });
        }
        Ok(pickups)
    }

    /// Pickups that give a number another value than the file does: both are possible, and one counts.
    fn contradicting_pickups(&self, file: &LensText, read: &LensFile) -> Vec<Loss> {
        let contradicting = |(text, pickup): (&PickupText, &Pickup)| {
            let Pickup { surface, variable, scale, offset } = *pickup;
            let Variable { surface: followed, number, .. } = read.variables[variable];
            let [own, followed] = [surface, followed].map(|i| number.read(&read.lens, i));
            let picked = scale * followed + offset;
            let size = [own, scale * followed, offset].into_iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            if (own - picked).abs() <= SAME_NUMBER * size {
                return None;
            }
            let name = text.parameter.get_ref();
            let [own, picked] = [own, picked].map(|value| for_message(number.stated(value)));
            let message = format!(
                "{name} of surface {} is {own} in the file, and its pickup makes it {picked}: optimisations and designs begin with the pickup's, everything \
                 else has the number of the file",
                surface + 1
            );
            Some(self.contradiction("[[pickup]]", Effect::Approximated, text.surface.span(), message))
        };
        file.pickup.iter().zip(&read.pickups).filter_map(contradicting).collect()
    }

    /// Solves that the lens of the file does not fulfil: their lens is another one.
    fn contradicting_solves(&self, file: &LensText, lens: &Lens) -> Vec<Loss> {
        let Some(solve) = &file.solve else { return Vec::new() };
        let contradicting = |what: &str, unit: &str, own: f64, solved: &Placed| {
            let wanted = solved.get_ref().0;
            // A lens without the figure at all has nothing that a solve could contradict.
            if !own.is_finite() || (own - wanted).abs() <= SOLVED * own.abs().max(wanted.abs()) {
                return None;
            }
            let message = format!(
                "the {what} is {own:.5}{unit} in the file, and its solve makes it {wanted}{unit}: optimisations and designs begin with the solve's, everything \
                 else has the lens of the file"
            );
            Some(self.contradiction("[solve]", Effect::Unsolved, solved.span(), message))
        };
        let efl = solve.efl.as_ref().and_then(|text| {
            let own_mm = first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
            contradicting("focal length", " mm", own_mm, &text.efl_mm)
        });
        let magnification = solve
            .magnification
            .as_ref()
            .and_then(|text| contradicting("magnification", "", magnification(lens)?, &text.magnification));
        let length = solve.length.as_ref().and_then(|text| {
            let own_mm = lens.total_track_mm() - lens.image_distance_mm();
            contradicting("length from the first vertex to the last", " mm", own_mm, &text.length_mm)
        });
        [efl, magnification, length].into_iter().flatten().collect()
    }

    /// The loss of a pickup or a solve that contradicts the lens of its file.
    fn contradiction(&self, record: &str, effect: Effect, span: Range<usize>, message: String) -> Loss {
        let line = self.error("", span, "").line;
        Loss { line, record: record.to_owned(), effect, message, more: 0 }
    }

    fn length_solve(
        &self,
        file: &LensText,
        lens: &Lens,
        variables: &[Variable],
    ) -> Result<Option<(usize, f64)>, FileError> {
        let Some(text) = file.solve.as_ref().and_then(|s| s.length.as_ref()) else { return Ok(None) };
        let surface = self.surface_index(&text.surface, lens)?;
        let length_mm = self.finite("length_mm", &text.length_mm)?;
        if surface + 1 == lens.surfaces.len() {
            let message = "the last distance is to the image, and the length is that between the vertices";
            return Err(self.error("surface", text.surface.span(), message));
        }
        if variables.iter().any(|v| (v.surface, v.number) == (surface, Number::Thickness)) {
            let message = format!("the thickness behind surface {} is a variable already", surface + 1);
            let error = self.error("surface", text.surface.span(), message);
            return Err(error.hint("a thickness is either solved for or varied"));
        }
        if let Err(defect) = validate(&with_length(lens, surface, length_mm)) {
            let message = format!("a length of {length_mm} mm makes this lens impossible: {defect}");
            return Err(self.error("length_mm", text.length_mm.span(), message).hint(format!(
                "it counts from the first vertex to the last, here {} mm",
                lens.total_track_mm() - lens.image_distance_mm()
            )));
        }
        Ok(Some((surface, length_mm)))
    }

    /// Checks that bounds enclose the lens's own value, and that every value between them is possible.
    fn check_bounds(&self, text: &VariableText, variable: &Variable, lens: &Lens) -> Result<(), FileError> {
        let Variable { surface, number, min, max } = *variable;
        let name = format!("{} of surface {}", text.parameter.get_ref(), surface + 1);
        if min >= max {
            let message = format!("the bounds of {name} are reversed: {min} is not below {max}");
            return Err(self.error("max", text.max.span(), message).hint("exchange `min` and `max`"));
        }
        if number == Number::Curvature && min <= 0.0 && max >= 0.0 {
            let message = format!("the bounds of {name} include a radius of 0");
            return Err(self.error("min", text.min.span(), message).hint(
                "keep both bounds on the side of the centre of curvature, or vary `curvature_per_mm`",
            ));
        }
        let (forwards, backwards) = (lens.light_goes_forwards(surface), max > 0.0);
        if number == Number::Thickness && forwards && min < 0.0 {
            let message = format!("the bounds of {name} include a negative thickness");
            return Err(self.error("min", text.min.span(), message).hint("the least is 0"));
        }
        if number == Number::Thickness && !forwards && backwards {
            let message = format!("the bounds of {name} include a positive thickness behind a mirror");
            return Err(self.error("max", text.max.span(), message).hint("the greatest is 0"));
        }
        // Allow for rounding: a radius is computed back from its curvature.
        let (value, slack) = (number.read_stated(lens, surface), 1e-9 * (max - min));
        // A thickness against the light cannot be within its bounds: the lens cannot be built, and a start begins at the bound.
        if number == Number::Thickness && if forwards { value < 0.0 } else { value > 0.0 } {
            return Ok(());
        }
        let (key, place) = if value < min - slack {
            ("min", &text.min)
        } else if value > max + slack {
            ("max", &text.max)
        } else {
            return Ok(());
        };
        let message = format!("{name} is {value} in this lens, outside its bounds {min} to {max}");
        Err(self.error(key, place.span(), message).hint("widen the bounds or change the lens"))
    }

    fn efl_solve(
        &self,
        file: &LensText,
        lens: &Lens,
        variables: &[Variable],
    ) -> Result<Option<EflSolve>, FileError> {
        let Some(text) = file.solve.as_ref().and_then(|s| s.efl.as_ref()) else { return Ok(None) };
        let efl_mm = self.finite("efl_mm", &text.efl_mm)?;
        let surface = self.solved_radius(&text.surface, lens, variables)?;
        if efl_mm == 0.0 {
            return Err(self.error("efl_mm", text.efl_mm.span(), "no lens has a focal length of 0"));
        }
        let radius_mm = self.solved_bounds(text.radius_mm.as_ref(), surface, lens)?;
        Ok(Some(EflSolve { surface, efl_mm, radius_mm }))
    }

    fn magnification_solve(
        &self,
        file: &LensText,
        lens: &Lens,
        variables: &[Variable],
    ) -> Result<Option<MagnificationSolve>, FileError> {
        let Some(solve) = file.solve.as_ref() else { return Ok(None) };
        let Some(text) = solve.magnification.as_ref() else { return Ok(None) };
        let magnification = self.finite("magnification", &text.magnification)?;
        let wrong = |message: &str| self.error("magnification", text.magnification.span(), message);
        if solve.efl.is_some() {
            let error = wrong("one radius holds the focal length or the magnification, not both");
            return Err(error.hint("leave `efl` out for a near object"));
        }
        if lens.object == ObjectDistance::Infinity {
            let error = wrong("an object at infinity has no magnification");
            return Err(error.hint("hold the focal length: efl = { surface = ..., efl_mm = ... }"));
        }
        if magnification == 0.0 {
            return Err(wrong("no image of a near object has a magnification of 0"));
        }
        let surface = self.solved_radius(&text.surface, lens, variables)?;
        let radius_mm = self.solved_bounds(text.radius_mm.as_ref(), surface, lens)?;
        Ok(Some(MagnificationSolve { surface, magnification, radius_mm }))
    }

    /// The surface whose radius is solved for.
    fn solved_radius(
        &self,
        number: &Spanned<usize>,
        lens: &Lens,
        variables: &[Variable],
    ) -> Result<usize, FileError> {
        let surface = self.surface_index(number, lens)?;
        if !parameters(&lens.surfaces[surface]).iter().any(|(_, n)| *n == Number::Curvature) {
            let message = format!("surface {} is a thin lens and has no radius to solve for", surface + 1);
            return Err(self.error("surface", number.span(), message));
        }
        if variables.iter().any(|v| (v.surface, v.number) == (surface, Number::Curvature)) {
            let message = format!("the radius of surface {} is a variable already", surface + 1);
            let error = self.error("surface", number.span(), message);
            return Err(error.hint("a radius is either solved for or varied"));
        }
        Ok(surface)
    }

    /// Bounds of a radius that is solved for, mm.
    fn solved_bounds(
        &self,
        bounds: Option<&Spanned<[f64; 2]>>,
        surface: usize,
        lens: &Lens,
    ) -> Result<Option<[f64; 2]>, FileError> {
        let Some(bounds) = bounds else { return Ok(None) };
        let [min, max] = *bounds.get_ref();
        let radius = Number::Curvature.read_stated(lens, surface);
        // Allow for rounding: a radius is computed back from its curvature.
        if !(min < max && radius >= min - 1e-9 && radius <= max + 1e-9) {
            let message = format!("radius {radius} of this lens is not between {min} and {max}");
            let error = self.error("radius_mm", bounds.span(), message);
            return Err(error.hint("write [min, max] around the lens's own radius"));
        }
        Ok(Some([min, max]))
    }

    fn expect(&self, text: &ExpectText, lens: &Lens) -> Result<Expect, FileError> {
        let one = |key: &str, text: &Option<ExpectedText>| -> Result<Option<Expected>, FileError> {
            let read = |text: &ExpectedText| {
                Ok(Expected {
                    value: self.finite(key, &text.value)?,
                    tolerance: self.positive("tolerance", &text.tolerance)?,
                })
            };
            text.as_ref().map(read).transpose()
        };
        let mut spots = None;
        if let Some(text) = &text.rms_spot_um {
            let (found, fields) = (text.values.get_ref().len(), lens.fields_deg.len());
            if found != fields {
                let message = format!("{found} values do not fit the lens's {fields} fields");
                return Err(self.error("values", text.values.span(), message).hint("one per field"));
            }
            let values = text.values.get_ref().iter();
            spots = Some(ExpectedSpots {
                values_um: values.map(|v| self.positive("values", v)).collect::<Result<_, _>>()?,
                relative_tolerance: self.positive("relative_tolerance", &text.relative_tolerance)?,
            });
        }
        Ok(Expect {
            efl_mm: one("efl_mm", &text.efl_mm)?,
            bfl_mm: one("bfl_mm", &text.bfl_mm)?,
            f_number: one("f_number", &text.f_number)?,
            total_track_mm: one("total_track_mm", &text.total_track_mm)?,
            rms_spot_um: spots,
        })
    }

    /// The error for a defect of the lens, at the number in the file that causes it.
    fn defect(&self, defect: &LensDefect, file: &LensText) -> FileError {
        let message = defect.to_string();
        let surface = defect.surface().and_then(|n| file.surface.get(n - 1)).map(Spanned::get_ref);
        let Some(surface) = surface else {
            return self.missing("surface", 0..0, message);
        };
        let thickness = ("thickness_mm", surface.thickness_mm.span());
        // A key that the file leaves out has its place at the thickness.
        let at = |key: &'static str, span: Option<Range<usize>>| match span {
            Some(span) => (key, span),
            None => thickness.clone(),
        };
        let semi_diameter = surface.semi_diameter_mm.as_ref().map(Spanned::span);
        let culprit = Culprit::of(defect);
        let measured = measured_surfaces(defect);
        let follows_beam = if culprit == Culprit::SemiDiameter && measured.is_empty() {
            semi_diameter.is_none()
        } else {
            measured.into_iter().filter(|i| *i < file.surface.len()).any(|i| is_open(file, i))
        };
        let pupil = &file.aperture.entrance_pupil_diameter_mm;
        let (key, span) = match culprit {
            Culprit::Thickness => thickness.clone(),
            Culprit::SemiDiameter if follows_beam => ("entrance_pupil_diameter_mm", pupil.span()),
            Culprit::SemiDiameter | Culprit::Other => at("semi_diameter_mm", semi_diameter),
            Culprit::Placement => at("placement", surface.placement.as_ref().map(Spanned::span)),
            Culprit::ThinLens => at("thin_lens", surface.thin_lens.as_ref().map(Spanned::span)),
            Culprit::Glass => at("glass", surface.glass.as_ref().map(Spanned::span)),
        };
        self.error(key, span, message).hint(hint(defect, follows_beam))
    }
}

/// Whether a surface, from 0, has no edge of its own.
fn is_open(file: &LensText, surface: usize) -> bool {
    let surface = file.surface[surface].get_ref();
    surface.semi_diameter_mm.is_none() || surface.open.as_ref().is_some_and(|open| *open.get_ref())
}
