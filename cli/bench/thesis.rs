//! The experiment of thesis §5.2.3 and §5.4.3: surfaces, camera, bounds and ε, fixed here beforehand, and what the thesis found.
//!
//! The thesis gives the field (5.11), 800×800 pixels and η; not its camera, its bounds, its ε or which rays it averages over.
//! Here: parallel rays along +y, 3.2 m from edge to edge (`scenes/sphere-noise.toml`); each ray between its ends on
//! the sphere that no value of the field's noises reaches beyond; averages over the rays that meet that sphere.
//! ε is 10⁻⁷ m unless told otherwise: with it and λ_N = 2.75, sphere tracing takes 79.4 steps against the thesis's 78.19, and
//! the speculative one takes 0.80 back against 0.78. So ratios can be compared, and counts with their sensitivity to ε in mind.

/// Width of the image plane, metres.
pub(crate) const WIDTH: f64 = 3.2;

/// How far before the origin rays start, metres.
pub(crate) const DISTANCE: f64 = 4.0;

/// The overshoot η of thesis §5.2.2.
pub(crate) const OVERSHOOT: f64 = 1.46;

/// A row of tables 5.1 to 5.5: a noise under eq. (5.11).
#[derive(Debug)]
pub(crate) struct Row {
    /// The noise's name in the tables.
    pub(crate) noise: &'static str,
    /// The noise as a field expression of `q`.
    pub(crate) expression: &'static str,
    /// How its values are normalised, where the thesis leaves it open.
    pub(crate) normalisation: &'static str,
    /// How far from 0 its values are taken to be where rays are clipped: no root is looked for beyond.
    pub(crate) reach: f64,
    /// λ_N of table 5.1.
    pub(crate) lipschitz_thesis: f64,
    /// A λ_N that is a bound; `None` where there is none of use.
    pub(crate) lipschitz_true: Option<f64>,
    /// Table 5.1: steps of sphere tracing, of speculative sphere tracing, and steps taken back.
    pub(crate) steps: [f64; 3],
    /// Tables 5.2 to 5.4: evaluations of IA, standard AA, reduced AA, and reduced AA with interval optimisation.
    pub(crate) evaluations: [f64; 4],
    /// The same, seconds.
    pub(crate) seconds: [f64; 4],
    /// Table 5.1: seconds of sphere tracing and of speculative sphere tracing.
    pub(crate) tracing: [f64; 2],
}

/// The noises of the tables.
pub(crate) const ROWS: [Row; 3] = [
    Row {
        noise: "gradient",
        expression: "noise(q)",
        normalisation: "as eq. (4.9): values to 1.0363",
        reach: 1.037,
        lipschitz_thesis: 2.75,
        lipschitz_true: Some(3.75),
        steps: [78.19, 55.37, 0.78],
        evaluations: [116.57, 61.69, 61.69, 46.39],
        seconds: [455.0, 2441.0, 403.0, 304.0],
        tracing: [86.0, 60.0],
    },
    Row {
        noise: "sparse convolution",
        expression: "sparse(q, #{nodes: 2})",
        normalisation: "this program's, K = 2; values beyond 4 would be cut off",
        reach: 4.0,
        lipschitz_thesis: 2.0,
        lipschitz_true: None,
        steps: [77.71, 54.27, 0.71],
        evaluations: [87.65, 47.99, 47.99, 30.92],
        seconds: [1606.0, 2287.0, 780.0, 478.0],
        tracing: [823.0, 577.0],
    },
    Row {
        noise: "cellular texture",
        expression: "cellular(q)",
        normalisation: "this program's, without bias",
        reach: 1.7,
        lipschitz_thesis: 1.0,
        lipschitz_true: Some(1.0),
        steps: [30.77, 26.51, 4.05],
        evaluations: [45.80, 34.16, 42.48, 30.03],
        seconds: [1851.0, 10257.0, 1876.0, 1441.0],
        tracing: [607.0, 525.0],
    },
];

impl Row {
    /// Eq. (5.11) with this noise.
    pub(crate) fn field(&self) -> String {
        let layer = |amplitude: f64, frequency: f64| {
            let noise = self.expression.replace('q', &format!("{frequency:?}*p"));
            format!(" + {amplitude:?}*{noise}")
        };
        let layers: String = LAYERS.iter().map(|&(a, f)| layer(a, f)).collect();
        format!("length(p) - 1.0{layers}")
    }

    /// Eq. (5.12): λ = 1 + 3.2 λ_N.
    pub(crate) fn lipschitz(noise: f64) -> f64 {
        1.0 + 3.2 * noise
    }

    /// Radius of the sphere beyond which the field is positive, metres.
    pub(crate) fn radius(&self) -> f64 {
        1.0 + LAYERS.iter().map(|(amplitude, _)| amplitude).sum::<f64>() * self.reach
    }
}

/// Amplitude and frequency of each layer of eq. (5.11).
const LAYERS: [(f64, f64); 3] = [(0.3, 4.0), (0.15, 8.0), (0.05, 16.0)];
