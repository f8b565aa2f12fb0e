//! The picture: rays through every sample of every pixel, tile by tile.
//!
//! Tiles lie on a fixed grid of sensor pixels. Each tile has a short list, front to back, of the parts whose projected bounds
//! reach into it. Lists and samples depend only on the place on the sensor, so a window shows the bits of the whole picture.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::colour::{Rgb, plus};
use crate::error::StreetError;
use crate::noise::{hash, unit};
use crate::object::{Object, Part};
use crate::pose::Pose;
use crate::projection::Projection;
use crate::road::GroundFace;
use crate::seen::{Seen, Tally, seen_objects};
use crate::shade::Hit;
use crate::street::Street;
use crate::surface_class::SurfaceClass;
use crate::vector::{Frame, Vec3};
use crate::window::Window;

/// Side of a tile, pixels.
const TILE: i64 = 16;
/// Tiles per side of a block, which first shortens the lists of its tiles.
const BLOCK: i64 = 4;
/// Most samples per side of a pixel.
const MOST_SAMPLES: usize = 16;

/// A part that may show: where its bounds lie on the sensor, and how near it begins.
#[derive(Clone, Copy)]
struct Shown {
    /// `[x1, y1, x2, y2]`, pixels.
    bounds: [f64; 4],
    near: f64,
    /// From the eye to its middle, m, and the radius of the sphere around it.
    to: Vec3,
    radius: f64,
    /// The eye in the part's own coordinates.
    eye: Vec3,
    object: u32,
    part: u32,
    /// Its place among the labelled objects of a tile.
    slot: u32,
}

/// The slot of a part that belongs to no labelled object.
const NO_SLOT: u32 = u32::MAX;

impl Shown {
    /// Whether a ray passes within `margin_m` of the sphere around the part.
    #[inline(always)]
    fn near_ray(&self, ray: Vec3, margin_m: f64) -> bool {
        let along = self.to.dot(ray);
        let reach = self.radius + margin_m;
        self.to.dot(self.to) - along * along <= reach * reach
    }

    fn reaches(&self, area: [f64; 4]) -> bool {
        let b = self.bounds;
        b[0] < area[2] && b[2] > area[0] && b[1] < area[3] && b[3] > area[1]
    }
}

/// What all tiles of a picture share.
struct View<'a> {
    street: &'a Street,
    projection: &'a Projection,
    camera: Frame,
    window: Window,
    samples: usize,
    pixel_rad: f64,
}

/// One finished tile.
struct Tile {
    row: usize,
    column: usize,
    width: usize,
    pixels: Vec<Rgb>,
    classes: Vec<SurfaceClass>,
    tallies: Vec<(u32, Tally)>,
}

impl Street {
    /// What a camera at `pose` sees in `window`, with `samples_per_side^2` samples (1 to 16 per side) in each pixel.
    ///
    /// The same arguments give the same bits whatever the number of threads, and a window shows exactly what the same pixels of
    /// any larger window show.
    pub fn see(
        &self,
        projection: &Projection,
        pose: &Pose,
        window: Window,
        samples_per_side: usize,
    ) -> Result<Seen, StreetError> {
        window.check()?;
        pose.check()?;
        if !(1..=MOST_SAMPLES).contains(&samples_per_side) {
            return Err(StreetError::Samples { samples: samples_per_side });
        }
        let camera = pose.frame();
        let centre = [0.5 * projection.columns() as f64, 0.5 * projection.rows() as f64];
        let neighbour = projection.direction(centre[0] + 1.0, centre[1]);
        let pixel_rad = neighbour.x.atan2(neighbour.z);
        let view = View { street: self, projection, camera, window, samples: samples_per_side, pixel_rad };
        let shown = view.shown();

        // Blocks of tiles in parallel; each pixel belongs to one tile.
        let side = TILE * BLOCK;
        let range =
            |first: i64, count: usize| first.div_euclid(side)..=(first + count as i64 - 1).div_euclid(side);
        let blocks: Vec<(i64, i64)> = range(window.row, window.height)
            .flat_map(|row| range(window.col, window.width).map(move |col| (row * side, col * side)))
            .collect();
        let tiles: Vec<Tile> =
            blocks.par_iter().flat_map_iter(|&(row, col)| view.block(row, col, &shown)).collect();

        let area = window.height * window.width;
        let mut planes = vec![0f32; 3 * area];
        let mut classes = vec![SurfaceClass::Sky; area];
        let mut tallies: BTreeMap<u32, Tally> = BTreeMap::new();
        for tile in &tiles {
            for (i, pixel) in tile.pixels.iter().enumerate() {
                let place = (tile.row + i / tile.width) * window.width + tile.column + i % tile.width;
                for channel in 0..3 {
                    planes[channel * area + place] = pixel[channel];
                }
                classes[place] = tile.classes[i];
            }
            for (object, tally) in &tile.tallies {
                tallies.entry(*object).or_default().join(tally);
            }
        }
        let objects = seen_objects(self, projection, &camera, window.outline_px(), &tallies);
        Ok(Seen { height: window.height, width: window.width, planes, classes, objects })
    }
}

