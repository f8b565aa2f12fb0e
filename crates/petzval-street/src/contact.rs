//! Contact shadows: objects take light of the sky from the ground below and beside them.

use crate::object::Object;
use crate::vector::Vec3;

/// Length of a cell along the street, m.
const CELL_M: f64 = 2.0;
const FIRST_M: f64 = -40.0;
const CELLS: usize = 240;

/// The objects whose contact shadows reach each stretch of the street.
pub(crate) struct ContactGrid {
    cells: Vec<Vec<u32>>,
}

impl ContactGrid {
    pub fn new(objects: &[Object]) -> Self {
        let mut cells = vec![Vec::new(); CELLS];
        for (i, object) in objects.iter().enumerate() {
            let Some(footprint) = object.footprint else { continue };
            let [half_x, half_z] = footprint.half_m;
            let along =
                half_x * object.frame.x.z.abs() + half_z * object.frame.z.z.abs() + 4.0 * footprint.reach_m;
            let z = object.frame.origin.z - FIRST_M;
            let last = CELLS as f64 - 1.0;
            let cell = |z: f64| (z / CELL_M).clamp(0.0, last) as usize;
            for list in &mut cells[cell(z - along)..=cell(z + along)] {
                list.push(i as u32);
            }
        }
        Self { cells }
    }

    /// Share of the sky's light that reaches the ground at a place.
    pub fn openness(&self, objects: &[Object], p: Vec3) -> f32 {
        let cell = (p.z - FIRST_M) / CELL_M;
        let Some(list) = self.cells.get(cell.max(0.0) as usize) else { return 1.0 };
        let mut open = 1.0;
        for &i in list {
            let object = &objects[i as usize];
            let Some(footprint) = object.footprint else { continue };
            let beyond =
                (p - object.frame.origin).length() - footprint.half_m[0].max(footprint.half_m[1]) * 1.5;
            if beyond < 4.0 * footprint.reach_m {
                open *= 1.0 - footprint.darkness * (-object.ground_distance(p) / footprint.reach_m).exp();
            }
        }
        open as f32
    }
}
