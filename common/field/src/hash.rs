//! The one integer hash: of the noise's lattice and of every keyed random number.
//!
//! It is *lowbias32*, the two-round multiply–xorshift permutation that Chris
//! Wellons's hash prospector searches, with the constants of least known bias
//! (0.108): `x ^= x >> 16; x *= 0x21f0aaad; x ^= x >> 15; x *= 0xd35a2d97;
//! x ^= x >> 15`. Several words are absorbed one after another through its
//! first round, and its second round finishes; the last word so passes through
//! exactly lowbias32, earlier ones through more. It never changes: pixels depend on it.

/// The state before the first word.
const START: u32 = 0x9e37_79b9;

/// The state after `word`: the first round over their sum. A permutation of `word`.
#[inline(always)]
pub(crate) const fn absorb(state: u32, word: u32) -> u32 {
    let t = state.wrapping_add(word);
    (t ^ (t >> 16)).wrapping_mul(0x21f0_aaad)
}

/// The second round without its last xorshift, which leaves the upper fifteen bits as they are.
#[inline(always)]
pub(crate) const fn finish_high(state: u32) -> u32 {
    (state ^ (state >> 15)).wrapping_mul(0xd35a_2d97)
}

/// The state after the first word, a key.
#[inline(always)]
pub(crate) const fn start(key: u32) -> u32 {
    absorb(START, key)
}

/// The hash of the words, in order.
///
/// ```
/// use field::hash::{hash, unit};
/// let random = unit(hash(&[7, 0, 319, 239, 0, 1]));
/// assert!((0.0..1.0).contains(&random));
/// ```
#[inline(always)]
pub const fn hash(words: &[u32]) -> u32 {
    let mut state = START;
    let mut at = 0;
    while at < words.len() {
        state = absorb(state, words[at]);
        at += 1;
    }
    let t = finish_high(state);
    t ^ (t >> 15)
}

/// `hash` as a number in [0, 1), a multiple of 2⁻³².
#[inline(always)]
pub fn unit(hash: u32) -> f64 {
    f64::from(hash) * (1.0 / 4_294_967_296.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The permutation as its author writes it.
    fn lowbias32(mut x: u32) -> u32 {
        x ^= x >> 16;
        x = x.wrapping_mul(0x21f0_aaad);
        x ^= x >> 15;
        x = x.wrapping_mul(0xd35a_2d97);
        x ^ (x >> 15)
    }

    #[test]
    fn one_word_is_lowbias32() {
        for word in [0, 1, 2, 0x8000_0000, u32::MAX, 12_345_678] {
            assert_eq!(hash(&[word]), lowbias32(START.wrapping_add(word)));
        }
    }

    #[test]
    fn test_vectors_never_move() {
        let seen = [
            hash(&[]),
            hash(&[0]),
            hash(&[1]),
            hash(&[0, 0]),
            hash(&[1, 2, 3, 4]),
            hash(&[u32::MAX; 6]),
        ];
        let known = [
            0x9ede_c16e,
            0xc463_1032,
            0xfe2c_5772,
            0xd71a_bc0a,
            0x37df_01ba,
            0x77f8_3093,
        ];
        assert_eq!(seen, known);
    }

    #[test]
    fn every_input_bit_turns_every_output_bit_half_of_the_time() {
        const WORDS: usize = 4;
        const SAMPLES: u32 = 4096;
        for word in 0..WORDS {
            for bit in 0..32 {
                let mut turned = [0u32; 32];
                for sample in 0..SAMPLES {
                    let mut words = [
                        sample,
                        3,
                        sample.wrapping_mul(0x9e37),
                        0u32.wrapping_sub(sample),
                    ];
                    let before = hash(&words);
                    words[word] ^= 1 << bit;
                    let change = before ^ hash(&words);
                    for (out, count) in turned.iter_mut().enumerate() {
                        *count += (change >> out) & 1;
                    }
                }
                for count in turned {
                    let share = f64::from(count) / f64::from(SAMPLES);
                    assert!(
                        (0.4..0.6).contains(&share),
                        "word {word} bit {bit}: {share}"
                    );
                }
            }
        }
    }
}
