//! Somebody who submits jobs until they are taken, changes their mind, and wants to see frames.

use model::{ImageRef, JobId, Rect, Resolution, SubmissionId};
use sched::{Command, Event, JobOutcome, JobState, Needs, Paused, Sched, Submission, TileShape};

use crate::coordinator::{Coordinator, REVISION};
use crate::disk::{HEIGHT, Pixels, WIDTH, flaws};
use crate::plan::Plan;
use crate::random::Random;

/// How often it changes its mind.
const WISHES_MAX: u32 = 30;

#[derive(Debug)]
pub(crate) struct User {
    jobs: Vec<Job>,
    wishes: u32,
    is_honest: bool,
}

#[derive(Debug)]
struct Job {
    submission: Submission,
    /// Its jobs that this one is to wait for, by their places.
    after: Vec<usize>,
    /// Its number, once that was heard.
    job: Option<JobId>,
    /// Whether it is wanted no more.
    is_removed: bool,
}

impl User {
    pub(crate) fn new(plan: &Plan, random: &mut Random) -> Self {
        let mut jobs: Vec<Job> = Vec::new();
        for number in 0..plan.jobs {
            jobs.push(Job {
                submission: submission(number, plan.images, random),
                after: (0..jobs.len()).filter(|_| random.below(3) == 0).collect(),
                job: None,
                is_removed: false,
            });
        }
        Self {
            jobs,
            wishes: 0,
            is_honest: plan.troubles.liars == 0,
        }
    }

    pub(crate) fn hears(&mut self, submission: u128, number: JobId) {
        for job in &mut self.jobs {
            if job.submission.submission == SubmissionId(submission) {
                job.job = Some(number);
            }
        }
    }

    /// Whether every job is taken and finished, or cancelled or removed.
    pub(crate) fn is_content(&self, sched: &Sched) -> bool {
        let is_done = |job: &Job| {
            let view = job.job.and_then(|job| sched.job(job));
            let ends = |state| {
                let ends = [JobOutcome::Finished, JobOutcome::Cancelled].map(JobState::Over);
                ends.contains(&state)
            };
            match (job.job, view) {
                (_, Some(view)) => ends(view.state) && !job.is_removed,
                (Some(_), None) => job.is_removed,
                (None, None) => false,
            }
        };
        self.jobs.iter().all(is_done)
    }

    /// What it says in this second: again whatever was not answered, and perhaps something new.
    pub(crate) fn wants(&mut self, sched: &Sched, wishes: bool, random: &mut Random) -> Vec<Event> {
        let mut events = Vec::new();
        for job in &self.jobs {
            let Some(id) = job.job else {
                if let Some(after) = self.after(job, sched)
                    && random.below(3) == 0
                {
                    events.push(Event::Submit(Submission {
                        after,
                        ..job.submission.clone()
                    }));
                }
                continue;
            };
            let mut want = |command| events.push(Event::Command { job: id, command });
            let view = sched.job(id);
            if job.is_removed && view.is_some() && random.below(3) == 0 {
                want(Command::Remove);
            }
            // Nobody waits for ever, nor gives up on a frame.
            if view.is_some_and(|view| view.paused == Paused::Yes) && random.below(20) == 0 {
                want(Command::Resume);
            }
            let is_cancelled = |before: &JobId| {
                let cancelled = JobState::Over(JobOutcome::Cancelled);
                sched
                    .job(*before)
                    .is_some_and(|view| view.state == cancelled)
            };
            let is_in_vain = view.is_some_and(|view| view.after.iter().any(is_cancelled));
            if is_in_vain && random.below(8) == 0 {
                want(Command::Cancel);
            }
            let failed = JobState::Over(JobOutcome::Failed);
            if view.is_some_and(|view| view.state == failed) && random.below(8) == 0 {
                want(Command::Retry);
            }
        }
        if wishes && self.wishes < WISHES_MAX {
            self.wishes += 1;
            events.extend(self.wish(random));
        }
        events
    }

    /// The jobs that one waits for, but for those that are gone; nothing where the number of one is not heard yet.
    fn after(&self, job: &Job, sched: &Sched) -> Option<Vec<JobId>> {
        let numbers = job.after.iter().map(|&place| self.jobs[place].job);
        let mut numbers = numbers.collect::<Option<Vec<JobId>>>()?;
        numbers.retain(|&number| sched.job(number).is_some());
        Some(numbers)
    }

    fn wish(&mut self, random: &mut Random) -> Option<Event> {
        let index = usize::try_from(random.below(self.jobs.len() as u64)).expect("it is small");
        let wanted = &mut self.jobs[index];
        let job = wanted.job?;
        let frames = wanted.submission.frames;
        let command = match random.below(20) {
            0..5 => Command::Pause,
            5..8 => Command::Resume,
            8..10 => Command::Priority(i32::try_from(random.below(5)).expect("it is small") - 2),
            10 => Command::Share(1 + u32::try_from(random.below(5)).expect("it is small")),
            11 => Command::Focus(Some(Rect {
                x0: 10,
                y0: 10,
                x1: 70,
                y1: 40,
            })),
            12 => Command::Focus(None),
            13..15 => Command::Retry,
            15..18 => {
                let place =
                    u32::try_from(random.below(frames.count().into())).expect("it is small");
                Command::Again(frames.nth(place)?)
            }
            18 => Command::Cancel,
            _ => {
                // Said until it is so.
                wanted.is_removed = true;
                return None;
            }
        };
        Some(Event::Command { job, command })
    }

    /// Every frame of every finished job is in its place, whole and right.
    pub(crate) fn looks_at(&self, coordinator: &Coordinator) {
        for id in self.jobs.iter().filter_map(|job| job.job) {
            let Some(view) = coordinator.sched.job(id) else {
                continue;
            };
            if view.state != JobState::Over(JobOutcome::Finished) {
                continue;
            }
            assert_eq!(view.pixels_done, view.pixels, "{id:?}");
            for image in view.frames.iter() {
                let image = ImageRef { job: id, image };
                let frame = &coordinator.disk.frames[&image];
                let (missing, wrong) = flaws(image, frame);
                assert_eq!(missing, 0, "{image:?} is whole");
                assert!(wrong == 0 || !self.is_honest, "{image:?} is right");
            }
        }
    }
}

fn submission(number: u64, images: u64, random: &mut Random) -> Submission {
    let images = 1 + random.below(images);
    let sizes = [(64, 64), (40, 60), (200, 25), (200, 150)];
    let (width, height) = sizes[usize::try_from(random.below(4)).expect("it is small")];
    Submission {
        submission: SubmissionId(u128::from(number) + 1),
        name: "flyby".into(),
        scene: Pixels::Right.digest(),
        revision: REVISION,
        frames: format!("0..{images}").parse().expect("a range"),
        window: Resolution {
            width: WIDTH,
            height: HEIGHT,
        }
        .rect(),
        tiles: match random.below(4) {
            0 => TileShape::Rule {
                min_tile_pixels: None,
            },
            1 => TileShape::Time { aim: None },
            _ => TileShape::Size { width, height },
        },
        priority: 0,
        share: 1,
        needs: Needs::default(),
        after: Vec::new(),
    }
}
