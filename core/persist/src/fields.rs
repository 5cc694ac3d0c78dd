//! The macro that turns a list of fields into both directions.

/// Implements [`Persist`](crate::Persist) for a struct: the fields to save, then those that keep
/// the value that they were made with. The compiler refuses a list that lacks a field. `sound`
/// names a method that says whether restored values can be worked with.
///
/// `persist!(Type { a, b } kept { settings, scratch } sound is_sound);`
#[macro_export]
macro_rules! persist {
    (
        $type:ident { $($field:ident),+ $(,)? }
        $(kept { $($kept:ident),+ $(,)? })?
        $(sound $sound:ident)?
    ) => {
        impl $crate::Persist for $type {
            fn save(&self, out: &mut $crate::Writer<'_>) {
                let Self { $($field,)+ $($($kept: _,)+)? } = self;
                $( $crate::Persist::save($field, out); )+
            }

            fn restore(&mut self, from: &mut $crate::Reader<'_>) -> Result<(), $crate::Error> {
                let Self { $($field,)+ $($($kept: _,)+)? } = self;
                $( $crate::Persist::restore($field, from)?; )+
                $( if !self.$sound() {
                    return Err($crate::Error::Unsound(stringify!($type)));
                } )?
                Ok(())
            }
        }
    };
}
