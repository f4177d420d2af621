//! Renders blocks of one image.

use core::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard, PoisonError};

use field::{BATCH, Interval, SimdLevel};
use glam::DVec3;
use model::{ImageNumber, Rect};
use scene::Description;

use crate::assets::Assets;
use crate::counts::Counts;
use crate::crew::{Alone, Crew, both};
use crate::error::{Cancelled, RenderError};
use crate::film::{Film, Seen};
use crate::grids;
use crate::places::Places;
use crate::sample::spline::FILTER_ORDER_MAX;
use crate::sample::strata::RAYS_MAX;
use crate::sample::{Draws, Order, Sample, Strata};
use crate::shade::light::{Lit, Lits};
use crate::shade::{Fields, Palette, Patch, mean_albedo};
use crate::sky::{Clouds, Crossing, Scanned, Sky};
use crate::times::{Clock, Part, Stopwatch, Times};
use crate::trace::surface::vertical;
use crate::trace::{Goal, Hit, Means, Ray, Surface, Technique, Tracer};
use crate::view::{Rows, Sight, View};

/// Samples that are worked on together, about: enough to fill batches, few enough for the cache.
const TOGETHER: usize = 8192;

/// Rays towards the sun start this share of a footprint above the surface.
const LIFT: f64 = 0.5;

/// How an image is computed; nothing here changes a pixel.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct EvalSettings {
    /// The instruction set of the evaluation; every one gives the same bits.
    pub level: SimdLevel,
    /// How rays find how far they may step; where not given, every image tries some rays by each means and takes the cheapest.
    pub means: Option<Means>,
}

impl Default for EvalSettings {
    /// The fastest level of this machine, and the means that each image finds cheapest.
    fn default() -> Self {
        Self {
            level: SimdLevel::best(),
            means: None,
        }
    }
}

/// One image, compiled: shared by any number of threads.
pub struct ImageRenderer {
    view: View,
    strata: Strata,
    surface: Surface,
    palette: Palette,
    sky: Sky,
    clouds: Option<Clouds>,
    shadows: bool,
    /// Parts of the shutter whose samples are followed together.
    slices: u32,
    /// Memory of blocks that are done, for those to come: no more than there are threads at it.
    spare: Mutex<Vec<Box<Work>>>,
}

impl ImageRenderer {
    /// Compiles image `image` of a scene: programs, bounds, tables of the sky; tries how its rays are traced fastest. Takes
    /// some ten milliseconds.
    pub fn new(
        description: &Description,
        assets: &Assets,
        image: ImageNumber,
        settings: EvalSettings,
    ) -> Result<Self, RenderError> {
        Self::prepared(&Alone, None, description, assets, image, settings)
    }

    /// The same by a crew, in less time.
    pub fn by(
        crew: &dyn Crew,
        description: &Description,
        assets: &Assets,
        image: ImageNumber,
        settings: EvalSettings,
    ) -> Result<Self, RenderError> {
        Self::prepared(crew, None, description, assets, image, settings)
    }

    /// The same, but a technique of the tracer is left out: the same pixels by more work, for measuring what it gains.
    pub fn without(
        technique: Option<Technique>,
        description: &Description,
        assets: &Assets,
        image: ImageNumber,
        settings: EvalSettings,
    ) -> Result<Self, RenderError> {
        Self::prepared(&Alone, technique, description, assets, image, settings)
    }

    fn prepared(
        crew: &dyn Crew,
        technique: Option<Technique>,
        description: &Description,
        assets: &Assets,
        image: ImageNumber,
        settings: EvalSettings,
    ) -> Result<Self, RenderError> {
        let film = &description.film;
        let sampling = &description.sampling;
        if image.0 >= film.images {
            return Err(RenderError::NoSuchImage {
                image,
                images: film.images,
            });
        }
        let (rays, order) = (sampling.rays, sampling.filter_order);
        if rays == 0 || rays > RAYS_MAX {
            return Err(RenderError::Rays { rays });
        }
        if order > FILTER_ORDER_MAX {
            return Err(RenderError::FilterOrder { order });
        }
        if order == 0 && rays != 1 {
            return Err(RenderError::CentreAlone { rays });
        }
        let attached = grids::attached(description, assets)?;
        let description = attached.as_ref();
        let start = f64::from(image.0) / film.fps;
        let view = View::new(&description.camera, film, start);
        let (start, end) = view.instants();
        let up = vertical(description.surface.seed, view.eye());
        let ground = mean_albedo(&description.surface.material);
        let (surface, sky) = both(
            crew,
            || Surface::prepared(crew, description, &view, settings, technique),
            || Sky::new(description, start, up, ground, crew),
        );
        let surface = surface?;
        let palette = Palette::new(description, assets, Interval::new(start, end))?;
        Ok(Self {
            strata: Strata::new(rays, order, description.key, image.0),
            // Where nothing moves, all instants are one.
            slices: if Technique::Slices.is_used(technique)
                && (view.travel() > 0.0 || surface.moves)
            {
                rays
            } else {
                1
            },
            sky,
            clouds: Clouds::new(description, view.eye(), Interval::new(start, end))?,
            view,
            surface,
            palette,
            shadows: description.sun.shadows,
            spare: Mutex::default(),
        })
    }

