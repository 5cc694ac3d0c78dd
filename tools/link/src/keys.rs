//! Keys of an operator's own: one authority signs one key for the base and one for each robot.

use anyhow::{Context, Result, bail};
use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose, date_time_ymd,
};
use std::fs::{self, File};
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

/// The name in the base's key.
pub const BASE: &str = "base";
/// Files in the folder of one end.
pub const AUTHORITY: &str = "authority.pem";
pub const OWN: &str = "own.pem";
pub const OWN_KEY: &str = "own.key";
/// The authority's key, which stays with the operator.
const AUTHORITY_KEY: &str = "authority.key";
/// The authority holds as long as a robot does.
const AUTHORITY_DAYS: i64 = 20 * 365;

/// Makes the keys of one end: `folder/NAME`, to be copied to that machine. The authority is made
/// with the first one.
pub fn make(folder: &Path, name: &str, days: i64) -> Result<()> {
    check_name(name)?;
    let own = folder.join(name);
    if own.exists() {
        bail!("{} is there already", own.display());
    }
    let authority = folder.join(AUTHORITY);
    if !authority.exists() {
        make_authority(folder)?;
    }
    let authority_pem = read(&authority)?;
    let authority_key = KeyPair::from_pem(&read(&folder.join(AUTHORITY_KEY))?)?;
    let issuer = Issuer::from_ca_cert_pem(&authority_pem, authority_key)?;
    let mut params = params(name, days)?;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = vec![
        ExtendedKeyUsagePurpose::ClientAuth,
        ExtendedKeyUsagePurpose::ServerAuth,
    ];
    let key = KeyPair::generate()?;
    let certificate = params.signed_by(&key, &issuer)?;
    make_folder(&own)?;
    write(&own.join(AUTHORITY), &authority_pem)?;
    write(&own.join(OWN), &certificate.pem())?;
    write(&own.join(OWN_KEY), &key.serialize_pem())
}

/// Refuses what is no name: it is part of a path, of a key in Zenoh and of a certificate.
pub fn check_name(name: &str) -> Result<()> {
    let is_part = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
    if name.is_empty() || name.len() > 32 || !name.bytes().all(is_part) {
        bail!("{name:?} is no name: up to 32 letters, digits, - and _");
    }
    Ok(())
}

fn make_authority(folder: &Path) -> Result<()> {
    make_folder(folder)?;
    let mut params = params("randt link", AUTHORITY_DAYS)?;
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign];
    let key = KeyPair::generate()?;
    let certificate = params.self_signed(&key)?;
    write(&folder.join(AUTHORITY_KEY), &key.serialize_pem())?;
    write(&folder.join(AUTHORITY), &certificate.pem())
}

fn params(name: &str, days: i64) -> Result<CertificateParams> {
    let mut params = CertificateParams::new(vec![name.replace(' ', "-")])?;
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name);
    let now = SystemTime::now().duration_since(UNIX_EPOCH)?.as_secs() / 86_400;
    // From yesterday on: clocks of robots are off.
    let (year, month, day) = date(now as i64 - 1);
    params.not_before = date_time_ymd(year, month, day);
    let (year, month, day) = date(now as i64 + days);
    params.not_after = date_time_ymd(year, month, day);
    Ok(params)
}

/// The date of a day since 1970 (Howard Hinnant's civil_from_days).
fn date(days: i64) -> (i32, u8, u8) {
    let days = days + 719_468;
    let era = days.div_euclid(146_097);
    let of_era = days.rem_euclid(146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * march + 2) / 5 + 1;
    let month = if march < 10 { march + 3 } else { march - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    (year as i32, month as u8, day as u8)
}

fn make_folder(path: &Path) -> Result<()> {
    let mut builder = fs::DirBuilder::new();
    let made = builder.recursive(true).mode(0o700).create(path);
    made.with_context(|| format!("{}", path.display()))
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("{}", path.display()))
}

fn write(path: &Path, text: &str) -> Result<()> {
    let mut options = File::options();
    options.write(true).create_new(true).mode(0o600);
    let written = options
        .open(path)
        .and_then(|mut file| file.write_all(text.as_bytes()));
    written.with_context(|| format!("{}", path.display()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;

    #[test]
    fn dates_are_right_and_names_are_checked() {
        assert_eq!(date(0), (1970, 1, 1));
        assert_eq!(date(11_016), (2000, 2, 29));
        assert_eq!(date(20_787), (2026, 11, 30));
        for name in ["", "a/b", "..", "a b", "ä", &"x".repeat(33)] {
            assert!(check_name(name).is_err(), "{name}");
        }
        assert!(check_name("spot-2_b").is_ok());
    }

    #[test]
    fn one_authority_signs_every_key_and_nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let keys = folder.path().join("keys");
        make(&keys, BASE, 10).unwrap();
        let authority = fs::read(keys.join(AUTHORITY)).unwrap();
        make(&keys, "spot", 10).unwrap();
        assert_eq!(
            fs::read(keys.join("spot").join(AUTHORITY)).unwrap(),
            authority
        );
        assert!(!keys.join("spot").join(AUTHORITY_KEY).exists());
        assert!(make(&keys, "spot", 10).is_err());
    }
}
