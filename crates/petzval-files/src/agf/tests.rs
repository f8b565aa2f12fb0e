//! Tests of the reader.

use petzval_optics::glass::{Expansion, Status};

use super::parse_agf;
use crate::glass_file::GlassWarning;

fn index(formula: usize, cd: &str, um: f64) -> f64 {
    let text = format!("NM X {formula} 0 1.5 60\nCD {cd}\nLD 5 9\n");
    parse_agf(&text, "").unwrap().glasses[0].index(um)
}

#[test]
fn every_formula_matches_the_published_one() {
    // By hand at 0.5 um: w^2 = 1/4, w^-2 = 4.
    let cases: [(usize, &str, f64); 13] = [
        (1, "2 -0.01 0.02 1e-3 -1e-4 1e-5", (2.0 - 0.0025 + 0.08 + 0.016 - 0.0064 + 0.00256_f64).sqrt()),
        (2, "1 0.01 0.2 0.02 1 100", (1.0 + 0.25 / 0.24 + 0.05 / 0.23 + 0.25 / -99.75_f64).sqrt()),
        (
            3,
            "1.5 0.01 0.001 -1e-3 2e-3 3e-3",
            1.5 + 0.01 / 0.222 + 0.001 / 0.222 / 0.222 - 2.5e-4 + 1.25e-4 + 3e-3 / 64.0,
        ),
        (4, "0.5 0.7 0.1 0.02 0.2", (1.5 + 0.7 * 0.25 / 0.24 + 0.02 / 0.21_f64).sqrt()),
        (5, "1.5 0.01 0.001", 1.5 + 0.02 + 0.001 * 2_f64.powf(3.5)),
        (
            6,
            "1 0.01 0.2 0.02 1 100 0.3 0.05",
            (1.0 + 0.25 / 0.24 + 0.05 / 0.23 - 0.25 / 99.75 + 0.075 / 0.2_f64).sqrt(),
        ),
        (7, "2.2 0.02 0.01 0.03", (2.2 + 0.02 / 0.24 - 0.0075_f64).sqrt()),
        (8, "1.2 1.1 0.01 0.03", (1.2 + 1.1 * 0.25 / 0.24 - 0.0075_f64).sqrt()),
        (9, "1.2 1.1 0.01 0.3 0.05", (1.2 + 1.1 * 0.25 / 0.24 + 0.075 / 0.2_f64).sqrt()),
        (10, "2 -0.01 0.02 0 0 0 1e-5 1e-6", (2.0 - 0.0025 + 0.08 + 0.01024 + 0.004096_f64).sqrt()),
        (11, "1 0.01 0 0 0 0 0 0 0.3 0.05", (1.0 + 0.25 / 0.24 + 0.075 / 0.2_f64).sqrt()),
        (12, "2 -0.01 0.02 0 0 0 -0.01 -0.02", (2.0 - 0.0025 + 0.08 - 0.01 / 16.0 - 0.02 / 64.0_f64).sqrt()),
        (
            13,
            "2 -0.01 -0.02 0.02 1e-3 1e-4 1e-5 1e-6 1e-7",
            (2.0 - 0.0025 - 0.00125 + 0.08 + 0.016 + 0.0064 + 0.00256 + 0.001024 + 0.0004096_f64).sqrt(),
        ),
    ];
    for (formula, cd, by_hand) in cases {
        let found = index(formula, cd, 0.5);
        assert!((found - by_hand).abs() < 1e-14, "formula {formula}: {found}, not {by_hand}");
    }
}

const GLASS: &str = "CC a catalogue\n! a comment\nNM F2 2 620364.360 1.62004 36.37 0 1\nGC lead glass\n\
    ED 8.2 9.2 3.599 0.0002 0\n\
    CD 1.34533359 0.00997743871 0.209073176 0.0470450767 0.937357162 111.886764\n\
    TD 1.51E-06 1.56E-08 -2.78E-11 9.34E-07 1.04E-09 0.25 20\nOD 1.2419 1 0 1 2.3 1.3\nLD 0.32 2.5\n\
    IT 0.334 0.211 25\nIT 0.32 0.0 25\nIT 0.35 0.78 25\n";

