//! What mirror symmetry makes of a gradient.

use super::Sequence;
use crate::gradient::LensGradient;
use crate::number::Number;

impl LensGradient {
    /// Zeroes the derivatives that mirror symmetry cancels: the gradient of half a beam, whose mirror image has the opposite
    /// derivative by every number that breaks the symmetry.
    pub(crate) fn keep_symmetry(&mut self, sequence: &Sequence) {
        if !sequence.is_mirror_symmetric {
            return;
        }
        for (surface, s) in sequence.surfaces.iter().enumerate() {
            for number in Number::ALL.into_iter().filter(|n| n.breaks_mirror_symmetry(&s.shape)) {
                self[(surface, number)] = 0.0;
            }
        }
    }
}
