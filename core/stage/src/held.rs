//! Parts of the bus that are not given back where their memory is gone.
//!
//! Whoever gives a port or a service back writes to its memory and removes files by their names.
//! When the memory has been removed or cut, writing ends the process, and the names may be those
//! of what others have made anew.

use std::cell::Cell;
use std::ops::Deref;
use std::rc::Rc;

/// Whether the memory of this process's parts of the bus is gone.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gone(Rc<Cell<bool>>);

/// A part that is given back when it is dropped, unless its memory is gone.
#[derive(Debug)]
pub(crate) struct Held<T> {
    part: Rc<T>,
    gone: Gone,
}

impl Gone {
    /// From now on nothing is given back.
    pub(crate) fn set(&self) {
        self.0.set(true);
    }

    /// Holds a part.
    pub(crate) fn hold<T>(&self, part: T) -> Held<T> {
        Held {
            part: Rc::new(part),
            gone: self.clone(),
        }
    }
}

impl<T> Deref for Held<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.part
    }
}

impl<T> Drop for Held<T> {
    fn drop(&mut self) {
        if self.gone.0.get() {
            // One owner more, who never drops it.
            std::mem::forget(Rc::clone(&self.part));
        }
    }
}
