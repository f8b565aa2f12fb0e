//! Pages of refractiveindex.info: one material each, in YAML.
//!
//! `DATA` lists an index (`formula 1` to `9`, `tabulated n`, `tabulated nk`) and often an extinction coefficient
//! (`tabulated k`). `CONDITIONS` and `PROPERTIES` hold the other values. The formulas, with `c1, c2, ...` in the order of
//! `coefficients` and w in um:
//!
//! | number | formula |
//! |---|---|
//! | 1 Sellmeier | `n^2 = 1 + c1 + c2 w^2 / (w^2 - c3^2) + c4 w^2 / (w^2 - c5^2) + ...` |
//! | 2 Sellmeier-2 | `n^2 = 1 + c1 + c2 w^2 / (w^2 - c3) + c4 w^2 / (w^2 - c5) + ...` |
//! | 3 polynomial | `n^2 = c1 + c2 w^c3 + c4 w^c5 + ...` |
//! | 4 | `n^2 = c1 + c2 w^c3 / (w^2 - c4^c5) + c6 w^c7 / (w^2 - c8^c9) + c10 w^c11 + ...` |
//! | 5 Cauchy | `n = c1 + c2 w^c3 + c4 w^c5 + ...` |
//! | 6 gases | `n = 1 + c1 + c2 / (c3 - w^-2) + c4 / (c5 - w^-2) + ...` |
//! | 7 Herzberger | `n = c1 + c2 L + c3 L^2 + c4 w^2 + c5 w^4 + c6 w^6`, `L = 1 / (w^2 - 0.028)` |
//! | 8 retro | `(n^2 - 1) / (n^2 + 2) = c1 + c2 w^2 / (w^2 - c3) + c4 w^2` |
//! | 9 exotic | `n^2 = c1 + c2 / (w^2 - c3) + c4 (w - c5) / ((w - c5)^2 + c6)` |
//!
//! Indices of makers' glasses are relative to air, as printed. Indices from papers may be relative to vacuum, as for gases
//! and some crystals; no page states this in a machine-readable way, so they are read unchanged. `glass_status` is left out,
//! because it differs from the status in the makers' own files.

use crate::glass_file::{GlassFile, GlassWarning, shifted};
use crate::yaml::{self, Node};
use petzval_base::FileError;
use petzval_optics::glass::{Absorption, Dispersion, Expansion, Glass, Printed, Thermal};

/// Reads the one material of a page. Pages state neither its name nor its maker, so the caller gives them; `maker` may be
/// empty.
///
/// ```
/// # use petzval_files::parse_rii;
/// let page = "DATA:
///   - type: formula 1
///     wavelength_range: 0.21 6.7
///     coefficients: 0 0.6961663 0.0684043 0.4079426 0.1162414 0.8974794 9.896161
/// ";
/// let file = parse_rii(page, "SILICA", "")?;
/// assert!((file.glasses[0].nd() - 1.458464).abs() < 1e-6);
/// # Ok::<(), petzval_base::FileError>(())
/// ```
pub fn parse_rii(text: &str, name: &str, maker: &str) -> Result<GlassFile, FileError> {
    let page = yaml::parse(text)?;
    if name.to_uppercase() == "AIR" {
        return Err(yaml::error(1, "", name, "air is built in").hint("give the file another name"));
    }
    let data = page.get("DATA").ok_or_else(|| {
        yaml::error(1, "DATA", "", "the page has no data")
            .hint("a page of refractiveindex.info has a list `DATA:`")
    })?;
    // Take the first index and the first extinction of the page.
    let mut warnings = Vec::new();
    let mut glass: Option<Glass> = None;
    let mut extinction: Option<Vec<[f64; 2]>> = None;
    for entry in data.list() {
        let kind = word(entry, "type")?;
        let (index, k) = read_entry(entry, kind)?;
        let k = k.map(|k| without_gain(entry, k, &mut warnings));
        match index {
            Some((dispersion, range_um)) if glass.is_none() => {
                let mut new = Glass::new(name, dispersion);
                new.range_um = range_um;
                glass = Some(new);
            }
            Some(_) => warnings.push(entry.error("type", format!("`{kind}` is a second index: left out"))),
            None => {}
        }
        match k {
            Some(k) if k.is_empty() => {}
            Some(k) if extinction.is_none() => extinction = Some(k),
            Some(_) => {
                warnings.push(entry.error("type", format!("`{kind}` is a second extinction: left out")))
            }
            None => {}
        }
    }
    let Some(mut glass) = glass else {
        return Err(data.error("DATA", "the page has no refractive index").hint("look for a page with n"));
    };
    glass.maker = maker.to_owned();
    glass.source = "refractiveindex.info".to_owned();
    glass.absorption = extinction.map(Absorption::Extinction);
    if let Some(properties) = page.get("PROPERTIES") {
        read_properties(properties, reference_c(&page), &mut glass, &mut warnings)?;
    }
    if let Some(misprint) = glass.misprint() {
        return Err(data.error("DATA", misprint.to_string()));
    }
    let warnings = warnings.into_iter().map(GlassWarning::from).collect();
    Ok(GlassFile { glasses: vec![glass], refused: Vec::new(), warnings })
}

