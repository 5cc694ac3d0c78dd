//! Worlds as text: one statement a line (docs/worlds.md).

use crate::line::{COORDINATE_MAX_M, Line};
use crate::shape::{self, Opening, Span};
use crate::{Relief, World, WorldError};
use nalgebra::Vector2;

/// Walls of a small town; every metre is sorted into the ray caster's grid.
const LENGTH_MAX_M: f64 = 20_000.0;
/// Five pieces a metre of the above: what rough walls need.
const WALLS_MAX: usize = 100_000;
/// 17 degrees: what a wheeled robot climbs.
const GRADE_MAX: f64 = 0.3;
const STATEMENTS: &str =
    "one of wall, rough, block, post, route, speed, slope, hill, ramp, or # and a comment";

impl World {
    /// Reads a world's text.
    ///
    /// ```
    /// use randt_simulator::World;
    /// let text = "wall concrete 0,0 9,0 9,6 0,6 0,0 windows 2..4\nroute 2,2 7,2 7,4 2,4";
    /// assert_eq!(World::parse("hall", text).unwrap().walls.len(), 6);
    /// let error = World::parse("hall", "wall marble 0,0 1,0").unwrap_err();
    /// let materials = "concrete, plaster, wood, glass, metal";
    /// assert_eq!(error.to_string(), format!("line 1: \"marble\": expected one of {materials}"));
    /// ```
    pub fn parse(name: &str, text: &str) -> Result<Self, WorldError> {
        let mut world = Self {
            name: name.to_owned(),
            ..Self::default()
        };
        let mut wall_length_m = 0.0;
        for (index, text) in text.lines().enumerate() {
            let text = text.split('#').next().unwrap_or_default();
            let mut words = text.split_whitespace();
            let Some(statement) = words.next() else {
                continue;
            };
            let mut line = Line {
                number: index + 1,
                statement,
                words,
            };
            let before = world.walls.len();
            line.read(&mut world)?;
            let added = world.walls.iter().skip(before);
            let lengths_m = added.map(|wall| (wall.to_m - wall.from_m).norm());
            wall_length_m += lengths_m.sum::<f64>();
            line.check_size(wall_length_m, &world)?;
        }
        let corners = world.route_m.len();
        if corners < 3 {
            return Err(WorldError::Route { corners });
        }
        Ok(world)
    }
}

impl<'a> Line<'a> {
    fn read(&mut self, world: &mut World) -> Result<(), WorldError> {
        match self.statement {
            "wall" => {
                let material = self.material()?;
                let (points, next) = self.line()?;
                let spans = self.spans(next, shape::length_m(&points))?;
                shape::wall(&points, material, &spans, &mut world.walls);
            }
            "rough" => {
                let material = self.material()?;
                let amplitude_m = self.number("an amplitude in m", 0.01, 1.0)?;
                self.keyword("seed")?;
                let word = self.word("a seed")?;
                let seed = word.parse();
                let seed = seed.map_err(|_| self.wrong(word, "a seed: a whole number"))?;
                let (points, next) = self.line()?;
                self.end(next)?;
                // Rough walls have many pieces: refused before they are made.
                self.check_size(shape::length_m(&points), world)?;
                let points = shape::roughened(&points, amplitude_m, seed);
                shape::wall(&points, material, &[], &mut world.walls);
            }
            "block" => {
                let material = self.material()?;
                let corner_m = self.point()?;
                let size_m = self.size()?;
                let turn_deg = match self.words.next() {
                    None => 0.0,
                    Some("turn") => self.number("an angle in degrees", -360.0, 360.0)?,
                    Some(word) => return Err(self.wrong(word, "turn, or the line's end")),
                };
                self.end(None)?;
                let turn_rad = turn_deg.to_radians();
                shape::block(corner_m, size_m, turn_rad, material, &mut world.walls);
            }
            "post" => {
                let material = self.material()?;
                let centre_m = self.point()?;
                let radius_m = self.number("a radius in m", 0.01, 20.0)?;
                self.end(None)?;
                shape::post(centre_m, radius_m, material, &mut world.walls);
            }
            "route" => {
                let before = world.route_m.len();
                while let Some(word) = self.words.next() {
                    let corner = self.as_point(word)?;
                    if world.route_m.last() == Some(&corner) {
                        return Err(self.wrong(word, "a corner apart from the one before"));
                    }
                    world.route_m.push(corner);
                }
                if world.route_m.len() == before {
                    return Err(self.short("corners X,Y in m"));
                }
            }
            "speed" => {
                // An iSDR-C's robot, not a car: a sweep takes 0.2 s.
                world.speed_max_m_s = self.number("a speed in m/s", 0.2, 3.0)?;
                self.end(None)?;
            }
            "slope" | "hill" | "ramp" => {
                let relief = self.relief()?;
                let grade = relief.grade_max();
                if grade > GRADE_MAX {
                    let expected = format!(
                        "a grade of at most {GRADE_MAX} (rise per m), this one has {grade:.2}"
                    );
                    return Err(self.wrong(self.statement, &expected));
                }
                world.ground.reliefs.push(relief);
            }
            word => return Err(self.wrong(word, STATEMENTS)),
        }
        Ok(())
    }

