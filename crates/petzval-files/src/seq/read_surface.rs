//! Reads a surface: its line and the commands that refer to it, then the surface that they define.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::command::{Command, Word};
use super::glass::{PrivateGlasses, fictitious};
use crate::draft::{Break, Clear, Drafted, Offset, Places, Record, check_angles, in_mm, is_bend, set_powers};
use crate::loss::{Effect, Losses};
use crate::old_glass::substitute;
use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Dispersion, Glass};
use petzval_optics::lens::{Action, Axis, Departure, Placement, Surface, SurfaceShape, XY_TERMS};

/// Remark on a glass of which the file gives index and Abbe number alone.
const BY_CAUCHY: &str =
    "the fictitious glass has the dispersion of its Abbe number by Cauchy's formula, not by the program's";

/// Coefficients of r^4, r^6, ..., r^20.
const LETTERS: [&str; 9] = ["A", "B", "C", "D", "E", "F", "G", "H", "J"];

/// Coefficients of an anamorphic asphere: its rotationally symmetric terms, and their asymmetries in [`UNROUND`].
const ROUND: [&str; 4] = ["AR", "BR", "CR", "DR"];
const UNROUND: [&str; 4] = ["AP", "BP", "CP", "DP"];

const DECENTERS: [&str; 6] = ["XDE", "YDE", "ZDE", "ADE", "BDE", "CDE"];

/// The highest number of a coefficient of a special surface.
const MOST_COEFFICIENTS: usize = 200;

/// Whether a command refers to a surface.
pub(super) fn is_surface_command(name: &str) -> bool {
    const OTHERS: &[&str] = &[
        "CON", "ASP", "SPH", "CYL", "YTO", "AAS", "SPS", "SCO", "K", "KX", "KY", "CUF", "RDY", "RDX", "CUY",
        "CUX", "THI", "GLA", "RMD", "SLB", "DAR", "BEN", "REV", "XOD", "YOD", "ZOD", "CIR", "REX", "REY",
        "ELX", "ELY", "ADX", "ADY", "ARO", "MLT", "COA",
    ];
    [OTHERS, &LETTERS, &ROUND, &UNROUND, &DECENTERS].iter().any(|list| list.contains(&name))
}

/// The formula of a shape.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Formula {
    /// A conic with even powers from r^4.
    #[default]
    Asphere,
    Cylinder,
    ToroidY,
    Anamorphic,
    /// All powers of r.
    Odd,
    /// Powers of x and y.
    Polynomial,
}

/// The axis behind the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Turn {
    #[default]
    Follow,
    Return,
    Bend,
    Reverse,
}

/// The commands of one surface, in the units of the file.
#[derive(Debug, Default)]
pub(super) struct RawSurface {
    pub record: Record,
    is_object: bool,
    /// Radius or curvature, by the mode of the file.
    radius_or_curvature: f64,
    curvature: Option<f64>,
    curvature_x: Option<f64>,
    pub thickness: f64,
    /// The command of its thickness, if it is not the line of the surface.
    thickness_at: Option<Record>,
    glass: Option<(Word, Record)>,
    mirror: bool,
    formula: (Formula, Record),
    conic: f64,
    conic_x: f64,
    even: [f64; 9],
    round: [f64; 4],
    coefficients: BTreeMap<usize, f64>,
    norm_radius: f64,
    decenter: [f64; 6],
    turn: (Turn, Record),
    /// The last command that rotates the surface.
    pub turned: Record,
    is_placed: bool,
    edge: Option<f64>,
    /// The last command of its aperture.
    edge_at: Option<Record>,
    half_widths: [f64; 2],
    offset: [f64; 2],
    /// The command of its offset.
    offset_at: Record,
    label: String,
}

/// A surface in mm.
pub(super) struct Made {
    pub drafted: Drafted,
    /// Shift of the surface along the axis in front, mm.
    pub along_mm: f64,
    /// The break of the axis behind it.
    pub behind: Option<Break>,
    /// The note to print if the glass is not exactly that of the file.
    pub substituted: Option<String>,
    /// Whether it is a plane without edge, placement and change of medium, so that only its break matters.
    pub does_nothing: bool,
}

/// The placement of a surface.
#[derive(Default)]
pub(super) struct Decenter {
    pub placement: Option<Placement>,
    pub along_mm: f64,
    pub behind: Option<Break>,
    /// Reduction of the thickness behind, because the axis returns, mm.
    back_mm: f64,
}

