//! A head of `core/messages` as iceoryx2 carries it.

use iceoryx2::prelude::ZeroCopySend;
use randt_messages::Topic;

/// The head of a topic's messages, named on the bus by its layout: two builds whose structs differ
/// refuse each other.
///
/// Its items follow as bytes; the name's hash covers them too.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Wire<T: Topic>(pub T::Head);

impl<T: Topic> std::fmt::Debug for Wire<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(T::TYPE_NAME)
    }
}

impl<T: Topic> Default for Wire<T> {
    fn default() -> Self {
        Self(bytemuck::Zeroable::zeroed())
    }
}

// SAFETY: heads are `Pod`: plain old data without padding, pointers or destructor, valid for every
// bit pattern. So they may lie in shared memory and be read by a process that maps it elsewhere.
// `repr(transparent)` keeps their layout.
#[allow(unsafe_code)]
unsafe impl<T: Topic> ZeroCopySend for Wire<T> {
    unsafe fn type_name() -> &'static str {
        T::TYPE_NAME
    }
}
