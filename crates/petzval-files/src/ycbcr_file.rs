//! Pictures of luma and colour differences: Y4M (YUV4MPEG2) and bare planes.

use petzval_camera::isp::{Chroma, Range, YcbcrPicture};
use y4m::{Colorspace, Frame, Ratio, VendorExtensionString};

/// The bytes of a Y4M file of one picture: a line of text with size, chroma and range, then the planes.
///
/// 4:2:0 of 8 bits is `C420mpeg2`: colour differences on the left columns, halfway between two rows. The format has no word for the standard of
/// luma, and none for the place of colour differences of 10 bits.
pub fn y4m_bytes(picture: &YcbcrPicture) -> Result<Vec<u8>, y4m::Error> {
    let format = picture.format;
    let colours = match (format.chroma, format.bits) {
        (Chroma::Every, 8) => Colorspace::C444,
        (Chroma::HalfWidth, 8) => Colorspace::C422,
        (Chroma::HalfBoth, 8) => Colorspace::C420mpeg2,
        (Chroma::Every, _) => Colorspace::C444p10,
        (Chroma::HalfWidth, _) => Colorspace::C422p10,
        (Chroma::HalfBoth, _) => Colorspace::C420p10,
    };
    let range = match format.range {
        Range::Full => "COLORRANGE=FULL",
        Range::Limited => "COLORRANGE=LIMITED",
    };
    let mut bytes = Vec::new();
    let planes = picture.planes.each_ref().map(|plane| plane_bytes(plane, format.bits));
    y4m::encode(picture.width, picture.height, Ratio::new(25, 1))
        .with_colorspace(colours)
        .append_vendor_extension(VendorExtensionString::new(range.into())?)
        .write_header(&mut bytes)?
        .write_frame(&Frame::new(planes.each_ref().map(Vec::as_slice), None))?;
    Ok(bytes)
}

/// The planes Y, Cb and Cr one after the other: a byte for each value of 8 bits, two for others, the lower one first.
pub fn yuv_bytes(picture: &YcbcrPicture) -> Vec<u8> {
    picture.planes.iter().flat_map(|plane| plane_bytes(plane, picture.format.bits)).collect()
}

fn plane_bytes(plane: &[u16], bits: u32) -> Vec<u8> {
    match bits {
        8 => plane.iter().map(|v| *v as u8).collect(),
        _ => plane.iter().flat_map(|v| v.to_le_bytes()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use petzval_camera::isp::{RgbPicture, Standard, YcbcrFormat};

    use super::*;

    fn picture(chroma: Chroma, range: Range, bits: u32) -> YcbcrPicture {
        let (height, width) = (6, 9);
        let data = (0..3 * height * width).map(|i| (i * 397 % 65536) as u16).collect();
        let format = YcbcrFormat { standard: Standard::Bt709, range, chroma, bits };
        RgbPicture { height, width, bits: 16, data }.to_ycbcr(format).unwrap()
    }

    #[test]
    fn a_reader_finds_size_format_and_planes() {
        for (chroma, range, bits, named) in [
            (Chroma::HalfBoth, Range::Limited, 8, "W9 H6 F25:1 XCOLORRANGE=LIMITED C420mpeg2\n"),
            (Chroma::HalfWidth, Range::Full, 8, "W9 H6 F25:1 XCOLORRANGE=FULL C422\n"),
            (Chroma::HalfBoth, Range::Limited, 10, "W9 H6 F25:1 XCOLORRANGE=LIMITED C420p10\n"),
            (Chroma::Every, Range::Full, 10, "W9 H6 F25:1 XCOLORRANGE=FULL C444p10\n"),
        ] {
            let picture = picture(chroma, range, bits);
            let bytes = y4m_bytes(&picture).unwrap();
            assert!(bytes.starts_with(format!("YUV4MPEG2 {named}FRAME\n").as_bytes()), "{named}");
            let mut reader = y4m::decode(bytes.as_slice()).unwrap();
            assert_eq!(
                (reader.get_width(), reader.get_height(), reader.get_bit_depth()),
                (9, 6, bits as usize)
            );
            let frame = reader.read_frame().unwrap();
            let read = [frame.get_y_plane(), frame.get_u_plane(), frame.get_v_plane()];
            for (read, plane) in read.into_iter().zip(&picture.planes) {
                assert_eq!(read, plane_bytes(plane, bits));
            }
            assert!(bytes.ends_with(&yuv_bytes(&picture)));
        }
    }
}
