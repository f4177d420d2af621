//! Colours by height, from the first row of an image.

use scene::Description;
use scene::description::Ramp;

use crate::assets::Assets;
use crate::error::RenderError;
use crate::sky::Colour;

/// Most pixels of a ramp's image, and most bytes that decoding it may take.
const SIDE_MAX: u32 = 65_536;
const BYTES_MAX: usize = 256 << 20;

/// Linear colours over a range of heights.
#[derive(Clone, Debug)]
pub(crate) struct Colours {
    row: Vec<Colour>,
    low: f64,
    high: f64,
}

impl Colours {
    /// Decodes a ramp's asset.
    pub(crate) fn load(
        ramp: &Ramp,
        description: &Description,
        assets: &Assets,
    ) -> Result<Self, RenderError> {
        let list = &description.assets;
        let Some(asset) = list.get(ramp.asset as usize) else {
            return Err(RenderError::NoSuchAsset {
                asset: ramp.asset,
                assets: list.len(),
            });
        };
        let Some(bytes) = assets.bytes(asset.digest) else {
            return Err(RenderError::MissingAsset {
                name: asset.name.clone(),
                digest: asset.digest,
            });
        };
        let name = &asset.name;
        Ok(Self {
            row: first_row(bytes, name)?,
            low: ramp.low,
            high: ramp.high,
        })
    }

    /// The colour at a height: that of the row's ends beyond them.
    pub(crate) fn at(&self, height: f64) -> Colour {
        let share = (height - self.low) / (self.high - self.low);
        let share = if share > 0.0 { share } else { 0.0 };
        let last = self.row.len() - 1;
        let along = if share < 1.0 { share } else { 1.0 } * last as f64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 0 and the row's length"
        )]
        let before = (along as usize).min(last);
        let (a, b) = (self.row[before], self.row[(before + 1).min(last)]);
        let rest = along - before as f64;
        [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * rest)
    }
}

fn first_row(bytes: &[u8], name: &str) -> Result<Vec<Colour>, RenderError> {
    let undecodable = |source| RenderError::BadImage {
        name: name.to_owned(),
        source,
    };
    let refuse = |reason| RenderError::BadRamp {
        name: name.to_owned(),
        reason,
    };
    let limits = png::Limits { bytes: BYTES_MAX };
    let mut decoder = png::Decoder::new_with_limits(std::io::Cursor::new(bytes), limits);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(undecodable)?;
    let info = reader.info();
    if info.width > SIDE_MAX || info.height > SIDE_MAX {
        return Err(refuse("it has more than 65536 pixels along a side"));
    }
    if info.interlaced {
        return Err(refuse("it is interlaced; save it without interlacing"));
    }
    let width = info.width as usize;
    let (colour, _) = reader.output_color_type();
    let channels = colour.samples();
    let row = reader
        .next_row()
        .map_err(undecodable)?
        .ok_or_else(|| refuse("it has no rows"))?;
    let data = row.data();
    if channels == 0 || data.len() < width * channels || width == 0 {
        return Err(refuse("its first row is incomplete"));
    }
    Ok(data[..width * channels]
        .chunks_exact(channels)
        .map(|pixel| match *pixel {
            [red, green, blue, ..] => [red, green, blue].map(linear),
            [grey, ..] => [linear(grey); 3],
            [] => [0.0; 3],
        })
        .collect())
}

/// The light that a byte of sRGB stands for, IEC 61966-2-1.
fn linear(byte: u8) -> f64 {
    let value = f64::from(byte) / 255.0;
    if value <= 0.040_45 {
        value / 12.92
    } else {
        libm::pow((value + 0.055) / 1.055, 2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, colour: png::ColorType, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, 1);
        encoder.set_color(colour);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn heights_between_the_ends_are_mixed() {
        let bytes = image(2, png::ColorType::Rgb, &[255, 0, 0, 0, 0, 255]);
        let colours = Colours {
            row: first_row(&bytes, "ramp.png").unwrap(),
            low: 10.0,
            high: 20.0,
        };
        assert_eq!(colours.at(-5.0), [1.0, 0.0, 0.0]);
        assert_eq!(colours.at(15.0), [0.5, 0.0, 0.5]);
        assert_eq!(colours.at(99.0), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn grey_and_alpha_are_understood_and_rubbish_is_refused() {
        let grey = image(1, png::ColorType::GrayscaleAlpha, &[255, 7]);
        assert_eq!(first_row(&grey, "g").unwrap(), [[1.0; 3]]);
        let refused = first_row(b"not a picture", "sand.png").unwrap_err();
        assert!(refused.to_string().contains("sand.png"));
        assert!(first_row(&grey[..40], "g").is_err());
    }
}
