//! The surfaces that methods are tried on.

use field::{Graph, Interval, NodeId, Op, Program};

/// A surface that rays are cast at.
pub(crate) struct Surface {
    pub(crate) name: &'static str,
    pub(crate) program: Program,
    /// What it is compiled of, if it is the same from everywhere: if it has no cascades, which lose detail with distance.
    pub(crate) plain: Option<(Graph, NodeId)>,
    /// No slope is greater; `None` where there is no such number.
    pub(crate) lipschitz: Option<f64>,
    /// Parts of a ray below this width are not cut for certainty about what is computed.
    pub(crate) finest: f64,
}

/// Short names for what graphs are made of.
struct Fields(Graph);

impl Fields {
    fn op(&mut self, op: Op, args: &[NodeId], params: &[f64]) -> NodeId {
        self.0.push(op, args, params).unwrap()
    }

    fn number(&mut self, value: f64) -> NodeId {
        self.0.constant(value).unwrap()
    }

    fn place(&mut self) -> NodeId {
        self.op(Op::Position, &[], &[])
    }

    fn scaled(&mut self, factor: f64) -> NodeId {
        let (p, factor) = (self.place(), self.number(factor));
        self.op(Op::Scale, &[p, factor], &[])
    }

    fn times(&mut self, factor: f64, a: NodeId) -> NodeId {
        let factor = self.number(factor);
        self.op(Op::Mul, &[factor, a], &[])
    }

    fn add(&mut self, a: NodeId, b: NodeId) -> NodeId {
        self.op(Op::Add, &[a, b], &[])
    }

    /// ‖p − centre‖ − radius.
    fn ball(&mut self, centre: [f64; 3], radius: f64) -> NodeId {
        let centre = centre.map(|part| self.number(part));
        let (p, centre) = (self.place(), self.op(Op::Vector, &centre, &[]));
        let away = self.op(Op::VectorSub, &[p, centre], &[]);
        let length = self.op(Op::Length, &[away], &[]);
        let radius = self.number(-radius);
        self.add(length, radius)
    }
}

fn surface(
    name: &'static str,
    lipschitz: Option<f64>,
    finest: f64,
    build: impl Fn(&mut Fields) -> NodeId,
) -> Surface {
    let mut fields = Fields(Graph::new());
    let root = build(&mut fields);
    let program = Program::compile(&fields.0, &[root], Interval::point(0.0)).unwrap();
    let cascades = fields
        .0
        .nodes()
        .iter()
        .any(|node| matches!(node.op, Op::Sum | Op::RidgedMultifractal));
    Surface {
        name,
        program,
        plain: (!cascades).then_some((fields.0, root)),
        lipschitz,
        finest,
    }
}

/// Two noises differ by 4 · 10⁻⁶ of their amplitude from the exact ones; divided by a slope that is rarely under a hundredth.
const NOISY: f64 = 1e-5;

