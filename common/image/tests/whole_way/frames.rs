//! Frames: written, read back, compared.

use image::{
    Encoding, FileKind, FinishedFile, Format, Formats, FrameRequest, ImageError, SampleKind,
    Scratch, ScratchIdentity, ViewTransform, Window,
};
use image::{compare, file_digest, finish, info};
use model::film::CHANNELS;
use model::{Rect, Resolution, rect::GRID_SQUARE};

use crate::film::{
    CROP, RESOLUTION, blocks, finished, identity, names, payload, request, value, write_all,
};

/// The samples of an EXR file through the `exr` crate's own reader.
fn exr_samples(path: &std::path::Path) -> Vec<(String, exr::image::FlatSamples)> {
    let image = exr::prelude::read_all_flat_layers_from_file(path).unwrap();
    let list = image.layer_data[0].channel_data.list.iter();
    list.map(|channel| (channel.name.to_string(), channel.sample_data.clone()))
        .collect()
}

#[test]
fn strips_read_back_as_the_film() {
    for window in [RESOLUTION.rect(), CROP] {
        let folder = tempfile::tempdir().unwrap();
        let scratch = finished(folder.path(), window);
        let frame = finish(&scratch, &request(folder.path(), "exr")).unwrap();
        let path = &frame.files[0].path;
        assert_eq!(path, &folder.path().join("flyby_0007.exr"));
        for (name, samples) in exr_samples(path) {
            let channel = CHANNELS
                .iter()
                .position(|channel| channel.name == name)
                .unwrap();
            for (index, stored) in samples.values_as_f32().enumerate() {
                let index = u32::try_from(index).unwrap();
                let (x, y) = (
                    window.x0 + index % window.width(),
                    window.y0 + index / window.width(),
                );
                let exact = value(channel, x, y);
                let expected = match &samples {
                    exr::image::FlatSamples::F16(_) => {
                        half::f16::from_f32(exact.clamp(-65504.0, 65504.0)).to_f32()
                    }
                    _ => exact,
                };
                assert_eq!(stored, expected, "{name} at ({x}, {y})");
            }
        }
    }
}

#[test]
fn a_film_makes_the_same_file_to_the_byte_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let mut files = (0..3).map(|_| {
        let again = tempfile::tempdir().unwrap();
        let frame = finish(&scratch, &request(again.path(), "exr")).unwrap();
        std::fs::read(&frame.files[0].path).unwrap()
    });
    let first = files.next().unwrap();
    // Each file's attributes had an order of its own by chance.
    assert!(files.all(|file| file == first));
}

#[test]
fn threads_make_the_same_file() {
    // Tiles enough for several turns of each thread.
    let window = Rect {
        x0: 0,
        y0: 0,
        x1: 450,
        y1: 400,
    };
    let folder = tempfile::tempdir().unwrap();
    let identity = ScratchIdentity {
        resolution: Resolution {
            width: 450,
            height: 400,
        },
        ..identity()
    };
    let scratch = Scratch::create(folder.path().join("large"), identity, window).unwrap();
    write_all(&scratch, &blocks(window, 64, 64));
    let alone = finish(&scratch, &request(folder.path(), "exr")).unwrap();
    let samples = exr_samples(&alone.files[0].path);
    for threads in [2, 3] {
        let request = FrameRequest {
            threads,
            ..request(folder.path(), "exr")
        };
        let shared = finish(&scratch, &request).unwrap();
        assert_eq!(shared, alone);
        for ((name, found), (_, expected)) in exr_samples(&alone.files[0].path).iter().zip(&samples)
        {
            assert_eq!(found, expected, "{name} with {threads} threads");
        }
    }
}

