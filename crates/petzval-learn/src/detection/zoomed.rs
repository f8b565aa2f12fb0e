//! A digital zoom in front of a detector.

use burn::prelude::*;
use petzval_base::Cancel;

use super::{Detection, Detector, Object, Truth};
use crate::loss::{LossError, NamedLoss};
use crate::network::resized;

/// A detector that looks at enlarged (or reduced) pictures. Objects are as large for it as through a lens of another focal length,
/// without the detail that such a lens would show: the control for a lens whose focal length is free.
pub struct Zoomed<D> {
    detector: D,
    zoom: Zoom,
}

/// By how much pictures are enlarged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Zoom {
    /// So many times.
    Times(f64),
    /// Until the shorter side has `shorter` pixels, or the longer one `longer` if that is less, rounded down, as the transform of torchvision's
    /// detectors does (800 and 1333 there).
    ToSides {
        /// Pixels of the shorter side.
        shorter: usize,
        /// Most pixels of the longer side.
        longer: usize,
    },
}

impl Zoom {
    /// Rows and columns of an enlarged picture.
    fn of(self, sides: [usize; 2]) -> [usize; 2] {
        match self {
            Self::Times(zoom) => sides.map(|side| (zoom * side as f64).round().max(1.0) as usize),
            Self::ToSides { shorter, longer } => {
                let [short, long] = [sides[0].min(sides[1]), sides[0].max(sides[1])].map(|side| side as f64);
                let zoom = (shorter as f64 / short).min(longer as f64 / long);
                // A product that is whole but for its rounding is not rounded down.
                sides.map(|side| (zoom * side as f64 + 1e-6).max(1.0) as usize)
            }
        }
    }
}

impl<D: Detector> Zoomed<D> {
    /// A detector that sees enlarged pictures. Boxes are in pixels of the pictures as they were.
    pub fn new(detector: D, zoom: Zoom) -> Self {
        Self { detector, zoom }
    }

    /// The enlarged pictures, and by how much they are really enlarged along x and y: their sides are whole pixels.
    fn enlarged(&self, pictures: Tensor<4>) -> (Tensor<4>, [f32; 2]) {
        let [_, _, height, width] = pictures.dims();
        let to = self.zoom.of([height, width]);
        (resized(pictures, to), enlargement([height, width], to))
    }
}

/// By how much pictures of this height and width are enlarged along x and y to get those sides.
fn enlargement([height, width]: [usize; 2], to: [usize; 2]) -> [f32; 2] {
    [to[1] as f32 / width as f32, to[0] as f32 / height as f32]
}

/// The truths of enlarged pictures.
fn scaled(truths: &[Truth], by: [f32; 2]) -> Vec<Truth> {
    let object = |o: &Object| Object { bbox: o.bbox.scaled(by), ..*o };
    let truth = |t: &Truth| Truth {
        objects: t.objects.iter().map(object).collect(),
        ignored: t.ignored.iter().map(|region| region.with_box(region.bbox.scaled(by))).collect(),
        beside: t.beside.iter().map(object).collect(),
    };
    truths.iter().map(truth).collect()
}

impl<D: Detector> Detector for Zoomed<D> {
    fn look(&self, pictures: Tensor<4>) -> Vec<Tensor<4>> {
        self.detector.look(self.enlarged(pictures).0)
    }

    fn loss_of_look(
        &self,
        look: Vec<Tensor<4>>,
        picture: [usize; 2],
        truths: &[Truth],
        seed: u64,
    ) -> Result<NamedLoss, LossError> {
        let to = self.zoom.of(picture);
        self.detector.loss_of_look(look, to, &scaled(truths, enlargement(picture, to)), seed)
    }

