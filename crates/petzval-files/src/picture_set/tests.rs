//! Pictures of folders, lists and shards are the same pictures.

use std::fs;
use std::path::PathBuf;

use petzval_camera::image::LinearImage;
use tempfile::TempDir;

use super::*;
use crate::png_bytes;

/// A PNG of `height` x `width` pixels of one gray.
fn png(height: usize, width: usize, gray: f32) -> Vec<u8> {
    png_bytes(&LinearImage::filled(3, height, width, gray)).unwrap()
}

fn tar_of(path: &Path, members: &[(&str, Vec<u8>)]) {
    let mut builder = tar::Builder::new(fs::File::create(path).unwrap());
    for (name, bytes) in members {
        let mut header = tar::Header::new_gnu();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        builder.append_data(&mut header, name, bytes.as_slice()).unwrap();
    }
    builder.finish().unwrap();
}

fn names(place: &Path) -> Vec<String> {
    stored_pictures(place).unwrap().into_iter().map(|picture| picture.name).collect()
}

#[test]
fn a_folder_a_list_and_shards_hold_the_same_pictures() {
    let root = TempDir::new().unwrap();
    let folder = root.path().join("folder");
    fs::create_dir(&folder).unwrap();
    let pictures = [("b.png", png(4, 6, 0.2)), ("a.png", png(5, 3, 0.4)), ("c.PNG", png(2, 2, 0.6))];
    for (name, bytes) in &pictures {
        fs::write(folder.join(name), bytes).unwrap();
    }
    fs::write(folder.join("notes.txt"), "none").unwrap();
    let list = root.path().join("train.txt");
    fs::write(&list, "\u{feff}# a comment\nfolder/b.png\r\n\n  folder/a.png\nfolder/c.PNG").unwrap();
    let shard = root.path().join("one.tar");
    let more = [("x/b.json", b"{}".to_vec()), ("x/b.seg.png", png(4, 6, 0.9)), ("x/.hidden.png", vec![1])];
    let members: Vec<(&str, Vec<u8>)> =
        pictures.iter().map(|(name, bytes)| (*name, bytes.clone())).chain(more).collect();
    tar_of(&shard, &members);
    assert_eq!(names(&folder), ["a.png", "b.png", "c.PNG"]);
    assert_eq!(names(&list), ["folder/b.png", "folder/a.png", "folder/c.PNG"]);
    assert_eq!(names(&shard), ["b.png", "a.png", "c.PNG"]);
    for place in [&folder, &list, &shard] {
        for picture in stored_pictures(place).unwrap() {
            let plain = pictures.iter().find(|(name, _)| picture.name.ends_with(name)).unwrap();
            let light = picture.load().unwrap().light;
            assert_eq!(picture.bytes().unwrap(), plain.1);
            assert_eq!(picture.size().unwrap(), [light.height, light.width]);
            assert_eq!(light, crate::load_image_bytes(&plain.1, "it").unwrap().light);
            assert_eq!(picture.stamp().unwrap().bytes, plain.1.len() as u64);
            let whole: [u8; 32] = sha2::Digest::finalize(sha2::Digest::chain_update(
                <sha2::Sha256 as sha2::Digest>::new(),
                &plain.1,
            ))
            .into();
            assert_eq!(picture.digest().unwrap(), whole);
        }
    }
    // A folder of shards: names tell from which.
    let shards = root.path().join("shards");
    fs::create_dir(&shards).unwrap();
    tar_of(&shards.join("1.tar"), &[("a.png", png(2, 2, 0.1))]);
    tar_of(&shards.join("0.tar"), &[("a.png", png(2, 2, 0.2))]);
    assert_eq!(names(&shards), ["0.tar/a.png", "1.tar/a.png"]);
}

