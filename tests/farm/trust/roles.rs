//! What each role may, call by call, over TLS.

use std::collections::BTreeSet;
use std::path::Path;

use tokio::runtime::Builder;
use wire::Failure;
use wire::proto::ErrorKind;
use wire::tls::token_file::TokenFile;
use wire::way::Way;

use crate::harness::{Farm, need, raw};

/// Every call, by the smallest role of users that may make it.
const CALLS: [(&str, &[&str]); 4] = [
    (
        "view",
        &[
            "Farm/ListJobs",
            "Farm/ShowJob",
            "Farm/WatchJob",
            "Farm/JobLog",
            "Farm/Why",
            "Farm/FetchFrame",
            "Farm/ListWorkers",
            "Farm/ListSites",
            "Farm/LookBack",
            "Farm/Info",
        ],
    ),
    (
        "submit",
        &["Farm/Submit", "Farm/CancelJob", "Farm/CommandJob"],
    ),
    (
        "operate",
        &[
            "Farm/Clean",
            "Farm/DrainWorkers",
            "Farm/CreateToken",
            "Farm/ListTokens",
            "Farm/RevokeToken",
        ],
    ),
    (
        "nobody without a certificate",
        &[
            "Workers/Control",
            "Workers/Deliver",
            "Workers/FetchScene",
            "Workers/FetchAsset",
            "Joining/Renew",
        ],
    ),
];

/// The only call of strangers: it brings a secret.
const JOIN: &str = "Joining/Join";

fn calls_of_the_protocol() -> BTreeSet<String> {
    let mut calls = BTreeSet::new();
    for file in ["user", "worker", "joining"] {
        let path = format!("{}/proto/flyby/v1/{file}.proto", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).unwrap();
        let mut service = "";
        for line in text.lines() {
            if let Some(rest) = line.strip_prefix("service ") {
                service = rest.trim_end_matches(" {");
            } else if let Some(rest) = line.trim().strip_prefix("rpc ") {
                calls.insert(format!("{service}/{}", rest.split('(').next().unwrap()));
            }
        }
    }
    calls
}

#[test]
fn each_role_may_what_it_may_and_nothing_more() {
    let listed = CALLS.iter().flat_map(|(_, calls)| *calls).chain([&JOIN]);
    let listed: BTreeSet<_> = listed.map(|&call| call.to_owned()).collect();
    assert_eq!(listed, calls_of_the_protocol());
    let Some(address) = need::address() else {
        return;
    };
    let farm = Farm::reachable(address, &[]);
    let runtime = Builder::new_current_thread().enable_all().build().unwrap();
    let owner = std::fs::read_to_string(farm.place.state().join("token")).unwrap();
    let mut way = None;
    for (rank, role) in ["view", "submit", "operate", "worker", "owner"]
        .into_iter()
        .enumerate()
    {
        let secret = match role {
            // The state folder's token, brought to another machine.
            "owner" => owner.trim().to_owned(),
            role => {
                let file = farm.token(&format!("{role}.token"), &["--role", role]);
                let file = TokenFile::read(Path::new(&file)).unwrap();
                way.get_or_insert_with(|| Way::by_token(&file, None).unwrap());
                file.secret.reveal().to_owned()
            }
        };
        let way = way.as_ref().unwrap();
        for (needed, (_, calls)) in CALLS.iter().enumerate() {
            for call in *calls {
                let may = needed < 3 && (role == "owner" || rank < 3 && needed <= rank);
                // An empty message: whoever may call is told what is wrong with it, or answered.
                let answer = raw::call_over(&runtime, way, &secret, call, b"");
                let kind = answer.map_err(|status| Failure::from(status).kind);
                let stopped =
                    matches!(kind, Err(ErrorKind::Forbidden | ErrorKind::Unauthenticated));
                assert_eq!(stopped, !may, "{role} calls {call}: {kind:?}");
            }
        }
        let join = raw::call_over(&runtime, way, &secret, JOIN, b"");
        let said = Failure::from(join.unwrap_err());
        assert_eq!(said.kind, ErrorKind::BadRequest, "{said:?}");
    }
    let stranger = "5a".repeat(32);
    for call in CALLS.iter().flat_map(|(_, calls)| *calls) {
        let answer = raw::call_over(&runtime, way.as_ref().unwrap(), &stranger, call, b"");
        let said = Failure::from(answer.unwrap_err());
        assert_eq!(said.kind, ErrorKind::Unauthenticated, "{call}: {said:?}");
    }
}
