//! Vectors and frames in space: x to the right, y up, z forward along the street, in metres.

use std::ops::{Add, Mul, Neg, Sub};

/// A point or a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Vec3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// Short for a vector of three numbers.
pub(crate) const fn vec3(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3 { x, y, z }
}

impl Vec3 {
    #[inline(always)]
    pub fn dot(self, o: Self) -> f64 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    pub fn cross(self, o: Self) -> Self {
        vec3(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    #[inline(always)]
    pub fn length(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// The direction of this vector; the upward direction for a vector of no length.
    #[inline(always)]
    pub fn unit(self) -> Self {
        let length = self.length();
        if length > 0.0 { self * (1.0 / length) } else { vec3(0.0, 1.0, 0.0) }
    }
}

impl Add for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        vec3(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl Sub for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        vec3(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl Mul<f64> for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: f64) -> Self {
        vec3(self.x * s, self.y * s, self.z * s)
    }
}

impl Neg for Vec3 {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}

/// Three axes at a point. The axes need not have unit length: a frame also scales, and it stays invertible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub origin: Vec3,
    pub x: Vec3,
    pub y: Vec3,
    pub z: Vec3,
}

impl Frame {
    /// The frame of the world.
    pub const WORLD: Self = Self {
        origin: vec3(0.0, 0.0, 0.0),
        x: vec3(1.0, 0.0, 0.0),
        y: vec3(0.0, 1.0, 0.0),
        z: vec3(0.0, 0.0, 1.0),
    };

    /// An upright frame whose z axis is turned by `yaw` radians from the street's direction to the right.
    pub fn turned(origin: Vec3, yaw: f64) -> Self {
        let (sin, cos) = yaw.sin_cos();
        Self { origin, x: vec3(cos, 0.0, -sin), y: vec3(0.0, 1.0, 0.0), z: vec3(sin, 0.0, cos) }
    }

    /// A frame at `a` whose y axis points at `b`, with unit axes; its x axis is as level as possible.
    pub fn along(a: Vec3, b: Vec3) -> Self {
        let y = (b - a).unit();
        let helper = if y.y.abs() > 0.99 { vec3(0.0, 0.0, 1.0) } else { vec3(0.0, 1.0, 0.0) };
        // A vertical axis keeps the frame's x axis to the right.
        let x = if y.y.abs() > 0.99 { y.cross(helper).unit() } else { helper.cross(y).unit() };
        Self { origin: a, x, y, z: x.cross(y) }
    }

    /// The frame with its axes stretched.
    pub fn scaled(self, x: f64, y: f64, z: f64) -> Self {
        Self { x: self.x * x, y: self.y * y, z: self.z * z, ..self }
    }

    #[inline(always)]
    pub fn direction(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }

    #[inline(always)]
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.origin + self.direction(p)
    }

    /// The frame `inner`, given in this frame, in the world.
    pub fn of(&self, inner: &Self) -> Self {
        let [x, y, z] = [inner.x, inner.y, inner.z].map(|axis| self.direction(axis));
        Self { origin: self.point(inner.origin), x, y, z }
    }

    /// The map from the world to coordinates in this frame.
    pub fn inverse(&self) -> Inverse {
        let (a, b, c) = (self.y.cross(self.z), self.z.cross(self.x), self.x.cross(self.y));
        let scale = 1.0 / self.x.dot(a);
        Inverse { origin: self.origin, x: a * scale, y: b * scale, z: c * scale }
    }
}

/// The map from the world to coordinates in a frame: `row . (point - origin)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Inverse {
    origin: Vec3,
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

impl Inverse {
    #[inline(always)]
    pub fn direction(&self, v: Vec3) -> Vec3 {
        vec3(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    #[inline(always)]
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.direction(p - self.origin)
    }

    /// The unit normal in the world of a normal in the frame.
    pub fn normal(&self, n: Vec3) -> Vec3 {
        (self.x * n.x + self.y * n.y + self.z * n.z).unit()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_and_its_inverse_undo_each_other() {
        let inner = Frame::along(vec3(0.2, 1.0, 0.1), vec3(0.5, 1.5, -0.3)).scaled(0.2, 0.5, 0.1);
        let frame = Frame::turned(vec3(3.0, 0.0, 40.0), 0.7).of(&inner);
        let p = vec3(0.3, -0.7, 0.9);
        assert!((frame.inverse().point(frame.point(p)) - p).length() < 1e-12);
        let upright = Frame::along(vec3(0.0, 0.0, 0.0), vec3(0.0, 2.0, 0.0));
        assert!((upright.x.length() - 1.0).abs() < 1e-12 && upright.y == vec3(0.0, 1.0, 0.0));
    }
}
