//! Lenses of variants that are made from the experiment's lens.

/// The name of a variant's lens that has no aberrations: a thin lens of the focal length and the entrance pupil of the experiment's lens. It is
/// the ceiling of what any lens of this f-number could reach. `variant.perfect_image` says what it makes of a point.
pub const PERFECT_LENS: &str = "perfect";

/// The name of a variant's lens that has every variable of the experiment's lens in the middle of its bounds: what the bounds alone say.
pub const BOX_CENTRE_LENS: &str = "box-centre";

/// Whether a name stands for a lens that is made from the experiment's lens, and not for a file.
pub fn is_derived_lens(name: &str) -> bool {
    [PERFECT_LENS, BOX_CENTRE_LENS].contains(&name)
}