impl RawSurface {
    /// Reads the line of a surface, `S radius thickness [glass] [REFL]`.
    pub fn new(command: &Command) -> Result<Self, FileError> {
        let infinite = |index: usize| {
            is_infinite(command.words.get(index..=index).unwrap_or(&[])).then_some(f64::INFINITY)
        };
        let is_object = command.name == "SO" || command.name == "S0";
        let radius = infinite(0).map_or_else(|| command.number(0), Ok)?;
        let thickness = match (command.words.len(), infinite(1)) {
            (_, Some(_)) if !is_object => {
                return Err(command.error("only the object may be at infinity"));
            }
            (_, Some(far)) => far,
            (1, None) => 0.0,
            (_, None) => command.number(1)?,
        };
        let mut raw = Self {
            record: command.record.clone(),
            is_object,
            radius_or_curvature: radius,
            thickness,
            formula: (Formula::default(), command.record.clone()),
            turn: (Turn::default(), command.record.clone()),
            turned: command.record.clone(),
            ..Self::default()
        };
        for (i, word) in command.words.iter().enumerate().skip(2) {
            match word.text.to_uppercase().as_str() {
                _ if word.quoted && i == 2 => raw.glass = Some((word.clone(), command.record.clone())),
                "REFL" => raw.mirror = true,
                "REFR" => {}
                _ if i == 2 => raw.glass = Some((word.clone(), command.record.clone())),
                other => {
                    let message = format!("`{other}` after radius, thickness and glass is not read");
                    return Err(command
                        .error(message)
                        .hint("a glass of nd and Vd is one word, as 1.5168:64.17"));
                }
            }
        }
        Ok(raw)
    }

    /// Reads a command that refers to the surface.
    pub fn read(&mut self, command: &Command, words: &[Word], losses: &mut Losses) -> Result<(), FileError> {
        let name = command.name.as_str();
        let value = || only_number(command, words);
        let is_number = is_infinite(words) || words.first().is_some_and(|w| w.text.parse::<f64>().is_ok());
        let mut lose = |effect, message: &str| command.record.lose(losses, effect, message);
        let place = |list: &[&str]| list.iter().position(|known| *known == name);
        if let Some(i) = place(&LETTERS) {
            self.even[i] = value()?;
            return Ok(());
        }
        if let Some(i) = place(&ROUND) {
            self.round[i] = value()?;
            return Ok(());
        }
        if place(&UNROUND).is_some() {
            return match value()? {
                0.0 => Ok(()),
                _ => {
                    Err(command.error("terms of an anamorphic asphere that differ in x and y are not traced"))
                }
            };
        }
        if let Some(i) = place(&DECENTERS) {
            self.decenter[i] = value()?;
            self.is_placed = true;
            if self.decenter[i] != 0.0 && i > 2 {
                self.turned = command.record.clone();
            }
            return Ok(());
        }
        match name {
            "CON" | "ASP" | "SPH" => self.formula = (Formula::Asphere, command.record.clone()),
            "CYL" => self.formula = (Formula::Cylinder, command.record.clone()),
            "YTO" => self.formula = (Formula::ToroidY, command.record.clone()),
            "AAS" => self.formula = (Formula::Anamorphic, command.record.clone()),
            "SPS" => {
                let formula = match words.first().map(|w| w.text.to_uppercase()).as_deref() {
                    Some("ODD") => Formula::Odd,
                    Some("XYP") => Formula::Polynomial,
                    other => {
                        let message = format!("special surfaces {} are not read", other.unwrap_or(""));
                        return Err(command.error(message).hint("ODD and XYP are"));
                    }
                };
                if words.len() > 1 {
                    self.norm_radius = only_number(command, &words[1..])?;
                }
                self.formula = (formula, command.record.clone());
            }
            "SCO" => self.read_coefficient(command, words)?,
            "K" | "KY" => self.conic = value()?,
            "KX" => self.conic_x = value()?,
            "CUF" if value()? != 0.0 => return Err(command.error("Fresnel surfaces are not traced")),
            "CUF" => {}
            "RDY" | "CUY" | "RDX" | "CUX" | "THI" if !is_number => {
                lose(Effect::NoRay, "the solve is not kept, but its value is");
            }
            "RDY" | "RDX" => {
                let curvature = curvature_of(if is_infinite(words) { f64::INFINITY } else { value()? });
                let to = if name == "RDY" { &mut self.curvature } else { &mut self.curvature_x };
                *to = Some(curvature);
            }
            "CUY" => self.curvature = Some(value()?),
            "CUX" => self.curvature_x = Some(value()?),
            "THI" if is_infinite(words) => {
                if !self.is_object {
                    return Err(command.error("only the object may be at infinity"));
                }
                self.thickness = f64::INFINITY;
            }
            "THI" => {
                self.thickness = value()?;
                self.thickness_at = Some(command.record.clone());
            }
            "GLA" => {
                let [word] = words else { return Err(command.error("the glass must be one word")) };
                self.glass = Some((word.clone(), command.record.clone()));
            }
            "RMD" => {
                self.mirror = match words.first().map(|w| w.text.to_uppercase()).as_deref() {
                    Some("REFL") => true,
                    Some("REFR") => false,
                    _ => return Err(command.error("only the ray modes REFR and REFL are traced")),
                }
            }
            "SLB" => self.label = words.first().map(|w| w.text.clone()).unwrap_or_default(),
            "DAR" | "BEN" | "REV" => {
                let turn = match name {
                    "DAR" => Turn::Return,
                    "BEN" => Turn::Bend,
                    _ => Turn::Reverse,
                };
                self.turn = (turn, command.record.clone());
                self.is_placed = true;
            }
            "XOD" | "YOD" | "ZOD" => {
                if value()? != 0.0 {
                    return Err(command.error("rotations about another point than the vertex are not read"));
                }
            }
            "CIR" | "REX" | "REY" | "ELX" | "ELY" => self.read_aperture(command, words, losses)?,
            "ADX" | "ADY" => {
                let value = qualified_number(command, words)?;
                // Offsets of edges and obscurations are not kept, like these themselves.
                if !["EDG", "OBS", "HOL"].iter().any(|what| says(words, what)) {
                    self.offset[usize::from(name == "ADY")] = value;
                    self.offset_at = command.record.clone();
                }
            }
            "ARO" => {}
            _ => lose(Effect::NoRay, "coatings are not read"),
        }
        Ok(())
    }

