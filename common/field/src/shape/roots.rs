//! Real roots of small polynomials between 0 and 1.

/// Most steps to one root; each at least halves what is left after two.
const STEPS: usize = 80;

/// Calls `found` with the places in [0, 1] where the polynomial of those coefficients, lowest first,
/// changes its sign, in rising order. At most four of them.
pub(crate) fn between_0_and_1(coefficients: &[f64; 5], mut found: impl FnMut(f64)) {
    let mut lists = [*coefficients; 5];
    for k in 1..5 {
        lists[k] = derivative(&lists[k - 1]);
    }
    // From the constant fourth derivative down: between two extrema there is at most one root.
    let mut stops = [0.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let mut count = 2;
    for k in (0..4).rev() {
        let mut next = [0.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        let mut roots = 1;
        for pair in stops[..count].windows(2) {
            if let Some(root) = root(&lists[k], &lists[k + 1], pair[0], pair[1]) {
                next[roots] = root;
                roots += 1;
            }
        }
        next[roots] = 1.0;
        (stops, count) = (next, roots + 1);
    }
    for root in &stops[1..count - 1] {
        found(*root);
    }
}

fn derivative(c: &[f64; 5]) -> [f64; 5] {
    [c[1], 2.0 * c[2], 3.0 * c[3], 4.0 * c[4], 0.0]
}

fn value(c: &[f64; 5], t: f64) -> f64 {
    c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * c[4])))
}

/// The root between two places of different sign: Newton's steps, halvings where they leave the bracket.
fn root(c: &[f64; 5], slope: &[f64; 5], from: f64, to: f64) -> Option<f64> {
    let (mut low, mut high) = (from, to);
    let rises = value(c, low) < 0.0;
    if rises == (value(c, high) < 0.0) {
        return None;
    }
    let mut t = 0.5 * (low + high);
    for _ in 0..STEPS {
        let f = value(c, t);
        if f == 0.0 {
            return Some(t);
        }
        if (f < 0.0) == rises {
            low = t;
        } else {
            high = t;
        }
        let newton = t - f / value(slope, t);
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - t).abs() <= 1e-16 {
            return Some(next);
        }
        t = next;
    }
    Some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roots(coefficients: [f64; 5]) -> Vec<f64> {
        let mut all = Vec::new();
        between_0_and_1(&coefficients, |root| all.push(root));
        all
    }

    #[test]
    fn every_change_of_sign_is_found() {
        // (t − 0.1)(t − 0.4)(t − 0.7)(t − 1.5)
        let mut c = [1.0, 0.0, 0.0, 0.0, 0.0];
        for root in [0.1, 0.4, 0.7, 1.5] {
            let mut next = [0.0; 5];
            for k in 0..5 {
                next[k] -= root * c[k];
                if k > 0 {
                    next[k] += c[k - 1];
                }
            }
            c = next;
        }
        let found = roots(c);
        assert_eq!(found.len(), 3, "{found:?}");
        for (seen, known) in found.iter().zip([0.1, 0.4, 0.7]) {
            assert!((seen - known).abs() < 1e-13, "{found:?}");
        }
        assert_eq!(roots([-0.25, 1.0, 0.0, 0.0, 0.0]), [0.25]);
        assert_eq!(roots([1.0, 0.0, 1.0, 0.0, 0.0]), [0.0; 0]);
        assert_eq!(roots([0.0; 5]), [0.0; 0]);
    }
}
