//! Objects: solids placed in the street, put together from parts.

use std::f64::consts::PI;

use crate::light::LampState;
use crate::material::Material;
use crate::shape::{Convex, Shape};
use crate::surface_class::SurfaceClass;
use crate::vector::{Frame, Inverse, Vec3, vec3};

/// What an object is to a detector.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectKind {
    /// A person.
    Pedestrian,
    /// A car, van, truck or bus.
    Vehicle,
    /// The housing of a traffic light whose lamps face the camera's lane. Pole, arm and backboard are not part of it.
    TrafficLight,
    /// A light for people on foot. A task about traffic lights does not look for it.
    PedestrianLight,
    /// A traffic light seen from behind or from the side, for other lanes. A task about traffic lights does not look for it.
    TurnedLight,
}

/// One solid of an object.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub shape: Shape,
    /// The shape's own coordinates in the world.
    pub frame: Frame,
    pub inverse: Inverse,
    pub material: Material,
    pub class: SurfaceClass,
    /// A sphere around it.
    pub centre: Vec3,
    pub radius: f64,
}

/// The area that an object covers on the ground, for contact shadows and collisions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    /// Half its extent along the object's x and z axes, m.
    pub half_m: [f64; 2],
    /// Share of the sky's light that it takes from the ground below it, 0..1.
    pub darkness: f64,
    /// Distance in which the darkness falls to 37 %, m.
    pub reach_m: f64,
}

/// An object of the street.
#[derive(Clone, Debug)]
pub(crate) struct Object {
    /// What it is to a detector; `None` for what no detector looks for.
    pub kind: Option<ObjectKind>,
    /// A number that stays the same in all moments of a street.
    pub id: u64,
    pub frame: Frame,
    pub inverse: Inverse,
    pub parts: Vec<Part>,
    pub centre: Vec3,
    pub radius: f64,
    pub footprint: Option<Footprint>,
    /// What a traffic light shows.
    pub lamp: Option<LampState>,
}

/// Puts an object together in its own coordinates: x right, y up, z forward, in metres from a point on the ground.
pub(crate) struct Builder {
    frame: Frame,
    parts: Vec<Part>,
    /// That of the parts to come.
    class: SurfaceClass,
}

impl Builder {
    /// An object at a place, turned by `yaw` radians to the right, with surfaces of a class.
    pub fn at(place: Vec3, yaw: f64, class: SurfaceClass) -> Self {
        Self { frame: Frame::turned(place, yaw), parts: Vec::new(), class }
    }

    /// Gives the parts to come another class.
    pub fn go_on_as(&mut self, class: SurfaceClass) {
        self.class = class;
    }

    /// Adds a shape in a frame given in the object's coordinates.
    pub fn add(&mut self, shape: Shape, frame: Frame, material: Material) {
        let frame = self.frame.of(&frame);
        let hull: Vec<Vec3> = shape.hull().into_iter().map(|corner| frame.point(corner)).collect();
        let centre = hull.iter().fold(Vec3::default(), |sum, p| sum + *p) * (1.0 / hull.len() as f64);
        let around = hull.iter().map(|p| (*p - centre).length()).fold(0.0, f64::max);
        // A ball is smaller than the box around it.
        let radius = match shape {
            Shape::Sphere => frame.x.length().max(frame.y.length()).max(frame.z.length()),
            _ => around,
        };
        let class = self.class;
        self.parts.push(Part { inverse: frame.inverse(), shape, frame, material, class, centre, radius });
    }

    /// A box around `centre` with half sides.
    pub fn block(&mut self, centre: [f64; 3], half: [f64; 3], material: Material) {
        self.turned_block(centre, half, 0.0, material);
    }

    /// A box turned about the upright axis.
    pub fn turned_block(&mut self, [x, y, z]: [f64; 3], half: [f64; 3], yaw: f64, material: Material) {
        let frame = Frame::turned(vec3(x, y, z), yaw).scaled(half[0], half[1], half[2]);
        self.add(Shape::Cube, frame, material);
    }

    /// A box turned about the x axis: `tip` radians lift its front.
    pub fn tipped_block(&mut self, [x, y, z]: [f64; 3], half: [f64; 3], tip: f64, material: Material) {
        let (sin, cos) = tip.sin_cos();
        let frame = Frame {
            origin: vec3(x, y, z),
            x: vec3(1.0, 0.0, 0.0),
            y: vec3(0.0, cos, -sin),
            z: vec3(0.0, sin, cos),
        };
        self.add(Shape::Cube, frame.scaled(half[0], half[1], half[2]), material);
    }

    /// An ellipsoid.
    pub fn ball(&mut self, [x, y, z]: [f64; 3], radii: [f64; 3], material: Material) {
        let frame = Frame { origin: vec3(x, y, z), ..Frame::WORLD }.scaled(radii[0], radii[1], radii[2]);
        self.add(Shape::Sphere, frame, material);
    }

