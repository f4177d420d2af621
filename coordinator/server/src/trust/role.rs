//! What each call needs: one table.

use std::fmt;

use serde::{Deserialize, Serialize};
use wire::proto;

/// What a token allows.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Role {
    /// Look.
    View,
    /// Also submit jobs and command them.
    Submit,
    /// Also what concerns everybody: workers, cleaning, tokens.
    Operate,
    /// Work for the farm, and nothing else.
    Worker,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::View => "view",
            Self::Submit => "submit",
            Self::Operate => "operate",
            Self::Worker => "worker",
        })
    }
}

impl Role {
    /// Whether it allows what needs `other`.
    pub(crate) fn includes(self, other: Self) -> bool {
        match (self, other) {
            (Self::Worker, _) | (_, Self::Worker) => self == other,
            _ => self >= other,
        }
    }

    /// The role that a message names.
    pub(crate) fn from_message(role: proto::Role) -> Option<Self> {
        Some(match role {
            proto::Role::Unspecified => return None,
            proto::Role::View => Self::View,
            proto::Role::Submit => Self::Submit,
            proto::Role::Operate => Self::Operate,
            proto::Role::Worker => Self::Worker,
        })
    }

    /// It as a message names it.
    pub(crate) fn message(self) -> proto::Role {
        match self {
            Self::View => proto::Role::View,
            Self::Submit => proto::Role::Submit,
            Self::Operate => proto::Role::Operate,
            Self::Worker => proto::Role::Worker,
        }
    }
}

/// What a call needs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Need {
    /// Nothing but TLS: the call itself brings a secret.
    Secret,
    /// A role.
    Role(Role),
}

/// Every call of the protocol.
const TABLE: &[(&str, Need)] = &[
    ("Farm/ListJobs", Need::Role(Role::View)),
    ("Farm/ShowJob", Need::Role(Role::View)),
    ("Farm/WatchJob", Need::Role(Role::View)),
    ("Farm/JobLog", Need::Role(Role::View)),
    ("Farm/Why", Need::Role(Role::View)),
    ("Farm/FetchFrame", Need::Role(Role::View)),
    ("Farm/ListWorkers", Need::Role(Role::View)),
    ("Farm/ListSites", Need::Role(Role::View)),
    ("Farm/LookBack", Need::Role(Role::View)),
    ("Farm/Info", Need::Role(Role::View)),
    ("Farm/Submit", Need::Role(Role::Submit)),
    ("Farm/CancelJob", Need::Role(Role::Submit)),
    ("Farm/CommandJob", Need::Role(Role::Submit)),
    ("Farm/Clean", Need::Role(Role::Operate)),
    ("Farm/DrainWorkers", Need::Role(Role::Operate)),
    ("Farm/CreateToken", Need::Role(Role::Operate)),
    ("Farm/ListTokens", Need::Role(Role::Operate)),
    ("Farm/RevokeToken", Need::Role(Role::Operate)),
    ("Workers/Control", Need::Role(Role::Worker)),
    ("Workers/Deliver", Need::Role(Role::Worker)),
    ("Workers/FetchScene", Need::Role(Role::Worker)),
    ("Workers/FetchAsset", Need::Role(Role::Worker)),
    ("Joining/Join", Need::Secret),
    ("Joining/Renew", Need::Role(Role::Worker)),
];

/// What the call of a path needs; `None`: there is no such call.
pub(crate) fn need(path: &str) -> Option<Need> {
    let call = path.strip_prefix("/flyby.v1.")?;
    TABLE
        .iter()
        .find(|(name, _)| *name == call)
        .map(|&(_, need)| need)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_call_of_the_protocol_stands_in_the_table_once() {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../proto/flyby/v1");
        let mut calls = BTreeSet::new();
        for file in std::fs::read_dir(root).unwrap() {
            let text = std::fs::read_to_string(file.unwrap().path()).unwrap();
            let mut service = "";
            for line in text.lines() {
                if let Some(rest) = line.strip_prefix("service ") {
                    service = rest.trim_end_matches(" {");
                } else if let Some(rest) = line.trim_start().strip_prefix("rpc ") {
                    calls.insert(format!("{service}/{}", rest.split('(').next().unwrap()));
                }
            }
        }
        let table: BTreeSet<String> = TABLE.iter().map(|(name, _)| (*name).to_owned()).collect();
        assert_eq!(table.len(), TABLE.len());
        assert_eq!(table, calls);
        assert_eq!(need("/flyby.v1.Farm/Nothing"), None);
        assert_eq!(need("Farm/Info"), None);
    }

    #[test]
    fn roles_of_users_include_each_other_and_workers_are_apart() {
        use Role::{Operate, Submit, View, Worker};
        assert!(Operate.includes(Submit) && Operate.includes(View) && Submit.includes(View));
        assert!(!View.includes(Submit) && !Submit.includes(Operate));
        for role in [View, Submit, Operate] {
            assert!(role.includes(role) && !role.includes(Worker) && !Worker.includes(role));
        }
        assert!(Worker.includes(Worker));
    }
}
