//! The width of a range bin: what goes with it, and where it comes from.

use crate::builtin::SENSORS;
use crate::{Error, Loaded, Location};

const RESOLUTION: (&str, &str) = ("sensor", "range_resolution_m");
const CONNECTIVITY: (&str, &str) = ("sensor", "connectivity_m");

impl Loaded {
    /// Applies something that may change the width of a range bin. The step in range within a
    /// cluster is a number of bins: it changes with their width unless it is set too.
    pub(crate) fn with_connectivity<R>(&mut self, apply: impl FnOnce(&mut Self) -> R) -> R {
        let (bin_m, set) = (
            self.config.sensor.range_resolution_m,
            self.origins.get(&CONNECTIVITY).cloned(),
        );
        let result = apply(self);
        let sensor = &mut self.config.sensor;
        if sensor.range_resolution_m != bin_m && self.origins.get(&CONNECTIVITY) == set.as_ref() {
            sensor.connectivity_m *= sensor.range_resolution_m / bin_m;
            let location = Location::whole("scaled with sensor.range_resolution_m");
            self.origins.insert(CONNECTIVITY, location);
        }
        result
    }

    /// Takes the width of a range bin from an input of polar images, unless it was set; gives what
    /// is in force, m.
    pub fn take_bin_size(&mut self, bins: usize, size_m: Option<f64>) -> Result<f64, Error> {
        let is_builtin = |location: &Location| SENSORS.iter().any(|s| s.source == location.source);
        let set = self.origins.get(&RESOLUTION);
        let found_m = match (set, size_m) {
            (Some(location), _) if !is_builtin(location) => self.config.sensor.range_resolution_m,
            (_, Some(size_m)) => size_m,
            (_, None) => return Err(Error::BinSizeUnknown { bins }),
        };
        if found_m != self.config.sensor.range_resolution_m {
            self.with_connectivity(|loaded| {
                loaded.config.sensor.range_resolution_m = found_m;
                loaded
                    .origins
                    .insert(RESOLUTION, Location::whole("the input"));
            });
        }
        Ok(found_m)
    }

    /// Leaves intensities out of the cells, where an input has none.
    pub fn without_intensity(&mut self) {
        self.config.ndt.intensity = false;
        let location = Location::whole("the input");
        self.origins.insert(("ndt", "intensity"), location);
    }
}

#[cfg(test)]
mod tests {
    use crate::{Config, Error, Loaded, Selection};

    fn load(set: &[&str]) -> Result<Loaded, Error> {
        Config::load(&Selection {
            sensor: Some("navtech-cts".to_owned()),
            set: set.iter().map(|text| (*text).to_owned()).collect(),
            ..Selection::default()
        })
    }

    #[test]
    fn a_cluster_reaches_as_many_bins_whatever_their_width() {
        let loaded = load(&["sensor.range_resolution_m=0.1736"]).unwrap();
        let sensor = &loaded.config.sensor;
        let bins = sensor.connectivity_m / sensor.range_resolution_m;
        assert!((bins - 0.12 / 0.0438).abs() < 1e-9, "{bins}");
        let both = [
            "sensor.range_resolution_m=0.1736",
            "sensor.connectivity_m=0.4",
        ];
        assert_eq!(load(&both).unwrap().config.sensor.connectivity_m, 0.4);
        let less = [
            "sensor.range_resolution_m=0.1736",
            "sensor.connectivity_m=0.12",
        ];
        let refused = load(&less).unwrap_err().to_string();
        assert!(
            refused.contains("must be below sensor.connectivity_m"),
            "{refused}"
        );
    }

    #[test]
    fn the_users_width_goes_over_the_inputs_and_one_of_them_must_be_there() {
        let mut loaded = load(&[]).unwrap();
        assert_eq!(loaded.take_bin_size(3768, Some(0.0438)).unwrap(), 0.0438);
        assert_eq!(loaded, load(&[]).unwrap());
        let refused = loaded.take_bin_size(3360, None).unwrap_err().to_string();
        assert!(refused.contains("3360 bins are not"), "{refused}");
        assert_eq!(loaded.take_bin_size(576, Some(0.1736)).unwrap(), 0.1736);
        assert!(loaded.config.sensor.connectivity_m > 0.4);
        let mut loaded = load(&["sensor.range_resolution_m=0.0596"]).unwrap();
        assert_eq!(loaded.take_bin_size(3768, Some(0.0438)).unwrap(), 0.0596);
    }
}
