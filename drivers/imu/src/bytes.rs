//! Big-endian numbers out of bytes that may be too short.

/// The beginning of `data` as an array.
pub(crate) fn array<const N: usize>(data: &[u8]) -> Option<[u8; N]> {
    data.first_chunk().copied()
}

/// Three or four floats in a row.
pub(crate) fn floats<const N: usize>(data: &[u8]) -> Option<[f32; N]> {
    let (words, rest) = data.as_chunks::<4>();
    if !rest.is_empty() {
        return None;
    }
    let words: &[[u8; 4]; N] = words.try_into().ok()?;
    Some(words.map(f32::from_be_bytes))
}

/// Floats as bytes.
pub(crate) fn float_bytes(values: &[f32]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_be_bytes())
        .collect()
}
