//! Planar pose graphs in g2o's text format: `VERTEX_SE2 id x y yaw` and
//! `EDGE_SE2 from to x y yaw I11 I12 I13 I22 I23 I33`.
//!
//! Responsible for the content of the lines. Not responsible for whether it makes a graph that can
//! be solved.

use crate::Error;
use randt_geometry::Pose2;
use std::io::BufRead;
use std::path::Path;
use std::str::FromStr;

/// Farther than a robot drives, m (a tenth of the earth's girth).
const COORDINATE_MAX_M: f64 = 4e6;
/// Better than any sensor knows (a nanometre); beyond it squares lose their digits.
const INFORMATION_MAX: f64 = 1e18;
/// A line has 12 words; more than this many bytes is no text file.
const LINE_BYTES_MAX: usize = 4096;

/// A pose graph as it stands in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Graph {
    /// Poses with their ids, in the order of the file. An id is a name, not an index: GTSAM's
    /// carry a letter in their upper byte.
    pub vertices: Vec<(u64, Pose2)>,
    /// Measurements in the order of the file.
    pub edges: Vec<Edge>,
}

/// A measurement between two vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// The vertex of the edge's origin.
    pub from: u64,
    /// The vertex of the edge's end.
    pub to: u64,
    /// `to` seen from `from`.
    pub measured: Pose2,
    /// Inverse covariance of (x, y, yaw), row by row; symmetric.
    pub information: [[f64; 3]; 3],
}

/// Reads a file.
pub fn read(path: &Path) -> Result<Graph, Error> {
    let file = std::fs::File::open(path).map_err(Error::io(path))?;
    read_from(std::io::BufReader::new(file), path)
}

/// Reads lines; `path` is for the error's text.
pub fn read_from(mut reader: impl BufRead, path: &Path) -> Result<Graph, Error> {
    let mut graph = Graph::default();
    let mut bytes = Vec::new();
    for line in 1.. {
        bytes.clear();
        let limited = &mut std::io::Read::take(&mut reader, LINE_BYTES_MAX as u64);
        let read = limited.read_until(b'\n', &mut bytes);
        if read.map_err(Error::io(path))? == 0 {
            break;
        }
        let parsed = if bytes.len() == LINE_BYTES_MAX {
            Err(format!(
                "over {LINE_BYTES_MAX} bytes long; a line has at most 12 words"
            ))
        } else {
            parse(&String::from_utf8_lossy(&bytes), &mut graph)
        };
        parsed.map_err(|what| Error::Line {
            path: path.display().to_string(),
            line,
            what,
        })?;
    }
    Ok(graph)
}

/// Takes in one line; empty lines and comments are skipped.
fn parse(line: &str, graph: &mut Graph) -> Result<(), String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words.as_slice() {
        [] => {}
        [first, ..] if first.starts_with('#') => {}
        // An anchor of the file's own: which node stands still changes no error.
        ["FIX", ..] => {}
        ["VERTEX_SE2", id, x, y, yaw] => {
            graph.vertices.push((self::id(id)?, pose([x, y, yaw])?));
        }
        ["EDGE_SE2", from, to, x, y, yaw, information @ ..] if information.len() == 6 => {
            graph.edges.push(Edge {
                from: id(from)?,
                to: id(to)?,
                measured: pose([x, y, yaw])?,
                information: symmetric(information)?,
            });
        }
        [tag @ ("VERTEX_SE2" | "EDGE_SE2"), rest @ ..] => {
            let right = if *tag == "VERTEX_SE2" {
                "4: id x y yaw"
            } else {
                "11: from to x y yaw I11 I12 I13 I22 I23 I33"
            };
            return Err(format!("{tag} with {} words, expected {right}", rest.len()));
        }
        [tag, ..] => {
            let tag: String = tag.chars().take(40).collect();
            return Err(format!(
                "{tag:?}, expected VERTEX_SE2 or EDGE_SE2 (a planar graph)"
            ));
        }
    }
    Ok(())
}

