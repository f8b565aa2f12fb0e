//! Notes on what a picture file says about its pixels that is not obeyed.

use std::io::{BufRead, Seek};

use ::image::codecs::hdr::HdrMetadata;
use ::image::codecs::webp::WebPDecoder;
use moxcms::{ColorProfile, ProfileText, ToneReprCurve};

use petzval_camera::image::srgb_decode;

/// Chromaticities x, y of red, green, blue and white.
pub type PrimariesXy = [[f32; 2]; 4];

const REC_709: PrimariesXy = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]];

/// Largest difference of a chromaticity that is rounding; the primaries of Rec. 601 differ by 0.01.
const SAME_XY: f32 = 0.003;

/// Gamma of a PNG that stands for sRGB, and how far it may be off.
const SRGB_GAMMA: (f32, f32) = (1.0 / 2.2, 0.01);

/// The note of an animation.
const ANIMATION: &str = "it is an animation, of which only one picture is used";

/// A note if the primaries are not those of Rec. 709, which are those of sRGB.
pub fn primaries_note(xy: &PrimariesXy) -> Option<String> {
    let is_off = |(a, b): (&f32, &f32)| (a - b).abs() > SAME_XY;
    let is_other = xy.as_flattened().iter().zip(REC_709.as_flattened()).any(is_off);
    let [[xr, yr], [xg, yg], [xb, yb], _] = xy;
    is_other.then(|| {
        format!(
            "its primaries, red {xr:.3} {yr:.3}, green {xg:.3} {yg:.3}, blue {xb:.3} {yb:.3}, are ignored: \
             colours are taken as those of Rec. 709"
        )
    })
}

/// Notes on the colour chunks of a PNG other than a profile, and on an animation.
pub fn png_notes(source: impl BufRead + Seek) -> Vec<String> {
    let mut notes = Vec::new();
    // A file that cannot be read is refused elsewhere.
    let Ok(reader) = png::Decoder::new(source).read_info() else { return notes };
    let info = reader.info();
    notes.extend(animation_note(info));
    if let Some(code) = info.coding_independent_code_points
        && (code.color_primaries, code.transfer_function) != (1, 13)
    {
        notes.push(format!(
            "its cICP chunk (primaries {}, transfer function {}) is ignored: values are taken as sRGB",
            code.color_primaries, code.transfer_function
        ));
    }
    // A statement of sRGB, or a profile, stands above gamma and chromaticities.
    if info.srgb.is_some() || info.icc_profile.is_some() {
        return notes;
    }
    let gamma = info.gama_chunk.map(|gamma| gamma.into_value());
    if let Some(gamma) = gamma.filter(|gamma| (gamma - SRGB_GAMMA.0).abs() > SRGB_GAMMA.1) {
        notes.push(format!("its gamma of {gamma:.4} (gAMA) is ignored: values are taken as sRGB"));
    }
    if let Some(xy) = info.chrm_chunk {
        let xy = [xy.red, xy.green, xy.blue, xy.white].map(|(x, y)| [x.into_value(), y.into_value()]);
        notes.extend(primaries_note(&xy));
    }
    notes
}

/// A note on a PNG file that is an animation.
pub fn animation_note(info: &png::Info) -> Option<String> {
    let is_animation = info.animation_control.is_some_and(|animation| animation.num_frames > 1);
    is_animation.then(|| ANIMATION.to_owned())
}

/// A note on a WebP file that is an animation.
pub fn webp_notes(source: impl BufRead + Seek) -> Vec<String> {
    let decoder = WebPDecoder::new(source);
    let is_animation = decoder.is_ok_and(|decoder| decoder.has_animation());
    is_animation.then(|| ANIMATION.to_owned()).into_iter().collect()
}

/// A note on a TIFF of several pages.
pub fn tiff_notes(source: impl BufRead + Seek) -> Vec<String> {
    let first = tiff::decoder::Decoder::new(source);
    let has_more = first.is_ok_and(|first| first.more_images());
    has_more.then(|| "it has several pages, of which only the first is used".to_owned()).into_iter().collect()
}

/// Notes on the header of a Radiance HDR file.
pub fn hdr_notes(header: &HdrMetadata) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(exposure) = header.exposure.filter(|exposure| *exposure != 1.0) {
        notes.push(format!("its EXPOSURE of {exposure} is ignored: 1 is white"));
    }
    if header.color_correction.is_some_and(|correction| correction != (1.0, 1.0, 1.0)) {
        notes.push("its COLORCORR is ignored".to_owned());
    }
    if let Some(aspect) = header.pixel_aspect_ratio.filter(|aspect| *aspect != 1.0) {
        notes.push(format!("its PIXASPECT of {aspect} is ignored"));
    }
    for (_, text) in header.custom_attributes.iter().filter(|(key, _)| key == "PRIMARIES") {
        let xy: Vec<f32> = text.split_whitespace().filter_map(|number| number.parse().ok()).collect();
        match *xy {
            [a, b, c, d, e, f, g, h] => notes.extend(primaries_note(&[[a, b], [c, d], [e, f], [g, h]])),
            _ => notes.push(format!("its PRIMARIES ({text}) are not eight numbers and ignored")),
        }
    }
    notes
}

/// A note on an ICC profile that is not that of sRGB.
pub fn profile_note(profile: &[u8]) -> Option<String> {
    let name = match ColorProfile::new_from_slice(profile) {
        Ok(profile) if is_srgb(&profile) => return None,
        Ok(profile) => profile_name(&profile).unwrap_or_else(|| "without a name".to_owned()),
        Err(_) => "that cannot be read".to_owned(),
    };
    Some(format!("its ICC profile ({name}) is ignored: values are taken as sRGB"))
}

/// Whether a profile has the primaries and the tone curve of sRGB, by its numbers: names such as `sRGB` stand for linear light,
/// too.
fn is_srgb(profile: &ColorProfile) -> bool {
    // Most profiles differ in the third digit of their colorants, Display P3 by 0.06; gamma 2.2 by 0.008 in light.
    let srgb = ColorProfile::new_srgb();
    let (ours, theirs) = (srgb.colorant_matrix(), profile.colorant_matrix());
    let is_same = |(a, b): (&f64, &f64)| (a - b).abs() < 0.005;
    ours.v.as_flattened().iter().zip(theirs.v.as_flattened()).all(is_same)
        && [&profile.red_trc, &profile.green_trc, &profile.blue_trc].into_iter().all(is_srgb_curve)
}

fn is_srgb_curve(curve: &Option<ToneReprCurve>) -> bool {
    let Some(Ok(curve)) = curve.as_ref().map(ToneReprCurve::make_linear_evaluator) else { return false };
    (0..=16).map(|i| i as f32 / 16.0).all(|v| (curve.evaluate_value(v) - srgb_decode(v)).abs() < 0.005)
}

fn profile_name(profile: &ColorProfile) -> Option<String> {
    let name = match profile.description.as_ref()? {
        ProfileText::PlainString(text) => text,
        ProfileText::Localizable(texts) => &texts.first()?.value,
        ProfileText::Description(text) if text.ascii_string.is_empty() => &text.unicode_string,
        ProfileText::Description(text) => &text.ascii_string,
    };
    let name: String = name.chars().filter(|c| !c.is_control()).take(80).collect();
    (!name.trim().is_empty()).then(|| name.trim().to_owned())
}
