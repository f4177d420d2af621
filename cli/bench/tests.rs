//! The experiment is the thesis's.

use super::thesis::{ROWS, Row};

#[test]
fn fields_are_eq_5_11_with_the_bound_of_eq_5_12() {
    assert_eq!(
        ROWS[0].field(),
        "length(p) - 1.0 + 0.3*noise(4.0*p) + 0.15*noise(8.0*p) + 0.05*noise(16.0*p)"
    );
    assert!((Row::lipschitz(3.75) - 13.0).abs() < 1e-12);
    assert!((Row::lipschitz(2.75) - 9.8).abs() < 1e-12);
    assert!((ROWS[0].radius() - 1.5185).abs() < 1e-12);
}
