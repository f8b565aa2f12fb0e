//! Edges of surfaces: what they let through.

use petzval_files::Import;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;

use crate::support::{SEQ, ZMX, changed, efl_mm, losses, seq, zmx};

#[test]
fn apertures_that_are_not_round_or_off_the_vertex() {
    let clear = |record: &str| {
        let import = zmx(&changed(ZMX, "  CLAP 0 6 0", record));
        (import.file.lens.surfaces[0].semi_diameter_mm, import.losses.len())
    };
    assert_eq!(clear("  FLAP 0 6 0"), (6.0, 0));
    assert_eq!(clear("  SQAP 6 8"), (10.0, 1));
    assert_eq!(clear("  CLAP 2 6"), (6.0, 1));
    assert_eq!(clear("  CLAP 0 8\n  OBDC 0 2"), (10.0, 1));
    assert_eq!(clear("  CLAP 0 6\n  OBSC 0 1"), (6.0, 1));
    // Without an aperture a semi-diameter blocks no light; the pupil determines that of the stop.
    assert_eq!(clear(""), (5.0, 0));
    let clear = |commands: &str| {
        let import = seq(&changed(SEQ, "  CIR 6", commands));
        (import.file.lens.surfaces[0].semi_diameter_mm, import.losses.len())
    };
    assert_eq!(clear("  REX 6; REY 8"), (10.0, 2));
    assert_eq!(clear("  CIR 8; ADY 2"), (10.0, 1));
    assert_eq!(clear("  CIR EDG 7; CIR 6; CIR OBS 1"), (6.0, 1));
}

#[test]
fn a_clear_aperture_of_the_stop_that_cuts_the_beam_narrows_the_entrance_pupil() {
    // The stop is the front surface: its beam is the entrance pupil, 10 mm wide.
    let pupil = |import: &Import| (import.file.lens.entrance_pupil_mm, losses(import).join("; "));
    for (record, diameter) in
        [("  CLAP 0 3 0", 6.0), ("  CLAP 0 4.9 0", 9.8), ("  SQAP 1 1", 2.0 * 2_f64.sqrt())]
    {
        let import = zmx(&changed(ZMX, "  CLAP 0 6 0", record));
        let (found, said) = pupil(&import);
        assert!((found - diameter).abs() < 1e-12, "{record}: {found}");
        // The warning is about the record of the aperture.
        let narrowing = import.losses.iter().find(|loss| loss.message.contains("is narrowed")).unwrap();
        assert_eq!(narrowing.record.trim(), record.trim());
        assert!(
            said.contains("is narrowed from 10 to") && said.contains("the clear aperture of the stop"),
            "{said}"
        );
    }
    let (found, said) = pupil(&seq(&changed(SEQ, "  CIR 6", "  CIR 3")));
    assert!((found - 6.0).abs() < 1e-12 && said.contains("narrowed from 10 to 6 mm"), "{found} {said}");
    // Lengths are rounded, and have no digits of the rounding: 50020 times 1e-4 is 5.002000000000001.
    let (_, said) = pupil(&seq(&changed(SEQ, "  CIR 6", "  CIR 2.501")));
    assert!(said.contains("narrowed from 10 to 5.002 mm"), "{said}");
    // A wider one does not, nor one that was printed with few digits, nor one that the program fits to its rays.
    for record in ["  CLAP 0 6 0", "  CLAP 0 5 0", "  CLAP 0 4.9998 0", "  FLAP 0 6 0"] {
        assert_eq!(pupil(&zmx(&changed(ZMX, "  CLAP 0 6 0", record))), (10.0, String::new()), "{record}");
    }
    // A floating aperture has the semi-diameter of the surface, which the program fits to its rays unless the user sets it.
    let floating = |diam: &str| changed(&changed(ZMX, "  CLAP 0 6 0", "  FLAP 0 6 0"), "DIAM 6 1", diam);
    assert_eq!(pupil(&zmx(&floating("DIAM 4.9 0"))), (10.0, String::new()));
    let (found, said) = pupil(&zmx(&floating("DIAM 4.9 1")));
    assert!((found - 9.8).abs() < 1e-12 && said.contains("narrowed from 10 to 9.8 mm"), "{found} {said}");
    // Behind a lens the beam at the stop is narrower than the pupil. The stop is 40 mm behind a thin lens of 100 mm: 6 mm of 10.
    let behind = changed(
        ZMX,
        "  STOP\n  TYPE STANDARD\n  CURV 0.02 0 0 0 0 \"\"\n  DISZ 4\n  GLAS N-BK7 0 0 1.5168 64.17\n  DIAM 6 1 0 0 1 \"\"\n  CLAP 0 6 0",
        "  TYPE PARAXIAL\n  PARM 1 100\n  DISZ 40",
    );
    let behind =
        changed(&behind, "SURF 2\n  TYPE STANDARD", "SURF 2\n  STOP\n  CLAP 0 1.5 0\n  TYPE STANDARD");
    let (found, said) = pupil(&zmx(&behind));
    assert!((found - 5.0).abs() < 1e-12 && said.contains("the beam of 3 mm"), "{found} {said}");
}

