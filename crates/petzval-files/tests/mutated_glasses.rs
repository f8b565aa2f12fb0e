//! Damaged glass files: no reader panics or hangs, and the result is not larger than the file explains.
//!
//! Every run reads 20 000 damaged texts with each reader; `PETZVAL_MUTATIONS=1000000` makes it a million.

use std::time::{Duration, Instant};

use petzval_files::{GlassFile, decode, parse_agf, parse_rii, write_catalog};
use petzval_optics::glass::{Absorption, Dispersion, Glass};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Time limit for reading one text. The texts are a few kilobytes and take far less.
const LONGEST: Duration = Duration::from_secs(2);

const AGF: &str = "CC a catalogue
! a remark
NM F2 2 620364.360 1.62004 36.37 0 1 -1
GC lead containing glass type
ED 8.200000 9.200000 3.599000 0.000200 0
CD 1.345333590E+00 9.977438710E-03 2.090731760E-01 4.704507670E-02 9.373571620E-01 1.118867640E+02 0 0
TD 1.510000E-06 1.560000E-08 -2.780000E-11 9.340000E-07 1.040000E-09 2.500000E-01 2.000000E+01
OD 1.2419 1.0000 0.0000 1.0000 2.3000 1.3000
LD 3.20000E-01 2.50000E+00
IT 3.20000E-01 0.00000E+00 2.50000E+01
IT 3.34000E-01 2.11000E-01 2.50000E+01
IT 3.50000E-01 7.80000E-01 2.50000E+01
NM X13 13 0 1.516800 64.13 0 0
CD 2.2711 -9.38988354E-003 -1.00277081E-004 1.09572221E-002 1.20210067E-004 3.31079774E-006 -1.48235581E-008 0 0
LD 0.365 2.058
NM H 3 0 0 0 0 2
CD 3.41983 0.159906 -0.123109 1.26878E-6 -1.95104E-9
NM S4 4 0 1.512 23.9 0 3
CD 0.5 0.7 0.1 0.02 0.2
NM C 5 0 1.603 42.5 0 4
CD 1.57410327 1.39786149E-2 8.300451E-4
NM A 12 0 0 0 0 0
CD 2 -0.01 0.02 0 0 0 -0.01 -0.02
";

const PAGE: &str = "# a page
REFERENCES: |
    <a href=\"https://refractiveindex.info\">Malitson</a> <i>J. Opt. Soc. Am.</i> \u{b5}m
COMMENTS: |
    Fused silica, 20 \u{b0}C
DATA:
  - type: formula 2
    wavelength_range: 0.3 2.5
    coefficients: 0 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653
  - type: tabulated nk
    data: |
        0.300 1.5 2.8607E-06
        0.310 1.4 1.3679E-06
        0.320 1.3 6.6608E-07
CONDITIONS:
    temperature: 293
