//! The sRGB transfer curve between linear light and display values.

/// Linear light up to which the curve is a line.
pub(crate) const SRGB_TOE: f32 = 0.003_130_8;

/// Encodes linear light for a display (opto-electronic transfer function).
///
/// `s = 12.92 l` for `l <= 0.0031308`, else `s = 1.055 l^(1/2.4) - 0.055`; `l` in [0, 1], relative light. Nothing is clipped: the
/// line through zero goes on below it, so that noise around black keeps its sign. Source: IEC 61966-2-1:1999.
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= SRGB_TOE { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Decodes a display value to linear light (electro-optical transfer function), the inverse of [`srgb_encode`].
///
/// `l = s / 12.92` for `s <= 0.04045`, else `l = ((s + 0.055) / 1.055)^2.4`. Source: IEC 61966-2-1:1999.
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_colour_science() {
        let reference: serde_json::Value =
            serde_json::from_str(include_str!("../../tests/fixtures/isp_reference.json")).unwrap();
        let list =
            |key: &str| -> Vec<f64> { serde_json::from_value(reference["srgb"][key].clone()).unwrap() };
        let (linear, encoded) = (list("linear"), list("encoded"));
        assert_eq!(linear.len(), 33);
        for (linear, encoded) in linear.into_iter().zip(encoded) {
            let found = f64::from(srgb_encode(linear as f32));
            assert!((found - encoded).abs() < 1e-6, "{linear}: {found} {encoded}");
            let found = f64::from(srgb_decode(encoded as f32));
            assert!((found - linear).abs() < 1e-6, "{encoded}: {found} {linear}");
        }
    }

    #[test]
    fn decode_inverts_encode() {
        for i in -20..=120 {
            let v = i as f32 / 100.0;
            assert!((srgb_decode(srgb_encode(v)) - v).abs() < 2e-6, "{v}");
        }
    }
}
