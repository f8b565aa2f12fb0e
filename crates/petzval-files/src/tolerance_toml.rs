//! The tolerance file in TOML: the tolerances of a lens's numbers, and its compensators.
//!
//! ```
//! # use petzval_base::FileError; use petzval_files::{parse_lens, parse_tolerances};
//! # use petzval_optics::glass::Catalog;
//! # let lens = parse_lens("name = 'x'\nunits = 'mm'\naperture = { entrance_pupil_diameter_mm = 5.0 }\n\
//! #     wavelengths = { um = [0.55] }\nfields = { angle_deg = [0.0] }\nglass.G = { nd = 1.5, vd = 60.0 }\n\
//! #     surface = [{ stop = true, radius_mm = 50.0, thickness_mm = 3.0, glass = 'G', semi_diameter_mm = 4.0 },\n\
//! #     { radius_mm = -50.0, thickness_mm = 48.0, semi_diameter_mm = 4.0 }]", &Catalog::default())?.lens;
//! let file = parse_tolerances(
//!     r#"
//! grade = "precision"      # for numbers without a [[tolerance]]; without a grade these are exact
//! distribution = "normal"  # cut at two sigma; or "uniform", "parabolic"
//!
//! [[tolerance]]
//! surface = 1
//! radius_mm = 0.02
//! thickness_mm = 0.03
//! index = 0                # exact
//!
//! [[tolerance]]
//! element = [1, 2]         # surfaces 1 to 2, as one body
//! decenter_mm = 0.01       # along x and along y
//! tilt_arcmin = 1.5
//! distribution = "uniform"
//!
//! [[compensator]]
//! element = [1, 2]
//! parameter = "decenter_y_mm"
//! travel = 0.1
//! "#,
//!     &lens,
//! )?;
//! assert_eq!(file.entries.len(), 7);
//! # Ok::<(), FileError>(())
//! ```
//!
//! Surfaces are counted from 1 in the file and from 0 in [`ToleranceFile`].

use std::collections::BTreeMap;
use std::ops::Range;

use schemars::JsonSchema;
use serde::Deserialize;

use super::spanned::Spanned;
use super::toml_number::Number;
use petzval_base::FileError;
use petzval_optics::lens::Lens;
use petzval_optics::tolerance::{
    Distribution, Freedom, Grade, Perturbation, Quantity, Tolerances, default_tolerances,
};

/// The content of a tolerance file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToleranceFile {
    /// The grade of all numbers without a tolerance of their own.
    pub grade: Option<Grade>,
    /// The default distribution.
    pub distribution: Distribution,
    /// The tolerances of the file, in the units of their quantities. A tolerance of 0 means that the number is exact.
    pub entries: Vec<Perturbation>,
    /// The compensators, which are adjusted on every lens, with their travel to either side.
    pub compensators: Vec<(Freedom, Option<f64>)>,
    /// Tolerances that are wider than the room between parts, each with its place in the file: some lenses cannot be built.
    pub wide: Vec<FileError>,
}

impl ToleranceFile {
    /// The tolerances of a lens: those of the file, and those of its grade for all other numbers. With `focus`, the image plane
    /// is a compensator.
    pub fn tolerances(&self, lens: &Lens, focus: bool) -> Tolerances {
        let mut perturbations = match self.grade {
            Some(grade) => default_tolerances(lens, grade, self.distribution, !focus),
            None => Vec::new(),
        };
        perturbations.retain(|p| !self.entries.iter().any(|e| is_same(&e.freedom, &p.freedom)));
        perturbations.extend(self.entries.iter().filter(|e| e.tolerance > 0.0));
        let mut compensators = self.compensators.clone();
        let image = Freedom::focus(lens);
        if focus && compensators.iter().all(|(freedom, _)| *freedom != image) {
            compensators.insert(0, (image, None));
        }
        Tolerances { perturbations, compensators }
    }
}

/// Whether two freedoms are the same error in different units: a radius in mm, a radius in percent and a power in fringes.
fn is_same(a: &Freedom, b: &Freedom) -> bool {
    let kind = |quantity: Quantity| match quantity {
        Quantity::RadiusPercent | Quantity::Power => Quantity::Radius,
        other => other,
    };
    (kind(a.quantity), a.first, a.last) == (kind(b.quantity), b.first, b.last)
}

/// Tolerances of the numbers of a lens, and its compensators.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(crate) struct FileText {
    /// Tolerances of every number without one of its own: "commercial", "precision" or "high". Without a grade these numbers are exact.
    grade: Option<Spanned<String>>,
    /// How errors are distributed between their limits: "normal" (cut at two sigma), "uniform" or "parabolic".
    distribution: Option<Spanned<String>>,
    /// Tolerances of a surface or of an element.
    #[serde(default)]
    tolerance: Vec<Spanned<ToleranceText>>,
    /// What is adjusted on every lens that is made.
    #[serde(default)]
    compensator: Vec<Spanned<CompensatorText>>,
}

