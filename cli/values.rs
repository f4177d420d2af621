//! How users write sizes, rectangles and numbers on the command line.

use std::net::{IpAddr, SocketAddr};

use model::rect::SIDE_MAX;
use model::{Rect, Resolution, Span};

use wire::place::DEFAULT_PORT;

pub(crate) use model::words::{label, memory, span};

/// A host or an address, and its port, which is the usual one where none is said: `farm.example.org`, `192.0.2.7:7359`, `[::1]:7359`.
pub(crate) fn host(text: &str) -> Result<String, String> {
    if text.parse::<SocketAddr>().is_ok() {
        return Ok(text.to_owned());
    }
    if let Ok(address) = text.parse::<IpAddr>() {
        return Ok(SocketAddr::new(address, DEFAULT_PORT).to_string());
    }
    let is_host = |host: &str| {
        let is_letter = |letter: char| letter.is_alphanumeric() || "-._".contains(letter);
        !host.is_empty() && !host.starts_with('-') && host.chars().all(is_letter)
    };
    let (host, port) = match text.rsplit_once(':') {
        Some((host, port)) => (host, port.parse().ok()),
        None => (text, Some(DEFAULT_PORT)),
    };
    match port.filter(|_| is_host(host)) {
        Some(port) => Ok(format!("{host}:{port}")),
        None => Err(format!(
            "`{text}` is no address: write it as farm.example.org, farm.example.org:7359 or 192.0.2.7:7359"
        )),
    }
}

/// Two whole numbers from 1 to the longest side of an image, as in `400x300`.
pub(crate) fn resolution(text: &str) -> Result<Resolution, String> {
    let form = || format!("`{text}` is no size: write it as 400x300, width before height");
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or_else(form)?;
    let side = |digits: &str| -> Result<u32, String> {
        let side: u32 = digits.trim().parse().map_err(|_| form())?;
        if (1..=SIDE_MAX).contains(&side) {
            Ok(side)
        } else {
            Err(format!("each side has 1 to {SIDE_MAX} pixels, not {side}"))
        }
    };
    Ok(Resolution {
        width: side(width)?,
        height: side(height)?,
    })
}

/// A part of an image: `x0,y0,x1,y1` (the last two not included) or `WxH+X+Y`.
pub(crate) fn crop(text: &str) -> Result<Rect, String> {
    let form = || {
        format!(
            "`{text}` is no part of an image: write it as x0,y0,x1,y1 (x1 and y1 are not \
             included) or as WxH+X+Y"
        )
    };
    let number = |digits: &str| digits.trim().parse::<u32>().map_err(|_| form());
    let rect = if let Some((size, place)) = text.split_once('+') {
        let (x, y) = place.split_once('+').ok_or_else(form)?;
        let (x0, y0) = (number(x)?, number(y)?);
        let size = resolution(size)?;
        Rect {
            x0,
            y0,
            x1: x0.saturating_add(size.width),
            y1: y0.saturating_add(size.height),
        }
    } else {
        let numbers = text.split(',').map(number).collect::<Result<Vec<_>, _>>()?;
        let [x0, y0, x1, y1] = numbers[..] else {
            return Err(form());
        };
        Rect { x0, y0, x1, y1 }
    };
    if rect.is_empty() || rect.x1 > SIDE_MAX || rect.y1 > SIDE_MAX {
        Err(format!("`{text}` holds no pixel of an image: {}", form()))
    } else {
        Ok(rect)
    }
}

/// A pixel: column and row, as in `120,80`.
pub(crate) fn pixel(text: &str) -> Result<(u32, u32), String> {
    let form = || format!("`{text}` is no pixel: write it as 120,80, column before row");
    let number = |digits: &str| digits.trim().parse::<u32>().map_err(|_| form());
    let (x, y) = text.split_once(',').ok_or_else(form)?;
    match (number(x)?, number(y)?) {
        (x, y) if x < SIDE_MAX && y < SIDE_MAX => Ok((x, y)),
        _ => Err(form()),
    }
}

/// A part of a whole in per cent, such as 0.5; in millionths.
pub(crate) fn percent(text: &str) -> Result<u32, String> {
    let form = || format!("`{text}` is no part of a hundred: write it as 0.5, or 100 for all");
    let digits = text.trim().trim_end_matches('%').trim_end();
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let is_digits = |text: &str| text.chars().all(|letter| letter.is_ascii_digit());
    if whole.is_empty()
        || whole.len() > 3
        || part.len() > 4
        || !is_digits(whole)
        || !is_digits(part)
    {
        return Err(form());
    }
    let millionths: u32 = format!("{whole}{part:0<4}").parse().map_err(|_| form())?;
    match millionths {
        0..=1_000_000 => Ok(millionths),
        _ => Err(form()),
    }
}

