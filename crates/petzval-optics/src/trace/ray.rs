//! Rays, one and many, and what becomes of them.

/// A point or a direction, `[x, y, z]`.
pub type Vec3 = [f64; 3];

#[inline]
pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + s b`.
#[inline]
pub(crate) fn along(a: Vec3, s: f64, b: Vec3) -> Vec3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// What became of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Fate {
    /// It reached the image plane.
    #[default]
    Ok,
    /// It never met this surface (0-based).
    Missed(usize),
    /// It met this surface outside its clear aperture; it is traced on, without weight.
    Clipped(usize),
    /// It was totally reflected at this surface.
    TotalReflection(usize),
    /// No launch point was found from which it passes the wanted point of the stop.
    NotAimed,
}

impl Fate {
    /// Whether position and direction at the image plane have a meaning.
    pub fn reaches_image(self) -> bool {
        matches!(self, Self::Ok | Self::Clipped(_))
    }
}

/// One ray: a point (mm) and unit direction cosines (l, m, n).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// A point on the ray, mm, in the coordinates of the surface it is at or heads for.
    pub position: Vec3,
    /// Unit direction.
    pub direction: Vec3,
}

/// Many rays as a structure of arrays.
#[derive(Clone, Debug, Default)]
pub struct RayBundle {
    /// x of the rays, mm.
    pub x: Vec<f64>,
    /// y of the rays, mm.
    pub y: Vec<f64>,
    /// z of the rays, mm.
    pub z: Vec<f64>,
    /// Direction cosine along x.
    pub l: Vec<f64>,
    /// Direction cosine along y.
    pub m: Vec<f64>,
    /// Direction cosine along z.
    pub n: Vec<f64>,
    /// What became of each ray.
    pub fate: Vec<Fate>,
}

impl RayBundle {
    /// An empty bundle with room for so many rays.
    pub fn with_capacity(rays: usize) -> Self {
        let v = || Vec::with_capacity(rays);
        Self { x: v(), y: v(), z: v(), l: v(), m: v(), n: v(), fate: Vec::with_capacity(rays) }
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Adds a ray.
    pub fn push(&mut self, ray: Ray, fate: Fate) {
        let ([x, y, z], [l, m, n]) = (ray.position, ray.direction);
        self.x.push(x);
        self.y.push(y);
        self.z.push(z);
        self.l.push(l);
        self.m.push(m);
        self.n.push(n);
        self.fate.push(fate);
    }

    /// Ray i.
    pub fn ray(&self, i: usize) -> Ray {
        Ray { position: [self.x[i], self.y[i], self.z[i]], direction: [self.l[i], self.m[i], self.n[i]] }
    }

    /// Replaces ray i.
    pub fn set(&mut self, i: usize, ray: Ray, fate: Fate) {
        [self.x[i], self.y[i], self.z[i]] = ray.position;
        [self.l[i], self.m[i], self.n[i]] = ray.direction;
        self.fate[i] = fate;
    }
}
