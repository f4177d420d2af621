//! What rendering took, in integers that are the same on every machine, but not for every way of cutting into blocks.

use core::ops::AddAssign;

macro_rules! counts {
    ($($(#[doc = $doc:literal])+ $name:ident,)+) => {
        /// Work done, counted. Of an image's blocks, pixels, samples, rays, hits and shadows add up to the same
        /// however it is cut; evaluations and steps depend on which rays were followed together.
        #[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
        pub struct Counts {
            $($(#[doc = $doc])+ pub $name: u64,)+
        }

        impl Counts {
            /// Every count with its name, in a fixed order.
            pub fn named(&self) -> [(&'static str, u64); [$(stringify!($name)),+].len()] {
                [$((stringify!($name), self.$name)),+]
            }
        }

        impl AddAssign for Counts {
            fn add_assign(&mut self, other: Self) {
                $(self.$name += other.$name;)+
            }
        }
    };
}

counts! {
    /// Pixels rendered.
    pixels,
    /// Samples taken of the image.
    samples,
    /// Rays cast from the camera; one for each sample.
    rays,
    /// Rays cast towards the sun.
    shadow_rays,
    /// Camera rays that met the surface.
    hits,
    /// Shadow rays that met the surface.
    shadows,
    /// Evaluations of the surface's field, gradients and cones included.
    evaluations,
    /// Evaluations of a noise's lattice cell within all of these; an upper bound where level of
    /// detail leaves octaves out.
    noise_evaluations,
    /// Steps of the search along rays.
    steps,
    /// Steps among them that went too far and were taken back.
    backtracks,
    /// Bundles of rays that went on in smaller ones, or as single rays, since one value no longer served them all;
    /// stretches that were cut in two.
    subdivisions,
    /// Steps along the cones that rays share.
    cone_steps,
    /// Rays whose search used up its budget: taken as hits where they stood.
    exhausted,
    /// Samples that were not finite, and counted as black.
    not_finite,
}

impl core::iter::Sum for Counts {
    fn sum<I: Iterator<Item = Self>>(counts: I) -> Self {
        counts.fold(Self::default(), |mut total, counts| {
            total += counts;
            total
        })
    }
}
