//! The stage around one end of the link: bus and journal on one side, Zenoh on the other.

use crate::base::Base;
use crate::cargo::Cargo;
use crate::carrier::{Carrier, Opening, listen_to_remarks, take_remarks};
use crate::newest::NewestTopic;
use crate::peer::{Peer, Received};
use crate::ports::{Input, open_inputs};
use crate::robot::Robot;
use crate::settings::{Carried, Settings};
use crate::status::Status;
use crate::stream::{MemorySource, OutStream};
use randt_config::Config;
use randt_messages::{Keyframe, Topic};
use randt_stage::{Descriptor, Stage, Waitable, WakeReason};
use std::cell::RefCell;
use std::error::Error;
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// A port that is taken, or an address that is not there yet, is tried again this often.
const OPEN_AGAIN: Duration = Duration::from_secs(2);
/// Whether it is open is looked after this often until then.
const OPENING: Duration = Duration::from_millis(50);

/// What one end does with its own bus.
pub trait End {
    /// What came.
    fn deliver(&mut self, received: Received, peer: &mut Peer) -> Result<(), Box<dyn Error>>;
    /// A turn of the loop: what the bus has for the other end.
    fn turn(&mut self, peer: &mut Peer) -> Result<(), Box<dyn Error>>;
    /// What wakes the loop beside the topics that are sent.
    fn waitables(&self) -> Vec<&dyn Waitable>;
    /// How long the loop may sleep for it.
    fn pause(&self) -> Duration;
    /// What is lost or wrong, and how many messages are lost.
    fn problem(&self, peer: &Peer) -> (String, u64);
    /// What is to be logged, once.
    fn take_news(&mut self) -> Vec<String>;
}

/// Topics that this end sends from memory.
struct Outward {
    inputs: Vec<Box<dyn Input>>,
    every: Vec<(u8, Rc<RefCell<MemorySource>>)>,
}

impl Outward {
    /// Opens what is sent, except what `is_own` takes care of.
    fn open(
        stage: &mut Stage,
        carried: &[Carried],
        cargo: &mut Cargo,
        is_own: impl Fn(&Carried) -> bool,
    ) -> Result<Self, randt_stage::Error> {
        let mut every = Vec::new();
        let mut topics = Vec::new();
        for it in carried.iter().filter(|it| !is_own(it)) {
            topics.push(it.topic);
            if it.is_every {
                let series = stage.epoch() as i64;
                let source = Rc::new(RefCell::new(MemorySource::new(series)));
                let stream = OutStream::new(it.topic, source.clone(), it.rate);
                cargo.streams.push(stream);
                every.push((it.topic, source));
            } else {
                let topic = NewestTopic::new(it.topic, it.is_urgent, it.rate);
                cargo.newest.push(topic);
            }
        }
        let inputs = open_inputs(stage, &topics)?;
        Ok(Self { inputs, every })
    }

    /// Reads what has come.
    fn turn(&mut self, peer: &mut Peer) -> Result<(), randt_stage::Error> {
        for input in &mut self.inputs {
            let topic = input.topic();
            while let Some(read) = input.receive()? {
                if let Some((_, source)) = self.every.iter().find(|(of, _)| *of == topic) {
                    source.borrow_mut().push(read.bytes);
                    continue;
                }
                let mut topics = peer.cargo.newest.iter_mut();
                if let Some(newest) = topics.find(|newest| newest.topic == topic) {
                    newest.push(read.key, read.stamp_ns, read.bytes);
                }
            }
        }
        Ok(())
    }

    fn lost(&self) -> u64 {
        let missed = self.inputs.iter().map(|input| input.missed());
        let dropped = self.every.iter().map(|(_, source)| source.borrow().lost);
        missed.chain(dropped).sum()
    }
}

/// Whether a topic is the keyframes' and goes by the journal.
pub fn is_keyframes(carried: &Carried) -> bool {
    carried.is_every && carried.name == Keyframe::NAME
}

/// Runs the stage until its end is requested.
pub fn run(
    stage: &mut Stage,
    config: &Config,
    settings: &Settings,
    journal: &Path,
) -> Result<(), Box<dyn Error>> {
    let mut cargo = Cargo::default();
    let outward = settings.outward();
    let mut end: Box<dyn End> = match settings.is_base {
        true => Box::new(Base::open(stage, settings, &mut cargo)?),
        false => Box::new(Robot::open(stage, config, settings, journal, &mut cargo)?),
    };
    // A mapper's requests are the base's own matter.
    let is_own = |it: &Carried| is_keyframes(it) || settings.is_base && !end_reads(it);
    let mut sent = Outward::open(stage, outward, &mut cargo, is_own)?;
    let mut peer = Peer::new(cargo, settings.rate_max);
    let mut status = Status::new(settings);
    listen_to_remarks();
    let mut carrier: Option<Carrier> = None;
    let mut opening = Some(Opening::begin(settings));
    let mut open_at = Instant::now();
    stage.running()?;
    loop {
        let clock = stage.clock();
        match opening.as_ref().and_then(Opening::poll) {
            Some(Ok(opened)) => (carrier, opening) = (Some(opened), None),
            Some(Err(why)) => {
                status.set_fault(&why.to_string());
                (opening, open_at) = (None, Instant::now() + OPEN_AGAIN);
            }
            None if opening.is_none() && carrier.is_none() && Instant::now() >= open_at => {
                opening = Some(Opening::begin(settings));
            }
            None => {}
        }
        if let Some(carrier) = &mut carrier {
            carrier.take_notices();
            while let Some(frame) = carrier.receive() {
                match peer.receive(&frame, clock.now_ns()) {
                    Ok(received) => {
                        for received in received {
                            end.deliver(received, &mut peer)?;
                        }
                    }
                    Err(refusal) => status.set_refusal(&refusal, clock.now_ns()),
                }
            }
        }
        sent.turn(&mut peer)?;
        end.turn(&mut peer)?;
        if let Some(carrier) = &carrier {
            status.set_open();
            while let Some(frame) = peer.next_frame(clock.now_ns()) {
                carrier.send(frame);
            }
        }
        for text in take_remarks() {
            status.remark(&text);
        }
        let (problem, lost) = end.problem(&peer);
        for text in status.take_news().into_iter().chain(end.take_news()) {
            stage.log_info(&text);
        }
        let now_ns = clock.now_ns();
        stage.set_status(&status.problem(&peer, &problem, now_ns), lost + sent.lost());
        let summary = status.summary(&peer, now_ns);
        stage.set_remark(&summary);
        stage.set_status_note(&summary);
        let mut pause = peer.pause(now_ns).min(end.pause());
        if carrier.is_none() {
            pause = OPENING;
        }
        let awake = carrier.as_ref().map(|it| Descriptor::new(it.descriptor()));
        let awake = awake.transpose()?;
        let mut on = end.waitables();
        on.extend(sent.inputs.iter().map(|input| input.waitable()));
        on.extend(awake.iter().map(|it| it as &dyn Waitable));
        if stage.wait(&on, Some(pause))? == WakeReason::Stop {
            drop(on);
            // Zenoh waits for the other end when a session is closed; the process's end does it.
            std::mem::forget((carrier, opening));
            return Ok(());
        }
    }
}

/// Whether a topic that the base sends is read as any other one.
fn end_reads(carried: &Carried) -> bool {
    carried.name != randt_messages::MapperGraph::NAME
}
