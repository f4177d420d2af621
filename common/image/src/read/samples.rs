//! Samples in the type in which a file stores them.

use std::fmt;

use half::f16;

/// How one sample is stored.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SampleKind {
    /// 8-bit code.
    U8,
    /// 16-bit code.
    U16,
    /// 32-bit unsigned integer.
    U32,
    /// 16-bit floating point.
    F16,
    /// 32-bit floating point.
    F32,
}

impl SampleKind {
    /// Its name as people write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint",
            Self::F16 => "half",
            Self::F32 => "float",
        }
    }

    /// Bytes of one sample.
    pub const fn bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::F16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

impl fmt::Display for SampleKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A run of samples.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Samples {
    U8(Vec<u8>),
    U16(Vec<u16>),
    U32(Vec<u32>),
    F16(Vec<f16>),
    F32(Vec<f32>),
}

impl Samples {
    pub(crate) fn kind(&self) -> SampleKind {
        match self {
            Self::U8(_) => SampleKind::U8,
            Self::U16(_) => SampleKind::U16,
            Self::U32(_) => SampleKind::U32,
            Self::F16(_) => SampleKind::F16,
            Self::F32(_) => SampleKind::F32,
        }
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Self::U8(samples) => samples.len(),
            Self::U16(samples) => samples.len(),
            Self::U32(samples) => samples.len(),
            Self::F16(samples) => samples.len(),
            Self::F32(samples) => samples.len(),
        }
    }

    /// A sample's value; exact for every kind.
    pub(crate) fn value(&self, index: usize) -> f64 {
        match self {
            Self::U8(samples) => f64::from(samples[index]),
            Self::U16(samples) => f64::from(samples[index]),
            Self::U32(samples) => f64::from(samples[index]),
            Self::F16(samples) => f64::from(samples[index]),
            Self::F32(samples) => f64::from(samples[index]),
        }
    }

    /// A sample's bits, so that NaNs and signed zeros can be told apart.
    pub(crate) fn bits(&self, index: usize) -> u32 {
        match self {
            Self::U8(samples) => u32::from(samples[index]),
            Self::U16(samples) => u32::from(samples[index]),
            Self::U32(samples) => samples[index],
            Self::F16(samples) => u32::from(samples[index].to_bits()),
            Self::F32(samples) => samples[index].to_bits(),
        }
    }

    /// Appends row `y` of rows of `width`, little-endian.
    pub(crate) fn row_bytes(&self, y: usize, width: usize, out: &mut Vec<u8>) {
        let row = y * width..(y + 1) * width;
        match self {
            Self::U8(samples) => out.extend_from_slice(&samples[row]),
            Self::U16(samples) => out.extend(samples[row].iter().flat_map(|s| s.to_le_bytes())),
            Self::U32(samples) => out.extend(samples[row].iter().flat_map(|s| s.to_le_bytes())),
            Self::F16(samples) => out.extend(samples[row].iter().flat_map(|s| s.to_le_bytes())),
            Self::F32(samples) => out.extend(samples[row].iter().flat_map(|s| s.to_le_bytes())),
        }
    }

    /// Every `step`-th sample from `first` on.
    pub(crate) fn every(&self, first: usize, step: usize) -> Self {
        fn pick<T: Copy>(samples: &[T], first: usize, step: usize) -> Vec<T> {
            samples.iter().skip(first).step_by(step).copied().collect()
        }
        match self {
            Self::U8(samples) => Self::U8(pick(samples, first, step)),
            Self::U16(samples) => Self::U16(pick(samples, first, step)),
            Self::U32(samples) => Self::U32(pick(samples, first, step)),
            Self::F16(samples) => Self::F16(pick(samples, first, step)),
            Self::F32(samples) => Self::F32(pick(samples, first, step)),
        }
    }

    /// Samples of 8 bits, or of 16 bits stored big-endian, as PNG and PPM have them.
    pub(crate) fn from_be_bytes(kind: SampleKind, bytes: Vec<u8>) -> Self {
        match kind {
            SampleKind::U8 => Self::U8(bytes),
            _ => Self::U16(
                bytes
                    .chunks_exact(2)
                    .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
                    .collect(),
            ),
        }
    }
}
