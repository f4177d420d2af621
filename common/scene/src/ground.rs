//! Whether the camera keeps out of the ground, looked up at every image over its shutter.

use field::{Graph, NodeId, Points, Program, Scratch, SimdLevel};

use crate::bound::time_of;
use crate::description::{Bound, Description, GreatCircle, Path};
use crate::rules::Problem;
use crate::vector::{Vector, direction, length, scale};

/// Most instants that are looked at; beyond it images are skipped evenly.
const INSTANTS_MAX: u32 = 20_000;

/// Steps by which a root is first looked for below the camera.
const STEPS: u32 = 32;

/// Halvings of a step after that: from kilometres to well below a millimetre.
const HALVINGS: u32 = 40;

/// What a valid description's camera runs into.
pub(crate) fn problems(scene: &Description) -> Vec<Problem> {
    let surface = &scene.surface;
    let Some(field) = Field::new(&surface.graph, surface.field, scene) else {
        return Vec::new();
    };
    let flight = scene.camera.flight();
    let times = instants(scene);
    let eyes: Vec<Vector> = times.iter().map(|&time| flight.pose(time).eye).collect();
    let values = field.at(&eyes, &times);
    if let (Path::GreatCircle(circle), Bound::Shell { inner, outer }) =
        (&scene.camera.path, surface.bound)
    {
        // From inside the ground its surface is looked for from above.
        let tops = eyes.iter().zip(&values).map(
            |(eye, value)| {
                if *value > 0.0 { length(*eye) } else { outer }
            },
        );
        let ground = ground_below(&field, inner, tops.collect(), &eyes, &times);
        return clearance(scene, circle, &ground, &eyes, &times)
            .into_iter()
            .collect();
    }
    let Some(inside) = values.iter().position(|value| *value <= 0.0) else {
        return Vec::new();
    };
    vec![Problem {
        key: path_key(&scene.camera.path).to_owned(),
        message: format!(
            "the camera is inside the surface at frame {}",
            frame(scene, times[inside])
        ),
        help: Some("move the eye to where the field is positive".into()),
    }]
}

fn path_key(path: &Path) -> &'static str {
    match path {
        Path::Fixed { .. } => "camera.fixed.eye",
        Path::Spline { .. } => "camera.spline.keys",
        Path::GreatCircle(_) => "camera.great_circle.altitude",
    }
}

/// The start and, with a shutter, the middle and end of every image.
fn instants(scene: &Description) -> Vec<f64> {
    let film = &scene.film;
    let parts = if film.shutter > 0.0 { 3 } else { 1 };
    let step = (film.images.saturating_mul(parts))
        .div_ceil(INSTANTS_MAX)
        .max(1);
    (0..film.images)
        .step_by(step as usize)
        .flat_map(|image| {
            let start = f64::from(image) / film.fps;
            (0..parts).map(move |part| start + film.shutter * f64::from(part) / 2.0)
        })
        .collect()
}

fn frame(scene: &Description, time: f64) -> f64 {
    // A shutter is shorter than an image's time, so this is the image that was open then.
    libm::floor(time * scene.film.fps + 1e-9)
}

/// The ground's distances from the centre, held to the clearance.
fn clearance(
    scene: &Description,
    circle: &GreatCircle,
    ground: &[f64],
    eyes: &[Vector],
    times: &[f64],
) -> Option<Problem> {
    let heights = eyes
        .iter()
        .zip(ground)
        .map(|(eye, ground)| length(*eye) - ground);
    let (worst, height) = heights.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
    if height > 0.0 && height >= circle.clearance {
        return None;
    }
    let (frame, highest) = (frame(scene, times[worst]), ground[worst] - circle.radius);
    let places = format!(
        "the ground is at {highest:.2} m, the camera at {} m",
        circle.altitude
    );
    let message = if height > 0.0 {
        let missing = circle.clearance - height;
        format!("the path passes {missing:.2} m under its clearance at frame {frame}: {places}")
    } else {
        format!("the path goes through the ground at frame {frame}: {places}")
    };
    let least = libm::ceil((highest + circle.clearance) * 10.0 + 1e-6) / 10.0;
    Some(Problem {
        key: "camera.great_circle.altitude".into(),
        message,
        help: Some(format!("raise the altitude to at least \"{least:.1} m\"")),
    })
}

/// Distances from the centre of the first ground met on the way down from the tops over or under the eyes.
fn ground_below(
    field: &Field,
    inner: f64,
    tops: Vec<f64>,
    eyes: &[Vector],
    times: &[f64],
) -> Vec<f64> {
    let downs: Vec<Vector> = eyes
        .iter()
        .map(|eye| direction(*eye).unwrap_or([0.0, 0.0, 1.0]))
        .collect();
    let at = |radii: &[f64]| {
        let places: Vec<_> = downs
            .iter()
            .zip(radii)
            .map(|(down, r)| scale(*down, *r))
            .collect();
        field.at(&places, times)
    };
    // `above` is outside, `below` inside the surface once it has been found.
    let (mut above, mut below) = (tops.clone(), vec![None; tops.len()]);
    for step in 1..=STEPS {
        let part = f64::from(step) / f64::from(STEPS);
        let radii: Vec<f64> = tops.iter().map(|top| top + (inner - top) * part).collect();
        for (index, value) in at(&radii).into_iter().enumerate() {
            if below[index].is_none() {
                if value <= 0.0 {
                    below[index] = Some(radii[index]);
                } else {
                    above[index] = radii[index];
                }
            }
        }
    }
    let mut below: Vec<f64> = below
        .into_iter()
        .map(|radius| radius.unwrap_or(inner))
        .collect();
    for _ in 0..HALVINGS {
        let middles: Vec<f64> = above
            .iter()
            .zip(&below)
            .map(|(a, b)| b + (a - b) / 2.0)
            .collect();
        for (index, value) in at(&middles).into_iter().enumerate() {
            if value <= 0.0 {
                below[index] = middles[index];
            } else {
                above[index] = middles[index];
            }
        }
    }
    below
}

/// A field with all its detail.
struct Field {
    program: Program,
}

impl Field {
    fn new(graph: &Graph, root: NodeId, scene: &Description) -> Option<Self> {
        let program = Program::compile(graph, &[root], time_of(scene)).ok()?;
        Some(Self { program })
    }

    fn at(&self, places: &[Vector], times: &[f64]) -> Vec<f64> {
        let axis = |k: usize| places.iter().map(|place| place[k]).collect::<Vec<_>>();
        let (x, y, z) = (axis(0), axis(1), axis(2));
        let footprint = vec![0.0; places.len()];
        let points = Points {
            x: &x,
            y: &y,
            z: &z,
            footprint: &footprint,
            time: times,
        };
        let mut values = vec![0.0; places.len()];
        let mut scratch = Scratch::new();
        self.program
            .evaluate(SimdLevel::best(), &points, &mut scratch, &mut [&mut values]);
        values
    }
}
