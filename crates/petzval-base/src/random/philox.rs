//! Philox4x32-10: random numbers as a function of a counter and a key.
//!
//! Ten rounds of multiplications mix a 128-bit counter under a 64-bit key. There is no state, so any number of any stream
//! can be computed directly, in any order and on any thread. Source: Salmon, Moraes, Dror and Shaw, "Parallel random
//! numbers: as easy as 1, 2, 3", SC 2011, which also reports that the generator passes TestU01's BigCrush.

const MULTIPLIER: [u64; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const LOW: u64 = 0xFFFF_FFFF;

/// The four random 32-bit words of a counter, as two 64-bit words (first word in the low half).
#[inline(always)]
pub(super) fn philox4x32(counter: [u32; 4], key: [u32; 2]) -> [u64; 2] {
    let [mut c0, mut c1, mut c2, mut c3] = counter.map(u64::from);
    let [mut k0, mut k1] = key;
    for _ in 0..10 {
        // Only the low halves count: the next product masks the high halves of c1 and c3.
        let (p0, p1) = (MULTIPLIER[0] * (c0 & LOW), MULTIPLIER[1] * (c2 & LOW));
        (c0, c1) = ((p1 >> 32) ^ c1 ^ k0 as u64, p1);
        (c2, c3) = ((p0 >> 32) ^ c3 ^ k1 as u64, p0);
        (k0, k1) = (k0.wrapping_add(WEYL[0]), k1.wrapping_add(WEYL[1]));
    }
    [c0 & LOW | c1 << 32, c2 & LOW | c3 << 32]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn output_matches_the_known_answers_of_random123() {
        // Known-answer vectors of the authors' library Random123: counter, key, result.
        let vectors: [([u32; 4], [u32; 2], [u32; 4]); 3] = [
            ([0; 4], [0; 2], [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]),
            ([u32::MAX; 4], [u32::MAX; 2], [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]),
            (
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0],
                [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
            ),
        ];
        for (counter, key, expected) in vectors {
            let [a, b] = philox4x32(counter, key);
            assert_eq!([a as u32, (a >> 32) as u32, b as u32, (b >> 32) as u32], expected);
        }
    }
}
