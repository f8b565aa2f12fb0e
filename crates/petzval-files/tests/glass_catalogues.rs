//! Compares the built-in glasses with the printed values of their makers.

use std::fs;
use std::path::Path;

use petzval_files::write_catalog;
use petzval_optics::glass::{Catalog, Glass, LINE_C_UM, LINE_D_UM, LINE_F_UM};

/// The catalogue files with their names, sorted by name.
fn files() -> Vec<(String, Catalog)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/glasses");
    let mut files: Vec<(String, Catalog)> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let catalog = petzval_files::parse_catalog(&fs::read_to_string(&path).unwrap())
                .unwrap_or_else(|e| panic!("{path:?}: {e}"));
            (path.file_stem().unwrap().to_string_lossy().into_owned(), catalog)
        })
        .collect();
    files.sort_by(|a, b| a.0.cmp(&b.0));
    files
}

fn glass(file: &str, name: &str) -> std::sync::Arc<Glass> {
    let (_, catalog) = files().into_iter().find(|(known, _)| known == file).unwrap();
    catalog.get(name).unwrap()
}

/// Glasses whose formula contradicts the printed values, by file, with the reason. Formula and printed values are both the
/// maker's; the manual lists them.
const OFF_PRINT: [(&str, &str, &str); 6] = [
    (
        "hoya",
        "V_d is that of indices that were rounded before",
        "BACED5 FC5 M-NBFD10 M-PCD4 MC-FCD1-M20 MC-PCD4-40 MC-TAF31-15 MC-TAFD51-50 MP-FCD1-M20 MP-PCD4-40 \
         MP-TAF31-15 MP-TAFD51-50 NBFD10 NBFD3 TAFD30",
    ),
    ("hoya", "V_d is off by up to 0.006, which no rounding explains", "FCD10A FCD515 FF5"),
    ("hoya", "the fit misses n_d by half a unit of the last digit", "FDS18-W FDS18"),
    ("schott", "V_d is that of indices that were rounded before", "SF6G05"),
    (
        "sumita",
        "formulas are fits to printed indices, good to 4e-5 in n_d and 0.23 in V_d",
        "K-BPG2 K-BaF8 K-BaFn1 K-BaSF4 K-BaSF5 K-CD45(M) K-CSK120(M) K-CSK120 K-CaFK95(M) K-CaFK95 K-FIR97UV \
         K-GFK68 K-GFK70(M) K-GFK70 K-LaF2 K-LaFK50(M) K-LaFK50T(M) K-LaFK55 K-LaFK58 K-LaFK60(M) K-LaFn11 \
         K-LaFn3 K-LaK14 K-LaKn11 K-LaKn2 K-LaKn4 K-LaKn5 K-LaKn7 K-LaSFn1 K-LaSFn10 K-LaSFn14 K-LaSFn17 \
         K-LaSFn2 K-LaSFn21 K-LaSFn4 K-LaSFn6 K-LaSFn7 K-PBK40(M) K-PBK50(M) K-PBK50 K-PFK80(M) K-PFK80 \
         K-PFK85(M) K-PG325(M) K-PG375(M) K-PG375 K-PMK30(M) K-PMK30 K-PSFn1(M) K-PSFn1 K-PSFn2(M) K-PSFn2 \
         K-PSFn214(M) K-PSFn3(M) K-PSFn3 K-PSK100 K-PSK11 K-PSK400(M) K-SFLD11 K-SFLD6 K-SK15 K-SK5 K-SKLD120 \
         K-SSK1 K-SSK4 K-VC179(M) K-VC181(M) K-VC89(M) K-VC89 K-VC90(M) K-VC91 K-ZnSF8(M)",
    ),
    (
        "polymers",
        "Zeon's formulas are fits to printed indices, good to 3e-5 in n_d and 0.13 in V_d",
        "E48R 480R 330R",
    ),
];

/// Whether a glass is in [`OFF_PRINT`].
fn is_known_off(file: &str, name: &str) -> bool {
    OFF_PRINT.iter().any(|(known, _, names)| *known == file && names.split_whitespace().any(|n| n == name))
}

