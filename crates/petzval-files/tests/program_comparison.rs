//! Checks the manual's comparison page: agreement with Optiland and ray-optics within the tolerance of each quantity, and the
//! reasons for differences.

#[path = "../examples/program_comparison/checks.rs"]
mod checks;
#[path = "../examples/program_comparison/listed.rs"]
#[allow(dead_code, reason = "the page prints more than is tested")]
mod listed;
#[path = "../examples/program_comparison/ours.rs"]
mod ours;
#[path = "../examples/program_comparison/rows.rs"]
#[allow(dead_code, reason = "the page prints more than is tested")]
mod rows;

use std::collections::HashMap;

use petzval_files::parse_lens;
use petzval_optics::glass::Catalog;
use rows::{Because, Compared, Pair, compare};

fn pairs(lenses: &[Compared]) -> impl Iterator<Item = (String, &Pair)> {
    lenses.iter().flat_map(|lens| {
        let first_order =
            lens.first_order.iter().map(move |row| (format!("{} {}", lens.name, row.quantity), row));
        let rays = lens.rays.iter().flat_map(move |(field, rows)| {
            rows.iter().map(move |row| (format!("{} {field} {}", lens.name, row.quantity), row))
        });
        let modulation = lens.modulation.iter().flat_map(move |row| {
            let name = format!("{} {} {} {}", lens.name, row.field_deg, row.section, row.by);
            row.pairs.iter().map(move |p| (name.clone(), p))
        });
        let of_rows = first_order
            .chain(rays)
            .flat_map(|(name, row)| row.pairs.iter().flatten().map(move |p| (name.clone(), p)));
        of_rows.chain(modulation)
    })
}

#[test]
fn values_agree_to_the_tolerances_of_the_page() {
    let lenses = compare(&listed::listed());
    let mut failures = Vec::new();
    let mut noted: HashMap<&str, f64> = HashMap::new();
    for (name, p) in pairs(&lenses) {
        let apart = (p.ours - p.theirs).abs();
        match p.because {
            Some(because) => {
                let most = noted.entry(because.mark()).or_default();
                *most = most.max(apart / p.tolerance);
            }
            None if apart <= p.tolerance => {}
            None => {
                failures.push(format!("{name}: {} {} ({apart:.1e} > {:.0e})", p.ours, p.theirs, p.tolerance))
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    // A noted difference must still exist: otherwise its note would hide agreement.
    for because in [Because::SquareTerm, Because::Aspheres, Because::ExitPupil, Because::Sphere] {
        assert!(noted[because.mark()] > 10.0, "{because:?}: {}", noted[because.mark()]);
    }
}

#[test]
fn the_reasons_for_differences_hold() {
    for c in checks::checks(&listed::listed()) {
        let apart = (c.value - c.other).abs();
        assert!(
            apart <= c.tolerance,
            "{} ({}): {} {}, {} {} ({apart:.1e})",
            c.lens,
            c.note,
            c.this,
            c.value,
            c.that,
            c.other
        );
    }
}

#[test]
fn optilands_diffraction_mtf_converges_to_ours_with_a_finer_grid() {
    for lens in checks::settling(&listed::listed()) {
        let (first, last) = (lens.by_rays.first().unwrap(), lens.by_rays.last().unwrap());
        assert!(first.0 < last.0 && last.1 < first.1 && last.1 < 5e-4, "{}: {:?}", lens.lens, lens.by_rays);
    }
}

#[test]
fn listed_lenses_equal_the_built_in_ones() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data");
    let mut catalog = Catalog::default();
    for entry in std::fs::read_dir(folder.join("glasses")).unwrap() {
        catalog.merge(
            petzval_files::parse_catalog(&std::fs::read_to_string(entry.unwrap().path()).unwrap()).unwrap(),
        );
    }
    let mut compared = 0;
    for listed in listed::listed().lenses {
        let Some(file) = &listed.file else { continue };
        let text = std::fs::read_to_string(folder.join(format!("lenses/{file}.toml"))).unwrap();
        let (ours, theirs) = (parse_lens(&text, &catalog).unwrap().lens, listed.lens());
        assert_eq!((ours.stop, ours.entrance_pupil_mm), (theirs.stop, theirs.entrance_pupil_mm));
        assert_eq!((&ours.wavelengths_um, &ours.fields_deg), (&theirs.wavelengths_um, &theirs.fields_deg));
        for um in &listed.index_um {
            let (a, b) = (ours.at_wavelength(*um), theirs.at_wavelength(*um));
            for (a, b) in a.surfaces.iter().zip(&b.surfaces) {
                assert!((a.n_after - b.n_after).abs() < 1e-14, "{file} {um}: {} {}", a.n_after, b.n_after);
                assert_eq!((a.shape, a.thickness_mm), (b.shape, b.thickness_mm), "{file}");
            }
        }
        compared += 1;
    }
    assert_eq!(compared, 2);
}
