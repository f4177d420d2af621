//! Mistakes, planted around the scheduler's events and effects: each is caught within 100 keys.

use crate::plan::{Bug, Plan, Troubles};
use crate::run::{one, smallest};

/// Finds the first key whose farm breaks, which must say this of it; the smallest such farm breaks too.
fn is_caught(bug: Bug, saying: &str) {
    let plan = |key| Plan {
        bug: Some(bug),
        ..Plan::new(key, Troubles::ALL)
    };
    let caught = (0..100).find_map(|key| Some((plan(key), one(plan(key)).err()?)));
    let (plan, broken) = caught.expect("it is caught within 100 keys");
    assert!(broken.contains(saying), "key {}: {broken}", plan.key);
    let (small, broken) = smallest(plan, broken);
    assert_eq!(
        one(small).err(),
        Some(broken),
        "the same plan breaks the same way"
    );
    assert_eq!(
        one(Plan { bug: None, ..small }).err(),
        None,
        "it is the mistake's fault"
    );
    println!("{bug:?}: key {}, at the smallest {small:?}", plan.key);
}

#[test]
fn lost_acknowledgement() {
    is_caught(Bug::LostAcknowledgement, "acknowledged");
}

#[test]
fn missing_sync() {
    is_caught(Bug::MissingSync, "what is committed was synced");
}

#[test]
fn double_commit() {
    is_caught(Bug::DoubleCommit, "an image is put in its place once");
}

#[test]
fn stale_attempt_accepted() {
    is_caught(Bug::StaleAttempt, "a block of a dead attempt never counts");
}

#[test]
fn lease_never_ending() {
    is_caught(Bug::EndlessLease, "every lease ends");
}

#[test]
fn unbounded_queue() {
    is_caught(Bug::UnboundedQueue, "blocks that wait are bounded");
}

#[test]
fn missing_ignored() {
    is_caught(Bug::FetchedAgain, "what is durable is not fetched again");
}

#[test]
fn waiting_forgotten() {
    is_caught(Bug::NoPatience, "jobs that wait are not begun");
}
