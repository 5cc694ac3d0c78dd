//! `randt up` in a realm of its own.

use randt_stage::Realm;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// A realm that no other test and no pipeline shares; its run folder is in memory and goes with this.
pub struct Own {
    pub realm: Realm,
    _run: tempfile::TempDir,
}

impl Drop for Own {
    fn drop(&mut self) {
        // What a test that failed left in memory; its processes may still be on their way out.
        let gone = |realm: &Realm| matches!(randt_stage::wipe(realm, false), Ok(Some(_)) | Err(_));
        for _ in 0..100 {
            if gone(&self.realm) {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Makes one.
pub fn own_realm(name: &str) -> Own {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let run = tempfile::Builder::new()
        .prefix("randt-test-")
        .tempdir_in("/dev/shm")
        .unwrap();
    let prefix = format!("{name}-{}-{count}", std::process::id());
    Own {
        realm: Realm::new(&prefix, Some(run.path())).unwrap(),
        _run: run,
    }
}

/// `randt up --play LOG --out OUT --rate 1` in a realm.
pub fn up(realm: &Realm, log: &Path, out: &Path) -> Command {
    let mut command = super::randt(&["up", "--rate", "1", "--prefix", realm.prefix(), "--play"]);
    command.arg(log).arg("--out").arg(out);
    command.arg("--run").arg(realm.run());
    command
}
