//! Errors and losses, with their line and the reason.

use petzval_base::FileError;
use petzval_files::{Effect, Import, parse_seq, parse_zmx, parse_zmx_start};

use crate::support::{SEQ, ZMX, catalog, changed, seq, zmx};

/// Errors name the line and the reason.
#[test]
fn records_that_cannot_be_traced_are_refused_with_their_line() {
    let refused = |error: Result<Import, FileError>, needles: &[&str]| {
        let said = error.expect_err("a refusal").to_string();
        for needle in needles {
            assert!(said.contains(needle), "{said:?} does not say {needle:?}");
        }
    };
    let standard = "  TYPE STANDARD\n  CURV 0.02 0 0 0 0 \"\"";
    for (from, to, needles) in [
        (standard, "  TYPE GRINSUR1", &["line 14: `TYPE GRINSUR1`", "not traced", "hint"][..]),
        (standard, "  TYPE QED_TYPE", &["line 14", "QED_TYPE"]),
        (standard, "  TYPE STANDARD\n  PARM 3 1", &["line 15: `PARM 3 1`", "no parameter 3"]),
        (standard, "  TYPE XASPHERE\n  XDAT 1 12\n  XDAT 2 1\n  XDAT 12 1e-30", &["line 14", "r^20"]),
        (standard, "  TYPE TOROIDAL\n  XDAT 1 3", &["line 15: `XDAT 1 3`", "extra terms"]),
        (standard, "  TYPE DGRATING\n  PARM 1 .1\n  PARM 2 0.5", &["line 16", "whole number"]),
        (standard, "  TYPE COORDBRK\n  PARM 3 95", &["line 14", "90 degrees"]),
        (
            "  GLAS N-BK7 0 0 1.5168 64.17",
            "  GLAS N-BK8",
            &["line 17", "no glass is called `N-BK8`", "N-BK7"],
        ),
        ("DISZ 4", "DISZ INFINITY", &["line 16: `DISZ INFINITY`", "only the object"]),
        ("DISZ 4", "DISZ -4", &["line 16: `DISZ -4`", "goes against the light", "it is at least 0"]),
        ("DISZ 4", "DISZ 0.1", &["line 16: `DISZ 0.1`", "edge thickness", "raise the thickness"]),
        ("DISZ 4", "DISZ four", &["line 16: `DISZ four`", "not a finite number"]),
        (
            "CLAP 0 6 0",
            "CLAP 0 60 0",
            &["line 19: `CLAP 0 60 0`", "ends 50.0000 mm", "lower the semi-diameter"],
        ),
        ("CLAP 0 6 0", "SCBD 1 0 0 0 0 10 0 0", &["line 19: `SCBD", "COORDBRK"]),
        ("MODE SEQ", "MODE NSC", &["line 2: `MODE NSC`", "sequential"]),
        ("UNIT MM", "UNIT FT", &["line 4", "no such lens unit"]),
        ("ENPD 10", "ENPD 10\nFNUM 4", &["line 6: `FNUM 4`", "line 5 already gives"]),
        ("ENPD 10\n", "", &["no aperture", "ENPD"]),
        ("FTYP 0 0", "FTYP 0 1", &["line 6", "telecentric", "near object"]),
        ("ENPD 10", "ENPD 10\nTELE 1", &["line 6: `TELE 1`", "telecentric", "near object"]),
        ("  STOP\n", "  STOP\n  IGNR 1\n", &["line 14: `IGNR 1`", "an ignored surface", "IGNR 0"]),
        ("  STOP\n", "  STOP\nIGNR 1\n", &["line 14: `IGNR 1`", "an ignored surface"]),
        ("FTYP 0 0", "FTYP 4 0", &["line 6", "type 4"]),
        ("YFLN 0 2", "YFLN 0 180", &["line 7", "180 degrees"]),
        ("0.5876 1", "587.6 1", &["line 8: `WAVM 1 587.6 1`", "not optical", "did you mean 0.5876?"]),
        (
            "2 1 0 0 0\nYFLN 0 2\nWAVM 1 0.5876 1",
            "2 3 0 0 0\nYFLN 0 2\nWAVM 1 0.4861 1\nWAVM 2 0.5876 1\nWAVM 3 656.3 1",
            &["line 10: `WAVM 3 656.3 1`", "656.3 um is not optical", "did you mean 0.6563?"],
        ),
        ("PWAV 1", "PWAV 3", &["line 9: `PWAV 3`", "no wavelength 3"]),
        ("  STOP\n", "", &["aperture stop"]),
        ("SURF 2", "SURF 4", &["line 20: `SURF 4`", "not the next"]),
        ("SURF 3\n", "SURF 3\n  CURV 0.01\n", &["line 25: `CURV 0.01`", "curved image"]),
        ("  DISZ INFINITY", "  DISZ 0", &["line 11: `DISZ 0`", "object"]),
        ("  DISZ INFINITY", "  DISZ INFINITY\n  CURV 0.1", &["line 12", "curved object"]),
        ("  DISZ INFINITY", "  TYPE COORDBRK\n  DISZ 90", &["line 11: `TYPE COORDBRK`", "object cannot be"]),
        (
            "  DISZ INFINITY",
            "  TYPE EVENASPH\n  PARM 2 1e-3\n  DISZ 90",
            &["line 11", "object that is not a plane"],
        ),
        (
            "SURF 3\n  TYPE STANDARD",
            "SURF 3\n  TYPE EVENASPH\n  PARM 2 1e-3",
            &["line 25", "image that is not a plane"],
        ),
        (
            "SURF 3\n",
            "SURF 3\n  CURV 0.01\n  DISZ 3\n",
            &["line 26: `DISZ 3`", "no plane and has a thickness", "is the file cut short?"],
        ),
        ("SURF 3\n", "SURF 3\n  STOP\n", &["line 25: `STOP`", "neither object nor image"]),
        ("SURF 2\n", "TOL TOFF 0\nSURF 2\n", &["line 21: `SURF 2`", "after merit function"]),
        ("SURF 2\n", "surf 2\n", &["line 20: `surf 2`", "capitals"]),
        ("  CURV 0.02", "  curv 0.02", &["line 15: `curv 0.02", "capitals"]),
        ("GLAS N-BK7 0", "GLAS N-BK7 4", &["line 17", "offsets"]),
        ("GLAS N-BK7 0", "GLAS N-BK7 9", &["line 17", "state 9"]),
        ("UNIT MM", "UNIT MM\nUNIT IN", &["line 5: `UNIT IN ", "line 4 already gives"]),
        ("YFLN 0 2", "YFLN 0 2\nYFLD 0 9", &["line 8: `YFLD 0 9`", "line 7 already gives"]),
        ("PWAV 1", "WAVM 1 0.6 1\nPWAV 1", &["line 9: `WAVM 1 0.6 1`", "already"]),
        ("  DISZ 4", "  DISZ 4\n  DISZ 5", &["line 17: `DISZ 5`", "already"]),
        ("  DISZ 4", "  DISZ 4\n  CURV 0.03", &["line 17: `CURV 0.03`", "already"]),
        ("  DISZ 4", "  DISZ 4\n  PARM 1 0\n  PARM 1 0", &["line 18: `PARM 1 0`", "line 17 already gives"]),
        (
            "ENPD 10",
            "ENPD 1e300",
            &["line 5: `ENPD 1e300`", "1e300 mm at the first vertex; 1e-6 to 1000000 mm", "lens unit"],
        ),
        ("ENPD 10", "ENPD -20.0", &["line 5: `ENPD -20.0`", "entrance pupil must be positive", "the sign"]),
        ("ENPD 10", "ENPD 0", &["line 5: `ENPD 0`", "entrance pupil must be positive", "has no light"]),
        ("ENPD 10", "FNUM -4 0", &["line 5: `FNUM -4 0`", "the f-number must be positive, not -4"]),
        ("ENPD 10", "OBNA 1.5 0", &["line 5: `OBNA 1.5 0`", "at the object is below 1, not 1.5"]),
        ("ENPD 10", "OBNA 90 1", &["line 5: `OBNA 90 1`", "is below 90 degrees", "half of the cone"]),
        ("ENPD 10", "ENPD 1e-300", &["line 5", "1e-300 mm"]),
    ] {
        refused(parse_zmx(&changed(ZMX, from, to), &catalog()), needles);
    }
    let (cut_short, _) = ZMX.split_once("SURF 2").unwrap();
    let needles = &["line 17: `GLAS N-BK7", "the last surface has a glass", "is the file cut short?"];
    refused(parse_zmx(cut_short, &catalog()), needles);
    let round = "FTYP 0 0 2 1 0 0 0\nYFLN 0 2";
    let text = changed(
        &changed(ZMX, round, "XFLN 1\nYFLN 0"),
        standard,
        "  TYPE BICONICX\n  PARM 1 30\n  CURV 0.02",
    );
    refused(parse_zmx(&text, &catalog()), &["line 6: `XFLN 1`", "off the y-z plane", "an x of 0"]);
    // What the hint says is a lens.
    assert_eq!(zmx(&changed(&text, "XFLN 1\nYFLN 0", "XFLN 0\nYFLN 2")).file.lens.fields_deg, [2.0]);
    let shifted = changed(&changed(SEQ, "YAN 0 2", "XAN 0 1\nYAN 0 2"), "  STO\n", "  STO\n  XDE 1\n");
    refused(
        parse_seq(&shifted, &catalog()),
        &["line 6: `XAN 0 1`", "the field (1, 2) lies off", "an x of 0"],
    );
    assert_eq!(seq(&changed(&shifted, "XAN 0 1", "XAN 0 0")).file.lens.fields_deg, [0.0, 2.0]);
    // A shift by nothing leaves the lens as it is.
    let round = seq(&changed(&shifted, "XDE 1", "XDE 0; YDE 0; ADE 0"));
    assert_eq!(round.file.lens.fields_deg.len(), 2);
    for (from, to, needles) in [
        ("  STO\n", "  STO\n  SPS QCN\n", &["line 10: `SPS QCN`", "not read"][..]),
        ("  STO\n", "  STO\n  J 1e-30\n", &["r^20"]),
        ("  STO\n", "  STO\n  DIF DOE\n", &["line 10: `DIF DOE`", "orders"]),
        ("  STO\n", "  STO\n  XTO\n", &["line 10: `XTO`"]),
        ("  STO\n", "  STO\n  AAS; AP 0.1\n", &["line 10: `AP 0.1`"]),
        ("  STO\n", "  STO\n  ADE 90\n", &["line 10: `ADE 90`", "90 degrees"]),
        ("  STO\n", "  STO\n  BEN; ADE 10\n", &["line 10: `BEN`", "only a mirror"]),
        ("  STO\n", "  STO\n  RET S1\n", &["line 10: `RET S1`"]),
        ("  STO\n", "  STO\n  K S9 1\n", &["line 10: `K S9 1`", "no surface S9"]),
        ("  STO\n", "  STO\n  K x\n", &["line 10: `K x`", "number is missing"]),
        ("  STO\n", "  STO\n  ADE 10 20\n", &["line 10: `ADE 10 20`", "one value is read, but there are 2"]),
        ("  STO\n", "  STO\n  THI S1 4 5\n", &["line 10: `THI S1 4 5`", "one value"]),
        ("  STO\n", "  STO\n  THI INF\n", &["line 10: `THI INF`", "only the object"]),
        ("  STO\n", "  STO\n  CUY SA 0.01\n", &["line 10", "no surface SA"]),
        ("  STO\n", "  STO\n  K S1..2 1\n", &["line 10", "no surface S1..2"]),
        ("  CIR 6\n", "  CIR 6 7\n", &["line 10: `CIR 6 7`", "one number"]),
        ("  STO\n", "  STO\n  HWL 632.8\n", &["line 10: `HWL 632.8`", "holograms"]),
        ("GO\n", "SCA S1..3 2\n", &["line 13: `SCA S1..3 2`", "change the lens"]),
        ("GO\n", "DEL S1\n", &["line 13: `DEL S1`", "change the lens"]),
        ("EPD 10", "EPD 10; RED 0.5", &["line 3: `RED 0.5`", "magnification"]),
        ("EPD 10", "EPD 10 20", &["line 3: `EPD 10 20`", "one value"]),
        ("EPD 10", "EPD 1e300", &["line 3: `EPD 1e300`", "1e300 mm at the first vertex; 1e-6 to 1000000 mm"]),
        ("YAN 0 2", "YOB 0 2", &["line 6: `YOB 0 2`", "object at a finite distance", "angles"]),
        ("SO 0.0 0.1e14\n", "SO 0.0 100\n ASP; A 1e-3\n", &["line 8: `ASP`", "object that is not a plane"]),
        ("SO 0.0 0.1e14\n", "SO 0.0 100\n ADE 5\n", &["line 8: `ADE 5`", "turned object"]),
        (
            "SI 0 0\n",
            "SI 0 0\n SPS ODD 0; SCO AR3 1e-3\n",
            &["line 13: `SPS ODD 0`", "image that is not a plane"],
        ),
        ("NBK7_SCHOTT", "1.5:inf", &["line 8", "nd = 1.5 and Vd = inf"]),
        ("NBK7_SCHOTT", "NBK8_SCHOTT", &["line 8", "no glass of SCHOTT is called `NBK8`", "N-BK7"]),
        ("NBK7_SCHOTT", "NBK7_OHARA", &["line 8", "no glass of OHARA"]),
        ("NBK7_SCHOTT", "1.5168 64.17", &["line 8", "64.17"]),
        ("EPD 10\n", "", &["no aperture"]),
        ("EPD 10", "EPD 10; FNO 4", &["line 3: `FNO 4`", "already"]),
        ("YAN 0 2", "YAN 0 2; YOB 1", &["line 6: `YOB 1`", "another kind"]),
        ("DIM M", "DIM F", &["line 4: `DIM F`"]),
        (
            "WL 587.6",
            "WL 0.5876",
            &["line 5: `WL 0.5876`", "0.5876 nm is not optical (200 to 20000 nm)", "did you mean 587.6?"],
        ),
        ("S 50 4", "S 50 -4", &["line 8: `S 50 -4 NBK7", "goes against the light", "it is at least 0"]),
        ("  STO\n", "  STO\n  THI -4\n", &["line 10: `THI -4`", "goes against the light"]),
        ("  CIR 6\n", "  CIR 60\n", &["line 10: `CIR 60`", "ends 50.0000 mm", "lower the semi-diameter"]),
        ("EPD 10", "EPD -20", &["line 3: `EPD -20`", "entrance pupil must be positive", "the sign"]),
        ("EPD 10", "NA 0", &["line 3: `NA 0`", "aperture at the image must be positive"]),
        ("EPD 10", "FNO 1e-300", &["line 3: `FNO 1e-300`", "is the number right? the focal length is 96."]),
        ("WL 587.6", "WL 587.6; REF 2", &["line 5: `REF 2`", "no wavelength 2"]),
        ("WL 587.6", "WL 587.6; TEL Y", &["line 5: `TEL Y`", "telecentric"]),
        ("WL 587.6", "WL 587.6; TEL 0", &["line 5: `TEL 0`", "TEL says yes or no", "TEL N"]),
        ("RDM", "RDM OFF", &["line 1: `RDM OFF`", "RDM says yes or no", "write RDM Y or RDM N"]),
        ("SI 0 0", "SI 50 0", &["line 12: `SI 50 0`", "curved image"]),
        ("SI 0 0\n", "", &["no object, surface and image", "cut short"]),
        ("SO 0.0 0.1e14\n", "", &["line 7: `S 50 4 NBK7_SCHOTT`", "SO"]),
    ] {
        refused(parse_seq(&changed(SEQ, from, to), &catalog()), needles);
    }
    // A stop without an edge is as large as the aperture makes it.
    let too_wide = changed(&changed(SEQ, "EPD 10", "EPD 120"), "  CIR 6\n", "");
    let needles = &["line 3: `EPD 120`", "surface 1: the shape ends 50.0000 mm", "narrow the beam"];
    refused(parse_seq(&too_wide, &catalog()), needles);
}

