//! What is in the package.

use crate::support::ended;
use crate::support::package::{PROGRAMS, build, collect};
use crate::support::robot::can_boot;
use std::fs;
use std::path::Path;

/// Runs dpkg-deb on a package.
fn dpkg_deb(option: &str, package: &Path) -> String {
    let mut command = std::process::Command::new("dpkg-deb");
    command.arg(option).arg(package);
    let output = ended(command);
    assert_eq!((output.code, output.stderr.as_str()), (Some(0), ""));
    output.stdout
}

#[test]
fn a_package_has_what_debian_asks_for() {
    if !can_boot() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let programs = collect(folder.path(), "programs", &[]);
    let package = build(&programs, "0.1.0", &folder.path().join("a"));
    let again = build(&programs, "0.1.0", &folder.path().join("b"));
    assert!(
        fs::read(&package).unwrap() == fs::read(again).unwrap(),
        "not the same bytes"
    );

    let info = dpkg_deb("--info", &package);
    println!("{info}");
    for words in [
        " Package: randt\n",
        " Version: 0.1.0\n",
        " Architecture: amd64\n",
        "libc6 (>= 2.",
        "systemd (>= 245)",
    ] {
        assert!(info.contains(words), "{words}: {info}");
    }
    for script in ["conffiles", "md5sums", "postinst", "postrm", "prerm"] {
        assert!(info.contains(script), "{script}");
    }
    let listed = dpkg_deb("--contents", &package);
    let rows: Vec<(&str, &str, &str)> = listed
        .lines()
        .map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            (words[0], words[1], words[5].strip_prefix('.').unwrap())
        })
        .collect();
    for (mode, owner, path) in &rows {
        let right = match mode.chars().next().unwrap() {
            'd' => "drwxr-xr-x",
            _ if path.starts_with("/usr/bin/") => "-rwxr-xr-x",
            _ => "-rw-r--r--",
        };
        assert_eq!((*mode, *owner), (right, "root/root"), "{path}");
    }
    let has = |path: &str| rows.iter().any(|(_, _, at)| *at == path);
    for program in PROGRAMS.lines() {
        assert!(has(&format!("/usr/bin/{program}")), "{program}");
        let section = if program == "randt" { 1 } else { 8 };
        assert!(has(&format!(
            "/usr/share/man/man{section}/{program}.{section}.gz"
        )));
        for shell in [
            format!("bash-completion/completions/{program}"),
            format!("zsh/vendor-completions/_{program}"),
            format!("fish/vendor_completions.d/{program}.fish"),
        ] {
            assert!(has(&format!("/usr/share/{shell}")), "{shell}");
        }
        if program != "randt" {
            assert!(has(&format!("/usr/lib/systemd/system/{program}.service")));
        }
    }
    for path in [
        "/etc/randt/robot.toml",
        "/etc/randt/randt.env",
        "/usr/lib/systemd/system/randt.target",
        "/usr/lib/systemd/system/randt.slice",
        "/usr/lib/systemd/system/randt-mission.service",
        "/usr/lib/systemd/system/randt-recover.service",
        "/usr/lib/sysusers.d/randt.conf",
        "/usr/lib/tmpfiles.d/randt.conf",
        "/usr/lib/sysctl.d/60-randt.conf",
        "/usr/lib/modules-load.d/randt.conf",
        "/usr/lib/udev/rules.d/60-randt.rules",
        "/usr/lib/randt/librandt_bus.so",
        "/usr/share/doc/randt/examples/bus/follow_pose.c",
        "/usr/share/doc/randt/copyright",
        "/usr/share/doc/randt/changelog.gz",
        "/usr/share/doc/randt/third-party.txt.gz",
        "/usr/share/doc/randt/operate.md",
        "/usr/share/doc/randt/examples/sensors/isdr-c.toml",
    ] {
        assert!(has(path), "{path}");
    }
    // Every file of /etc, and nothing else, is the administrator's.
    let unpacked = folder.path().join("unpacked");
    let mut command = std::process::Command::new("dpkg-deb");
    command.arg("--raw-extract").arg(&package).arg(&unpacked);
    assert_eq!(ended(command).code, Some(0));
    let conffiles = fs::read_to_string(unpacked.join("DEBIAN/conffiles")).unwrap();
    let of_etc: Vec<&str> = rows
        .iter()
        .filter(|(mode, _, path)| mode.starts_with('-') && path.starts_with("/etc/"))
        .map(|(_, _, path)| *path)
        .collect();
    assert_eq!(conffiles.lines().collect::<Vec<_>>(), of_etc);
    for script in ["postinst", "prerm", "postrm"] {
        let mut command = std::process::Command::new("sh");
        command.arg("-n").arg(unpacked.join("DEBIAN").join(script));
        assert_eq!(ended(command).code, Some(0), "{script}");
    }
}
