//! The sRGB transfer curve between linear light and display values.

/// Encodes linear light for a display (opto-electronic transfer function).
///
/// `s = 12.92 l` for `l <= 0.0031308`, else `s = 1.055 l^(1/2.4) - 0.055`; `l` in [0, 1], relative light; odd-symmetric
/// below zero, no clipping above one. Source: IEC 61966-2-1:1999.
pub fn srgb_encode(linear: f32) -> f32 {
    let magnitude = linear.abs();
    let encoded =
        if magnitude <= 0.0031308 { 12.92 * magnitude } else { 1.055 * magnitude.powf(1.0 / 2.4) - 0.055 };
    encoded.copysign(linear)
}

/// Decodes a display value to linear light (electro-optical transfer function), the inverse of [`srgb_encode`].
///
/// `l = s / 12.92` for `s <= 0.04045`, else `l = ((s + 0.055) / 1.055)^2.4`. Source: IEC 61966-2-1:1999.
pub fn srgb_decode(encoded: f32) -> f32 {
    let magnitude = encoded.abs();
    let linear =
        if magnitude <= 0.04045 { magnitude / 12.92 } else { ((magnitude + 0.055) / 1.055).powf(2.4) };
    linear.copysign(encoded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_colour_science() {
        // colour-science 0.4.7, cctf_encoding(x, "sRGB").
        assert!((srgb_encode(0.03125) - 0.193_946_85).abs() < 1e-6);
        assert!((srgb_encode(0.0625) - 0.277_304_18).abs() < 1e-6);
        assert_eq!(srgb_encode(0.0), 0.0);
        assert!((srgb_encode(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn decode_inverts_encode() {
        for i in -20..=120 {
            let v = i as f32 / 100.0;
            assert!((srgb_decode(srgb_encode(v)) - v).abs() < 2e-6, "{v}");
        }
    }
}
