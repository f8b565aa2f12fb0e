//! Reading any bytes as a lens file ends soon and without a panic, with a lens or with an error.
//!
//! Each reader reads 20 000 mutations of valid files; `PETZVAL_MUTATIONS=1000000` makes it a million.

#[path = "../../petzval-optics/tests/common/mod.rs"]
mod common;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use petzval_base::FileError;
use petzval_files::{
    Import, LensFile, decode, parse_lens, parse_optiland, parse_seq, parse_zmx, write_lens, write_seq,
    write_zmx,
};
use petzval_optics::glass::Catalog;
use petzval_optics::lens::validate;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Time limit for reading one file: far beyond what any takes, also on a busy machine, so that only a reader that hangs exceeds it.
const LONGEST: Duration = Duration::from_secs(30);

/// Limit of the peak memory of this test program, kB.
const MOST_MEMORY_KB: u64 = 1 << 20;

const CATALOG: &str = "
[glass.N-BK7]
nd = 1.5168
vd = 64.17
maker = \"Schott\"
[glass.PMMA]
maker = \"generic\"
schott = [2.1864582, -0.00024475348, 0.014155787, -0.00044329781, 7.7664259e-05, -2.9936382e-06]
[glass.N-SF11]
maker = \"Schott\"
sellmeier = { b = [1.73759695, 0.313747346, 1.89878101], c_um2 = [0.013188707, 0.0623068142, 155.23629] }
";

/// A singlet with an even asphere, in Optiland's format.
const OPTILAND: &str = r#"{
  "version": 1.0,
  "aperture": {"type": "EPD", "value": 10},
  "fields": {"fields": [{"x": 0.0, "y": 0}, {"x": 0.0, "y": 5}], "telecentric": false, "field_type": "angle"},
  "wavelengths": {"wavelengths": [{"value": 0.55, "is_primary": true, "unit": "um"}], "polarization": "ignore"},
  "pickups": [],
  "solves": {"solves": []},
  "surface_group": {"surfaces": [
    {"type": "ObjectSurface", "geometry": {"type": "Plane", "cs": {"z": -Infinity}, "radius": Infinity},
     "material_post": {"type": "IdealMaterial", "index": 1.0}},
    {"type": "Surface", "geometry": {"type": "EvenAsphere", "cs": {"x": 0.0, "z": 0.0, "rx": 0.0, "reference_cs": null},
       "radius": 40.0, "conic": -0.5, "coefficients": [0.0, 1e-6]},
     "material_post": {"type": "Material", "filename": "data-nk/glass/schott/N-SF11.yml", "name": "N-SF11"},
     "is_stop": true, "aperture": {"type": "RadialAperture", "r_max": 7.0, "r_min": 0}, "coating": null},
    {"type": "Surface", "geometry": {"type": "StandardGeometry", "cs": {"z": 4.0}, "radius": -80.0},
     "material_post": {"type": "IdealMaterial", "index": 1.0},
     "interaction_model": {"type": "RefractiveReflectiveModel", "is_reflective": false}},
    {"type": "Surface", "geometry": {"type": "Plane", "cs": {"z": 40.0}}, "material_post": {"type": "IdealMaterial", "index": 1.0}}
  ]}
}"#;

/// Words that mutations insert, so that many mutated files are still readable.
const WORDS: &[&str] = &[
    "0",
    "-0.0",
    "1e308",
    "-1e308",
    "1e-320",
    "inf",
    "NaN",
    "INFINITY",
    "90",
    "1000000",
    "-1",
    "3.7",
    "\"",
    "'",
    ";",
    "&",
    "!",
    "TYPE XPOLYNOM",
    "TYPE BINARY_2",
    "TYPE TOROIDAL",
    "TYPE COORDBRK",
    "TYPE PARAXIAL",
    "TYPE ODDASPHE",
    "XDAT 1 300",
    "XDAT 299 1",
    "PARM 300 1",
    "GLAS MIRROR",
    "STOP",
    "FLOA",
    "FNUM 1e-9 1",
    "FTYP 3 0 99 99",
    "YFLN 89.9 -89.9",
    "MODE NSC",
    "REFL",
    "BEN",
    "REV",
    "DAR",
    "ADE 89",
    "ZDE 1e9",
    "SPS XYP 1e-7",
    "SPS ODD 3",
    "SCO C200 1",
    "SCO AR31 1",
    "CYL",
    "YTO",
    "AAS",
    "PRV",
    "END",
    "PWL 500",
    "S 1 1 517642",
    "S S S",
    "K SI 1",
    "YRI 1e6",
    "FNO 1e-300",
    "NA 2",
    "RDM N",
    "PIM",
    "DIM I",
];

fn seeds() -> (Vec<String>, Vec<String>) {
    let catalog = petzval_files::parse_catalog(CATALOG).unwrap();
    let (mut zmx, mut seq) = (Vec::new(), Vec::new());
    for lens in common::special_lenses() {
        let file = LensFile {
            lens,
            expect: None,
            field_weights: Vec::new(),
            variables: vec![],
            pickups: vec![],
            efl_solve: None,
            magnification_solve: None,
            length_solve: None,
        };
        for (to, export) in [(&mut zmx, write_zmx(&file, &catalog)), (&mut seq, write_seq(&file, &catalog))] {
            let Ok(export) = export else { continue };
            // Half of them have no edges, so that semi-diameters are computed from beams.
            let without: String = export
                .text
                .lines()
                .filter(|line| !line.contains("FLAP") && !line.contains("CIR"))
                .map(|line| format!("{line}\n"))
                .collect();
            to.extend([export.text, without]);
        }
    }
    seq.push(
        "tit 'x'\ndim m\nso 0. 100\ns 0.1 1 nbk7_schott !\ns -.05 15\n pim\nsi 0 0\nfno 5\nwl 650 550 &\n 450\nyim 0 3\n".into(),
    );
    (zmx, seq)
}