fn id(word: &str) -> Result<u64, String> {
    u64::from_str(word)
        .map_err(|_| format!("id {word:?}, expected a whole number up to {}", u64::MAX))
}

fn pose(words: [&str; 3]) -> Result<Pose2, String> {
    let [x_m, y_m, yaw_rad] = words.map(|word| number(word, COORDINATE_MAX_M));
    Ok(Pose2::new(x_m?, y_m?, yaw_rad?))
}

fn symmetric(words: &[&str]) -> Result<[[f64; 3]; 3], String> {
    let mut i = [0.0; 6];
    for (value, word) in i.iter_mut().zip(words) {
        *value = number(word, INFORMATION_MAX)?;
    }
    Ok([[i[0], i[1], i[2]], [i[1], i[3], i[4]], [i[2], i[4], i[5]]])
}

fn number(word: &str, below: f64) -> Result<f64, String> {
    f64::from_str(word)
        .ok()
        .filter(|value| value.abs() < below)
        .ok_or_else(|| format!("{word:?}, expected a number below {below:e}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(text: &str) -> Result<Graph, String> {
        read_from(text.as_bytes(), Path::new("a.g2o")).map_err(|error| error.to_string())
    }

    #[test]
    fn vertices_and_edges_are_read() {
        let graph =
            text("# a graph\nVERTEX_SE2 7 1 -2 0.5\r\n\nFIX 7\nEDGE_SE2 7 8 1e0 2 -3 1 2 3 4 5 6")
                .unwrap();
        assert_eq!(graph.vertices, [(7, Pose2::new(1.0, -2.0, 0.5))]);
        assert_eq!(graph.edges[0].to, 8);
        assert_eq!(graph.edges[0].measured, Pose2::new(1.0, 2.0, -3.0));
        assert_eq!(
            graph.edges[0].information,
            [[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]
        );
        assert_eq!(text("").unwrap(), Graph::default());
        // x0 of GTSAM, and the last id there is.
        let last = text("VERTEX_SE2 18446744073709551615 0 0 0").unwrap();
        assert_eq!(last.vertices[0].0, u64::MAX);
        let symbol = text("VERTEX_SE2 8646911284551352320 0 0 0").unwrap();
        assert_eq!(symbol.vertices[0].0, u64::from(b'x') << 56);
    }

    #[test]
    fn errors_name_their_line() {
        for (line, expected) in [
            ("VERTEX_SE2 1 2 3", "with 3 words, expected 4: id x y yaw"),
            ("EDGE_SE2 0 1 0 0 0 1 0 0 1 0", "with 10 words, expected 11"),
            (
                "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1",
                "expected VERTEX_SE2 or EDGE_SE2",
            ),
            ("VERTEX_SE2 -1 0 0 0", "id \"-1\", expected a whole number"),
            (
                "VERTEX_SE2 18446744073709551616 0 0 0",
                "up to 18446744073709551615",
            ),
            (
                "VERTEX_SE2 1 NaN 0 0",
                "\"NaN\", expected a number below 4e6",
            ),
            ("VERTEX_SE2 1 0 0 inf", "\"inf\""),
            ("EDGE_SE2 0 1 0 0 1e300 1 0 0 1 0 1", "\"1e300\""),
            ("EDGE_SE2 0 1 0 0 0 1 0 0 x 0 1", "\"x\""),
        ] {
            let error = text(&format!("VERTEX_SE2 0 0 0 0\n{line}\n")).unwrap_err();
            assert!(
                error.starts_with("a.g2o: line 2: ") && error.contains(expected),
                "{error}"
            );
        }
        let error = text(&"9".repeat(10_000)).unwrap_err();
        assert!(error.contains("line 1: over 4096 bytes"), "{error}");
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = read_from(bytes.as_slice(), Path::new("a.g2o"));
        }

        #[test]
        fn no_words_make_it_panic(words in "(VERTEX_SE2|EDGE_SE2)( (-?[0-9]{1,25}(e[0-9]{1,4})?|nan|inf)){0,12}") {
            let _ = text(&words);
        }
    }
}
