//! Cheap noise from hashed lattice points. Every function returns 0..1.

/// A well-mixed number from three whole numbers and a seed.
#[inline(always)]
pub(crate) fn hash(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x8da6_b343)
        ^ (y as u32).wrapping_mul(0xd816_3841)
        ^ (z as u32).wrapping_mul(0xcb1a_b31f)
        ^ seed.wrapping_mul(0x9e37_79b9);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2c1b_3c6d);
    h ^= h >> 12;
    h = h.wrapping_mul(0x297a_2d39);
    h ^ h >> 15
}

/// The number 0..1 of a hash.
#[inline(always)]
pub(crate) fn unit(h: u32) -> f32 {
    (h >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A uniform number of a lattice cell.
#[inline(always)]
pub(crate) fn cell(x: i32, y: i32, seed: u32) -> f32 {
    unit(hash(x, y, 0, seed))
}

#[inline(always)]
fn fade(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// The largest whole number that is not above `x`; a conversion is faster than the library's function.
#[inline(always)]
pub(crate) fn floor(x: f64) -> i32 {
    let toward_zero = x as i32;
    toward_zero - i32::from(f64::from(toward_zero) > x)
}

/// Lattice cell and place in it.
#[inline(always)]
fn split(x: f64) -> (i32, f32) {
    let cell = floor(x);
    (cell, (x - f64::from(cell)) as f32)
}

/// Smooth noise on a plane; features of size one.
#[inline]
pub(crate) fn value2(x: f64, y: f64, seed: u32) -> f32 {
    let ((ix, fx), (iy, fy)) = (split(x), split(y));
    let (u, v) = (fade(fx), fade(fy));
    let at = |dx: i32, dy: i32| cell(ix.wrapping_add(dx), iy.wrapping_add(dy), seed);
    let low = at(0, 0) + u * (at(1, 0) - at(0, 0));
    let high = at(0, 1) + u * (at(1, 1) - at(0, 1));
    low + v * (high - low)
}

/// Smooth noise in space; features of size one.
#[inline]
pub(crate) fn value3(x: f64, y: f64, z: f64, seed: u32) -> f32 {
    let ((ix, fx), (iy, fy), (iz, fz)) = (split(x), split(y), split(z));
    let (u, v, w) = (fade(fx), fade(fy), fade(fz));
    let at = |dx: i32, dy: i32, dz: i32| {
        unit(hash(ix.wrapping_add(dx), iy.wrapping_add(dy), iz.wrapping_add(dz), seed))
    };
    let row = |dy: i32, dz: i32| at(0, dy, dz) + u * (at(1, dy, dz) - at(0, dy, dz));
    let plane = |dz: i32| row(0, dz) + v * (row(1, dz) - row(0, dz));
    plane(0) + w * (plane(1) - plane(0))
}

/// Noise of several octaves on a plane, about 0.5 on average.
#[inline]
pub(crate) fn fractal2(x: f64, y: f64, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total, mut scale) = (0.0, 1.0, 0.0, 1.0);
    for octave in 0..octaves {
        // Turn each octave, so that the lattice does not show.
        let (tx, ty) = if octave & 1 == 0 { (x, y) } else { (0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y) };
        sum += weight * value2(tx * scale, ty * scale, seed.wrapping_add(octave * 977));
        total += weight;
        weight *= 0.5;
        scale *= 2.03;
    }
    sum / total
}

/// Layers of overlapping discs: the number 0..1 of the uppermost disc at a place. Discs have radii up to one.
pub(crate) fn leaves2(x: f64, y: f64, seed: u32) -> f32 {
    for layer in 0..3u32 {
        let scale = [1.0, 1.7, 0.8][layer as usize];
        let (px, py) = (x * scale + 0.37 * layer as f64, y * scale);
        let (cx, cy) = (floor(px), floor(py));
        let mut best: Option<u32> = None;
        for dy in -1..=1 {
            for dx in -1..=1 {
                let h = hash(cx + dx, cy + dy, layer as i32, seed);
                let (ox, oy) = (unit(h), unit(h.wrapping_mul(0x9e37_79b1)));
                let radius = f64::from(0.15 + 0.7 * unit(h.wrapping_mul(0x85eb_ca6b)).powi(2));
                let ex = px - f64::from(cx + dx) - f64::from(ox);
                let ey = py - f64::from(cy + dy) - f64::from(oy);
                if ex * ex + ey * ey < radius * radius && best.is_none_or(|b| h > b) {
                    best = Some(h);
                }
            }
        }
        if let Some(h) = best {
            return unit(h.wrapping_mul(0xc2b2_ae35));
        }
    }
    0.5
}

/// Cells of random shape: the number 0..1 of the nearest seed point, and how far the second nearest is beyond it.
pub(crate) fn cells2(x: f64, y: f64, seed: u32) -> (f32, f32) {
    let (cx, cy) = (floor(x), floor(y));
    let (mut first, mut second, mut id) = (9.0f64, 9.0f64, 0);
    for dy in -1..=1 {
        for dx in -1..=1 {
            let h = hash(cx + dx, cy + dy, 7, seed);
            let ex = x - f64::from(cx + dx) - f64::from(unit(h));
            let ey = y - f64::from(cy + dy) - f64::from(unit(h.wrapping_mul(0x9e37_79b1)));
            let distance = (ex * ex + ey * ey).sqrt();
            if distance < first {
                (second, first, id) = (first, distance, h);
            } else if distance < second {
                second = distance;
            }
        }
    }
    (unit(id.wrapping_mul(0xc2b2_ae35)), (second - first) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_stays_in_range_and_averages_to_a_half() {
        let mut sums = [0.0f64; 4];
        let n = 40_000;
        for i in 0..n {
            let (x, y) = (0.173 * f64::from(i % 200) - 9.0, 0.291 * f64::from(i / 200) - 30.0);
            let values = [value2(x, y, 1), value3(x, y, 0.3 * x, 2), fractal2(x, y, 4, 3), leaves2(x, y, 4)];
            for (sum, value) in sums.iter_mut().zip(values) {
                assert!((0.0..=1.0).contains(&value));
                *sum += f64::from(value);
            }
        }
        assert!(sums.iter().all(|sum| (sum / f64::from(n) - 0.5).abs() < 0.06), "{sums:?}");
    }
}