    fn relief(&mut self) -> Result<Relief, WorldError> {
        let relief = match self.statement {
            "slope" => Relief::Slope {
                grade: self.point()?,
            },
            "hill" => Relief::Hill {
                centre_m: self.point()?,
                radius_m: self.number("a radius in m", 1.0, COORDINATE_MAX_M)?,
                height_m: self.number("a height in m", -50.0, 50.0)?,
            },
            _ => {
                let from_m = self.point()?;
                let word = self.word("the ramp's head X,Y in m")?;
                let to_m = self.as_point(word)?;
                if (to_m - from_m).norm() < 1.0 {
                    return Err(self.wrong(word, "a head at least 1 m from the foot"));
                }
                Relief::Ramp {
                    from_m,
                    to_m,
                    height_m: self.number("a height in m", -50.0, 50.0)?,
                }
            }
        };
        self.end(None)?;
        Ok(relief)
    }

    /// Two points or more, each apart from the one before; and the word behind them.
    fn line(&mut self) -> Result<(Vec<Vector2<f64>>, Option<&'a str>), WorldError> {
        let mut points = vec![self.point()?];
        loop {
            match self.words.next() {
                Some(word) if points.len() < 2 || word.contains(',') => {
                    let point = self.as_point(word)?;
                    if points.last() == Some(&point) {
                        return Err(self.wrong(word, "a point apart from the one before"));
                    }
                    points.push(point);
                }
                None if points.len() < 2 => return Err(self.short("a second point X,Y in m")),
                next => return Ok((points, next)),
            }
        }
    }

    /// Openings of a wall: `doors 1..2 5..6 windows 8..9`, in order of distance.
    fn spans(&mut self, mut next: Option<&'a str>, length_m: f64) -> Result<Vec<Span>, WorldError> {
        let mut spans: Vec<Span> = Vec::new();
        let mut opening = None;
        while let Some(word) = next {
            match (word, word.split_once(".."), opening) {
                ("doors", ..) => opening = Some(Opening::Door),
                ("windows", ..) => opening = Some(Opening::Window),
                ("gaps", ..) => opening = Some(Opening::Gap),
                (_, Some((from, to)), Some(opening)) => {
                    let (Ok(from_m), Ok(to_m)) = (from.parse::<f64>(), to.parse::<f64>()) else {
                        return Err(self.wrong(word, "an opening FROM..TO in m"));
                    };
                    if !(0.0 <= from_m && from_m < to_m && to_m <= length_m) {
                        let expected = format!("an opening FROM..TO within 0..{length_m:.2} m");
                        return Err(self.wrong(word, &expected));
                    }
                    let meets = |span: &Span| from_m < span.to_m && span.from_m < to_m;
                    if spans.iter().any(meets) {
                        return Err(self.wrong(word, "an opening apart from the others"));
                    }
                    spans.push(Span {
                        opening,
                        from_m,
                        to_m,
                    });
                }
                (_, _, None) => {
                    return Err(self.wrong(word, "a point X,Y, or doors, windows or gaps"));
                }
                _ => return Err(self.wrong(word, "an opening FROM..TO in m")),
            }
            next = self.words.next();
        }
        spans.sort_by(|a, b| a.from_m.total_cmp(&b.from_m));
        Ok(spans)
    }

    /// Refuses walls of a length, and those of a world, that are more than a simulation is for.
    fn check_size(&self, length_m: f64, world: &World) -> Result<(), WorldError> {
        if length_m <= LENGTH_MAX_M && world.walls.len() <= WALLS_MAX {
            return Ok(());
        }
        Err(WorldError::Large {
            line: self.number,
            length_m,
            walls: world.walls.len(),
            length_max_m: LENGTH_MAX_M,
            walls_max: WALLS_MAX,
        })
    }
}
