//! The configuration in force as a documented TOML text that can be read back.

use crate::{Config, Loaded, Location, Rule};

/// If this section is not set the input's own values hold, so writing its zeros would change the
/// result.
const FROM_INPUT: &str = "robot";

impl Loaded {
    /// Valid TOML of every key, with its documentation and where its value comes from.
    pub fn to_toml(&self) -> String {
        let mut text = String::new();
        for section in Config::SECTIONS {
            if !text.is_empty() {
                text.push('\n');
            }
            comment(&mut text, section.about);
            text.push_str(&format!("[{}]\n", section.name));
            let from_input = section.name == FROM_INPUT && !self.is_set(section.name);
            for key in section.keys {
                comment(&mut text, key.doc);
                if key.rule != Rule::NoNumber {
                    text.push_str(&format!("# Range: {}.\n", key.rule));
                }
                let value = self.config.get(section.name, key.name).unwrap_or_default();
                let origin = self.origins.get(&(section.name, key.name));
                let name = key.name;
                text += &match origin {
                    _ if from_input => format!("# {name} = {value}  # from the input, or this\n"),
                    None => format!("{name} = {value}  # default\n"),
                    Some(location) => format!("{name} = {value}  # {}\n", one_line(location)),
                };
            }
        }
        text
    }
}

fn comment(text: &mut String, lines: &[&str]) {
    for line in lines {
        text.push_str(&format!("# {}\n", line.trim()));
    }
}

/// A path may hold any character; a comment must not.
fn one_line(location: &Location) -> String {
    let mut line = String::new();
    for character in location.to_string().chars() {
        if character.is_control() {
            line.extend(character.escape_default());
        } else {
            line.push(character);
        }
    }
    line
}
