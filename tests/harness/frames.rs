//! Frames as files, to be compared byte for byte.

use std::fs;
use std::path::Path;

/// The attribute of a frame's header that counts what its rendering took: rays are followed in bundles that end at a tile's
/// edge, so that it says how the image was cut, and nothing of the picture.
const STATISTICS: &str = "flyby:statistics";

/// All bytes of an EXR file but for [`STATISTICS`], and with the places of its chunks counted from its header's end, which
/// that attribute moves.
pub(crate) fn comparable(file: &Path) -> Vec<u8> {
    let bytes = fs::read(file).unwrap();
    // The magic number and the version.
    let (mut kept, mut rest) = (bytes[..8].to_vec(), &bytes[8..]);
    while rest[0] != 0 {
        let end_of_word =
            |from: usize| from + rest[from..].iter().position(|&byte| byte == 0).unwrap();
        let name = end_of_word(0);
        let kind = end_of_word(name + 1);
        let length = i32::from_le_bytes(rest[kind + 1..kind + 5].try_into().unwrap());
        let (attribute, after) = rest.split_at(kind + 5 + usize::try_from(length).unwrap());
        if attribute[..name] != *STATISTICS.as_bytes() {
            kept.extend(attribute);
        }
        rest = after;
    }
    rest = &rest[1..];
    let header = (bytes.len() - rest.len()) as u64;
    // The table of places ends where the first chunk begins.
    let place = |entry: &[u8]| u64::from_le_bytes(entry.try_into().unwrap()) - header;
    let table = usize::try_from(place(&rest[..8])).unwrap();
    let (table, chunks) = rest.split_at(table);
    for entry in table.chunks_exact(8) {
        kept.extend(place(entry).to_le_bytes());
    }
    kept.extend(chunks);
    kept
}

/// The frames of a folder, in the order of their names, as [`comparable`].
pub(crate) fn frames(folder: &Path) -> Vec<Vec<u8>> {
    let entries = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries
        .filter(|path| path.extension().is_some_and(|kind| kind == "exr"))
        .collect();
    files.sort();
    files.iter().map(|file| comparable(file)).collect()
}

/// Sees that frames are the same to the byte; says where they are not.
#[track_caller]
pub(crate) fn are_same(found: &[Vec<u8>], expected: &[Vec<u8>]) {
    assert_eq!(found.len(), expected.len(), "how many frames");
    for (number, (found, expected)) in found.iter().zip(expected).enumerate() {
        let differ = |(ours, theirs): (&u8, &u8)| ours != theirs;
        let place = found.iter().zip(expected).position(differ);
        let around = |bytes: &[u8], place: usize| {
            let end = bytes.len().min(place + 80);
            String::from_utf8_lossy(&bytes[place.saturating_sub(80).min(end)..end]).into_owned()
        };
        if let Some(place) = place.or((found.len() != expected.len()).then_some(found.len())) {
            panic!(
                "frame {number} differs at byte {place} of {}: {:?} and not {:?}",
                expected.len(),
                around(found, place),
                around(expected, place)
            );
        }
    }
}