type Placed = Spanned<Number>;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct ToleranceText {
    /// The surface, counted from 1.
    surface: Option<Spanned<usize>>,
    /// First and last surface of an element, which moves as one body.
    element: Option<Spanned<Vec<usize>>>,
    /// Distribution of these errors, in place of that of the file.
    distribution: Option<Spanned<String>>,
    /// Radius of curvature, either way. Unit: mm.
    radius_mm: Option<Placed>,
    /// Radius of curvature, either way. Unit: %.
    radius_percent: Option<Placed>,
    /// Power against a test plate. Unit: fringes.
    power_fringes: Option<Placed>,
    /// Conic constant, either way.
    conic: Option<Placed>,
    /// Irregularity that is alike all round, peak to valley. Unit: fringes.
    irregularity_fringes: Option<Placed>,
    /// Errors of form at the edge of the clear aperture, by even orders from 2 to 16: `{ r4 = 0.1 }`. Unit: um.
    form_um: Option<Spanned<BTreeMap<Spanned<String>, Placed>>>,
    /// Distance to the next vertex, either way; all that follows moves along. Unit: mm.
    thickness_mm: Option<Placed>,
    /// Refractive index behind the surface, either way.
    index: Option<Placed>,
    /// Abbe number behind the surface, at a fixed index of the d line, either way. Unit: %.
    abbe_percent: Option<Placed>,
    /// Decentre along x and along y. Unit: mm.
    decenter_mm: Option<Placed>,
    /// Decentre along x. Unit: mm.
    decenter_x_mm: Option<Placed>,
    /// Decentre along y. Unit: mm.
    decenter_y_mm: Option<Placed>,
    /// Tilt about x and about y. Unit: arcmin.
    tilt_arcmin: Option<Placed>,
    /// Tilt about x. Unit: arcmin.
    tilt_x_arcmin: Option<Placed>,
    /// Tilt about y. Unit: arcmin.
    tilt_y_arcmin: Option<Placed>,
    /// Shift of an element along the axis, between neighbours that stay. Unit: mm.
    shift_mm: Option<Placed>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct CompensatorText {
    /// The surface, counted from 1.
    surface: Option<Spanned<usize>>,
    /// First and last surface of an element, which moves as one body.
    element: Option<Spanned<Vec<usize>>>,
    /// What is adjusted: "thickness_mm", "decenter_x_mm", "decenter_y_mm", "tilt_x_arcmin", "tilt_y_arcmin" or "shift_mm".
    parameter: Spanned<String>,
    /// How far it can be adjusted to either side, in the unit of the parameter; without a limit if it is left out.
    travel: Option<Placed>,
}

/// Quantities that can be compensators: those that can be adjusted after manufacture.
const SETTINGS: [(&str, Quantity); 6] = [
    ("thickness_mm", Quantity::Thickness),
    ("decenter_x_mm", Quantity::DecenterX),
    ("decenter_y_mm", Quantity::DecenterY),
    ("tilt_x_arcmin", Quantity::TiltX),
    ("tilt_y_arcmin", Quantity::TiltY),
    ("shift_mm", Quantity::Shift),
];

/// Reads the tolerances of a lens.
pub fn parse_tolerances(text: &str, lens: &Lens) -> Result<ToleranceFile, FileError> {
    let file: FileText = FileError::read_toml(text)?;
    let reader = Reader { text, lens };
    let grade = file.grade.as_ref().map(|g| reader.grade(g)).transpose()?;
    let distribution = reader.distribution(file.distribution.as_ref())?.unwrap_or_default();
    let (mut entries, mut wide) = (Vec::new(), Vec::new());
    for table in &file.tolerance {
        reader.tolerance(table, distribution, &mut entries, &mut wide)?;
    }
    let compensators = file.compensator.iter().map(|c| reader.compensator(c)).collect::<Result<_, _>>()?;
    Ok(ToleranceFile { grade, distribution, entries, compensators, wide })
}

struct Reader<'a> {
    text: &'a str,
    lens: &'a Lens,
}

