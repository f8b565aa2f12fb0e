//! Surfaces: shape, place, what they do to light, and their edge.

use petzval_base::FileError;
use petzval_optics::glass::Catalog;
use petzval_optics::lens::{Action, Surface, SurfaceShape};

use super::material::medium;
use super::object::{Object, number_of};
use crate::draft::{Clear, Drafted, Places, Record, set_powers};
use crate::loss::{Effect, Losses};
use crate::yaml::Node;

/// Keys of a surface, of older and newer versions. `material_pre` repeats the medium behind the surface before, `thickness` the place.
const KEYS: &[&str] = &[
    "type",
    "geometry",
    "material_pre",
    "material_post",
    "is_stop",
    "aperture",
    "coating",
    "bsdf",
    "is_reflective",
    "comment",
    "thickness",
    "interaction_model",
    "surface_type",
    "focal_length",
];

/// Keys of a geometry; tolerance and number of iterations are those of the program's intersections.
const SHAPE_KEYS: &[&str] = &["type", "cs", "radius", "conic", "coefficients", "tol", "max_iter"];

const COORDINATES: [&str; 5] = ["x", "y", "rx", "ry", "rz"];

/// A surface of the file.
pub(super) struct RawSurface<'a> {
    object: Object<'a>,
    geometry: Object<'a>,
    pub record: Record,
    pub is_stop: bool,
    /// Place of the vertex on the axis, mm; the object may be at minus infinity.
    pub z_mm: f64,
}

impl<'a> RawSurface<'a> {
    /// Reads the place of the surface with a number, counted from the object.
    pub fn new(node: &'a Node, number: usize) -> Result<Self, FileError> {
        let name = format!("surface {number}");
        let object = Object::new(node, &name)?;
        let record = object.record(&name);
        let geometry = object.needed_object("geometry")?;
        let cs = geometry.needed_object("cs")?;
        if cs.object("reference_cs")?.is_some() {
            let message = format!("{name}: coordinates that refer to others are not read");
            return Err(cs.error("reference_cs", message));
        }
        for key in COORDINATES {
            if cs.number(key)?.is_some_and(|value| value != 0.0) {
                let message = format!("{name}: shifted and tilted surfaces are not read from this format");
                return Err(cs.error(key, message).hint("write the lens as .zmx, with coordinate breaks"));
            }
        }
        let z_mm = cs.number("z")?.unwrap_or(0.0);
        if z_mm.is_infinite() && !(number == 0 && z_mm < 0.0) {
            return Err(cs.error("z", format!("{name}: only the object may be at minus infinity")));
        }
        Ok(Self { is_stop: object.flag("is_stop")?, object, geometry, record, z_mm })
    }

