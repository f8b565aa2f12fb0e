//! Reads a surface: its shape, its action on light, and its placement.

use std::ops::Range;
use std::sync::Arc;

use super::read::Reader;
use super::text::{BiconicText, ForbesText, Placed, PlacementText, SurfaceText, Terms, ToroidText};
use crate::spanned::Spanned;
use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Glass};
use petzval_optics::lens::{
    ASPHERE_TERMS, Action, Axis, Departure, ODD_TERMS, Pattern, Phase, Placement, Q_TERMS, Surface,
    SurfaceShape, XY_DEGREE, XY_TERMS, xy_index,
};
use petzval_optics::number::PHASE_TERMS;

/// In place of a clear semi-diameter that the file leaves out, until the beams are known: no shape ends within it.
const UNSTATED_MM: f64 = 1e-9;

impl Reader<'_> {
    /// Reads a surface. `front` is the medium in front of it, or `None` for the first surface.
    pub(super) fn surface(
        &self,
        number: usize,
        placed: &Spanned<SurfaceText>,
        glasses: &Catalog,
        front: Option<Arc<Glass>>,
    ) -> Result<Surface, FileError> {
        let surface = placed.get_ref();
        let mut asphere = [0.0; ASPHERE_TERMS];
        for (i, term) in surface.asphere.terms().into_iter().enumerate() {
            if let Some(term) = term {
                asphere[i] = self.finite(&format!("a{}", 2 * i + 2), term)?;
            }
        }
        let conic = surface.conic.as_ref().map_or(Ok(0.0), |k| self.finite("conic", k))?;
        let curvature = self.curvature(number, placed)?;
        let action = self.action(number, surface)?;
        let glass = match &surface.glass {
            Some(name) if action == Action::Reflect => {
                let message =
                    format!("surface {number} is a mirror: the medium behind it is the one in front");
                return Err(self.error("glass", name.span(), message).hint("leave `glass` out"));
            }
            None if action == Action::Reflect => front.unwrap_or_else(Glass::air),
            None => Glass::air(),
            Some(name) => glasses.get(name.get_ref()).map_err(|unknown| {
                let message = format!("surface {number}: {}", unknown.reason());
                self.error("glass", name.span(), message).hint(format!(
                    "the nearest names are {}; a glass of your own goes into [glass.NAME]",
                    unknown.nearest.join(", ")
                ))
            })?,
        };
        Ok(Surface {
            label: surface.label.clone(),
            shape: SurfaceShape { curvature, conic, asphere, departure: self.departure(number, surface)? },
            thickness_mm: self.finite("thickness_mm", &surface.thickness_mm)?,
            glass,
            semi_diameter_mm: match &surface.semi_diameter_mm {
                Some(semi) => self.positive("semi_diameter_mm", semi)?,
                None => UNSTATED_MM,
            },
            is_open: false,
            action,
            phase: self.phase(number, surface)?,
            placement: surface.placement.as_ref().map(|p| self.placement(p)).transpose()?,
        })
    }

    /// The vertex curvature, from its radius or from the curvature itself.
    fn curvature(&self, number: usize, placed: &Spanned<SurfaceText>) -> Result<f64, FileError> {
        let surface = placed.get_ref();
        let keys = ["radius_mm", "curvature_per_mm"];
        match self.reciprocal(number, keys, &surface.radius_mm, &surface.curvature_per_mm)? {
            Some(curvature) => Ok(curvature),
            None => {
                let message = format!("surface {number} has no radius");
                Err(self.missing("radius_mm", placed.span(), message).hint("a plane is `radius_mm = inf`"))
            }
        }
    }

    /// A curvature or power, from its reciprocal or from the value itself; `None` if the file gives neither.
    fn reciprocal(
        &self,
        number: usize,
        [reciprocal_key, key]: [&str; 2],
        reciprocal: &Option<Placed>,
        value: &Option<Placed>,
    ) -> Result<Option<f64>, FileError> {
        match (reciprocal, value) {
            (Some(radius), None) => {
                let value = radius.get_ref().0;
                let (what, none) = match reciprocal_key {
                    "focal_length_mm" => ("focal length", "a lens without power"),
                    _ => ("radius", "a plane"),
                };
                if value.is_nan() {
                    let message = format!("surface {number}: the {what} is not a number");
                    return Err(self.error(reciprocal_key, radius.span(), message));
                }
                if value == 0.0 {
                    let message = format!("surface {number}: a surface cannot have the {what} 0");
                    let error = self.error(reciprocal_key, radius.span(), message);
                    return Err(error.hint(format!("{none} is `{reciprocal_key} = inf`")));
                }
                Ok(Some(1.0 / value))
            }
            (None, Some(value)) => self.finite(key, value).map(Some),
            (Some(_), Some(value)) => {
                let message = format!("surface {number} has `{reciprocal_key}` already");
                Err(self.error(key, value.span(), message).hint("keep one of the two"))
            }
            (None, None) => Ok(None),
        }
    }

    /// A normalisation radius, mm, in the range in which its powers up to the twentieth are finite.
    fn norm_radius(&self, number: &Placed) -> Result<f64, FileError> {
        let value = self.positive("norm_radius_mm", number)?;
        if (1e-6..=1e6).contains(&value) {
            return Ok(value);
        }
        let message = "a normalisation radius is about the clear semi-diameter, 1e-6 to 1e6 mm";
        Err(self.error("norm_radius_mm", number.span(), message))
    }

    /// The departure of a surface from its conic, of which it may have one.
    fn departure(&self, number: usize, surface: &SurfaceText) -> Result<Departure, FileError> {
        let mut named = Vec::new();
        if let Some(terms) = &surface.odd {
            named.push(("odd", terms.span(), self.odd(terms.get_ref())?));
        }
        if let Some(terms) = &surface.xy {
            named.push(("xy", terms.span(), self.xy(terms)?));
        }
        for (key, forbes) in [("q_bfs", &surface.q_bfs), ("q_con", &surface.q_con)] {
            if let Some(forbes) = forbes {
                named.push((key, forbes.span(), self.forbes(key, forbes.get_ref())?));
            }
        }
        if let Some(biconic) = &surface.biconic {
            named.push(("biconic", biconic.span(), self.biconic(number, biconic)?));
        }
        if let Some(toroid) = &surface.toroid {
            named.push(("toroid", toroid.span(), self.toroid(number, toroid)?));
        }
        if let (Some((_, span, _)), Some(k)) =
            (named.iter().find(|(key, ..)| *key == "q_bfs"), &surface.conic)
            && k.get_ref().0 != 0.0
        {
            let message = format!("surface {number}: Q_bfs departs from a sphere, not from a conic");
            return Err(self.error("q_bfs", span.clone(), message).hint("leave `conic` out, or use q_con"));
        }
        match named.len() {
            0 => Ok(Departure::None),
            1 => Ok(named.swap_remove(0).2),
            _ => {
                let (key, span, _) = &named[1];
                let message = format!("surface {number} has `{}` already", named[0].0);
                Err(self.error(key, span.clone(), message).hint("a surface departs in one way"))
            }
        }
    }

    fn odd(&self, terms: &Terms) -> Result<Departure, FileError> {
        let mut b = [0.0; ODD_TERMS];
        for (key, value) in terms {
            let index = (0..ODD_TERMS).find(|i| *key == format!("b{}", 2 * i + 1)).ok_or_else(|| {
                self.error(key, value.span(), format!("there is no odd term `{key}`"))
                    .hint(format!("the terms are b1, b3, ... b{}", 2 * ODD_TERMS - 1))
            })?;
            b[index] = self.finite(key, value)?;
        }
        Ok(Departure::Odd(b))
    }

    fn xy(&self, placed: &Spanned<Terms>) -> Result<Departure, FileError> {
        let terms = placed.get_ref();
        let Some(norm) = terms.get("norm_radius_mm") else {
            return Err(self
                .missing("norm_radius_mm", placed.span(), "an XY polynomial has a normalisation radius")
                .hint("write `norm_radius_mm = 1.0` for plain powers of x and y"));
        };
        let mut coefficients = [0.0; XY_TERMS];
        for (key, value) in terms.iter().filter(|(key, _)| *key != "norm_radius_mm") {
            let index = xy_term(key).ok_or_else(|| {
                self.error(key, value.span(), format!("there is no term `{key}`"))
                    .hint(format!("terms are x0y1, x1y0, ... up to a total degree of {XY_DEGREE}"))
            })?;
            coefficients[index] = self.finite(key, value)?;
        }
        Ok(Departure::Xy { norm_radius_mm: self.norm_radius(norm)?, coefficients })
    }

    fn forbes(&self, key: &str, text: &ForbesText) -> Result<Departure, FileError> {
        let coefficients = self.list::<Q_TERMS>("a", &text.a)?;
        let norm_radius_mm = self.norm_radius(&text.norm_radius_mm)?;
        Ok(match key {
            "q_bfs" => Departure::Qbfs { norm_radius_mm, coefficients },
            _ => Departure::Qcon { norm_radius_mm, coefficients },
        })
    }

    fn biconic(&self, number: usize, placed: &Spanned<BiconicText>) -> Result<Departure, FileError> {
        let text = placed.get_ref();
        let [radius, curvature] = [&text.radius_x_mm, &text.curvature_x_per_mm];
        let curvature_x = self.curvature_x(number, placed.span(), radius, curvature)?;
        let conic_x = text.conic_x.as_ref().map_or(Ok(0.0), |k| self.finite("conic_x", k))?;
        Ok(Departure::Biconic { curvature_x, conic_x })
    }

    fn toroid(&self, number: usize, placed: &Spanned<ToroidText>) -> Result<Departure, FileError> {
        let text = placed.get_ref();
        let [radius, curvature] = [&text.radius_x_mm, &text.curvature_x_per_mm];
        let curvature_x = self.curvature_x(number, placed.span(), radius, curvature)?;
        match &text.conic_x {
            Some(k) => Err(self
                .error("conic_x", k.span(), "the x-z section of a toroid is a circle")
                .hint("a surface with two conic sections is a biconic")),
            None => Ok(Departure::Toroid { curvature_x }),
        }
    }

    /// Curvature of an x-z section, 1/mm.
    fn curvature_x(
        &self,
        number: usize,
        span: Range<usize>,
        radius: &Option<Placed>,
        curvature: &Option<Placed>,
    ) -> Result<f64, FileError> {
        let keys = ["radius_x_mm", "curvature_x_per_mm"];
        self.reciprocal(number, keys, radius, curvature)?.ok_or_else(|| {
            let message = format!("surface {number}: the x-z section has no radius");
            let error = self.missing("radius_x_mm", span, message);
            error.hint("a straight section is `radius_x_mm = inf`")
        })
    }

    fn action(&self, number: usize, surface: &SurfaceText) -> Result<Action, FileError> {
        let mirror = surface.mirror.as_ref().is_some_and(|m| *m.get_ref());
        match &surface.thin_lens {
            None if mirror => Ok(Action::Reflect),
            None => Ok(Action::Refract),
            Some(text) if mirror => {
                Err(self.error("thin_lens", text.span(), format!("surface {number} is a mirror already")))
            }
            Some(placed) => {
                let text = placed.get_ref();
                let keys = ["focal_length_mm", "power_per_mm"];
                match self.reciprocal(number, keys, &text.focal_length_mm, &text.power_per_mm)? {
                    Some(power_per_mm) => Ok(Action::ThinLens { power_per_mm }),
                    None => Err(self.missing(
                        "focal_length_mm",
                        placed.span(),
                        format!("surface {number}: a thin lens has a focal length"),
                    )),
                }
            }
        }
    }

    fn phase(&self, number: usize, surface: &SurfaceText) -> Result<Option<Phase>, FileError> {
        match (&surface.grating, &surface.binary) {
            (None, None) => Ok(None),
            (Some(_), Some(binary)) => {
                Err(self.error("binary", binary.span(), format!("surface {number} is a grating already")))
            }
            (Some(text), None) => {
                let text = text.get_ref();
                let lines_per_mm = self.finite("lines_per_mm", &text.lines_per_mm)?;
                Ok(Some(Phase { order: text.order, pattern: Pattern::Grating { lines_per_mm } }))
            }
            (None, Some(text)) => {
                let text = text.get_ref();
                let pattern = Pattern::Binary {
                    norm_radius_mm: self.norm_radius(&text.norm_radius_mm)?,
                    coefficients_rad: self.list::<PHASE_TERMS>("a_rad", &text.a_rad)?,
                };
                Ok(Some(Phase { order: text.order, pattern }))
            }
        }
    }

    fn placement(&self, placed: &Spanned<PlacementText>) -> Result<Placement, FileError> {
        let text = placed.get_ref();
        let decenter_mm = match &text.decenter_mm {
            Some(list) => self.exact_list::<2>("decenter_mm", list)?,
            None => [0.0; 2],
        };
        let tilt_rad = match (&text.tilt_deg, &text.tilt_rad) {
            (Some(list), None) => self.exact_list::<3>("tilt_deg", list)?.map(f64::to_radians),
            (None, Some(list)) => self.exact_list::<3>("tilt_rad", list)?,
            (None, None) => [0.0; 3],
            (Some(_), Some(list)) => {
                let error = self.error("tilt_rad", list.span(), "the tilt is already given in degrees");
                return Err(error.hint("keep one of the two"));
            }
        };
        let axis = match text.axis.as_ref().map(|axis| (axis.get_ref().as_str(), axis.span())) {
            None | Some(("returns", _)) => Axis::Returns,
            Some(("follows", _)) => Axis::Follows,
            Some(("bends", _)) => Axis::Bends,
            Some((other, span)) => {
                return Err(self
                    .error("axis", span, format!("the axis cannot be `{other}`"))
                    .hint("it `returns` (a misplaced surface), `follows` (a coordinate break) or `bends` (a fold mirror)"));
            }
        };
        Ok(Placement { decenter_mm, tilt_rad, axis })
    }

    /// Up to N numbers; missing ones are zero.
    fn list<const N: usize>(&self, key: &str, list: &Spanned<Vec<Placed>>) -> Result<[f64; N], FileError> {
        let mut out = [0.0; N];
        if list.get_ref().len() > N {
            let message =
                format!("there are {} coefficients, and at most {N} are used", list.get_ref().len());
            return Err(self.error(key, list.span(), message));
        }
        for (to, value) in out.iter_mut().zip(list.get_ref()) {
            *to = self.finite(key, value)?;
        }
        Ok(out)
    }

    /// Exactly N numbers.
    fn exact_list<const N: usize>(
        &self,
        key: &str,
        list: &Spanned<Vec<Placed>>,
    ) -> Result<[f64; N], FileError> {
        if list.get_ref().len() != N {
            let message = format!("there are {} numbers, {N} are needed", list.get_ref().len());
            return Err(self.error(key, list.span(), message));
        }
        self.list(key, list)
    }
}

/// Index of a term `x{i}y{j}`.
pub(super) fn xy_term(key: &str) -> Option<usize> {
    let (i, j) = key.strip_prefix('x')?.split_once('y')?;
    let power = |text: &str| text.parse::<usize>().ok().filter(|n| n.to_string() == text);
    let (i, j) = (power(i)?, power(j)?);
    let within = i <= XY_DEGREE && j <= XY_DEGREE && (1..=XY_DEGREE).contains(&(i + j));
    within.then(|| xy_index(i, j))
}
