//! Second derivatives of the blending functions: by u = ρ², and along straight lines in space.

use super::Kernel;
use crate::interval::Interval;

/// Room for rounding in second derivatives, which are at most some twenty.
const ROOM: f64 = 1e-9;

impl Kernel {
    /// Whether it is (1 − u)².
    #[inline(always)]
    pub(crate) fn is_parabola(self) -> bool {
        matches!(self, Self::Murakami)
    }

    /// Whether it lies above its tangents as a function of u.
    #[inline(always)]
    pub(crate) fn is_convex(self) -> bool {
        !matches!(self, Self::Hart)
    }

    /// No less than its second derivative by u anywhere from `low` to `high`, and than 0.
    #[inline(always)]
    pub(crate) fn bend_most(self, low: f64, high: f64) -> f64 {
        let least = if low > 0.0 { low } else { 0.0 };
        let bend = match self {
            Self::Blinn => libm::exp(-least),
            // It is 0 to u = 1/9, and falls from there.
            Self::Metaballs => {
                let from = if least > 1.0 / 9.0 { least } else { 1.0 / 9.0 };
                let bend = 0.75 / (from * from.sqrt());
                if high < 1.0 / 9.0 { 0.0 } else { bend }
            }
            Self::Wyvill => (34.0 - 24.0 * least) / 9.0,
            Self::Murakami => 2.0,
            // −7.5/ρ + 30 − 22.5ρ rises to u = 1/3 and falls from there.
            Self::Hart => {
                let from = if least > 1.0 / 3.0 { least } else { 1.0 / 3.0 };
                let peak = if high < from { high } else { from };
                let rho = peak.sqrt();
                30.0 - 7.5 / rho - 22.5 * rho
            }
            Self::Cauchy => {
                let square = (1.0 + least) * (1.0 + least);
                6.0 / (square * square)
            }
        };
        let is_beyond = self.ends() & (least >= 1.0);
        let bend = if bend > 0.0 { bend } else { 0.0 };
        // What is exact stays so.
        let room = if matches!(self, Self::Murakami) {
            0.0
        } else {
            ROOM
        };
        if is_beyond { 0.0 } else { bend + room }
    }

    /// All second derivatives along straight lines by their length in ρ, at distances ρ from a point.
    ///
    /// With u = ρ² a line at the angle θ to the way from the point has 2h′ + 4u h″ cos² θ: from across
    /// the way to along it.
    pub(crate) fn bend(self, rho: Interval) -> Interval {
        self.bends(rho, |[across, turn]| {
            Interval::point(across).hull(Interval::point(across + turn))
        })
    }

    /// The same about a convex body: along its flat parts u itself bends less, or not at all.
    pub(crate) fn bend_of_convex(self, rho: Interval) -> Interval {
        self.bends(rho, |[across, turn]| {
            let turn = Interval::point(turn).hull(Interval::point(0.0));
            let across = Interval::point(across).hull(Interval::point(0.0));
            across.add(turn)
        })
    }

    /// The hull of what `of` makes of 2h′ and of 4u h″ at distances ρ.
    fn bends(self, rho: Interval, of: impl Fn([f64; 2]) -> Interval) -> Interval {
        let ends = if self.ends() { 1.0 } else { f64::INFINITY };
        let at = |rho: f64| of(self.bends_at(rho));
        let mut all = if rho.high < ends && rho.high.is_finite() {
            at(rho.high)
        } else {
            Interval::point(0.0)
        };
        if rho.low < ends {
            // Before a jump at the end.
            let last = if rho.high < ends {
                rho.high
            } else {
                1.0 - 1e-12
            };
            all = all.hull(at(rho.low)).hull(at(last));
            for &turn in self.turns() {
                for near in [turn - 1e-9, turn, turn + 1e-9] {
                    if rho.low <= near && near <= rho.high {
                        all = all.hull(at(near));
                    }
                }
            }
        }
        all.expand(1e3 * ROOM)
    }

    /// Between these ρ both 2h′, 4u h″ and their sum rise or fall.
    fn turns(self) -> &'static [f64] {
        match self {
            Self::Blinn => &[1.0, 1.224_744_871],
            Self::Metaballs => &[1.0 / 3.0],
            Self::Wyvill => &[0.841_625_412, 0.921_954_446],
            Self::Murakami => &[],
            Self::Hart => &[
                0.150_472_076,
                0.211_324_865,
                1.0 / 3.0,
                0.738_416_812,
                0.788_675_135,
            ],
            Self::Cauchy => &[0.577_350_269, 0.774_596_669],
        }
    }

    /// 2h′ and 4u h″.
    fn bends_at(self, rho: f64) -> [f64; 2] {
        let u = rho * rho;
        let [_, slope, bend] = self.jet(u);
        let turn = 4.0 * u * bend;
        [2.0 * slope, if turn.is_nan() { 0.0 } else { turn }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_second_derivative_is_outside_its_bounds() {
        for kernel in Kernel::ALL {
            let steps = 400;
            let rho = |i: u32| f64::from(i) * 0.004;
            for from in (0..steps).step_by(7) {
                for to in [from, from + 1, from + 11, from + 90] {
                    let (low, high) = (rho(from), rho(to));
                    let known = kernel.bend(Interval::new(low, high));
                    let most = kernel.bend_most(low * low, high * high);
                    let mut widest = f64::NEG_INFINITY;
                    for i in 0..=20 {
                        let rho = low + (high - low) * f64::from(i) / 20.0;
                        let [_, slope, bend] = kernel.jet(rho * rho);
                        assert!(
                            bend <= most,
                            "{kernel:?} at {rho} of {low} to {high}: {bend} {most}"
                        );
                        for share in [0.0, 0.3, 1.0] {
                            let along = 2.0 * slope + 4.0 * rho * rho * bend * share;
                            assert!(
                                known.contains(along),
                                "{kernel:?} at {rho}: {along} {known:?}"
                            );
                        }
                        widest = widest.max(bend);
                    }
                    // And the bounds are not far off: of Metaballs and at an end there are jumps.
                    let is_far = most > widest.max(0.0) * 1.3 + 0.2;
                    let jumps = high >= 1.0 || matches!(kernel, Kernel::Metaballs);
                    assert!(!is_far || jumps, "{kernel:?} {low} {high}: {widest} {most}");
                }
            }
        }
    }
}