/// Share of the light of a wide stop that an aperture of the stop lets through on the axis.
fn light(lens: &Lens) -> f64 {
    let quadrature = petzval_optics::pupil::Quadrature::grid(256).unwrap();
    let sequence = lens.at_wavelength(lens.reference_um);
    let stop = first_order(&sequence).stop_radius_mm;
    let beam = petzval_optics::pupil::trace_beam(&sequence, 0.0, stop, &quadrature);
    let mut open = lens.clone();
    open.surfaces.iter_mut().for_each(|s| s.semi_diameter_mm = 20.0);
    let all =
        petzval_optics::pupil::trace_beam(&open.at_wavelength(lens.reference_um), 0.0, stop, &quadrature);
    beam.light() / all.light()
}

#[test]
fn an_aperture_of_the_stop_off_its_vertex_lets_its_own_light_through() {
    // A circle within the beam of 5 mm lets through the ratio of the areas; one that crosses its rim their common area.
    for (clap, offset, share) in [("2", "2 0", 0.16), ("3", "2 -1", 0.352_86), ("1", "0 3.5", 0.04)] {
        let record = format!("  CLAP 0 {clap} 0\n  OBDC {offset}");
        let import = zmx(&changed(ZMX, "  CLAP 0 6 0", &record));
        let lens = &import.file.lens;
        assert_eq!((lens.stop, lens.surfaces.len(), lens.entrance_pupil_mm), (1, 3, 10.0));
        assert!((light(lens) - share).abs() < 2e-3, "{clap} {offset}: {}", light(lens));
        assert!(losses(&import).join("").contains("line 20: `OBDC"), "{:?}", import.losses);
        // It is as long, and has the same power, as without the aperture.
        let plain = zmx(&changed(ZMX, "  CLAP 0 6 0", "")).file.lens;
        assert_eq!((efl_mm(lens), lens.total_track_mm()), (efl_mm(&plain), plain.total_track_mm()));
    }
    let import = seq(&changed(SEQ, "  CIR 6", "  CIR 2; ADX 0; ADY 2"));
    assert!((light(&import.file.lens) - 0.16).abs() < 2e-3 && import.losses.len() == 1);
    // Fields off the y-z plane need a round lens: there a circle about the vertex encloses the aperture.
    let skew =
        changed(&changed(ZMX, "  CLAP 0 6 0", "  CLAP 0 2 0\n  OBDC 2 0"), "YFLN 0 2", "XFLN 0 1\nYFLN 0 2");
    let import = zmx(&skew);
    assert!((import.file.lens.entrance_pupil_mm - 8.0).abs() < 1e-12, "{:?}", import.losses);
}

/// A stop that is too large for the surfaces: the beams are narrowed, with a message.
#[test]
fn beams_wider_than_the_lens_can_be_are_narrowed() {
    let text = "MODE SEQ\nUNIT MM\nFLOA\nYFLN 0\nWAVM 1 0.5876 1\nPWAV 1\nSURF 0\n DISZ INFINITY\nSURF 1\n CURV 0.05\n DISZ 5\n \
                GLAS N-BK7\nSURF 2\n CURV -0.05\n DISZ 10\nSURF 3\n STOP\n DISZ 20\n DIAM 8.5\nSURF 4\n\n";
    let import = zmx(text);
    assert!(losses(&import)[0].contains("wider than the surfaces can be"), "{:?}", losses(&import));
    let semi = import.file.lens.surfaces[0].semi_diameter_mm;
    // The spheres meet where each has a sag of 2.5 mm.
    assert!(semi > 8.0 && semi < 9.69, "{semi}");
    let sequence = import.file.lens.at_wavelength(0.5876);
    assert!((first_order(&sequence).stop_radius_mm - 8.5).abs() < 1e-12);
    // Only surfaces that end within the beams are made smaller: a plate in front of the lens takes all of the outermost beam.
    let plate = "SURF 1\n CURV 0\n DISZ 3\n GLAS N-BK7\nSURF 2\n CURV 0\n DISZ 40\nSURF 3\n CURV 0.05";
    let behind = changed(text, "SURF 1\n CURV 0.05", plate);
    let behind =
        changed(&changed(&behind, "SURF 3\n STOP", "SURF 5\n STOP"), "SURF 2\n CURV -", "SURF 4\n CURV -");
    let behind = changed(&changed(&behind, "SURF 4\n\n", "SURF 6\n"), "YFLN 0", "YFLN 0 20");
    let import = zmx(&behind);
    let said = losses(&import).join("; ");
    assert!(
        said.contains("at surface 3") && said.contains("at surface 4") && !said.contains("surface 1"),
        "{said}"
    );
    let semis: Vec<f64> = import.file.lens.surfaces.iter().map(|s| s.semi_diameter_mm).collect();
    assert!(semis[0] > 40.0 * 20_f64.to_radians().tan() && semis[2] < 9.69 && semis[2] > 9.4, "{semis:?}");
}

#[test]
fn the_loss_of_a_shifted_aperture_describes_its_treatment() {
    let said = |records: &str| {
        let import = zmx(&changed(ZMX, "  CLAP 0 6 0", records));
        (import.file.lens.surfaces[0].semi_diameter_mm, losses(&import).join("\n"))
    };
    let (semi, loss) = said("  CLAP 0 8\n  OBDC 0 2");
    assert!(semi == 10.0 && loss.contains("encloses it"), "{loss}");
    let (semi, loss) = said("  FLAP 0 6\n  OBDC 0 2");
    assert!(semi == 6.0 && loss.contains("stays at the vertex"), "{loss}");
    assert!(said("  OBDC 0 2").1.contains("no aperture that is kept"));
}
