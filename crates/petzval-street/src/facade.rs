//! Walls of houses with windows, doors and shops.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::colour::{Rgb, blend, from_hue, scaled, surface_colour};
use crate::families::Drawer;
use crate::light::Light;
use crate::noise::{cell, fractal2, value2};
use crate::surface::{Place, Surface};
use crate::texture::Texture;

/// What a wall is built of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wall {
    Brick,
    Plaster,
    Panels,
    Stone,
    Boards,
    Patterned,
}

const WALLS: [(Wall, &str); 6] = [
    (Wall::Brick, "brick"),
    (Wall::Plaster, "plaster"),
    (Wall::Panels, "panels"),
    (Wall::Stone, "stone"),
    (Wall::Boards, "boards"),
    (Wall::Patterned, "patterned"),
];

/// How windows are cut.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Windows {
    Upright,
    Wide,
    Paired,
    Ribbon,
    Arched,
    Square,
}

const WINDOWS: [(Windows, &str); 6] = [
    (Windows::Upright, "upright"),
    (Windows::Wide, "wide"),
    (Windows::Paired, "paired"),
    (Windows::Ribbon, "ribbon"),
    (Windows::Arched, "arched"),
    (Windows::Square, "square"),
];

/// The wall of a house. The object's x runs along the street, y up, z out of the front.
#[derive(Clone, Debug)]
pub(crate) struct Facade {
    wall: Wall,
    windows: Windows,
    colours: [Rgb; 2],
    frame: Rgb,
    texture: Texture,
    floor_m: f64,
    bay_m: f64,
    /// Width and height of a window, m, and height of its sill above the floor.
    window_m: [f64; 3],
    /// Height of the shop on the ground floor, m; zero without one.
    shop_m: f64,
    top_m: f64,
    /// Share of lit windows, and their luminance, cd/m^2.
    lit_share: f32,
    lit_cd_m2: f32,
    shop_cd_m2: f32,
    seed: u32,
}

impl Facade {
    /// A facade of `top_m` metres.
    pub fn draw(rng: &mut ChaCha8Rng, drawer: &mut Drawer, light: Light, top_m: f64) -> Self {
        let wall = drawer.draw(rng, "wall", &WALLS);
        let windows = drawer.draw(rng, "windows", &WINDOWS);
        let tone = rng.random_range(0.12..0.6);
        let base = match wall {
            Wall::Brick => from_hue(rng.random_range(0.01..0.09), rng.random_range(0.3..0.65), 0.7 * tone),
            _ if rng.random_bool(0.2) => surface_colour(rng),
            _ => from_hue(rng.random_range(0.03..0.17), rng.random_range(0.0..0.4), tone),
        };
        let joint = scaled(base, rng.random_range(0.6..1.3));
        let window_m: [f64; 3] = match windows {
            Windows::Upright => [rng.random_range(0.8..1.2), rng.random_range(1.5..2.1), 0.7],
            Windows::Wide => [rng.random_range(1.6..2.4), rng.random_range(1.2..1.6), 0.9],
            Windows::Paired => [rng.random_range(1.7..2.2), rng.random_range(1.3..1.7), 0.8],
            Windows::Ribbon => [99.0, rng.random_range(1.3..1.9), 0.8],
            Windows::Arched => [rng.random_range(0.9..1.3), rng.random_range(1.7..2.1), 0.6],
            Windows::Square => [rng.random_range(0.9..1.2), rng.random_range(0.9..1.2), 1.0],
        };
        let (lit_share, lit_cd_m2, shop_cd_m2) = match light {
            Light::Day => (0.06, 120.0, rng.random_range(50.0..600.0)),
            Light::Dusk => (0.3, rng.random_range(5.0..40.0), rng.random_range(20.0..300.0)),
            Light::Night => (0.25, rng.random_range(0.5..8.0), rng.random_range(2.0..40.0)),
        };
        let dark_shop = rng.random_bool(0.4);
        Self {
            wall,
            windows,
            colours: [base, joint],
            frame: if rng.random_bool(0.5) { [rng.random_range(0.5..0.8); 3] } else { surface_colour(rng) },
            texture: Texture::draw(rng, drawer, 0.5),
            floor_m: rng.random_range(2.8..3.7),
            bay_m: window_m[0].min(2.5) + rng.random_range(0.7..2.0),
            window_m,
            shop_m: if rng.random_bool(0.55) { rng.random_range(3.0..4.2) } else { 0.0 },
            top_m,
            lit_share,
            lit_cd_m2,
            shop_cd_m2: if dark_shop { 0.0 } else { shop_cd_m2 },
            seed: rng.random(),
        }
    }