/// The temperature of the measurement, degrees Celsius; 20 if the page has none.
///
/// Pages round whole degrees Celsius to whole kelvin: 293 means 20 C, and 298 means 25 C.
fn reference_c(page: &Node) -> f64 {
    const USUAL_C: f64 = 20.0;
    let kelvin = page.get("CONDITIONS").and_then(|c| c.get("temperature")).and_then(Node::text);
    match kelvin.and_then(finite) {
        Some(kelvin) if kelvin.fract() == 0.0 => kelvin - 273.0,
        Some(kelvin) => kelvin - 273.15,
        None => USUAL_C,
    }
}

/// A formula, and the range of wavelengths in which it holds, um.
type Index = (Dispersion, Option<[f64; 2]>);

/// Rows `[wavelength um, extinction coefficient]`.
type Extinction = Vec<[f64; 2]>;

/// Index and extinction of one entry of `DATA`.
fn read_entry(entry: &Node, kind: &str) -> Result<(Option<Index>, Option<Extinction>), FileError> {
    let table = |rows: Vec<[f64; 2]>| {
        let range_um = rows.first().zip(rows.last()).map(|(first, last)| [first[0], last[0]]);
        let (wavelength_um, index) = rows.into_iter().map(|[um, n]| (um, n)).unzip();
        (Dispersion::Table { wavelength_um, index }, range_um)
    };
    match kind.split_whitespace().collect::<Vec<_>>()[..] {
        ["tabulated", "n"] => Ok((Some(table(rows(entry)?)), None)),
        ["tabulated", "k"] => Ok((None, Some(rows(entry)?))),
        ["tabulated", "nk"] => {
            let rows = rows::<3>(entry)?;
            let k = rows.iter().map(|[um, _, k]| [*um, *k]).collect();
            Ok((Some(table(rows.iter().map(|[um, n, _]| [*um, *n]).collect())), Some(k)))
        }
        ["formula", number] => {
            let a = entry.get("coefficients");
            let a = a.ok_or_else(|| entry.error("coefficients", "the formula has none"))?;
            let c = numbers_of(a).filter(|c| !c.is_empty());
            let c = c.ok_or_else(|| a.error("coefficients", "these are not numbers"))?;
            let dispersion = dispersion(number, &c).map_err(|message| a.error("coefficients", message))?;
            Ok((Some((dispersion, wavelength_range(entry)?)), None))
        }
        _ => Err(entry
            .error("type", format!("there is no `{kind}`"))
            .hint("it is one of formula 1 to formula 9, tabulated n, tabulated k, tabulated nk")),
    }
}

