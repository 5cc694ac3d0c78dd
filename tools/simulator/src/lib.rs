//! Worlds and sensors: a simulated drive as a log.
