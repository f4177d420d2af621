//! The few operations on places and directions that poses need, with a fixed order of rounding.

/// Three numbers: metres in world space, or a direction.
pub(crate) type Vector = [f64; 3];

pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(crate) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn scale(a: Vector, factor: f64) -> Vector {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// ‖a‖, without overflow or underflow on the way.
pub(crate) fn length(a: Vector) -> f64 {
    libm::hypot(libm::hypot(a[0], a[1]), a[2])
}

/// a/‖a‖; `None` where a has no direction.
pub(crate) fn direction(a: Vector) -> Option<Vector> {
    let norm = length(a);
    (norm > 0.0 && norm.is_finite()).then(|| scale(a, 1.0 / norm))
}

/// `cosine` · a + `sine` · b: a turned towards b, when both are unit vectors at right angles.
pub(crate) fn turn(a: Vector, b: Vector, (sine, cosine): (f64, f64)) -> Vector {
    add(scale(a, cosine), scale(b, sine))
}

/// East, north and up at a latitude and a longitude of a sphere about the origin, +z its north pole.
pub(crate) fn local_frame(latitude: f64, longitude: f64) -> [Vector; 3] {
    let (sin_lat, cos_lat) = libm::sincos(latitude);
    let (sin_lon, cos_lon) = libm::sincos(longitude);
    [
        [-sin_lon, cos_lon, 0.0],
        [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
        [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
    ]
}