#[test]
fn every_record_is_read() {
    let file = parse_agf(GLASS, "Schott").unwrap();
    assert_eq!(file.warnings, []);
    let glass = &file.glasses[0];
    assert_eq!(
        (glass.name.as_str(), glass.maker.as_str(), glass.source.as_str()),
        ("F2", "Schott", "lead glass")
    );
    assert_eq!(glass.status, Some(Status::Preferred));
    assert!(
        glass.printed_nd.unwrap().agrees(glass.nd()) && glass.printed_vd.unwrap().agrees(glass.abbe_vd())
    );
    assert_eq!(glass.expansion[0], Expansion { range_c: [-30.0, 70.0], per_k: 8.2e-6 });
    assert_eq!((glass.density_g_cm3, glass.relative_cost), (Some(3.599), Some(1.2419)));
    assert_eq!(glass.range_um, Some([0.32, 2.5]));
    assert_eq!(glass.thermal.unwrap().lambda_tk_um, 0.25);
    assert!((glass.internal_transmission(0.35, 25.0).unwrap() - 0.78).abs() < 1e-12);
}

#[test]
fn lines_that_do_not_affect_an_index_give_warnings_with_their_line() {
    let text = format!("Reproduced by permission\n{GLASS}XY 1 2\nIT 0.36  25\nLD 2.5 0.3\n")
        .replace("OD 1.2419", "OD _");
    let file = parse_agf(&text, "").unwrap();
    let lines: Vec<_> = file.warnings.iter().map(|w| w.error.line.unwrap()).collect();
    assert_eq!(lines, [1, 14, 15, 16]);
    assert_eq!(file.glasses[0].range_um, Some([0.32, 2.5]));
    // An equal glass gives no warning; a different glass of that name does.
    let twice = GLASS.to_owned() + GLASS;
    assert_eq!(parse_agf(&twice, "").map(|f| (f.glasses.len(), f.warnings.len())), Ok((1, 0)));
    // An obsolete glass does not replace a current one.
    let obsolete = GLASS.to_owned() + &GLASS.replace("36.37 0 1", "36.37 0 2");
    let file = parse_agf(&obsolete, "").unwrap();
    assert_eq!((file.glasses[0].status, file.warnings.len()), (Some(Status::Preferred), 1));
    let other = GLASS.to_owned() + &GLASS.replace("9.37357162", "9.4").replace("36.37", "36.38");
    assert_eq!(parse_agf(&other, "").map(|f| (f.glasses.len(), f.warnings.len())), Ok((1, 1)));
}

/// A borosilicate crown by Schott's formula, as some catalogues break it over lines: after a number, with and without a blank line.
const WRAPPED: &str = "NM CROWN 1 2 1.516800\n 64.170000 0 1 0\nGC crown, melt of\n2019\nED 7.1 8.3\n2.51 -0.0009 0\n\
    CD 2.271929E+000 -1.010773E-002 1.059251E-002 \n2.081697E-004 -7.647254E-006\n\n 4.924099E-007\n\
    TD 1.86E-06 1.31E-08 -1.37E-11 4.34E-07\n6.27E-10 0.17 20\nLD 0.31\n2.3\nIT 0.4 0.99\n10\n";

