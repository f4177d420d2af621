mod mistakes;

use std::fs;

use super::*;
use crate::Curve;
use crate::description as d;

/// A scene without mistakes that uses most keys.
const GOOD: &str = r##"
name = "test"
key = 3

[film]
resolution = "64x48"
images = 10
fps = 25
shutter = "20 ms"
exposure = "1 stops"

[sampling]
rays = 2

[camera]
angle = "60 deg"

[camera.great_circle]
altitude = "30 m"
speed = "60 km/h"
heading = "20 deg"
pitch = { linear = [["0 s", "-10 deg"], ["0.4 s", "0 deg"]] }
clearance = "2 m"

[surface]
field = """
let rise = 2*wave;
seed - 20 - rise - 3*noise(base/30)
"""

[surface.sphere]
radius = "10 km"

[curves]
wave = { smooth = [[0, 0], [1, 1]] }

[material]
albedo = "#804020"

[[material.layer]]
albedo = [0.5, 0.5, 0.5]
above = ["20 m", "22 m"]
cover = "noise(p)"

[sun]
azimuth = "200 deg"

[sky.air]
visibility = "9 km"
"##;

fn read(text: &str, overrides: &Overrides) -> Result<Loaded, SceneError> {
    let source = Source {
        name: "test.toml".into(),
        text: text.to_owned(),
    };
    parse(source, "stem", Path::new("."), overrides)
}

/// The mistakes of the good scene after `old` was replaced by `new`, each as the text that it
/// points to, its message, and its help.
fn mistakes(old: &str, new: &str) -> Vec<(String, String, String)> {
    assert!(GOOD.contains(old), "{old}");
    shown(read(&GOOD.replacen(old, new, 1), &Overrides::default()))
}

fn shown(result: Result<Loaded, SceneError>) -> Vec<(String, String, String)> {
    let Err(error) = result else {
        return Vec::new();
    };
    error
        .mistakes
        .iter()
        .map(|mistake| {
            let text = &error.sources[mistake.place.source].text;
            (
                text[mistake.place.span.clone()].to_owned(),
                mistake.message.clone(),
                mistake.help.clone().unwrap_or_default(),
            )
        })
        .collect()
}

#[test]
fn a_good_scene_is_read_as_it_is_written() {
    let loaded = read(GOOD, &Overrides::default()).unwrap();
    assert_eq!(loaded.warnings, []);
    let scene = loaded.description;
    assert_eq!((scene.name.as_str(), scene.key), ("test", 3));
    assert_eq!((scene.film.shutter, scene.film.exposure), (0.02, 1.0));
    assert_eq!(scene.film.window, scene.film.resolution.rect());
    let d::Path::GreatCircle(circle) = &scene.camera.path else {
        panic!("{:?}", scene.camera.path)
    };
    assert_eq!((circle.radius, circle.speed), (10_000.0, 60.0 / 3.6));
    assert_eq!(
        circle.pitch,
        Curve::Linear(vec![(0.0, (-10.0f64).to_radians()), (0.4, 0.0)])
    );
    let d::Bound::Shell { inner, outer } = scene.surface.bound else {
        panic!("{:?}", scene.surface.bound)
    };
    assert!((10_016.0..10_017.0).contains(&inner) && (10_023.0..10_026.0).contains(&outer));
    let albedo = scene.surface.material.albedo;
    assert!((albedo[0] - 0.2158605).abs() < 1e-6, "{albedo:?}");
    assert_eq!(
        Description::from_bytes(&scene.to_bytes().unwrap()),
        Ok(scene)
    );
}

#[test]
fn all_mistakes_are_found_at_once_in_the_order_of_the_file() {
    let text = GOOD
        .replace("fps = 25", "fps = 0")
        .replace("rays = 2", "rayz = 2")
        .replace("\"60 deg\"", "\"60 m\"")
        .replace("noise(base/30)", "noise(q)")
        .replace("\"9 km\"", "\"-9 km\"");
    let error = read(&text, &Overrides::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "test.toml:8:7: the number of images per second must lie between 0.001 and 10000, but it is 0\n\
         test.toml:13:1: there is no key `sampling.rayz` (did you mean `rays`?)\n\
         test.toml:16:9: \"60 m\" is a length, but an angle is wanted here (it is given in deg, rad)\n\
         test.toml:28:28: there is no `q` (the names here are p, t, seed, height, base, R, PI and those of [curves])\n\
         test.toml:49:14: the visibility must lie between 0.001 m and 1e8 m, but it is -9000 m"
    );
}

