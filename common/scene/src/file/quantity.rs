//! Numbers with units, as a scene file writes them: `"25 m"`, `"60 km/h"`, `"40 deg"`.

use super::tree::Value;

/// What a number measures.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Dimension {
    /// Nothing: a pure number.
    None,
    /// Metres inside.
    Length,
    /// Radians inside. A plain number is refused: it could be degrees.
    Angle,
    /// Seconds inside.
    Time,
    /// Metres per second inside. A plain number is refused: it could be km/h.
    Speed,
    /// Factors of two of light.
    Stops,
    /// Whatever its unit says: the values of named curves.
    Any,
}

struct Unit {
    name: &'static str,
    dimension: Dimension,
    /// The base unit is `times` / `over` of this one: a division is exact where a factor is not.
    times: f64,
    over: f64,
}

const fn unit(name: &'static str, dimension: Dimension, times: f64, over: f64) -> Unit {
    Unit {
        name,
        dimension,
        times,
        over,
    }
}

const UNITS: &[Unit] = &[
    unit("m", Dimension::Length, 1.0, 1.0),
    unit("km", Dimension::Length, 1000.0, 1.0),
    unit("cm", Dimension::Length, 1.0, 100.0),
    unit("mm", Dimension::Length, 1.0, 1000.0),
    unit("deg", Dimension::Angle, core::f64::consts::PI, 180.0),
    unit("rad", Dimension::Angle, 1.0, 1.0),
    unit("s", Dimension::Time, 1.0, 1.0),
    unit("ms", Dimension::Time, 1.0, 1000.0),
    unit("min", Dimension::Time, 60.0, 1.0),
    unit("m/s", Dimension::Speed, 1.0, 1.0),
    unit("km/h", Dimension::Speed, 1.0, 3.6),
    unit("stops", Dimension::Stops, 1.0, 1.0),
];

impl Dimension {
    /// Its name with an article.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None | Self::Any => "a number",
            Self::Length => "a length",
            Self::Angle => "an angle",
            Self::Time => "a time",
            Self::Speed => "a speed",
            Self::Stops => "a number of stops",
        }
    }

    /// A value as one would write it.
    pub(crate) fn example(self) -> &'static str {
        match self {
            Self::None | Self::Any => "0.5",
            Self::Length => "\"25 m\"",
            Self::Angle => "\"40 deg\"",
            Self::Time => "\"20 ms\"",
            Self::Speed => "\"60 km/h\"",
            Self::Stops => "\"2 stops\"",
        }
    }

    /// Its units' names.
    pub(crate) fn units(self) -> Vec<&'static str> {
        UNITS
            .iter()
            .filter(|unit| unit.dimension == self || self == Self::Any)
            .map(|unit| unit.name)
            .collect()
    }

    /// Whether a number without a unit can only mean the base unit.
    pub(crate) fn takes_plain_numbers(self) -> bool {
        !matches!(self, Self::Angle | Self::Speed)
    }
}

/// Why a value is no quantity of the dimension.
#[derive(Debug, PartialEq)]
pub(crate) struct Refusal {
    pub(crate) message: String,
    pub(crate) help: Option<String>,
}

/// The value in base units.
pub(crate) fn quantity(value: &Value, wanted: Dimension) -> Result<f64, Refusal> {
    let number = match value {
        Value::Text(text) => from_text(text, wanted)?,
        #[expect(clippy::cast_precision_loss, reason = "a scene's integers are small")]
        Value::Integer(integer) => plain(*integer as f64, wanted)?,
        Value::Number(number) => plain(*number, wanted)?,
        other => {
            return Err(Refusal {
                message: format!("{} is wanted here, not {}", wanted.name(), other.kind()),
                help: Some(format!("write it like {}", wanted.example())),
            });
        }
    };
    if number.is_finite() {
        Ok(number)
    } else {
        Err(Refusal {
            message: format!("{} must be finite, not {number}", wanted.name()),
            help: None,
        })
    }
}

fn plain(number: f64, wanted: Dimension) -> Result<f64, Refusal> {
    if number == 0.0 || number.is_nan() || wanted.takes_plain_numbers() {
        return Ok(number);
    }
    let units: Vec<_> = wanted
        .units()
        .iter()
        .map(|unit| format!("\"{number} {unit}\""))
        .collect();
    Err(Refusal {
        message: format!("{} needs its unit", wanted.name()),
        help: Some(format!("write {}", units.join(" or "))),
    })
}

