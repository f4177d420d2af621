//! From light to a display: the one fixed transform that PNG and PPM frames go through.
//!
//! It is the same for every frame, so that frames do not flicker: an exposure, a shoulder, the
//! sRGB transfer function (IEC 61966-2-1). The shoulder is that of the Khronos PBR Neutral tone
//! mapper (2024): what is darker than [`SHOULDER`] stays as it is, brighter light is compressed
//! by a hyperbola on the largest of the three channels and then mixed towards white. Scaling all
//! channels by one factor keeps the hue, which curves per channel (Hable's, Reinhard's) do not:
//! they turn an orange sun yellow and a blue sky cyan. Departures: no offset for reflections at
//! normal incidence, and the shoulder begins at 0.4 instead of 0.8, since light outdoors has a
//! wider range than a product on a table. Middle grey, 0.18, passes unchanged: code 118 of 255.

/// Light up to here is shown as it is: a little over one stop above middle grey.
const SHOULDER: f64 = 0.4;

/// How fast compressed light loses its colour, as published.
const DESATURATION: f64 = 0.15;

/// Exposures further from 0 than this are refused.
pub(crate) const STOPS_MAX: f64 = 64.0;

/// How light becomes the colours of a PNG or PPM frame.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct ViewTransform {
    /// The light is multiplied by two to this power; from −64 to 64.
    pub exposure_stops: f64,
}

impl ViewTransform {
    /// Whether the exposure is a usable number.
    pub(crate) fn is_usable(self) -> bool {
        self.exposure_stops.is_finite() && self.exposure_stops.abs() <= STOPS_MAX
    }

    /// The transform made ready for codes from 0 to `top`.
    pub(crate) fn prepare(self, top: u16) -> Display {
        Display {
            scale: libm::exp2(self.exposure_stops),
            quantiser: Quantiser::new(top),
        }
    }
}

/// A view transform with its tables, for one number of codes.
#[derive(Debug)]
pub(crate) struct Display {
    scale: f64,
    quantiser: Quantiser,
}

impl Display {
    /// The codes of a pixel. Negative light counts as none.
    pub(crate) fn codes(&self, rgb: [f32; 3]) -> [u16; 3] {
        shoulder(rgb.map(|value| f64::from(value) * self.scale))
            .map(|value| self.quantiser.code(value))
    }
}

/// Compresses finite light into 0 to 1, keeping its hue.
fn shoulder(rgb: [f64; 3]) -> [f64; 3] {
    let rgb = rgb.map(|value| if value > 0.0 { value } else { 0.0 });
    let peak = rgb
        .iter()
        .copied()
        .fold(0.0, |a: f64, b| if b > a { b } else { a });
    if peak <= SHOULDER {
        return rgb;
    }
    let room = 1.0 - SHOULDER;
    let compressed = 1.0 - room * room / (peak + room - SHOULDER);
    let white = 1.0 - 1.0 / (DESATURATION * (peak - compressed) + 1.0);
    let factor = compressed / peak;
    rgb.map(|value| {
        let scaled = value * factor;
        scaled + (compressed - scaled) * white
    })
}

/// Rounds linear light from 0 to 1 to the nearest sRGB code, by thresholds instead of a power per
/// sample.
#[derive(Debug)]
struct Quantiser {
    /// `thresholds[k]` is the least light of code `k + 1`.
    thresholds: Vec<f64>,
    /// For each of equal steps of light, the code at its beginning.
    first: Vec<u16>,
}

impl Quantiser {
    fn new(top: u16) -> Self {
        let thresholds: Vec<f64> = (0..top)
            .map(|code| linear((f64::from(code) + 0.5) / f64::from(top)))
            .collect();
        // As many steps as codes, and some: near black, where the curve is steepest (12.92), a
        // step then spans a handful of codes.
        let steps = 4 * (usize::from(top) + 1);
        let mut code = 0;
        let first = (0..=steps)
            .map(|step| {
                let light = step as f64 / steps as f64;
                while code < top && thresholds[usize::from(code)] <= light {
                    code += 1;
                }
                code
            })
            .collect();
        Self { thresholds, first }
    }

    fn code(&self, light: f64) -> u16 {
        let steps = self.first.len() - 1;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "light is from 0 to 1 up to rounding, and the result is limited"
        )]
        let step = ((light * steps as f64) as usize).min(steps);
        let mut code = self.first[step];
        while self
            .thresholds
            .get(usize::from(code))
            .is_some_and(|threshold| *threshold <= light)
        {
            code += 1;
        }
        code
    }
}

/// The light that a display shows for a signal from 0 to 1: the inverse of sRGB's transfer function.
fn linear(signal: f64) -> f64 {
    if signal <= 0.04045 {
        signal / 12.92
    } else {
        libm::pow((signal + 0.055) / 1.055, 2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// sRGB's transfer function, the way round that the tables avoid.
    fn signal(light: f64) -> f64 {
        if light <= 0.003_130_8 {
            light * 12.92
        } else {
            1.055 * libm::pow(light, 1.0 / 2.4) - 0.055
        }
    }

    #[test]
    fn the_tables_round_to_the_nearest_code() {
        for top in [255_u16, 65535] {
            let quantiser = Quantiser::new(top);
            for step in 0..=200_000_u32 {
                let light = f64::from(step) / 200_000.0;
                let exact = signal(light) * f64::from(top);
                let code = f64::from(quantiser.code(light));
                assert!(
                    (code - exact).abs() <= 0.5 + 2e-3,
                    "{light}: {code} {exact}"
                );
            }
            assert_eq!((quantiser.code(0.0), quantiser.code(1.0)), (0, top));
        }
    }

    #[test]
    fn middle_grey_is_middle_grey() {
        let display = ViewTransform::default().prepare(255);
        assert_eq!(display.codes([0.18; 3]), [118; 3]);
        let brighter = ViewTransform {
            exposure_stops: 1.0,
        }
        .prepare(255);
        assert_eq!(brighter.codes([0.09; 3]), [118; 3]);
    }

    #[test]
    fn no_light_is_black_and_endless_light_is_white() {
        let display = ViewTransform::default().prepare(65535);
        assert_eq!(display.codes([0.0, -0.0, -5.0]), [0; 3]);
        assert_eq!(display.codes([f32::MAX, 0.0, 0.0]), [65535; 3]);
    }

    proptest! {
        #[test]
        fn more_light_is_never_darker(
            rgb in prop::array::uniform3(0.0_f32..50.0),
            stops in -10.0_f64..10.0,
            more in 0.0_f64..3.0,
        ) {
            let codes = |exposure_stops| ViewTransform { exposure_stops }.prepare(255).codes(rgb);
            let (dark, bright) = (codes(stops), codes(stops + more));
            prop_assert!(dark.iter().zip(bright).all(|(dark, bright)| *dark <= bright));
        }

        /// The order of the channels, which is the hue's sextant, is kept.
        #[test]
        fn the_strongest_channel_stays_the_strongest(rgb in prop::array::uniform3(0.0_f32..1e4)) {
            let codes = ViewTransform::default().prepare(65535).codes(rgb);
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                if rgb[a] <= rgb[b] {
                    prop_assert!(codes[a] <= codes[b]);
                }
            }
        }
    }
}
