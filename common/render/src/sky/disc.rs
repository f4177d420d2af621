//! The sun as it is seen: its disc, and the glow that haze spreads closely around it.

use core::f64::consts::PI;

use super::air::Colour;

/// Angular radius of the sun from the Earth's distance, radians: 0.2666°.
const RADIUS: f64 = 0.004_653;

/// How much darker the limb is, red to blue: the coefficients of I(μ)/I(1) = 1 − u(1 − μ), after
/// Allen's *Astrophysical quantities*.
const LIMB: Colour = [0.52, 0.62, 0.76];

/// How strongly the largest droplets of haze scatter forwards: Henyey and Greenstein's g.
const FORWARDS: f64 = 0.985;

/// The share of sunlight that they scatter for a haze of 1, from the limb outwards to some degrees.
const GLOW: f64 = 0.012;

/// Radiance of sun and glow for sunlight of irradiance 1, at an angle of that cosine to its centre.
///
/// Over the disc it adds up to 1, whatever the channel; the glow comes on top.
pub(super) fn radiance(cosine: f64, haze: f64) -> Colour {
    if cosine <= 0.0 {
        return [0.0; 3];
    }
    let glow = haze * GLOW * henyey_greenstein(cosine);
    // sin² of the angle: the cosine itself has no digits left so near to 1.
    let off = (1.0 - cosine) * (1.0 + cosine) / (RADIUS * RADIUS);
    if off >= 1.0 {
        return [glow; 3];
    }
    let inward = (1.0 - off).sqrt();
    LIMB.map(|u| {
        // The mean of 1 − u(1 − μ) over the disc is 1 − u/3.
        let mean = 1.0 / (PI * RADIUS * RADIUS * (1.0 - u / 3.0));
        glow + mean * (1.0 - u * (1.0 - inward))
    })
}

/// Henyey and Greenstein's density of scattering per steradian.
fn henyey_greenstein(cosine: f64) -> f64 {
    const G: f64 = FORWARDS;
    let base = 1.0 + G * G - 2.0 * G * cosine;
    (1.0 - G * G) / (4.0 * PI * base * base.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disc_sends_all_sunlight_and_the_glow_its_share() {
        for (haze, wanted) in [(0.0, 1.0), (2.0, 1.0 + 2.0 * GLOW)] {
            let mut total = [0.0; 3];
            let mut from = 0.0;
            // Rings, fine within the disc and wider outside, out to a right angle.
            while from < PI / 2.0 {
                let width = if from < 2.0 * RADIUS {
                    RADIUS / 500.0
                } else {
                    from / 400.0
                };
                let angle: f64 = from + width / 2.0;
                let light = radiance(libm::cos(angle), haze);
                for c in 0..3 {
                    total[c] += light[c] * 2.0 * PI * libm::sin(angle) * width;
                }
                from += width;
            }
            for total in total {
                // The glow's last percent falls beyond the right angle.
                assert!((total / wanted - 1.0).abs() < 4e-3, "{total} {wanted}");
            }
        }
    }

    #[test]
    fn the_limb_is_darker_and_redder_than_the_centre_and_the_sky_behind_is_dark() {
        let (centre, limb) = (radiance(1.0, 0.0), radiance(libm::cos(RADIUS * 0.97), 0.0));
        assert!(limb[1] < 0.7 * centre[1]);
        assert!(limb[2] / centre[2] < limb[0] / centre[0]);
        assert_eq!(radiance(libm::cos(RADIUS * 1.03), 0.0), [0.0; 3]);
        assert_eq!(radiance(-1.0, 1.0), [0.0; 3]);
    }
}
