//! Convolution surfaces, thesis eq. (2.11): a kernel integrated over primitives, in closed form.
//!
//! With Murakami's quartic (1 − d²/r²)², as in Jin and Tai 2002, a piece counts only where it lies in the
//! ball of radius r about the place. Where that cuts it off the integrand is 0, so that the cuts count as
//! constants when derivatives are taken. With Cauchy's 1/(1 + d²/r²)², as in Sherstyuk 1999, everything counts.

use super::Refusal;
use super::kernel::Kernel;
use super::local::{Local, along, atan, dot, fixed, less};
use super::roots;
use super::skeleton::{self, Arc, Ball, Piece, Polygon, Quadratic, Segment};
use super::sum::{Rules, Summed};
use super::supports::Supports;
use super::within::{Extent, Known, Within};
use crate::arithmetic::Unary;
use crate::interval::{Interval, larger, smaller};

/// T − Σ aᵢ ∫ h(‖x − u‖/rᵢ) du, the integral along the length of lines and over the area of polygons.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Convolution {
    rules: Rules,
    terms: Vec<Term>,
    supports: Supports,
}

#[derive(Clone, PartialEq, Debug)]
struct Term {
    piece: Piece,
    balls: Vec<Ball>,
    measure: f64,
    radius: f64,
    weight: f64,
}

impl Convolution {
    /// From the rules and the primitives; their pieces add up, so each is a term of its own.
    pub(crate) fn new(params: &[f64]) -> Result<Self, Refusal> {
        let (rules, list) = Rules::split(params)?;
        if !matches!(rules.kernel, Kernel::Murakami | Kernel::Cauchy) {
            return Err((
                "the kernel murakami or cauchy: others have no closed form",
                params[0],
            ));
        }
        if rules.far {
            return Err(("no far field", 1.0));
        }
        let mut terms = Vec::new();
        for primitive in skeleton::primitives(list)? {
            for piece in primitive.pieces {
                let curved = matches!(piece, Piece::Quadratic(_));
                if curved && rules.kernel == Kernel::Cauchy {
                    return Err((
                        "the kernel murakami for curves: cauchy has no closed form",
                        params[0],
                    ));
                }
                terms.push(Term {
                    balls: piece.cover(0.2 * primitive.radius),
                    measure: piece.measure(),
                    piece,
                    radius: primitive.radius,
                    weight: primitive.weight,
                });
            }
        }
        let supports = Supports::sorted(&mut terms, |term| {
            if rules.kernel.ends() {
                term.piece.extent(term.radius)
            } else {
                Extent::ALL
            }
        });
        Ok(Self {
            rules,
            terms,
            supports,
        })
    }

    /// Its value.
    #[inline]
    pub(crate) fn value<N: Local>(&self, at: [N; 3]) -> N {
        let place = [at[0].at(), at[1].at(), at[2].at()];
        let mut sum = N::constant(0.0);
        self.supports.at(place, |i| {
            let term = &self.terms[i];
            let part = match self.rules.kernel {
                Kernel::Murakami => quartic(&term.piece, term.radius, &at),
                _ => cauchy(&term.piece, term.radius, &at),
            };
            sum = sum.clone().plus(part.times(term.weight));
        });
        N::constant(self.rules.threshold).minus(sum)
    }

    pub(crate) fn bound(&self, within: &Within) -> Known {
        self.rules.bound(self, &self.supports, within)
    }

    pub(crate) fn bend(&self, within: &Within) -> Interval {
        self.rules.bend(self, &self.supports, within)
    }
}

impl Summed for Convolution {
    fn size(&self) -> f64 {
        let radii = self.terms.iter().map(|term| term.radius);
        radii.fold(f64::INFINITY, smaller)
    }

    fn weight(&self) -> f64 {
        let weights = self
            .terms
            .iter()
            .map(|term| term.weight.abs() * term.measure);
        // Closed forms are differences of antiderivatives: a few digits go with them.
        1e4 * weights.sum::<f64>()
    }

