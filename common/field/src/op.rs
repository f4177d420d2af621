//! The operations of a field graph: numbers, names, what they take and what they give.
//!
//! An opcode, once released, is never given another meaning and never reused:
//! the canonical bytes of every scene hold them.

/// What a node of a graph yields at a point.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// One number.
    Scalar,
    /// Three numbers: a place or a direction.
    Vector,
}

/// The shape of a noise within a frequency cascade.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Basis {
    /// f_N itself, as in thesis eq. (3.40).
    Plain,
    /// |f_N|, Perlin's turbulence (thesis §3.3.3).
    Absolute,
    /// (1 − |f_N|)², Musgrave's ridged noise (thesis §3.3.3).
    Ridged,
}

impl Basis {
    /// Every basis, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Plain, Self::Absolute, Self::Ridged];

    /// The number that stands for it among a node's parameters.
    pub fn number(self) -> f64 {
        match self {
            Self::Plain => 0.0,
            Self::Absolute => 1.0,
            Self::Ridged => 2.0,
        }
    }

    /// The basis of that number.
    pub fn from_number(number: f64) -> Option<Self> {
        Self::ALL.into_iter().find(|basis| basis.number() == number)
    }
}

/// How many parameters an operation takes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Params {
    /// Exactly these, by name.
    Named(&'static [&'static str]),
    /// Pairs of an instant and a value, at least one, instants rising.
    Keys,
    /// A list of numbers, as long as the operation wants it.
    List,
    /// These, by name, then a noise: its opcode and its constants. Then a Hurst coefficient for each octave, or none.
    OverNoise(&'static [&'static str]),
}

/// What an operation takes and gives.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Signature {
    /// Its name in messages and listings.
    pub name: &'static str,
    /// The kinds of its arguments.
    pub args: &'static [Kind],
    /// Its constants.
    pub params: Params,
    /// What it yields.
    pub result: Kind,
}