fn from_text(text: &str, wanted: Dimension) -> Result<f64, Refusal> {
    let text = text.trim();
    let end = number_end(text);
    let (digits, name) = (&text[..end], text[end..].trim());
    let Ok(number) = digits.replace('_', "").parse::<f64>() else {
        return Err(Refusal {
            message: format!("\"{text}\" is not {}", wanted.name()),
            help: Some(format!("write it like {}", wanted.example())),
        });
    };
    if name.is_empty() {
        return plain(number, wanted);
    }
    let Some(unit) = UNITS.iter().find(|unit| unit.name == name) else {
        let units = wanted.units();
        let help = match nearest(name, UNITS.iter().map(|unit| unit.name)) {
            Some(near) if units.contains(&near) => format!("did you mean \"{digits} {near}\"?"),
            _ if units.is_empty() => "it takes no unit".to_owned(),
            _ => format!("{} is given in {}", wanted.name(), units.join(", ")),
        };
        return Err(Refusal {
            message: format!("there is no unit `{name}`"),
            help: Some(help),
        });
    };
    if wanted != Dimension::Any && unit.dimension != wanted {
        let units = wanted.units();
        return Err(Refusal {
            message: format!(
                "\"{text}\" is {}, but {} is wanted here",
                unit.dimension.name(),
                wanted.name()
            ),
            help: Some(if units.is_empty() {
                format!("it takes no unit: {digits}")
            } else {
                format!("it is given in {}", units.join(", "))
            }),
        });
    }
    Ok(number * unit.times / unit.over)
}

/// Where the number at the start of a text ends: `e` belongs to it only before digits.
fn number_end(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digit = |at: usize| bytes.get(at).is_some_and(u8::is_ascii_digit);
    let mut end = 0;
    while let Some(&byte) = bytes.get(end) {
        let belongs = match byte {
            b'0'..=b'9' | b'.' | b'_' => true,
            b'+' | b'-' => end == 0 || matches!(bytes[end - 1], b'e' | b'E'),
            b'e' | b'E' => {
                end > 0
                    && (digit(end + 1)
                        || (matches!(bytes.get(end + 1), Some(b'+' | b'-')) && digit(end + 2)))
            }
            _ => false,
        };
        if !belongs {
            break;
        }
        end += 1;
    }
    end
}

/// The word that was probably meant: one slip away, or much alike.
pub(crate) fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    /// Jaro-Winkler similarity below which two words share nothing.
    const ALIKE: f64 = 0.75;
    let word = word.to_lowercase();
    known
        .filter_map(|each| {
            let other = each.to_lowercase();
            let slips = strsim::damerau_levenshtein(&word, &other);
            let alike = strsim::jaro_winkler(&word, &other);
            let near = slips == 0
                || (slips == 1 && word.len() >= 3)
                || (alike >= ALIKE && word.len() >= 4);
            near.then_some((slips, alike, each))
        })
        .min_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)))
        .map(|(_, _, each)| each)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, wanted: Dimension) -> Result<f64, String> {
        quantity(&Value::Text(text.into()), wanted).map_err(|refusal| refusal.message)
    }

    #[test]
    fn quantities_as_users_write_them() {
        for (text, dimension, value) in [
            ("25 m", Dimension::Length, 25.0),
            ("6371 km", Dimension::Length, 6_371_000.0),
            ("6_371km", Dimension::Length, 6_371_000.0),
            ("-1.5e2cm", Dimension::Length, -1.5),
            ("60 km/h", Dimension::Speed, 60.0 / 3.6),
            ("180 deg", Dimension::Angle, core::f64::consts::PI),
            ("0.5 rad", Dimension::Angle, 0.5),
            ("20 ms", Dimension::Time, 0.02),
            ("2 stops", Dimension::Stops, 2.0),
            ("0", Dimension::Angle, 0.0),
            ("3", Dimension::Length, 3.0),
        ] {
            assert_eq!(read(text, dimension), Ok(value), "{text}");
        }
    }

    #[test]
    fn what_is_no_quantity_says_so() {
        assert_eq!(
            read("25 deg", Dimension::Length),
            Err("\"25 deg\" is an angle, but a length is wanted here".into())
        );
        assert_eq!(
            read("25 parsec", Dimension::Length),
            Err("there is no unit `parsec`".into())
        );
        assert_eq!(
            read("40", Dimension::Angle),
            Err("an angle needs its unit".into())
        );
        assert_eq!(
            read("high", Dimension::Length),
            Err("\"high\" is not a length".into())
        );
        assert_eq!(
            read("1e999 m", Dimension::Length),
            Err("a length must be finite, not inf".into())
        );
        assert!(quantity(&Value::Number(f64::NAN), Dimension::Angle).is_err());
        assert!(quantity(&Value::Flag(true), Dimension::Time).is_err());
    }
}
