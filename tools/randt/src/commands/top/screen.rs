//! The terminal: one page that fits 80 x 24 and uses what is more.

use super::facts::{self, Fact};
use super::snapshot::Snapshot;
use super::table::{self, Table};
use anyhow::Context;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::{Alignment, Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph, Wrap};
use ratatui::{DefaultTerminal, Frame};
use std::time::Duration;

/// From this width on robot and map stand beside each other: the topics, and two columns of facts
/// with 34 each.
const WIDE: u16 = WIDE_TOPICS.1 + 2 * 34;
/// Between two columns of a table, and the width of the topics with that: the longest name has 20
/// characters.
const TOPICS: (usize, u16) = (2, 46);
const WIDE_TOPICS: (usize, u16) = (4, 54);
const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);

const HELP: &str = "\
q, Esc, Ctrl-C   end
?                this page

RESTARTS  starts of the stage before this one
CPU       of one processor, over the last interval
LOST      stage: data lost in itself; topic: messages
          that its readers missed
AGE       since the last message, as its stage reports
wait      end of the sweep until the IMU covers it
compute   from then until the pose is published;
          median and p99 of the last 200 scans
position, heading: in the map where the mapper has
          placed the robot, else in odom

States: starting running degraded stopping finished
stopped (by a signal) dead";

/// What the user wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// Nothing.
    Nothing,
    /// Another screen: the size or the page has changed.
    Draw,
    /// The end.
    End,
}

/// The terminal, given back however this process ends.
pub struct Screen {
    terminal: DefaultTerminal,
    help: bool,
}

impl Drop for Screen {
    fn drop(&mut self) {
        // A panic is dealt with by ratatui's own hook, before its message is printed.
        ratatui::restore();
    }
}

impl Screen {
    /// Takes the terminal.
    pub fn open() -> anyhow::Result<Self> {
        Ok(Self {
            terminal: ratatui::try_init().context("the terminal cannot be used")?,
            help: false,
        })
    }

    /// Draws what differs from the last screen.
    pub fn draw(&mut self, snapshot: &Snapshot) -> anyhow::Result<()> {
        let help = self.help;
        self.terminal
            .draw(|frame| draw(frame, snapshot, help))
            .context("the terminal cannot be written")?;
        Ok(())
    }

    /// Waits for a key.
    pub fn wait(&mut self, pause: Duration) -> anyhow::Result<Asked> {
        let reading = "the terminal cannot be read";
        if !event::poll(pause).context(reading)? {
            return Ok(Asked::Nothing);
        }
        Ok(match event::read().context(reading)? {
            Event::Key(key) if key.kind == KeyEventKind::Press => self.key(key),
            Event::Resize(..) => Asked::Draw,
            _ => Asked::Nothing,
        })
    }

    fn key(&mut self, key: KeyEvent) -> Asked {
        match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Asked::End,
            KeyCode::Char('?' | 'h') => {
                self.help = !self.help;
                Asked::Draw
            }
            KeyCode::Char('q') => Asked::End,
            KeyCode::Esc if self.help => {
                self.help = false;
                Asked::Draw
            }
            KeyCode::Esc => Asked::End,
            _ => Asked::Nothing,
        }
    }
}

/// Draws a page.
fn draw(frame: &mut Frame, snapshot: &Snapshot, help: bool) {
    let (stages, topics) = (table::stages(snapshot), table::topics(snapshot));
    let (robot, map) = (facts::robot(snapshot), facts::map(snapshot));
    let wide = frame.area().width >= WIDE;
    let (gap, width) = if wide { WIDE_TOPICS } else { TOPICS };
    let facts = match wide {
        true => robot.len(),
        false => robot.len() + map.len(),
    };
    // Two lines more than rows: the rule and the heads.
    let height = |rows: usize| u16::try_from(rows).unwrap_or(u16::MAX);
    let [title, above, below, notes] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(height(stages.rows.len() + 2)),
        Constraint::Length(height((topics.rows.len() + 2).max(facts + 1))),
        Constraint::Min(0),
    ])
    .areas(frame.area());
    draw_title(frame, title, snapshot);
    draw_table(frame, above, "stages", &stages, gap);
    let [left, right] =
        Layout::horizontal([Constraint::Length(width), Constraint::Min(0)]).areas(below);
    draw_table(frame, left, "topics", &topics, gap);
    if wide {
        let columns = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]);
        let [middle, right] = columns.areas(right);
        draw_facts(frame, middle, "robot", &robot);
        draw_facts(frame, right, "map", &map);
    } else {
        draw_facts(frame, right, "robot and map", &[robot, map].concat());
    }
    if !snapshot.notes.is_empty() {
        let text = snapshot.notes.iter();
        let text: Vec<Line> = text.map(|note| Line::raw(format!(" {note}"))).collect();
        let paragraph = Paragraph::new(text).wrap(Wrap { trim: false });
        frame.render_widget(paragraph.block(rule("notes")), notes);
    }
    if help {
        draw_help(frame);
    }
}

