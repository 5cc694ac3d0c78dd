//! The whole state as bytes, after every scan: odometry that is restored goes on to the same bits.

use super::Odometry;
use randt_config::Config;
use randt_persist::{Error, Persist, Reader, StateIdentity, Writer, decode, encode};

/// The source that gives the bytes their meaning (build.rs).
const CODE: &str = env!("RANDT_CODE");

impl Odometry {
    /// Room that is enough for the state of every possible window, bytes; most states take a
    /// hundredth.
    pub const STATE_BYTES_MAX: usize = 32 << 20;

    /// Writes the state into a buffer; gives the number of bytes in use. Nothing is allocated.
    ///
    /// Waiting scans and samples are in it. What the sink was given is not.
    pub fn save(&self, out: &mut [u8]) -> Result<usize, Error> {
        encode(&self.identity, out, |out| self.write(out))
    }

    /// Goes on from a state that the same build saved under the same configuration.
    pub fn restore(config: &Config, use_imu: bool, bytes: &[u8]) -> Result<Self, Error> {
        let mut odometry = Self::new(config, use_imu);
        let mut from = decode(&odometry.identity, bytes)?;
        odometry.read(&mut from)?;
        from.end()?;
        Ok(odometry)
    }

    fn write(&self, out: &mut Writer<'_>) {
        // Named one by one, so that a new field is not forgotten.
        let Self {
            config: _,
            identity: _,
            synchronizer,
            gyro,
            gyro_check,
            twist,
            initializer: _,
            window,
            submaps,
            clutter,
            overlap,
            tracking,
            keyframes,
            mounting,
            frame,
            publisher,
            counters,
        } = self;
        synchronizer.save(out);
        if let Some(gyro) = gyro {
            gyro.save(out);
        }
        gyro_check.save(out);
        twist.save(out);
        window.save(out);
        submaps.save(out);
        clutter.save(out);
        overlap.save(out);
        tracking.save(out);
        keyframes.save(out);
        mounting.save(out);
        frame.save(out);
        publisher.save(out);
        counters.save(out);
    }

    fn read(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        self.synchronizer.restore(from)?;
        if let Some(gyro) = &mut self.gyro {
            gyro.restore(from)?;
        }
        self.gyro_check.restore(from)?;
        self.twist.restore(from)?;
        self.window.restore(from)?;
        self.submaps.restore(from)?;
        self.clutter.restore(from)?;
        self.overlap.restore(from)?;
        self.tracking.restore(from)?;
        self.keyframes.restore(from)?;
        self.mounting.restore(from)?;
        self.frame.restore(from)?;
        self.publisher.restore(from)?;
        self.counters.restore(from)
    }
}

/// Which states this build can take over.
pub(super) fn identity(config: &Config, use_imu: bool) -> StateIdentity {
    let mut code = [b' '; 16];
    code.iter_mut()
        .zip(CODE.bytes())
        .for_each(|(to, from)| *to = from);
    StateIdentity {
        magic: *b"ODOMETRY",
        code,
        // Without an IMU the state has other parts.
        config: config.fingerprint() ^ u64::from(use_imu),
    }
}