    fn term(&self, i: usize, within: &Within) -> (Interval, f64) {
        let term = &self.terms[i];
        let inverse = Interval::point(1.0 / term.radius).widen();
        let mut range = Interval::point(0.0);
        let mut slope = 0.0;
        for ball in &term.balls {
            let rho = ball.distance(within).mul(inverse);
            let rho = Interval::new(larger(rho.low, 0.0), rho.high);
            let kernel = self.rules.kernel;
            // A cover's measures may be a little larger than the piece's own.
            let measure = match &term.piece {
                Piece::Quadratic(_) => Interval::new(0.0, ball.measure),
                _ => Interval::point(ball.measure).expand(1e-8 * ball.measure),
            };
            range = range.add(kernel.range(rho).mul(measure));
            slope += kernel.slope(rho) * ball.measure;
        }
        (
            range.mul(Interval::point(term.weight)),
            slope * term.weight.abs() * inverse.high,
        )
    }

    /// The integral of those of the kernel about every place of the piece.
    fn bend(&self, i: usize, within: &Within) -> Interval {
        let term = &self.terms[i];
        let inverse = Interval::point(1.0 / term.radius).widen();
        let mut bend = Interval::point(0.0);
        for ball in &term.balls {
            let rho = ball.distance(within).mul(inverse);
            let rho = Interval::new(larger(rho.low, 0.0), rho.high);
            // A cover's measures may be a little larger than the piece's own, and of curves much larger.
            let measure = match &term.piece {
                Piece::Quadratic(_) => Interval::new(0.0, ball.measure),
                _ => Interval::point(ball.measure).expand(1e-8 * ball.measure),
            };
            bend = bend.add(self.rules.kernel.bend(rho).mul(measure));
        }
        let scale = Interval::point(term.weight).mul(inverse.square());
        bend.mul(scale)
    }

    fn beyond(&self, _: &Within) -> Interval {
        Interval::point(0.0)
    }
}

/// The quartic over a piece.
fn quartic<N: Local>(piece: &Piece, radius: f64, at: &[N; 3]) -> N {
    match piece {
        Piece::Point(place) => {
            let away = less(at.clone(), *place);
            let u = dot(away.clone(), away).times(1.0 / (radius * radius));
            Kernel::Murakami.of(u)
        }
        Piece::Segment(segment) => quartic_segment(segment, radius, at),
        Piece::Arc(arc) => quartic_arc(arc, radius, at),
        Piece::Polygon(polygon) => quartic_polygon(polygon, radius, at),
        Piece::Quadratic(curve) => quartic_curve(curve, radius, at),
    }
}

/// With W = r² − (distance to the line)² and u along it, ∫(W − u²)² du = W²u − ⅔Wu³ + u⁵/5.
fn quartic_segment<N: Local>(segment: &Segment, radius: f64, at: &[N; 3]) -> N {
    let away = less(at.clone(), segment.start);
    let s = along(away.clone(), segment.axis);
    let square = dot(away.clone(), away).minus(s.clone().square());
    let w = N::constant(radius * radius).minus(square);
    if w.at() <= 0.0 {
        return N::constant(0.0);
    }
    let reach = w.at().sqrt();
    let (from, to) = (
        larger(0.0, s.at() - reach),
        smaller(segment.length, s.at() + reach),
    );
    if from >= to {
        return N::constant(0.0);
    }
    let whole = |l: f64| {
        let u = N::constant(l).minus(s.clone());
        let v = u.clone().square();
        // u (W² + v (v/5 − ⅔W))
        let inner = v.clone().times(0.2).minus(w.clone().times(2.0 / 3.0));
        u.mul(w.clone().square().plus(v.mul(inner)))
    };
    let scale = radius * radius;
    whole(to).minus(whole(from)).times(1.0 / (scale * scale))
}

