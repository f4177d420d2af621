use super::*;

const EXAMPLE: &str = include_str!("../../../../deploy/sites.toml");

/// Thesis §C.3.2: `grid.conf` and table C.1.
#[test]
fn the_example_has_the_nodes_of_the_thesis() {
    let sites = parse("sites.toml", EXAMPLE, None).unwrap_or_else(|error| panic!("{error}"));
    for (name, pixels, running) in [
        ("iceberg", 2_500, Some(10)),
        ("everest", 1_600, None),
        ("snowdon", 5_000, Some(4)),
    ] {
        let site = sites.named(name).unwrap();
        assert_eq!(site.min_tile_pixels, pixels, "{name}");
        assert_eq!(site.max_array_size, Some(75_000), "{name}");
        assert_eq!(site.max_running, running, "{name}");
        assert_eq!(site.kind, Kind::GridEngine);
        assert_eq!(site.poll, Span::from_secs(300));
        assert_eq!(site.ahead, 1);
    }
}

#[test]
fn what_is_not_said_has_its_usual_value() {
    let sites = parse("a", "[site.here]\nkind = 'local'\n", None).unwrap();
    let site = sites.named("here").unwrap();
    assert_eq!(site.program, "~/.flyby/bin/flyby");
    assert_eq!(site.mode, Mode::Auto);
    assert_eq!((site.threads, site.ahead), (1, 1));
    assert_eq!(site.label(), "site.here");
}

#[track_caller]
fn mistakes(text: &str) -> Vec<String> {
    let error = parse("s.toml", text, None).unwrap_err();
    error.to_string().lines().map(str::to_owned).collect()
}

#[test]
fn mistakes_have_file_line_column_and_help() {
    assert_eq!(
        mistakes("[site.a]\nkind = 'local'\nmax_runing = 3\n"),
        [
            "s.toml:3:1: unknown field `max_runing`, expected one of `kind`, `mode`, `address`, `ssh_options`, `setup`, `min_tile_pixels`, `max_array_size`, `max_running`, `poll`, `ahead`, `time_limit`, `queue`, `account`, `parallel_environment`, `submit`, `labels`, `threads`, `memory`, `folder`, `program`, `template`, `idle`, `patience`, `coordinator`, `cancelled` (did you mean `max_running`?)"
        ]
    );
    let said = mistakes("[site.a]\nkind = 'pbs'\n");
    assert!(
        said[0].starts_with("s.toml:2:8: unknown variant `pbs`"),
        "{said:?}"
    );
    let said = mistakes("[site.a]\nkind = \n");
    assert!(said[0].starts_with("s.toml:2:"), "{said:?}");
}

#[test]
fn all_wrong_values_are_named_at_once() {
    let text = "\
[site.'a b']
kind = 'ssh'
poll = '30'
time_limit = '1 s'
labels = ['big', 'é']
queue = '-x'
folder = 'here'
max_running = 0
coordinator = 'host'
setup = \"a\\nb\"
";
    let said = mistakes(text).join("\n");
    for part in [
        "s.toml:1:7: `a b` is no name of a site",
        "s.toml:2:8: a site of kind ssh needs its address",
        "s.toml:3:8: `30` is no length of time",
        "s.toml:4:14: this must be between 1 min and 365 d",
        "s.toml:5:18: `é` is no label",
        "s.toml:6:9: `-x` is no name that a queue gives",
        "s.toml:7:10: `here` is no path",
        "s.toml:8:15: `max_running` is a whole number",
        "s.toml:9:15: `host` is no address of a coordinator",
        "s.toml:10:9: this must be one line",
    ] {
        assert!(said.contains(part), "{part}\n{said}");
    }
}

#[test]
fn an_address_is_never_an_option_of_ssh() {
    for address in ["-oProxyCommand=x", "a b", "", "a;b", "$(a)"] {
        let text = format!("[site.a]\nkind = 'ssh'\naddress = '{address}'\n");
        let said = mistakes(&text).join("\n");
        assert!(said.contains("is no address for ssh"), "{said}");
    }
}

#[test]
fn several_slots_need_a_parallel_environment() {
    let said = mistakes("[site.a]\nkind = 'gridengine'\nthreads = 4\n");
    assert!(
        said[0].contains("parallel_environment = \"smp\""),
        "{said:?}"
    );
}

#[test]
fn a_file_that_is_not_there_says_so() {
    let error = read(std::path::Path::new("/nowhere/sites.toml")).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("/nowhere/sites.toml: it cannot be read"),
        "{error}"
    );
}