    /// Reads `SCO name value`; the name is `K`, `AR3` (of r^3), `C4` or `NRADIUS`.
    fn read_coefficient(&mut self, command: &Command, words: &[Word]) -> Result<(), FileError> {
        let name = words.first().map(|w| w.text.to_uppercase()).unwrap_or_default();
        let value = only_number(command, words.get(1..).unwrap_or(&[]))?;
        let counted = |prefix: &str| name.strip_prefix(prefix).and_then(|n| n.parse::<usize>().ok());
        let norm = if self.formula.0 == Formula::Odd { 33 } else { 67 };
        let index = match name.as_str() {
            "K" => Some(1),
            "NRADIUS" => Some(norm),
            _ => counted("AR")
                .filter(|_| self.formula.0 == Formula::Odd)
                .map(|n| n + 1)
                .or_else(|| counted("C")),
        };
        match index {
            Some(1) => self.conic = value,
            Some(index) if index == norm => self.norm_radius = value,
            Some(index) if (2..=MOST_COEFFICIENTS).contains(&index) => {
                self.coefficients.insert(index, value);
            }
            _ => return Err(command.error(format!("the coefficient `{name}` is not known"))),
        }
        Ok(())
    }

    /// Reads `CIR [EDG|OBS|HOL|CLR] [L'label'] radius` and the other apertures.
    fn read_aperture(
        &mut self,
        command: &Command,
        words: &[Word],
        losses: &mut Losses,
    ) -> Result<(), FileError> {
        let says = |what: &str| says(words, what);
        let value = qualified_number(command, words)?;
        // An edge is the rim of the glass and does not block light.
        if says("EDG") {
            return Ok(());
        }
        let mut lose = |message: &str| {
            command.record.lose(losses, Effect::Approximated, message);
        };
        if says("OBS") || says("HOL") {
            lose("obscurations and holes are not kept: light passes there");
            return Ok(());
        }
        if value <= 0.0 {
            return Err(command.error("an aperture must be positive"));
        }
        self.edge_at = Some(command.record.clone());
        match command.name.as_str() {
            "CIR" => self.edge = Some(value),
            "REX" => self.half_widths[0] = value,
            "REY" => self.half_widths[1] = value,
            _ => self.edge = Some(self.edge.map_or(value, |e| e.max(value))),
        }
        if self.half_widths != [0.0; 2] && command.name.starts_with("RE") {
            self.edge = Some(self.half_widths[0].hypot(self.half_widths[1]));
        }
        if command.name != "CIR" {
            lose("the aperture is not round; a circle around it is taken");
        }
        Ok(())
    }