#[test]
fn a_scene_without_anything_says_what_it_needs() {
    let found = shown(read("", &Overrides::default()));
    let messages: Vec<_> = found
        .iter()
        .map(|(_, message, _)| message.as_str())
        .collect();
    assert_eq!(messages, ["`camera` is missing", "`surface` is missing"]);
}

#[test]
fn fixed_and_spline_cameras_are_checked() {
    let surface = "[surface]\nplane = {}\nfield = \"seed - noise(base)\"\n";
    let camera = |camera: &str| {
        let found = shown(read(
            &format!("{surface}[camera]\n{camera}"),
            &Overrides::default(),
        ));
        found
            .into_iter()
            .map(|(_, message, _)| message)
            .collect::<Vec<_>>()
            .join("; ")
    };
    assert_eq!(
        camera("fixed = { eye = [0, -9, 5], target = [0, 0, 0] }"),
        ""
    );
    for (text, message) in [
        (
            "fixed = { eye = [0, 0, 5], target = [0, 0, 5] }",
            "the camera looks at the place where it stands",
        ),
        (
            "fixed = { eye = [0, 0, 5], target = [0, 0, 0] }",
            "the camera looks along its own up",
        ),
        (
            "fixed = { eye = [0, 0, -5], target = [0, 9, 0] }",
            "the camera is inside the surface at frame 0",
        ),
        (
            "fixed = { eye = [0, 0, 5] }",
            "`camera.fixed.target` is missing",
        ),
        (
            "fixed = { eye = [0, 5], target = [0, 9, 0] }",
            "a list of 3 is wanted here, not of 2",
        ),
        (
            "spline = { keys = [] }",
            "a spline has 2 to 4096 keys, not 0",
        ),
        (
            "spline = { keys = [{ time = 1, eye = [0, 0, 5], target = [0, 9, 0] }, { time = 1, eye = [0, 0, 6], target = [0, 9, 0] }] }",
            "instants of keys must rise",
        ),
        (
            "angle = \"50 deg\"",
            "[camera] needs one of [camera.fixed], [camera.spline], [camera.great_circle]",
        ),
        ("fixed = 3", "a table is wanted here, not a number"),
    ] {
        assert!(
            camera(text).starts_with(message),
            "{text}: {}",
            camera(text)
        );
    }
}

#[test]
fn overrides_replace_and_are_blamed_for_their_own_mistakes() {
    let set = |set: &[&str]| Overrides {
        set: set.iter().map(|text| (*text).to_owned()).collect(),
        ..Overrides::default()
    };
    let overrides = Overrides {
        resolution: Some(model::Resolution {
            width: 32,
            height: 16,
        }),
        rays: Some(5),
        crop: Some(model::Rect {
            x0: 0,
            y0: 0,
            x1: 8,
            y1: 8,
        }),
        ..set(&[
            "camera.great_circle.altitude=40 m",
            "film.fps=30",
            "material.layer.0.albedo=[1, 0, 0]",
            "name=other",
        ])
    };
    let scene = read(GOOD, &overrides).unwrap().description;
    assert_eq!((scene.film.resolution.width, scene.film.window.x1), (32, 8));
    assert_eq!((scene.sampling.rays, scene.film.fps), (5, 30.0));
    assert_eq!(scene.surface.material.layers[0].albedo, [1.0, 0.0, 0.0]);
    assert_eq!(scene.name, "other");
    for (text, error) in [
        ("film.fps=0", "--set:1:10: the number of images per second"),
        ("film.fsp=3", "--set:1:6: there is no key `film.fsp`"),
        ("film.shutter=3 m", "--set:1:14: \"3 m\" is a length"),
        ("film", "--set:1:1: `film` sets nothing"),
        ("film..fps=3", "--set:1:6: `film..fps` is not a key"),
        (
            "material.layer.7.albedo=1",
            "--set:1:16: `7` is no element of a list of 1",
        ),
        (
            "key.x=1",
            "--set:1:5: `x` cannot be set: what it belongs to is a number",
        ),
        (
            "surface.field=seed - nose(p)",
            "--set:1:22: there is no function `nose`",
        ),
    ] {
        let message = read(GOOD, &set(&[text])).unwrap_err().to_string();
        assert!(message.starts_with(error), "{text}: {message}");
    }
    let rays = Overrides {
        rays: Some(0),
        ..Overrides::default()
    };
    let message = read(GOOD, &rays).unwrap_err().to_string();
    assert!(
        message.starts_with("--rays:1:1: a pixel cannot have 0 × 0 rays"),
        "{message}"
    );
}

#[test]
fn unused_curves_are_a_warning() {
    let loaded = read(&GOOD.replace("2*wave", "2"), &Overrides::default()).unwrap();
    assert_eq!(loaded.warnings[0].message, "no field uses the curve `wave`");
}

