//! The kinds of pictures.

/// A picture of an analysis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// The cross-section with rays, to scale.
    Layout,
    /// Spot diagrams.
    Spots,
    /// Ray aberrations over the pupil.
    RayFans,
    /// Optical path differences over the pupil.
    OpdFans,
    /// Modulation over frequency, by waves.
    Mtf,
    /// Modulation over frequency, by rays.
    MtfGeometric,
    /// Modulation over the field.
    MtfByField,
    /// Modulation over focus.
    MtfThroughFocus,
    /// Tangential and sagittal focus and distortion over the field.
    FieldCurvatureDistortion,
    /// Lateral colour over the field.
    LateralColour,
    /// Focus over wavelength and over the pupil.
    AxialColour,
    /// Energy within circles.
    EncircledEnergy,
    /// Illumination over the field.
    RelativeIllumination,
    /// Wavefront errors and Zernike coefficients.
    Wavefront,
    /// Third-order sums by surface.
    Seidel,
}

impl PictureKind {
    /// All kinds, in the order of the page.
    pub const ALL: [Self; 15] = [
        Self::Layout,
        Self::Spots,
        Self::RayFans,
        Self::OpdFans,
        Self::Mtf,
        Self::MtfGeometric,
        Self::MtfByField,
        Self::MtfThroughFocus,
        Self::FieldCurvatureDistortion,
        Self::LateralColour,
        Self::AxialColour,
        Self::EncircledEnergy,
        Self::RelativeIllumination,
        Self::Wavefront,
        Self::Seidel,
    ];

    /// Its name, that of its file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Layout => "layout",
            Self::Spots => "spots",
            Self::RayFans => "ray_fans",
            Self::OpdFans => "opd_fans",
            Self::Mtf => "mtf",
            Self::MtfGeometric => "mtf_geometric",
            Self::MtfByField => "mtf_by_field",
            Self::MtfThroughFocus => "mtf_through_focus",
            Self::FieldCurvatureDistortion => "field_curvature_distortion",
            Self::LateralColour => "lateral_colour",
            Self::AxialColour => "axial_colour",
            Self::EncircledEnergy => "encircled_energy",
            Self::RelativeIllumination => "relative_illumination",
            Self::Wavefront => "wavefront",
            Self::Seidel => "seidel",
        }
    }
}
