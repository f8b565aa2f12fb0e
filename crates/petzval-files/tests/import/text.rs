//! What files are written in: encodings, units, commands in short or in quotes, older records.

use petzval_files::{Effect, decode, parse_seq};
use petzval_optics::lens::{Action, ObjectDistance};
use petzval_optics::paraxial::first_order;

use crate::support::{SEQ, ZMX, catalog, changed, efl_mm, losses, seq, zmx};

#[test]
fn both_formats_read_the_same_singlet() {
    let (a, b) = (zmx(ZMX), seq(SEQ));
    assert!(a.losses.is_empty() && b.losses.is_empty(), "{:?} {:?}", a.losses, b.losses);
    let (a, b) = (a.file.lens, b.file.lens);
    assert_eq!(a, b);
    assert_eq!((a.stop, a.entrance_pupil_mm, a.object), (0, 10.0, ObjectDistance::Infinity));
    assert_eq!((&a.fields_deg[..], &a.wavelengths_um[..]), (&[0.0, 2.0][..], &[0.5876][..]));
    assert_eq!(a.surfaces[0].semi_diameter_mm, 6.0);
    // The other surface has no edge: it is slightly larger than the beams.
    let open = a.surfaces[1].semi_diameter_mm;
    assert!(open > 4.85 && open < 5.1, "{open}");
    assert!((efl_mm(&a) - 50.0 / (a.surfaces[0].glass.index(0.5876) - 1.0)).abs() < 1e-9);
}

#[test]
fn every_encoding_is_read() {
    let text = changed(ZMX, "NAME singlet", "NAME Gauß\r");
    let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
    let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let marked = [&[0xff, 0xfe], &utf16[..]].concat();
    for bytes in [text.as_bytes(), &latin, &utf16, &marked] {
        assert_eq!(zmx(&decode(bytes)).file.lens.name, "Gauß");
    }
}

/// Catalogue parts: an achromat of 100 mm, one of 1.5 mm, and a telescope of f/4 with a 20 mm pupil.
#[test]
fn focal_lengths_match_the_catalogue() {
    let achromat = |name: &str, epd: f64, surfaces: &str| {
        seq(&format!(
            "RDM;LEN\nTITLE '{name}'\nEPD {epd}\nDIM M\nWL 587.6\nYAN 0\nSO 0 1e14\n{surfaces}SI 0 0\n"
        ))
        .file
        .lens
    };
    let long = achromat(
        "100 mm",
        25.0,
        "S 61.47 6 NBK7_SCHOTT\n STO\nS -44.64 2.5 NSF5_SCHOTT\nS -129.94 95.95194415183156\n",
    );
    let order = first_order(&long.at_wavelength(long.reference_um));
    assert!((order.efl_mm - 100.0).abs() < 0.05, "{}", order.efl_mm);
    // The file's image distance is the paraxial one.
    assert!((order.bfl_mm - 95.95194415183156).abs() < 1e-4, "{}", order.bfl_mm);
    let short =
        achromat("1.5 mm", 0.9, "S .8 .5 NPSK53A_SCHOTT\n STO\nS -.8 .5 NLASF9_SCHOTT\nS -4.5 0.917675\n");
    assert!((efl_mm(&short) - 1.5).abs() < 2e-3, "{}", efl_mm(&short));

    let text = "MODE SEQ\nUNIT MM\nFNUM 4 0\nFTYP 0 0 2 1\nYFLN 0 1\nWAVM 1 0.55 1\nPWAV 1\nSURF 0\n  DISZ INFINITY\n\
                SURF 1\n  CURV 0\n  DISZ 16\nSURF 2\n  STOP\n  CURV -2.187226596675415774E-02\n  DISZ -16\n  GLAS MIRROR\n  \
                CONI -1\nSURF 3\n  CURV -5.208333333333333565E-02\n  DISZ 24.035\n  GLAS MIRROR\n  CONI -3.236\nSURF 4\n";
    let lens = zmx(text).file.lens;
    let order = first_order(&lens.at_wavelength(0.55));
    assert!((order.efl_mm - 80.0).abs() < 0.1 && (lens.entrance_pupil_mm - 20.0).abs() < 0.03, "{order:?}");
    assert!((order.bfl_mm - 24.035).abs() < 1e-3, "{}", order.bfl_mm);
}

#[test]
fn lens_units_become_mm() {
    for (unit, mm) in [("CM", 10.0), ("IN", 25.4), ("METER", 1000.0)] {
        let text = changed(ZMX, "UNIT MM", &format!("UNIT {unit}"));
        let text = text.replace("TYPE STANDARD\n  CURV 0.02", "TYPE EVENASPH\n  PARM 2 1e-9\n  CURV 0.02");
        let lens = zmx(&text).file.lens;
        assert_eq!(lens.entrance_pupil_mm, 10.0 * mm, "{unit}");
        let s = &lens.surfaces[0];
        assert_eq!((s.shape.curvature, s.thickness_mm, s.semi_diameter_mm), (0.02 / mm, 4.0 * mm, 6.0 * mm));
        assert!((s.shape.asphere[1] * mm.powi(3) / 1e-9 - 1.0).abs() < 1e-14);
    }
    let inches = seq(&changed(SEQ, "DIM M", "DIM I")).file.lens;
    assert_eq!((inches.surfaces[0].thickness_mm, inches.entrance_pupil_mm), (4.0 * 25.4, 254.0));
}

