//! Glasses near a point of the n_d, V_d plane.

use std::sync::Arc;

use super::{Catalog, Glass};

/// A glass and its distance from the requested point.
#[derive(Clone, Debug, PartialEq)]
pub struct Near {
    /// The glass.
    pub glass: Arc<Glass>,
    /// `sqrt((dn_d / 0.01)^2 + dV_d^2)`: 0.01 of index counts as much as 1 of Abbe number, as on usual glass maps.
    pub distance: f64,
}

/// Distance of a glass from a point of the glass map, as in [`Near`].
pub fn map_distance(glass: &Glass, [nd, vd]: [f64; 2]) -> f64 {
    const ND_UNIT: f64 = 0.01;
    ((glass.nd() - nd) / ND_UNIT).hypot(glass.abbe_vd() - vd)
}

/// The glasses nearest to a point `[n_d, V_d]`, nearest first, at most `count`, among those that pass `wanted`. Each
/// glass of each maker is listed once, under its own name; media without dispersion are left out.
pub fn nearest(
    catalog: &Catalog,
    place: [f64; 2],
    count: usize,
    wanted: impl Fn(&Glass) -> bool,
) -> Vec<Near> {
    let mut found: Vec<Near> = catalog
        .glasses()
        .filter(|glass| wanted(glass))
        .map(|glass| Near { glass: glass.clone(), distance: map_distance(glass, place) })
        .filter(|near| near.distance.is_finite())
        .collect();
    found.sort_by(|a, b| a.distance.total_cmp(&b.distance).then_with(|| a.glass.name.cmp(&b.glass.name)));
    found.truncate(count);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::glass::{Dispersion, Glass};

    #[test]
    fn the_nearest_come_first_and_aliases_do_not_count_twice() {
        let mut catalog = Catalog::default();
        for (name, maker, dispersion) in [
            ("A", "One", Dispersion::NdVd { nd: 1.51, vd: 64.0 }),
            ("B", "", Dispersion::NdVd { nd: 1.52, vd: 62.0 }),
            ("C", "", Dispersion::NdVd { nd: 1.7, vd: 30.0 }),
            ("D", "", Dispersion::Constant(1.5)),
        ] {
            let glass = Arc::new(Glass { maker: maker.into(), ..Glass::new(name, dispersion) });
            catalog.insert(name, glass.clone());
            if name == "A" {
                catalog.insert("AA", glass);
            }
        }
        let near = nearest(&catalog, [1.51, 62.0], 9, |_| true);
        let names: Vec<&str> = near.iter().map(|n| n.glass.name.as_str()).collect();
        assert_eq!(names, ["B", "A", "C"]);
        assert!((near[0].distance - 1.0).abs() < 1e-9 && (near[1].distance - 2.0).abs() < 1e-9);
        assert_eq!(nearest(&catalog, [1.51, 62.0], 1, |g| g.maker == "One")[0].glass.name, "A");
    }
}
