//! Reads a surface block: its records, then the surface that they define.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::record::{Line, SOLVES, SURFACE_BOOKKEEPING, SURFACE_LOST};
use crate::decimal::shown;
use crate::draft::{Break, Clear, Drafted, Offset, Places};
use crate::loss::{Effect, Losses};
use crate::old_glass::{substitute, unknown_glass};
use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{Action, Surface, SurfaceShape};

/// Highest index of a parameter or an extra value.
const MOST_PARAMETERS: usize = 300;

/// State of a semi-diameter that the user set.
const FIXED: f64 = 1.0;

/// Codes of a value's state without a solve: fixed and variable.
const FREE_STATES: [f64; 2] = [0.0, 1.0];

/// Unit and glass catalogues for the conversion of surfaces.
pub(super) struct Shapes<'a> {
    /// Millimetres in a lens unit.
    pub mm: f64,
    pub catalog: &'a Catalog,
    /// Catalogues of the file, in upper case.
    pub catalogs: &'a [String],
}

/// A value and its line.
pub(super) type Said<'a> = (f64, Line<'a>);

/// The records of one surface.
#[derive(Debug, Default)]
pub(super) struct RawSurface<'a> {
    pub line: Line<'a>,
    pub kind: Option<Line<'a>>,
    pub curvature: Option<Said<'a>>,
    pub conic: Option<Said<'a>>,
    pub parameters: BTreeMap<usize, Said<'a>>,
    pub extra: BTreeMap<usize, Said<'a>>,
    pub thickness: Option<Line<'a>>,
    glass: Option<Line<'a>>,
    semi_diameter: Option<Line<'a>>,
    pub stop: Option<Line<'a>>,
    comment: String,
    /// Radius of the aperture, or of the circle that encloses it, in units of the file.
    aperture: Option<(f64, Line<'a>)>,
    offset: Option<([f64; 2], Line<'a>)>,
    floats: bool,
    turned: Option<Line<'a>>,
    /// Records of [`ONCE`] that were read.
    said: Vec<&'a str>,
}

/// What to do about a last surface that is no image.
const CUT_SHORT: &str = "is the file cut short? the image is a plane without a glass behind it";

/// Records that a surface has at most once.
const ONCE: &[&str] = &["TYPE", "CURV", "CONI", "DISZ", "GLAS", "DIAM", "STOP", "OBDC"];

impl<'a> RawSurface<'a> {
    pub fn new(line: Line<'a>) -> Self {
        Self { line, ..Self::default() }
    }

    /// Reads one record.
    pub fn read(&mut self, line: Line<'a>, losses: &mut Losses) -> Result<(), FileError> {
        if ONCE.contains(&line.keyword) {
            if self.said.contains(&line.keyword) {
                let message = format!("the surface already has a line {}", line.keyword);
                return Err(line.error(message).hint("keep one of the two"));
            }
            self.said.push(line.keyword);
        }
        match line.keyword {
            "TYPE" => self.kind = Some(line),
            "CURV" => {
                let state = line.number(1)?.unwrap_or(0.0);
                if !FREE_STATES.contains(&state) {
                    report_solve(&line, losses);
                }
                self.curvature = Some((line.needed(0)?, line));
            }
            "CONI" => self.conic = Some((line.needed(0)?, line)),
            "PARM" | "XDAT" => {
                let index = line.count(0)?;
                if index > MOST_PARAMETERS {
                    return Err(line.error(format!("numbers are counted up to {MOST_PARAMETERS}")));
                }
                let value = line.needed(1)?;
                let to = if line.keyword == "PARM" { &mut self.parameters } else { &mut self.extra };
                if let Some((_, earlier)) = to.insert(index, (value, line.clone())) {
                    let message = format!("line {} already gives this number", earlier.number);
                    return Err(line.error(message).hint("keep one of the two"));
                }
            }
            "DISZ" => self.thickness = Some(line),
            "GLAS" => self.glass = Some(line),
            "DIAM" => self.semi_diameter = Some(line),
            "STOP" => self.stop = Some(line),
            "COMM" => self.comment = line.rest().to_owned(),
            "FLAP" => self.floats = true,
            "CLAP" => {
                if line.needed(0)? != 0.0 {
                    let message = "the hole in the middle of the aperture is not kept";
                    line.lose(losses, Effect::Approximated, message);
                }
                self.aperture = Some((line.needed(1)?, line));
            }
            "SQAP" | "ELAP" => {
                let [a, b] = [line.needed(0)?, line.needed(1)?];
                let around = if line.keyword == "SQAP" { a.hypot(b) } else { a.abs().max(b.abs()) };
                let message = "the aperture is not round; a circle around it is taken";
                line.lose(losses, Effect::Approximated, message);
                self.aperture = Some((around, line));
            }
            "OBDC" => {
                let offset = [line.needed(0)?, line.needed(1)?];
                if offset != [0.0; 2] {
                    self.offset = Some((offset, line));
                }
            }
            "OBSC" | "SQOB" | "ELOB" | "SPID" | "UDAD" => {
                let message = "obscurations and apertures of free shape are not kept: light passes there";
                line.lose(losses, Effect::Approximated, message);
            }
            // `SCBD` holds tilts as surface properties: two flags and an order, then shifts and angles.
            "SCBD" => {
                if line.has_values(3) {
                    self.turned = Some(line);
                }
            }
            "IGNR" if line.number(0)?.unwrap_or(1.0) == 0.0 => {}
            "IGNR" => {
                let message = "an ignored surface is not read: whether its thickness counts is not known";
                let hint = "delete the surface in OpticStudio, or write IGNR 0 if light meets it";
                return Err(line.error(message).hint(hint));
            }
            known if SURFACE_BOOKKEEPING.contains(&known) => {}
            known if SOLVES.contains(&known) => report_solve(&line, losses),
            known => {
                let lost = SURFACE_LOST.iter().find(|(keyword, _)| *keyword == known);
                match lost {
                    Some((_, message)) => line.lose(losses, Effect::NoRay, *message),
                    None => {
                        line.lose(losses, Effect::NotUnderstood, "this record is not understood");
                    }
                }
            }
        }
        Ok(())
    }

    /// The name of the surface's formula.
    pub fn kind_name(&self) -> &'a str {
        self.kind.as_ref().and_then(|line| line.word(0)).unwrap_or("STANDARD")
    }

    /// An error about the type of the surface.
    pub fn kind_error(&self, message: impl Into<String>) -> FileError {
        self.kind.as_ref().unwrap_or(&self.line).error(message)
    }

    pub fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(&index).map_or(0.0, |said| said.0)
    }

    /// Distance to the next surface, mm; may be infinite.
    pub fn thickness_mm(&self, shapes: &Shapes<'_>) -> Result<f64, FileError> {
        match &self.thickness {
            None => Ok(0.0),
            Some(line) if line.word(0).is_some_and(|w| w.eq_ignore_ascii_case("INFINITY")) => {
                Ok(f64::INFINITY)
            }
            Some(line) => Ok(line.needed(0)? * shapes.mm),
        }
    }

    /// Distance to the next surface, mm. Fails if it is infinite.
    fn finite_thickness_mm(&self, shapes: &Shapes<'_>) -> Result<f64, FileError> {
        let mm = self.thickness_mm(shapes)?;
        match (&self.thickness, mm.is_finite()) {
            (Some(line), false) => Err(line.error("only the object may be at infinity")),
            _ => Ok(mm),
        }
    }

    /// Checks that the last surface of a file is an image, and not a surface of the lens at which the file is cut short.
    pub fn check_image(&self, shapes: &Shapes<'_>) -> Result<(), FileError> {
        self.check_not_turned()?;
        if let Some(line) = &self.glass {
            let message = "the last surface has a glass, so it is not an image";
            return Err(line.error(message).hint(CUT_SHORT));
        }
        let checked = self.check_end(shapes, "image");
        let has_length = |line: &&Line<'_>| line.number(0).is_ok_and(|number| number.unwrap_or(0.0) != 0.0);
        match self.thickness.as_ref().filter(has_length) {
            Some(line) if checked.is_err() => {
                let message = "the last surface is no plane and has a thickness, so it is not an image";
                Err(line.error(message).hint(CUT_SHORT))
            }
            _ => checked,
        }
    }

    /// Checks that object or image is a plane, and that the object is in air.
    pub fn check_end(&self, shapes: &Shapes<'_>, what: &str) -> Result<(), FileError> {
        self.check_not_turned()?;
        if matches!(self.kind_name(), "COORDBRK" | "PARAXIAL") {
            let message = format!("the {what} cannot be of this type");
            return Err(self.kind_error(message).hint("make it a plane, STANDARD"));
        }
        if let Some((_, line)) = self.curvature.as_ref().filter(|c| c.0 != 0.0) {
            return Err(line.error(format!("a curved {what} is not traced")).hint("make it a plane"));
        }
        let (shape, phase) = self.shape(shapes)?;
        // The conic constant has no effect on a plane.
        if phase.is_some() || (SurfaceShape { conic: 0.0, ..shape }) != SurfaceShape::PLANE {
            let message = format!("an {what} that is not a plane is not traced");
            return Err(self.kind_error(message).hint("make it a plane"));
        }
        match &self.glass {
            Some(line) if what == "object" => Err(line.error("an object in glass is not traced")),
            _ => Ok(()),
        }
    }

    fn check_not_turned(&self) -> Result<(), FileError> {
        match &self.turned {
            None => Ok(()),
            Some(line) => Err(line
                .error("shifts and tilts as properties of a surface are not read")
                .hint("write them as coordinate breaks (surfaces of type COORDBRK)")),
        }
    }

    /// The coordinate break that this surface is; `None` if it is a surface.
    pub fn coordinate_break(&self, shapes: &Shapes<'_>) -> Result<Option<Break>, FileError> {
        if self.kind_name() != "COORDBRK" {
            return Ok(None);
        }
        self.check_not_turned()?;
        let p = |index: usize| self.parameter(index);
        Ok(Some(Break {
            decenter_mm: [p(1) * shapes.mm, p(2) * shapes.mm],
            tilt_rad: [p(3), p(4), p(5)].map(f64::to_radians),
            tilt_first: p(6) != 0.0,
            thickness_mm: self.finite_thickness_mm(shapes)?,
            record: self.kind.as_ref().unwrap_or(&self.line).record(),
            thickness_at: self.thickness.as_ref().map(Line::record),
        }))
    }

    /// The surface.
    pub fn surface(&self, shapes: &Shapes<'_>, losses: &mut Losses) -> Result<Drafted, FileError> {
        self.check_not_turned()?;
        let mirror = self.glass.as_ref().filter(|line| line.word(0) == Some("MIRROR"));
        let (shape, phase) = self.shape(shapes)?;
        let action = match (self.kind_name(), mirror) {
            ("PARAXIAL", None) => Action::ThinLens { power_per_mm: self.power(shapes)? },
            ("PARAXIAL", Some(line)) => return Err(line.error("a thin lens that reflects is not traced")),
            (_, Some(line)) if phase.is_some() => {
                let message =
                    "a diffractive structure on a mirror is not read: the sign of its orders is not known";
                return Err(line.error(message));
            }
            (_, Some(_)) => Action::Reflect,
            (_, None) => Action::Refract,
        };
        let glass = match &self.glass {
            Some(line) if mirror.is_none() => self.medium(line, shapes, losses)?,
            _ => Glass::air(),
        };
        let (label, thickness_mm) = (self.comment.clone(), self.finite_thickness_mm(shapes)?);
        let surface = Surface { label, shape, thickness_mm, glass, action, phase, ..Surface::default() };
        let record = self.kind.as_ref().unwrap_or(&self.line).record();
        let offset = self.offset_aperture(shapes);
        Ok(Drafted { surface, clear: self.clear(shapes, losses)?, record, places: self.places(), offset })
    }

    fn places(&self) -> Places {
        let aperture = self.aperture.as_ref().map(|(_, line)| line);
        Places {
            thickness: self.thickness.as_ref().map(Line::record),
            clear: aperture.or(self.semi_diameter.as_ref()).map(Line::record),
            glass: self.glass.as_ref().map(Line::record),
        }
    }

    /// The clear semi-diameter. Only an aperture blocks light; a semi-diameter without one does not.
    fn clear(&self, shapes: &Shapes<'_>, losses: &mut Losses) -> Result<Clear, FileError> {
        if let Some((_, line)) = self.offset.as_ref().filter(|_| self.aperture.is_none()) {
            let floating = "a floating aperture stays at the vertex; its shift is not kept";
            let message = if self.floats { floating } else { "this shifts no aperture that is kept" };
            line.lose(losses, Effect::Approximated, message);
        }
        let offset = self.offset.as_ref().map_or(0.0, |([x, y], _)| x.hypot(*y));
        let printed = match &self.semi_diameter {
            None => 0.0,
            Some(line) => line.needed(0)?.abs() * shapes.mm,
        };
        match &self.aperture {
            Some((radius, line)) => match (radius + offset) * shapes.mm {
                edge if edge > 0.0 => Ok(Clear::Edge(edge)),
                _ => Err(line.error("the aperture must be positive")),
            },
            None if self.floats && printed > 0.0 => {
                let kind = if self.has_fixed_semi_diameter()? { Clear::Edge } else { Clear::Beam };
                Ok(kind(printed))
            }
            None => Ok(Clear::Open(printed)),
        }
    }

    /// Whether the user set the semi-diameter, the second value of `DIAM`. Otherwise the program fits it to its rays.
    fn has_fixed_semi_diameter(&self) -> Result<bool, FileError> {
        let state = self.semi_diameter.as_ref().map(|line| line.number(1)).transpose()?.flatten();
        Ok(state == Some(FIXED))
    }

    /// The aperture, if it is off the vertex.
    fn offset_aperture(&self, shapes: &Shapes<'_>) -> Option<Offset> {
        let ((at, line), (radius, _)) = (self.offset.as_ref()?, self.aperture.as_ref()?);
        let at_mm = at.map(|v| v * shapes.mm);
        Some(Offset { at_mm, radius_mm: radius * shapes.mm, record: line.record() })
    }

    /// The medium of `GLAS name state pickup nd Vd ...`.
    fn medium(
        &self,
        line: &Line<'a>,
        shapes: &Shapes<'_>,
        losses: &mut Losses,
    ) -> Result<Arc<Glass>, FileError> {
        let Some(name) = line.word(0) else { return Err(line.error("the glass has no name")) };
        let state = line.number(1)?.unwrap_or(0.0);
        // A model glass whose numbers a solve sets keeps the numbers.
        let is_model = name == MODEL_GLASS && state != 4.0;
        if is_model && state != 1.0 {
            report_solve(line, losses);
        }
        match if is_model { 1.0 } else { state } {
            // A model glass: its index and Abbe number.
            1.0 => {
                let [nd, vd] = [line.needed(3)?, line.number(4)?.unwrap_or(0.0)];
                if !(nd >= 1.0 && vd >= 0.0) {
                    return Err(line.error("a model glass has an index from 1 and an Abbe number from 0"));
                }
                let dispersion = match vd {
                    // A glass without dispersion has no Abbe number.
                    vd if vd == 0.0 || nd == 1.0 => Dispersion::Constant(nd),
                    vd => {
                        let message =
                            "the model glass has the dispersion of its Abbe number by Cauchy's formula";
                        line.lose(losses, Effect::Approximated, message);
                        Dispersion::NdVd { nd, vd }
                    }
                };
                let name = if name == MODEL_GLASS {
                    format!("{}:{}", shown(nd), shown(vd))
                } else {
                    name.to_owned()
                };
                return Ok(Arc::new(Glass::new(&name, dispersion)));
            }
            0.0 | 3.0 => {}
            2.0 => report_solve(line, losses),
            4.0 => return Err(line.error("a glass with offsets of its index and Abbe number is not read")),
            other => {
                let message = format!("the effect of state {} of a glass is not known", shown(other));
                return Err(line.error(message).hint("0 is a fixed glass, 1 a model glass"));
            }
        }
        // A glass without a maker is the user's own, and the last word where it was added last.
        let by_name = shapes.catalog.get(name);
        if let Ok(own) = &by_name
            && own.maker.is_empty()
        {
            return Ok(own.clone());
        }
        // If several makers share the name, take the first that the file names. None stands in for one that was left out.
        let place = |maker: &str| place_of(maker, shapes.catalogs);
        let all = shapes.catalog.all(name).iter().rev();
        let of_file =
            all.filter_map(|glass| Some((place(&glass.maker)?, glass))).min_by_key(|(place, _)| *place);
        let is_first = |maker: &str| match place(maker) {
            Some(own) => of_file.is_none_or(|(found, _)| own <= found),
            None => maker.is_empty() && by_name.is_err(),
        };
        if let Some((_, refused)) = shapes.catalog.refusals(name).find(|(maker, _)| is_first(maker)) {
            return Err(unknown_glass(&line.record(), &refused));
        }
        if let Some((_, glass)) = of_file {
            return Ok(glass.clone());
        }
        let glass = match by_name {
            Ok(glass) => glass,
            Err(unknown) => {
                let stated = [line.number(3)?.unwrap_or(0.0), line.number(4)?.unwrap_or(0.0)];
                let is_said = stated != NOT_STATED && stated[0] > 1.0 && stated[1] >= 0.0;
                let Some((glass, said)) = substitute(name, is_said.then_some(stated), shapes.catalog) else {
                    return Err(unknown_glass(&line.record(), &unknown));
                };
                line.lose(losses, Effect::Approximated, said);
                return Ok(glass);
            }
        };
        let maker = &glass.maker;
        if !maker.is_empty() && !shapes.catalogs.is_empty() && place(maker).is_none() {
            let message = format!("the glass is that of {maker}, which the file's GCAT does not name");
            line.lose(losses, Effect::Approximated, message);
        }
        Ok(glass)
    }
}

/// The name of a model glass.
const MODEL_GLASS: &str = "___BLANK";

/// Index and Abbe number that the program writes beside a name that it does not know.
const NOT_STATED: [f64; 2] = [1.5, 40.0];

/// The place of a maker among the catalogues that a file names. Generic materials are in several of them and come last.
fn place_of(maker: &str, catalogs: &[String]) -> Option<usize> {
    let maker = maker.to_uppercase();
    match maker.as_str() {
        "" => None,
        "GENERIC" => (!catalogs.is_empty()).then_some(catalogs.len()),
        maker => catalogs.iter().position(|catalog| catalog.contains(maker)),
    }
}

fn report_solve(line: &Line<'_>, losses: &mut Losses) {
    line.lose(losses, Effect::NoRay, "the solve is not kept, but its value is");
}
