//! What the bus carries in this build: its topics, and the structs of their messages.

use anyhow::Context;
use randt_log::{Kind, StoredLayout, Struct, describe};
use randt_messages::{BUS_TOPICS, BusTopic, Layout, Topic, TopicVisitor, visit_bus_topics};
use std::fmt::Write as _;
use std::sync::Arc;

/// A topic and the names of its structs.
pub struct TopicLayout {
    /// Its name, type name and quality of service.
    pub topic: BusTopic,
    /// What a message begins with.
    pub head: Arc<Struct>,
    /// One element of what follows, where something does.
    pub item: Option<Kind>,
}

/// All topics, and every struct once, after those inside it.
pub struct BusLayout {
    /// In the order of the data's way.
    pub topics: Vec<TopicLayout>,
    /// Named by their layout's text.
    pub structs: Vec<Arc<Struct>>,
    /// The topics' layouts as logs carry them.
    text: String,
}

impl BusLayout {
    /// The layout of this program's messages.
    pub fn of_this_build() -> anyhow::Result<Self> {
        let mut layout = Self {
            topics: Vec::new(),
            structs: Vec::new(),
            text: String::new(),
        };
        visit_bus_topics(&mut layout)?;
        Ok(layout)
    }

    /// Every topic's layout, as logs carry it too.
    pub fn text(&self) -> String {
        self.text.clone()
    }

    fn add(&mut self, kind: &Kind) {
        match kind {
            Kind::Number(_) => {}
            Kind::Array(element, _) => self.add(element),
            Kind::Struct(found) => {
                found.fields.iter().for_each(|field| self.add(&field.kind));
                if self.structs.iter().all(|known| known.name != found.name) {
                    self.structs.push(Arc::clone(found));
                }
            }
        }
    }
}

impl TopicVisitor for BusLayout {
    type Error = anyhow::Error;

    fn visit<T: Topic>(&mut self) -> anyhow::Result<()> {
        let text = describe::<T>();
        let mut parsed =
            StoredLayout::parse(&text).with_context(|| format!("{}: layout", T::NAME))?;
        // A ROS 2 definition names the message, not what it begins with.
        if let Kind::Struct(head) = &mut parsed.head {
            Arc::make_mut(head).name = T::Head::NAME.to_owned();
        }
        let topic = BUS_TOPICS.iter().find(|topic| topic.name == T::NAME);
        let topic = *topic.with_context(|| format!("{}: not on the bus", T::NAME))?;
        let _ = writeln!(self.text, "{text}");
        self.add(&parsed.head);
        parsed.item.iter().for_each(|item| self.add(item));
        let Kind::Struct(head) = parsed.head else {
            anyhow::bail!("{}: no struct", T::NAME);
        };
        let item = parsed.item;
        self.topics.push(TopicLayout { topic, head, item });
        Ok(())
    }
}

impl TopicLayout {
    /// The name for constants: `ODOMETRY_STATE` for `odometry/state/v1`.
    pub fn constant(&self) -> String {
        let name = self.topic.name;
        let unversioned = name.rsplit_once('/').map_or(name, |(name, _)| name);
        unversioned.replace('/', "_").to_uppercase()
    }
}

/// `OdometryState` as `odometry_state`.
pub fn snake_case(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}
