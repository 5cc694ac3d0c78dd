//! Where a data set has its images, their stamps and its IMU, and how large its range bins are.

use std::path::{Path, PathBuf};

/// A data set by the form of its folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DataSet {
    /// `radar/STAMP_US.png`, `radar.timestamps`; or the images alone.
    Oxford,
    /// `radar/STAMP_US.png`, `applanix/imu_raw.csv`.
    Boreas,
    /// `sensor_data/radar/polar/STAMP_NS.png` or `polar/STAMP_NS.png`, `xsens_imu.csv`.
    MulRan,
    /// `Navtech_Polar/NUMBER.png` with `Navtech_Polar.txt`, `GPS_IMU_Twist/NUMBER.txt`.
    Radiate,
}

/// Bins of the radars whose images do not say what they are: a Navtech CTS350-X of the Oxford data
/// set.
const OXFORD_BINS: usize = 3768;
/// "4.38 cm in range resolution" in the data set's documentation. Its software kit computes with
/// 0.0432; ARCHITECTURE.md has the reason why we do not.
const OXFORD_BIN_M: f64 = 0.0438;
/// MulRan's CIR204-H: 200 m in 3360 bins.
const MULRAN_BIN_M: f64 = 200.0 / 3360.0;
/// RADIATE's CTS350-X: 100 m in 576 bins.
const RADIATE_BIN_M: f64 = 100.0 / 576.0;
/// Boreas' CIR304-H, and the same radar after its upgrade, us since 1970 (the data set's own kit).
const BOREAS_BIN_M: [f64; 2] = [0.0596, 0.04381];
const BOREAS_UPGRADE_NS: i64 = 1_632_182_400_000_000_000;

/// A folder that was recognised.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub data_set: DataSet,
    /// Folder of the images.
    pub images: PathBuf,
    /// File with the IMU's samples, or folder of them.
    pub imu: Option<PathBuf>,
    /// Folder of the data set.
    pub base: PathBuf,
}

impl Layout {
    /// By the names of what is in the folder, or beside it where it is the images' own.
    pub fn find(path: &Path) -> Self {
        let known: [(DataSet, &[&str]); 3] = [
            (DataSet::Radiate, &["Navtech_Polar"]),
            (
                DataSet::MulRan,
                &["sensor_data/radar/polar", "radar/polar", "polar"],
            ),
            (DataSet::Oxford, &["radar"]),
        ];
        let mut folders = known.into_iter().flat_map(|(data_set, names)| {
            let names = names.iter().map(move |name| (data_set, path.join(name)));
            names.filter(|(_, folder)| folder.is_dir())
        });
        let (mut data_set, images, base) = match folders.next() {
            Some((data_set, images)) => (data_set, images, path.to_owned()),
            None => {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let data_set = match &*name {
                    "Navtech_Polar" => DataSet::Radiate,
                    "polar" => DataSet::MulRan,
                    _ => DataSet::Oxford,
                };
                let base = path.parent().unwrap_or(path).to_owned();
                (data_set, path.to_owned(), base)
            }
        };
        if data_set == DataSet::Oxford && base.join("applanix").is_dir() {
            data_set = DataSet::Boreas;
        }
        let mut folders = base
            .ancestors()
            .take(if data_set == DataSet::MulRan { 3 } else { 1 });
        let files: &[&str] = match data_set {
            DataSet::Oxford => &[],
            DataSet::Boreas => &[
                "applanix/imu_raw.csv",
                "applanix/imu.csv",
                "imu/dmu_imu.csv",
                "applanix/dmu_imu.csv",
            ],
            DataSet::MulRan => &["sensor_data/xsens_imu.csv", "xsens_imu.csv"],
            DataSet::Radiate => &["GPS_IMU_Twist"],
        };
        let imu = folders.find_map(|folder| {
            let mut files = files.iter().map(|name| folder.join(name));
            files.find(|file| file.exists())
        });
        Self {
            data_set,
            images,
            imu,
            base,
        }
    }

    /// Name of the format.
    pub fn format(&self) -> &'static str {
        match self.data_set {
            DataSet::Oxford => "oxford",
            DataSet::Boreas => "boreas",
            DataSet::MulRan => "mulran",
            DataSet::Radiate => "radiate",
        }
    }

    /// Width of a range bin, m, where the data set or the number of bins tells it.
    pub fn bin_m(&self, bins: usize, stamp_ns: i64) -> Option<f64> {
        let [before, after] = BOREAS_BIN_M;
        match (self.data_set, bins) {
            (DataSet::Oxford, OXFORD_BINS) => Some(OXFORD_BIN_M),
            (DataSet::Boreas, 3360) if stamp_ns < BOREAS_UPGRADE_NS => Some(before),
            (DataSet::Boreas, _) if stamp_ns >= BOREAS_UPGRADE_NS => Some(after),
            (DataSet::MulRan, 3360) => Some(MULRAN_BIN_M),
            (DataSet::Radiate, 576) => Some(RADIATE_BIN_M),
            _ => None,
        }
    }
}

/// A stamp in ns from a name or a cell: seconds with a point, or whole us or ns since 1970.
pub(super) fn stamp_ns(text: &str) -> Option<i64> {
    let text = text.trim();
    if text.contains(['e', 'E']) {
        // numpy.savetxt writes stamps so; a double is all that is behind it.
        let stamp_ns = text.parse::<f64>().ok()? * 1e9;
        return (stamp_ns.abs() < 9.2e18).then_some(stamp_ns.round() as i64);
    }
    if let Some((whole, fraction)) = text.split_once('.') {
        let whole: i64 = whole.parse().ok()?;
        let digits = fraction.bytes().chain(std::iter::repeat(b'0')).take(9);
        let mut nanos = digits.map(|digit| digit.is_ascii_digit().then(|| i64::from(digit - b'0')));
        let nanos = nanos.try_fold(0, |sum, digit| Some(sum * 10 + digit?))?;
        return whole.checked_mul(1_000_000_000)?.checked_add(nanos);
    }
    let value: i64 = text.parse().ok()?;
    // In us until the year 5138; a small one is a running number.
    match value {
        value if value > 100_000_000_000_000_000 => Some(value),
        value if value > 100_000_000_000 => value.checked_mul(1000),
        value if value > 100_000_000 => value.checked_mul(1_000_000_000),
        _ => None,
    }
}
