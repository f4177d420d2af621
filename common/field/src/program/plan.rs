//! The operations of a field that matter, in order, with their constants digested: what every arithmetic walks over.

use std::sync::Arc;

use crate::arithmetic::{Binary, Unary};
use crate::cascade::Cascade;
use crate::curve::{Curve, Join};
use crate::graph::Node;
use crate::grid::{SAMPLES_MAX, Surface, recipe};
use crate::interval::{Interval, larger};
use crate::noise::{Lattice, Noise, limits};
use crate::op::{Kind, Op};
use crate::program::CompileError;
use crate::program::fold::{self, Value};
use crate::shape::Shape;
use crate::{Graph, NodeId};

/// What a step does.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Act {
    Constant(f64),
    ConstantVector([f64; 3]),
    Position,
    Time,
    Curve(Curve),
    Vector,
    /// The component of that number.
    Component(usize),
    VectorAdd,
    VectorSub,
    Scale,
    Length,
    Dot,
    OntoSphere(f64),
    OntoPlane,
    Unary(Unary),
    Binary(Binary),
    Power(f64),
    SmoothStep(f64, f64),
    Select,
    Noise(Lattice),
    /// Any noise but the gradient noise above.
    AnyNoise(Noise),
    /// The gradient of a noise.
    NoiseGradient(Noise),
    Cascade(Cascade),
    Shape(Arc<Shape>),
    Grid(Arc<Surface>),
}

/// One operation on the results of earlier steps.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Step {
    pub(crate) act: Act,
    pub(crate) args: Vec<usize>,
    pub(crate) kind: Kind,
}

/// The live operations of a graph; each stands after its arguments.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) steps: Vec<Step>,
    pub(crate) roots: Vec<usize>,
    /// Where the numbers of each step begin if all stand one after another, and how many there are.
    pub(crate) places: Vec<usize>,
    pub(crate) numbers: usize,
}

impl Plan {
    pub(crate) fn new(
        graph: &Graph,
        roots: &[NodeId],
        time: Interval,
    ) -> Result<Self, CompileError> {
        for root in roots {
            match graph.nodes().get(root.index()) {
                None => return Err(CompileError::Missing(root.0)),
                Some(_) if graph.kind(*root) == Kind::Scalar => {}
                Some(node) => return Err(CompileError::Vector(node.op.signature().name)),
            }
        }
        let size = |file| Some(graph.files().get(&file)?.values().len());
        let samples = graph.nodes().iter().map(|node| recipe::count(node, size));
        if samples.fold(0usize, usize::saturating_add) > SAMPLES_MAX {
            return Err(CompileError::TooManySamples);
        }
        let mut steps = Vec::with_capacity(graph.nodes().len());
        let mut known: Vec<Known> = Vec::with_capacity(graph.nodes().len());
        for node in graph.nodes() {
            let args: Vec<&Known> = node.args.iter().map(|arg| &known[arg.index()]).collect();
            let surface = surface_of(graph, node)?;
            let (step, fact) = digest(node, surface, &args, time);
            steps.push(step);
            known.push(fact);
        }
        let roots = roots.iter().map(|root| root.index()).collect();
        Ok(Self::live(steps, roots))
    }

    /// The steps that a root needs.
    pub(crate) fn live(all: Vec<Step>, roots: Vec<usize>) -> Self {
        let mut needed = vec![false; all.len()];
        for &root in &roots {
            needed[root] = true;
        }
        for (i, step) in all.iter().enumerate().rev() {
            if needed[i] {
                for &arg in &step.args {
                    needed[arg] = true;
                }
            }
        }
        let mut place = vec![0; all.len()];
        let (mut steps, mut places, mut numbers) = (Vec::new(), Vec::new(), 0);
        for (i, mut step) in all.into_iter().enumerate() {
            if needed[i] {
                place[i] = steps.len();
                for arg in &mut step.args {
                    *arg = place[*arg];
                }
                places.push(numbers);
                numbers += match step.kind {
                    Kind::Scalar => 1,
                    Kind::Vector => 3,
                };
                steps.push(step);
            }
        }
        let roots = roots.into_iter().map(|root| place[root]).collect();
        Self {
            steps,
            roots,
            places,
            numbers,
        }
    }
}

/// What is known of a node before evaluation.
struct Known {
    /// Its value, if it is the same everywhere and at all times.
    value: Option<Value>,
    /// Its values over the time at hand, if it depends on time alone.
    over_time: Option<Interval>,
    /// How many units it changes per metre by its nominal scale; 0 if that cannot be said.
    scale: f64,
}

/// The grid of a node that has one.
fn surface_of(graph: &Graph, node: &Node) -> Result<Option<Arc<Surface>>, CompileError> {
    if node.op != Op::Grid {
        return Ok(recipe::synthesised(node));
    }
    let file = recipe::file(node);
    let samples = graph.files().get(&file);
    let samples = samples.ok_or(CompileError::NoFile(file))?;
    Ok(Some(recipe::of_file(node, samples)))
}

fn digest(
    node: &Node,
    surface: Option<Arc<Surface>>,
    args: &[&Known],
    time: Interval,
) -> (Step, Known) {
    let kind = node.op.signature().result;
    let scale = scale_of(node, args);
    let act = match surface {
        Some(surface) => Act::Grid(surface),
        None => act_of(node, args),
    };
    let over_time = over_time(&act, args, time);
    let constant = match over_time {
        Some(Interval { low, high }) if low == high => Some(Value::Scalar(low)),
        _ => fold::constant(&act, &args.iter().map(|arg| arg.value).collect::<Vec<_>>()),
    };
    let step = match constant {
        Some(Value::Scalar(value)) => Step {
            act: Act::Constant(value),
            args: Vec::new(),
            kind,
        },
        Some(Value::Vector(value)) => Step {
            act: Act::ConstantVector(value),
            args: Vec::new(),
            kind,
        },
        None => Step {
            act,
            args: node.args.iter().map(|arg| arg.index()).collect(),
            kind,
        },
    };
    (
        step,
        Known {
            value: constant,
            over_time,
            scale,
        },
    )
}

