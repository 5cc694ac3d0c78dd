//! The documents: their pages, and the blocks of code in them.

use super::names;
use std::fs;
use std::path::Path;

/// A block of code.
pub struct Block {
    /// What stands behind the opening quotes; `sh` where a test runs it as it stands.
    pub language: String,
    pub text: String,
}

/// Pages for people, by name. Decisions are not among them: they say what was.
pub fn all(root: &Path) -> Vec<(String, String)> {
    let folders = ["", "docs", "tests/fuzz", "core/log/tests/fixtures"];
    let pages = folders.iter().flat_map(|folder| {
        let names = names(&root.join(folder)).into_iter();
        let names = names.filter(|name| name.ends_with(".md"));
        names.map(|name| Path::new(folder).join(name).display().to_string())
    });
    let read = |name: String| {
        let text = fs::read_to_string(root.join(&name)).unwrap();
        (name, text)
    };
    pages.map(read).collect()
}

/// The blocks of a page.
pub fn blocks(text: &str) -> Vec<Block> {
    let parts = format!("\n{text}");
    let parts = parts.split("\n```").skip(1).step_by(2);
    parts
        .map(|part| {
            let (language, text) = part.split_once('\n').unwrap_or((part, ""));
            Block {
                language: language.to_owned(),
                text: text.to_owned(),
            }
        })
        .collect()
}
