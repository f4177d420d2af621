//! Our surfaces in the language of the crate fidget, rendered by its JIT to depth and normals.
//!
//! fidget looks along −z into a cube of voxels, here 512 along each side as its pixels are, so that its depths are
//! as fine as the picture; it shades nothing. Its language has no noise: gradient noise is written with what it has, a hash of
//! the lattice's corners (`mix`, `rand`), so that its intervals know a cell's gradients wherever they lie within the cell.

use ::fidget::context::Tree;
use ::fidget::jit::JitShape;
use ::fidget::raster::voxel::{EvalConfig, Image, RenderConfig, RenderSize, render as rasterize};
use ::fidget::shape::BoundShape;

use super::rows::Shape;

/// Pixels along a side, and voxels behind each.
pub(crate) const SIDE: u32 = 512;

/// Half the width of the view, metres.
const HALF: f32 = 1.6;

/// Where the soft balls are, as in `benches/peers/blob.toml`: x to the right, y away from the eye, z up.
const BALLS: [[f32; 3]; 6] = [
    [-0.489_580_46, -0.847_978_2, -0.203_085_94],
    [0.309_769_84, 0.536_537_1, -0.784_965_34],
    [-0.600_766_36, 0.010_904_375, -0.799_350_3],
    [-0.309_826_64, 0.514_826_7, 0.799_350_3],
    [-0.983_698, -0.002_513_356, 0.179_810_63],
    [-0.489_672_4, 0.853_164_14, -0.179_810_63],
];

/// Amplitudes of the layers of eq. (5.11), and two more; frequencies begin at 4 and double.
const AMPLITUDES: [f32; 5] = [0.3, 0.15, 0.05, 0.025, 0.0125];

/// A surface over the view, which spans ±1 along every axis there.
pub(crate) fn tree(shape: Shape) -> Tree {
    let (x, y, z) = Tree::axes();
    let p = [x * HALF, y * HALF, z * HALF];
    match shape {
        Shape::Blob => blob(&p),
        Shape::Sphere { layers } => sphere(&p, layers),
    }
}

/// Depth and normals of every pixel of a square, on the calling thread.
pub(crate) fn render(tree: &Tree, side: u32) -> Option<Image> {
    let shape: BoundShape<'_, _, f32> = JitShape::from(tree.clone()).try_into().ok()?;
    let settings = EvalConfig {
        threads: None,
        ..EvalConfig::default()
    };
    rasterize(
        shape,
        &RenderConfig::from_size(RenderSize::from(side)),
        &settings,
    )
}

fn blob([x, y, z]: &[Tree; 3]) -> Tree {
    const RADIUS: f32 = 0.75;
    let mut field = Tree::constant(0.45);
    // The balls are symmetric about the origin.
    for [bx, by, bz] in BALLS.into_iter().flat_map(|ball| [ball, ball.map(|c| -c)]) {
        let square =
            (x.clone() - bx).square() + (z.clone() + by).square() + (y.clone() - bz).square();
        let rest = (1.0 - square * (1.0 / (RADIUS * RADIUS))).max(0.0);
        field -= rest.square();
    }
    field
}

fn sphere(p: &[Tree; 3], layers: usize) -> Tree {
    let [x, y, z] = p;
    let mut field = (x.square() + y.square() + z.square()).sqrt() - 1.0;
    let mut frequency = 4.0;
    for amplitude in AMPLITUDES.into_iter().take(layers) {
        let q = [0, 1, 2].map(|axis| p[axis].clone() * frequency);
        field += noise(&q) * amplitude;
        frequency *= 2.0;
    }
    field
}

/// Eq. (4.9) with gradients drawn evenly from a cube, as long on average as those towards the middles of its edges:
/// the cheapest that the language can say, with one random number for each corner.
fn noise(q: &[Tree; 3]) -> Tree {
    let cell = [0, 1, 2].map(|axis| q[axis].floor());
    let offset = [0, 1, 2].map(|axis| q[axis].clone() - cell[axis].clone());
    let fade = [0, 1, 2].map(|axis| {
        let t = &offset[axis];
        t.square() * t.clone() * (t.clone() * (t.clone() * 6.0 - 15.0) + 10.0)
    });
    let corner = |i: f32, j: f32, k: f32| {
        let place = |axis: usize, step: f32| cell[axis].clone() + step;
        let hash = place(0, i).mix(place(1, j)).mix(place(2, k));
        // Three numbers from the digits of one.
        let first = hash.rand();
        let digits = |of: &Tree| {
            let shifted = of.clone() * 128.0;
            shifted.clone() - shifted.floor()
        };
        let second = digits(&first);
        let third = digits(&second);
        let part =
            |axis: usize, step: f32, random: Tree| (random - 0.5) * (offset[axis].clone() - step);
        part(0, i, first) + part(1, j, second) + part(2, k, third)
    };
    let blend = |axis: usize, a: Tree, b: Tree| a.clone() + fade[axis].clone() * (b - a);
    let along_x = |j: f32, k: f32| blend(0, corner(0.0, j, k), corner(1.0, j, k));
    let along_y = |k: f32| blend(1, along_x(0.0, k), along_x(1.0, k));
    // Components of ±½ at most, whose mean square is to be ⅔.
    blend(2, along_y(0.0), along_y(1.0)) * 8.0f32.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of pixels that show the surface.
    fn coverage(shape: Shape) -> f64 {
        const SIDE: u32 = 128;
        let image = render(&tree(shape), SIDE).unwrap();
        let covered = image.iter().filter(|pixel| pixel.depth > 0).count();
        covered as f64 / f64::from(SIDE * SIDE)
    }

    #[test]
    fn the_surfaces_are_those_that_the_others_show() {
        // POV-Ray shows 45.43 % of the blob, and 40.06 % of three layers of another gradient noise.
        let blob = coverage(Shape::Blob);
        assert!((blob - 0.4543).abs() < 0.002, "{blob}");
        let sphere = coverage(Shape::Sphere { layers: 3 });
        assert!((sphere - 0.4006).abs() < 0.04, "{sphere}");
    }
}