    /// The hull of a ball of radius `low` around `a` and one of radius `high` around `b`, `depth` times as deep as wide.
    pub fn limb(&mut self, a: Vec3, b: Vec3, [low, high]: [f64; 2], depth: f64, material: Material) {
        let frame = Frame::along(a, b).scaled(1.0, 1.0, depth);
        self.add(Shape::RoundCone { low, high, height: (b - a).length() }, frame, material);
    }

    /// A capped cone from `a` to `b`.
    pub fn cone(&mut self, a: Vec3, b: Vec3, [low, high]: [f64; 2], material: Material) {
        let frame = Frame::along((a + b) * 0.5, b).scaled(low, 0.5 * (b - a).length(), low);
        self.add(Shape::Cone { top: high / low }, frame, material);
    }

    /// A polyhedron given by outward normals and points of its planes.
    pub fn convex(&mut self, planes: &[(Vec3, Vec3)], material: Material) {
        self.add(Shape::Convex(Convex::new(planes)), Frame::WORLD, material);
    }

    /// The finished object.
    pub fn finish(self, id: u64, kind: Option<ObjectKind>) -> Object {
        let count = self.parts.len().max(1) as f64;
        let centre = self.parts.iter().fold(Vec3::default(), |sum, part| sum + part.centre) * (1.0 / count);
        let radius = self.parts.iter().map(|p| (p.centre - centre).length() + p.radius).fold(0.0, f64::max);
        let (frame, inverse) = (self.frame, self.frame.inverse());
        Object { kind, id, frame, inverse, parts: self.parts, centre, radius, footprint: None, lamp: None }
    }
}

impl Object {
    /// The object with its area on the ground.
    pub fn on_ground(mut self, half_m: [f64; 2], darkness: f64, reach_m: f64) -> Self {
        self.footprint = Some(Footprint { half_m, darkness, reach_m });
        self
    }

    /// Distance on the ground from its footprint, m; zero below it.
    pub fn ground_distance(&self, p: Vec3) -> f64 {
        let Some(footprint) = self.footprint else { return f64::INFINITY };
        let own = self.inverse.point(p);
        let [x, z] = [own.x.abs() - footprint.half_m[0], own.z.abs() - footprint.half_m[1]];
        x.max(0.0).hypot(z.max(0.0))
    }

    /// Whether two footprints come closer than `gap_m`.
    pub fn collides(&self, other: &Self, gap_m: f64) -> bool {
        let (Some(a), Some(b)) = (self.footprint, other.footprint) else { return false };
        let between = other.frame.origin - self.frame.origin;
        // Two rectangles are apart if an axis of one of them separates them.
        let axes = [self.frame.x, self.frame.z, other.frame.x, other.frame.z];
        axes.into_iter().all(|axis| {
            let extent = |frame: &Frame, half: [f64; 2]| {
                half[0] * frame.x.dot(axis).abs() + half[1] * frame.z.dot(axis).abs()
            };
            between.dot(axis).abs() < extent(&self.frame, a.half_m) + extent(&other.frame, b.half_m) + gap_m
        })
    }
}

impl Part {
    /// Whether a ray passes through a gap where it crosses a ball: at `world`, which is `q` in the ball's own coordinates, along
    /// `d` in them.
    #[inline]
    pub fn gap(&self, world: Vec3, q: Vec3, d: Vec3) -> bool {
        self.material.gap(world, q.dot(d).abs() / d.length())
    }

    /// Points in the world whose convex hull is the part as seen from `eye`, or lies within a thousandth of it.
    pub fn outline(&self, eye: Vec3) -> Vec<Vec3> {
        const STEPS: usize = 64;
        let circle = (0..STEPS).map(|i| (2.0 * PI * i as f64 / STEPS as f64).sin_cos());
        let own = self.inverse.point(eye);
        // The circle in which a cone from the eye touches a ball.
        let touched = |centre: Vec3, radius: f64| {
            let to = own - centre;
            let distance = to.length().max(1.001 * radius);
            let axis = to.unit();
            let across = if axis.y.abs() < 0.9 { vec3(0.0, 1.0, 0.0) } else { vec3(1.0, 0.0, 0.0) };
            let u = axis.cross(across).unit();
            let v = axis.cross(u);
            let middle = centre + axis * (radius * radius / distance);
            let ring = radius * (1.0 - (radius / distance).powi(2)).sqrt();
            circle.clone().map(move |(sin, cos)| middle + (u * cos + v * sin) * ring)
        };
        let points: Vec<Vec3> = match &self.shape {
            Shape::Sphere => touched(Vec3::default(), 1.0).collect(),
            Shape::Cube => self.shape.hull(),
            Shape::Cone { top } => {
                let rims = [(-1.0, 1.0), (1.0, *top)];
                let rim =
                    |(y, r): (f64, f64)| circle.clone().map(move |(sin, cos)| vec3(r * cos, y, r * sin));
                rims.into_iter().flat_map(rim).collect()
            }
            Shape::RoundCone { low, high, height } => {
                touched(Vec3::default(), *low).chain(touched(vec3(0.0, *height, 0.0), *high)).collect()
            }
            Shape::Convex(convex) => convex.corners.clone(),
        };
        points.into_iter().map(|p| self.frame.point(p)).collect()
    }
}