#[test]
fn frames_encoded_while_blocks_come_are_the_same_files() {
    for (case, window) in [RESOLUTION.rect(), CROP, CROP].into_iter().enumerate() {
        for (formats, threads) in [("exr,png,ppm", 1), ("png16,exr", 3)] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("film");
            let request = FrameRequest {
                threads,
                ..request(folder.path(), formats)
            };
            let scratch = Scratch::create(path, identity(), window).unwrap();
            let encoding = Encoding::new(&scratch, request.formats, request.view);
            let mut blocks = blocks(window, 32, 32);
            match case {
                0 => {}
                // The last rows first: all are encoded at the end.
                1 => blocks.reverse(),
                _ => blocks.rotate_left(3),
            }
            std::thread::scope(|scope| {
                for part in blocks.chunks(blocks.len().div_ceil(threads)) {
                    let (scratch, encoding) = (&scratch, &encoding);
                    scope.spawn(move || {
                        for block in part {
                            write_all(scratch, std::slice::from_ref(block));
                            encoding.go_on(scratch).unwrap();
                        }
                    });
                }
            });
            let early = encoding.finish(&scratch, &request).unwrap();
            let read = |file: &FinishedFile| std::fs::read(&file.path).unwrap();
            let early_files: Vec<_> = early.files.iter().map(read).collect();
            let late = finish(&scratch, &request).unwrap();
            assert_eq!(early, late);
            let late_files: Vec<_> = late.files.iter().map(read).collect();
            assert!(early_files == late_files, "{formats} of {window:?}");
        }
    }
}

#[test]
fn what_was_encoded_for_other_frames_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let request = request(folder.path(), "exr,ppm");
    let expected = finish(&scratch, &request).unwrap();
    let brighter = ViewTransform {
        exposure_stops: 1.0,
    };
    let ppm = Formats::new([Format::Ppm]);
    for (formats, view) in [(ppm, request.view), (request.formats, brighter)] {
        let encoding = Encoding::new(&scratch, formats, view);
        encoding.go_on(&scratch).unwrap();
        assert_eq!(encoding.finish(&scratch, &request).unwrap(), expected);
    }
}

#[test]
fn the_header_says_what_the_frame_is() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let frame = finish(&scratch, &request(folder.path(), "exr,png")).unwrap();
    let exr = info(&frame.files[0].path).unwrap();
    assert_eq!((exr.kind, exr.parts.len()), (FileKind::Exr, 1));
    assert_eq!(
        exr.packing,
        format!("tiles of {GRID_SQUARE}x{GRID_SQUARE}, zip block compression")
    );
    let part = &exr.parts[0];
    let window = |x, y, width, height| Window {
        x,
        y,
        width,
        height,
    };
    assert_eq!(part.display_window, window(0, 0, 150, 101));
    assert_eq!(part.data_window, window(21, 13, 109, 86));
    assert_eq!(part.layers, ["N"]);
    let kinds: Vec<_> = part
        .channels
        .iter()
        .map(|c| (c.name.as_str(), c.kind))
        .collect();
    let half = |name| (name, SampleKind::F16);
    assert_eq!(
        kinds,
        [
            half("A"),
            half("B"),
            half("G"),
            half("N.X"),
            half("N.Y"),
            half("N.Z"),
            half("R"),
            ("Z", SampleKind::F32)
        ]
    );
    let red = &part.channels[6];
    assert_eq!((red.max, red.not_finite), (65_504.0, 0));
    let alpha = &part.channels[0];
    assert_eq!((alpha.min, alpha.max), (0.0, 1.0));
    assert_eq!(alpha.mean, 58.0 / 86.0);

    let png = info(&frame.files[1].path).unwrap();
    for (info, comment, rate) in [(&exr, "comments", "25/1"), (&png, "Comment", "25")] {
        let said = |name: &str| {
            let found = info.metadata.iter().find(|(key, _)| key == name);
            found.unwrap_or_else(|| panic!("{name}")).1.clone()
        };
        assert_eq!(said("flyby:sceneDigest"), "01".repeat(32));
        assert_eq!(said("flyby:filmDigest"), frame.film_digest.to_string());
        assert_eq!(said("flyby:revision"), "1");
        assert_eq!(said("flyby:settings"), r#"{"rays":"10x10","where":"Höhe"}"#);
        assert_eq!(said("flyby:statistics"), r#"{"rays":123456}"#);
        assert_eq!(said("flyby:software"), "flyby 0.1.0");
        assert_eq!(said("framesPerSecond"), rate);
        assert_eq!(said(comment), "made by a test");
    }
    assert_eq!(png.parts[0].data_window, window(0, 0, 109, 86));
}

#[test]
fn digests_given_when_written_are_those_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let mut files = finish(&scratch, &request(folder.path(), "exr,png,ppm"))
        .unwrap()
        .files;
    let mut deep = request(folder.path(), "png16");
    deep.stem = "deep".into();
    files.extend(finish(&scratch, &deep).unwrap().files);
    assert_eq!(
        names(folder.path()),
        [
            "deep_0007.png",
            "flyby_0007.exr",
            "flyby_0007.png",
            "flyby_7.ppm",
            "scratch",
            "scratch.journal"
        ]
    );
    for file in &files {
        assert_eq!(
            file_digest(&file.path).unwrap(),
            file.digest,
            "{}",
            file.path.display()
        );
        assert_eq!(std::fs::metadata(&file.path).unwrap().len(), file.bytes);
    }
    let formats: Vec<_> = files.iter().map(|file| file.format).collect();
    assert_eq!(
        formats,
        [Format::Exr, Format::Png8, Format::Ppm, Format::Png16]
    );
}

