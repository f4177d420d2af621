//! A new user's half hour: the README's chapter on clusters, command by command, on a real Slurm behind ssh.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;

use crate::engine::Engine;
use crate::harness::scenes::film_digests;
use crate::harness::{Place, Process, wait};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// The chapter, up to where it comes to poll mode.
fn chapter() -> String {
    let readme = fs::read_to_string(format!("{ROOT}/README.md")).unwrap();
    let chapter = readme
        .split("\n## ")
        .find(|part| part.starts_with("On a cluster\n"));
    let chapter = chapter.expect("the README has a chapter on clusters");
    let pilot = chapter.split("in poll mode").next().unwrap();
    pilot.to_owned()
}

/// The text of its first block of a language.
fn block<'a>(chapter: &'a str, language: &str) -> &'a str {
    let begin = format!("```{language}\n");
    let from = chapter.find(&begin).expect("the chapter has such a block") + begin.len();
    let text = &chapter[from..];
    &text[..text.find("```").unwrap()]
}

/// The words of each command of a block.
fn commands(block: &str) -> Vec<Vec<&str>> {
    let lines = block.lines().map(|line| line.split('#').next().unwrap());
    let words = lines.map(|line| line.split_whitespace().collect::<Vec<_>>());
    let words = words.filter(|words| !words.is_empty());
    words
        .map(|words| {
            assert_eq!(words[0], "flyby", "{words:?}");
            words[1..].to_vec()
        })
        .collect()
}

#[test]
#[ignore = "long: tests/run --all"]
fn its_commands_lead_from_nothing_to_frames() {
    // Nodes that have the processors that the chapter's allocations ask for.
    let Some(mut engine) = Engine::slurm_with(2, &[("SLURM_NODE_CPUS", "4")]) else {
        return;
    };
    let place = Place::new();
    let home = place.path("home-there");
    fs::create_dir(&home).unwrap();
    if !engine.add_ssh_with(&[("SSH_HOME", home.to_str().unwrap())]) {
        return;
    }
    symlink(format!("{ROOT}/scenes"), place.path("scenes")).unwrap();

    // What differs from the README: the cluster's name, with what stands in a user's ~/.ssh/config of it, and the port, since
    // another coordinator may listen there.
    let chapter = chapter();
    let there = format!(
        "\"node1\"\nssh_options = [\"-F\", \"{}/ssh/config\"]",
        engine.folder.display()
    );
    let address = "\"me@login.example.org\"";
    let sites = block(&chapter, "toml sites");
    assert!(sites.contains(address), "{sites}");
    place.write("sites.toml", sites.replacen(address, &there, 1));
    let text = block(&chapter, "sh").replace(":7359", ":0");

    let mut coordinator: Option<Process> = None;
    let mut submitted = Vec::new();
    let mut verbs = BTreeSet::new();
    for words in commands(&text) {
        verbs.insert(words[..2].join(" "));
        match words[0] {
            "coordinator" => {
                let started = place.start("coordinator", &words);
                let started = coordinator.insert(started);
                wait::until("the coordinator says where it listens", || {
                    assert!(started.ended().is_none(), "{}", started.stderr());
                    place
                        .state()
                        .join("coordinator.json")
                        .is_file()
                        .then_some(())
                });
            }
            "submit" => {
                place.flyby(&words).ok();
                submitted = words;
            }
            _ => {
                let said = place.flyby(&words).ok();
                // A user sees at once where something is not as it should be.
                assert!(!said.contains("doubtful"), "{said}");
            }
        }
    }
    for verb in [
        "site install",
        "site check",
        "coordinator --sites",
        "site list",
        "site clean",
    ] {
        assert!(verbs.contains(verb), "the chapter does not show {verb}");
    }
    coordinator
        .expect("the chapter starts a coordinator")
        .kill();

    // The same frames as one process renders, of the same settings.
    let scene = submitted[1];
    let option = |name: &str| {
        let place = submitted.iter().position(|&word| word == name);
        submitted[place.unwrap_or_else(|| panic!("the chapter says {name}")) + 1]
    };
    let mut render = vec!["render", scene, "-o", "alone", "--format", "exr"];
    for name in ["--frames", "--resolution", "--rays"] {
        render.extend([name, option(name)]);
    }
    place.flyby(&render).ok();
    let alone = film_digests(&place, "alone");
    assert!(alone.len() > 1, "{alone:?}");
    assert_eq!(film_digests(&place, option("-o")), alone);

    // It ran there indeed, and nothing is left of it but the program.
    let accounts = fs::read_to_string(engine.folder.join("slurm/log/jobcomp.txt")).unwrap();
    assert!(accounts.contains("flyby-"), "{accounts}");
    assert_eq!(engine.slurm_tool("squeue", &["-h"]), "");
    assert_eq!(place.files("home-there"), [".flyby/bin/flyby"]);
}