impl View<'_> {
    /// All parts that may show in the window, nearest first.
    fn shown(&self) -> Vec<Shown> {
        let inverse = self.camera.inverse();
        let widest = self.projection.widest_rad();
        let outline = self.window.outline_px();
        // Grow the window to whole blocks, so that the list does not depend on where it ends.
        let side = (TILE * BLOCK) as f64;
        let area = [outline[0] - side, outline[1] - side, outline[2] + side, outline[3] + side];
        let beside = |centre: Vec3, radius: f64| {
            let to = inverse.point(centre);
            let spread = (radius / to.length()).min(1.0).asin();
            to.x.hypot(to.y).atan2(to.z) - spread > widest + 0.3
        };
        let mut shown = Vec::new();
        for (o, object) in self.street.objects.iter().enumerate() {
            if beside(object.centre, object.radius) {
                continue;
            }
            for (p, part) in object.parts.iter().enumerate() {
                let to = part.centre - self.camera.origin;
                let entry = Shown {
                    bounds: self.bounds(part, widest),
                    near: to.length() - part.radius,
                    to,
                    radius: part.radius,
                    eye: part.inverse.point(self.camera.origin),
                    object: o as u32,
                    part: p as u32,
                    slot: NO_SLOT,
                };
                if entry.reaches(area) && !beside(part.centre, part.radius) {
                    shown.push(entry);
                }
            }
        }
        shown.sort_by(|a, b| a.near.total_cmp(&b.near));
        shown
    }

    /// A rectangle on the sensor that holds a part; without end if part of it is beside or behind the camera.
    fn bounds(&self, part: &Part, widest: f64) -> [f64; 4] {
        let inverse = self.camera.inverse();
        let everywhere = [f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY];
        let least = (widest + 0.6).min(1.45).cos();
        let mut b = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let to = part.centre - self.camera.origin;
        if to.length() < 1.2 * part.radius {
            return everywhere;
        }
        for corner in part.shape.hull() {
            let ([x, y], cosine) = self.projection.pixel(inverse.point(part.frame.point(corner)));
            if cosine < least {
                return everywhere;
            }
            b = [b[0].min(x), b[1].min(y), b[2].max(x), b[3].max(y)];
        }
        // Distortion bends the edges between the corners outward by a share of their length.
        let spread = part.radius / to.length();
        let margin = 1.5 + (b[2] - b[0] + b[3] - b[1]) * (0.005 + 0.08 * spread);
        [b[0] - margin, b[1] - margin, b[2] + margin, b[3] + margin]
    }

    /// The tiles of a block that starts at a sensor pixel.
    fn block(&self, row: i64, col: i64, shown: &[Shown]) -> Vec<Tile> {
        let side = TILE * BLOCK;
        let area = [col as f64, row as f64, (col + side) as f64, (row + side) as f64];
        let near: Vec<Shown> = shown.iter().filter(|entry| entry.reaches(area)).copied().collect();
        let mut list = Vec::new();
        let mut tiles = Vec::new();
        for i in 0..BLOCK * BLOCK {
            let (row, col) = (row + i / BLOCK * TILE, col + i % BLOCK * TILE);
            let area = [col as f64, row as f64, (col + TILE) as f64, (row + TILE) as f64];
            list.clear();
            list.extend(near.iter().filter(|entry| entry.reaches(area)));
            tiles.extend(self.tile(row, col, &mut list));
        }
        tiles
    }

    /// The pixels of a tile inside the window; `None` if there are none.
    fn tile(&self, row: i64, col: i64, list: &mut [Shown]) -> Option<Tile> {
        let w = self.window;
        let (first_row, last_row) = (row.max(w.row), (row + TILE).min(w.row + w.height as i64));
        let (first_col, last_col) = (col.max(w.col), (col + TILE).min(w.col + w.width as i64));
        if first_row >= last_row || first_col >= last_col {
            return None;
        }
        let n = self.samples;
        let objects = &self.street.objects;
        let mut labelled = Labelled::default();
        for entry in list.iter_mut() {
            entry.slot = labelled.slot(objects, entry.object);
        }
        let mut pixels = Vec::with_capacity((TILE * TILE) as usize);
        let mut classes = Vec::with_capacity((TILE * TILE) as usize);
        let mut close: Vec<Shown> = Vec::new();
        for row in first_row..last_row {
            for col in first_col..last_col {
                // All samples of a pixel lie within a pixel of its middle.
                let middle = self.projection.direction(col as f64 + 0.5, row as f64 + 0.5);
                let middle = self.camera.direction(middle);
                let margin = 1.5 * self.pixel_rad;
                close.clear();
                let pixel = [col as f64, row as f64, col as f64 + 1.0, row as f64 + 1.0];
                close.extend(list.iter().filter(|entry| {
                    let far = entry.near.max(0.0) + 2.0 * entry.radius;
                    entry.reaches(pixel) && entry.near_ray(middle, margin * far)
                }));
                let mut sum = [0.0; 3];
                let mut counts = [0; SurfaceClass::ALL.len()];
                for i in 0..n * n {
                    let cell = self.cell(row, col, i);
                    let ray = self.ray(row, col, i, cell);
                    let hit = self.first_hit(ray, &close);
                    sum = plus(sum, self.street.light_of(self.camera.origin, ray, hit, self.pixel_rad));
                    labelled.count(objects, &close, self.camera.origin, ray, hit, cell);
                    counts[self.class_of(hit) as usize] += 1;
                }
                let share = 1.0 / (n * n) as f32;
                pixels.push(sum.map(|channel| channel * share));
                classes.push(SurfaceClass::of_most(&counts));
            }
        }
        Some(Tile {
            row: (first_row - w.row) as usize,
            column: (first_col - w.col) as usize,
            width: (last_col - first_col) as usize,
            pixels,
            classes,
            tallies: labelled.tallies.into_iter().filter(|(_, tally)| tally.all > 0).collect(),
        })
    }

    /// The class of what a ray meets first.
    fn class_of(&self, hit: Hit) -> SurfaceClass {
        match hit {
            Hit::Sky => SurfaceClass::Sky,
            Hit::Ground { face: GroundFace::Carriageway, .. } => SurfaceClass::Road,
            Hit::Ground { face: GroundFace::Pavement | GroundFace::Kerb, .. } => SurfaceClass::Pavement,
            Hit::Part { object, part, .. } => self.street.objects[object as usize].parts[part as usize].class,
        }
    }

    /// The cell of a pixel's `i`th sample, `[x1, y1, x2, y2]` in sensor pixels.
    fn cell(&self, row: i64, col: i64, i: usize) -> [f64; 4] {
        let step = 1.0 / self.samples as f64;
        let (x, y) =
            (col as f64 + step * (i % self.samples) as f64, row as f64 + step * (i / self.samples) as f64);
        [x, y, x + step, y + step]
    }

    /// The direction in the world of a sample: a random place in its cell, keyed by the pixel.
    fn ray(&self, row: i64, col: i64, i: usize, cell: [f64; 4]) -> Vec3 {
        let h = hash(row as i32, col as i32, i as i32, 0x51ed);
        let (u, v) = (f64::from(unit(h)), f64::from(unit(h.wrapping_mul(0x9e37_79b1) ^ h >> 7)));
        let (x, y) = (cell[0] + u * (cell[2] - cell[0]), cell[1] + v * (cell[3] - cell[1]));
        self.camera.direction(self.projection.direction(x, y))
    }

    /// What a ray meets first.
    fn first_hit(&self, ray: Vec3, list: &[Shown]) -> Hit {
        let eye = self.camera.origin;
        let (mut best, mut hit) = match self.street.road.enter(eye, ray) {
            Some((distance, face)) => (distance, Hit::Ground { distance, face }),
            None => (f64::INFINITY, Hit::Sky),
        };
        for entry in list {
            // The list is sorted: nothing behind can be nearer.
            if entry.near > best {
                break;
            }
            let part = &self.street.objects[entry.object as usize].parts[entry.part as usize];
            if entry.near_ray(ray, 0.0)
                && let Some((distance, face)) = part_entry(part, entry.eye, eye, ray)
                && distance < best
            {
                best = distance;
                hit = Hit::Part { distance, object: entry.object, part: entry.part, face };
            }
        }
        hit
    }
}