    /// Whether the number of the surface's line is implausible as a curvature: its radius would be below a lens unit.
    pub fn is_hardly_a_curvature(&self) -> bool {
        self.curvature.is_none() && self.radius_or_curvature.abs() > 1.0
    }

    /// Curvature in the y-z section, in units of the file.
    fn curvature(&self, radii: bool) -> f64 {
        // `INF` means a plane in either mode.
        self.curvature.unwrap_or(if radii || self.radius_or_curvature.is_infinite() {
            curvature_of(self.radius_or_curvature)
        } else {
            self.radius_or_curvature
        })
    }

    /// The number that a command sets, in units of the file; infinity for the radius of a plane. `None` for other commands than those of thickness,
    /// curvature, radius, conic constant, even powers and placement.
    pub fn value(&self, command: &str, radii: bool) -> Option<f64> {
        let of = |list: &[&str], values: &[f64]| {
            list.iter().zip(values).find(|(name, _)| **name == command).map(|(_, value)| *value)
        };
        match command {
            "THI" => Some(self.thickness),
            "CUY" => Some(self.curvature(radii)),
            "RDY" => Some(1.0 / self.curvature(radii)),
            "K" | "KY" => Some(self.conic),
            _ => of(&LETTERS, &self.even).or_else(|| of(&DECENTERS, &self.decenter)),
        }
    }

    /// Checks that object or image is a plane, and that the object is in air.
    pub fn check_plane(&self, mm: f64, radii: bool, what: &str) -> Result<(), FileError> {
        if self.curvature(radii) != 0.0 {
            return Err(self.record.error(format!("a curved {what} is not traced")).hint("make it a plane"));
        }
        // The conic constant has no effect on a plane.
        let shape = SurfaceShape { conic: 0.0, ..self.shape(mm, radii)? };
        if shape != SurfaceShape::PLANE {
            let message = format!("an {what} that is not a plane is not traced");
            return Err(self.formula.1.error(message).hint("make it a plane"));
        }
        match &self.glass {
            Some((_, record)) if what == "object" => Err(record.error("an object in glass is not traced")),
            _ => Ok(()),
        }
    }

    /// Whether the surface is shifted or rotated.
    pub fn is_moved(&self) -> bool {
        self.decenter != [0.0; 6]
    }

    /// The surface, in mm.
    pub fn make(
        &self,
        mm: f64,
        radii: bool,
        front: &Arc<Glass>,
        private: &PrivateGlasses,
        catalog: &Catalog,
    ) -> Result<Made, FileError> {
        let mut substituted = None;
        let glass = match &self.glass {
            _ if self.mirror => front.clone(),
            None => Glass::air(),
            Some((word, record)) => match private.medium(word, catalog, record) {
                Ok(glass) => {
                    let has_abbe_number = matches!(glass.dispersion, Dispersion::NdVd { .. });
                    substituted = private.remark(word);
                    if has_abbe_number && fictitious(&word.text).is_some() {
                        substituted = Some(BY_CAUCHY.to_owned());
                    }
                    glass
                }
                Err(error) => {
                    let (upper, of_maker) = (word.text.to_uppercase(), "_SCHOTT");
                    let name = upper.strip_suffix(of_maker).unwrap_or(&upper);
                    let (glass, said) = substitute(name, None, catalog).ok_or(error)?;
                    substituted = Some(said);
                    glass
                }
            },
        };
        let shape = self.shape(mm, radii)?;
        let Decenter { placement, along_mm, behind, back_mm } = self.decenter(mm)?;
        if self.turn.0 == Turn::Bend && self.is_placed && !self.mirror {
            return Err(self.turn.1.error("only a mirror bends the axis"));
        }
        let thickness_mm = self.thickness * mm - back_mm;
        let edge = self.edge.map(|edge| (edge + self.offset[0].hypot(self.offset[1])) * mm);
        let does_nothing = shape == SurfaceShape::PLANE
            && !self.mirror
            && glass == *front
            && edge.is_none()
            && placement.is_none();
        let surface = Surface {
            label: self.label.clone(),
            shape,
            thickness_mm: if behind.is_some() { 0.0 } else { thickness_mm },
            glass,
            action: if self.mirror { Action::Reflect } else { Action::Refract },
            placement,
            ..Surface::default()
        };
        let clear = edge.map_or(Clear::Open(0.0), Clear::Edge);
        let offset = self.edge.filter(|_| self.offset != [0.0; 2]).map(|edge| Offset {
            at_mm: self.offset.map(|v| v * mm),
            radius_mm: edge * mm,
            record: self.offset_at.clone(),
        });
        Ok(Made {
            drafted: Drafted { surface, clear, record: self.record.clone(), places: self.places(), offset },
            along_mm,
            behind: behind.map(|b| Break { thickness_mm, thickness_at: Some(self.thickness_at()), ..b }),
            substituted,
            does_nothing,
        })
    }

