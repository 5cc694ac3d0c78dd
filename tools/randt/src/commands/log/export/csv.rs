//! A table a topic: one row a message, one column a number.

use super::layout::{Column, Layout};
use crate::units::count;
use anyhow::Context;
use randt_log::{Entry, LogReader, StoredLayout};
use std::collections::{BTreeMap, btree_map::Entry as Slot};
use std::fs::File;
use std::io::{BufWriter, Read, Seek, Write};
use std::path::Path;

/// Writes `TOPIC.csv` and, with `items`, `TOPIC.items.csv` into a folder. Topics that are not ours
/// are left out.
pub fn export<R: Read + Seek>(
    reader: &mut LogReader<R>,
    folder: &Path,
    items: bool,
) -> anyhow::Result<String> {
    let mut tables: BTreeMap<String, Table> = BTreeMap::new();
    let mut rows = 0;
    while let Some(entry) = reader.next_entry()? {
        if !entry.channel.is_ours() {
            continue;
        }
        let name = &entry.channel.topic;
        let context = || format!("topic {name}");
        let table = match tables.entry(name.clone()) {
            Slot::Occupied(table) => table.into_mut(),
            Slot::Vacant(slot) => {
                slot.insert(Table::begin(folder, &entry, items).with_context(context)?)
            }
        };
        table.add(&entry).with_context(context)?;
        rows += 1;
    }
    tables.values_mut().try_for_each(Table::flush)?;
    let tables = tables.len() as u64;
    Ok(format!(
        "{} of {}",
        count(rows, "row", "rows"),
        count(tables, "table", "tables")
    ))
}

struct Table {
    stored: StoredLayout,
    layout: Layout,
    messages: BufWriter<File>,
    items: Option<BufWriter<File>>,
}

impl Table {
    fn begin(folder: &Path, entry: &Entry<'_>, items: bool) -> anyhow::Result<Self> {
        let channel = entry.channel;
        let stored = channel.stored_layout();
        let stored = stored.context("no description of its messages")?;
        let layout = Layout::from_stored(&stored);
        // `radar/scan/v1` becomes `radar_scan_v1`.
        let stem = channel.topic.replace('/', "_");
        let create = |name: String| {
            let path = folder.join(name);
            let file = File::create(&path).with_context(|| path.display().to_string());
            file.map(BufWriter::new)
        };
        let mut messages = create(format!("{stem}.csv"))?;
        let names = |columns: &[Column]| {
            let names: Vec<_> = columns.iter().map(|column| column.name.as_str()).collect();
            names.join(",")
        };
        let has_items = layout.item_bytes > 0;
        let count = if has_items { ",items" } else { "" };
        writeln!(messages, "{}{count}", names(&layout.head))?;
        let items = (has_items && items).then(|| create(format!("{stem}.items.csv")));
        let mut items = items.transpose()?;
        if let Some(items) = &mut items {
            writeln!(items, "sequence,time_ns,{}", names(&layout.item))?;
        }
        Ok(Self {
            stored,
            layout,
            messages,
            items,
        })
    }

    fn add(&mut self, entry: &Entry<'_>) -> anyhow::Result<()> {
        let layout = &self.layout;
        let row = |columns: &[Column], bytes: &[u8]| {
            let cells: Vec<_> = columns.iter().map(|column| column.text(bytes)).collect();
            cells.join(",")
        };
        let split = self.stored.split(entry.bytes);
        let (head, rest) = split.context("a message of another size than its layout says")?;
        write!(self.messages, "{}", row(&layout.head, head))?;
        if let Some(items) = rest.len().checked_div(layout.item_bytes) {
            write!(self.messages, ",{items}")?;
        }
        writeln!(self.messages)?;
        if let Some(items) = &mut self.items {
            for item in rest.chunks_exact(layout.item_bytes) {
                let (number, time_ns) = (entry.sequence, entry.time_ns);
                writeln!(items, "{number},{time_ns},{}", row(&layout.item, item))?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.messages.flush()?;
        self.items.iter_mut().try_for_each(BufWriter::flush)
    }
}
