//! What is said of a whole lens: aperture, fields and wavelengths.

use petzval_optics::paraxial::image_height_per_tangent;
use petzval_optics::pupil::chief_ray;

use crate::support::{SEQ, ZMX, changed, efl_mm, losses, seq, zmx};

#[test]
fn apertures_of_every_kind() {
    let pupil = |line: &str| zmx(&changed(ZMX, "ENPD 10", line)).file.lens.entrance_pupil_mm;
    let efl = efl_mm(&zmx(ZMX).file.lens);
    assert!((pupil("FNUM 9 0") - efl / 9.0).abs() < 1e-12);
    assert!((pupil("FNUM 9 1") - efl / 9.0).abs() < 1e-12);
    // At f/8 the clear aperture of the stop, of 6 mm, is narrower.
    assert!(efl / 8.0 > 12.0 && (pupil("FNUM 8 0") - 12.0).abs() < 1e-12);
    assert!((pupil("FLOA") - 12.0).abs() < 1e-12);
    // A near object; the first surface is the stop.
    let near = changed(ZMX, "DISZ INFINITY", "DISZ 200");
    let pupil = |line: &str| zmx(&changed(&near, "ENPD 10", line)).file.lens;
    assert!((pupil("OBNA 0.02 0").entrance_pupil_mm - 400.0 * 0.02_f64.asin().tan()).abs() < 1e-12);
    assert!((pupil("OBNA 1 1").entrance_pupil_mm - 400.0 * 1_f64.to_radians().tan()).abs() < 1e-12);
    // f/20 at the image: the marginal ray's slope behind the lens is 1/40. The stop is clear for it.
    let lens = pupil("FNUM 20 1");
    let sequence = lens.at_wavelength(lens.reference_um);
    let u = 0.5 * lens.entrance_pupil_mm / 200.0;
    let ray = petzval_optics::paraxial::paraxial_ray(&sequence, 200.0 * u, u);
    assert!((ray.w[2].abs() - 0.025).abs() < 1e-12);
    // CODE V takes the sine at the object instead.
    let near_seq = |line: &str| seq(&changed(&changed(SEQ, "0.1e14", "200"), "EPD 10", line)).file.lens;
    let lens = near_seq("FNO 20");
    let sine = (0.5 * lens.entrance_pupil_mm / 200.0).atan().sin();
    let magnification = 1.0 / petzval_optics::paraxial::paraxial_ray(&sequence, 200.0, 1.0).w[2].abs();
    assert!((sine / magnification - 0.025).abs() < 1e-12);
    // At f/10 it would be wider than the clear aperture of the stop, of 6 mm.
    assert!(0.05 * magnification * 200.0 > 6.0);
    assert!((near_seq("FNO 10").entrance_pupil_mm - 12.0).abs() < 1e-12);
    assert!((near_seq("NA 0.025").entrance_pupil_mm - lens.entrance_pupil_mm).abs() < 1e-12);
    assert!((near_seq("NAO 0.02").entrance_pupil_mm - 400.0 * 0.02_f64.asin().tan()).abs() < 1e-12);
    let far_seq = |line: &str| seq(&changed(SEQ, "EPD 10", line)).file.lens.entrance_pupil_mm;
    assert!((far_seq("FNO 9") - efl / 9.0).abs() < 1e-12);
    assert!((far_seq("FNO 8") - 12.0).abs() < 1e-12);
}

