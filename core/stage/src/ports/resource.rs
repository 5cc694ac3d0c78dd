//! Resources of the bus that are not released once their memory is lost.
//!
//! Releasing a port or a service writes to its memory and removes files by their names. When that
//! memory has been removed or cut, writing ends the process, and the names may be those of files
//! that others have made anew.

use std::cell::Cell;
use std::ops::Deref;
use std::rc::Rc;

/// Whether the memory of this process's resources is lost.
#[derive(Clone, Debug, Default)]
pub(crate) struct MemoryLoss(Rc<Cell<bool>>);

/// A resource that is released when it is dropped, unless its memory is lost.
#[derive(Debug)]
pub(crate) struct BusResource<T> {
    resource: Rc<T>,
    memory_loss: MemoryLoss,
}

impl MemoryLoss {
    /// From now on nothing is released.
    pub(crate) fn set(&self) {
        self.0.set(true);
    }

    /// Takes a resource.
    pub(crate) fn guard<T>(&self, resource: T) -> BusResource<T> {
        BusResource {
            resource: Rc::new(resource),
            memory_loss: self.clone(),
        }
    }
}

impl<T> Deref for BusResource<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.resource
    }
}

impl<T> Drop for BusResource<T> {
    fn drop(&mut self) {
        if self.memory_loss.0.get() {
            // One owner more, which is never dropped.
            std::mem::forget(Rc::clone(&self.resource));
        }
    }
}
