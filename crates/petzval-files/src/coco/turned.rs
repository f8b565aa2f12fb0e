//! Boxes of pictures that an EXIF orientation rotates or mirrors.
//!
//! The boxes of a file refer either to the stored pixels or to the upright picture. Two things decide which: the key `turned`, or a stated
//! picture size that fits only one of them.

use image::metadata::Orientation;

use super::bounds::Bounds;
use crate::picture_file::PictureHead;

/// The pixel grid to which the boxes of a picture refer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BoxesOf {
    /// The picture the right way up.
    Upright,
    /// The pixels as they are stored, which are to be turned.
    Stored,
    /// One of the two.
    Unknown,
    /// A picture of another size.
    Other,
}

/// Finds the grid to which boxes refer, from the key of their file and from the picture size that it states (columns and rows, px). `None`
/// for what the file does not state.
pub(super) fn boxes_of(head: &PictureHead, says_turned: Option<bool>, stated: Option<(u32, u32)>) -> BoxesOf {
    let is = |size: (u32, u32)| stated.is_none_or(|stated| stated == size);
    if head.orientation == Orientation::NoTransforms {
        return if is(head.stored) { BoxesOf::Upright } else { BoxesOf::Other };
    }
    match (says_turned, is(head.upright()), is(head.stored)) {
        (None, true, true) => BoxesOf::Unknown,
        (Some(true), true, _) | (None, true, false) => BoxesOf::Upright,
        (Some(false), _, true) | (None, false, true) => BoxesOf::Stored,
        _ => BoxesOf::Other,
    }
}

/// Bounds in stored pixels, turned with the picture.
pub(super) fn turned(bounds: Bounds, head: &PictureHead) -> Bounds {
    let Bounds { x, y, width, height } = bounds;
    let (columns, rows) = (f64::from(head.stored.0), f64::from(head.stored.1));
    // Distances of the box from the right and the lower edge.
    let (right, bottom) = (columns - x - width, rows - y - height);
    let (x, y) = match head.orientation {
        Orientation::NoTransforms => (x, y),
        Orientation::FlipHorizontal => (right, y),
        Orientation::Rotate180 => (right, bottom),
        Orientation::FlipVertical => (x, bottom),
        Orientation::Rotate90FlipH => (y, x),
        Orientation::Rotate90 => (bottom, x),
        Orientation::Rotate270FlipH => (bottom, right),
        Orientation::Rotate270 => (y, right),
    };
    let (width, height) = if head.lies_on_its_side() { (height, width) } else { (width, height) };
    Bounds { x, y, width, height }
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, GrayImage, Luma};

    use super::*;

    fn head(stored: (u32, u32), exif: u8) -> PictureHead {
        let orientation = Orientation::from_exif(exif).unwrap();
        PictureHead { stored, orientation, file_bytes: 0, sample_bytes: 0, decoding_bytes: 0 }
    }

    /// A bright rectangle is found where its box says, whichever way the picture is turned.
    #[test]
    fn boxes_turn_with_the_pixels() {
        let (columns, rows) = (7, 5);
        let bounds = Bounds::from([1.0, 2.0, 3.0, 2.0]);
        let inside = |x: u32, y: u32| (1..4).contains(&x) && (2..4).contains(&y);
        let stored = GrayImage::from_fn(columns, rows, |x, y| Luma([if inside(x, y) { 255 } else { 0 }]));
        for exif in 1..=8 {
            let head = head((columns, rows), exif);
            let mut picture = DynamicImage::from(stored.clone());
            picture.apply_orientation(head.orientation);
            assert_eq!((picture.width(), picture.height()), head.upright());
            let Bounds { x, y, width, height } = turned(bounds, &head);
            for (column, row, pixel) in picture.to_luma8().enumerate_pixels() {
                let (across, down) = (f64::from(column) + 0.5, f64::from(row) + 0.5);
                let is_in_box = (x..x + width).contains(&across) && (y..y + height).contains(&down);
                assert_eq!(pixel[0] == 255, is_in_box, "orientation {exif}, pixel {column}, {row}");
            }
        }
    }

    #[test]
    fn the_stated_size_says_to_what_boxes_belong() {
        let of = |stored, exif, stated| boxes_of(&head(stored, exif), None, stated);
        assert_eq!(of((40, 30), 1, Some((40, 30))), BoxesOf::Upright);
        assert_eq!(of((40, 30), 1, None), BoxesOf::Upright);
        assert_eq!(of((40, 30), 1, Some((30, 40))), BoxesOf::Other);
        assert_eq!(of((40, 30), 6, Some((30, 40))), BoxesOf::Upright);
        assert_eq!(of((40, 30), 6, Some((40, 30))), BoxesOf::Stored);
        assert_eq!(of((40, 30), 6, Some((41, 30))), BoxesOf::Other);
        for (stored, exif, stated) in
            [((40, 30), 6, None), ((40, 30), 3, Some((40, 30))), ((30, 30), 8, Some((30, 30)))]
        {
            assert_eq!(of(stored, exif, stated), BoxesOf::Unknown, "orientation {exif}");
            let said = |turned| boxes_of(&head(stored, exif), Some(turned), stated);
            assert_eq!((said(true), said(false)), (BoxesOf::Upright, BoxesOf::Stored));
        }
        assert_eq!(boxes_of(&head((40, 30), 6), Some(true), Some((40, 30))), BoxesOf::Other);
    }
}
