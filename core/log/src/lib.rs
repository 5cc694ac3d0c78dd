//! The MCAP log: the messages' bytes as they are on the bus.