#[test]
fn assets_are_read_by_content_and_confined() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let ramp = "ramp = { file = \"ramp.png\", heights = [\"0 m\", \"20 m\"] }";
    fs::write(&path, GOOD.replace("albedo = [0.5, 0.5, 0.5]", ramp)).unwrap();
    let error = load(&path, &Overrides::default()).unwrap_err();
    assert!(
        error.to_string().contains("cannot open `ramp.png`"),
        "{error}"
    );
    fs::write(folder.path().join("ramp.png"), b"pixels").unwrap();
    let loaded = load(&path, &Overrides::default()).unwrap();
    let (asset, bytes) = &loaded.assets[0];
    assert_eq!((asset.bytes, &bytes[..]), (6, &b"pixels"[..]));
    assert_eq!(asset.digest.0, *blake3::hash(b"pixels").as_bytes());
    assert_eq!(loaded.description.assets, std::slice::from_ref(asset));
    #[cfg(unix)]
    {
        let outside = tempfile::NamedTempFile::new().unwrap();
        fs::remove_file(folder.path().join("ramp.png")).unwrap();
        std::os::unix::fs::symlink(outside.path(), folder.path().join("ramp.png")).unwrap();
        let error = load(&path, &Overrides::default()).unwrap_err();
        assert!(error.to_string().contains("leads out of"), "{error}");
    }
}

#[test]
fn height_maps_are_read_once_and_travel_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let field = "seed - heightmap(\"h.grid\", base, #{spacing: 10, high: 4}) - noise(base) \
                 - heightmap(\"h.grid\", base, #{edges: \"repeat\"})";
    fs::write(
        &path,
        GOOD.replace("seed - 20 - rise - 3*noise(base/30)", field),
    )
    .unwrap();
    let said = |path: &Path| load(path, &Overrides::default()).unwrap_err().to_string();
    assert!(
        said(&path).contains("cannot open `h.grid`"),
        "{}",
        said(&path)
    );
    // The place is that of the call, in its line.
    assert!(said(&path).contains("scene.toml:28:"), "{}", said(&path));
    fs::write(folder.path().join("h.grid"), b"no grid").unwrap();
    assert!(
        said(&path).contains("`h.grid` is no grid"),
        "{}",
        said(&path)
    );
    let mut grid = b"flyby-grid 1\n5 4\n".to_vec();
    grid.extend([1.0f32; 20].map(f32::to_le_bytes).concat());
    fs::write(folder.path().join("h.grid"), &grid).unwrap();
    let loaded = load(&path, &Overrides::default()).unwrap();
    assert_eq!(loaded.assets.len(), 1);
    assert_eq!(loaded.description.surface.graph.files_needed(), [0]);
    assert!(loaded.description.surface.graph.files().contains_key(&0));
    let bytes = loaded.description.to_bytes().unwrap();
    let read = Description::from_bytes(&bytes).unwrap();
    assert_eq!(read, loaded.description);
    // A scene that names no such file is refused, whoever sends it.
    let mut robbed = loaded.description;
    robbed.assets.clear();
    assert!(robbed.to_bytes().is_err());
}

#[test]
fn files_that_are_no_scenes_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let message = |path: &Path| load(path, &Overrides::default()).unwrap_err().to_string();
    assert!(message(&path).contains("cannot read the file: No such file"));
    assert!(message(folder.path()).contains("this is not an ordinary file"));
    fs::write(&path, b"name = \"x\"\n\xff").unwrap();
    assert!(message(&path).contains("line 2 is not UTF-8"));
    fs::write(&path, vec![b'#'; 2 << 20]).unwrap();
    assert!(message(&path).contains("larger than 1 MiB"));
    fs::write(&path, format!("a = {}", "[".repeat(100_000))).unwrap();
    assert!(message(&path).contains("this is not TOML"));
}

#[test]
fn scenes_in_the_repository_load() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let mut count = 0;
    let entries = fs::read_dir(&folder).unwrap();
    let figures = fs::read_dir(folder.join("figures")).unwrap();
    let library = fs::read_dir(folder.join("library")).unwrap();
    for entry in entries.chain(figures).chain(library) {
        let path = entry.unwrap().path();
        let list = path.ends_with("gallery.toml");
        if path.extension().is_some_and(|ending| ending == "toml") && !list {
            let loaded =
                load(&path, &Overrides::default()).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(loaded.warnings, [], "{}", path.display());
            let bytes = loaded.description.to_bytes().unwrap();
            assert_eq!(Description::from_bytes(&bytes), Ok(loaded.description));
            count += 1;
        }
    }
    assert!(count >= 12, "{count}");
}