/// Removes rows with a negative extinction coefficient. Some tables have a few, from a transmittance misprinted above 1.
fn without_gain(entry: &Node, rows: Vec<[f64; 2]>, warnings: &mut Vec<FileError>) -> Vec<[f64; 2]> {
    let (kept, gain): (Vec<_>, Vec<_>) = rows.into_iter().partition(|[_, k]| *k >= 0.0);
    for [um, k] in gain {
        let message = format!("an extinction coefficient is at least 0, not {k} at {um} um: left out");
        warnings.push(entry.error("data", message));
    }
    kept
}

fn wavelength_range(entry: &Node) -> Result<Option<[f64; 2]>, FileError> {
    let Some(range) = entry.get("wavelength_range") else { return Ok(None) };
    match numbers_of(range).as_deref() {
        Some(&[min, max]) if min > 0.0 && max >= min => Ok(Some([min, max])),
        _ => Err(range.error("wavelength_range", "this is not a shortest and a longest wavelength in um")),
    }
}

/// The rows of a table, with ascending wavelengths.
fn rows<const N: usize>(entry: &Node) -> Result<Vec<[f64; N]>, FileError> {
    let data = entry.get("data").ok_or_else(|| entry.error("data", "the table has no rows"))?;
    let text = data.text().ok_or_else(|| data.error("data", "a table is lines of numbers"))?;
    let mut rows: Vec<[f64; N]> = Vec::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let numbers = line.split_whitespace().map(finite).collect::<Option<Vec<f64>>>();
        let row = numbers.and_then(|numbers| <[f64; N]>::try_from(numbers).ok()).filter(|row| row[0] > 0.0);
        // The line of a block is that of its text, not that of its key.
        let row =
            row.ok_or_else(|| yaml::error(data.line + i, "data", line, format!("this is not {N} numbers")))?;
        rows.push(row);
    }
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    // Keep one row per wavelength, because the slope between two would be infinite.
    rows.dedup_by(|later, earlier| later[0] == earlier[0]);
    if rows.is_empty() { Err(data.error("data", "the table has no rows")) } else { Ok(rows) }
}

/// What is wrong with the coefficients of a formula without a term.
const ALL_ZERO: &str = "all of them are 0";

/// The terms, or this error if there are none.
fn non_empty<T>(terms: Vec<T>, error: &str) -> Result<Vec<T>, String> {
    if terms.is_empty() { Err(error.to_owned()) } else { Ok(terms) }
}