#[test]
fn records_continue_over_lines_that_begin_with_a_number() {
    let file = parse_agf(WRAPPED, "").unwrap();
    assert_eq!(file.warnings, []);
    let glass = &file.glasses[0];
    // By hand at the d line: n^2 = a0 + a1 w^2 + a2 w^-2 + a3 w^-4 + a4 w^-6 + a5 w^-8.
    let w2: f64 = 0.5875618 * 0.5875618;
    let by_hand = 2.271929 - 0.01010773 * w2 + 0.01059251 / w2 + 2.081697e-4 / w2.powi(2)
        - 7.647254e-6 / w2.powi(3)
        + 4.924099e-7 / w2.powi(4);
    assert!(
        (glass.nd() - by_hand.sqrt()).abs() < 1e-14 && (glass.nd() - 1.5168).abs() < 2e-5,
        "{}",
        glass.nd()
    );
    assert_eq!((glass.status, glass.source.as_str()), (Some(Status::Preferred), "crown, melt of 2019"));
    assert_eq!((glass.density_g_cm3, glass.range_um), (Some(2.51), Some([0.31, 2.3])));
    assert_eq!(glass.thermal.unwrap().reference_c, 20.0);
    assert!((glass.internal_transmission(0.4, 10.0).unwrap() - 0.99).abs() < 1e-12);
    // The same records on one line each, and with the line ends of old Macintoshes.
    let joined = WRAPPED.replace("\n\n", "\n").lines().fold(String::new(), |all, line| {
        let goes_on = line.trim().starts_with(|c: char| c.is_ascii_digit() || c == '-');
        all + if goes_on { " " } else { "\n" } + line
    });
    assert_eq!(parse_agf(&joined, "").unwrap(), file);
    assert_eq!(parse_agf(&WRAPPED.replace('\n', "\r"), "").unwrap(), file);
    // A continuation with a word in it spoils the coefficients, and prose does not continue them.
    let error = parse_agf(&WRAPPED.replace("4.924099E-007", "4.924099E-007 x"), "").unwrap_err();
    assert!(error.message.contains("not coefficients of `CROWN`"), "{error}");
    assert_eq!(parse_agf(&WRAPPED.replace("TD", "words\nTD"), "").unwrap().warnings.len(), 1);
}

#[test]
fn a_formula_that_contradicts_its_printed_index_or_abbe_number_is_refused_with_both() {
    // n_d to 1e-4, and V_d as n_F - n_C to 1e-4: from 63.38 to 64.98 for this crown.
    let with = |nd: &str, vd: &str| {
        let text = WRAPPED.replace("1.516800\n 64.170000", &format!("{nd} {vd}"));
        parse_agf(&(text + GLASS), "").unwrap()
    };
    for (nd, vd) in [("1.51689", "64.17"), ("1.51671", "63.40"), ("1.5168", "64.95"), ("0", "0")] {
        assert_eq!(with(nd, vd).glasses.len(), 2, "{nd} {vd}");
    }
    // Two decimals round 1.5168 to 1.52, and no decimal 64.17 to 64.
    assert_eq!(with("1.52", "64").glasses.len(), 2);
    for (nd, vd, both) in [
        ("1.51695", "64.17", ["nd = 1.51681", "1.51695"]),
        ("1.51640", "64.17", ["nd = 1.51681", "1.51640"]),
        ("1.51680", "46.17", ["Vd = 64.1", "46.17"]),
        ("1.51680", "65.05", ["Vd = 64.1", "65.05"]),
        ("1.51680", "63.30", ["Vd = 64.1", "63.30"]),
    ] {
        let file = with(nd, vd);
        assert_eq!((file.glasses.len(), file.glasses[0].name.as_str()), (1, "F2"));
        let warning = &file.warnings[0].error;
        assert!(both.iter().all(|value| warning.message.contains(value)), "{warning}");
        assert!(warning.message.ends_with("is left out") && warning.line == Some(1), "{warning}");
        // A lens that names the glass gets the reason.
        let unknown = file.into_catalog().get("crown").unwrap_err();
        assert!(both.iter().all(|value| unknown.reason().contains(value)), "{unknown}");
    }
    // Without its last coefficients the formula contradicts what is printed.
    let cut = WRAPPED.replace("\n2.081697E-004 -7.647254E-006\n\n 4.924099E-007", "");
    let error = parse_agf(&cut, "").unwrap_err();
    assert!(error.message.contains("nd = 1.5162") && error.message.contains("1.5168"), "{error}");
    // Where the range of the formula ends before a line, the figures of that line are not compared.
    assert_eq!(parse_agf(&cut.replace("LD 0.31\n2.3", "LD 0.7 2.3"), "").unwrap().glasses.len(), 1);
}