PROPERTIES:
    thermal_dispersion:
      - type: formula A
        coefficients: 1.86e-06 1.31e-08 -1.37e-11 4.34e-07 6.27e-10 0.17
    nd: 1.5168
    Vd: 64.17
    density:
      - value: 2510
    thermal_expansion:
      - temperature_range: 243 343
        value: 7.1e-06
    resistance: {climatic: 1.0, acid: [1, 2.0], stain: \"0\"}
";

const TOML: &str = "[glass.N-BK7]
aliases = [\"BK7\"]
maker = \"Schott\"
status = \"standard\"
nd = 1.5168
vd = 64.17
sellmeier = { b = [1.03961212, 0.231792344, 1.01046945], c_um2 = [0.00600069867, 0.0200179144, 103.560653] }
range_um = [0.3, 2.5]
transmission = { thickness_mm = 25, wavelength_um = [0.4, 0.5], transmittance = [0.992, 0.994] }
thermal = { d = [1.86e-6, 1.31e-8, -1.37e-11], e = [4.34e-7, 6.27e-10], lambda_tk_um = 0.17, reference_c = 20 }
expansion = [{ range_c = [-30, 70], per_k = 7.1e-6 }]
density_g_cm3 = 2.51

[glass.\"a b\"]
square = { powers = [[2.27, 0], [-0.009, 2]], resonances = [[0.01, 0, 0.1, 2]] }
extinction = { wavelength_um = [0.3, 0.31], k = [2.8607e-06, 1.3679e-06] }
[glass.melt]
nd = 1.5
vd = 60.0
[glass.T]
table = { wavelength_um = [0.4, 0.5], index = [1.5, 1.4] }
";

/// Number of damaged texts for each reader.
fn count() -> u64 {
    const USUAL: u64 = 20_000;
    match std::env::var("PETZVAL_MUTATIONS") {
        Ok(text) => text.parse().expect("PETZVAL_MUTATIONS is a number"),
        Err(_) => USUAL,
    }
}

/// Words that are likely to cause errors in readers.
const WORDS: [&str; 40] = [
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "0",
    "-0.0",
    "9223372036854775808",
    "1_0",
    "+.5",
    "1.",
    "NM",
    "CD",
    "IT",
    "TD",
    "LD",
    "AIR",
    "DATA:",
    "- ",
    "&a",
    "*a",
    "? ",
    "|",
    ">",
    "---\n",
    "...\n",
    "{",
    "[",
    "\"\"\"",
    "'''",
    "\t",
    "\r",
    "\0",
    "\u{feff}",
    "\u{85}",
    "\u{2028}",
    "é",
    "formula 4",
];

/// A text with one to six damages.
fn damaged(text: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = text.to_vec();
    for _ in 0..random.random_range(1..=6) {
        if bytes.is_empty() {
            break;
        }
        let (at, other) = (random.random_range(0..bytes.len()), random.random_range(0..bytes.len()));
        let span = at.min(other)..at.max(other);
        match random.random_range(0..10) {
            0 => bytes[at] = random.random(),
            1 => bytes[at] ^= 1 << random.random_range(0..8),
            2 => drop(bytes.drain(span.start..(span.start + random.random_range(1..40)).min(bytes.len()))),
            3 => bytes.truncate(at),
            // Copy a piece to another place.
            4 => {
                let piece = bytes[span.start..span.end.min(span.start + 400)].to_vec();
                drop(bytes.splice(other..other, piece));
            }
            // Repeat a piece many times: long lines, deep nesting, thousands of rows.
            5 => {
                let piece = bytes[span.start..span.end.min(span.start + random.random_range(1..8))].to_vec();
                drop(bytes.splice(at..at, piece.repeat(random.random_range(1..300))));
            }
            6 | 7 => {
                let word = WORDS.choose(random).expect("there are words");
                drop(bytes.splice(at..at, word.bytes()));
            }
            // Replace a word.
            8 => {
                let is_gap = |b: &u8| b.is_ascii_whitespace() || b",[]{}=:".contains(b);
                let end = bytes[at..].iter().position(is_gap).map_or(bytes.len(), |n| at + n);
                let start = bytes[..at].iter().rposition(is_gap).map_or(0, |n| n + 1);
                let word = WORDS.choose(random).expect("there are words");
                drop(bytes.splice(start..end, word.bytes()));
            }
            // Swap two lines.
            _ => {
                let mut lines: Vec<&[u8]> = bytes.split(|b| *b == b'\n').collect();
                let (a, b) = (random.random_range(0..lines.len()), random.random_range(0..lines.len()));
                lines.swap(a, b);
                bytes = lines.join(&b'\n');
            }
        }
    }
    bytes
}

/// Count of the numbers and characters of a glass: a measure of its memory.
fn numbers(glass: &Glass) -> usize {
    let dispersion = match &glass.dispersion {
        Dispersion::Sellmeier { b, c_um2 } => b.len() + c_um2.len(),
        Dispersion::Square { powers, resonances } => 2 * powers.len() + 4 * resonances.len(),
        Dispersion::Powers(powers) => 2 * powers.len(),
        Dispersion::Gas { terms, .. } => 2 * terms.len(),
        Dispersion::Table { wavelength_um, index } => wavelength_um.len() + index.len(),
        _ => 0,
    };
    let absorption = match &glass.absorption {
        None => 0,
        Some(Absorption::Transmittance(rows)) => 3 * rows.len(),
        Some(Absorption::Extinction(rows)) => 2 * rows.len(),
    };
    dispersion
        + absorption
        + 3 * glass.expansion.len()
        + glass.name.len()
        + glass.source.len()
        + glass.maker.len()
}

/// Evaluates every property of a glass; none may panic.
fn use_it(glass: &Glass) {
    for um in [0.0, 0.3, 0.31, 0.5875618, 2.0, 1e300, f64::NAN] {
        let _ = (glass.index(um), glass.index_at(um, 40.0, 1.0), glass.internal_transmission(um, 10.0));
        let _ = (glass.is_outside_range(um), glass.partial_dispersion_gf(), glass.abbe_vd());
    }
}

/// Reads damaged texts. `read` returns the glasses and the number of messages.
fn survive(name: &str, sample: &str, read: impl Fn(&str) -> Option<(Vec<Glass>, usize)>) {
    let (mut random, mut longest, mut accepted) = (ChaCha8Rng::seed_from_u64(1840), Duration::ZERO, 0_u64);
    let mut sixteen = Vec::new();
    sixteen.extend(sample.encode_utf16().flat_map(u16::to_le_bytes));
    let start = Instant::now();
    for round in 0..count() {
        // Damage UTF-16 texts too, in which half a character is easily lost.
        let original = if round % 16 == 0 { &sixteen } else { sample.as_bytes() };
        let bytes = damaged(original, &mut random);
        let began = Instant::now();
        let text = decode(&bytes);
        if let Some((glasses, messages)) = read(&text) {
            accepted += 1;
            let held: usize = glasses.iter().map(numbers).sum();
            // Each number takes at least a digit and a space. A formula with too few numbers is filled with zeros.
            assert!(
                held <= 2 * text.len() + 64 * glasses.len(),
                "{name}: {held} numbers from {} bytes",
                text.len()
            );
            assert!(glasses.len() + messages <= text.len() + 1, "{name}: {} glasses", glasses.len());
            glasses.iter().for_each(use_it);
            // Writing and reading the glasses must give the same glasses.
            if random.random_range(0..8) == 0 {
                let written = write_catalog(&glasses);
                let again = petzval_files::parse_catalog(&written)
                    .unwrap_or_else(|error| panic!("{error}\n{written}"));
                for glass in glasses.iter().filter(|glass| !glass.name.eq_ignore_ascii_case("AIR")) {
                    let found = again.all(&glass.name).last().map(|g| g.as_ref());
                    assert_eq!(found, Some(glass), "{written}");
                }
            }
        }
        let took = began.elapsed();
        assert!(took < LONGEST, "{name}: {took:?} for {} bytes:\n{text}", text.len());
        longest = longest.max(took);
    }
    let (took, all) = (start.elapsed(), count());
    println!("{name}: {all} texts in {took:.1?}, {accepted} accepted, the longest took {longest:.1?}");
    // Some damaged texts must be accepted and some refused, or the test shows nothing.
    assert!(accepted > all / 100 && accepted < all - all / 100, "{name}: {accepted} of {all} accepted");
}

fn of_file(file: GlassFile) -> (Vec<Glass>, usize) {
    (file.glasses, file.warnings.len())
}

#[test]
fn agf_survives() {
    survive("AGF", AGF, |text| parse_agf(text, "Maker").ok().map(of_file));
}

#[test]
fn pages_of_refractiveindex_info_survive() {
    survive("page", PAGE, |text| parse_rii(text, "NAME", "Maker").ok().map(of_file));
}

#[test]
fn toml_survives() {
    survive("TOML", TOML, |text| {
        let catalog = petzval_files::parse_catalog(text).ok()?;
        Some((catalog.glasses().map(|glass| glass.as_ref().clone()).collect(), 0))
    });
}

#[test]
fn the_undamaged_samples_are_read() {
    let agf = parse_agf(AGF, "").unwrap();
    assert_eq!((agf.glasses.len(), agf.warnings.len()), (6, 0), "{:?}", agf.warnings);
    let page = parse_rii(PAGE, "X", "").unwrap();
    assert_eq!(page.warnings.len(), 1, "the second index: {:?}", page.warnings);
    assert_eq!(petzval_files::parse_catalog(TOML).unwrap().glasses().count(), 4);
}

#[test]
fn large_texts_take_no_longer_than_their_size_explains() {
    let timed = |what: &str, read: &dyn Fn()| {
        let start = Instant::now();
        read();
        let took = start.elapsed();
        assert!(took < 4 * LONGEST, "{what}: {took:?}");
    };
    let lines = |line: &str, count: usize| line.repeat(count);
    timed("rows", &|| drop(parse_agf(&(AGF.to_owned() + &lines("IT 0.5 0.9 10\n", 200_000)), "")));
    timed("unknown records", &|| drop(parse_agf(&(AGF.to_owned() + &lines("XX 1\n", 200_000)), "")));
    timed("glasses", &|| {
        let many: String = (0..50_000).map(|i| format!("NM G{i} 1 0 1.5 60\nCD 2 0 0 0 0 0\n")).collect();
        drop(parse_agf(&many, ""));
    });
    timed("one line", &|| drop(parse_agf(&lines("NM ", 500_000), "")));
    timed("deep", &|| drop(parse_rii(&lines("[", 500_000), "X", "")));
    timed("deep maps", &|| drop(parse_rii(&lines("{a: ", 200_000), "X", "")));
    timed("deep lists", &|| drop(parse_rii(&lines("- ", 200_000), "X", "")));
    timed("laughs", &|| {
        let laughs: String = (1..40).map(|i| format!("a{i}: &a{i} [*a{0}, *a{0}]\n", i - 1)).collect();
        drop(parse_rii(&("a0: &a0 ha\n".to_owned() + &laughs), "X", ""));
    });
    timed("table", &|| {
        let rows: String = (0..100_000).map(|i| format!("        {}.5 1.5\n", i)).collect();
        drop(parse_rii(&format!("DATA:\n  - type: tabulated n\n    data: |\n{rows}"), "X", ""));
    });
    timed("keys", &|| {
        let keys: String = (0..50_000).map(|i| format!("k{i}: 1\n")).collect();
        drop(parse_rii(&(PAGE.to_owned() + &keys), "X", ""));
    });
    timed("nested arrays", &|| {
        drop(petzval_files::parse_catalog(&format!("[glass.X]\npowers = {}", lines("[", 200_000))))
    });
    timed("tables", &|| {
        let many: String = (0..20_000).map(|i| format!("[glass.G{i}]\nnd = 1.5\nvd = 60.0\n")).collect();
        drop(petzval_files::parse_catalog(&many));
    });
}