#[test]
fn ends_tell_files_of_one_length_apart() {
    let root = TempDir::new().unwrap();
    let file = |name: &str, change: Option<usize>| {
        let mut bytes = vec![7_u8; 20_000];
        change.into_iter().for_each(|at| bytes[at] = 8);
        let path = root.path().join(name);
        fs::write(&path, bytes).unwrap();
        StoredPicture::file(path)
    };
    let [plain, same, first, last, middle] =
        [("a", None), ("b", None), ("c", Some(4095)), ("d", Some(15_904)), ("e", Some(10_000))]
            .map(|(name, at)| file(name, at));
    let ends = |picture: &StoredPicture| picture.digest_of_ends().unwrap();
    assert_eq!(ends(&plain), ends(&same));
    assert!(ends(&plain) != ends(&first) && ends(&plain) != ends(&last));
    assert_eq!(ends(&plain), ends(&middle), "only the whole digest tells these apart");
    assert_ne!(plain.digest().unwrap(), middle.digest().unwrap());
}

#[test]
fn what_is_no_set_of_pictures_is_refused_with_its_place() {
    let root = TempDir::new().unwrap();
    let refused = |name: &str, bytes: &[u8]| -> String {
        let path: PathBuf = root.path().join(name);
        fs::write(&path, bytes).unwrap();
        stored_pictures(&path).unwrap_err().to_string()
    };
    fs::write(root.path().join("a.png"), png(2, 2, 0.5)).unwrap();
    let missing = refused("list.txt", b"a.png\n\nnone.png\n");
    assert!(missing.contains("line 3") && missing.contains("none.png"), "{missing}");
    assert!(refused("twice.txt", b"a.png\na.png\n").contains("there twice"));
    fs::create_dir(root.path().join("inner")).unwrap();
    for other in ["./a.png", "inner/../a.png"] {
        let spelt = refused("spelt.txt", format!("a.png\n{other}\n").as_bytes());
        assert!(spelt.contains(&format!("\"a.png\" and {other:?} are one file; hint: ")), "{spelt}");
    }
    assert!(refused("bytes.txt", b"a.png\n\xff\xfe\n").contains("line 2"));
    assert!(refused("one.png", &png(2, 2, 0.5)).contains("this is one picture; name its folder"));
    assert!(refused("empty.txt", b"# nothing\n").contains("a list with one path a line"));
    assert!(refused("no.tar", &[1; 2000]).contains("cannot be read as a tar file"));
    let shard = root.path().join("two.tar");
    tar_of(&shard, &[("a.png", png(2, 2, 0.5)), ("a.jpg", png(2, 2, 0.5))]);
    assert!(stored_pictures(&shard).unwrap_err().to_string().contains("one stem"));
    // A shard that was cut off in its last member.
    tar_of(&shard, &[("a.png", png(2, 2, 0.5)), ("b.png", png(300, 200, 0.5))]);
    let bytes = fs::read(&shard).unwrap();
    let cut = refused("cut.tar", &bytes[..1024 + 512 + 300]);
    assert!(cut.contains("cut.tar") && (cut.contains("cut off") || cut.contains("cannot be read")), "{cut}");
}

#[cfg(unix)]
#[test]
fn broken_links_are_pictures_that_cannot_be_read() {
    let root = TempDir::new().unwrap();
    fs::write(root.path().join("a.png"), png(4, 6, 0.2)).unwrap();
    std::os::unix::fs::symlink(root.path().join("a.png"), root.path().join("b.png")).unwrap();
    std::os::unix::fs::symlink(root.path().join("gone.png"), root.path().join("c.png")).unwrap();
    fs::create_dir(root.path().join("inner")).unwrap();
    std::os::unix::fs::symlink(root.path().join("inner"), root.path().join("d.png")).unwrap();
    assert_eq!(names(root.path()), ["a.png", "b.png", "c.png"]);
    let pictures = stored_pictures(root.path()).unwrap();
    let sizes = check_stored(&pictures, &CheckedPictures::default(), &|_| Ok(())).unwrap();
    assert!(sizes[..2].iter().all(|size| *size == Ok((6, 4))), "{sizes:?}");
    assert!(
        sizes[2].as_ref().is_err_and(|unread| unread.is_unopened && unread.message.contains("c.png")),
        "{sizes:?}"
    );
}