    /// The command of its thickness.
    fn thickness_at(&self) -> Record {
        self.thickness_at.as_ref().unwrap_or(&self.record).clone()
    }

    fn places(&self) -> Places {
        Places {
            thickness: Some(self.thickness_at()),
            clear: self.edge_at.clone(),
            glass: self.glass.as_ref().map(|(_, record)| record.clone()),
        }
    }

    /// The placement of the surface. Rotations about x and y are left-handed.
    pub fn decenter(&self, mm: f64) -> Result<Decenter, FileError> {
        if !self.is_placed || self.decenter == [0.0; 6] {
            return Ok(Decenter::default());
        }
        let [x, y, z, alpha, beta, gamma] = self.decenter;
        let placed = Placement {
            decenter_mm: [x * mm, y * mm],
            tilt_rad: [0.0 - alpha.to_radians(), 0.0 - beta.to_radians(), gamma.to_radians()],
            axis: Axis::Follows,
        };
        check_angles(&placed.tilt_rad, &self.turned)?;
        let along_mm = z * mm;
        let (turn, record) = &self.turn;
        let with = |axis: Axis| Some(Placement { axis, ..placed });
        match turn {
            Turn::Follow => Ok(Decenter { placement: Some(placed), along_mm, ..Decenter::default() }),
            Turn::Return => {
                Ok(Decenter { placement: with(Axis::Returns), along_mm, back_mm: along_mm, behind: None })
            }
            _ if along_mm != 0.0 => {
                Err(record
                    .error("a shift along an axis that is bent or reversed at the surface is not read"))
            }
            Turn::Bend => match with(Axis::Bends) {
                Some(bend) if is_bend(&bend) => Ok(Decenter { placement: Some(bend), ..Decenter::default() }),
                _ => {
                    Err(record.error("a mirror that bends the axis about two axes at once is not read").hint(
                        "the order of the two rotations behind the mirror is not known; use two dummy surfaces",
                    ))
                }
            },
            Turn::Reverse => {
                let behind = Break {
                    decenter_mm: placed.decenter_mm.map(|v| 0.0 - v),
                    tilt_rad: placed.tilt_rad.map(|v| 0.0 - v),
                    tilt_first: true,
                    record: record.clone(),
                    ..Break::default()
                };
                Ok(Decenter { behind: Some(behind), ..Decenter::default() })
            }
        }
    }