#[test]
fn solves_defocus_qualifiers_and_defaults() {
    let import = seq(&changed(SEQ, "SI 0 0", "  THI HMY 0.0\nSI 0 0.25\nK S1 -0.5\nSLB S2 'rear'"));
    let lens = &import.file.lens;
    assert_eq!((lens.image_distance_mm(), lens.surfaces[0].shape.conic), (94.25, -0.5));
    assert_eq!(lens.surfaces[1].label, "rear");
    assert!(
        losses(&import)[0].starts_with("line 12: `THI HMY 0.0`: the solve is not kept"),
        "{:?}",
        losses(&import)
    );
    // A paraxial image without a stored distance is computed.
    let focused = seq(&changed(&changed(SEQ, "S 0 94", "S 0 0"), "SI 0 0", "PIM\nSI 0 0")).file.lens;
    let order = first_order(&focused.at_wavelength(focused.reference_um));
    assert!((focused.image_distance_mm() - order.bfl_mm).abs() < 1e-12);
    // Without RDM numbers are curvatures; numbers that are implausible as curvatures are refused.
    let bare = changed(&changed(SEQ, "RDM;LEN", "LEN"), "S 50 4", "S 0.02 4");
    let import = seq(&changed(&changed(&bare, "  STO\n", ""), "YAN 0 2\n", ""));
    assert_eq!(import.file.lens.surfaces[0].shape.curvature, 0.02);
    assert_eq!(
        import.losses.iter().filter(|l| l.effect == Effect::Assumed).count(),
        3,
        "{:?}",
        losses(&import)
    );
    let refused = parse_seq(&changed(SEQ, "RDM;LEN", "LEN"), &catalog()).unwrap_err();
    assert!(
        refused.to_string().contains("line 8: `S 50 4 NBK7_SCHOTT`: the file does not state whether"),
        "{refused}"
    );
}

#[test]
fn older_records_missing_ones_and_filling() {
    let older = changed(ZMX, "YFLN 0 2", "XFLD 0 0\nYFLD 0 2\nFWGT 1 1");
    let import = zmx(&older);
    assert_eq!((&import.file.lens.fields_deg[..], import.losses.len()), (&[0.0, 2.0][..], 0));
    let import = zmx(&changed(ZMX, "YFLN 0 2\n", ""));
    assert_eq!((&import.file.lens.fields_deg[..], import.losses[0].effect), (&[0.0][..], Effect::Assumed));
    // Without a count, equal wavelengths that fill the table are left out.
    let waves = "WAVM 1 0.48 1\nWAVM 2 0.65 1\nWAVM 3 0.55 1\nWAVM 4 0.55 1\nWAVM 5 0.55 1";
    let uncounted = changed(&changed(ZMX, "FTYP 0 0 2 1 0 0 0", "FTYP 0 0"), "WAVM 1 0.5876 1", waves);
    let import = zmx(&uncounted);
    assert_eq!(import.file.lens.wavelengths_um, [0.48, 0.65]);
    assert!(losses(&import)[0].contains("taken for filling"), "{:?}", losses(&import));
    assert_eq!(import.losses[0].effect, Effect::Assumed);
    // The primary wavelength is kept even if it is one of them.
    let lens = zmx(&changed(&uncounted, "PWAV 1", "PWAV 3")).file.lens;
    assert_eq!((&lens.wavelengths_um[..], lens.reference_um), (&[0.48, 0.55, 0.65][..], 0.55));
    // Lines may end in carriage returns alone.
    assert_eq!(zmx(&ZMX.replace('\n', "\r")).file.lens, zmx(ZMX).file.lens);
    assert_eq!(seq(&SEQ.replace('\n', "\r")).file.lens, seq(SEQ).file.lens);
    assert_eq!(zmx(&ZMX.replace('\n', "\r\n")).file.lens, zmx(ZMX).file.lens);
}

