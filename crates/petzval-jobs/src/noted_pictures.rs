//! Pictures that a job reads from files, with warnings of what these files say that is not obeyed.

use std::path::Path;

use petzval_camera::image::LinearImage;
use petzval_files::{ImageError, load_image};

use crate::context::Context;
use crate::event::WarningKind;
use crate::noted::Noted;

/// Reads the pictures of a job. When it goes out of scope it warns of what their files say that is not obeyed, once for each kind of
/// statement with a count: no caller can leave that out.
pub(crate) struct NotedPictures<'c>(Noted<'c>);

impl<'c> NotedPictures<'c> {
    /// A reader that has read nothing yet.
    pub fn new(context: &'c Context) -> Self {
        Self(Noted::new(context, "picture"))
    }

    /// The linear light of a picture, three planes, 1 = white; see [`load_image`].
    pub fn light(&self, path: &Path) -> Result<LinearImage, ImageError> {
        let picture = load_image(path)?;
        for note in picture.notes {
            self.0.warning(path.display(), WarningKind::Picture, note);
        }
        Ok(picture.light)
    }

    /// Adds a note on a picture, which is reported like the warnings.
    pub fn note(&self, path: &Path, text: String) {
        self.0.note(path.display(), text);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use petzval_files::save_exr;

    use super::*;
    use crate::event::Lines;

    #[test]
    fn what_files_say_is_a_warning_for_each_kind_once_all_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let lines = Arc::new(Lines::default());
        let context = Context::new(crate::built_in_assets(), lines.clone());
        let pictures = NotedPictures::new(&context);
        for (name, negative) in [("a", 1), ("b", 0), ("c", 3), ("d", 5)] {
            let mut light = LinearImage::filled(3, 2, 4, 0.5);
            light.data[..negative].fill(-0.25);
            let path = folder.path().join(format!("{name}.exr"));
            save_exr(&light, &path).unwrap();
            assert_eq!(pictures.light(&path).unwrap().data[..negative], vec![0.0; negative]);
        }
        assert!(pictures.light(&folder.path().join("none.exr")).is_err());
        assert!(lines.0.lock().unwrap().is_empty());
        drop(pictures);
        let said = lines.0.lock().unwrap().clone();
        assert_eq!(said.len(), 1, "{said:?}");
        let wanted =
            "a.exr and 2 other pictures: 1 of its 24 values are negative, down to -0.25, and taken as 0";
        assert!(said[0].ends_with(wanted), "{said:?}");
    }
}