    /// By what means its rays are traced.
    pub fn means(&self) -> Means {
        self.surface.means
    }

    /// Most pixels that are worked on together. A larger block is cut into [halves](Rect::halves), and these again, until none
    /// is larger: such parts may as well be rendered as blocks of their own, by the same work. Smaller ones take longer for a pixel.
    pub fn together(&self) -> u64 {
        (TOGETHER / self.strata.per_pixel()).max(1) as u64
    }

    /// Renders the pixels of `block`, any rectangle of the image.
    ///
    /// `pixels` is cleared and filled plane by plane in the order of
    /// [`model::film::CHANNELS`], rows from the top, columns from the left. The values depend on scene, image
    /// and place alone, and all of them are finite. `cancel` is looked at every
    /// few thousand evaluations.
    pub fn render_block(
        &self,
        block: Rect,
        cancel: &AtomicBool,
        pixels: &mut Vec<f32>,
    ) -> Result<Counts, Cancelled> {
        let rendered = self.render(block, cancel, pixels, None);
        rendered.map(|(counts, _)| counts)
    }

    /// The same, and how long the parts took by `clock`, which is read a few times for every few
    /// thousand samples.
    pub fn render_block_timed(
        &self,
        block: Rect,
        cancel: &AtomicBool,
        pixels: &mut Vec<f32>,
        clock: Clock,
    ) -> Result<(Counts, Times), Cancelled> {
        self.render(block, cancel, pixels, Some(clock))
    }

    fn render(
        &self,
        block: Rect,
        cancel: &AtomicBool,
        pixels: &mut Vec<f32>,
        clock: Option<Clock>,
    ) -> Result<(Counts, Times), Cancelled> {
        let mut work = self.spare().pop().unwrap_or_default();
        work.tracer.stopwatch = Stopwatch::new(clock);
        work.tracer.scratch.noise_evaluations = 0;
        let mut counts = Counts::default();
        let mut film = Film::new(block, pixels);
        let mut parts = vec![block];
        while let Some(part) = parts.pop() {
            if part.area() > self.together() {
                let [first, second] = part.halves();
                parts.extend([second, first]);
                continue;
            }
            work.tracer.stopwatch.begin(Part::Sampling);
            work.clear();
            self.take(part, &mut work);
            self.see(&mut work, cancel, &mut counts)?;
            work.tracer.stopwatch.begin(Part::Film);
            film.put(part, &work.seen, self.strata.per_pixel(), &mut counts);
        }
        counts.noise_evaluations += work.tracer.scratch.noise_evaluations;
        work.tracer.stopwatch.stop();
        let times = work.tracer.stopwatch.times;
        self.spare().push(work);
        Ok((counts, times))
    }

    /// Takes the samples of a part's pixels, in an order in which neighbours share what they can.
    fn take(&self, part: Rect, work: &mut Work) {
        let Work {
            draws,
            order,
            samples,
            from,
            ..
        } = work;
        let level = self.surface.level;
        self.strata.of_pixels(level, part, draws, samples);
        if !Technique::Curve.is_used(self.surface.without) {
            from.extend((0..).take(samples.len()));
        } else if self.strata.per_pixel() == 1 {
            // Then the order of pixels is that of samples.
            order.along_curve(part, samples, from);
        } else {
            order.arrange(samples, [part.x0, part.y0], self.slices, from);
        }
    }

    fn spare(&self) -> MutexGuard<'_, Vec<Box<Work>>> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Follows all samples of `work` into the scene.
    fn see(
        &self,
        work: &mut Work,
        cancel: &AtomicBool,
        counts: &mut Counts,
    ) -> Result<(), Cancelled> {
        counts.samples += work.samples.len() as u64;
        counts.rays += work.samples.len() as u64;
        let Work {
            samples,
            rows,
            rays,
            ..
        } = work;
        rays.reserve(samples.len());
        self.view
            .sights(self.surface.level, samples, rows, |sight| {
                rays.push(self.surface.ray(&sight));
            });
        work.tracer.trace(
            &self.surface,
            Goal::Distance,
            &work.rays,
            cancel,
            counts,
            &mut work.hits,
        )?;
        work.tracer.stopwatch.begin(Part::Normals);
        self.touch(work, counts);
        work.tracer.stopwatch.begin(Part::Shadows);
        self.cast_shadows(work, cancel, counts)?;
        work.tracer.stopwatch.begin(Part::Shading);
        self.shade(work);
        Ok(())
    }

