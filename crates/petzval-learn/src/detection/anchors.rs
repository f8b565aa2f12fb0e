//! Anchors: boxes of fixed sizes and shapes at every place of a feature map, from which proposals are predicted.

use serde::Serialize;

use super::BBox;

/// Sizes and shapes of anchors, one set of sizes for each level of the pyramid.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    /// anchor. Places are whole multiples of the stride, the quotient of both sizes, rounded down. It is a power of two but on the coarsest level,
    /// where maps may be rounded up: torchvision puts anchors closer there than the places that see them.
    pub fn of_level(&self, level: usize, map: [usize; 2], picture: [usize; 2]) -> Vec<BBox> {
        let cell = self.around_origin(level);
        let stride: [f32; 2] = std::array::from_fn(|i| (picture[i] / map[i].max(1)) as f32);
        let places = (0..map[0]).flat_map(|row| (0..map[1]).map(move |column| [row, column]));
        let at = |[row, column]: [usize; 2]| [column as f32 * stride[1], row as f32 * stride[0]];
        places.flat_map(|place| cell.iter().map(move |anchor| anchor.moved(at(place)))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strides_are_whole_quotients() {
        let anchors = Anchors { sizes: vec![vec![32.0]], aspect_ratios: vec![1.0] };
        let all = anchors.of_level(0, [68, 8], [1088, 128]);
        assert_eq!(all.len(), 68 * 8);
        assert_eq!(all[67 * 8 + 7].centre(), [112.0, 1072.0]);
        // 800 rows have 25 places at a 32nd of the resolution, and 13 at half of that: 800 / 13 is 61.5.
        assert_eq!(anchors.of_level(0, [13, 1], [800, 64])[12].centre(), [0.0, 12.0 * 61.0]);
    }
}