#[test]
fn metadata_and_packing_are_not_in_the_digest() {
    use exr::prelude::{Blocks, Compression, Encoding, LineOrder, Vec2, WritableImage};
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let file = finish(&scratch, &request(folder.path(), "exr"))
        .unwrap()
        .files
        .remove(0);
    let mut other = request(folder.path(), "exr");
    other.stem = "other".into();
    other.metadata.settings = "something else".into();
    let other = finish(&scratch, &other).unwrap().files.remove(0);
    assert_eq!(other.digest, file.digest);
    assert!(compare(&file.path, &other.path).unwrap().is_equal());

    // The same values by another writer, in every packing that loses nothing.
    let mut image = exr::prelude::read_all_flat_layers_from_file(&file.path).unwrap();
    let path = folder.path().join("packed.exr");
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
    ] {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(16, 48))] {
            for line_order in [LineOrder::Increasing, LineOrder::Decreasing] {
                image.layer_data[0].encoding = Encoding {
                    compression,
                    blocks,
                    line_order,
                };
                image.write().to_file(&path).unwrap();
                assert_eq!(
                    file_digest(&path).unwrap(),
                    file.digest,
                    "{compression} {blocks:?}"
                );
            }
        }
    }
}

#[test]
fn the_parts_of_a_file_are_told_apart() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("parts.exr");
    let layer = |name: &str, by: f32| {
        let channels = SpecificChannels::build()
            .with_channel("Y")
            .with_pixel_fn(move |Vec2(x, _)| (x as f32 * by,));
        Layer::new(
            (40, 30),
            LayerAttributes::named(name),
            Encoding::FAST_LOSSLESS,
            channels,
        )
    };
    let bounds = IntegerBounds::from_dimensions((40, 30));
    Image::empty(ImageAttributes::new(bounds))
        .with_layer(layer("near", 1.0))
        .with_layer(layer("far", 2.0))
        .write()
        .to_file(&path)
        .unwrap();
    let info = info(&path).unwrap();
    let most: Vec<_> = info
        .parts
        .iter()
        .map(|part| (part.name.as_deref().unwrap(), part.channels[0].max))
        .collect();
    assert_eq!(most, [("near", 39.0), ("far", 78.0)]);
}

#[test]
fn ppm_and_png_show_the_same_codes() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let files = finish(&scratch, &request(folder.path(), "png,ppm"))
        .unwrap()
        .files;
    let ppm = std::fs::read(&files[1].path).unwrap();
    let head = b"P6\n109 86\n255\n";
    assert!(ppm.starts_with(head));
    let png = std::io::BufReader::new(std::fs::File::open(&files[0].path).unwrap());
    let mut reader = png::Decoder::new(png).read_info().unwrap();
    assert_eq!(
        reader.info().srgb,
        Some(png::SrgbRenderingIntent::Perceptual)
    );
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    assert_eq!(pixels, ppm[head.len()..]);
    let error = compare(&files[0].path, &files[1].path).unwrap_err();
    assert!(
        error.to_string().contains("one is png, the other ppm"),
        "{error}"
    );
}

