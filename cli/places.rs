//! Where things are unless a user says otherwise, from the environment, which `main` alone reads.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

/// What the program takes from its environment beside the options' own twins.
#[derive(Clone, Default, Debug)]
pub(crate) struct Surroundings {
    /// `$FLYBY_CONFIG`: the configuration file.
    pub(crate) config: Option<OsString>,
    /// `$XDG_CONFIG_HOME`.
    pub(crate) xdg_config_home: Option<OsString>,
    /// `$XDG_STATE_HOME`.
    pub(crate) xdg_state_home: Option<OsString>,
    /// `$HOME`.
    pub(crate) home: Option<OsString>,
}

impl Surroundings {
    /// Picks them out of the environment's variables.
    pub(crate) fn new(environment: &BTreeMap<OsString, OsString>) -> Self {
        let named = |name: &str| environment.get(OsStr::new(name)).cloned();
        Self {
            config: named("FLYBY_CONFIG"),
            xdg_config_home: named("XDG_CONFIG_HOME"),
            xdg_state_home: named("XDG_STATE_HOME"),
            home: named("HOME"),
        }
    }

    /// Where the configuration file is, if the user has a home: named by the user, or the usual place.
    pub(crate) fn config_file(&self) -> Option<(PathBuf, Named)> {
        match &self.config {
            Some(file) if !file.is_empty() => Some((file.into(), Named::ByUser)),
            _ => Some((
                self.home_folder(&self.xdg_config_home, ".config")?
                    .join("flyby/config.toml"),
                Named::ByCustom,
            )),
        }
    }

    /// The state folder where none is named: `$XDG_STATE_HOME/flyby` or `~/.local/state/flyby`.
    pub(crate) fn state_folder(&self) -> Option<PathBuf> {
        Some(
            self.home_folder(&self.xdg_state_home, ".local/state")?
                .join("flyby"),
        )
    }

    /// A base folder of the XDG specification, which ignores relative paths.
    fn home_folder(&self, named: &Option<OsString>, usual: &str) -> Option<PathBuf> {
        let absolute = |path: &OsString| {
            let path = PathBuf::from(path);
            path.is_absolute().then_some(path)
        };
        named.as_ref().and_then(absolute).or_else(|| {
            let home = self.home.as_ref().and_then(absolute)?;
            Some(home.join(usual))
        })
    }
}

/// Who chose a file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Named {
    /// The user named it, so it must be there.
    ByUser,
    /// It is where such files usually are, and may be missing.
    ByCustom,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn xdg_before_home_and_relative_paths_ignored() {
        let mut around = Surroundings {
            home: Some("/home/ada".into()),
            ..Surroundings::default()
        };
        let state = |around: &Surroundings| around.state_folder().unwrap();
        assert_eq!(
            state(&around),
            PathBuf::from("/home/ada/.local/state/flyby")
        );
        around.xdg_state_home = Some("relative".into());
        assert_eq!(
            state(&around),
            PathBuf::from("/home/ada/.local/state/flyby")
        );
        around.xdg_state_home = Some("/state".into());
        assert_eq!(state(&around), PathBuf::from("/state/flyby"));
        assert_eq!(Surroundings::default().state_folder(), None);
    }

    #[test]
    fn a_named_configuration_must_be_there() {
        let mut around = Surroundings {
            home: Some("/home/ada".into()),
            ..Surroundings::default()
        };
        assert_eq!(
            around.config_file(),
            Some((
                "/home/ada/.config/flyby/config.toml".into(),
                Named::ByCustom
            ))
        );
        around.config = Some("my.toml".into());
        assert_eq!(
            around.config_file(),
            Some(("my.toml".into(), Named::ByUser))
        );
    }
}
