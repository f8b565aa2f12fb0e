//! The projection of a lens: which direction each pixel looks in.

use petzval_base::table::Interval;

use crate::error::StreetError;
use crate::vector::{Vec3, vec3};

/// Entries of the resampled tables.
const ENTRIES: usize = 4096;

/// Where each pixel of a sensor looks: a monotone table from image radius to field angle, with the axis at the sensor's centre.
///
/// A pixel at `(x, y)` from the axis looks in the direction `(sin(a) x / r, -sin(a) y / r, cos(a))` of the camera (right, up,
/// forward), with `r = hypot(x, y)` and the angle `a(r)` of the table. Between entries the angle is linear in the radius; beyond
/// the last entry it goes on with the last slope, up to half a turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    radius_px: Vec<f64>,
    angle_rad: Vec<f64>,
    rows: usize,
    columns: usize,
    /// `sin(a) / r` and `cos(a)` at equal steps of `r^2`.
    by_square: Vec<[f64; 2]>,
    squares_per_px2: f64,
}

impl Projection {
    /// A projection from its table. Radii (pixels from the axis) and angles (radians from the axis, below pi) both start at zero
    /// and rise strictly. The sensor has `rows` by `columns` pixels.
    pub fn new(
        radius_px: Vec<f64>,
        angle_rad: Vec<f64>,
        rows: usize,
        columns: usize,
    ) -> Result<Self, StreetError> {
        let wrong = |name, value, entry, hint| Err(StreetError::Projection { name, value, entry, hint });
        if radius_px.len() != angle_rad.len() || radius_px.len() < 2 {
            let hint = "there must be as many angles as radii, and at least two";
            return wrong("number of angles", angle_rad.len() as f64, radius_px.len(), hint);
        }
        for (name, column) in [("radius_px", &radius_px), ("angle_rad", &angle_rad)] {
            if column[0] != 0.0 {
                return wrong(name, column[0], 0, "the table must start on the axis, at 0");
            }
            let falls = column.windows(2).position(|pair| !(pair[1] > pair[0] && pair[1].is_finite()));
            if let Some(entry) = falls {
                return wrong(name, column[entry + 1], entry + 1, "the table must rise strictly");
            }
        }
        let last = angle_rad.len() - 1;
        if angle_rad[last] >= std::f64::consts::PI {
            return wrong("angle_rad", angle_rad[last], last, "an angle must be below pi");
        }
        if rows == 0 || columns == 0 || rows > 100_000 || columns > 100_000 {
            let hint = "the sensor must have 1 to 100000 rows and columns";
            return wrong("smaller side", rows.min(columns) as f64, 0, hint);
        }
        let mut projection =
            Self { radius_px, angle_rad, rows, columns, by_square: Vec::new(), squares_per_px2: 0.0 };
        // The resampled table reaches a quarter beyond the corner of the sensor, so that borders are in it.
        let reach = 1.25 * 0.5 * (rows as f64).hypot(columns as f64) + 64.0;
        projection.squares_per_px2 = (ENTRIES - 1) as f64 / (reach * reach);
        let entry = |i: usize| {
            let radius = (i as f64 / projection.squares_per_px2).sqrt();
            projection.sine_and_cosine(radius)
        };
        projection.by_square = (0..ENTRIES).map(entry).collect();
        Ok(projection)
    }

    /// A lens without distortion: radius = `focal_px` tan(angle), tabulated to `largest_radius_px`. Both are positive.
    pub fn rectilinear(
        focal_px: f64,
        largest_radius_px: f64,
        rows: usize,
        columns: usize,
    ) -> Result<Self, StreetError> {
        for (name, value) in [("focal length", focal_px), ("largest radius", largest_radius_px)] {
            if !(value > 0.0 && value.is_finite()) {
                let hint = "must be positive, in pixels";
                return Err(StreetError::Projection { name, value, entry: 0, hint });
            }
        }
        let steps = 2048;
        let radius: Vec<f64> = (0..=steps).map(|i| largest_radius_px * i as f64 / steps as f64).collect();
        let angle = radius.iter().map(|r| (r / focal_px).atan()).collect();
        Self::new(radius, angle, rows, columns)
    }

    /// The same with radii that are so many times as large, on as many pixels. `by` is positive.
    pub fn magnified(&self, by: f64) -> Result<Self, StreetError> {
        let radius_px = self.radius_px.iter().map(|r| by * r).collect();
        Self::new(radius_px, self.angle_rad.clone(), self.rows, self.columns)
    }

