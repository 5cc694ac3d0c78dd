//! Counters, each written once: its field, its name, and whether it is a loss.

/// A struct of counters. `event` is something that happened, `loss` is data that are missing.
macro_rules! counters {
    (
        $(#[$doc:meta])*
        $visibility:vis struct $name:ident { $($field:ident: $kind:ident $shown:literal),+ $(,)? }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default)]
        $visibility struct $name { $(pub $field: u64),+ }

        impl $name {
            /// Gives all counters in their order.
            $visibility fn visit(&self, visit: &mut dyn FnMut(randt_device::Count)) {
                $(visit(randt_device::Count::$kind($shown, self.$field));)+
            }
        }

        impl core::ops::AddAssign for $name {
            fn add_assign(&mut self, more: Self) {
                $(self.$field += more.$field;)+
            }
        }
    };
}

pub(crate) use counters;
