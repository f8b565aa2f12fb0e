//! Anchors: boxes of fixed sizes and shapes at every place of a feature map, from which proposals are predicted.

use super::BBox;

/// Sizes and shapes of anchors, one set of sizes for each level of the pyramid.
#[derive(Clone, Debug, PartialEq)]
pub struct Anchors {
    /// Sides of square anchors, pixels, by level.
    pub sizes: Vec<Vec<f32>>,
    /// Height over width.
    pub aspect_ratios: Vec<f32>,
}

impl Anchors {
    /// Anchors at each place of a level.
    pub fn per_place(&self, level: usize) -> usize {
        self.sizes[level].len() * self.aspect_ratios.len()
    }

    /// The anchors around the origin: `height = size sqrt(ratio)`, `width = size / sqrt(ratio)`, halved and rounded to whole pixels
    /// (half to even). The aspect ratio is the outer loop, the size the inner one.
    pub fn around_origin(&self, level: usize) -> Vec<BBox> {
        let sizes = &self.sizes[level];
        let shapes = self.aspect_ratios.iter().flat_map(|ratio| sizes.iter().map(move |size| (ratio, size)));
        let of_shape = |(ratio, size): (&f32, &f32)| {
            let tall = ratio.sqrt();
            let (width, height) =
                ((size / tall / 2.0).round_ties_even(), (size * tall / 2.0).round_ties_even());
            BBox::new(-width, -height, width, height)
        };
        shapes.map(of_shape).collect()
    }

    /// All anchors of a level whose feature map has this height and width, in a picture of this height and width: by row, column and
    /// anchor. Places are whole multiples of the stride, which is rounded down.
    pub fn of_level(&self, level: usize, map: [usize; 2], picture: [usize; 2]) -> Vec<BBox> {
        let cell = self.around_origin(level);
        let stride = [picture[0] / map[0], picture[1] / map[1]];
        let places = (0..map[0]).flat_map(|row| (0..map[1]).map(move |column| [row, column]));
        let at = |[row, column]: [usize; 2]| [(column * stride[1]) as f32, (row * stride[0]) as f32];
        places.flat_map(|place| cell.iter().map(move |anchor| anchor.moved(at(place)))).collect()
    }
}