/// A formula by its number. The error describes what is wrong with its coefficients.
fn dispersion(number: &str, c: &[f64]) -> Result<Dispersion, String> {
    let pairs = || c[1..].chunks(2);
    if matches!(number, "1" | "2" | "3" | "5" | "6") && c.len().is_multiple_of(2) {
        return Err(format!("formula {number} has an odd number of coefficients, not {}", c.len()));
    }
    let at_most = |most: usize| {
        if c.len() <= most {
            Ok(c.iter().copied().chain(std::iter::repeat(0.0)))
        } else {
            Err(format!("formula {number} has at most {most} coefficients, not {}", c.len()))
        }
    };
    fn filled<const N: usize>(mut from: impl Iterator<Item = f64>) -> [f64; N] {
        std::array::from_fn(|_| from.next().unwrap_or(0.0))
    }
    let one_and_offset = || [1.0, c[0]].into_iter().filter(|a| *a != 0.0).map(|a| [a, 0.0]).collect();
    let resonances = |r: f64| pairs().filter(|p| p[0] != 0.0).map(|p| [p[0], 2.0, p[1], r]).collect();
    let series = || {
        std::iter::once([c[0], 0.0]).chain(pairs().map(|p| [p[0], p[1]])).filter(|[a, _]| *a != 0.0).collect()
    };
    Ok(match number {
        "1" => Dispersion::Square { powers: one_and_offset(), resonances: resonances(2.0) },
        "2" if c[0] == 0.0 => {
            let terms: Vec<(f64, f64)> = pairs().filter(|p| p[0] != 0.0).map(|p| (p[0], p[1])).collect();
            let (b, c_um2) = non_empty(terms, "there is no term")?.into_iter().unzip();
            Dispersion::Sellmeier { b, c_um2 }
        }
        "2" => Dispersion::Square { powers: one_and_offset(), resonances: resonances(1.0) },
        "3" => match c {
            &[a0, a1, 2.0, a2, -2.0, a3, -4.0, a4, -6.0, a5, -8.0] => {
                Dispersion::Schott([a0, a1, a2, a3, a4, a5])
            }
            _ => Dispersion::Square { powers: non_empty(series(), ALL_ZERO)?, resonances: Vec::new() },
        },
        "4" => {
            const RESONANT: usize = 9;
            const MOST: usize = 17;
            if c.len() > MOST
                || !(c.len() - 1).is_multiple_of(4) && c.len() < RESONANT
                || c.len() > RESONANT && c.len().is_multiple_of(2)
            {
                return Err(format!(
                    "formula 4 has 1, 5 or 9 coefficients, or an odd number up to 17, not {}",
                    c.len()
                ));
            }
            let (resonant, powers) = c[1..].split_at(c.len().min(RESONANT) - 1);
            let powers = std::iter::once([c[0], 0.0]).chain(powers.chunks(2).map(|p| [p[0], p[1]]));
            let powers: Vec<[f64; 2]> = powers.filter(|[a, _]| *a != 0.0).collect();
            // Unused terms are filled with zeros; drop resonances of zero strength.
            let resonances = resonant.chunks(4).filter(|b| b[0] != 0.0).map(|b| [b[0], b[1], b[2], b[3]]);
            let resonances: Vec<[f64; 4]> = resonances.collect();
            if powers.is_empty() && resonances.is_empty() {
                return Err(ALL_ZERO.to_owned());
            }
            Dispersion::Square { powers, resonances }
        }
        "5" => Dispersion::Powers(non_empty(series(), ALL_ZERO)?),
        "6" => Dispersion::Gas { a: c[0], terms: pairs().map(|p| [p[0], p[1]]).collect() },
        "7" => Dispersion::Herzberger(filled(at_most(6)?)),
        "8" => Dispersion::LorentzLorenz(filled(at_most(4)?)),
        "9" => Dispersion::Exotic(filled(at_most(6)?)),
        _ => return Err(format!("there is no formula {number}")),
    })
}

fn read_properties(
    properties: &Node,
    reference_c: f64,
    glass: &mut Glass,
    warnings: &mut Vec<FileError>,
) -> Result<(), FileError> {
    let mut printed = |key: &str, least: f64| {
        let node = properties.get(key)?;
        let number = node.text().and_then(Printed::parse).filter(|number| number.value > least);
        if number.is_none() {
            warnings.push(node.error(key, "this is not a possible value: left out"));
        }
        number
    };
    (glass.printed_nd, glass.printed_vd) = (printed("nd", 1.0), printed("Vd", 0.0));
    for entry in properties.get("thermal_dispersion").map_or(&[][..], Node::list) {
        let kind = word(entry, "type")?;
        match (kind, entry.get("coefficients").and_then(numbers_of).as_deref()) {
            ("formula A", Some(&[d0, d1, d2, e0, e1, lambda_tk_um])) => {
                glass.thermal = Some(Thermal { d: [d0, d1, d2], e: [e0, e1], lambda_tk_um, reference_c });
            }
            _ => warnings
                .push(entry.error("thermal_dispersion", "this is not a formula A of six numbers: left out")),
        }
    }
    let number = |entry: &Node, key: &str| entry.get(key).and_then(Node::text).and_then(finite);
    for entry in properties.get("density").map_or(&[][..], Node::list) {
        glass.density_g_cm3 =
            number(entry, "value").filter(|kg_m3| *kg_m3 > 0.0).map(|kg_m3| shifted(kg_m3, -3));
    }
    for entry in properties.get("thermal_expansion").map_or(&[][..], Node::list) {
        let range = entry.get("temperature_range").and_then(numbers_of);
        match (range.as_deref(), number(entry, "value")) {
            (Some(&[from, to]), Some(per_k)) => {
                glass.expansion.push(Expansion { range_c: [from - 273.0, to - 273.0], per_k });
            }
            _ => warnings.push(entry.error("thermal_expansion", "this has no range and value: left out")),
        }
    }
    Ok(())
}

