//! Shapes of surfaces: their formula, over any kind of number, and how it moves with each of its coefficients.

use super::departure::{self, Departure};
use crate::jet::{Dual, Jet, Real};
use crate::number::{ASPHERE_TERMS, DEPARTURE_NUMBERS, Number};

/// A shape: a conic plus an even polynomial,
///
/// `z(u) = c u / (1 + sqrt(1 - (1+k) c^2 u)) + a_2 u + a_4 u^2 + ... + a_16 u^8`, with `u = r^2`,
/// plus a [`Departure`].
///
/// Source: ISO 10110-12; the r^2 term counts in first-order optics, `c_eff = c + 2 a_2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceShape {
    /// Vertex curvature c of the conic, 1/mm.
    pub curvature: f64,
    /// Conic constant k.
    pub conic: f64,
    /// Coefficients a_2, a_4, ..., a_16, mm^(1-n).
    pub asphere: [f64; ASPHERE_TERMS],
    /// What it has beyond these.
    pub departure: Departure,
}

/// Sag and its first two derivatives with respect to `u = r^2`.
#[derive(Clone, Copy, Debug)]
pub struct SagJet {
    /// z(u), mm.
    pub sag: f64,
    /// dz/du, 1/mm.
    pub first: f64,
    /// d^2z/du^2, 1/mm^3.
    pub second: f64,
}

impl SurfaceShape {
    /// A flat surface.
    pub const PLANE: Self =
        Self { curvature: 0.0, conic: 0.0, asphere: [0.0; ASPHERE_TERMS], departure: Departure::None };

    /// Whether the shape is a conic, so that a ray meets the surface in closed form.
    pub fn is_conic(&self) -> bool {
        self.departure == Departure::None && self.asphere.iter().all(|a| *a == 0.0)
    }

    /// Whether nothing distinguishes one section of the shape from another.
    pub fn is_rotationally_symmetric(&self) -> bool {
        !matches!(self.departure, Departure::Xy { .. } | Departure::Biconic { .. } | Departure::Toroid { .. })
    }

    /// Whether the shape is its own mirror image in x.
    pub fn is_mirror_symmetric(&self) -> bool {
        let numbers = self.departure.numbers();
        numbers.iter().enumerate().all(|(i, v)| *v == 0.0 || self.departure.is_mirror_symmetric_in(i))
    }

    /// The curvature that first-order optics sees, `c + 2 a_2` and what a departure adds in the y-z section.
    ///
    /// Odd powers of r have no part in first-order optics.
    pub fn paraxial_curvature(&self) -> f64 {
        let departure = match &self.departure {
            Departure::None => return self.curvature + 2.0 * self.asphere[0],
            departure => departure,
        };
        let by = self.paraxial_sensitivity();
        let numbers = departure.numbers();
        let more = by.iter().map(|(i, by)| numbers[*i] * by).sum::<f64>();
        self.curvature + 2.0 * self.asphere[0] + more
    }

    /// Derivatives of the paraxial curvature by those numbers of the departure that it depends on; by the curvature it is 1,
    /// by a_2 it is 2.
    pub(crate) fn paraxial_sensitivity(&self) -> Vec<(usize, f64)> {
        match &self.departure {
            Departure::Xy { norm_radius_mm: h, .. } => vec![(departure::xy_index(0, 2), 2.0 / (h * h))],
            Departure::Qbfs { norm_radius_mm: h, .. } => {
                departure::q_bfs(0.0).into_iter().map(|q| 2.0 * q / (h * h)).enumerate().collect()
            }
            _ => Vec::new(),
        }
    }

    /// Coefficient of r^4 of the shape, in the y-z section, 1/mm^3.
    pub(crate) fn quartic(&self) -> f64 {
        let base = self.asphere[1] + (1.0 + self.conic) * self.curvature.powi(3) / 8.0;
        base + match &self.departure {
            Departure::Xy { norm_radius_mm: h, coefficients } => {
                coefficients[departure::xy_index(0, 4)] / h.powi(4)
            }
            Departure::Qcon { norm_radius_mm: h, coefficients } => {
                departure::q_con(0.0).iter().zip(coefficients).map(|(q, a)| q * a).sum::<f64>() / h.powi(4)
            }
            Departure::Qbfs { norm_radius_mm: h, coefficients } => {
                // v (1 - v) (1 + c^2 h^2 v / 2) Q(v), to the second power of v.
                let q = departure::q_bfs(Dual::variable(0.0));
                let sum = |part: fn(&Dual<f64>) -> f64| {
                    q.iter().zip(coefficients).map(|(q, a)| part(q) * a).sum::<f64>()
                };
                let (value, slope) = (sum(|q| q.value), sum(|q| q.by));
                (slope + value * (0.5 * (self.curvature * h).powi(2) - 1.0)) / h.powi(4)
            }
            _ => 0.0,
        }
    }