    /// The surface at a place.
    pub fn surface(&self, place: &Place<'_>) -> Surface {
        let p = place.object;
        let across = if place.normal.z.abs() > 0.6 { p.x } else { p.z + 400.0 };
        if place.normal.y.abs() > 0.7 {
            return Surface { albedo: [0.12; 3], gloss: 0.0, emission: [0.0; 3] };
        }
        if p.y < self.shop_m {
            return self.shop(across, p.y, place);
        }
        let above = p.y - self.shop_m;
        let floor = (above / self.floor_m).floor();
        let bay = (across / self.bay_m).floor();
        let up = above - floor * self.floor_m;
        let from_middle = across - (bay + 0.5) * self.bay_m;
        let [width, height, sill] = self.window_m;
        // No window is cut off by the roof.
        let fits = p.y - up + sill + height < self.top_m - 0.5;
        let half = 0.5 * width.min(self.bay_m);
        let (dx, dy) = (half - from_middle.abs(), (up - sill).min(sill + height - up));
        let arched = self.windows == Windows::Arched && {
            let rise = up - (sill + height - half);
            rise > 0.0 && from_middle.hypot(rise) > half
        };
        let frame = 0.055 + 0.35 * place.footprint_m;
        if !fits || dy < -0.1 || dx < -0.12 || (arched && dx < 0.2 && dy < 0.1) {
            return self.wall(across, p.y, place);
        }
        if dy < 0.0 || dx < 0.0 || arched {
            // The surround: a sill below, a lintel above.
            let tone = if up < sill { 1.15 } else { 0.8 };
            let albedo = scaled(blend(self.colours[0], self.frame, 0.4), tone);
            return Surface { albedo, gloss: 0.0, emission: [0.0; 3] };
        }
        let bar = match self.windows {
            Windows::Paired | Windows::Upright => from_middle.abs() < 0.6 * frame,
            Windows::Wide => (from_middle.abs() - half / 3.0).abs() < 0.5 * frame,
            Windows::Arched => {
                from_middle.abs() < 0.5 * frame || (up - sill - 0.65 * height).abs() < 0.5 * frame
            }
            _ => false,
        };
        if dx < frame || dy < frame || bar {
            return Surface { albedo: self.frame, gloss: 0.02, emission: [0.0; 3] };
        }
        let key = cell(bay as i32, floor as i32, self.seed);
        // The window lies back in the wall: its upper edge is in shade.
        let shade = if sill + height - up < 0.18 { 0.45 } else { 1.0 };
        let curtain = from_middle.abs() > half * f64::from(0.4 + key)
            || up > sill + height * f64::from(0.55 + 0.6 * key);
        let behind = if curtain { [0.30, 0.28, 0.25] } else { [0.025; 3] };
        let lit = cell(bay as i32 + 77, floor as i32, self.seed) < self.lit_share;
        let emission = if lit {
            let deep = 0.4 + 0.9 * value2(3.0 * across, 2.5 * p.y, self.seed);
            let warm = [1.25, 1.0, 0.4 + 0.5 * key];
            scaled(warm, self.lit_cd_m2 * deep * if curtain { 0.6 } else { 1.0 } * (0.3 + key))
        } else {
            [0.0; 3]
        };
        Surface { albedo: scaled(behind, shade), gloss: 0.09 * shade, emission }
    }

    /// The ground floor of a shop: a band for its name, panes, doors.
    fn shop(&self, across: f64, up: f64, place: &Place<'_>) -> Surface {
        let plain = |albedo: Rgb| Surface { albedo, gloss: 0.02, emission: [0.0; 3] };
        let bay = (across / 4.3).floor();
        let within = across - bay * 4.3;
        if up > self.shop_m - 0.75 {
            let on = up < self.shop_m - 0.15;
            let albedo = if on { self.texture.at(across, up, place.footprint_m) } else { self.colours[1] };
            let glow = if cell(bay as i32, 3, self.seed) < 0.5 && on { 0.15 * self.shop_cd_m2 } else { 0.0 };
            return Surface { emission: scaled(albedo, glow), ..plain(albedo) };
        }
        let frame = 0.06 + 0.35 * place.footprint_m;
        let door = within > 3.1;
        if within < 0.35 || (!door && up < 0.45) {
            return self.wall(across, up, place);
        }
        if within < 0.35 + frame
            || (within - 3.1).abs() < frame
            || within > 4.3 - frame
            || (door && up < 0.15)
        {
            return plain(self.frame);
        }
        let goods = self.texture.at(1.7 * across, 2.0 * up, place.footprint_m);
        let depth = 0.4 + 0.8 * fractal2(1.2 * across, 1.5 * up, 3, self.seed);
        let light = self.shop_cd_m2 * depth * if up > 2.0 { 1.4 } else { 0.9 };
        let emission = scaled(blend([1.05, 1.0, 0.85], goods, 0.75), light);
        Surface { albedo: scaled(goods, 0.12), gloss: 0.08, emission }
    }

    /// Bare wall.
    fn wall(&self, across: f64, up: f64, place: &Place<'_>) -> Surface {
        let weather = 0.72 + 0.56 * fractal2(0.35 * across, 0.22 * up, 4, self.seed);
        let fine = 0.9 + 0.2 * fractal2(7.0 * across, 7.0 * up, 2, self.seed ^ 3);
        // Courses melt into their mean where a pixel covers several.
        let block = |width: f64, height: f64, joint: f64| {
            let row = (up / height).floor();
            let shifted = across / width + 0.5 * row.rem_euclid(2.0);
            let column = shifted.floor();
            let edge = ((shifted - column) * width).min(up - row * height);
            let tone = 0.75 + 0.5 * cell(column as i32, row as i32, self.seed);
            let seen = (0.6 * height / place.footprint_m.max(1e-6)).min(1.0) as f32;
            let share = if edge < joint { 1.0 } else { 0.0 };
            let albedo = blend(scaled(self.colours[0], tone), self.colours[1], share);
            blend(self.colours[0], albedo, seen)
        };
        let albedo = match self.wall {
            Wall::Brick => block(0.25, 0.075, 0.012),
            Wall::Plaster => self.colours[0],
            Wall::Panels => block(self.bay_m, self.floor_m, 0.025),
            Wall::Stone => block(0.75, 0.36, 0.02),
            Wall::Boards => block(3.7, 0.18, 0.015),
            Wall::Patterned => blend(self.colours[0], self.texture.at(across, up, place.footprint_m), 0.35),
        };
        // Splashes of dirt near the ground.
        let low = 0.75 + 0.25 * (up as f32 / 0.8).min(1.0);
        Surface { albedo: scaled(albedo, weather * fine * low), gloss: 0.0, emission: [0.0; 3] }
    }
}