/// 1 − d²/r² = p + q cos θ + s sin θ; its square has an elementary integral.
fn quartic_arc<N: Local>(arc: &Arc, radius: f64, at: &[N; 3]) -> N {
    let away = less(at.clone(), arc.centre);
    let (x, y) = (along(away.clone(), arc.x), along(away.clone(), arc.y));
    let inverse = 1.0 / (radius * radius);
    let near = dot(away.clone(), away).plus(N::constant(arc.radius * arc.radius));
    let p = N::constant(1.0).minus(near.times(inverse));
    let (q, s) = (
        x.times(2.0 * arc.radius * inverse),
        y.times(2.0 * arc.radius * inverse),
    );
    let most = (q.at() * q.at() + s.at() * s.at()).sqrt();
    if p.at() + most <= 0.0 {
        return N::constant(0.0);
    }
    // Inside where cos(θ − φ) > −p/most.
    let half = if p.at() >= most {
        core::f64::consts::PI
    } else {
        libm::acos(-p.at() / most)
    };
    let phi = libm::atan2(s.at(), q.at());
    let mut sum = N::constant(0.0);
    for turn in [-1.0, 0.0, 1.0] {
        let middle = phi + turn * core::f64::consts::TAU;
        let (from, to) = (
            larger(0.0, middle - half),
            smaller(arc.angle, middle + half),
        );
        if from < to {
            let over = |f: &dyn Fn(f64) -> f64| f(to) - f(from);
            let sin = over(&libm::sin);
            let cos = over(&libm::cos);
            let double = over(&|t| 0.25 * libm::sin(2.0 * t));
            let half = 0.5 * (to - from);
            let mixed = over(&|t| libm::sin(t) * libm::sin(t));
            sum = sum
                .plus(p.clone().square().times(to - from))
                .plus(p.clone().mul(q.clone()).times(2.0 * sin))
                .minus(p.clone().mul(s.clone()).times(2.0 * cos))
                .plus(q.clone().square().times(half + double))
                .plus(s.clone().square().times(half - double))
                .plus(q.clone().mul(s.clone()).times(mixed));
        }
    }
    sum.times(arc.radius)
}

/// Where a place stands over a polygon's plane, and over one of its edges.
struct Over<N> {
    /// The square of the height over the plane.
    square: N,
    /// Along the edge from the place's foot to the edge's start and to its end.
    from: N,
    to: N,
    /// How far the foot lies to the left of the edge.
    left: N,
}

/// Sums over the edges of a polygon: a radial function's integral is ∮ P(ρ) dθ about the place's foot,
/// P(ρ) = ∫₀^ρ ρ′h dρ′ and dθ = e dt/(e² + t²) along an edge at distance e.
fn over_edges<N: Local>(polygon: &Polygon, at: &[N; 3], edge: impl Fn(Over<N>) -> N) -> N {
    let height = along(less(at.clone(), polygon.vertices[0]), polygon.normal);
    let square = height.square();
    let mut sum = N::constant(0.0);
    for segment in &polygon.edges {
        let away = less(at.clone(), segment.start);
        let from = along(away.clone(), segment.axis).neg();
        let left = along(away, fixed::cross(polygon.normal, segment.axis));
        sum = sum.plus(edge(Over {
            square: square.clone(),
            to: from.clone().plus(N::constant(segment.length)),
            from,
            left,
        }));
    }
    sum
}

/// Within the disc of W = r² − h² about the foot, P dθ is a polynomial; outside, P is W³/6.
fn quartic_polygon<N: Local>(polygon: &Polygon, radius: f64, at: &[N; 3]) -> N {
    let scale = radius * radius;
    let sum = over_edges(polygon, at, |over| {
        let w = N::constant(scale).minus(over.square);
        if w.at() <= 0.0 {
            return N::constant(0.0);
        }
        let e = over.left;
        let square = e.clone().square();
        // e (3W² − 3Wρ² + ρ⁴)/6 with ρ² = e² + t², integrated.
        let within = |t: &N| {
            let v = t.clone().square();
            let w3 = w.clone().times(3.0);
            let constant = w3
                .clone()
                .mul(w.clone().minus(square.clone()))
                .plus(square.clone().square());
            let second = square.clone().times(2.0).minus(w3).times(1.0 / 3.0);
            let inner = constant.plus(v.clone().mul(second.plus(v.times(0.2))));
            e.clone().mul(t.clone().mul(inner)).times(1.0 / 6.0)
        };
        let outside = |a: &N, b: &N| {
            let cubed = w.clone().square().mul(w.clone()).times(1.0 / 6.0);
            cubed.mul(turned(&e, a, b))
        };
        let reach = w.at() - square.at();
        if reach <= 0.0 {
            return outside(&over.from, &over.to);
        }
        let reach = reach.sqrt();
        // The edge's parts before, in and after the disc.
        let mut sum = N::constant(0.0);
        let (low, high) = (N::constant(-reach), N::constant(reach));
        let pick = |a: &N, b: &N, smaller: bool| {
            if (a.at() < b.at()) == smaller {
                a.clone()
            } else {
                b.clone()
            }
        };
        if over.from.at() < -reach {
            sum = sum.plus(outside(&over.from, &pick(&over.to, &low, true)));
        }
        let (from, to) = (pick(&over.from, &low, false), pick(&over.to, &high, true));
        if from.at() < to.at() {
            sum = sum.plus(within(&to).minus(within(&from)));
        }
        if over.to.at() > reach {
            sum = sum.plus(outside(&pick(&over.from, &high, false), &over.to));
        }
        sum
    });
    sum.times(1.0 / (scale * scale))
}

