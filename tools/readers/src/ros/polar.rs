//! `sensor_msgs/Image` with a polar sweep in it.

use super::wire::{Encoding, Malformed, RosHeader, Wire};

/// Largest plausible image, pixels.
const PIXELS_MAX: usize = 64 << 20;

/// A grey image of 8 bits.
pub(crate) struct RosImage {
    pub header: RosHeader,
    pub width: usize,
    pub height: usize,
    /// Row by row, without padding.
    pub pixels: Vec<u8>,
}

impl RosImage {
    pub fn decode(bytes: &[u8], encoding: Encoding) -> Result<Self, Malformed> {
        Self::read(&mut Wire::new(bytes, encoding)?)
    }

    /// Reads it where it begins another message.
    pub fn read(wire: &mut Wire<'_>) -> Result<Self, Malformed> {
        let header = wire.header()?;
        let height = wire.u32()? as usize;
        let width = wire.u32()? as usize;
        let format = wire.string()?;
        wire.u8()?; // byte order, which bytes have none of
        let step = wire.u32()? as usize;
        let data = wire.bytes()?;
        if !matches!(format.as_str(), "mono8" | "8UC1") {
            return Err(wire.malformed(format!(
                "an image of {format}; a polar sweep is mono8 or 8UC1"
            )));
        }
        let pixels = height.checked_mul(width).filter(|n| *n <= PIXELS_MAX);
        let is_whole = pixels.is_some_and(|n| n > 0)
            && step >= width
            && step.checked_mul(height).is_some_and(|n| n <= data.len());
        if !is_whole {
            return Err(wire.malformed(format!(
                "{width} x {height} pixels, {step} bytes a row, {} in all",
                data.len()
            )));
        }
        let rows = data.chunks_exact(step).take(height);
        let rows = rows.map(|row| row.get(..width).unwrap_or_default());
        Ok(Self {
            header,
            width,
            height,
            pixels: rows.collect::<Vec<_>>().concat(),
        })
    }
}