impl Reader<'_> {
    fn error(&self, key: &str, span: Range<usize>, message: impl Into<String>) -> FileError {
        FileError::at(self.text, span, key, message)
    }

    fn grade(&self, name: &Spanned<String>) -> Result<Grade, FileError> {
        match name.get_ref().as_str() {
            "commercial" => Ok(Grade::Commercial),
            "precision" => Ok(Grade::Precision),
            "high" => Ok(Grade::High),
            other => Err(self
                .error("grade", name.span(), format!("there is no grade `{other}`"))
                .hint("one of \"commercial\", \"precision\", \"high\"")),
        }
    }

    fn distribution(&self, name: Option<&Spanned<String>>) -> Result<Option<Distribution>, FileError> {
        let Some(name) = name else { return Ok(None) };
        match name.get_ref().as_str() {
            "uniform" => Ok(Some(Distribution::Uniform)),
            "normal" => Ok(Some(Distribution::Normal)),
            "parabolic" => Ok(Some(Distribution::Parabolic)),
            other => Err(self
                .error("distribution", name.span(), format!("there is no distribution `{other}`"))
                .hint("one of \"uniform\", \"normal\", \"parabolic\"")),
        }
    }

    /// First and last surface of a table, from 0.
    fn place(
        &self,
        surface: Option<&Spanned<usize>>,
        element: Option<&Spanned<Vec<usize>>>,
        table: Range<usize>,
    ) -> Result<(usize, usize), FileError> {
        let count = self.lens.surfaces.len();
        let check = |key: &str, span: Range<usize>, number: usize| {
            if (1..=count).contains(&number) {
                Ok(number - 1)
            } else {
                Err(self
                    .error(key, span, format!("surface {number} does not exist"))
                    .hint(format!("the lens has surfaces 1 to {count}")))
            }
        };
        match (surface, element) {
            (Some(s), None) => {
                let s = check("surface", s.span(), *s.get_ref())?;
                Ok((s, s))
            }
            (None, Some(list)) => {
                let [first, last] = list.get_ref()[..] else {
                    let message = "an element is given by its first and its last surface";
                    let error = self.error("element", list.span(), message);
                    return Err(error.hint("for example `element = [1, 2]`"));
                };
                let (a, b) = (check("element", list.span(), first)?, check("element", list.span(), last)?);
                if a <= b {
                    Ok((a, b))
                } else {
                    Err(self.error("element", list.span(), "the last surface comes before the first"))
                }
            }
            (Some(_), Some(list)) => Err(self
                .error("element", list.span(), "the table already names a surface")
                .hint("keep one of `surface` and `element`")),
            (None, None) => Err(self
                .error("surface", table, "no surface is named")
                .without_value()
                .hint("add `surface = 1`, or `element = [1, 2]` for surfaces that move as one body")),
        }
    }

    fn tolerance(
        &self,
        table: &Spanned<ToleranceText>,
        distribution: Distribution,
        entries: &mut Vec<Perturbation>,
        wide: &mut Vec<FileError>,
    ) -> Result<(), FileError> {
        let t = table.get_ref();
        let (first, last) = self.place(t.surface.as_ref(), t.element.as_ref(), table.span())?;
        let distribution = self.distribution(t.distribution.as_ref())?.unwrap_or(distribution);
        use Quantity as Q;
        let mut named: Vec<(String, Quantity, &Placed)> = Vec::new();
        for (key, quantities, value) in [
            ("radius_mm", &[Q::Radius][..], &t.radius_mm),
            ("radius_percent", &[Q::RadiusPercent], &t.radius_percent),
            ("power_fringes", &[Q::Power], &t.power_fringes),
            ("conic", &[Q::Conic], &t.conic),
            ("irregularity_fringes", &[Q::Irregularity], &t.irregularity_fringes),
            ("thickness_mm", &[Q::Thickness], &t.thickness_mm),
            ("index", &[Q::Index], &t.index),
            ("abbe_percent", &[Q::Abbe], &t.abbe_percent),
            ("decenter_mm", &[Q::DecenterX, Q::DecenterY], &t.decenter_mm),
            ("decenter_x_mm", &[Q::DecenterX], &t.decenter_x_mm),
            ("decenter_y_mm", &[Q::DecenterY], &t.decenter_y_mm),
            ("tilt_arcmin", &[Q::TiltX, Q::TiltY], &t.tilt_arcmin),
            ("tilt_x_arcmin", &[Q::TiltX], &t.tilt_x_arcmin),
            ("tilt_y_arcmin", &[Q::TiltY], &t.tilt_y_arcmin),
            ("shift_mm", &[Q::Shift], &t.shift_mm),
        ] {
            let value = value.iter();
            named.extend(value.flat_map(|v| quantities.iter().map(move |q| (key.to_owned(), *q, v))));
        }
        for (term, value) in t.form_um.iter().flat_map(|form| form.get_ref()) {
            let order = term.get_ref().strip_prefix('r').and_then(|n| n.parse::<usize>().ok());
            let Some(order) = order.filter(|n| (2..=16).contains(n) && n.is_multiple_of(2)) else {
                let message = format!("there is no form error `{}`", term.get_ref());
                return Err(self
                    .error("form_um", term.span(), message)
                    .hint("even orders from 2 to 16, in um at the edge of the clear aperture: `form_um = { r4 = 0.1 }`"));
            };
            named.push((term.get_ref().clone(), Q::Form(order), value));
        }
        if named.is_empty() {
            return Err(self
                .error("tolerance", table.span(), "this table gives no tolerance")
                .without_value()
                .hint("add, for example, `thickness_mm = 0.05`"));
        }
        for (key, quantity, value) in named {
            let tolerance = value.get_ref().0;
            if !(tolerance >= 0.0 && tolerance.is_finite()) {
                let error = self.error(&key, value.span(), "a tolerance is a finite number from 0");
                return Err(error.hint("it holds to either side"));
            }
            let freedom = Freedom { quantity, first, last };
            self.check(&key, value.span(), &freedom)?;
            if let Some(known) = entries.iter().find(|e| is_same(&e.freedom, &freedom)) {
                let message = format!("{} has a tolerance already", known.freedom.name());
                return Err(self.error(&key, value.span(), message).hint("keep one of the two"));
            }
            if let Some(room_mm) = freedom.room_mm(self.lens).filter(|room_mm| tolerance > *room_mm) {
                let message =
                    format!("wider than the {room_mm:.4} mm that are there; some lenses cannot be built");
                wide.push(self.error(&key, value.span(), message));
            }
            entries.push(Perturbation { freedom, tolerance, distribution });
        }
        Ok(())
    }

    fn compensator(&self, table: &Spanned<CompensatorText>) -> Result<(Freedom, Option<f64>), FileError> {
        let t = table.get_ref();
        let (first, last) = self.place(t.surface.as_ref(), t.element.as_ref(), table.span())?;
        let name = t.parameter.get_ref();
        let Some((_, quantity)) = SETTINGS.iter().find(|(key, _)| key == name) else {
            let known: Vec<&str> = SETTINGS.iter().map(|(key, _)| *key).collect();
            return Err(self
                .error("parameter", t.parameter.span(), format!("`{name}` cannot be adjusted on a lens"))
                .hint(format!("one of {}", known.join(", "))));
        };
        let freedom = Freedom { quantity: *quantity, first, last };
        self.check("parameter", t.parameter.span(), &freedom)?;
        let travel = match &t.travel {
            None => None,
            Some(travel) => match travel.get_ref().0 {
                v if v > 0.0 && v.is_finite() => Some(v),
                _ => return Err(self.error("travel", travel.span(), "a travel is a finite number above 0")),
            },
        };
        Ok((freedom, travel))
    }

    /// Checks that the lens has the freedom.
    fn check(&self, key: &str, span: Range<usize>, freedom: &Freedom) -> Result<(), FileError> {
        freedom.check(self.lens).map_err(|e| self.error(key, span, e.to_string()))
    }
}