fn act_of(node: &Node, args: &[&Known]) -> Act {
    let params = &node.params;
    if let Some(unary) = Unary::of(node.op) {
        return Act::Unary(unary);
    }
    if let Some(binary) = Binary::of(node.op) {
        return Act::Binary(binary);
    }
    if let Some(shape) = Shape::new(node.op, params) {
        return Act::Shape(Arc::new(shape.expect("the graph checked the constants")));
    }
    match node.op {
        Op::Constant => Act::Constant(params[0]),
        Op::Position => Act::Position,
        Op::Time => Act::Time,
        Op::Linear => Act::Curve(Curve::new(Join::Linear, params)),
        Op::Smooth => Act::Curve(Curve::new(Join::Smooth, params)),
        Op::Vector => Act::Vector,
        Op::X => Act::Component(0),
        Op::Y => Act::Component(1),
        Op::Z => Act::Component(2),
        Op::VectorAdd => Act::VectorAdd,
        Op::VectorSub => Act::VectorSub,
        Op::Scale => Act::Scale,
        Op::Length => Act::Length,
        Op::Dot => Act::Dot,
        Op::OntoSphere => Act::OntoSphere(params[0]),
        Op::OntoPlane => Act::OntoPlane,
        Op::Power => Act::Power(params[0]),
        Op::SmoothStep => Act::SmoothStep(params[0], params[1]),
        Op::Select => Act::Select,
        Op::Noise => {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "whole and in range: the graph checked it"
            )]
            let key = params[0] as u32;
            Act::Noise(Lattice::new(key))
        }
        Op::ValueNoise
        | Op::ValueGradientNoise
        | Op::SimplexNoise
        | Op::SparseNoise
        | Op::CellularNoise
        | Op::PlaneCellularNoise
        | Op::SpotNoise
        | Op::WaveletNoise => {
            let noise = Noise::new(node.op, params);
            Act::AnyNoise(noise.expect("the graph checked the constants"))
        }
        Op::NoiseGradient => {
            let noise = limits::split_noise(params, 0)
                .and_then(|(op, constants, _)| Noise::new(op, constants));
            Act::NoiseGradient(noise.expect("the graph checked the constants"))
        }
        Op::Sum | Op::AltitudeOne | Op::AltitudeTwo | Op::RidgedMultifractal | Op::Cascade => {
            let cascade = Cascade::new(node.op, params, args[0].scale);
            Act::Cascade(cascade.expect("the graph checked the constants"))
        }
        Op::Neg
        | Op::Abs
        | Op::Sqrt
        | Op::Sin
        | Op::Cos
        | Op::Exp
        | Op::Add
        | Op::Sub
        | Op::Mul
        | Op::Div
        | Op::Min
        | Op::Max
        | Op::Polynomial
        | Op::Superquadric
        | Op::Blobs
        | Op::Distances
        | Op::Convolution
        | Op::Bernstein
        | Op::Bend
        | Op::Blend => unreachable!("functions of numbers and shapes are taken above"),
        Op::Grid | Op::SpectralTerrain | Op::Sea | Op::MidpointTerrain => {
            unreachable!("grids have surfaces")
        }
    }
}

/// The values of a step that depends on time alone, if they are easily known: time itself, and curves over it.
fn over_time(act: &Act, args: &[&Known], time: Interval) -> Option<Interval> {
    match act {
        Act::Time => Some(time),
        Act::Curve(curve) => args[0].over_time.map(|over| curve.range(over)),
        _ => None,
    }
}

/// The nominal scale of a node: what level of detail is counted with.
///
/// A constant factor multiplies it; a constant summand and the projections onto plane and sphere
/// keep it (on the sphere itself they do); of two summands the larger counts. Noises, curves and
/// other functions add no scale of their own: a warp by noise keeps the scale of what it warps.
fn scale_of(node: &Node, args: &[&Known]) -> f64 {
    let of = |i: usize| args.get(i).map_or(0.0, |arg: &&Known| arg.scale);
    let factor = |i: usize| match args.get(i).and_then(|arg: &&Known| arg.value) {
        Some(Value::Scalar(value)) => Some(value.abs()),
        _ => None,
    };
    match node.op {
        Op::Position => 1.0,
        Op::X
        | Op::Y
        | Op::Z
        | Op::Neg
        | Op::Abs
        | Op::OntoSphere
        | Op::OntoPlane
        | Op::Length
        | Op::Bend => of(0),
        Op::Vector => larger(larger(of(0), of(1)), of(2)),
        Op::VectorAdd | Op::VectorSub | Op::Add | Op::Sub | Op::Min | Op::Max => {
            larger(of(0), of(1))
        }
        Op::Scale | Op::Mul => match (factor(0), factor(1)) {
            (_, Some(b)) => of(0) * b,
            (Some(a), None) => of(1) * a,
            (None, None) => larger(of(0), of(1)),
        },
        Op::Div => of(0) / factor(1).filter(|b| *b > 0.0).unwrap_or(1.0),
        _ => 0.0,
    }
}
