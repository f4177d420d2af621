//! Places in the form that fields are evaluated over.

use field::Points;
use glam::DVec3;

/// Places with their footprints and instants, as structure of arrays.
#[derive(Default)]
pub(crate) struct Places {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    footprint: Vec<f64>,
    time: Vec<f64>,
}

impl Places {
    pub(crate) fn len(&self) -> usize {
        self.x.len()
    }

    pub(crate) fn push(&mut self, place: DVec3, footprint: f64, time: f64) {
        self.x.push(place.x);
        self.y.push(place.y);
        self.z.push(place.z);
        self.footprint.push(footprint);
        self.time.push(time);
    }

    /// Makes the footprint of one place `factor` times as wide.
    pub(crate) fn widen(&mut self, index: usize, factor: f64) {
        self.footprint[index] *= factor;
    }

    pub(crate) fn batch(&self, first: usize, count: usize) -> Points<'_> {
        let range = first..first + count;
        Points {
            x: &self.x[range.clone()],
            y: &self.y[range.clone()],
            z: &self.z[range.clone()],
            footprint: &self.footprint[range.clone()],
            time: &self.time[range],
        }
    }

    pub(crate) fn clear(&mut self) {
        for column in [
            &mut self.x,
            &mut self.y,
            &mut self.z,
            &mut self.footprint,
            &mut self.time,
        ] {
            column.clear();
        }
    }
}
