//! Typed configuration: an environment profile, a sensor, a robot; overrides on top.
//!
//! Responsible for reading, checking and showing. Not responsible for where a value is used.
//!
//! ```
//! use randt_config::{Config, Selection};
//!
//! let loaded = Config::load(&Selection {
//!     profile: Some("indoor".to_owned()),
//!     set: vec!["ndt.cell_size_m=0.4".to_owned()],
//!     ..Selection::default()
//! })?;
//! assert_eq!(loaded.config.ndt.cell_size_m, 0.4);
//! # Ok::<(), randt_config::Error>(())
//! ```

#[cfg(feature = "clap")]
mod arguments;
mod bins;
mod builtin;
mod config;
mod error;
mod extent;
mod host;
mod input;
mod layer;
mod load;
mod location;
#[cfg(feature = "clap")]
mod name_or_file;
mod pin;
mod rule;
mod section;
mod sections;
mod show;
mod value;
mod web_access;
mod web_origin;

#[cfg(feature = "clap")]
pub use arguments::SelectionArguments;
pub use config::{Config, Section};
pub use error::Error;
pub use host::Host;
pub use input::{InputGeometry, check_input};
pub use layer::Origins;
pub use load::{DEFAULT_PROFILE, Loaded, Selection, check_file};
pub use location::Location;
#[cfg(feature = "clap")]
pub use name_or_file::NameOrFile;
pub use pin::{DevicePin, SenderPin};
pub use rule::Rule;
pub use section::Key;
pub use sections::{
    Attitude, ByteOrder, Filter, Grid, ImuDriver, ImuSource, Keyframe, Link, LinkRole, Loops,
    MapperHost, Ndt, Odometry, RadarDriver, RadarSource, Record, Robot, Sensor, Submap, View,
};
pub use web_access::{HostNames, WebOrigins};
pub use web_origin::WebOrigin;
