//! What the Earth's air does to light: how much of it there is, and which way it scatters.
//!
//! Rayleigh scattering by air, Mie scattering by haze, absorption by ozone,
//! with the coefficients of Bruneton and Neyret (2008) as Hillaire (2020) gives them.

/// Three numbers, one for each of red, green and blue.
pub(crate) type Colour = [f64; 3];

/// Radius of the ground that the air lies on, metres.
pub(crate) const GROUND: f64 = 6_360_000.0;

/// Height at which the air ends, metres.
pub(crate) const TOP: f64 = 100_000.0;

/// Rayleigh scattering at the ground, per metre.
const RAYLEIGH: Colour = [5.802e-6, 13.558e-6, 33.1e-6];

/// Height over which air thins by a factor of e, metres.
const RAYLEIGH_HEIGHT: f64 = 8_000.0;

/// Scattering by clear-day haze at the ground, per metre.
const HAZE: f64 = 3.996e-6;

/// Extinction by haze over its scattering: a tenth is absorbed.
const HAZE_EXTINCTION: f64 = 1.11;

/// Height over which haze thins by a factor of e, metres.
const HAZE_HEIGHT: f64 = 1_200.0;

/// Absorption by ozone where it is densest, per metre.
const OZONE: Colour = [0.650e-6, 1.881e-6, 0.085e-6];

/// Height of the densest ozone, and half the depth of its layer, metres.
const OZONE_HEIGHT: f64 = 25_000.0;
const OZONE_DEPTH: f64 = 15_000.0;

/// How strongly haze scatters forwards.
const FORWARDS: f64 = 0.76;

/// Multiples of the Earth's air.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Air {
    /// Of its gases.
    pub(crate) rayleigh: f64,
    /// Of its clear-day haze.
    pub(crate) haze: f64,
}

/// Amounts of air passed through, in metres of the densest.
#[derive(Clone, Copy, Default, PartialEq, Debug)]
pub(crate) struct Depth {
    /// Gases.
    pub(crate) rayleigh: f64,
    /// Haze.
    pub(crate) haze: f64,
    /// Ozone.
    pub(crate) ozone: f64,
}

impl Depth {
    /// The densities at a height, as shares of the greatest.
    pub(crate) fn density(height: f64) -> Self {
        let height = if height > 0.0 { height } else { 0.0 };
        let off = (height - OZONE_HEIGHT).abs() / OZONE_DEPTH;
        Self {
            rayleigh: libm::exp(-height / RAYLEIGH_HEIGHT),
            haze: libm::exp(-height / HAZE_HEIGHT),
            ozone: if off < 1.0 { 1.0 - off } else { 0.0 },
        }
    }

    /// This and `length` metres at `density`.
    pub(crate) fn and(self, density: Self, length: f64) -> Self {
        Self {
            rayleigh: self.rayleigh + density.rayleigh * length,
            haze: self.haze + density.haze * length,
            ozone: self.ozone + density.ozone * length,
        }
    }

    /// This one, `share` of the way to another.
    pub(crate) fn mixed(self, other: Self, share: f64) -> Self {
        self.and(self, -share).and(other, share)
    }
}

impl Air {
    /// The share of light that is left after passing through that much.
    pub(crate) fn transmitted(&self, depth: Depth) -> Colour {
        [0, 1, 2].map(|c| {
            let optical = self.rayleigh * (RAYLEIGH[c] * depth.rayleigh + OZONE[c] * depth.ozone)
                + self.haze * HAZE * HAZE_EXTINCTION * depth.haze;
            libm::exp(-optical)
        })
    }

    /// Light scattered per metre by gases, as a share, over all directions.
    pub(crate) fn rayleigh_scattering(&self, density: Depth) -> Colour {
        RAYLEIGH.map(|scattering| scattering * self.rayleigh * density.rayleigh)
    }

    /// The same by haze.
    pub(crate) fn haze_scattering(&self, density: Depth) -> f64 {
        HAZE * self.haze * density.haze
    }
}

/// The density of Rayleigh scattering per steradian, by the cosine of the angle of deflection.
pub(crate) fn rayleigh_phase(cosine: f64) -> f64 {
    3.0 / (16.0 * core::f64::consts::PI) * (1.0 + cosine * cosine)
}

/// The density of scattering by haze per steradian: Cornette and Shanks (1992).
pub(crate) fn haze_phase(cosine: f64) -> f64 {
    const G: f64 = FORWARDS;
    let base = 1.0 + G * G - 2.0 * G * cosine;
    3.0 / (8.0 * core::f64::consts::PI) * (1.0 - G * G) * (1.0 + cosine * cosine)
        / ((2.0 + G * G) * base * base.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scattered_light_is_all_of_it() {
        for phase in [rayleigh_phase, haze_phase] {
            const STEPS: i32 = 20_000;
            let total: f64 = (0..STEPS)
                .map(|i| {
                    let cosine = (f64::from(i) + 0.5) / f64::from(STEPS) * 2.0 - 1.0;
                    phase(cosine) * core::f64::consts::TAU * 2.0 / f64::from(STEPS)
                })
                .sum();
            assert!((total - 1.0).abs() < 1e-4, "{total}");
        }
    }

    #[test]
    fn blue_is_lost_first_and_nothing_is_gained() {
        let air = Air {
            rayleigh: 1.0,
            haze: 1.0,
        };
        let far = Depth::default().and(Depth::density(0.0), 50_000.0);
        let left = air.transmitted(far);
        assert!(left[0] > left[1] && left[1] > left[2] && left[2] > 0.0 && left[0] < 1.0);
        assert_eq!(air.transmitted(Depth::default()), [1.0; 3]);
    }
}
