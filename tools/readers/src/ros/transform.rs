//! `tf2_msgs/TFMessage`, and the chain of static transforms from `base_link` to a sensor.

use super::wire::{Encoding, Malformed, Wire};
use randt_geometry::Quaternion;
use std::collections::BTreeSet;

/// A frame seen from its parent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Transform {
    pub parent: String,
    pub child: String,
    pub translation_m: [f64; 3],
    pub rotation: Quaternion,
}

/// Names of the robot's own frame, best first (REP-105, and common practice).
const BASE_FRAMES: [&str; 2] = ["base_link", "base_footprint"];

/// Frames on the way from the base to a sensor; more is a loop.
const MAX_CHAIN: usize = 32;

/// Decodes the transforms of one message.
pub(crate) fn decode(bytes: &[u8], encoding: Encoding) -> Result<Vec<Transform>, Malformed> {
    let mut wire = Wire::new(bytes, encoding)?;
    let mut transforms = Vec::new();
    for _ in 0..wire.u32()? {
        let parent = wire.header()?.frame;
        let child = wire.string()?;
        let translation_m = wire.f64s()?;
        let [x, y, z, w] = wire.f64s()?;
        transforms.push(Transform {
            // ROS 1 programs of the tf era write a leading slash.
            parent: parent.trim_start_matches('/').to_owned(),
            child: child.trim_start_matches('/').to_owned(),
            translation_m,
            rotation: Quaternion::new(w, x, y, z),
        });
    }
    Ok(transforms)
}

/// The transforms of a recording, the first of each child frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    transforms: Vec<Transform>,
    /// Child frames whose transform was seen to change.
    moving: BTreeSet<String>,
}

impl Tree {
    pub fn add(&mut self, transform: Transform) {
        let known = self.transforms.iter().find(|t| t.child == transform.child);
        match known {
            None => self.transforms.push(transform),
            Some(known) if *known == transform => {}
            Some(_) => _ = self.moving.insert(transform.child),
        }
    }

    /// A sensor's pose in the base frame: translation m and rotation; `None` without a static
    /// chain.
    pub fn in_base(&self, frame: &str) -> Option<([f64; 3], Quaternion)> {
        let mut frame = frame.trim_start_matches('/');
        let mut translation = [0.0; 3];
        let mut rotation = Quaternion::IDENTITY;
        for _ in 0..MAX_CHAIN {
            // Robots of a fleet put their name before their frames: robot_1/base_link.
            let own_name = frame.rsplit('/').next().unwrap_or(frame);
            if BASE_FRAMES.contains(&own_name) {
                return Some((translation, rotation));
            }
            let step = self.transforms.iter().find(|t| t.child == frame)?;
            if self.moving.contains(&step.child) {
                return None;
            }
            let [x, y, z]: [f64; 3] = step.rotation.rotate(translation.into()).into();
            let [x_m, y_m, z_m] = step.translation_m;
            translation = [x + x_m, y + y_m, z + z_m];
            rotation = step.rotation.multiply(&rotation);
            frame = &step.parent;
        }
        None
    }
}