#[test]
fn the_index_at_f_d_and_c_gives_the_printed_nd_and_vd_to_the_last_digit() {
    let (mut agreed, mut off) = (0, 0);
    for (file, catalog) in files() {
        for glass in catalog.glasses() {
            let (Some(nd), Some(vd)) = (glass.printed_nd, glass.printed_vd) else { continue };
            let agrees = nd.agrees(glass.nd()) && vd.agrees(glass.abbe_vd());
            // A listed glass must disagree, any other must agree.
            assert_eq!(
                agrees,
                !is_known_off(&file, &glass.name),
                "{file}: {}: n_d {:.7} ({nd}), V_d {:.6} ({vd})",
                glass.name,
                glass.nd(),
                glass.abbe_vd()
            );
            agreed += usize::from(agrees);
            off += usize::from(!agrees);
        }
    }
    let excused: usize = OFF_PRINT.iter().map(|(.., names)| names.split_whitespace().count()).sum();
    assert_eq!(off, excused);
    println!("{agreed} glasses agree to the last printed digit, {off} do not");
    assert!(agreed >= 900, "only {agreed} glasses");
}

#[test]
fn listed_exceptions_differ_by_no_more_than_rounding_or_a_fit() {
    for (file, catalog) in files() {
        for glass in catalog.glasses().filter(|glass| is_known_off(&file, &glass.name)) {
            // A wrong coefficient would cause a larger difference.
            let (nd, vd) = (glass.printed_nd.unwrap(), glass.printed_vd.unwrap());
            assert!((glass.nd() - nd.value).abs() < 4.3e-5, "{}", glass.name);
            assert!((glass.abbe_vd() / vd.value - 1.0).abs() < 4e-3, "{}", glass.name);
        }
    }
}

#[test]
fn writing_and_reading_catalogues_keeps_every_bit() {
    for (file, catalog) in files() {
        let glasses: Vec<&Glass> = catalog.glasses().map(AsRef::as_ref).collect();
        let again = petzval_files::parse_catalog(&write_catalog(glasses.iter().copied())).unwrap();
        let again: Vec<&Glass> = again.glasses().map(AsRef::as_ref).collect();
        assert_eq!(again, glasses, "{file}");
    }
}

#[test]
fn every_glass_of_a_maker_covers_the_visible_and_most_have_thermal_data() {
    let makers = ["cdgm", "hikari", "hoya", "ohara", "schott", "sumita"];
    for (file, catalog) in files().into_iter().filter(|(file, _)| makers.contains(&file.as_str())) {
        let (mut all, mut thermal) = (0, 0);
        for glass in catalog.glasses() {
            let range = glass.range_um.unwrap_or_else(|| panic!("{} has no range", glass.name));
            let holds = [LINE_F_UM, LINE_D_UM, LINE_C_UM].iter().all(|line| !glass.is_outside_range(*line));
            assert!(holds, "{}: {range:?} um", glass.name);
            assert_eq!(glass.maker.to_lowercase(), file);
            (all, thermal) = (all + 1, thermal + usize::from(glass.thermal.is_some()));
            if let Some(n) = glass.index_at(0.55, 60.0, 1.0) {
                assert!((n - glass.index(0.55)).abs() < 2e-3, "{}: {n}", glass.name);
            }
        }
        assert!(thermal * 2 > all, "{file}: {thermal} of {all}");
    }
}

#[test]
fn transmission_and_dispersion_match_data_sheets() {
    // Schott's data sheet of N-BK7: internal transmittance of 10 mm.
    let bk7 = glass("schott", "N-BK7");
    for (um, printed) in
        [(0.31, 0.574), (0.334, 0.905), (0.35, 0.967), (0.365, 0.988), (0.4, 0.997), (1.97, 0.933)]
    {
        let found = bk7.internal_transmission(um, 10.0).unwrap();
        assert!((found - printed).abs() < 6e-4, "{um}: {found}, not {printed}");
    }
    assert_eq!(bk7.internal_transmission(3.0, 10.0), None);
    // P_gF of crown and flint.
    for (name, printed) in [("N-BK7", 0.5349), ("F2", 0.5828), ("N-SF6", 0.6158), ("N-SF11", 0.6156)] {
        let found = glass("schott", name).partial_dispersion_gf();
        assert!((found - printed).abs() < 5.1e-5, "{name}: {found}, not {printed}");
    }
}