#[test]
fn lost_records_are_reported_with_line_and_effect() {
    let text = changed(ZMX, "  CLAP", "  COAT AR\n  NEWREC 1\n  PZUP 1 1 0\n  CLAP");
    let text = changed(&text, "ENPD 10", "ENPD 10\nENVD 35 1 1\nVCYN 0 0.1\nQQQQ 1");
    let import = zmx(&(text + "TOL TOFF 0\nMNUM 3 1\nEFFL 0 1\nTRCX 0 1\nZZZZZ\n"));
    let expected = [
        (6, "ENVD 35 1 1", Effect::Approximated),
        (7, "VCYN 0 0.1", Effect::Approximated),
        (8, "QQQQ 1", Effect::NotUnderstood),
        (22, "COAT AR", Effect::NoRay),
        (23, "NEWREC 1", Effect::NotUnderstood),
        (24, "PZUP 1 1 0", Effect::NoRay),
        (32, "TOL TOFF 0", Effect::NoRay),
        (33, "MNUM 3 1", Effect::NoRay),
        (34, "EFFL 0 1", Effect::NoRay),
        (36, "ZZZZZ", Effect::NotUnderstood),
    ];
    let found: Vec<_> =
        import.losses.iter().map(|l| (l.line.unwrap(), l.record.as_str(), l.effect)).collect();
    assert_eq!(found, expected);
    assert_eq!(import.losses[8].more, 1);
    let import = seq(&changed(SEQ, "  CIR 6", "  CIR 6; CCY 0\n  MLT AR\n  QQQ 1\n  ZOO THI S1 4 2"));
    let found: Vec<_> =
        import.losses.iter().map(|l| (l.line.unwrap(), l.record.as_str(), l.effect)).collect();
    let expected = [
        (10, "CCY 0", Effect::NoRay),
        (11, "MLT AR", Effect::NoRay),
        (12, "QQQ 1", Effect::NotUnderstood),
        (13, "ZOO THI S1 4 2", Effect::NoRay),
    ];
    assert_eq!(found, expected);
}

