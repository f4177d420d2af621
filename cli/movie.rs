//! A movie of finished PNG frames, by ffmpeg where it is installed.

use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;

use crate::error::Error;
use crate::stop::Stop;

/// Most bytes kept of what ffmpeg says.
const SAID_BYTES_MAX: u64 = 16 << 10;

/// What came of asking for a movie.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Movie {
    /// It is there.
    Made(PathBuf),
    /// There is no ffmpeg on this machine.
    NoEncoder,
}

/// What to tell a user without ffmpeg.
pub(crate) const HOW_TO_INSTALL: &str = "no movie is made, because there is no `ffmpeg` here: install it (Debian and Ubuntu: \
     `apt install ffmpeg`, Fedora: `dnf install ffmpeg-free`, macOS: `brew install ffmpeg`) and run \
     this again";

/// Makes `<folder>/<stem>.mp4` of PNG frames, in order, H.264 where ffmpeg has it.
///
/// The movie appears whole or not at all. Fails if a frame cannot be read, if ffmpeg
/// refuses, or if the user wants to stop.
pub(crate) fn make(
    folder: &Path,
    stem: &str,
    frames: &[PathBuf],
    fps: f64,
    stop: &Stop,
) -> Result<Movie, Error> {
    let Some(codec) = codec()? else {
        return Ok(Movie::NoEncoder);
    };
    let movie = folder.join(format!("{stem}.mp4"));
    let unfinished = folder.join(format!(".{stem}.mp4.part"));
    let made = encode(&unfinished, codec, frames, fps, stop).and_then(|()| {
        fs::rename(&unfinished, &movie).map_err(|error| {
            Error::failed(format!("cannot put the movie at `{}`", movie.display())).because(error)
        })
    });
    if made.is_err() {
        let _ = fs::remove_file(&unfinished);
    }
    made.map(|()| Movie::Made(movie))
}

/// How ffmpeg is to encode.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Codec {
    H264,
    Mpeg4,
}

/// The best codec of this machine's ffmpeg; `None` without ffmpeg.
fn codec() -> Result<Option<Codec>, Error> {
    let asked = Command::new("ffmpeg")
        .args(["-hide_banner", "-encoders"])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output();
    match asked {
        Ok(answer) => Ok(Some(best_codec(&String::from_utf8_lossy(&answer.stdout)))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Error::failed("cannot start `ffmpeg`").because(error)),
    }
}

fn best_codec(encoders: &str) -> Codec {
    let has = |name: &str| encoders.split_whitespace().any(|word| word == name);
    if has("libx264") {
        Codec::H264
    } else {
        Codec::Mpeg4
    }
}

fn encode(to: &Path, codec: Codec, frames: &[PathBuf], fps: f64, stop: &Stop) -> Result<(), Error> {
    let attempt = || format!("cannot make the movie `{}`", to.display());
    let mut encoder = command(to, codec, fps)
        .spawn()
        .map_err(|error| Error::failed(attempt()).because(error))?;
    let stderr = encoder.stderr.take().expect("it is piped");
    let listener = thread::spawn(move || said(stderr));
    let fed = feed(&mut encoder, frames, stop);
    if fed.as_ref().is_err_and(|error| !error.is_broken_pipe()) {
        // It would otherwise finish a movie that nobody wants.
        let _ = encoder.kill();
    }
    let ended = encoder
        .wait()
        .map_err(|error| Error::failed(attempt()).because(error))?;
    let said = listener.join().unwrap_or_default();
    match fed {
        // Where ffmpeg left early, what it said is the reason.
        Err(error) if !error.is_broken_pipe() => Err(error),
        _ if ended.success() => Ok(()),
        _ => Err(Error::failed(attempt()).because(format!("ffmpeg said: {said}"))),
    }
}

fn command(to: &Path, codec: Codec, fps: f64) -> Command {
    let mut command = Command::new("ffmpeg");
    command
        .args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y"])
        .args(["-f", "image2pipe", "-c:v", "png"])
        .args(["-framerate", &fps.to_string(), "-i", "pipe:0", "-an"])
        // Both codecs want even sides; the frames are sRGB, whose primaries are BT.709's.
        .args([
            "-vf",
            "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv",
        ])
        .args(["-pix_fmt", "yuv420p", "-colorspace", "bt709"])
        .args(["-color_primaries", "bt709", "-color_trc", "bt709"]);
    match codec {
        Codec::H264 => command.args(["-c:v", "libx264", "-crf", "18", "-preset", "medium"]),
        Codec::Mpeg4 => command.args(["-c:v", "mpeg4", "-q:v", "3"]),
    };
    command
        .args(["-movflags", "+faststart", "-f", "mp4"])
        .arg(to)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command
}

/// Sends the frames, then closes ffmpeg's input.
fn feed(encoder: &mut Child, frames: &[PathBuf], stop: &Stop) -> Result<(), Error> {
    let mut input = encoder.stdin.take().expect("it is piped");
    for frame in frames {
        if stop.is_set() {
            return Err(Error::interrupted("the movie was not finished")
                .next("the frames are whole: run the same command again to make it"));
        }
        let send = || io::copy(&mut File::open(frame)?, &mut input);
        let mut send = send;
        send().map_err(|error| {
            Error::failed(format!("cannot send `{}` to ffmpeg", frame.display())).because(error)
        })?;
    }
    Ok(())
}

/// The beginning of what ffmpeg says, on one line; the rest is read too, so that it never waits.
fn said(mut stderr: impl io::Read) -> String {
    let mut said = Vec::new();
    let _ = stderr.by_ref().take(SAID_BYTES_MAX).read_to_end(&mut said);
    let _ = io::copy(&mut stderr, &mut io::sink());
    let said = String::from_utf8_lossy(&said);
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn h264_where_there_is_one() {
        let listed = " V....D libx264              libx264 H.264\n V.S... mpeg4    MPEG-4 part 2";
        assert_eq!(best_codec(listed), Codec::H264);
        assert_eq!(
            best_codec(" V....D libx264rgb  x\n V.S... mpeg4  y"),
            Codec::Mpeg4
        );
    }

    #[test]
    fn a_missing_frame_is_named_and_nothing_is_left() {
        if codec().unwrap().is_none() {
            eprintln!("skipped: there is no ffmpeg");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("a_0000.png");
        let error = make(folder.path(), "a", &[missing], 25.0, &Stop::new()).unwrap_err();
        assert!(error.to_string().contains("a_0000.png"), "{error}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