/// Where a ray enters a part, and the face. `own_eye` is the eye in the part's own coordinates.
#[inline]
fn part_entry(part: &Part, own_eye: Vec3, eye: Vec3, ray: Vec3) -> Option<(f64, u32)> {
    let (o, d) = (own_eye, part.inverse.direction(ray));
    if part.material.has_gaps() {
        let solid = |t: &f64| !part.gap(eye + ray * *t, o + d * *t, d);
        return part.shape.crossings(o, d).into_iter().flatten().find(solid).map(|t| (t, 0));
    }
    part.shape.enter(o, d)
}

/// The labelled objects of a tile and the counts of their samples.
#[derive(Default)]
struct Labelled {
    tallies: Vec<(u32, Tally)>,
    /// The last sample that met each object.
    met: Vec<u32>,
    sample: u32,
}

impl Labelled {
    /// The slot of an object, which is added if it is labelled and new.
    fn slot(&mut self, objects: &[Object], object: u32) -> u32 {
        if objects[object as usize].kind.is_none() {
            return NO_SLOT;
        }
        let place = self.tallies.iter().position(|(known, _)| *known == object);
        place.unwrap_or_else(|| {
            self.tallies.push((object, Tally::default()));
            self.met.push(0);
            self.met.len() - 1
        }) as u32
    }

    /// Counts a sample for the objects that it meets, hidden or not. `close` lists the parts near its pixel.
    fn count(&mut self, objects: &[Object], close: &[Shown], eye: Vec3, ray: Vec3, hit: Hit, cell: [f64; 4]) {
        let (first, distance) = match hit {
            Hit::Sky => return,
            Hit::Ground { distance, .. } => (None, distance),
            Hit::Part { distance, object, .. } => (Some(object), distance),
        };
        self.sample += 1;
        for entry in close.iter().filter(|entry| entry.slot != NO_SLOT) {
            let slot = entry.slot as usize;
            if self.met[slot] == self.sample {
                continue;
            }
            let tally = &mut self.tallies[slot].1;
            if first == Some(entry.object) {
                tally.show(cell);
                self.met[slot] = self.sample;
            } else if entry.near + 2.0 * entry.radius > distance && entry.near_ray(ray, 0.0) {
                // A hidden sample has the object behind what the ray meets first.
                let part = &objects[entry.object as usize].parts[entry.part as usize];
                if part_entry(part, entry.eye, eye, ray).is_some() {
                    tally.all += 1;
                    self.met[slot] = self.sample;
                }
            }
        }
    }
}
