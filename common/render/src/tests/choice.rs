//! Which means an image takes.

use super::scenes;
use crate::crew::Alone;
use crate::trace::ground::COST;
use crate::trace::means::Trial;
use crate::trace::surface::Looks;
use crate::trace::{Means, Surface};
use crate::view::View;
use crate::{EvalSettings, SimdLevel};

#[test]
fn trials_that_end_early_find_what_whole_ones_find() {
    let mut seen = (0, 0);
    for (name, scene) in scenes::all() {
        let view = View::new(&scene.camera, &scene.film, 0.0);
        let settings = EvalSettings {
            level: SimdLevel::best(),
            means: None,
        };
        let chosen = Surface::prepared(&Alone, &scene, &view, settings, None).unwrap();
        let trial = Trial::new(&chosen, &view, &Alone);
        let least = |surface: &Surface| {
            let all = [Means::Values, Means::Tangents, Means::Stretches];
            let known = all.into_iter().filter(|means| surface.knows(*means));
            known
                .map(|means| {
                    let tried = Surface {
                        means,
                        looks: Looks::default(),
                        coarse: None,
                        ..surface.clone()
                    };
                    (means, trial.costs(&[tried], f64::INFINITY)[0])
                })
                .reduce(|best, other| if other.1 < best.1 { other } else { best })
                .unwrap()
        };
        let bare = least(&Surface {
            ground: None,
            ..chosen.clone()
        });
        if chosen.ground.is_some() {
            let led = least(&chosen);
            assert_eq!(chosen.means, led.0, "{name}");
            assert!(led.1 + COST < bare.1, "{name}: {led:?}, {bare:?}");
            seen.0 += 1;
        } else if !matches!(chosen.means, Means::Ranges(_)) {
            assert_eq!(chosen.means, bare.0, "{name}");
            seen.1 += 1;
        }
    }
    assert!(seen.0 > 0 && seen.1 > 1, "{seen:?}");
}