    /// Gathers the places where rays met the surface, with their normals.
    fn touch(&self, work: &mut Work, counts: &mut Counts) {
        let Work {
            hits,
            rays,
            touched,
            places,
            tracer,
            ..
        } = work;
        for (index, (hit, ray)) in hits.iter().zip(rays.iter()).enumerate() {
            let Some(distance) = hit.distance() else {
                continue;
            };
            let place = ray.origin + ray.direction * distance;
            places.push(place, self.surface.footprint.at(distance), ray.time);
            touched.push(Touched {
                sample: index,
                distance,
                place,
                normal: DVec3::ZERO,
                sun: 0.0,
            });
        }
        counts.hits += touched.len() as u64;
        counts.evaluations += touched.len() as u64;
        let mut value = [0.0; BATCH];
        let mut gradient = [[0.0; BATCH]; 3];
        for first in (0..touched.len()).step_by(BATCH) {
            let n = BATCH.min(touched.len() - first);
            let [gx, gy, gz] = &mut gradient;
            self.surface.program.evaluate_gradient(
                self.surface.level,
                &places.batch(first, n),
                &mut tracer.scratch,
                &mut value[..n],
                [&mut gx[..n], &mut gy[..n], &mut gz[..n]],
            );
            for i in 0..n {
                let touched = &mut touched[first + i];
                let slope = DVec3::new(gradient[0][i], gradient[1][i], gradient[2][i]);
                touched.normal = match hits[touched.sample] {
                    Hit::Face(_) => self.face(touched.place),
                    _ => self.normal(touched.place, slope),
                };
            }
        }
    }

    /// The gradient as a unit vector, or the vertical where it has no direction.
    fn normal(&self, place: DVec3, slope: DVec3) -> DVec3 {
        let largest = slope.abs().max_element();
        if !(largest > 0.0 && largest.is_finite()) {
            return self.surface.vertical(place);
        }
        let slope = slope * (1.0 / largest);
        slope * (1.0 / slope.dot(slope).sqrt())
    }

    /// The normal of the box's face that a place is on.
    fn face(&self, place: DVec3) -> DVec3 {
        let scene::description::Bound::Box { min, max } = self.surface.bound else {
            return self.surface.vertical(place);
        };
        let mut nearest = (f64::INFINITY, DVec3::Z);
        for axis in 0..3 {
            for (face, sign) in [(min[axis], -1.0), (max[axis], 1.0)] {
                let distance = (place[axis] - face).abs();
                if distance < nearest.0 {
                    nearest = (distance, DVec3::AXES[axis] * sign);
                }
            }
        }
        nearest.1
    }

    /// Finds out which places the sun reaches.
    fn cast_shadows(
        &self,
        work: &mut Work,
        cancel: &AtomicBool,
        counts: &mut Counts,
    ) -> Result<(), Cancelled> {
        work.asking.clear();
        work.asking_rays.clear();
        work.hits.clear();
        for (index, touched) in work.touched.iter_mut().enumerate() {
            if touched.normal.dot(self.sky.sun) <= 0.0 {
                continue;
            }
            touched.sun = 1.0;
            if !self.shadows {
                continue;
            }
            let ray = &work.rays[touched.sample];
            let footprint = self.surface.footprint.at(touched.distance);
            let origin = touched.place + touched.normal * (LIFT * footprint);
            work.asking.push(index);
            work.asking_rays.push(Ray {
                origin,
                direction: self.sky.sun,
                from_eye: origin - ray.origin,
                time: ray.time,
                grid: self.surface.shadow_grid(touched.distance),
            });
        }
        counts.shadow_rays += work.asking_rays.len() as u64;
        work.tracer.trace(
            &self.surface,
            Goal::Occlusion,
            &work.asking_rays,
            cancel,
            counts,
            &mut work.hits,
        )?;
        for (&index, hit) in work.asking.iter().zip(&work.hits) {
            if *hit != Hit::None {
                work.touched[index].sun = 0.0;
                counts.shadows += 1;
            }
        }
        Ok(())
    }