#[test]
fn fields_of_every_kind_become_angles() {
    let fields = |kind: usize, values: &str, text: &str| {
        let text = changed(text, "FTYP 0 0 2 1", &format!("FTYP {kind} 0 2 1"));
        zmx(&changed(&text, "YFLN 0 2", values)).file.lens
    };
    let near = changed(ZMX, "DISZ INFINITY", "DISZ 200");
    let deg = |tangent: f64| tangent.atan().to_degrees();
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    close(fields(1, "YFLN 0 7", &near).fields_deg[1], deg(7.0 / 200.0));
    let lens = fields(2, "YFLN 0 3", ZMX);
    close(lens.fields_deg[1], deg(3.0 / efl_mm(&lens)));
    let lens = fields(2, "YFLN 0 3", &near);
    let per_tangent = image_height_per_tangent(&lens.at_wavelength(lens.reference_um));
    close(lens.fields_deg[1], deg(3.0 / per_tangent.abs()));
    for text in [ZMX, &near] {
        let lens = fields(3, "YFLN 0 3", text);
        let landed =
            chief_ray(&lens.at_wavelength(lens.reference_um), lens.fields_deg[1].to_radians()).unwrap();
        close(landed.y_mm.abs(), 3.0);
    }
    // The stop is the first surface: an angle at the entrance pupil is one at the first vertex.
    close(fields(0, "YFLN 0 2", &near).fields_deg[1], 2.0);
    // Fields off the y axis and below it are turned onto it in a rotationally symmetric lens.
    let lens = changed(ZMX, "YFLN 0 2", "XFLN 3 0\nYFLN 4 -2");
    let import = zmx(&lens);
    let [x, y] = [3_f64, 4.0].map(|v| v.to_radians().tan());
    assert_eq!(import.file.lens.fields_deg, [2.0, x.hypot(y).atan().to_degrees()]);
    let losses_text = losses(&import).join("\n");
    assert!(losses_text.contains("turned into it") && losses_text.contains("mirror images"), "{losses_text}");
    for (command, angle) in [("YIM 0 3", deg(3.0 / efl_mm(&zmx(ZMX).file.lens))), ("XAN 0 2\nYAN 0 0", 2.0)] {
        close(seq(&changed(SEQ, "YAN 0 2", command)).file.lens.fields_deg[1], angle);
    }
}

#[test]
fn wavelengths_with_weight_zero_are_left_out() {
    let text = changed(ZMX, "FTYP 0 0 2 1", "FTYP 0 0 2 3");
    let text = changed(
        &text,
        "WAVM 1 0.5876 1\nPWAV 1",
        "WAVM 1 0.65 1\nWAVM 2 0.5876 0\nWAVM 3 0.45 1\nWAVM 4 0.55 1\nPWAV 2",
    );
    let import = zmx(&text);
    assert_eq!(
        (&import.file.lens.wavelengths_um[..], import.file.lens.reference_um),
        (&[0.45, 0.65][..], 0.5876)
    );
    assert!(import.losses.is_empty(), "{:?}", import.losses);
    let lens = seq(&changed(SEQ, "WL 587.6", "WL 650 587.6 450\nREF 2\nWTW 1 0 1")).file.lens;
    assert_eq!((&lens.wavelengths_um[..], lens.reference_um), (&[0.45, 0.65][..], 0.5876));
}

/// Whatever happens to a weight of a wavelength is said, wherever the file has it; lines beyond the count have no meaning.
#[test]
fn weights_of_wavelengths_that_are_lost_are_said() {
    let (left_out, all_zero, uneven) =
        ("of weight 0 are not kept", "have the weight 0", "weights of wavelengths are not kept");
    let three =
        |first: &str| changed(&changed(ZMX, "FTYP 0 0 2 1", "FTYP 0 0 2 3"), "WAVM 1 0.5876 1", first);
    for (waves, um, said) in [
        ("WAVM 1 0.65 1\nWAVM 2 0.55 2\nWAVM 3 0.45 1", &[0.45, 0.55, 0.65][..], &[uneven][..]),
        ("WAVM 1 0.65 1\nWAVM 2 0.55 1\nWAVM 3 0.45 1\nWAVM 4 0.7 9", &[0.45, 0.55, 0.65], &[]),
        ("WAVM 1 0.65 1\nWAVM 2 0.55 1\nWAVM 3 0.45 0", &[0.55, 0.65], &[left_out]),
        ("WAVM 1 0.65 1\nWAVM 2 0.55 3\nWAVM 3 0.45 0", &[0.55, 0.65], &[left_out, uneven]),
        ("WAVM 1 0.65 0\nWAVM 2 0.55 0\nWAVM 3 0.45 0", &[0.45, 0.55, 0.65], &[all_zero]),
        // Listed twice, it has twice the weight.
        ("WAVM 1 0.65 1\nWAVM 2 0.55 1\nWAVM 3 0.55 1", &[0.55, 0.65], &[uneven]),
        // A record of their own may stand in front of the wavelengths.
        ("WWGN 1 1 0\nWAVN 0.65 0.55 0.45", &[0.55, 0.65], &[left_out]),
        ("WAVN 0.65 0.55 0.45\nWWGN 1 1 0", &[0.55, 0.65], &[left_out]),
    ] {
        let import = zmx(&three(waves));
        assert_eq!(import.file.lens.wavelengths_um, um, "{waves}");
        let losses = losses(&import);
        assert_eq!(losses.len(), said.len(), "{waves}: {losses:?}");
        for said in said {
            assert!(losses.iter().any(|loss| loss.contains(said)), "{waves}: {losses:?}");
        }
    }
}