fn draw_title(frame: &mut Frame, area: Rect, snapshot: &Snapshot) {
    let title = Line::from(vec![
        Span::styled(" randt top", BOLD),
        Span::raw(format!("  {} in {}", snapshot.prefix, snapshot.run)),
    ]);
    frame.render_widget(title, area);
    let keys = Line::raw(" q quit  ? help ").alignment(Alignment::Right);
    let [_, right] = Layout::horizontal([Constraint::Min(0), Constraint::Length(16)]).areas(area);
    frame.render_widget(keys, right);
}

fn draw_table(frame: &mut Frame, area: Rect, title: &'static str, table: &Table, gap: usize) {
    let widths = table.widths();
    let line = |cells: &mut dyn Iterator<Item = &str>, style: fn(&str) -> Style| {
        let mut spans = vec![Span::raw(" ")];
        for (i, (cell, width)) in cells.zip(&widths).enumerate() {
            spans.push(Span::styled(table.filled(i, cell, *width), style(cell)));
            spans.push(Span::raw(" ".repeat(gap)));
        }
        Line::from(spans)
    };
    let mut lines = vec![line(&mut table.heads.iter().copied(), |_| BOLD)];
    for row in &table.rows {
        lines.push(line(&mut row.iter().map(String::as_str), color));
    }
    frame.render_widget(Paragraph::new(lines).block(rule(title)), area);
}

fn draw_facts(frame: &mut Frame, area: Rect, title: &'static str, facts: &[Fact]) {
    let line = |(name, value): &Fact| {
        let (name, value) = (
            format!("{name:<9} "),
            Span::styled(value.clone(), color(value)),
        );
        Line::from(vec![Span::raw(name), value])
    };
    let lines: Vec<Line> = facts.iter().map(line).collect();
    frame.render_widget(Paragraph::new(lines).block(rule(title)), area);
}

fn draw_help(frame: &mut Frame) {
    let area = frame.area();
    let width = 60.min(area.width);
    let height = (HELP.lines().count() as u16 + 2).min(area.height);
    let middle = Rect {
        x: (area.width - width) / 2,
        y: (area.height - height) / 2,
        width,
        height,
    };
    frame.render_widget(Clear, middle);
    let block = Block::bordered().title(" help ");
    frame.render_widget(Paragraph::new(HELP).block(block), middle);
}

/// A line with a title over what follows.
fn rule(title: &'static str) -> Block<'static> {
    Block::new()
        .borders(Borders::TOP)
        .title(format!(" {title} "))
}

/// Colour of the name of a state.
fn color(state: &str) -> Style {
    match state.split(',').next().unwrap_or_default() {
        "running" | "good" => Style::new().fg(Color::Green),
        "degraded" | "starting" | "stopping" | "stopped" => Style::new().fg(Color::Yellow),
        "dead" | "lost" => Style::new().fg(Color::Red).add_modifier(Modifier::BOLD),
        _ => Style::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::snapshot::sample;
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    #[test]
    fn nothing_is_cut_on_a_terminal_of_80_columns_or_more() {
        let snapshot = sample();
        let facts = [facts::robot(&snapshot), facts::map(&snapshot)].concat();
        for width in 80..=150 {
            let mut terminal = Terminal::new(TestBackend::new(width, 30)).unwrap();
            terminal
                .draw(|frame| draw(frame, &snapshot, false))
                .unwrap();
            let cells = terminal.backend().buffer().content().iter();
            let text: Vec<&str> = cells.map(|cell| cell.symbol()).collect();
            let rows: Vec<String> = text.chunks(width.into()).map(<[&str]>::concat).collect();
            for (name, value) in &facts {
                let shown = format!("{name:<9} {value}");
                assert!(
                    rows.iter().any(|row| row.contains(&shown)),
                    "{width}: {shown}"
                );
            }
            for topic in &snapshot.topics {
                let is_whole = |row: &String| {
                    let lost = topic.lost.to_string();
                    let rest = row.split_once(topic.name.as_str());
                    rest.is_some_and(|(_, rest)| rest.split(' ').any(|word| word == lost))
                };
                assert!(rows.iter().any(is_whole), "{width}: {}", topic.name);
            }
        }
    }
}
