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
    /// anchor. Places are whole multiples of the stride, the power of two by which the map is smaller: sides that are no multiple of it give
    /// maps that are rounded up.
    pub fn of_level(&self, level: usize, map: [usize; 2], picture: [usize; 2]) -> Vec<BBox> {
        let cell = self.around_origin(level);
        let stride: [f32; 2] =
            std::array::from_fn(|i| (picture[i] as f32 / map[i] as f32).log2().round().exp2());
        let places = (0..map[0]).flat_map(|row| (0..map[1]).map(move |column| [row, column]));
        let at = |[row, column]: [usize; 2]| [column as f32 * stride[1], row as f32 * stride[0]];
        places.flat_map(|place| cell.iter().map(move |anchor| anchor.moved(at(place)))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_lie_on_the_places_of_maps_that_were_rounded_up() {
        let anchors = Anchors { sizes: vec![vec![32.0]], aspect_ratios: vec![1.0] };
        // 1080 rows and 100 columns give maps of 68 and 7 at a sixteenth of the resolution.
        let all = anchors.of_level(0, [68, 7], [1080, 100]);
        assert_eq!(all.len(), 68 * 7);
        assert_eq!(all[67 * 7 + 6].centre(), [96.0, 1072.0]);
    }
}
