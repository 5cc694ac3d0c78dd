//! Polar images as PNG files.

use super::{BINS_MAX, METADATA_BYTES, PolarImage};
use std::fs::File;
use std::io::{BufRead, BufReader, Seek};
use std::path::Path;

impl PolarImage {
    /// Reads a file; the error has what is there instead of a polar sweep.
    pub fn read(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|error| error.to_string())?;
        Self::decode(BufReader::new(file))
    }

    fn decode(reader: impl BufRead + Seek) -> Result<Self, String> {
        let mut decoder = png::Decoder::new(reader);
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
        let (width, height) = reader.info().size();
        let (color, depth) = reader.output_color_type();
        let (width, height) = (width as usize, height as usize);
        // Both sides may be the ranges.
        let largest = BINS_MAX + METADATA_BYTES;
        if color != png::ColorType::Grayscale
            || depth != png::BitDepth::Eight
            || width.max(height) > largest
            || width.min(height) > 1024
        {
            return Err(format!(
                "{width} x {height} pixels of {color:?} {depth:?}; a polar sweep is grey, of 8 bits, with up to 1024 azimuths and {BINS_MAX} bins"
            ));
        }
        let mut pixels = vec![0; width * height];
        reader
            .next_frame(&mut pixels)
            .map_err(|error| error.to_string())?;
        Self::from_pixels(pixels, width, height)
    }
}