    /// Sag and its derivatives at `u = r^2`, without a departure; `None` where the conic does not reach that far.
    #[inline]
    pub fn jet(&self, u: f64) -> Option<SagJet> {
        let (c, k1) = (self.curvature, 1.0 + self.conic);
        let w2 = 1.0 - k1 * c * c * u;
        if w2 <= 0.0 {
            return None;
        }
        // The conic: z = c u / (1 + w), z' = c / (2 w), z'' = (1+k) c^3 / (4 w^3).
        let w = w2.sqrt();
        let mut jet =
            SagJet { sag: c * u / (1.0 + w), first: 0.5 * c / w, second: 0.25 * k1 * c * c * c / (w2 * w) };
        // The polynomial by Horner's rule, with its derivatives.
        let (mut p, mut d, mut dd) = (0.0, 0.0, 0.0);
        for a in self.asphere.iter().rev() {
            dd = dd * u + 2.0 * d;
            d = d * u + p;
            p = p * u + a;
        }
        // p is the polynomial divided by u: z = u p, z' = p + u p', z'' = 2 p' + u p''.
        jet.sag += u * p;
        jet.first += p + u * d;
        jet.second += 2.0 * d + u * dd;
        Some(jet)
    }

    /// Sag in the y-z section at the height r, mm; `None` beyond the conic's reach.
    pub fn sag_mm(&self, r_mm: f64) -> Option<f64> {
        match self.departure {
            Departure::None => self.jet(r_mm * r_mm).map(|j| j.sag),
            _ => self.sag_at_mm([0.0, r_mm]),
        }
    }

    /// A number of the shape, to be changed; `None` if the shape has no such number.
    pub fn number_mut(&mut self, number: Number) -> Option<&mut f64> {
        match number {
            Number::Curvature => Some(&mut self.curvature),
            Number::Conic => Some(&mut self.conic),
            Number::Asphere(j) => self.asphere.get_mut(j),
            Number::Departure(k) => self.departure.number_mut(k),
            _ => None,
        }
    }

    /// Sag at a point (x, y), mm; `None` beyond the shape's reach.
    pub fn sag_at_mm(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let sag = self.formula(&ShapeNumbers::fixed(self, x), x, y);
        sag.is_finite().then_some(sag)
    }

    /// Sag, slopes and second derivatives at a point (x, y); no numbers beyond the shape's reach.
    #[inline(always)]
    pub(crate) fn sag_jet<R: Real>(&self, at: [R; 2]) -> Jet<R> {
        let [x, y] = Jet::axes(at);
        self.formula(&ShapeNumbers::fixed(self, x), x, y)
    }

    /// The sag at a point, over any kind of number.
    #[inline(always)]
    pub(crate) fn sag_of<R: Real>(&self, x: R, y: R) -> R {
        self.formula(&ShapeNumbers::fixed(self, x), x, y)
    }

    /// The formula of the shape, over any kind of number.
    #[inline(always)]
    fn formula<R: Real>(&self, n: &ShapeNumbers<R>, x: R, y: R) -> R {
        let (x2, y2) = (x * x, y * y);
        let u = x2 + y2;
        match &self.departure {
            Departure::None => n.conic(u) + n.even(u),
            Departure::Odd(b) => n.conic(u) + n.even(u) + departure::odd(b, u),
            Departure::Xy { norm_radius_mm, coefficients } => {
                let per = 1.0 / norm_radius_mm;
                n.conic(u) + n.even(u) + departure::xy(coefficients, x * per, y * per)
            }
            Departure::Qbfs { norm_radius_mm, coefficients } => {
                let v = u * (1.0 / (norm_radius_mm * norm_radius_mm));
                let sum = weighted(&departure::q_bfs(v), coefficients);
                n.conic(u) + n.even(u) + n.bfs_envelope(u, v) * sum
            }
            Departure::Qcon { norm_radius_mm, coefficients } => {
                let v = u * (1.0 / (norm_radius_mm * norm_radius_mm));
                n.conic(u) + n.even(u) + v * v * weighted(&departure::q_con(v), coefficients)
            }
            Departure::Biconic { .. } => n.biconic(x2, y2) + n.even(u),
            Departure::Toroid { .. } => n.toroid(x2, y2),
        }
    }

