//! Where readings come from.

use crate::line::{LineSource, TwistReading};
use crate::{Error, Reading, Serial, mip::MipCodec, phidget::Spatial, xsens::XsensCodec};
use randt_config::{ImuDriver, ImuSource};
use randt_device::Count;
use std::fmt::Debug;
use std::os::fd::BorrowedFd;

/// A device and its way in. It never fails: a device that is not there is tried again without end.
pub trait ReadingSource: Debug {
    /// What to sleep on; none while there is nothing open.
    fn descriptor(&self) -> Option<BorrowedFd<'_>>;

    /// Takes what came, and does what is due. The clock is read after the device: an arrival may
    /// be late, but never early, because a device's clock is fitted to the earliest of them.
    fn poll(&mut self, clock: &dyn Fn() -> i64, readings: &mut Vec<Reading>);

    /// When it wants to be polled although nothing came.
    fn due_ns(&self) -> Option<i64>;

    /// Why nothing can come, or an empty text.
    fn fault(&self) -> &str;

    /// The text where nothing comes although it could.
    fn silence(&self) -> String;

    /// What the device does otherwise than it was asked to, or an empty text.
    fn complaint(&self) -> &str;

    /// From one reading to the next, ns, as the device has agreed to.
    fn interval_ns(&self) -> i64;

    /// How often the device was opened anew: its counter and its clock may have begun anew, too.
    fn reconnects(&self) -> u64;

    /// What else was counted.
    fn counts(&self) -> Vec<Count>;

    /// Velocities of the robot that came by the same wire since the last time; few protocols have
    /// them.
    fn drain_twists(&mut self, _sink: &mut dyn FnMut(TwistReading)) {}
}

/// The source that the configuration names.
pub(crate) fn reading_source(config: &ImuDriver) -> Result<Box<dyn ReadingSource>, Error> {
    if config.source != ImuSource::Phidget22 && config.device.is_empty() {
        let expected = match config.source {
            ImuSource::Line => {
                "a serial port's path, or an address to listen on, such as 0.0.0.0:6321"
            }
            _ => "the serial port's path, such as /dev/serial/by-id/...",
        };
        return Err(Error::new("device", "", expected));
    }
    Ok(match config.source {
        ImuSource::Phidget22 => Box::new(Spatial::new(config)?),
        ImuSource::Mip => Box::new(Serial::<MipCodec>::new(config)),
        ImuSource::Xsens => Box::new(Serial::<XsensCodec>::new(config)),
        ImuSource::Line => Box::new(LineSource::of_imu(config)),
    })
}