    /// Gives every sample its colour.
    fn shade(&self, work: &mut Work) {
        work.seen.resize(work.rays.len(), Seen::NOTHING);
        self.shade_surface(work);
        work.tracer.stopwatch.begin(Part::Sky);
        self.shade_sky(work);
    }

    /// Colours the samples that met the surface.
    fn shade_surface(&self, work: &mut Work) {
        let Work {
            rays,
            from,
            touched,
            places,
            fields,
            lits,
            tracer,
            seen,
            ..
        } = work;
        for first in (0..touched.len()).step_by(BATCH) {
            let n = BATCH.min(touched.len() - first);
            if self.palette.has_fields() {
                for (i, touched) in touched[first..first + n].iter().enumerate() {
                    let facing = touched.normal.dot(rays[touched.sample].direction);
                    places.widen(first + i, Patch::longer(facing));
                }
            }
            self.palette.evaluate(
                self.surface.level,
                &places.batch(first, n),
                &mut tracer.scratch,
                fields,
            );
            for i in 0..n {
                let touched = &touched[first + i];
                let direction = rays[touched.sample].direction;
                let patch = Patch::new(
                    touched.normal,
                    direction,
                    self.surface.vertical(touched.place),
                    self.surface.height(touched.place),
                    self.surface.footprint.at(touched.distance),
                );
                let lit = Lit {
                    normal: touched.normal,
                    direction,
                    albedo: self.palette.albedo(fields, i, &patch),
                    sun: touched.sun,
                };
                lits.set(i, &lit);
            }
            lits.reflect(self.surface.level, &self.sky);
            for (i, touched) in touched[first..first + n].iter().enumerate() {
                let direction = rays[touched.sample].direction;
                let radiance = lits.radiance(i);
                seen[from[touched.sample] as usize] = Seen {
                    radiance: self.sky.through_air(radiance, direction, touched.distance),
                    surface: Some((touched.distance, touched.normal)),
                };
            }
        }
    }

    /// Colours the samples that met nothing: sun, sky and clouds.
    fn shade_sky(&self, work: &mut Work) {
        let Work {
            rays,
            from,
            tracer,
            seen,
            scanned,
            crossings,
            ..
        } = work;
        scanned.clear();
        crossings.clear();
        for (index, (ray, &place)) in rays.iter().zip(&*from).enumerate() {
            let seen = &mut seen[place as usize];
            if seen.surface.is_some() {
                continue;
            }
            seen.radiance = self.sky.background(ray.direction);
            let crossing = self.clouds.as_ref().and_then(|clouds| {
                let sight = Sight {
                    origin: ray.origin,
                    direction: ray.direction,
                    time: ray.time,
                };
                let angle = self.surface.footprint.angle;
                clouds.meet(self.sky.sun, &sight, angle, scanned)
            });
            crossings.extend(crossing.map(|crossing| (index, crossing)));
        }
        let Some(clouds) = &self.clouds else { return };
        clouds.scan(self.surface.level, &mut tracer.scratch, scanned);
        let light = self.sky.on_clouds();
        for &(index, crossing) in &*crossings {
            let veil = clouds.veil(crossing, rays[index].direction, &light, scanned);
            let seen = &mut seen[from[index] as usize];
            seen.radiance = veil.over(seen.radiance);
        }
    }
}

/// A place where a ray met the surface.
struct Touched {
    /// Which sample of the chunk.
    sample: usize,
    distance: f64,
    place: DVec3,
    normal: DVec3,
    /// The share of the sun that it sees.
    sun: f64,
}

/// Memory of one block's rendering, reused from chunk to chunk.
#[derive(Default)]
struct Work {
    draws: Draws,
    order: Order,
    samples: Vec<Sample>,
    /// From which place each of the samples comes.
    from: Vec<u32>,
    /// Where rays are computed.
    rows: Box<Rows>,
    rays: Vec<Ray>,
    hits: Vec<Hit>,
    touched: Vec<Touched>,
    places: Places,
    /// Which of `touched` each shadow ray belongs to.
    asking: Vec<usize>,
    asking_rays: Vec<Ray>,
    /// What the samples saw, pixel by pixel.
    seen: Vec<Seen>,
    fields: Fields,
    lits: Box<Lits>,
    scanned: Scanned,
    /// Which samples see the layer of clouds, and where.
    crossings: Vec<(usize, Crossing)>,
    tracer: Tracer,
}

impl Work {
    fn clear(&mut self) {
        self.samples.clear();
        self.from.clear();
        self.rays.clear();
        self.hits.clear();
        self.touched.clear();
        self.places.clear();
        self.seen.clear();
    }
}