    /// How sag, slopes and second derivatives at a point move with each number of the shape.
    #[inline(always)]
    pub(crate) fn sensitivities<R: Real>(&self, [x, y]: [R; 2]) -> Vec<(Number, Jet<R>)> {
        let mut all = Vec::with_capacity(2 + ASPHERE_TERMS + DEPARTURE_NUMBERS);
        // Coefficients, by the function that each of them is a factor of.
        let [jx, jy] = Jet::axes([x, y]);
        let u = jx * jx + jy * jy;
        let mut bfs_sum = u;
        if !matches!(self.departure, Departure::Toroid { .. }) {
            let mut power = u;
            for j in 0..ASPHERE_TERMS {
                all.push((Number::Asphere(j), power));
                power = power * u;
            }
        }
        match &self.departure {
            Departure::Odd(b) => {
                let mut power = departure::radius(u);
                for k in 0..b.len() {
                    all.push((Number::Departure(k), power));
                    power = power * u;
                }
            }
            Departure::Xy { norm_radius_mm, .. } => {
                let per = 1.0 / norm_radius_mm;
                let mut terms = Vec::with_capacity(departure::XY_TERMS);
                departure::xy_terms(jx * per, jy * per, &mut terms);
                for (k, term) in terms.into_iter().enumerate() {
                    all.push((Number::Departure(k), term));
                }
            }
            Departure::Qbfs { norm_radius_mm, .. } => {
                let v = u * (1.0 / (norm_radius_mm * norm_radius_mm));
                let envelope = ShapeNumbers::fixed(self, u).bfs_envelope(u, v);
                let q = departure::q_bfs(v);
                bfs_sum = weighted(&q, &self.departure.numbers());
                for (k, q) in q.into_iter().enumerate() {
                    all.push((Number::Departure(k), envelope * q));
                }
            }
            Departure::Qcon { norm_radius_mm, .. } => {
                let v = u * (1.0 / (norm_radius_mm * norm_radius_mm));
                for (k, q) in departure::q_con(v).into_iter().enumerate() {
                    all.push((Number::Departure(k), v * v * q));
                }
            }
            _ => {}
        }
        // Numbers within roots and quotients, by duals.
        let [jx, jy] = Jet::axes([Dual::fixed(x), Dual::fixed(y)]);
        let (x2, y2) = (jx * jx, jy * jy);
        for number in self.curved_numbers() {
            let n = ShapeNumbers::moving(self, jx, *number);
            let mut moved = match &self.departure {
                Departure::Biconic { .. } => n.biconic(x2, y2),
                Departure::Toroid { .. } => n.toroid(x2, y2),
                _ => n.conic(x2 + y2),
            }
            .moved();
            if let (Departure::Qbfs { norm_radius_mm, .. }, Number::Curvature) = (&self.departure, number) {
                let u = x2 + y2;
                let v = u * (1.0 / (norm_radius_mm * norm_radius_mm));
                moved = moved + n.bfs_envelope(u, v).moved() * bfs_sum;
            }
            all.push((*number, moved));
        }
        all
    }

    /// The numbers that are no plain factors of a function of x and y.
    fn curved_numbers(&self) -> &'static [Number] {
        const TOROID: [Number; 3 + ASPHERE_TERMS] = {
            let mut all = [Number::Curvature; 3 + ASPHERE_TERMS];
            all[1] = Number::Conic;
            all[2] = Number::Departure(0);
            let mut j = 0;
            while j < ASPHERE_TERMS {
                all[3 + j] = Number::Asphere(j);
                j += 1;
            }
            all
        };
        const BICONIC: [Number; 4] =
            [Number::Curvature, Number::Conic, Number::Departure(0), Number::Departure(1)];
        match self.departure {
            Departure::Toroid { .. } => &TOROID,
            Departure::Biconic { .. } => &BICONIC,
            _ => &BICONIC[..2],
        }
    }
}

/// The numbers within the roots and quotients of a shape's formula, as what it is evaluated over.
struct ShapeNumbers<R> {
    curvature: R,
    conic: R,
    asphere: [R; ASPHERE_TERMS],
    curvature_x: R,
    conic_x: R,
}

