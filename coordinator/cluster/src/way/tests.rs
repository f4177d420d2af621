use super::*;
use crate::sites;

fn here(more: &str) -> Way {
    let text = format!("[site.here]\nkind = 'local'\n{more}");
    let sites = sites::parse("s", &text, None).unwrap();
    Way::to(&sites.0[0], Path::new("/nowhere"))
}

#[test]
fn a_script_says_what_it_prints_after_the_mark() {
    let way = here("setup = 'echo Welcome; greeting=hello'");
    let said = way
        .run("a test", "echo $greeting; cat; echo oh >&2; exit 3", LIMIT)
        .unwrap();
    assert_eq!(said.code, Some(3));
    assert_eq!(said.stdout, "hello\n");
    assert_eq!(said.stderr, "oh\n");
}

#[test]
fn a_setup_that_ends_the_shell_is_named() {
    let error = here("setup = 'exit 4'")
        .run("a test", "echo x", LIMIT)
        .unwrap_err();
    assert!(error.to_string().contains("`setup`"), "{error}");
}

#[test]
fn time_is_limited_and_nobody_stays() {
    let folder = tempfile::tempdir().unwrap();
    let pid = folder.path().join("pid");
    let script = format!("sleep 1000 & echo $! >{}; wait", pid.display());
    let error = here("")
        .run("sleeping", &script, Span::from_millis(500))
        .unwrap_err();
    assert!(matches!(error, ClusterError::TimedOut { .. }), "{error}");
    assert!(error.may_pass());
    let pid = std::fs::read_to_string(pid).unwrap();
    let stat = format!("/proc/{}/stat", pid.trim());
    while std::fs::read_to_string(&stat).is_ok_and(|stat| !stat.contains(") Z ")) {
        thread::yield_now();
    }
}

#[test]
fn output_is_limited() {
    let error = here("").run("talking", "yes", LIMIT).unwrap_err();
    assert!(error.to_string().contains("is longer than"), "{error}");
}

#[test]
fn a_file_arrives_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a b/it's");
    let there = path.to_str().unwrap();
    here("").put(&b"hello"[..], 5, there, 0o600, LIMIT).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"hello");
    here("")
        .put(&b"he"[..], 5, there, 0o600, LIMIT)
        .unwrap_err();
    assert_eq!(std::fs::read(&path).unwrap(), b"hello");
    assert_eq!(
        std::fs::read_dir(path.parent().unwrap()).unwrap().count(),
        1
    );
}

#[test]
fn what_is_missing_is_named() {
    let error = here("")
        .ask("asking", "no-such-queue", "no-such-queue -v")
        .unwrap_err();
    assert!(
        matches!(&error, ClusterError::Missing { program, .. } if program == "no-such-queue"),
        "{error}"
    );
}

#[test]
fn what_ssh_says_is_told_apart() {
    let said = |stderr: &str| not_there("x", stderr);
    assert!(matches!(
        said("Host key verification failed.\r\n"),
        ClusterError::HostKey { .. }
    ));
    assert!(matches!(
        said("a@b: Permission denied (publickey)."),
        ClusterError::Login { .. }
    ));
    let away = said("ssh: connect to host b port 22: Connection refused");
    assert!(matches!(away, ClusterError::Unreachable { .. }) && away.may_pass());
}

#[test]
fn what_arrived_before_a_cut_is_given() {
    let script = "printf 'a\\377\\000b'; exec sleep 1000";
    let (bytes, ended) = here("").fetch("fetching", script, Span::from_millis(500));
    assert_eq!(bytes, b"a\xff\0b");
    assert!(matches!(ended, Err(ClusterError::TimedOut { .. })));
    let (bytes, ended) = here("").fetch("fetching", "echo x; echo no room >&2; exit 3", LIMIT);
    assert_eq!(bytes, b"x\n");
    let error = ended.unwrap_err().to_string();
    assert!(error.contains("no room"), "{error}");
    let (bytes, ended) = here("").fetch("fetching", "printf whole", LIMIT);
    assert_eq!(bytes, b"whole");
    ended.unwrap();
}