macro_rules! ops {
    ($($(#[doc = $doc:literal])+ $op:ident = $code:literal $name:literal ($($arg:ident),*) $params:expr => $result:ident;)+) => {
        /// An operation of a field graph. `a`, `b`, `c` are its arguments in order.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
        #[repr(u16)]
        pub enum Op { $($(#[doc = $doc])+ $op = $code,)+ }

        impl Op {
            /// Every operation, by rising opcode.
            pub const ALL: &'static [Self] = &[$(Self::$op),+];

            /// What it takes and gives.
            pub const fn signature(self) -> Signature {
                match self {
                    $(Self::$op => Signature {
                        name: $name,
                        args: &[$(Kind::$arg),*],
                        params: $params,
                        result: Kind::$result,
                    },)+
                }
            }
        }
    };
}

const NONE: Params = Params::Named(&[]);
const CASCADE: Params = Params::Named(&[
    "basis",
    "key",
    "lacunarity",
    "hurst",
    "octaves",
    "xi",
    "detail",
]);

const CELLULAR: Params = Params::Named(&[
    "key", "norm", "density", "a1", "a2", "a3", "a4", "raised", "unbiased",
]);

ops! {
    /// The constant `value`.
    Constant = 1 "constant" () Params::Named(&["value"]) => Scalar;
    /// The point itself, in world metres.
    Position = 2 "p" () NONE => Vector;
    /// The instant in seconds from image 0.
    Time = 3 "t" () NONE => Scalar;
    /// A curve over `a`: `keys` are (instant, value) pairs, joined by straight lines, constant outside.
    Linear = 4 "linear" (Scalar) Params::Keys => Scalar;
    /// A curve over `a`: monotone cubic through the keys, constant outside.
    Smooth = 5 "smooth" (Scalar) Params::Keys => Scalar;

    /// (a, b, c).
    Vector = 16 "vec" (Scalar, Scalar, Scalar) NONE => Vector;
    /// The first component.
    X = 17 "x" (Vector) NONE => Scalar;
    /// The second component.
    Y = 18 "y" (Vector) NONE => Scalar;
    /// The third component: up.
    Z = 19 "z" (Vector) NONE => Scalar;
    /// a + b.
    VectorAdd = 20 "add" (Vector, Vector) NONE => Vector;
    /// a − b.
    VectorSub = 21 "sub" (Vector, Vector) NONE => Vector;
    /// a times the number b.
    Scale = 22 "scale" (Vector, Scalar) NONE => Vector;
    /// ‖a‖; its gradient at the origin is zero.
    Length = 23 "length" (Vector) NONE => Scalar;
    /// a · b.
    Dot = 24 "dot" (Vector, Vector) NONE => Scalar;
    /// `radius` · a/‖a‖: the nearest point on a sphere, thesis eq. (2.25). The origin goes to itself.
    OntoSphere = 25 "onto_sphere" (Vector) Params::Named(&["radius"]) => Vector;
    /// (x, y, 0): the nearest point on the horizontal plane, thesis eq. (2.24).
    OntoPlane = 26 "onto_plane" (Vector) NONE => Vector;

    /// a + b.
    Add = 32 "+" (Scalar, Scalar) NONE => Scalar;
    /// a − b.
    Sub = 33 "-" (Scalar, Scalar) NONE => Scalar;
    /// a b.
    Mul = 34 "*" (Scalar, Scalar) NONE => Scalar;
    /// a / b.
    Div = 35 "/" (Scalar, Scalar) NONE => Scalar;
    /// −a.
    Neg = 36 "neg" (Scalar) NONE => Scalar;
    /// |a|.
    Abs = 37 "abs" (Scalar) NONE => Scalar;
    /// The smaller of a and b.
    Min = 38 "min" (Scalar, Scalar) NONE => Scalar;
    /// The larger of a and b.
    Max = 39 "max" (Scalar, Scalar) NONE => Scalar;
    /// √a, 0 for a < 0.
    Sqrt = 40 "sqrt" (Scalar) NONE => Scalar;
    /// sign(a) · |a|^`exponent` (ERRATA row 1232: the sign is kept).
    Power = 41 "pow" (Scalar) Params::Named(&["exponent"]) => Scalar;
    /// sin a, radians.
    Sin = 42 "sin" (Scalar) NONE => Scalar;
    /// cos a, radians.
    Cos = 43 "cos" (Scalar) NONE => Scalar;
    /// eᵃ.
    Exp = 44 "exp" (Scalar) NONE => Scalar;
    /// 0 below `low`, 1 above `high`, 3u² − 2u³ between.
    SmoothStep = 45 "smoothstep" (Scalar) Params::Named(&["low", "high"]) => Scalar;
    /// b where a < 0, else c.
    Select = 46 "select" (Scalar, Scalar, Scalar) NONE => Scalar;

    /// Gradient noise f_N(a), thesis eq. (4.9), over the lattice of `key`.
    Noise = 64 "noise" (Vector) Params::Named(&["key"]) => Scalar;
    /// Rescale-and-add, thesis eqs. (3.40)–(3.42) mended: Σ r^{−iH} basis(rⁱ a), i = 0 … octaves − 1.
    Sum = 65 "fbm" (Vector) CASCADE => Scalar;
    /// Musgrave's first statistics-by-altitude model, thesis eq. (3.44), started at basis(a) + ξ.
    AltitudeOne = 66 "altitude1" (Vector) CASCADE => Scalar;
    /// Musgrave's second statistics-by-altitude model, thesis eq. (3.45), started at basis(a) + ξ.
    AltitudeTwo = 67 "altitude2" (Vector) CASCADE => Scalar;
    /// Musgrave's ridged multifractal: s₀ = (o − |n|)², sᵢ = clamp(g sᵢ₋₁, 0, 1)(o − |n|)², Σ r^{−iH} sᵢ.
    RidgedMultifractal = 68 "ridged_multifractal" (Vector) Params::Named(&[
        "key", "lacunarity", "hurst", "octaves", "offset", "gain", "detail",
    ]) => Scalar;

    /// Value noise at a, thesis eq. (4.11), over the lattice of `key`.
    ValueNoise = 80 "value_noise" (Vector) Params::Named(&["key"]) => Scalar;
    /// Value-gradient noise at a, thesis eq. (4.12).
    ValueGradientNoise = 81 "value_gradient_noise" (Vector) Params::Named(&["key"]) => Scalar;
    /// Simplex noise at a, thesis §4.3.2.
    SimplexNoise = 82 "simplex" (Vector) Params::Named(&["key"]) => Scalar;
    /// Sparse convolution noise at a, thesis eq. (4.13): `nodes` per cell, `kernel` and `scatter` by their numbers.
    SparseNoise = 83 "sparse" (Vector) Params::Named(&["key", "nodes", "kernel", "scatter"]) => Scalar;
    /// Cellular noise at a, thesis eqs. (4.18), (4.20): Σ a_l (ψ(φ_l) − μ_l), `norm` 0 for the maximum norm, ψ(d) = d^(1 + `raised`).
    CellularNoise = 84 "cellular" (Vector) CELLULAR => Scalar;
    /// Spot noise at a, thesis eq. (4.17): `nodes` per cell with `kernel`, `stretch` times as long as wide along
    /// (`x`, `y`, `z`), or along a random axis if that is 0, with radii from 1 − `variety` to 1.
    SpotNoise = 85 "spot" (Vector) Params::Named(&[
        "key", "nodes", "kernel", "stretch", "variety", "axis x", "axis y", "axis z",
    ]) => Scalar;
    /// Wavelet noise at a, thesis eq. (4.23).
    WaveletNoise = 86 "wavelet" (Vector) Params::Named(&["key"]) => Scalar;
    /// Cellular noise in two dimensions: as 84 over nodes of the plane, by the first two components of a alone.
    PlaneCellularNoise = 87 "cellular of two dimensions" (Vector) CELLULAR => Scalar;
    /// A cascade as 65 to 68 (`model` 0 to 3 in their order) over any noise, from octave `first` on;
    /// after the noise a Hurst coefficient for each octave, or none.
    Cascade = 88 "cascade" (Vector) Params::OverNoise(&[
        "model", "basis", "key", "lacunarity", "hurst", "octaves", "xi", "detail", "offset", "gain", "first",
    ]) => Scalar;
    /// The gradient of a smooth noise at a, thesis eq. (4.2).
    NoiseGradient = 89 "noise_gradient" (Vector) Params::OverNoise(&[]) => Vector;

    /// An algebraic surface, thesis §2.2.2: terms (i, j, k, c) of Σ c xⁱ yʲ zᵏ.
    Polynomial = 128 "polynomial" (Vector) Params::List => Scalar;
    /// A superquadric, thesis eq. (2.6), by ε₁ and ε₂.
    Superquadric = 129 "superquadric" (Vector) Params::Named(&["e1", "e2"]) => Scalar;
    /// A blobby surface, thesis eq. (2.9): kernel, threshold, far field, then (x, y, z, radius, weight) each.
    Blobs = 130 "blobs" (Vector) Params::List => Scalar;
    /// Two surfaces joined without a crease, thesis eq. (2.14) mended: `kind` 0 Ricci's union, 1 his
    /// intersection, 2 a local union, 3 a local intersection; `size` is his exponent or the local width.
    Blend = 131 "blend" (Scalar, Scalar) Params::Named(&["kind", "size"]) => Scalar;
    /// A distance surface, thesis eq. (2.10): kernel, threshold, far field, then primitives: each its kind (0 point,
    /// 1 line, 2 polygon, 3 quadratic B-spline, 4 arc), radius, weight, the count of its numbers, and these.
    Distances = 132 "distances" (Vector) Params::List => Scalar;
    /// A convolution surface, thesis eq. (2.11), of the same constants.
    Convolution = 133 "convolution" (Vector) Params::List => Scalar;
    /// A trivariate Bernstein polynomial, of which free-form deformations are made: three degrees, the box's least
    /// and greatest corner, control values with x fastest. Beyond the box it goes on as on its faces.
    Bernstein = 134 "bernstein" (Vector) Params::List => Scalar;
    /// Where the points of a bent body come from (Barr 1984): its x (`part` 0) or z (`part` 1). It bends towards +x
    /// by `rate` radians a metre between the heights `low` and `high`, and `centre` stays where it is.
    Bend = 135 "bend" (Vector) Params::Named(&["part", "rate", "low", "high", "centre"]) => Scalar;

    /// The samples of file number `asset` at a place counted in samples: [`crate::grid`].
    Grid = 192 "grid" (Vector) Params::Named(&["asset", "edges", "degree"]) => Scalar;
    /// fBm of unit variance by spectral synthesis, thesis eq. (3.27) mended, periodic over `size` samples.
    SpectralTerrain = 193 "spectral_terrain" (Vector)
        Params::Named(&["axes", "size", "hurst", "key", "degree"]) => Scalar;
    /// Heights in metres of a sea by Pierson and Moskowitz, periodic over `size` samples, `cell` metres apart.
    Sea = 194 "sea" (Vector)
        Params::Named(&["size", "cell", "wind", "direction", "key", "degree"]) => Scalar;
    /// fBm by midpoint subdivision, thesis eqs. (3.28)–(3.33), bounded, over 2^levels samples.
    MidpointTerrain = 195 "midpoint_terrain" (Vector)
        Params::Named(&["levels", "mesh", "additions", "hurst", "key", "degree"]) => Scalar;
}

impl Op {
    /// The number that stands for it in canonical bytes.
    pub const fn code(self) -> u16 {
        self as u16
    }

    /// The operation of that number.
    pub fn from_code(code: u16) -> Option<Self> {
        Self::ALL.iter().copied().find(|op| op.code() == code)
    }
}
