//! Which pictures may have the same file.

use std::collections::HashMap;
use std::hash::Hash;

use petzval_base::{Cancel, Cancelled};
use rayon::prelude::*;

use super::StoredPicture;

/// SHA-256 of the files of those pictures that another one may equal: which has as many bytes, and the same first and last ones. None of the
/// others, whose files are not read as a whole, and of those that cannot be read.
pub fn digests_of_alike(
    pictures: &[Option<&StoredPicture>],
    cancel: &Cancel,
) -> Result<Vec<Option<[u8; 32]>>, Cancelled> {
    let alike = (0..pictures.len()).collect();
    let alike = shared(alike, cancel, &|i| Some(pictures[i]?.stamp().ok()?.bytes))?;
    let alike = shared(alike, cancel, &|i| pictures[i]?.digest_of_ends().ok())?;
    let digest = |i: &usize| {
        cancel.check()?;
        Ok((*i, pictures[*i].and_then(|picture| picture.digest().ok())))
    };
    let mut digests = vec![None; pictures.len()];
    for (i, digest) in alike.par_iter().map(digest).collect::<Result<Vec<_>, Cancelled>>()? {
        digests[i] = digest;
    }
    Ok(digests)
}

/// Those of some values, by their number, that share a figure with another one.
fn shared<K: Hash + Eq + Send>(
    numbers: Vec<usize>,
    cancel: &Cancel,
    of: &(dyn Fn(usize) -> Option<K> + Sync),
) -> Result<Vec<usize>, Cancelled> {
    let figure = |i: &usize| {
        cancel.check()?;
        Ok(of(*i))
    };
    let figures = numbers.par_iter().map(figure).collect::<Result<Vec<Option<K>>, Cancelled>>()?;
    let mut counts: HashMap<&K, usize> = HashMap::new();
    figures.iter().flatten().for_each(|figure| *counts.entry(figure).or_default() += 1);
    let is_shared = |figure: &Option<K>| figure.as_ref().is_some_and(|figure| counts[figure] > 1);
    Ok(numbers.into_iter().zip(&figures).filter(|(_, figure)| is_shared(figure)).map(|(i, _)| i).collect())
}