/// The angle under which the foot sees an edge's part from `a` to `b`.
fn turned<N: Local>(e: &N, a: &N, b: &N) -> N {
    let to = |t: &N| atan(t.clone().over(e.clone()));
    if a.at() < 0.0 && b.at() > 0.0 {
        return to(b).minus(to(a));
    }
    let across = e.clone().mul(b.clone().minus(a.clone()));
    let beside = e.clone().square().plus(a.clone().mul(b.clone()));
    if beside.at() > 0.0 {
        atan(across.over(beside))
    } else {
        N::constant(0.0)
    }
}

/// Gauss's rule of eight points on [−1, 1]: the positive half.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_27),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// ∫ (1 − q(t)/r²)² |c′(t)| dt over the parts of the curve in the ball.
///
/// About the parameter τ = t + t₀ at which the curve turns, |c′| = 2|a| √(τ² + κ²) and the polynomial's
/// moments under that root have a recurrence. Where t₀ is far away, the curve being nearly straight,
/// the recurrence would lose digits; there the root is all but linear and Gauss's rule is as exact.
fn quartic_curve<N: Local>(curve: &Quadratic, radius: f64, at: &[N; 3]) -> N {
    const FAR: f64 = 3.0;
    let place = [at[0].at(), at[1].at(), at[2].at()];
    let Quadratic { a, b, c } = *curve;
    let scale = radius * radius;
    let d = fixed::sub(c, place);
    let outside = [
        fixed::dot(d, d) - scale,
        2.0 * fixed::dot(b, d),
        fixed::dot(b, b) + 2.0 * fixed::dot(a, d),
        2.0 * fixed::dot(a, b),
        fixed::dot(a, a),
    ];
    let mut cuts = [0.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let mut count = 1;
    roots::between_0_and_1(&outside, |root| {
        cuts[count] = root;
        count += 1;
    });
    cuts[count] = 1.0;
    let bend = fixed::dot(a, a);
    let turn = 0.5 * fixed::dot(a, b) / bend;
    let mut sum = N::constant(0.0);
    for pair in cuts[..=count].windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let middle = 0.5 * (from + to);
        let here = fixed::sub(curve.at(middle), place);
        if from >= to || fixed::dot(here, here) >= scale {
            continue;
        }
        sum = sum.plus(if turn.abs() < FAR {
            by_moments(curve, turn, (from, to), scale, at)
        } else {
            by_gauss(curve, (from, to), scale, at)
        });
    }
    sum.times(1.0 / (scale * scale))
}

/// ∫ (r² − q)² |c′| dt by Gauss's rule on halves.
fn by_gauss<N: Local>(curve: &Quadratic, (from, to): (f64, f64), scale: f64, at: &[N; 3]) -> N {
    let mut sum = N::constant(0.0);
    let half = 0.25 * (to - from);
    for middle in [from + half, to - half] {
        for (node, weight) in GAUSS {
            for t in [middle - half * node, middle + half * node] {
                let away = less(at.clone(), curve.at(t));
                let inner = N::constant(scale).minus(dot(away.clone(), away));
                let speed = fixed::length([0, 1, 2].map(|k| curve.b[k] + 2.0 * t * curve.a[k]));
                sum = sum.plus(inner.square().times(weight * half * speed));
            }
        }
    }
    sum
}