impl<R: Real> ShapeNumbers<R> {
    /// As they are.
    #[inline(always)]
    fn fixed(shape: &SurfaceShape, like: R) -> Self {
        let (curvature_x, conic_x) = match shape.departure {
            Departure::Biconic { curvature_x, conic_x } => (curvature_x, conic_x),
            Departure::Toroid { curvature_x } => (curvature_x, 0.0),
            _ => (0.0, 0.0),
        };
        let mut asphere = [like; ASPHERE_TERMS];
        for (to, a) in asphere.iter_mut().zip(&shape.asphere) {
            *to = like.constant(*a);
        }
        Self {
            curvature: like.constant(shape.curvature),
            conic: like.constant(shape.conic),
            asphere,
            curvature_x: like.constant(curvature_x),
            conic_x: like.constant(conic_x),
        }
    }

    /// `c u / (1 + sqrt(1 - (1 + k) c^2 u))`.
    #[inline(always)]
    fn conic(&self, u: R) -> R {
        let c = self.curvature;
        let root = (u.constant(1.0) - (self.conic + 1.0) * c * c * u).sqrt();
        c * u / (root + 1.0)
    }

    /// See [`Departure::Biconic`].
    #[inline(always)]
    fn biconic(&self, x2: R, y2: R) -> R {
        let (cx, cy) = (self.curvature_x, self.curvature);
        let lost = (self.conic_x + 1.0) * cx * cx * x2 + (self.conic + 1.0) * cy * cy * y2;
        (cx * x2 + cy * y2) / ((-lost + 1.0).sqrt() + 1.0)
    }

    /// See [`Departure::Toroid`].
    #[inline(always)]
    fn toroid(&self, x2: R, y2: R) -> R {
        let section = self.conic(y2) + self.even(y2);
        let turned = self.curvature_x / (-(self.curvature_x * section) + 1.0);
        let root = (-(turned * turned * x2) + 1.0).sqrt();
        section + turned * x2 / (root + 1.0)
    }

    /// `a_2 u + a_4 u^2 + ...`.
    #[inline(always)]
    fn even(&self, u: R) -> R {
        let mut sum = u.constant(0.0);
        for a in self.asphere.iter().rev() {
            sum = (sum + *a) * u;
        }
        sum
    }

    /// `v (1 - v) / sqrt(1 - c^2 u)`.
    #[inline(always)]
    fn bfs_envelope(&self, u: R, v: R) -> R {
        let c = self.curvature;
        v * (-v + 1.0) / (u.constant(1.0) - c * c * u).sqrt()
    }
}

impl<R: Real> ShapeNumbers<Jet<Dual<R>>> {
    /// With one of them moving.
    #[inline(always)]
    fn moving(shape: &SurfaceShape, like: Jet<Dual<R>>, number: Number) -> Self {
        let mut all = Self::fixed(shape, like);
        let moving = match number {
            Number::Curvature => &mut all.curvature,
            Number::Conic => &mut all.conic,
            Number::Asphere(j) => &mut all.asphere[j],
            Number::Departure(0) => &mut all.curvature_x,
            // Of the curved numbers, only the second of a biconic is left.
            _ => &mut all.conic_x,
        };
        moving.value = Dual::variable(moving.value.value);
        all
    }
}