fn word<'a>(entry: &'a Node, key: &str) -> Result<&'a str, FileError> {
    entry.get(key).and_then(Node::text).ok_or_else(|| entry.error(key, format!("there is no `{key}`")))
}

/// The numbers in the text of a node; `None` if a word of it is no finite number.
fn numbers_of(node: &Node) -> Option<Vec<f64>> {
    node.text()?.split_whitespace().map(finite).collect()
}

fn finite(word: &str) -> Option<f64> {
    word.parse().ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(formula: usize, c: &str, um: f64) -> f64 {
        let page = format!(
            "DATA:\n  - type: formula {formula}\n    wavelength_range: 0.2 3\n    coefficients: {c}\n"
        );
        parse_rii(&page, "X", "").unwrap().glasses[0].index(um)
    }

    #[test]
    fn every_formula_matches_the_published_one() {
        // By hand at 0.5 um: w^2 = 1/4, w^-2 = 4.
        let x: f64 = 0.2 + 0.1 * 0.25 / 0.24 + 0.005;
        let cases = [
            (1, "0.1 1 0.1 0.3 0.2", (1.1 + 0.25 / 0.24 + 0.3 * 0.25 / 0.21_f64).sqrt()),
            (2, "0 1 0.01 0.3 0.04", (1.0 + 0.25 / 0.24 + 0.3 * 0.25 / 0.21_f64).sqrt()),
            (2, "0.1 1 0.01 0.3 0.04", (1.1 + 0.25 / 0.24 + 0.3 * 0.25 / 0.21_f64).sqrt()),
            (
                3,
                "2 -0.01 2 0.02 -2 1e-3 -4 -1e-4 -6 1e-5 -8",
                (2.0 - 0.0025 + 0.08 + 0.016 - 0.0064 + 0.00256_f64).sqrt(),
            ),
            (3, "2 -0.02 4 0.02 -2", (2.0 - 0.00125 + 0.08_f64).sqrt()),
            (
                4,
                "2 0.5 2 0.1 2 0.02 0 0.04 1 -0.01 2 0.003 -4",
                (2.0 + 0.5 * 0.25 / 0.24 + 0.02 / 0.21 - 0.0025 + 0.048_f64).sqrt(),
            ),
            (4, "2 0.5 2 0.1 2 0 0 0 1", (2.0 + 0.5 * 0.25 / 0.24_f64).sqrt()),
            (5, "1.5 0.0097 -2 1.5e-4 -4", 1.5 + 0.0388 + 0.0024),
            (6, "0 0.05792105 238.0185 0.00167917 57.362", 1.0 + 0.05792105 / 234.0185 + 0.00167917 / 53.362),
            (7, "3.4 0.16 -0.12 1e-3 -2e-3", 3.4 + 0.16 / 0.222 - 0.12 / 0.222 / 0.222 + 2.5e-4 - 1.25e-4),
            (8, "0.2 0.1 0.01 0.02", ((1.0 + 2.0 * x) / (1.0 - x)).sqrt()),
            (9, "2 0.01 0.02 0.3 0.4 0.5", (2.0 + 0.01 / 0.23 + 0.03 / 0.51_f64).sqrt()),
        ];
        for (formula, c, by_hand) in cases {
            let found = index(formula, c, 0.5);
            assert!((found - by_hand).abs() < 1e-14, "formula {formula}: {found}, not {by_hand}");
        }
    }

    const PAGE: &str = "# a comment
REFERENCES: |
    <a href=\"x\">Schott</a>
DATA:
  - type: formula 2
    wavelength_range: 0.3 2.5
    coefficients: 0 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653
  - type: tabulated k
    data: |
        0.390 1.3731E-08
        0.400 1.0227E-08
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
";

    #[test]
    fn every_value_of_a_page_is_read() {
        let file = parse_rii(PAGE, "N-BK7", "Schott").unwrap();
        assert_eq!(file.warnings, []);
        let glass = &file.glasses[0];
        assert!(matches!(glass.dispersion, Dispersion::Sellmeier { .. }));
        assert!(
            glass.printed_nd.unwrap().agrees(glass.nd()) && glass.printed_vd.unwrap().agrees(glass.abbe_vd())
        );
        assert_eq!(glass.range_um, Some([0.3, 2.5]));
        assert_eq!((glass.density_g_cm3, glass.thermal.unwrap().reference_c), (Some(2.51), 20.0));
        assert_eq!(glass.expansion, [Expansion { range_c: [-30.0, 70.0], per_k: 7.1e-6 }]);
        assert!((glass.internal_transmission(0.4, 25.0).unwrap() - 0.992).abs() < 1e-6);
    }

    #[test]
    fn tables_are_sorted_and_their_ends_are_the_range() {
        let page = "DATA:\n  - type: tabulated nk\n    data: |\n        0.7 1.4 0.1\n        0.5 1.5 0.2\n";
        let glass = &parse_rii(page, "X", "").unwrap().glasses[0];
        assert_eq!((glass.range_um, glass.index(0.6)), (Some([0.5, 0.7]), 1.45));
        assert_eq!(glass.absorption, Some(Absorption::Extinction(vec![[0.5, 0.2], [0.7, 0.1]])));
    }

    #[test]
    fn a_row_of_negative_extinction_is_left_out() {
        let file = parse_rii(&PAGE.replace("1.0227E-08", "-1.0227E-08"), "X", "").unwrap();
        assert_eq!(file.glasses[0].absorption, Some(Absorption::Extinction(vec![[0.39, 1.3731e-8]])));
        let warning = &file.warnings[0].error;
        assert_eq!(warning.line, Some(8));
        assert!(warning.message.contains("at least 0"), "{warning}");
    }

    #[test]
    fn a_page_whose_formula_contradicts_its_printed_values_is_refused() {
        let error = parse_rii(&PAGE.replace("Vd: 64.17", "Vd: 46.17"), "X", "").unwrap_err();
        assert!(error.message.contains("gives Vd = 64.167") && error.message.contains("46.17"), "{error}");
    }

    #[test]
    fn errors_of_a_page_name_the_line() {
        for (from, to, line, says) in [
            ("formula 2", "formula 12", 7, "there is no formula 12"),
            ("formula 2", "recipe", 5, "there is no `recipe`"),
            ("0 1.03961212", "0 0 1.03961212", 7, "an odd number of coefficients"),
            ("0 1.03961212", "0 1.0396x", 7, "not numbers"),
            ("0.3 2.5", "2.5 0.3", 6, "not a shortest and a longest"),
            ("0.400 1.0227E-08", "0.400", 11, "not 2 numbers"),
            ("DATA:", "DAT:", 1, "no data"),
            ("  - type: formula 2", "  - &x y\n  - *x", 6, "alias"),
            ("REFERENCES: |", "REFERENCES: [", 4, "not YAML"),
        ] {
            let error = parse_rii(&PAGE.replace(from, to), "X", "").unwrap_err();
            assert!(error.to_string().contains(says), "{error}");
            assert_eq!(error.line, Some(line), "{error}");
        }
        let metal = "DATA:\n  - type: tabulated k\n    data: |\n        0.5 1.0\n";
        assert!(parse_rii(metal, "X", "").unwrap_err().message.contains("no refractive index"));
        assert!(parse_rii(&"[".repeat(100_000), "X", "").is_err());
        assert!(parse_rii("", "X", "").is_err());
    }
}
