//! The macro that saves an enum by the names of its variants.

/// The code that a variant is saved by: FNV-1a of its name, 32 bits.
pub const fn variant_code(name: &str) -> u32 {
    let mut hash: u32 = 0x811c_9dc5;
    let mut rest = name.as_bytes();
    while let [byte, tail @ ..] = rest {
        hash = (hash ^ *byte as u32).wrapping_mul(0x0100_0193);
        rest = tail;
    }
    hash
}

/// Whether all codes differ.
#[doc(hidden)]
pub const fn are_distinct(mut codes: &[u32]) -> bool {
    while let [first, tail @ ..] = codes {
        let mut rest = tail;
        while let [other, tail @ ..] = rest {
            if *first == *other {
                return false;
            }
            rest = tail;
        }
        codes = tail;
    }
    true
}

/// Implements [`Persist`](crate::Persist) for an enum: its variants, each with the names of its
/// fields, whose types have a [`Default`]. The compiler refuses a list that lacks a variant or a
/// field.
///
/// A variant is saved as [`variant_code`](crate::variant_code) of its name, four bytes, then its
/// fields. So variants may be added, removed and put in another order; a variant that is renamed
/// keeps its saved name after `as`.
///
/// `persist_enum!(Type { Unit, Renamed as "Before", Tuple(a), Struct { a, b } });`
#[macro_export]
macro_rules! persist_enum {
    (@name $variant:ident) => { stringify!($variant) };
    (@name $variant:ident $name:literal) => { $name };
    (
        $type:ident { $(
            $variant:ident $(as $name:literal)?
            $(( $($item:ident),+ $(,)? ))?
            $({ $($field:ident),+ $(,)? })?
        ),+ $(,)? }
    ) => {
        impl $crate::Persist for $type {
            fn save(&self, out: &mut $crate::Writer<'_>) {
                match self { $(
                    Self::$variant $(( $($item),+ ))? $({ $($field),+ })? => {
                        out.plain(&const {
                            $crate::variant_code($crate::persist_enum!(@name $variant $($name)?))
                        });
                        $($( $crate::Persist::save($item, out); )+)?
                        $($( $crate::Persist::save($field, out); )+)?
                    }
                )+ }
            }

            fn restore(&mut self, from: &mut $crate::Reader<'_>) -> Result<(), $crate::Error> {
                let code: u32 = from.plain()?;
                $(
                    if code == const {
                        $crate::variant_code($crate::persist_enum!(@name $variant $($name)?))
                    } {
                        $($(
                            let mut $item = Default::default();
                            $crate::Persist::restore(&mut $item, from)?;
                        )+)?
                        $($(
                            let mut $field = Default::default();
                            $crate::Persist::restore(&mut $field, from)?;
                        )+)?
                        *self = Self::$variant $(( $($item),+ ))? $({ $($field),+ })?;
                        return Ok(());
                    }
                )+
                Err($crate::Error::Unsound(stringify!($type)))
            }
        }

        const _: () = assert!($crate::are_distinct(&[$(
            $crate::variant_code($crate::persist_enum!(@name $variant $($name)?))
        ),+]));
    };
}