fn by_moments<N: Local>(
    curve: &Quadratic,
    turn: f64,
    (from, to): (f64, f64),
    scale: f64,
    at: &[N; 3],
) -> N {
    let Quadratic { a, b, .. } = *curve;
    let bend = fixed::dot(a, a);
    // c = a τ² + b′ τ + c′, b′ square to a.
    let across = fixed::sub(b, fixed::scale(a, 2.0 * turn));
    let vertex = curve.at(-turn);
    let kappa = 0.25 * fixed::dot(across, across) / bend;
    let moments = moments(kappa, from + turn, to + turn);
    let d = less(at.clone(), vertex);
    // r² − q = g₀ + g₁ τ + g₂ τ² + g₄ τ⁴.
    let g0 = N::constant(scale).minus(dot(d.clone(), d.clone()));
    let g1 = along(d.clone(), across).times(2.0);
    let g2 = along(d, a)
        .times(2.0)
        .minus(N::constant(fixed::dot(across, across)));
    let g4 = -bend;
    let sum = g0
        .clone()
        .square()
        .times(moments[0])
        .plus(g0.clone().mul(g1.clone()).times(2.0 * moments[1]))
        .plus(
            g1.clone()
                .square()
                .plus(g0.clone().mul(g2.clone()).times(2.0))
                .times(moments[2]),
        )
        .plus(g1.clone().mul(g2.clone()).times(2.0 * moments[3]))
        .plus(
            g2.clone()
                .square()
                .plus(g0.times(2.0 * g4))
                .times(moments[4]),
        )
        .plus(g1.times(2.0 * g4 * moments[5]))
        .plus(g2.times(2.0 * g4 * moments[6]))
        .plus(N::constant(g4 * g4 * moments[8]));
    sum.times(2.0 * bend.sqrt())
}

/// ∫ τⁿ √(τ² + κ²) dτ for n = 0 … 8, `kappa` being κ².
fn moments(kappa: f64, from: f64, to: f64) -> [f64; 9] {
    let root = |t: f64| (t * t + kappa).sqrt();
    let (s, e) = (root(from), root(to));
    let kappa_root = kappa.sqrt();
    let area = |t: f64| {
        if kappa_root > 0.0 {
            libm::asinh(t / kappa_root)
        } else {
            0.0
        }
    };
    let mut moments = [0.0; 9];
    moments[0] = 0.5 * (to * e - from * s + kappa * (area(to) - area(from)));
    moments[1] = (e * e * e - s * s * s) / 3.0;
    let (mut low, mut high) = (s * s * s, e * e * e);
    for n in 2..9u8 {
        (low, high) = (low * from, high * to);
        let (at, n) = (usize::from(n), f64::from(n));
        let before = moments[at - 2];
        moments[at] = (high - low - (n - 1.0) * kappa * before) / (n + 2.0);
    }
    moments
}

/// Cauchy's kernel over a piece.
fn cauchy<N: Local>(piece: &Piece, radius: f64, at: &[N; 3]) -> N {
    match piece {
        Piece::Segment(segment) => cauchy_segment(segment, radius, at),
        Piece::Arc(arc) => cauchy_arc(arc, radius, at),
        Piece::Polygon(polygon) => cauchy_polygon(polygon, radius, at),
        Piece::Point(place) => {
            let away = less(at.clone(), *place);
            let u = dot(away.clone(), away).times(1.0 / (radius * radius));
            Kernel::Cauchy.of(u)
        }
        Piece::Quadratic(_) => N::constant(0.0),
    }
}

/// ∫ du/(p² + u²)² = u/(2p²(p² + u²)) + atan(u/p)/(2p³), in units of r.
fn cauchy_segment<N: Local>(segment: &Segment, radius: f64, at: &[N; 3]) -> N {
    let inverse = 1.0 / radius;
    let away = less(at.clone(), segment.start);
    let s = along(away.clone(), segment.axis);
    let across = dot(away.clone(), away).minus(s.clone().square());
    let square = across.times(inverse * inverse).plus(N::constant(1.0));
    let p = square.clone().sqrt();
    let whole = |l: f64| {
        let u = N::constant(l).minus(s.clone()).times(inverse);
        let below = square.clone().plus(u.clone().square());
        let first = u.clone().over(below);
        first.plus(atan(u.over(p.clone())).over(p.clone()))
    };
    let sum = whole(segment.length).minus(whole(0.0));
    sum.over(square).times(0.5 * radius)
}

