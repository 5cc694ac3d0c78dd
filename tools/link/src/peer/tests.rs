//! Two ends in a time of their own, with a link between them.

use super::*;
use crate::stream::{InStream, MemorySource};
use std::cell::RefCell;
use std::rc::Rc;

const SECOND_NS: i64 = 1_000_000_000;
const STEP_NS: i64 = 20_000_000;
const STATE: u8 = 0;
const KEYFRAME: u8 = 1;
const TILE: u8 = 2;

/// A robot and a base; what is under way is there after a delay, or never while the link is away.
struct Link {
    robot: Peer,
    base: Peer,
    keyframes: Rc<RefCell<MemorySource>>,
    now_ns: i64,
    /// How far the robot's clock is ahead, ns.
    ahead_ns: i64,
    is_away: bool,
    /// Frames with the time of their arrival, to the base and back.
    under_way: [VecDeque<(i64, Vec<u8>)>; 2],
    /// What came at the base: topic, and how old it was, ns.
    came: Vec<(u8, i64)>,
    /// Bytes that the robot has sent, with their overhead.
    bytes: usize,
}

impl Link {
    fn new(rate_max: f64) -> Self {
        let keyframes = Rc::new(RefCell::new(MemorySource::new(3)));
        let up = Cargo {
            newest: vec![
                NewestTopic::new(STATE, true, 0.0),
                NewestTopic::new(TILE, false, 0.0),
            ],
            streams: vec![OutStream::new(KEYFRAME, keyframes.clone(), 0.0)],
            incoming: Vec::new(),
        };
        let there = Cargo {
            incoming: vec![InStream::new(KEYFRAME, None)],
            ..Cargo::default()
        };
        Self {
            robot: Peer::new(up, rate_max),
            base: Peer::new(there, 0.0),
            keyframes,
            now_ns: SECOND_NS,
            ahead_ns: 0,
            is_away: false,
            under_way: [VecDeque::new(), VecDeque::new()],
            came: Vec::new(),
            bytes: 0,
        }
    }

    /// Lets time pass; each step the robot has something new.
    fn run(&mut self, seconds: i64, mut publish: impl FnMut(&mut Self, i64)) {
        for step in 0..seconds * SECOND_NS / STEP_NS {
            publish(self, step);
            self.step();
        }
    }

    fn step(&mut self) {
        let delay_ns = 50_000_000;
        let there_ns = self.now_ns + delay_ns;
        while let Some(frame) = self.robot.next_frame(self.now_ns + self.ahead_ns) {
            self.bytes += on_wire(frame.len());
            if !self.is_away {
                self.under_way[0].push_back((there_ns, frame));
            }
        }
        while let Some(frame) = self.base.next_frame(self.now_ns) {
            if !self.is_away {
                self.under_way[1].push_back((there_ns, frame));
            }
        }
        self.now_ns += STEP_NS;
        let now_ns = self.now_ns;
        let arrives =
            |way: &mut VecDeque<(i64, Vec<u8>)>| way.pop_front_if(|(at_ns, _)| *at_ns <= now_ns);
        while let Some((_, frame)) = arrives(&mut self.under_way[0]) {
            for received in self.base.receive(&frame, now_ns).unwrap_or_default() {
                let stamp = received.message.first_chunk().copied();
                let age_ns = now_ns - i64::from_le_bytes(stamp.unwrap_or_default());
                self.came.push((received.topic, age_ns));
            }
        }
        while let Some((_, frame)) = arrives(&mut self.under_way[1]) {
            let _ = self.robot.receive(&frame, now_ns + self.ahead_ns);
        }
    }

    /// A message of the robot's, of this moment; it does not shrink.
    fn message(&self, bytes: usize) -> Vec<u8> {
        let mut message = self.now_ns.to_le_bytes().to_vec();
        let mut number = self.now_ns as u64;
        message.resize_with(bytes, || {
            number = number
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (number >> 56) as u8
        });
        message
    }

    fn push(&mut self, topic: u8, key: u64, bytes: usize) {
        let message = self.message(bytes);
        let mut topics = self.robot.cargo.newest.iter_mut();
        if let Some(newest) = topics.find(|newest| newest.topic == topic) {
            newest.push(key, self.now_ns, message);
        }
    }

    /// A state each step, and more keyframes and tiles than any link takes.
    fn push_all(&mut self, step: i64) {
        self.push(STATE, 0, 200);
        self.push(TILE, step as u64 % 50, 4000);
        let message = self.message(10_000);
        self.keyframes.borrow_mut().push(message);
    }

    fn oldest_s(&self, topic: u8) -> f64 {
        let ages = self.came.iter().filter(|(of, _)| *of == topic);
        ages.map(|(_, age_ns)| *age_ns).max().unwrap_or(i64::MAX) as f64 * 1e-9
    }

    fn count(&self, topic: u8) -> usize {
        self.came.iter().filter(|(of, _)| *of == topic).count()
    }
}

#[test]
fn no_more_goes_than_the_greatest_rate() {
    for rate_max in [8_000.0, 30_000.0] {
        let mut link = Link::new(rate_max);
        link.run(60, Link::push_all);
        let rate = link.bytes as f64 / 60.0;
        println!("{rate_max} B/s at most: {rate:.0}");
        assert!((0.9 * rate_max..1.01 * rate_max).contains(&rate), "{rate}");
        // What matters comes all the same.
        assert!(link.oldest_s(STATE) < 1.0, "{}", link.oldest_s(STATE));
        assert!(link.count(KEYFRAME) > 5);
    }
}

#[test]
fn a_base_that_is_off_for_an_hour_costs_no_memory_and_gets_the_newest_at_once() {
    let mut link = Link::new(0.0);
    link.run(5, Link::push_all);
    link.is_away = true;
    link.bytes = 0;
    link.run(3600, |link, step| {
        link.push(STATE, 0, 200);
        link.push(TILE, step as u64 % 50, 40);
    });
    // It is called once a second.
    assert!(link.bytes < 3600 * 500, "{}", link.bytes);
    let kept = &link.robot;
    assert!(kept.unknown.len() <= UNKNOWN_MAX);
    link.is_away = false;
    link.came.clear();
    link.run(3, |link, _| link.push(STATE, 0, 200));
    assert!(link.count(STATE) > 10 && link.oldest_s(STATE) < 1.0);
    // Each of them once.
    assert_eq!(link.count(TILE), 50);
}

#[test]
fn a_robot_that_comes_back_with_another_clock_is_heard_at_once_and_its_clock_is_known() {
    let mut link = Link::new(0.0);
    for ahead_s in [7200, 3600, 7200, -3600] {
        // A clock changes with a boot, and that is another process.
        let next = Link::new(0.0);
        (link.robot, link.keyframes) = (next.robot, next.keyframes);
        link.ahead_ns = ahead_s * SECOND_NS;
        link.came.clear();
        link.run(5, Link::push_all);
        let (states, oldest_s) = (link.count(STATE), link.oldest_s(STATE));
        println!("{ahead_s} s ahead: {states} states, the oldest of {oldest_s:.2} s");
        assert!(states > 30 && oldest_s < 1.0);
        let (offset_ns, off_ns) = link.base.clock_offset.estimate_ns().unwrap_or_default();
        assert!((offset_ns - link.ahead_ns).abs() <= off_ns && off_ns < SECOND_NS);
    }
}
