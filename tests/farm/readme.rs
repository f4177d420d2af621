//! Every command that the README shows exists, and every file is right.

use crate::harness::Place;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn readme() -> String {
    std::fs::read_to_string(format!("{ROOT}/README.md")).unwrap()
}

/// The words of every `flyby` command in the README's code blocks.
fn commands(readme: &str) -> Vec<Vec<&str>> {
    let blocks = readme.split("```").skip(1).step_by(2);
    let lines = blocks
        .flat_map(str::lines)
        .map(|line| line.split('#').next().unwrap().trim());
    lines
        .filter_map(|line| {
            let line = line.strip_prefix("$ ").unwrap_or(line);
            let words = line
                .strip_prefix("cargo run --release -- ")
                .or_else(|| line.strip_prefix("flyby "))
                .or_else(|| line.strip_prefix("target/release/flyby "))?;
            Some(words.split_whitespace().collect())
        })
        .collect()
}

#[test]
fn its_commands_and_options_exist() {
    let place = Place::new();
    let readme = readme();
    let commands = commands(&readme);
    assert!(
        commands.iter().any(|words| words == &["demo"]),
        "{commands:?}"
    );
    for words in commands {
        // Up to the first option or file these are names of commands.
        let is_name = |word: &&&str| word.chars().all(|letter| letter.is_ascii_lowercase());
        let names = words.iter().take_while(is_name).copied();
        let help = place.flyby(names.chain(["--help"])).ok();
        for option in words.iter().filter(|word| word.starts_with('-')) {
            let option = option.split('=').next().unwrap();
            assert!(
                help.contains(option),
                "{words:?}: no option {option}\n{help}"
            );
        }
    }
}

#[test]
fn its_files_are_there() {
    let (root, readme) = (std::path::Path::new(ROOT), readme());
    let links = readme
        .split("](")
        .skip(1)
        .map(|rest| rest.split([')', '#']).next().unwrap());
    for link in links.filter(|link| !link.is_empty() && !link.contains("://")) {
        assert!(
            root.join(link).exists(),
            "the README names {link}, which is not there"
        );
    }
    for words in commands(&readme) {
        for scene in words.iter().filter(|word| word.starts_with("scenes/")) {
            assert!(root.join(scene).exists(), "{words:?}");
        }
    }
}

#[test]
fn its_scenes_and_sites_are_right() {
    let (place, readme) = (Place::new(), readme());
    let mut count = 0;
    for block in readme.split("```toml").skip(1) {
        let block = block.split("```").next().unwrap();
        if let Some(sites) = block.strip_prefix(" sites\n") {
            place.write("sites.toml", sites);
            place.flyby(["site", "list", "--sites", "sites.toml"]).ok();
            continue;
        }
        let camera = "[camera.fixed]\neye = [6371100, 0, 0]\ntarget = [6371000, 100, 0]\n";
        place.write("readme.toml", format!("{camera}{block}"));
        place.flyby(["scene", "check", "readme.toml"]).ok();
        count += 1;
    }
    assert!(count > 0, "the README shows a scene");
}