    /// The kind of the surface.
    pub fn kind(&self) -> Result<&'a str, FileError> {
        self.object.needed_text("type")
    }

    /// Checks that object or image is a plane, and that the object is in air.
    pub fn check_end(&self, what: &str, catalog: &Catalog, losses: &mut Losses) -> Result<(), FileError> {
        if self.is_stop {
            return Err(self.record.error("neither object nor image can be the stop"));
        }
        let shape = self.shape(losses)?;
        if (SurfaceShape { conic: 0.0, ..shape }) != SurfaceShape::PLANE {
            let message = format!("{what} that is not a plane is not traced");
            return Err(self.record.error(message).hint("make it a plane"));
        }
        let in_air = |material| medium(&material, &self.record, catalog, losses).map(|glass| glass.is_air());
        match self.object.object("material_post")?.filter(|_| what == "an object").map(in_air).transpose()? {
            Some(false) => Err(self.record.error("an object in glass is not traced")),
            _ => Ok(()),
        }
    }

    /// The surface, with the distance to the next.
    pub fn make(
        &self,
        thickness_mm: f64,
        catalog: &Catalog,
        losses: &mut Losses,
    ) -> Result<Drafted, FileError> {
        self.object.report_others(KEYS, losses);
        // Newer versions have what the surface does to light in an object of its own.
        let model = self.object.object("interaction_model")?;
        let acts = model.unwrap_or(self.object);
        let model_name = model.map(|model| model.needed_text("type")).transpose()?;
        let is_thin_lens = match (self.kind()?, model_name) {
            ("Surface", None | Some("RefractiveReflectiveModel")) => false,
            ("ParaxialSurface", None) | ("Surface" | "ParaxialSurface", Some("ThinLensInteractionModel")) => {
                true
            }
            (kind, model) => {
                let what = model.unwrap_or(kind);
                return Err(self.record.error(format!("surfaces of the kind {what} are not traced")));
            }
        };
        if acts.flag("is_reflective")? {
            let message = format!("{}: mirrors are not read from this format", self.record.text);
            return Err(acts.error("is_reflective", message).hint("write the lens as .zmx"));
        }
        if acts.has("bsdf") {
            return Err(
                acts.error("bsdf", format!("{}: scattering surfaces are not traced", self.record.text))
            );
        }
        if acts.has("coating") {
            losses.add(acts.line("coating"), &self.record.text, Effect::NoRay, "coatings are not read");
        }
        let shape = self.shape(losses)?;
        let action = if is_thin_lens {
            match acts.needed_number("focal_length")? {
                f if f != 0.0 => Action::ThinLens { power_per_mm: 1.0 / f },
                _ => {
                    let message = format!("{}: a thin lens needs a focal length", self.record.text);
                    return Err(acts.error("focal_length", message));
                }
            }
        } else {
            Action::Refract
        };
        let material = self.object.needed_object("material_post")?;
        let surface = Surface {
            label: self.object.text("comment")?.unwrap_or("").to_owned(),
            shape,
            thickness_mm,
            glass: medium(&material, &self.record, catalog, losses)?,
            action,
            ..Surface::default()
        };
        let (record, places) = (self.record.clone(), Places::default());
        Ok(Drafted { surface, clear: self.clear(losses)?, record, places, offset: None })
    }

    /// The shape: `z = r^2 / (R (1 + sqrt(1 - (1 + k) r^2 / R^2)))` and, with i from 0, `C_i r^(2 i + 2)` of an even asphere or
    /// `C_i r^(i + 1)` of an odd one.
    fn shape(&self, losses: &mut Losses) -> Result<SurfaceShape, FileError> {
        let geometry = &self.geometry;
        let kind = geometry.needed_text("type")?;
        let name = &self.record.text;
        let power: fn(usize) -> usize = match kind {
            "Plane" | "StandardGeometry" | "OddAsphere" => |i| i + 1,
            "EvenAsphere" => |i| 2 * i + 2,
            other => {
                let message = format!("{name}: geometries of the type {other} are not traced");
                let hint = "Plane, StandardGeometry, EvenAsphere and OddAsphere are";
                return Err(geometry.error("type", message).hint(hint));
            }
        };
        geometry.report_others(SHAPE_KEYS, losses);
        let radius = match kind {
            "Plane" => {
                if geometry.number("radius")?.is_some_and(f64::is_finite) {
                    let message = "a plane has no radius; the one of the file is not kept";
                    losses.add(geometry.line("radius"), name, Effect::Approximated, message);
                }
                f64::INFINITY
            }
            _ => geometry.needed_number("radius")?,
        };
        if radius == 0.0 {
            return Err(geometry.error("radius", format!("{name}: a radius of 0 is no surface")));
        }
        let conic = geometry.number("conic")?.unwrap_or(0.0);
        if !conic.is_finite() {
            return Err(geometry.error("conic", format!("{name}: the conic constant must be finite")));
        }
        let mut shape = SurfaceShape { curvature: 1.0 / radius, conic, ..SurfaceShape::PLANE };
        if matches!(kind, "EvenAsphere" | "OddAsphere") {
            let mut terms = Vec::new();
            for (i, node) in geometry.list("coefficients")?.iter().enumerate() {
                let value = number_of(node, "coefficients")?;
                if !value.is_finite() {
                    return Err(node.error("coefficients", format!("{name}: coefficients must be finite")));
                }
                terms.push((power(i), value));
            }
            set_powers(&mut shape, terms.into_iter(), 1.0, 1.0)
                .map_err(|message| geometry.error("coefficients", format!("{name}: {message}")))?;
        }
        Ok(shape)
    }

    /// The edge that blocks light.
    fn clear(&self, losses: &mut Losses) -> Result<Clear, FileError> {
        let Some(aperture) = self.object.object("aperture")? else { return Ok(Clear::Open(0.0)) };
        let mut lose = |message: &str| {
            losses.add(self.object.line("aperture"), &self.record.text, Effect::Approximated, message);
        };
        match aperture.needed_text("type")? {
            "RadialAperture" => {
                if aperture.number("r_min")?.is_some_and(|hole| hole != 0.0) {
                    lose("the hole in the middle of the aperture is not kept");
                }
                match aperture.needed_number("r_max")? {
                    f64::INFINITY => Ok(Clear::Open(0.0)),
                    edge if edge > 0.0 => Ok(Clear::Edge(edge)),
                    _ => Err(aperture
                        .error("r_max", format!("{}: the aperture must be positive", self.record.text))),
                }
            }
            _ => {
                lose("the aperture is not round about the vertex, and is not kept: light passes there");
                Ok(Clear::Open(0.0))
            }
        }
    }
}