/// A text with one to five mutations.
fn mutated(seeds: &[String], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut text = seeds[random.random_range(0..seeds.len())].clone().into_bytes();
    for _ in 0..random.random_range(1..6) {
        if text.is_empty() {
            break;
        }
        let at = random.random_range(0..text.len());
        let mut lines: Vec<Vec<u8>> = text.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
        let line = random.random_range(0..lines.len());
        let other = random.random_range(0..lines.len());
        match random.random_range(0..10) {
            0 => text[at] ^= 1 << random.random_range(0..8),
            1 => text[at] = random.next_u32() as u8,
            2 => {
                text.remove(at);
            }
            3 => text.truncate(at),
            4 => {
                lines.remove(line);
                text = lines.join(&b'\n');
            }
            5 => {
                let copy = lines[line].clone();
                let times = if random.random_range(0..20) == 0 { 700 } else { 1 };
                for _ in 0..times {
                    lines.insert(other, copy.clone());
                }
                text = lines.join(&b'\n');
            }
            6 => {
                lines.swap(line, other);
                text = lines.join(&b'\n');
            }
            // Replace a word of a line.
            7 | 8 => {
                let word = WORDS[random.random_range(0..WORDS.len())].as_bytes();
                let mut words: Vec<Vec<u8>> = lines[line].split(|b| *b == b' ').map(<[u8]>::to_vec).collect();
                let place = random.random_range(0..words.len());
                words[place] = word.to_vec();
                lines[line] = words.join(&b' ');
                text = lines.join(&b'\n');
            }
            _ => {
                let word = WORDS[random.random_range(0..WORDS.len())];
                lines.insert(line, format!("  {word}").into_bytes());
                text = lines.join(&b'\n');
            }
        }
    }
    text
}

fn survives(seeds: &[String], parse: fn(&str, &Catalog) -> Result<Import, FileError>, what: &str) {
    let mutations: u64 =
        std::env::var("PETZVAL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(20_000);
    let catalog = petzval_files::parse_catalog(CATALOG).unwrap();
    // Check that the seeds themselves can be read.
    for text in seeds {
        parse(text, &catalog).unwrap_or_else(|e| panic!("{e}\n{text}"));
    }
    let (longest, read) = (0..mutations)
        .into_par_iter()
        .map(|number| {
            let mut random = ChaCha8Rng::seed_from_u64(number);
            let bytes = mutated(seeds, &mut random);
            let start = Instant::now();
            let outcome = catch_unwind(AssertUnwindSafe(|| parse(&decode(&bytes), &catalog)));
            let took = start.elapsed();
            let text = || String::from_utf8_lossy(&bytes).into_owned();
            let outcome = outcome.unwrap_or_else(|_| panic!("{what} {number} panics:\n{}", text()));
            assert!(took < LONGEST, "{what} {number} takes {took:?}:\n{}", text());
            match outcome {
                Ok(import) => {
                    assert!(import.losses.len() <= 201 && import.file.lens.surfaces.len() <= 2000);
                    validate(&import.file.lens)
                        .unwrap_or_else(|e| panic!("{what} {number}: {e}\n{}", text()));
                    // An accepted lens can be written and read again.
                    let written = write_lens(&import.file);
                    let again = parse_lens(&written, &catalog)
                        .unwrap_or_else(|e| panic!("{what} {number}: {e}\n{written}\n{}", text()));
                    assert_eq!(again.lens.surfaces.len(), import.file.lens.surfaces.len(), "{what} {number}");
                    (took, 1_u64)
                }
                Err(error) => {
                    assert!(!error.message.is_empty());
                    (took, 0)
                }
            }
        })
        .reduce(|| (Duration::ZERO, 0), |a, b| (a.0.max(b.0), a.1 + b.1));
    // Some mutations must be accepted and some refused, or the test shows nothing.
    assert!(
        read > mutations / 50 && read < mutations - mutations / 50,
        "{what}: {read} of {mutations} are read"
    );
    println!(
        "{what}: {mutations} mutations, {read} read, longest {longest:?}, peak memory {:?} kB",
        peak_memory_kb()
    );
    if let Some(kb) = peak_memory_kb() {
        assert!(kb < MOST_MEMORY_KB, "{kb} kB");
    }
}

/// Peak memory of this process, kB (Linux only).
fn peak_memory_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse().ok())
}

#[test]
fn zmx_files() {
    survives(&seeds().0, parse_zmx, "zmx");
}

#[test]
fn seq_files() {
    survives(&seeds().1, parse_seq, "seq");
}

#[test]
fn optiland_files() {
    survives(&[OPTILAND.to_owned()], parse_optiland, "json");
}

#[test]
fn huge_files_are_refused() {
    let catalog = Catalog::default();
    let much = "SURF 0\n".repeat(3 << 20);
    for parse in [parse_zmx, parse_seq] {
        let start = Instant::now();
        assert!(parse(&much, &catalog).unwrap_err().to_string().contains("MB is not read"));
        // Files below the limit: long lines, many commands on a line, many unknown records.
        for text in
            ["a;".repeat(7 << 20), "x ".repeat(7 << 20), "&\n".repeat(7 << 20), "Q1\n".repeat(5 << 20)]
        {
            assert!(parse(&text, &catalog).is_err());
        }
        assert!(start.elapsed() < LONGEST, "{:?}", start.elapsed());
    }
}
