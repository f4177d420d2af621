//! The page: one HTML file that holds its pictures and scenes, and fetches nothing.

use std::fmt::Write as _;
use std::time::Duration;

use super::index::Figure;
use super::record::Record;
use crate::progress::duration;

const STYLE: &str = "\
body{font:16px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:76rem;padding:0 1rem;\
background:#16181c;color:#d8dade}\
main{display:grid;grid-template-columns:repeat(auto-fill,minmax(22rem,1fr));gap:2rem}\
figure{margin:0}img{width:100%;height:auto;display:block;border-radius:4px}\
h1{font-weight:500}figcaption b{color:#fff}\
.took{color:#9aa0a8;font-size:.85em;margin:.3rem 0}\
pre{font-size:.75em;overflow:auto;background:#0e1013;padding:.7rem;border-radius:4px}\
summary{cursor:pointer;color:#8fb4e8;font-size:.85em}";

/// One figure with its picture.
pub(crate) struct Entry<'a> {
    /// What it is.
    pub(crate) figure: &'a Figure,
    /// What it took.
    pub(crate) record: &'a Record,
    /// The picture.
    pub(crate) png: Vec<u8>,
    /// The scene file.
    pub(crate) scene: String,
}

/// The whole page.
pub(crate) fn html(entries: &[Entry<'_>]) -> String {
    let mut page = String::from(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n\
         <title>Flyby: figures of the thesis</title>\n<style>",
    );
    page.push_str(STYLE);
    page.push_str(
        "</style>\n<h1>Figures of the thesis, rendered by Flyby</h1>\n\
         <p>M. N. Gamito, <cite>Techniques for stochastic implicit surface modelling and \
         rendering</cite>, Sheffield, 2009. Same formulas, our own random numbers, cameras and \
         colours.</p>\n<main>\n",
    );
    for entry in entries {
        figure(&mut page, entry);
    }
    page.push_str("</main>\n</html>\n");
    page
}

fn figure(page: &mut String, entry: &Entry<'_>) {
    let Entry {
        figure,
        record,
        png,
        scene,
    } = entry;
    let (number, caption) = (escaped(&figure.number), escaped(&figure.caption));
    let took = duration(Duration::from_secs_f64(record.seconds));
    let rate = record.rate();
    let threads = match record.threads {
        1 => "1 thread".to_owned(),
        many => format!("{many} threads"),
    };
    let evaluations = record.evaluations_per_ray();
    // Writing to a string cannot fail.
    let _ = write!(
        page,
        "<figure id=\"{name}\">\n<img alt=\"Figure {number}\" src=\"data:image/png;base64,{picture}\">\n\
         <figcaption><b>{number}</b> {caption}\n\
         <p class=\"took\">{took} on {threads} · {rate} rays/s · {evaluations:.1} evaluations/ray</p>\n\
         <details><summary>{file}</summary><pre>{settings}{scene}</pre></details>\n\
         </figcaption>\n</figure>\n",
        name = escaped(&figure.name),
        picture = base64(png),
        file = escaped(&figure.scene),
        settings = settings(figure),
        scene = escaped(scene),
    );
}

/// What is changed in the scene, as comments before it.
fn settings(figure: &Figure) -> String {
    figure
        .set
        .iter()
        .map(|set| format!("# --set {}\n", escaped(set)))
        .collect()
}

/// Text that HTML shows as it is.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            c => escaped.push(c),
        }
    }
    escaped
}

/// RFC 4648, §4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |i: usize| u32::from(group.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            text.push(if digit <= group.len() {
                char::from(DIGITS[(bits >> (18 - 6 * digit)) as usize & 63])
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xff, 0xef, 0xbe]), "/+++");
    }

    #[test]
    fn a_page_holds_everything_and_lets_no_scene_break_it() {
        let figure = Figure {
            name: "a".into(),
            number: "3.14a".into(),
            scene: "a.toml".into(),
            set: vec!["curves.x=1".into()],
            frame: 0,
            side: None,
            caption: "Heights < 1 & rising.".into(),
        };
        let record = Record {
            name: "a".into(),
            number: "3.14a".into(),
            picture: "a_0000.png".into(),
            scene_digest: String::new(),
            frame: 0,
            revision: 1,
            seconds: 2.0,
            threads: 2,
            rays: 1_000_000,
            evaluations: 20_000_000,
        };
        let page = html(&[Entry {
            figure: &figure,
            record: &record,
            png: b"foobar".to_vec(),
            scene: "</pre><script>".into(),
        }]);
        for part in [
            "base64,Zm9vYmFy",
            "Heights &lt; 1 &amp; rising.",
            "&lt;/pre&gt;&lt;script&gt;",
            "500 k rays/s",
            "20.0 evaluations/ray",
            "# --set curves.x=1",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("http:") && !page.contains("https:"));
    }
}