pub(crate) fn surfaces() -> Vec<Surface> {
    vec![
        surface("thesis eq. (5.11)", Some(13.0), NOISY, |f| {
            let mut sum = f.ball([0.0; 3], 1.0);
            for (amplitude, frequency) in [(0.3, 4.0), (0.15, 8.0), (0.05, 16.0)] {
                let p = f.scaled(frequency);
                let noise = f.op(Op::Noise, &[p], &[0.0]);
                let noise = f.times(amplitude, noise);
                sum = f.add(sum, noise);
            }
            sum
        }),
        // Slits along the noise's zeros, steep on both sides: there its rounding moves a root by less than a micrometre.
        surface("thesis eq. (5.29)", None, 1e-6, |f| {
            let p = f.scaled(6.0);
            let noise = f.op(Op::Noise, &[p], &[0.0]);
            let noise = f.op(Op::Abs, &[noise], &[]);
            let root = f.op(Op::Sqrt, &[noise], &[]);
            let root = f.times(0.3, root);
            let ball = f.ball([0.0; 3], 1.0);
            f.add(ball, root)
        }),
        // ‖p‖ changes by 1, an octave of rotated noise of amplitude aᵢ by aᵢ · 2ⁱ · 2.5 · 3.75.
        surface("ball and fbm", Some(1.0 + 0.3 * 3.0 * 9.375), NOISY, |f| {
            let p = f.scaled(2.5);
            let fbm = f.op(Op::Sum, &[p], &[0.0, 5.0, 2.0, 1.0, 3.0, 0.0, 0.0]);
            let fbm = f.times(0.3, fbm);
            let ball = f.ball([0.0; 3], 1.0);
            f.add(ball, fbm)
        }),
        surface("ball of ridges", None, NOISY, |f| {
            let p = f.scaled(2.0);
            let params = [4.0, 2.0, 1.0, 3.0, 1.0, 2.0, 0.0];
            let ridges = f.op(Op::RidgedMultifractal, &[p], &params);
            let ridges = f.times(-0.3, ridges);
            let ball = f.ball([0.0; 3], 0.9);
            f.add(ball, ridges)
        }),
        surface("balls cut and joined", Some(1.0), 1e-9, |f| {
            let (a, b) = (f.ball([0.4, 0.0, 0.0], 0.8), f.ball([-0.4, 0.1, 0.0], 0.7));
            let c = f.ball([0.0, 0.0, 0.5], 0.6);
            let both = f.op(Op::Min, &[a, b], &[]);
            let without = f.op(Op::Neg, &[c], &[]);
            f.op(Op::Max, &[both, without], &[])
        }),
        surface("waves", Some(2.5), 1e-9, |f| {
            let p = f.place();
            let [x, y, z] = [Op::X, Op::Y, Op::Z].map(|op| f.op(op, &[p], &[]));
            let steep = f.times(4.0, x);
            let wave = f.op(Op::Sin, &[steep], &[]);
            let fall = f.op(Op::Mul, &[y, y], &[]);
            let fall = f.op(Op::Neg, &[fall], &[]);
            let fall = f.op(Op::Exp, &[fall], &[]);
            let hill = f.op(Op::Mul, &[wave, fall], &[]);
            let hill = f.times(-0.4, hill);
            f.add(z, hill)
        }),
        surface("ball of sparse convolution", None, NOISY, |f| {
            let p = f.scaled(3.0);
            let noise = f.op(Op::SparseNoise, &[p], &[0.0, 1.0, 1.0, 0.0]);
            let noise = f.times(0.15, noise);
            let ball = f.ball([0.0; 3], 1.0);
            f.add(ball, noise)
        }),
        // Distances change by 1: so does the ball's, and 0.2 · 3 that of the cells.
        surface("ball of cells", Some(1.6), NOISY, |f| {
            let p = f.scaled(3.0);
            let params = [0.0, 2.0, 1.0, -1.0, 1.0, 0.0, 0.0, 0.0, 1.0];
            let first = f.op(
                Op::CellularNoise,
                &[p],
                &[0.0, 2.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            );
            let edges = f.op(Op::CellularNoise, &[p], &params);
            let (first, edges) = (f.times(0.1, first), f.times(-0.05, edges));
            let (ball, cells) = (f.ball([0.0; 3], 1.0), f.add(first, edges));
            f.add(ball, cells)
        }),
        // The tangle cube: Σ x⁴ − 5x² + 11.8.
        surface("quartic", None, 1e-9, |f| {
            let p = f.scaled(2.0);
            let mut terms = vec![0.0, 0.0, 0.0, 11.8];
            for k in 0..3 {
                for (power, factor) in [(4.0, 1.0), (2.0, -5.0)] {
                    let mut term = [0.0, 0.0, 0.0, factor];
                    term[k] = power;
                    terms.extend(term);
                }
            }
            f.op(Op::Polynomial, &[p], &terms)
        }),
    ]
}
