//! Shadows of the sun: a grid, square to the sun's direction, of the parts that each ray towards the sun may meet.

use crate::object::Object;
use crate::sky::Sky;
use crate::vector::{Vec3, vec3};

/// Side of a cell, m.
const CELL_M: f64 = 0.9;

/// One part in a cell.
#[derive(Clone, Copy)]
struct Entry {
    object: u32,
    part: u32,
    /// How far towards the sun it reaches, m.
    top: f32,
    /// Place of its middle square to the sun, m, and the radius of the sphere around it.
    middle: [f32; 2],
    radius: f32,
}

/// The parts that rays towards the sun meet.
pub(crate) struct SunGrid {
    sun: Vec3,
    u: Vec3,
    v: Vec3,
    first: [f64; 2],
    size: [usize; 2],
    /// Where the entries of each cell start.
    starts: Vec<u32>,
    entries: Vec<Entry>,
}

impl SunGrid {
    pub fn new(objects: &[Object], sky: &Sky) -> Self {
        let sun = sky.sun;
        let u = sun.cross(vec3(0.0, 1.0, 0.0)).unit();
        let v = sun.cross(u);
        let mut grid =
            Self { sun, u, v, first: [0.0; 2], size: [0; 2], starts: vec![0], entries: Vec::new() };
        // Without sun nothing casts a shadow.
        if sky.sun_lx[1] <= 0.0 {
            return grid;
        }
        let mut extents = Vec::new();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (o, object) in objects.iter().enumerate() {
            for (p, part) in object.parts.iter().enumerate() {
                let (mut least, mut most, mut top) =
                    ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], f64::NEG_INFINITY);
                for corner in part.shape.hull() {
                    let q = part.frame.point(corner);
                    for (axis, along) in [u.dot(q), v.dot(q)].into_iter().enumerate() {
                        least[axis] = least[axis].min(along);
                        most[axis] = most[axis].max(along);
                    }
                    top = top.max(sun.dot(q));
                }
                for axis in 0..2 {
                    low[axis] = low[axis].min(least[axis]);
                    high[axis] = high[axis].max(most[axis]);
                }
                extents.push((
                    least,
                    most,
                    Entry {
                        object: o as u32,
                        part: p as u32,
                        top: top as f32 + 0.01,
                        middle: [u.dot(part.centre) as f32, v.dot(part.centre) as f32],
                        radius: part.radius as f32 + 0.01,
                    },
                ));
            }
        }
        if extents.is_empty() {
            return grid;
        }
        grid.first = low;
        grid.size = [0, 1].map(|axis| ((high[axis] - low[axis]) / CELL_M) as usize + 1);
        let cells = |least: &[f64; 2], most: &[f64; 2]| {
            let range = |axis: usize| {
                let cell = |x: f64| ((x - low[axis]) / CELL_M) as usize;
                cell(least[axis])..=cell(most[axis])
            };
            let (columns, width) = (range(0), grid.size[0]);
            range(1).flat_map(move |row| columns.clone().map(move |column| row * width + column))
        };
        // Count, then fill: the entries of a cell lie side by side.
        let mut starts = vec![0u32; grid.size[0] * grid.size[1] + 1];
        for (least, most, _) in &extents {
            cells(least, most).for_each(|cell| starts[cell + 1] += 1);
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut entries = vec![extents[0].2; starts[starts.len() - 1] as usize];
        for (least, most, entry) in &extents {
            for cell in cells(least, most) {
                entries[next[cell] as usize] = *entry;
                next[cell] += 1;
            }
        }
        (grid.starts, grid.entries) = (starts, entries);
        grid
    }

    /// Whether a part other than `own` (object and part) lies between a point and the sun.
    pub fn shaded(&self, objects: &[Object], p: Vec3, own: Option<(u32, u32)>) -> bool {
        let cell = |along: f64, axis: usize| {
            let at = (along - self.first[axis]) / CELL_M;
            (at >= 0.0 && at < self.size[axis] as f64).then_some(at as usize)
        };
        let (u, v) = (self.u.dot(p), self.v.dot(p));
        let (Some(column), Some(row)) = (cell(u, 0), cell(v, 1)) else {
            return false;
        };
        let place = row * self.size[0] + column;
        let range = self.starts[place] as usize..self.starts[place + 1] as usize;
        let height = self.sun.dot(p) as f32;
        self.entries[range].iter().any(|entry| {
            if entry.top <= height || own == Some((entry.object, entry.part)) {
                return false;
            }
            // Most parts of a cell miss the ray: compare with the sphere around first.
            let (du, dv) = (entry.middle[0] - u as f32, entry.middle[1] - v as f32);
            if du * du + dv * dv > entry.radius * entry.radius {
                return false;
            }
            let part = &objects[entry.object as usize].parts[entry.part as usize];
            let (o, d) = (part.inverse.point(p), part.inverse.direction(self.sun));
            if part.material.has_gaps() {
                let mut crossings = part.shape.crossings(o, d).into_iter().flatten();
                return crossings.any(|t| !part.gap(p + self.sun * t, o + d * t, d));
            }
            part.shape.enter(o, d).is_some()
        })
    }
}