/// An afocal image space is named in every way that a file states it. A record that changes nothing is no loss.
#[test]
fn afocal_image_spaces_are_approximated_and_defaults_are_no_loss() {
    let of = |import: Import| -> Vec<_> {
        import.losses.into_iter().map(|loss| (loss.record, loss.effect, loss.message)).collect()
    };
    let of_zmx = |to: &str| of(zmx(&changed(ZMX, "ENPD 10", &format!("ENPD 10\n{to}"))));
    let of_seq = |to: &str| of(seq(&changed(SEQ, "  CIR 6", &format!("  CIR 6\n{to}"))));
    for (record, found) in [
        ("AFOC 1", of_zmx("AFOC 1")),
        ("FTYP 0 0 2 1 0 0 1", of(zmx(&changed(ZMX, "FTYP 0 0 2 1 0 0 0", "FTYP 0 0 2 1 0 0 1")))),
        ("AFI", of_seq("AFI")),
        ("AFI 0.5", of_seq("AFI 0.5")),
    ] {
        let [(text, effect, message)] = &found[..] else { panic!("{record}: {found:?}") };
        assert_eq!((text.as_str(), *effect), (record, Effect::Approximated));
        assert!(message.contains("afocal image space"), "{message}");
    }
    let still_there = of(zmx(&changed(ZMX, "  STOP\n", "  STOP\n  IGNR 0\n")));
    for found in [of_zmx("TELE 0\nAFOC 0"), still_there, of_seq("IC Yes; AFI N")] {
        assert!(found.is_empty(), "{found:?}");
    }
    // What it changes is not known.
    assert_eq!(of_seq("IC No")[0].1, Effect::NotUnderstood);
}

