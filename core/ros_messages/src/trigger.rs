//! `std_srvs/Trigger`: a request without content, and its response.

use crate::pen::{Pen, Style};

/// A response behind what a middleware may put before it, which has a multiple of eight bytes.
pub fn trigger_response(before: &[u8], success: bool, message: &str) -> Vec<u8> {
    let mut pen = Pen::new(Style::Cdr);
    pen.bare(before);
    pen.u8(u8::from(success));
    pen.string(message);
    pen.end()
}