/// `sum a_m q_m`.
#[inline(always)]
fn weighted<R: Real>(q: &[R], a: &[f64]) -> R {
    let mut sum = q[0] * a[0];
    for (q, a) in q.iter().zip(a).skip(1) {
        sum = sum + *q * *a;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asphere() -> SurfaceShape {
        let mut asphere = [0.0; ASPHERE_TERMS];
        asphere[..5].copy_from_slice(&[1e-3, -2.07e-4, -4.4e-7, 4.42e-7, -2.23e-8]);
        SurfaceShape { curvature: 1.0 / 15.38, conic: 0.37, asphere, departure: Departure::None }
    }

    #[test]
    fn sag_is_the_published_formula() {
        let s = asphere();
        let (c, r) = (s.curvature, 2.7_f64);
        let expected = c * r * r / (1.0 + (1.0 - 1.37 * c * c * r * r).sqrt()) + 1e-3 * r.powi(2)
            - 2.07e-4 * r.powi(4)
            - 4.4e-7 * r.powi(6)
            + 4.42e-7 * r.powi(8)
            - 2.23e-8 * r.powi(10);
        assert!((s.sag_mm(r).unwrap() - expected).abs() < 1e-15);
    }

    #[test]
    fn derivatives_match_central_differences() {
        let (s, u, h) = (asphere(), 6.25, 1e-4);
        let at = |u: f64| s.jet(u).unwrap();
        let j = at(u);
        assert!((j.first - (at(u + h).sag - at(u - h).sag) / (2.0 * h)).abs() < 1e-9);
        assert!((j.second - (at(u + h).first - at(u - h).first) / (2.0 * h)).abs() < 1e-9);
    }

    /// Every kind of shape, with numbers of some size.
    fn shapes() -> Vec<SurfaceShape> {
        let wave = |k: usize| 1e-3 * (1.0 + k as f64).sin();
        let base = asphere();
        let sphere = SurfaceShape { conic: 0.0, ..base };
        let mut all = vec![base];
        let mut add = |base: SurfaceShape, departure| all.push(SurfaceShape { departure, ..base });
        add(base, Departure::Odd(std::array::from_fn(|k| wave(k) * 3f64.powi(-2 * k as i32))));
        add(base, Departure::Xy { norm_radius_mm: 4.0, coefficients: std::array::from_fn(wave) });
        add(sphere, Departure::Qbfs { norm_radius_mm: 4.0, coefficients: std::array::from_fn(wave) });
        add(base, Departure::Qcon { norm_radius_mm: 4.0, coefficients: std::array::from_fn(wave) });
        add(base, Departure::Biconic { curvature_x: -0.03, conic_x: 1.4 });
        add(base, Departure::Toroid { curvature_x: -0.03 });
        all
    }

    #[test]
    fn jets_and_sensitivities_match_central_differences() {
        let ([x, y], h) = ([1.3, -2.1], 1e-5);
        for shape in shapes() {
            let sag = |x: f64, y: f64| shape.sag_at_mm([x, y]).unwrap();
            let jet = shape.sag_jet([x, y]);
            assert!((jet.value - sag(x, y)).abs() < 1e-15);
            assert!((jet.slope[0] - (sag(x + h, y) - sag(x - h, y)) / (2.0 * h)).abs() < 1e-8);
            assert!((jet.slope[1] - (sag(x, y + h) - sag(x, y - h)) / (2.0 * h)).abs() < 1e-8);
            let found = shape.sensitivities([x, y]);
            assert_eq!(found.len(), 2 + ASPHERE_TERMS + shape.departure.numbers().len());
            for (number, by) in found {
                let moved = |h: f64| {
                    let mut moved = shape;
                    *moved.number_mut(number).unwrap() += h;
                    moved.sag_jet([x, y])
                };
                let h = 1e-6 * by.value.abs().max(1e-3).recip().min(1.0);
                let (plus, minus) = (moved(h), moved(-h));
                for (exact, plus, minus) in [
                    (by.value, plus.value, minus.value),
                    (by.slope[0], plus.slope[0], minus.slope[0]),
                    (by.slope[1], plus.slope[1], minus.slope[1]),
                ] {
                    let numeric = (plus - minus) / (2.0 * h);
                    let scale = exact.abs().max(1e-16 / h).max(1e-2);
                    assert!(
                        (exact - numeric).abs() < 1e-6 * scale,
                        "{number:?} of {:?}: {exact} {numeric}",
                        shape.departure
                    );
                }
            }
        }
    }

    /// First-order curvature and r^4 coefficient, by differences of the y-z section.
    #[test]
    fn the_vertex_is_what_first_and_third_order_optics_see() {
        for shape in shapes() {
            if let Departure::Odd(_) = shape.departure {
                continue;
            }
            let even =
                |y: f64| 0.5 * (shape.sag_at_mm([0.0, y]).unwrap() + shape.sag_at_mm([0.0, -y]).unwrap());
            // z = c/2 y^2 + b y^4 + d y^6 + ..., at four heights.
            let h = 0.05;
            let rows = nalgebra::Matrix4::from_fn(|i, j| ((i + 1) as f64 * h).powi(2 * j as i32 + 2));
            let sags = nalgebra::Vector4::from_fn(|i, _| even((i + 1) as f64 * h));
            let fit = rows.lu().solve(&sags).unwrap();
            let c = shape.paraxial_curvature();
            assert!((2.0 * fit[0] - c).abs() < 1e-6 * c.abs(), "{} {c} {:?}", 2.0 * fit[0], shape.departure);
            let b = shape.quartic();
            assert!((fit[1] - b).abs() < 2e-4 * b.abs(), "{} {b} {:?}", fit[1], shape.departure);
        }
    }

    #[test]
    fn a_conic_that_ends_has_no_sag_beyond() {
        let sphere = SurfaceShape { curvature: 0.1, ..SurfaceShape::PLANE };
        assert!(sphere.sag_mm(9.99).is_some());
        assert!(sphere.sag_mm(10.01).is_none());
    }
}