    /// The shape, in mm.
    fn shape(&self, mm: f64, radii: bool) -> Result<SurfaceShape, FileError> {
        let (formula, record) = &self.formula;
        let mut shape =
            SurfaceShape { curvature: self.curvature(radii) / mm, conic: self.conic, ..SurfaceShape::PLANE };
        for (i, value) in self.even.iter().enumerate() {
            match shape.asphere.get_mut(i + 1) {
                Some(a) => *a = in_mm(*value, 2 * i + 4, mm),
                None if *value == 0.0 => {}
                None => {
                    let (letter, power) = (LETTERS[i], 2 * i + 4);
                    let message =
                        format!("the term {letter} of r^{power} is not traced: powers up to 16 are");
                    return Err(record.error(message));
                }
            }
        }
        // Check that the coefficients belong to the formula, then fill in its departure from a conic.
        let has_even = self.even.iter().any(|a| *a != 0.0);
        let special = matches!(formula, Formula::Odd | Formula::Polynomial);
        if !special && self.coefficients.values().any(|v| *v != 0.0) {
            return Err(record.error("coefficients SCO need a special surface, SPS"));
        }
        let unround = self.round.iter().any(|v| *v != 0.0) || self.conic_x != 0.0;
        if unround && *formula != Formula::Anamorphic {
            return Err(record.error("coefficients of an anamorphic asphere need AAS"));
        }
        if has_even && (special || *formula == Formula::Anamorphic) {
            return Err(record.error("coefficients A, B, ... of this kind of surface are not read"));
        }
        match formula {
            Formula::Asphere if self.curvature_x.is_some_and(|c| c != self.curvature(radii)) => {
                return Err(record.error("a surface with another curvature in x must name its kind"));
            }
            Formula::Asphere => {}
            Formula::Cylinder | Formula::ToroidY => {
                let curvature_x = match (formula, self.curvature_x) {
                    (_, Some(c)) => c / mm,
                    (Formula::Cylinder, None) => 0.0,
                    _ => shape.curvature,
                };
                if *formula == Formula::Cylinder && curvature_x != 0.0 && shape.curvature != 0.0 {
                    return Err(record.error("a cylinder is curved in x or in y, not in both"));
                }
                shape.departure = Departure::Toroid { curvature_x };
            }
            Formula::Anamorphic => {
                for (i, value) in self.round.iter().enumerate() {
                    shape.asphere[i + 1] = in_mm(*value, 2 * i + 4, mm);
                }
                let curvature_x = self.curvature_x.map_or(shape.curvature, |c| c / mm);
                shape.departure = Departure::Biconic { curvature_x, conic_x: self.conic_x };
            }
            Formula::Odd => self.powers(&mut shape, mm)?,
            Formula::Polynomial => {
                let mut coefficients = [0.0; XY_TERMS];
                for (index, value) in &self.coefficients {
                    match coefficients.get_mut(index - 2) {
                        Some(to) => *to = value * mm,
                        None if *value == 0.0 => {}
                        None => {
                            let message =
                                format!("the coefficient C{index} is not traced: degrees up to 8 are");
                            return Err(record.error(message));
                        }
                    }
                }
                let norm_radius_mm = self.norm_radius_or_one() * mm;
                if !(1e-6..=1e6).contains(&norm_radius_mm) {
                    let message = format!("a normalisation radius of {norm_radius_mm} mm is not traced");
                    return Err(record.error(message));
                }
                shape.departure = Departure::Xy { norm_radius_mm, coefficients };
            }
        }
        Ok(shape)
    }

    /// The normalisation radius in units of the file; 0 stands for 1.
    fn norm_radius_or_one(&self) -> f64 {
        if self.norm_radius == 0.0 { 1.0 } else { self.norm_radius }
    }

    /// Sets all powers of r: coefficient i + 1 is that of r^i.
    fn powers(&self, shape: &mut SurfaceShape, mm: f64) -> Result<(), FileError> {
        let terms = self.coefficients.iter().map(|(index, value)| (index - 1, *value));
        set_powers(shape, terms, self.norm_radius_or_one(), mm)
            .map_err(|message| self.formula.1.error(message))
    }
}

/// The only value of a command.
fn only_number(command: &Command, words: &[Word]) -> Result<f64, FileError> {
    match words {
        [word] => finite(word),
        _ => None,
    }
    .ok_or_else(|| match words.len() {
        0 | 1 => command.error("a finite number is missing"),
        count => command.error(format!("one value is read, but there are {count}")),
    })
}

/// The only number of a command, after its qualifiers.
fn qualified_number(command: &Command, words: &[Word]) -> Result<f64, FileError> {
    let (last, before) = words.split_last().ok_or_else(|| command.error("a finite number is missing"))?;
    if before.iter().any(|word| finite(word).is_some()) {
        Err(command.error("one number is read, but there are more"))
    } else {
        only_number(command, std::slice::from_ref(last))
    }
}

fn finite(word: &Word) -> Option<f64> {
    word.text.parse().ok().filter(|v: &f64| v.is_finite() && !word.quoted)
}

fn says(words: &[Word], what: &str) -> bool {
    words.iter().any(|w| w.text.eq_ignore_ascii_case(what))
}

/// Whether the only value is infinity.
fn is_infinite(words: &[Word]) -> bool {
    matches!(words, [word] if ["INF", "INFINITY"].iter().any(|name| word.text.eq_ignore_ascii_case(name)))
}

/// The curvature of a radius; 0 and infinity stand for a plane.
fn curvature_of(radius: f64) -> f64 {
    if radius == 0.0 { 0.0 } else { 1.0 / radius }
}
