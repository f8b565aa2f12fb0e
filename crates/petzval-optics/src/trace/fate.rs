//! Fates of rays, and their codes in vectors.

/// The fate of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Fate {
    /// It reached the image plane.
    #[default]
    Ok,
    /// It never met this surface (0-based).
    Missed(usize),
    /// It met this surface outside its clear aperture; it is traced further, without weight.
    Clipped(usize),
    /// It was totally reflected at this surface.
    TotalReflection(usize),
    /// No launch point was found for its point of the stop.
    NotAimed,
}

impl Fate {
    /// Whether the ray has a position and a direction at the image plane.
    pub fn reaches_image(self) -> bool {
        matches!(self, Self::Ok | Self::Clipped(_))
    }

    /// Decodes a fate. It is one number in vector code: 0 is ok, `surface + 1` is clipped at that surface, and rays that do not
    /// reach the image have numbers below zero.
    pub(super) fn of_code(code: f64) -> Self {
        if code == 0.0 {
            return Self::Ok;
        }
        let number = code.abs() as usize;
        match (code > 0.0, number) {
            (true, surface) => Self::Clipped(surface - 1),
            (false, 1) => Self::NotAimed,
            (false, n) if n % 2 == 0 => Self::Missed(n / 2 - 1),
            (false, n) => Self::TotalReflection(n / 2 - 1),
        }
    }
}

/// Reasons for which a ray does not pass a surface.
#[derive(Clone, Copy)]
pub(super) enum Loss {
    Missed,
    TotalReflection,
}

impl Loss {
    /// The code of a ray that is lost at a surface.
    pub fn code(self, surface: usize) -> f64 {
        -((2 * (surface + 1) + self as usize) as f64)
    }
}

/// The code of a ray that could not be aimed.
pub(super) const NOT_AIMED: f64 = -1.0;

/// The code of a ray that an aperture clips.
pub(super) fn clipped_at(surface: usize) -> f64 {
    (surface + 1) as f64
}