/// ∫ dα/(a − m cos α)² = [m sin α/(a − m cos α) + 2a/√(a² − m²) atan(√((a+m)/(a−m)) tan α/2)]/(a² − m²), |α| ≤ π.
fn cauchy_arc<N: Local>(arc: &Arc, radius: f64, at: &[N; 3]) -> N {
    let inverse = 1.0 / (radius * radius);
    let away = less(at.clone(), arc.centre);
    let (x, y) = (along(away.clone(), arc.x), along(away.clone(), arc.y));
    let near = dot(away.clone(), away).plus(N::constant(arc.radius * arc.radius));
    let a = near.times(inverse).plus(N::constant(1.0));
    let flat = x.clone().square().plus(y.clone().square());
    if flat.at() < 1e-18 * arc.radius * arc.radius {
        // On the axis all of the arc is equally far.
        return N::constant(arc.radius * arc.angle).over(a.square());
    }
    let m = flat.sqrt().times(2.0 * arc.radius * inverse);
    // φ = φ₀ + atan(y′/x′) in axes turned by φ₀, where y′ is 0 but for its derivative.
    let phi = libm::atan2(y.at(), x.at());
    let (cos, sin) = (libm::cos(phi), libm::sin(phi));
    let turned = y.clone().times(cos).minus(x.clone().times(sin));
    let ahead = x.times(cos).plus(y.times(sin));
    let beyond = atan(turned.over(ahead));
    let square = a.clone().square().minus(m.clone().square());
    let root = square.clone().sqrt();
    let stretch = a
        .clone()
        .plus(m.clone())
        .over(a.clone().minus(m.clone()))
        .sqrt();
    let whole = |alpha: N| {
        let (s, c) = (
            alpha.clone().unary(Unary::Sin),
            alpha.clone().unary(Unary::Cos),
        );
        let half = alpha.times(0.5);
        let tan = half.clone().unary(Unary::Sin).over(half.unary(Unary::Cos));
        let first = m.clone().mul(s).over(a.clone().minus(m.clone().mul(c)));
        let second = a
            .clone()
            .times(2.0)
            .over(root.clone())
            .mul(atan(stretch.clone().mul(tan)));
        first.plus(second)
    };
    let mut sum = N::constant(0.0);
    for turn in [-1.0, 0.0, 1.0] {
        let middle = phi + turn * core::f64::consts::TAU;
        let half = core::f64::consts::PI;
        let (from, to) = (
            larger(0.0, middle - half),
            smaller(arc.angle, middle + half),
        );
        if from < to {
            // At ±π itself the antiderivative does not move with φ: windows join there.
            let end = |theta: f64, free: bool| {
                let alpha = N::constant(theta - middle);
                whole(if free {
                    alpha.minus(beyond.clone())
                } else {
                    alpha
                })
            };
            sum = sum
                .plus(end(to, to == arc.angle))
                .minus(end(from, from == 0.0));
        }
    }
    sum.over(square).times(arc.radius)
}

/// With A = 1 + h²/r², B² = A + e²/r²: an edge gives e r/(2AB) [atan(t/(rB))].
fn cauchy_polygon<N: Local>(polygon: &Polygon, radius: f64, at: &[N; 3]) -> N {
    let inverse = 1.0 / radius;
    over_edges(polygon, at, |over| {
        let a = over.square.times(inverse * inverse).plus(N::constant(1.0));
        let e = over.left;
        let b = a
            .clone()
            .plus(e.clone().square().times(inverse * inverse))
            .sqrt();
        let angle = |t: N| atan(t.times(inverse).over(b.clone()));
        let seen = angle(over.to).minus(angle(over.from));
        e.mul(seen).over(a.mul(b.clone())).times(0.5 * radius)
    })
}
