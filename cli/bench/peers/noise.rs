//! Points per second of gradient noise: ours, and crates' where this program was built with them.
//!
//! Every side evaluates the same points, far enough apart to lie in cells of their own. Sums are fBm of 8 octaves,
//! lacunarity 2, gain ½. Libraries that only answer single points are asked for one after the other.

use field::hash::{hash, unit};
use field::{Points, Program, Scratch, SimdLevel};

use super::pairs::{Reason, compile};
use super::rows::Library;

/// Points of one evaluation.
pub(crate) const POINTS: usize = 4096;

/// Points lie in a cube this wide, in lattice cells.
const WIDTH: f64 = 400.0;

/// Noise of so many octaves.
pub(crate) fn program(octaves: u32) -> Result<Program, Reason> {
    match octaves {
        1 => compile("noise(p)"),
        octaves => compile(&format!(
            "fbm(p, #{{octaves: {octaves}, hurst: 1, lacunarity: 2, detail: 0}})"
        )),
    }
}

/// Coordinates of the points along one axis.
fn column(axis: u32) -> Vec<f64> {
    (0..4096)
        .map(|point| WIDTH * unit(hash(&[point, axis])))
        .collect()
}

/// A field's values at the points.
pub(crate) fn value(program: &Program, level: SimdLevel) {
    Batch::with(|batch| {
        let Batch {
            columns: [x, y, z],
            zero,
            scratch,
            value,
            ..
        } = batch;
        let points = Points {
            x,
            y,
            z,
            footprint: zero,
            time: zero,
        };
        program.evaluate(level, &points, scratch, &mut [value]);
        std::hint::black_box(value);
    });
}

/// A field's values and gradients at the points.
pub(crate) fn gradient(program: &Program, level: SimdLevel) {
    Batch::with(|batch| {
        let Batch {
            columns: [x, y, z],
            zero,
            scratch,
            value,
            gradient: [gx, gy, gz],
        } = batch;
        let points = Points {
            x,
            y,
            z,
            footprint: zero,
            time: zero,
        };
        program.evaluate_gradient(level, &points, scratch, value, [gx, gy, gz]);
        std::hint::black_box((value, gx));
    });
}

/// The points, and room for what is evaluated there.
struct Batch {
    columns: [Vec<f64>; 3],
    zero: Vec<f64>,
    scratch: Scratch,
    value: Vec<f64>,
    gradient: [Vec<f64>; 3],
}

thread_local! {
    static BATCH: std::cell::RefCell<Batch> = std::cell::RefCell::new(Batch {
        columns: [column(0), column(1), column(2)],
        zero: vec![0.0; POINTS],
        scratch: Scratch::new(),
        value: vec![0.0; POINTS],
        gradient: [(); 3].map(|()| vec![0.0; POINTS]),
    });
}

impl Batch {
    fn with(what: impl FnOnce(&mut Self)) {
        BATCH.with_borrow_mut(what);
    }
}

/// What a library is called.
pub(crate) fn called(library: Library) -> &'static str {
    match library {
        Library::FastNoiseLite => "fastnoise-lite (f32)",
        Library::Noise => "noise (f64)",
        Library::LibNoise => "libnoise (f64)",
    }
}

/// A library's noise at the points.
#[cfg(feature = "peers")]
pub(crate) fn peer(library: Library, octaves: u32) -> Result<Box<dyn FnMut()>, Reason> {
    use fastnoise_lite::{FastNoiseLite, FractalType, NoiseType};
    use libnoise::{Generator as _, ImprovedPerlin, Source};
    use noise::{Fbm, MultiFractal as _, NoiseFn, Perlin};

    let [x, y, z] = [column(0), column(1), column(2)];
    let places: Vec<[f64; 3]> = (0..POINTS).map(|i| [x[i], y[i], z[i]]).collect();
    /// Asks for one point after the other.
    fn each<P: 'static, V: 'static>(
        places: Vec<P>,
        at: impl Fn(&P) -> V + 'static,
    ) -> Box<dyn FnMut()> {
        Box::new(move || {
            for place in &places {
                std::hint::black_box(at(place));
            }
        })
    }
    let whole = |octaves: u32| octaves as usize;
    Ok(match library {
        Library::FastNoiseLite => {
            let mut noise = FastNoiseLite::with_seed(1);
            noise.set_noise_type(Some(NoiseType::Perlin));
            noise.set_frequency(Some(1.0));
            if octaves > 1 {
                noise.set_fractal_type(Some(FractalType::FBm));
                noise.set_fractal_octaves(i32::try_from(octaves).ok());
            }
            #[expect(
                clippy::cast_possible_truncation,
                reason = "the library's own precision"
            )]
            let places = places
                .into_iter()
                .map(|place| place.map(|part| part as f32))
                .collect();
            each(places, move |&[x, y, z]: &[f32; 3]| {
                noise.get_noise_3d(x, y, z)
            })
        }
        Library::Noise if octaves == 1 => {
            let noise = Perlin::new(1);
            each(places, move |&place| noise.get(place))
        }
        Library::Noise => {
            let noise = Fbm::<Perlin>::new(1)
                .set_octaves(whole(octaves))
                .set_frequency(1.0)
                .set_lacunarity(2.0)
                .set_persistence(0.5);
            each(places, move |&place| noise.get(place))
        }
        Library::LibNoise => {
            let noise: ImprovedPerlin<3> = Source::improved_perlin(1);
            if octaves == 1 {
                each(places, move |&place| noise.sample(place))
            } else {
                let noise = noise.fbm(octaves, 1.0, 2.0, 0.5);
                each(places, move |&place| noise.sample(place))
            }
        }
    })
}

/// A library's noise at the points.
#[cfg(not(feature = "peers"))]
pub(crate) fn peer(_: Library, _: u32) -> Result<Box<dyn FnMut()>, Reason> {
    Err(super::NOT_BUILT.to_owned())
}
