//! File names of the held-out pictures of a run, and which of them stand for all.

use super::RunFolder;

/// First and last bytes of a whole PNG file: its signature, and its last chunk with the checksum.
const PNG_ENDS: [&[u8]; 2] = [b"\x89PNG\r\n\x1a\n", b"IEND\xaeB\x60\x82"];

/// File name of a state of picture `index`: `truth`, or `developed` and `output` of a camera.
pub fn file_name(index: usize, state: &str, camera: Option<&str>) -> String {
    match camera {
        Some(camera) => format!("{index:02}-{camera}-{state}.png"),
        None => format!("{index:02}-{state}.png"),
    }
}

/// File name of a whole frame: that of a camera, or the scene as it lies on the sensor.
pub fn whole_name(camera: Option<&str>) -> String {
    camera.map_or_else(|| "whole.png".to_owned(), |camera| format!("whole-{camera}.png"))
}

/// The bytes of a picture; none of a file that is missing, cut short, or no PNG.
pub(crate) fn whole_png(run: &RunFolder, file: &str) -> Option<Vec<u8>> {
    let bytes = petzval_base::read_whole(run.picture(file)).ok()?;
    let [first, last] = PNG_ENDS;
    (bytes.starts_with(first) && bytes.ends_with(last)).then_some(bytes)
}

/// Indices of at most `most` pictures, which are ordered by photograph and then by place: spread evenly over the photographs, with the places
/// in turn.
pub fn spread_pictures(photographs: usize, places: usize, most: usize) -> Vec<usize> {
    let shown = (photographs * places).min(most);
    let place = |i: usize| if places > shown { i * places / shown } else { i % places };
    (0..shown).map(|i| i * photographs / shown * places + place(i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn many_pictures_are_chosen_evenly_and_few_are_all_shown() {
        assert_eq!(spread_pictures(3, 9, 27), (0..27).collect::<Vec<_>>());
        assert_eq!(spread_pictures(2, 1, 27), [0, 1]);
        for (photographs, places) in [(50, 9), (5, 9), (200, 1), (1, 100), (4, 9)] {
            let shown = spread_pictures(photographs, places, 27);
            assert_eq!(shown.len(), (photographs * places).min(27));
            let distinct =
                |of: &dyn Fn(usize) -> usize| shown.iter().map(|i| of(*i)).collect::<BTreeSet<_>>().len();
            assert_eq!(distinct(&|i| i), shown.len(), "each once");
            assert_eq!(distinct(&|i| i / places), photographs.min(27), "every photograph, or as many as fit");
            assert_eq!(distinct(&|i| i % places), places.min(27), "every place");
            assert!(shown.iter().all(|i| *i < photographs * places));
        }
    }
}