    fn detect_unless(&self, cancel: &Cancel, pictures: Tensor<4>) -> Result<Vec<Vec<Detection>>, LossError> {
        let (enlarged, by) = self.enlarged(pictures);
        let back = by.map(|factor| 1.0 / factor);
        let mut found = self.detector.detect_unless(cancel, enlarged)?;
        found.iter_mut().flatten().for_each(|d| d.bbox = d.bbox.scaled(back));
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Device;
    use crate::detection::BBox;

    /// Detects what is brighter than a half, and records the size of its input picture.
    struct Bright;

    impl Detector for Bright {
        fn look(&self, pictures: Tensor<4>) -> Vec<Tensor<4>> {
            vec![pictures]
        }

        fn loss_of_look(
            &self,
            look: Vec<Tensor<4>>,
            _: [usize; 2],
            truths: &[Truth],
            _: u64,
        ) -> Result<NamedLoss, LossError> {
            let sum = truths.iter().flat_map(|t| &t.objects).map(|o| f64::from(o.bbox.area())).sum();
            Ok(NamedLoss { total: look[0].clone().mean(), parts: vec![("total", sum)] })
        }

        fn detect_unless(&self, _: &Cancel, pictures: Tensor<4>) -> Result<Vec<Vec<Detection>>, LossError> {
            let [_, _, height, width] = pictures.dims();
            let data = pictures.into_data().try_to_vec::<f32>().unwrap();
            let bright: Vec<(f32, f32)> = (0..height * width)
                .filter(|i| data[*i] > 0.5)
                .map(|i| ((i % width) as f32, (i / width) as f32))
                .collect();
            let end = |of: &dyn Fn(&(f32, f32)) -> f32, fold: fn(f32, f32) -> f32, from| {
                bright.iter().map(of).fold(from, fold)
            };
            let bbox = BBox::new(
                end(&|p| p.0, f32::min, f32::MAX),
                end(&|p| p.1, f32::min, f32::MAX),
                end(&|p| p.0 + 1.0, f32::max, 0.0),
                end(&|p| p.1 + 1.0, f32::max, 0.0),
            );
            Ok(vec![vec![Detection { bbox, class: 0, score: 1.0 }]])
        }
    }

    #[test]
    fn boxes_are_in_pixels_of_the_picture_before_the_zoom() {
        let device = Device::flex();
        // A bright rectangle of 12 x 8 pixels at (10, 20) of 40 x 60.
        let is_bright = |i: usize| (10..22).contains(&(i % 60)) && (20..28).contains(&(i / 60 % 40));
        let data = (0..3 * 40 * 60).map(|i| f32::from(u8::from(is_bright(i)))).collect::<Vec<f32>>();
        let picture = Tensor::from_data(TensorData::new(data, [1, 3, 40, 60]), &device);
        let truth = Truth {
            objects: vec![Object { bbox: BBox::new(10.0, 20.0, 22.0, 28.0), class: 0 }],
            ..Truth::default()
        };
        for zoom in [0.5, 1.25, 2.0] {
            let zoomed = Zoomed::new(Bright, Zoom::Times(zoom));
            let found = zoomed.detect(picture.clone()).unwrap()[0][0].bbox;
            for (found, wanted) in [(found.x1, 10.0), (found.y1, 20.0), (found.x2, 22.0), (found.y2, 28.0)] {
                assert!((found - wanted).abs() <= 0.51 / zoom as f32, "{zoom}: {found} {wanted}");
            }
            let loss = zoomed.loss(picture.clone(), std::slice::from_ref(&truth), 0).unwrap();
            let area = loss.parts[0].1;
            assert!((area / (96.0 * zoom * zoom) - 1.0).abs() < 0.01, "{zoom}: {area}");
        }
    }

    #[test]
    fn pictures_get_the_sides_that_torchvision_gives_them() {
        let to_sides = Zoom::ToSides { shorter: 800, longer: 1333 };
        // Its `GeneralizedRCNNTransform`: 800 over the shorter side, or 1333 over the longer one.
        for (from, to) in [
            ([480, 640], [800, 1066]),
            ([640, 480], [1066, 800]),
            ([100, 400], [333, 1333]),
            ([1200, 1920], [800, 1280]),
            ([1080, 1920], [749, 1333]),
            ([800, 800], [800, 800]),
        ] {
            assert_eq!(to_sides.of(from), to, "{from:?}");
        }
    }
}
