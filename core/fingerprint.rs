// Included by build scripts: a fingerprint of the source that gives a stage's saved state its
// meaning.
//
// A state that another build has saved is taken over only if this is the same.

use std::{fs, path::Path};

/// Sets `RANDT_CODE` to 16 hexadecimal digits made of every source file below `folders`, in order
/// of their names.
fn fingerprint(folders: &[&str]) {
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for folder in folders {
        println!("cargo:rerun-if-changed={folder}");
        add(Path::new(folder), &mut hash);
    }
    println!("cargo:rustc-env=RANDT_CODE={hash:016x}");
}

fn add(path: &Path, hash: &mut u64) {
    if path.is_dir() {
        let Ok(entries) = fs::read_dir(path) else {
            return;
        };
        let mut entries: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
        entries.sort();
        entries.iter().for_each(|entry| add(entry, hash));
    } else if let Ok(bytes) = fs::read(path) {
        // FNV-1a.
        for byte in bytes {
            *hash = (*hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