/// An unknown record between surfaces is reported, and every surface is kept.
#[test]
fn unknown_records_among_surfaces_end_nothing() {
    let import = zmx(&changed(ZMX, "SURF 2\n", "NEWREC 1 2\nQQQQ 3\nSURF 2\n"));
    assert_eq!(import.file.lens, zmx(ZMX).file.lens);
    let found: Vec<_> = import.losses.iter().map(|l| (l.line.unwrap(), l.effect)).collect();
    assert_eq!(found, [(20, Effect::NotUnderstood), (21, Effect::NotUnderstood)]);
}

/// A line that may be a surface with a typing slip: without it the lens is another one.
#[test]
fn a_command_that_may_be_a_surface_is_refused() {
    for line in ["S1.5 -5 1", "-5 1", "S-20 3 SF5"] {
        let error = parse_seq(&changed(SEQ, "SI 0 0", &format!("{line}\nSI 0 0")), &catalog()).unwrap_err();
        let said = error.to_string();
        assert!(said.contains("may be a surface") && said.contains("S RADIUS THICKNESS"), "{line}: {said}");
    }
}

#[test]
fn a_lens_that_cannot_be_built_is_read_as_a_start_alone() {
    for (from, to, why) in [
        ("DISZ 4", "DISZ -4", "goes against the light"),
        ("DISZ 4", "DISZ 0.1", "edge thickness of N-BK7 is -"),
    ] {
        assert_eq!(ZMX.matches(from).count(), 1);
        let text = ZMX.replace(from, to);
        let refused = parse_zmx(&text, &catalog()).unwrap_err();
        assert!(refused.message.contains(why), "{refused}");
        let start = parse_zmx_start(&text, &catalog()).unwrap();
        assert_eq!(start.unbuildable, Some(refused));
        assert_eq!(start.file.lens.surfaces.len(), 2);
    }
    assert_eq!(parse_zmx_start(ZMX, &catalog()).unwrap().unbuildable, None);
}