#[test]
fn a_difference_is_found_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let a = finish(&scratch, &request(folder.path(), "exr"))
        .unwrap()
        .files
        .remove(0);
    drop(scratch);

    let changed = Scratch::create(folder.path().join("changed"), identity(), CROP).unwrap();
    let all = blocks(CROP, 64, 64);
    let pixel = Rect {
        x0: 70,
        y0: 70,
        x1: 71,
        y1: 71,
    };
    let other = Rect {
        x0: 72,
        y0: 75,
        x1: 73,
        y1: 76,
    };
    for (rect, channel, by) in [(pixel, 1, 0.5_f32), (other, 4, -64.0)] {
        let mut bytes = payload(rect);
        let old = value(channel, rect.x0, rect.y0);
        bytes[channel * 4..channel * 4 + 4].copy_from_slice(&(old + by).to_le_bytes());
        changed.write_block(rect, &bytes).unwrap();
    }
    // The square of those pixels in parts around them, so that they are not written over.
    write_all(
        &changed,
        &all.into_iter()
            .filter(|block| !block.contains(pixel))
            .collect::<Vec<_>>(),
    );
    write_all(&changed, &changed.remaining());
    let mut request = request(folder.path(), "exr");
    request.stem = "changed".into();
    let b = finish(&changed, &request).unwrap().files.remove(0);
    assert_ne!(a.digest, b.digest);

    let comparison = compare(&a.path, &b.path).unwrap();
    assert_eq!(
        (comparison.pixels, comparison.differing_pixels),
        (109 * 86, 2)
    );
    assert_eq!(comparison.largest, 64.0);
    assert_eq!(
        comparison.bounds,
        Some(Window {
            x: 70,
            y: 70,
            width: 3,
            height: 6
        })
    );
    let first = comparison.first.unwrap();
    assert_eq!((first.x, first.y, first.channel.as_str()), (70, 70, "G"));
    assert!((first.b - first.a - 0.5).abs() < 1e-3);
}

#[test]
fn frames_of_other_sizes_cannot_be_compared() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let a = finish(&scratch, &request(folder.path(), "exr"))
        .unwrap()
        .files
        .remove(0);
    drop(scratch);
    let scratch = finished(folder.path(), RESOLUTION.rect());
    let mut request = request(folder.path(), "exr");
    request.stem = "whole".into();
    let b = finish(&scratch, &request).unwrap().files.remove(0);
    let error = compare(&a.path, &b.path).unwrap_err().to_string();
    assert!(
        error.contains("109x86 at (21, 13)") && error.contains("150x101 at (0, 0)"),
        "{error}"
    );
}

#[test]
fn an_unfinished_image_makes_no_frame() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = Scratch::create(folder.path().join("scratch"), identity(), CROP).unwrap();
    let error = finish(&scratch, &request(folder.path(), "exr,png")).unwrap_err();
    assert!(matches!(error, ImageError::Incomplete { missing, .. } if missing == CROP.area()));
    assert_eq!(names(folder.path()), ["scratch", "scratch.journal"]);
}

#[test]
fn a_failure_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    // A folder stands where the PPM should: it cannot be replaced.
    std::fs::create_dir_all(folder.path().join(".flyby_7.ppm.partial")).unwrap();
    assert!(finish(&scratch, &request(folder.path(), "exr,png,ppm")).is_err());
    assert_eq!(
        names(folder.path()),
        [".flyby_7.ppm.partial", "scratch", "scratch.journal"]
    );
}

#[test]
fn a_bad_request_is_an_answer() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    let mut exposure = request(folder.path(), "png");
    exposure.view = ViewTransform {
        exposure_stops: f64::NAN,
    };
    let mut stem = request(folder.path(), "png");
    stem.stem = "../flyby".into();
    let mut formats = request(folder.path(), "png");
    formats.formats = Formats::default();
    let mut missing = request(&folder.path().join("nowhere"), "png");
    missing.metadata.comments.clear();
    for (request, part) in [
        (exposure, "exposure of NaN stops"),
        (stem, "`../flyby`"),
        (formats, "exr, png, png16, ppm"),
        (missing, "nowhere/.flyby_0007.png.partial"),
    ] {
        let error = finish(&scratch, &request).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
    assert_eq!(names(folder.path()), ["scratch", "scratch.journal"]);
}

/// Writing through a link to the device that is always full.
#[test]
fn a_full_disk_says_so_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scratch = finished(folder.path(), CROP);
    for (format, name) in [
        ("exr", "flyby_0007.exr"),
        ("png", "flyby_0007.png"),
        ("ppm", "flyby_7.ppm"),
    ] {
        let partial = folder.path().join(format!(".{name}.partial"));
        std::os::unix::fs::symlink("/dev/full", &partial).unwrap();
        let error = finish(&scratch, &request(folder.path(), format)).unwrap_err();
        assert!(error.is_disk_full(), "{error:?}");
        let text = error.to_string();
        assert!(
            text.starts_with("no space left to write") && text.contains(name),
            "{text}"
        );
        assert_eq!(names(folder.path()), ["scratch", "scratch.journal"]);
    }
}
