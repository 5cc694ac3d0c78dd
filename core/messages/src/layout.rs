//! Layout hash: a fingerprint of a payload's names, types and offsets.
//!
//! Two builds whose structs differ, even by two swapped fields of one size, get different hashes.
//! The hash is part of the type's name on the bus and in the log, so they refuse each other.

/// A plain type whose memory layout is known by name.
pub trait Layout {
    /// Type name as written in the source.
    const NAME: &'static str;
    /// FNV-1a over names, nested hashes, offsets and size.
    const HASH: u64;
    /// Field name, type and byte offset; empty for primitives.
    const FIELDS: &'static [(&'static str, &'static str, usize)];

    /// Calls `visit` with name, size and fields of every struct inside this type, then of itself.
    fn visit(_visit: &mut dyn FnMut(&'static str, usize, Fields)) {}
}

/// Name, type and byte offset of a struct's fields.
pub type Fields = &'static [(&'static str, &'static str, usize)];

/// Start value of FNV-1a, 64 bit.
pub const FNV_SEED: u64 = 0xcbf2_9ce4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01b3;

/// Continues a hash over bytes.
pub const fn hash_bytes(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut i = 0;
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(FNV_PRIME);
        i += 1;
    }
    hash
}

/// Continues a hash over a number.
pub const fn hash_u64(hash: u64, value: u64) -> u64 {
    hash_bytes(hash, &value.to_le_bytes())
}

/// Writes `name`, a dash and 16 hexadecimal digits; `N` must be the name's length + 17.
pub const fn type_name_bytes<const N: usize>(name: &str, hash: u64) -> [u8; N] {
    const HEX: &[u8; 16] = b"0123456789abcdef";
    let mut out = [b'-'; N];
    let bytes = name.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        out[i] = bytes[i];
        i += 1;
    }
    let mut digit = 0;
    while digit < 16 {
        out[bytes.len() + 1 + digit] = HEX[((hash >> (60 - 4 * digit)) & 15) as usize];
        digit += 1;
    }
    out
}

macro_rules! primitive {
    ($($ty:ty),+) => { $(
        impl Layout for $ty {
            const NAME: &'static str = stringify!($ty);
            const HASH: u64 = hash_bytes(FNV_SEED, stringify!($ty).as_bytes());
            const FIELDS: &'static [(&'static str, &'static str, usize)] = &[];
        }
    )+ };
}
primitive!(u8, u16, u32, u64, i8, i16, i32, i64, f32, f64, ());

impl<T: Layout, const N: usize> Layout for [T; N] {
    const NAME: &'static str = T::NAME;
    const HASH: u64 = hash_u64(hash_bytes(T::HASH, b"array"), N as u64);
    const FIELDS: &'static [(&'static str, &'static str, usize)] = &[];

    fn visit(visit: &mut dyn FnMut(&'static str, usize, Fields)) {
        T::visit(visit);
    }
}

/// Declares plain old data: `repr(C)`, no padding (refused by the compiler), with its layout hash. The crate that uses it
/// needs `bytemuck` with its feature `derive`.
#[macro_export]
macro_rules! plain {
    ($( $(#[$meta:meta])* pub struct $name:ident {
        $( $(#[$field_meta:meta])* pub $field:ident : $ty:ty ),+ $(,)?
    } )+) => { $(
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $( $(#[$field_meta])* pub $field : $ty ),+ }

        impl $crate::layout::Layout for $name {
            const NAME: &'static str = stringify!($name);
            const HASH: u64 = {
                use $crate::layout::{FNV_SEED, Layout, hash_bytes, hash_u64};
                let mut hash = hash_bytes(FNV_SEED, stringify!($name).as_bytes());
                $(
                    hash = hash_bytes(hash, stringify!($field).as_bytes());
                    hash = hash_u64(hash, <$ty as Layout>::HASH);
                    hash = hash_u64(hash, core::mem::offset_of!($name, $field) as u64);
                )+
                hash_u64(hash, size_of::<$name>() as u64)
            };
            const FIELDS: &'static [(&'static str, &'static str, usize)] = &[
                $( (stringify!($field), stringify!($ty), core::mem::offset_of!($name, $field)) ),+
            ];

            fn visit(visit: &mut dyn FnMut(&'static str, usize, $crate::layout::Fields)) {
                $( <$ty as $crate::layout::Layout>::visit(visit); )+
                visit(stringify!($name), size_of::<$name>(), Self::FIELDS);
            }
        }

        impl Default for $name {
            fn default() -> Self { bytemuck::Zeroable::zeroed() }
        }
    )+ };
}

#[cfg(test)]
mod tests {
    use super::Layout;

    mod one {
        plain! { pub struct Pair { pub left: f32, pub right: f32 } }
    }
    mod swapped {
        plain! { pub struct Pair { pub right: f32, pub left: f32 } }
    }
    mod nested {
        plain! { pub struct Outer { pub pair: super::one::Pair } }
    }
    mod nested_swapped {
        use super::swapped::Pair;
        plain! { pub struct Outer { pub pair: Pair } }
    }

    #[test]
    fn swapped_fields_of_one_size_have_another_hash() {
        assert_ne!(one::Pair::HASH, swapped::Pair::HASH);
    }

    #[test]
    fn a_change_in_a_nested_type_changes_the_outer_hash() {
        assert_ne!(nested::Outer::HASH, nested_swapped::Outer::HASH);
        assert_ne!(<[one::Pair; 2]>::HASH, <[one::Pair; 3]>::HASH);
    }
}