    /// Rows of the sensor.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Columns of the sensor.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The largest angle that any pixel of the sensor, or of a border of a quarter of it, looks at, rad.
    pub(crate) fn widest_rad(&self) -> f64 {
        self.by_square[ENTRIES - 1][1].clamp(-1.0, 1.0).acos()
    }

    /// The field angle in radians of a radius in pixels.
    fn angle(&self, radius: f64) -> f64 {
        interpolate(&self.radius_px, &self.angle_rad, radius).min(std::f64::consts::PI)
    }

    fn sine_and_cosine(&self, radius: f64) -> [f64; 2] {
        let (sin, cos) = self.angle(radius).sin_cos();
        // On the axis the quotient is the slope of the table.
        let slope = if radius > 0.0 { sin / radius } else { self.angle_rad[1] / self.radius_px[1] };
        [slope, cos]
    }

    /// The unit direction, in the camera's axes (right, up, forward), of a place on the sensor in pixels.
    #[inline]
    pub(crate) fn direction(&self, x: f64, y: f64) -> Vec3 {
        let (x, y) = (x - 0.5 * self.columns as f64, y - 0.5 * self.rows as f64);
        let square = x * x + y * y;
        let at = square * self.squares_per_px2;
        let i = at as usize;
        let [slope, cos] = if i + 1 < ENTRIES {
            let share = at - i as f64;
            let (a, b) = (self.by_square[i], self.by_square[i + 1]);
            [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
        } else {
            self.sine_and_cosine(square.sqrt())
        };
        vec3(slope * x, -slope * y, cos).unit()
    }

    /// The place `[x, y]` on the sensor, pixels, of a direction in the camera's axes, and the cosine of its angle.
    pub(crate) fn pixel(&self, v: Vec3) -> ([f64; 2], f64) {
        let across = v.x.hypot(v.y);
        let angle = across.atan2(v.z);
        let radius = interpolate(&self.angle_rad, &self.radius_px, angle);
        let scale = if across > 0.0 { radius / across } else { 0.0 };
        let place = [0.5 * self.columns as f64 + scale * v.x, 0.5 * self.rows as f64 - scale * v.y];
        (place, angle.cos())
    }
}

/// The value at `x` of a rising table, linear between its entries and, with the last slope, beyond them.
fn interpolate(xs: &[f64], ys: &[f64], x: f64) -> f64 {
    Interval::in_slice(x, xs).map_or(ys[0], |interval| interval.on_line(|i| ys[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_and_direction_undo_each_other_for_a_lens_with_barrel_distortion() {
        let angle: Vec<f64> = (0..200).map(|i| 0.005 * i as f64).collect();
        let radius = angle.iter().map(|a| 900.0 * (a - 0.08 * a.powi(3))).collect();
        let projection = Projection::new(radius, angle, 1200, 1920).unwrap();
        for (x, y) in [(960.0, 600.0), (960.3, 600.2), (3.0, 8.0), (1900.0, 20.0), (-60.0, 1240.0)] {
            let v = projection.direction(x, y);
            let ([px, py], cos) = projection.pixel(v * 7.0);
            assert!((px - x).abs() < 0.02 && (py - y).abs() < 0.02, "{x} {y} {px} {py}");
            assert!((cos - v.z).abs() < 1e-9);
        }
    }

    #[test]
    fn a_rectilinear_lens_follows_the_tangent() {
        let projection = Projection::rectilinear(4266.0, 1200.0, 1200, 1920).unwrap();
        let v = projection.direction(960.0 + 426.6, 600.0 - 213.3);
        assert!((v.x / v.z - 0.1).abs() < 1e-7 && (v.y / v.z - 0.05).abs() < 1e-7);
    }

    #[test]
    fn wrong_tables_are_refused() {
        let wrong = |r: &[f64], a: &[f64]| Projection::new(r.to_vec(), a.to_vec(), 10, 10).is_err();
        assert!(wrong(&[0.0], &[0.0]) && wrong(&[0.0, 1.0], &[0.0]) && wrong(&[1.0, 2.0], &[0.0, 1.0]));
        assert!(wrong(&[0.0, 1.0, 1.0], &[0.0, 0.1, 0.2]) && wrong(&[0.0, f64::NAN], &[0.0, 0.1]));
        assert!(wrong(&[0.0, 1.0], &[0.0, 4.0]));
        assert!(Projection::rectilinear(-1.0, 5.0, 10, 10).is_err());
        assert!(Projection::rectilinear(10.0, 5.0, 0, 10).is_err());
    }
}
