//! A bank as cameras take it.

use petzval_camera::image::CHANNELS;
use petzval_camera::psf::PsfBank;
use petzval_camera::render::Distortion;

use super::check::fault;
use super::{Channel, PsfFault, PsfFile};

/// Fields closer to the axis than this lie on it, mm.
const ON_AXIS_MM: f64 = 1e-9;

/// A radius, mm, which is 0 on the axis: rounding may have moved it.
fn snapped(radius_mm: f64) -> f64 {
    if radius_mm < ON_AXIS_MM { 0.0 } else { radius_mm }
}

/// Widest field of a rectilinear picture, degrees.
const WIDEST_PICTURE_DEG: f64 = 85.0;

impl PsfFile {
    /// The PSFs in single precision, from the axis outwards, in red, green and blue: a camera turns those of each radius about the axis.
    ///
    /// `channels` says which wavelength is which colour. Without it the longest of three is red; a single one stands for all colours. Fails for a lens
    /// without rotational symmetry, without a field on the axis, and for other numbers of wavelengths.
    pub fn for_cameras(&self) -> Result<PsfBank, PsfFault> {
        let axes = &self.axes;
        if !axes.rotationally_symmetric {
            let message = "cameras turn the PSFs of one azimuth about the axis, and so cannot take these";
            let hint = "take PSFs of a rotationally symmetric lens";
            return Err(fault("rotationally_symmetric", false, message, hint));
        }
        if let Some(below) = axes.chief_ray_y_mm.iter().find(|mm| **mm < -ON_AXIS_MM) {
            let message = "a field below the axis: its rows run towards the axis";
            let hint = "take the field on the other side of the axis";
            return Err(fault("chief_ray_y_mm", below, message, hint));
        }
        let (order, field_radius_mm) = self.fields_outwards();
        if let Some(first) = field_radius_mm.first().filter(|mm| **mm > 0.0) {
            let message = "no field lies on the axis: radii start at 0";
            return Err(fault("field_radius_mm", first, message, "add the PSFs of the axis"));
        }
        if let Some(pair) = field_radius_mm.windows(2).find(|pair| pair[0] == pair[1]) {
            let message = "two fields have this radius";
            return Err(fault("field_radius_mm", pair[1], message, "leave one of them out"));
        }
        let colours = self.colours()?;
        let [_, wavelengths, rows, columns] = self.shape;
        let cells = rows * columns;
        let mut bank = PsfBank {
            field_radius_mm,
            grid: rows,
            pitch_um: axes.pitch_um,
            values: Vec::with_capacity(order.len() * CHANNELS * cells),
            illumination: Vec::with_capacity(order.len() * CHANNELS),
        };
        for (field, colour) in
            order.iter().flat_map(|field| colours.iter().map(move |colour| (field, colour)))
        {
            let psf = field * wavelengths + colour;
            bank.values.extend(self.values[psf * cells..][..cells].iter().map(|value| *value as f32));
            bank.illumination.push(self.illumination[psf] as f32);
        }
        bank.validate().map_err(|e| fault("values", "", e.to_string(), "divide each PSF by its sum"))?;
        Ok(bank)
    }

    /// Where the points of a rectilinear scene land, if field angles and the scale of the image are known.
    pub fn distortion(&self) -> Result<Option<Distortion>, PsfFault> {
        let axes = &self.axes;
        let (Some(scale_mm), false) = (axes.image_scale_mm, axes.field_deg.is_empty()) else {
            return Ok(None);
        };
        if let Some(wide) = axes.field_deg.iter().find(|deg| deg.abs() > WIDEST_PICTURE_DEG) {
            let message = "a rectilinear picture of a scene ends before 90 degrees";
            let hint = "leave distortion out, so that the picture lies on the image as it is";
            return Err(fault("field_deg", wide, message, hint));
        }
        let (order, image_mm) = self.fields_outwards();
        if image_mm.len() < 2 {
            return Ok(None);
        }
        let ideal = |field: &usize| snapped(scale_mm * axes.field_deg[*field].abs().to_radians().tan());
        Distortion::new(image_mm, order.iter().map(ideal).collect()).map(Some).map_err(|e| {
            let hint = "image radii grow with the field; leave image_scale_mm out if they do not";
            fault("field_deg", "", e.to_string(), hint)
        })
    }

    /// The fields in the order of their image radii, and the radii, mm.
    fn fields_outwards(&self) -> (Vec<usize>, Vec<f64>) {
        let radii = &self.axes.field_radius_mm;
        let mut order: Vec<usize> = (0..radii.len()).collect();
        order.sort_by(|a, b| radii[*a].total_cmp(&radii[*b]));
        let ascending = order.iter().map(|field| snapped(radii[*field])).collect();
        (order, ascending)
    }

    /// The wavelengths that stand for red, green and blue.
    fn colours(&self) -> Result<[usize; CHANNELS], PsfFault> {
        let axes = &self.axes;
        if !axes.channels.is_empty() {
            let of = |wanted: Channel| axes.channels.iter().position(|channel| *channel == wanted);
            if let [Some(red), Some(green), Some(blue)] = Channel::RGB.map(of) {
                return Ok([red, green, blue]);
            }
            let hint = "write [\"red\", \"green\", \"blue\"], in the order of the array";
            return Err(fault("channels", "", "a colour is missing", hint));
        }
        match self.shape[1] {
            1 => Ok([0; CHANNELS]),
            CHANNELS if axes.wavelengths_um.len() == CHANNELS => {
                let mut order = [0, 1, 2];
                order.sort_by(|a, b| axes.wavelengths_um[*b].total_cmp(&axes.wavelengths_um[*a]));
                Ok(order)
            }
            CHANNELS => Ok([0, 1, 2]),
            other => {
                let message = format!("{other} wavelengths, and a camera has three colours");
                let hint = "take one wavelength or three, or name three `channels`";
                Err(fault("values", format!("{:?}", self.shape), message, hint))
            }
        }
    }
}
