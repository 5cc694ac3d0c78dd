//! The macro that turns a list of fields into both directions.

/// Implements [`Saved`](crate::Saved) for a struct: the fields to save, then those that stay as they were made.
/// The compiler refuses a list that lacks a field. `sound` names a method that says whether restored values can be
/// worked with.
///
/// `saved!(Type { a, b } kept { settings, scratch } sound is_sound);`
#[macro_export]
macro_rules! saved {
    (
        $type:ident { $($field:ident),+ $(,)? }
        $(kept { $($kept:ident),+ $(,)? })?
        $(sound $sound:ident)?
    ) => {
        impl $crate::Saved for $type {
            fn save(&self, out: &mut $crate::Writer<'_>) {
                let Self { $($field,)+ $($($kept: _,)+)? } = self;
                $( $crate::Saved::save($field, out); )+
            }

            fn restore(&mut self, from: &mut $crate::Reader<'_>) -> Result<(), $crate::Error> {
                let Self { $($field,)+ $($($kept: _,)+)? } = self;
                $( $crate::Saved::restore($field, from)?; )+
                $( if !self.$sound() {
                    return Err($crate::Error::Unsound(stringify!($type)));
                } )?
                Ok(())
            }
        }
    };
}