#[test]
fn one_warning_of_each_kind_stands_for_all() {
    let prose = "words\n".repeat(2000);
    let text = format!(
        "{prose}{GLASS}IT 0.36 x 25\nIT 0.37 x 25\nLD 2.5 0.3\n{}",
        WRAPPED.replace("1.516800", "1.6")
    );
    let file = parse_agf(&text, "").unwrap();
    let kinds = GlassWarning::by_kind(&file.warnings);
    let said: Vec<(&str, usize)> = kinds.iter().map(|(first, more)| (first.kind.as_str(), *more)).collect();
    let expected = [
        ("the glass is left out", 0),
        ("no such record in AGF files: left out", 1999),
        ("IT: the numbers do not fit the record: left out", 1),
        ("LD: the numbers do not fit the record: left out", 0),
    ];
    assert_eq!(said, expected);
}

#[test]
fn an_unusable_glass_is_a_warning_among_others_and_an_error_alone() {
    for (from, to, line, says) in [
        ("F2 2 620364.360", "F2 14", Some(3), "there is no formula 14"),
        ("F2 2 620364.360 1.62004 36.37 0 1", "F2", Some(3), "needs a name and the number"),
        ("CD 1.34533359", "CD 1.345e3x", Some(6), "not coefficients of `F2`"),
        ("CD", "CC", Some(3), "`F2` has no coefficients"),
        ("NM F2", "CC F2", Some(6), "belong to no glass"),
        ("CD 1.34533359", "CD 1e999", Some(6), "not coefficients of `F2`"),
        (
            "CD 1.34533359 0.00997743871 0.209073176 0.0470450767 0.937357162",
            "CD 0 1 0 1 0",
            Some(6),
            "formula of `F2` has no term",
        ),
    ] {
        let bad = GLASS.replace(from, to);
        let error = parse_agf(&bad, "").unwrap_err();
        assert_eq!(error.line, line, "{error}");
        assert!(error.to_string().contains(says), "{error}");
        let file = parse_agf(&(bad + &GLASS.replace("NM F2", "NM F3")), "").unwrap();
        let names: Vec<_> = file.glasses.iter().map(|glass| glass.name.as_str()).collect();
        assert_eq!(names, ["F3"]);
        let warning = &file.warnings[0].error;
        assert_eq!(warning.line, line, "{warning}");
        assert!(warning.message.contains(says) && warning.message.ends_with("is left out"), "{warning}");
    }
    assert!(parse_agf("", "").is_err() && parse_agf("CC nothing", "").is_err());
}

#[test]
fn a_glass_that_is_refused_takes_the_place_of_an_earlier_one_of_its_name() {
    let good = |name: &str| format!("NM {name} 5 0 1.5 0\nCD 1.5 0.0 0.0\nLD 0.3 2\n");
    let bad = "NM A 5 0 1.5 0\nLD 0.3 2\n";
    let glass = |text: String| {
        let catalog = parse_agf(&text, "Maker").unwrap().into_catalog();
        catalog.get("A").map(|glass| glass.name.clone()).map_err(|unknown| unknown.refused.is_some())
    };
    let (a, b) = (good("A"), good("B"));
    assert_eq!(glass(format!("{b}{a}{bad}")), Err(true));
    assert_eq!(glass(format!("{b}{bad}{a}")), Ok("A".to_owned()));
    assert_eq!(glass(format!("{b}{a}{bad}{a}")), Ok("A".to_owned()));
    // An obsolete glass replaces none that is not.
    let obsolete = "NM A 5 0 1.5 0 0 2\nLD 0.3 2\n";
    assert_eq!(glass(format!("{b}{a}{obsolete}")), Ok("A".to_owned()));
    let alone = parse_agf(&format!("{a}{bad}"), "Maker").unwrap_err();
    assert!(alone.message.contains("no coefficients"), "{alone}");
}