/// The text of a tolerance file with one table per tolerance. Reading it gives the same tolerances.
pub fn write_tolerances(tolerances: &Tolerances) -> String {
    let place = |freedom: &Freedom| {
        if freedom.first == freedom.last {
            format!("surface = {}", freedom.first + 1)
        } else {
            format!("element = [{}, {}]", freedom.first + 1, freedom.last + 1)
        }
    };
    let mut out = String::new();
    for p in &tolerances.perturbations {
        let distribution = match p.distribution {
            Distribution::Uniform => "uniform",
            Distribution::Normal => "normal",
            Distribution::Parabolic => "parabolic",
        };
        let (key, tolerance) = (key_of(p.freedom.quantity), format!("{:?}", p.tolerance));
        let value = match p.freedom.quantity {
            Quantity::Form(order) => format!("{{ r{order} = {tolerance} }}"),
            _ => tolerance,
        };
        out += &format!(
            "[[tolerance]]\n{}\n{key} = {value}\ndistribution = \"{distribution}\"\n\n",
            place(&p.freedom)
        );
    }
    for (freedom, travel) in &tolerances.compensators {
        let travel = travel.map_or_else(String::new, |t| format!("travel = {t:?}\n"));
        let parameter = key_of(freedom.quantity);
        out += &format!("[[compensator]]\n{}\nparameter = \"{parameter}\"\n{travel}\n", place(freedom));
    }
    out
}

/// The key of a quantity in a file.
fn key_of(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Radius => "radius_mm",
        Quantity::RadiusPercent => "radius_percent",
        Quantity::Power => "power_fringes",
        Quantity::Conic => "conic",
        Quantity::Irregularity => "irregularity_fringes",
        Quantity::Form(_) => "form_um",
        Quantity::Thickness => "thickness_mm",
        Quantity::Index => "index",
        Quantity::Abbe => "abbe_percent",
        Quantity::DecenterX => "decenter_x_mm",
        Quantity::DecenterY => "decenter_y_mm",
        Quantity::TiltX => "tilt_x_arcmin",
        Quantity::TiltY => "tilt_y_arcmin",
        Quantity::Shift => "shift_mm",
    }
}
