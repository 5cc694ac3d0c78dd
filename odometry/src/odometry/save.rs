//! The whole state as bytes, after every scan: who restores it goes on as if nothing had been, to the last bit.

use super::{Odometry, PENDING};
use crate::scan;
use randt_config::Config;
use randt_messages::PoseRecord;
use randt_persist::{Error, Persist, Reader, StateIdentity, Writer, decode, encode};

/// The source that gives the bytes their meaning (build.rs).
const CODE: &str = env!("RANDT_CODE");

impl Odometry {
    /// Room that every state of a window of some scans finds, bytes; most have a hundredth of it.
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
            heading,
            imu,
            pending,
            spare: _,
            ended_wait_ns,
            standstill,
            slots,
            used,
            prior,
            settled,
            leaving,
            inserted,
            solver: _,
            submaps,
            cells: _,
            keyframes,
            judge,
            frame,
            sequence,
            counters,
            record,
            last_scan,
            last_imu,
        } = self;
        if let Some(heading) = heading {
            heading.save(out);
        }
        imu.save(out);
        pending.len().save(out);
        pending.iter().for_each(|scan| scan::save(scan, out));
        ended_wait_ns.save(out);
        standstill.save(out);
        used.save(out);
        slots.iter().take(*used).for_each(|slot| slot.save(out));
        prior.save(out);
        settled.save(out);
        leaving.save(out);
        inserted.save(out);
        submaps.save(out);
        keyframes.save(out);
        judge.save(out);
        frame.save(out);
        sequence.save(out);
        counters.save(out);
        out.plain(record);
        last_scan.save(out);
        last_imu.save(out);
    }

    fn read(&mut self, from: &mut Reader<'_>) -> Result<(), Error> {
        if let Some(heading) = &mut self.heading {
            heading.restore(from)?;
        }
        self.imu.restore(from)?;
        let mut pending = 0_usize;
        pending.restore(from)?;
        if pending > PENDING {
            return Err(Error::Unsound("waiting scans"));
        }
        for _ in 0..pending {
            let mut message = self.spare.pop().unwrap_or_default();
            scan::restore(&mut message, from)?;
            self.pending.push_back(message);
        }
        self.ended_wait_ns.restore(from)?;
        self.standstill.restore(from)?;
        self.used.restore(from)?;
        let slots = self.slots.get_mut(..self.used);
        for slot in slots.ok_or(Error::Unsound("window"))? {
            slot.restore(from)?;
        }
        self.prior.restore(from)?;
        self.settled.restore(from)?;
        self.leaving.restore(from)?;
        self.inserted.restore(from)?;
        self.submaps.restore(from)?;
        self.keyframes.restore(from)?;
        self.judge.restore(from)?;
        self.frame.restore(from)?;
        self.sequence.restore(from)?;
        self.counters.restore(from)?;
        self.record = from.plain::<PoseRecord>()?;
        self.last_scan.restore(from)?;
        self.last_imu.restore(from)
    }
}

/// Which states are ours.
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
