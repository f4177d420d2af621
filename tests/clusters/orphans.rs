//! No orphan: after a cancelled job, and after a killed coordinator and `flyby site clean`, neither queue, processes nor
//! site hold anything of the job.

use crate::engine::{Engine, Kind};
use crate::flight::Flight;
use crate::harness::scenes::ENDLESS;
use crate::harness::wait;

/// Nothing of ours is in the queue.
fn queue_is_empty(engine: &Engine) -> bool {
    !engine.tool("qstat", &["-u", "*"]).contains("flyby-")
}

#[test]
#[ignore = "long: tests/run --all"]
fn grid_engine_is_left_as_it_was() {
    let Some(engine) = Engine::gridengine(2, &[]) else {
        return;
    };
    for mode in [
        "mode = 'pilot'\nidle = '3 s'",
        "mode = 'poll'\nmin_tile_pixels = 2500",
    ] {
        // More than run at a time, so that some wait in the queue.
        let more = format!("{mode}\nmax_running = 8");
        let mut flight = Flight::over_tls(&engine, Kind::GridEngine, &more);
        let under_way = |flight: &Flight| {
            let job = flight.farm.submit(&ENDLESS);
            flight.farm.wait_acknowledged(job, 1);
            assert!(!queue_is_empty(&engine));
            job.to_string()
        };
        let job = under_way(&flight);
        flight.farm.flyby(["job", "cancel", &job]).ok();
        wait::until("the queue is empty", || {
            queue_is_empty(&engine).then_some(())
        });
        flight.runs_nothing();
        // What stays is the farm's own: what tasks said, and how workers join that come next.
        wait::until("nothing of the job lies there", || {
            let files = flight.farm.place.files("there");
            let is_farm_s = |file: &String| {
                let parts = ["/log/", "/token", "/joined"];
                parts.iter().any(|part| file.contains(part))
            };
            files.iter().all(is_farm_s).then_some(())
        });

        under_way(&flight);
        flight.farm.coordinator.kill();
        flight.clean();
        assert!(queue_is_empty(&engine));
        flight.has_left_nothing();
    }
}
