//! How values are saved that structs are made of.

use crate::{Error, Persist, Reader, Writer};
use nalgebra::SMatrix;
use std::collections::VecDeque;

macro_rules! plain {
    ($($ty:ty),+) => { $(
        impl Persist for $ty {
            #[inline]
            fn save(&self, out: &mut Writer<'_>) {
                out.plain(self);
            }
            #[inline]
            fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
                *self = from.plain()?;
                Ok(())
            }
        }
    )+ };
}
plain!(u8, u16, u32, u64, i32, i64, f32, f64);

impl Persist for usize {
    fn save(&self, out: &mut Writer<'_>) {
        out.plain(&(*self as u64));
    }
    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        *self = usize::try_from(from.plain::<u64>()?).map_err(|_| Error::Unsound("usize"))?;
        Ok(())
    }
}

impl Persist for bool {
    fn save(&self, out: &mut Writer<'_>) {
        out.plain(&u8::from(*self));
    }
    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        *self = match from.plain::<u8>()? {
            0 => false,
            1 => true,
            _ => return Err(Error::Unsound("bool")),
        };
        Ok(())
    }
}

impl<const R: usize, const C: usize> Persist for SMatrix<f64, R, C> {
    fn save(&self, out: &mut Writer<'_>) {
        self.iter().for_each(|value| value.save(out));
    }
    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.iter_mut().try_for_each(|value| value.restore(from))
    }
}

impl<T: Persist, const N: usize> Persist for [T; N] {
    fn save(&self, out: &mut Writer<'_>) {
        self.iter().for_each(|value| value.save(out));
    }
    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.iter_mut().try_for_each(|value| value.restore(from))
    }
}

macro_rules! tuple {
    ($($name:ident $index:tt),+) => {
        impl<$($name: Persist),+> Persist for ($($name,)+) {
            fn save(&self, out: &mut Writer<'_>) {
                $( self.$index.save(out); )+
            }
            fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
                $( self.$index.restore(from)?; )+
                Ok(())
            }
        }
    };
}
tuple!(A 0, B 1);
tuple!(A 0, B 1, C 2);
tuple!(A 0, B 1, C 2, D 3);

/// Length in bytes, then UTF-8.
impl Persist for String {
    fn save(&self, out: &mut Writer<'_>) {
        self.len().save(out);
        out.bytes(self.as_bytes());
    }
    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        let length: usize = next(from)?;
        let text = str::from_utf8(from.bytes(length)?).map_err(|_| Error::Unsound("String"))?;
        text.clone_into(self);
        Ok(())
    }
}

impl<T: Persist + Default> Persist for Option<T> {
    fn save(&self, out: &mut Writer<'_>) {
        self.is_some().save(out);
        self.iter().for_each(|value| value.save(out));
    }
    fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        *self = if next(from)? { Some(next(from)?) } else { None };
        Ok(())
    }
}

/// A list: its length, then its values. It grows as they come, so that a false length cannot ask
/// for memory.
macro_rules! list {
    ($list:ident, $push:ident) => {
        impl<T: Persist + Default> Persist for $list<T> {
            fn save(&self, out: &mut Writer<'_>) {
                self.len().save(out);
                self.iter().for_each(|value| value.save(out));
            }
            fn restore(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
                self.clear();
                let count: usize = next(from)?;
                for _ in 0..count {
                    self.$push(next(from)?);
                }
                Ok(())
            }
        }
    };
}
list!(Vec, push);
list!(VecDeque, push_back);

fn next<T: Persist + Default>(from: &mut Reader<'_>) -> Result<T, Error> {
    let mut value = T::default();
    value.restore(from)?;
    Ok(value)
}