#[test]
fn answers_infinities_and_quotes_of_code_v() {
    let same = |from: &str, to: &str| {
        let (a, b) = (seq(&changed(SEQ, from, to)), seq(SEQ));
        assert_eq!((a.file.lens, a.losses.len()), (b.file.lens, 0), "{to}");
    };
    same("EPD 10", "EPD 10; TEL N; AFO no");
    same("RDM;LEN", "RDM YES;LEN");
    // With any word for no the numbers are curvatures.
    for no in ["N", "no", "NO"] {
        let text = changed(&changed(SEQ, "RDM", &format!("RDM {no}")), "S 50 4", "S 0.02 4");
        assert_eq!(seq(&text).file.lens.surfaces[0].shape.curvature, 0.02, "{no}");
    }
    same("SI 0 0", "RDY INF\nSI 0 0");
    same("SO 0.0 0.1e14", "SO 0.0 100\n THI INF");
    same("SO 0.0 0.1e14", "SO INF INF");
    same("SI 0 0", "SI INF 0");
    same("S 50 4 NBK7_SCHOTT", "S 50 4\n GLA NBK7_SCHOTT");
    let glass = |text: &str| seq(text).file.lens.surfaces[0].glass.name.clone();
    // A glass whose name begins like that of a surface.
    assert_eq!(glass(&changed(SEQ, "S 50 4 NBK7_SCHOTT", "S 50 4\n GLA SF5")), "SF5");
    // Private glasses have whole names, with or without quotes; a glass called END does not end the catalogue.
    let private = "PRV\n PWL 550\n glueball 1.5\n 'END' 1.6\n 'REFL' 1.7\nEND\nSO";
    let text = changed(SEQ, "SO", private);
    for name in ["GLUEBALL", "'END'", "'REFL'"] {
        let lens = seq(&changed(&text, "NBK7_SCHOTT", name)).file.lens;
        assert_eq!(
            (&*lens.surfaces[0].glass.name, lens.surfaces[0].action),
            (name.trim_matches('\''), Action::Refract)
        );
    }
    // A quoted word is not a command.
    let import = seq(&changed(SEQ, "  CIR 6", "  CIR 6\n'K' 5"));
    assert_eq!((import.losses.len(), import.losses[0].effect), (1, Effect::NotUnderstood));
}

#[test]
fn zoomed_values_are_those_of_the_first_position() {
    let with = |lines: &str| changed(SEQ, "SI 0 0", &format!("SI 0 0\n{lines}"));
    let import = seq(&with(
        "ZOO 3\nZOO THI S2 90 91 92\nZOO EPD 8 9 10\nZOO RDY S1 60 50 50\nZOO CIR S1 7 8 9\nZOO YAN F2 3 2 1\n\
         ZOO WL W1 546.1 587.6 587.6\nZOO GLA S1 SF5 517642 517642\nZOO THC S1 100 100 100",
    ));
    let lens = &import.file.lens;
    let front = &lens.surfaces[0];
    assert_eq!((lens.image_distance_mm(), lens.entrance_pupil_mm), (90.0, 8.0));
    assert_eq!((front.shape.curvature, front.semi_diameter_mm, &*front.glass.name), (1.0 / 60.0, 7.0, "SF5"));
    assert_eq!((&lens.fields_deg[..], &lens.wavelengths_um[..]), (&[0.0, 3.0][..], &[0.5461][..]));
    let said = losses(&import);
    assert!(said.len() == 1 && said[0].contains("only the first zoom position is read"), "{said:?}");
    assert_eq!(seq(&with("ZOO STO S2 S1")).file.lens.stop, 1);
    // A surface line may state no distance where the zoomed one does.
    let bare = with("ZOO THI S2 90 91").replace("S 0 94", "S 0 0");
    assert_eq!(seq(&bare).file.lens.image_distance_mm(), 90.0);
    // What is not read is named.
    for (line, name) in [("ZOO PIM Y N", "PIM"), ("ZOO THI S2", "THI"), ("ZOO ZOO 1 2", "ZOO")] {
        let import = seq(&with(line));
        let loss = &import.losses[0];
        assert_eq!(loss.effect, Effect::NotUnderstood, "{line}");
        assert!(loss.message.contains(&format!("{name} of the first zoom position is not read")), "{loss}");
    }
    let error = parse_seq(&with("ZOO YAN 3 2 1"), &catalog()).unwrap_err();
    assert!(error.to_string().contains("one value for 2 numbers"), "{error}");
}

#[test]
fn pickups_that_the_numbers_of_the_file_contradict_are_reported() {
    for (line, effect, message) in [
        ("PIK THI S2 S1 23.5", Effect::NoRay, "its value is"),
        ("PIK RDY SI S2", Effect::NoRay, "its value is"),
        ("PIK THI S2 S1 2 1", Effect::Unsolved, "it gives 9, and the file states 94"),
        ("PIK CUY S2 S1 -1", Effect::Unsolved, "it gives -0.02, and the file states 0"),
        ("PIK GLA S2 S1", Effect::NotUnderstood, "not compared"),
    ] {
        let import = seq(&changed(SEQ, "SI 0 0", &format!("SI 0 0\n{line}")));
        let [loss] = &import.losses[..] else { panic!("{:?}", losses(&import)) };
        assert_eq!((loss.effect, &*loss.record), (effect, line));
        assert!(loss.message.contains(message), "{loss}");
        assert_eq!(import.file.lens, seq(SEQ).file.lens, "{line}");
    }
}