/// How long a certificate may count: long enough to be renewed in time, and no longer than somebody may be away.
pub(crate) fn certificate_life(text: &str) -> Result<Span, String> {
    match span(text)? {
        life if (Span::from_secs(3)..=Span::from_secs(31 * 86_400)).contains(&life) => Ok(life),
        _ => Err(format!("`{text}` is out of range: 3 s to 31 d is possible")),
    }
}

/// A host or an address, with a port.
pub(crate) fn host_port(text: &str) -> Result<String, String> {
    let parts = text.rsplit_once(':');
    let right = parts.is_some_and(|(host, port)| {
        let host = host.trim_start_matches('[').trim_end_matches(']');
        let plain = |letter: char| letter.is_ascii_alphanumeric() || "-.:_%".contains(letter);
        !host.is_empty()
            && host.len() <= 253
            && host.chars().all(plain)
            && port.parse::<u16>().is_ok_and(|port| port > 0)
    });
    match right {
        true => Ok(text.to_owned()),
        false => Err(format!(
            "`{text}` is no host with a port: write it as farm.example.org:7359 or [2001:db8::1]:7359"
        )),
    }
}

/// A number of things of which there is at least one.
pub(crate) fn at_least_one(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(0) => Err("there must be at least 1".to_owned()),
        Ok(number @ 1..=4_096) => Ok(number),
        Ok(_) => Err("at most 4096 are possible".to_owned()),
        Err(_) => Err(format!("`{text}` is no whole number")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rect(x0: u32, y0: u32, x1: u32, y1: u32) -> Rect {
        Rect { x0, y0, x1, y1 }
    }

    #[test]
    fn a_host_has_the_usual_port_unless_another_is_said() {
        let port = DEFAULT_PORT;
        for (text, expected) in [
            ("farm.example.org", format!("farm.example.org:{port}")),
            ("farm:80", "farm:80".to_owned()),
            ("192.0.2.7", format!("192.0.2.7:{port}")),
            ("192.0.2.7:80", "192.0.2.7:80".to_owned()),
            ("::1", format!("[::1]:{port}")),
            ("[::1]:80", "[::1]:80".to_owned()),
        ] {
            assert_eq!(host(text), Ok(expected));
        }
        for text in [
            "",
            ":80",
            "farm:",
            "farm:99999",
            "a farm",
            "-o",
            "http://farm",
            "a:b:1",
        ] {
            assert!(host(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes() {
        let size = |width, height| Ok(Resolution { width, height });
        assert_eq!(resolution("400x300"), size(400, 300));
        assert_eq!(resolution("1X65536"), size(1, 65_536));
        for wrong in ["400", "0x3", "3x0", "65537x1", "-1x3", "ax3", "1x2x3", ""] {
            assert!(resolution(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn parts_of_an_image() {
        assert_eq!(crop("10,20,40,60"), Ok(rect(10, 20, 40, 60)));
        assert_eq!(crop("30x40+10+20"), Ok(rect(10, 20, 40, 60)));
        for wrong in [
            "10,20,10,60",
            "1,2,3",
            "30x40",
            "30x40+1",
            "9,9,1,1",
            "1x1+65536+0",
            "",
        ] {
            assert!(crop(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn pixels_and_parts() {
        assert_eq!(pixel("120,80"), Ok((120, 80)));
        for wrong in ["120", "a,1", "-1,2", "65536,0", ""] {
            assert!(pixel(wrong).is_err(), "{wrong}");
        }
        assert_eq!(percent("0.5"), Ok(5_000));
        assert_eq!(percent("100 %"), Ok(1_000_000));
        assert_eq!(percent("0"), Ok(0));
        for wrong in ["", "-1", "100.1", "1.23456", "half", "1e2", "."] {
            assert!(percent(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers_of_things() {
        assert_eq!(at_least_one("2"), Ok(2));
        assert!(at_least_one("0").is_err() && at_least_one("4097").is_err());
        assert!(at_least_one("-1").is_err() && at_least_one("two").is_err());
    }
}
