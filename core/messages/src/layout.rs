//! Layout hash: a fingerprint of a payload's names, types and offsets.
//!
//! Two builds whose structs differ, even by two swapped fields of one size, get different hashes.
//! The hash is part of the type's name on the bus and in the log, so they refuse each other.

/// A plain type whose memory layout is known by name.
pub trait Layout {
    /// Type name as written in the source.
    const NAME: &'static str;
    /// FNV-1a over names, nested hashes, offsets, codes and size.
    const HASH: u64;
    /// The fields in their order; empty for primitives.
    const FIELDS: Fields;

    /// Calls `visit` with name, size and fields of every struct inside this type, then of itself.
    fn visit(_visit: &mut dyn FnMut(&'static str, usize, Fields)) {}
}

/// The fields of a struct.
pub type Fields = &'static [Field];

/// One field of a struct.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its type as written in the source.
    pub kind: &'static str,
    /// Where it begins in the struct, bytes.
    pub offset: usize,
    /// What its numbers stand for; empty where they are numbers.
    pub codes: Codes,
    /// Where earlier builds had it. Not in the hash.
    pub former: &'static [Former],
}

/// Where earlier builds had the value of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Former {
    /// In a field of this name.
    Name(&'static str),
    /// In one bit of this field, which still exists.
    Bit(&'static str, u32),
}

/// Codes of an enum in a message, each with its name.
pub type Codes = &'static [(u32, &'static str)];

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

/// Continues a hash over codes and their names; without any it stays what it is.
pub const fn hash_codes(mut hash: u64, codes: Codes) -> u64 {
    let mut i = 0;
    while i < codes.len() {
        let (code, name) = codes[i];
        hash = hash_bytes(hash_u64(hash, code as u64), name.as_bytes());
        i += 1;
    }
    hash
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
            const FIELDS: Fields = &[];
        }
    )+ };
}
primitive!(u8, u16, u32, u64, i8, i16, i32, i64, f32, f64, ());

impl<T: Layout, const N: usize> Layout for [T; N] {
    const NAME: &'static str = T::NAME;
    const HASH: u64 = hash_u64(hash_bytes(T::HASH, b"array"), N as u64);
    const FIELDS: Fields = &[];

    fn visit(visit: &mut dyn FnMut(&'static str, usize, Fields)) {
        T::visit(visit);
    }
}

/// Declares plain old data: `repr(C)`, no padding (refused by the compiler), with its layout hash.
/// The crate that uses it needs `bytemuck` with its feature `derive`.
///
/// A field may have, behind its documentation:
/// - `#[was(NAME)]`: its name in earlier builds, whose logs are read by it;
/// - `#[was_bit(FIELD, BIT)]`: the bit of another field that earlier builds had it in;
/// - `#[code(ENUM)]`: the enum whose codes it holds, which a log then names.
#[macro_export]
macro_rules! plain {
    ($( $(#[$meta:meta])* pub struct $name:ident { $(
        $(#[doc = $doc:literal])*
        $(#[was($was:ident)])*
        $(#[was_bit($bits:ident, $bit:literal)])?
        $(#[code($code:ty)])?
        pub $field:ident : $ty:ty
    ),+ $(,)? } )+) => { $(
        $(#[$meta])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
        pub struct $name { $( $(#[doc = $doc])* pub $field : $ty ),+ }

        impl $crate::layout::Layout for $name {
            const NAME: &'static str = stringify!($name);
            const HASH: u64 = {
                use $crate::layout::{FNV_SEED, Layout, hash_bytes, hash_u64};
                let mut hash = hash_bytes(FNV_SEED, stringify!($name).as_bytes());
                $(
                    hash = hash_bytes(hash, stringify!($field).as_bytes());
                    hash = hash_u64(hash, <$ty as Layout>::HASH);
                    hash = hash_u64(hash, core::mem::offset_of!($name, $field) as u64);
                    $( hash = $crate::layout::hash_codes(hash, <$code>::CODES); )?
                )+
                hash_u64(hash, size_of::<$name>() as u64)
            };
            const FIELDS: $crate::layout::Fields = &[$(
                $crate::layout::Field {
                    name: stringify!($field),
                    kind: stringify!($ty),
                    offset: core::mem::offset_of!($name, $field),
                    codes: [$( <$code>::CODES, )? &[]][0],
                    former: &[
                        $( $crate::layout::Former::Name(stringify!($was)), )*
                        $( $crate::layout::Former::Bit(stringify!($bits), $bit), )?
                    ],
                },
            )+];

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

/// Declares an enum that messages hold as its code, a `u32`. Each variant has its code and its
/// name for logs: `Good = 2 => "good"`. What no variant stands for is the one marked `#[default]`.
macro_rules! coded {
    ($( $(#[$meta:meta])* pub enum $name:ident {
        $( $(#[$variant_meta:meta])* $variant:ident = $code:literal => $text:literal ),+ $(,)?
    } )+) => { $(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u32)]
        pub enum $name { $( $(#[$variant_meta])* $variant = $code ),+ }

        impl $name {
            /// Every code with its name.
            pub const CODES: $crate::layout::Codes = &[ $( ($code, $text) ),+ ];

            /// What a code stands for; the default where it stands for nothing.
            pub fn from_code(code: u32) -> Self {
                match code {
                    $( $code => Self::$variant, )+
                    _ => Self::default(),
                }
            }

            /// Its name, as a log's layout gives it.
            pub fn as_str(self) -> &'static str {
                match self { $( Self::$variant => $text ),+ }
            }
        }
    )+ };
}
pub(crate) use coded;

#[cfg(test)]
mod tests {
    use super::{Former, Layout};

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

    coded! {
        /// What a lamp shows.
        pub enum Lamp {
            /// Nothing.
            #[default]
            Dark = 0 => "dark",
            /// Light.
            Lit = 3 => "lit",
        }
    }
    mod described {
        plain! {
            pub struct Pair {
                #[was(port)]
                #[was(larboard)]
                #[code(super::Lamp)]
                pub left: f32,
                /// Right.
                #[was_bit(left, 7)]
                pub right: f32,
            }
        }
    }

    mod renamed {
        plain! {
            pub struct Pair {
                #[was(larboard)]
                pub left: f32,
                pub right: f32,
            }
        }
    }

    #[test]
    fn codes_are_part_of_the_hash_and_former_names_are_not() {
        assert_ne!(described::Pair::HASH, one::Pair::HASH);
        assert_eq!(renamed::Pair::HASH, one::Pair::HASH);
        let [left, right] = described::Pair::FIELDS else {
            panic!("two fields");
        };
        assert_eq!(left.codes, [(0, "dark"), (3, "lit")]);
        assert_eq!(
            left.former,
            [Former::Name("port"), Former::Name("larboard")]
        );
        assert!(right.codes.is_empty());
        assert_eq!(right.former, [Former::Bit("left", 7)]);
    }

    #[test]
    fn a_code_is_its_variant_and_any_other_is_the_default() {
        for (code, name) in Lamp::CODES {
            let lamp = Lamp::from_code(*code);
            assert_eq!((lamp as u32, lamp.as_str()), (*code, *name));
        }
        assert_eq!(Lamp::from_code(1), Lamp::Dark);
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
