//! Keeps the sockets of DDS on loopback: RustDDS opens them for every network, and only chooses
//! what it announces.

use nix::sys::socket::{
    AddressFamily, SockaddrLike, SockaddrStorage, getsockname, setsockopt, sockopt,
};
use rustix::process::{PidfdFlags, PidfdGetfdFlags, getpid, pidfd_getfd, pidfd_open};
use std::ffi::OsString;
use std::io;
use std::os::fd::{AsRawFd, OwnedFd};

const DEVICE: &str = "lo";

/// Binds all of this process's sockets of the internet protocols to the loopback device: nothing
/// comes from elsewhere, and nothing goes there.
pub fn keep() -> io::Result<()> {
    let own = pidfd_open(getpid(), PidfdFlags::empty())?;
    let mut kept = 0;
    for entry in std::fs::read_dir("/proc/self/fd")? {
        let path = entry?.path();
        // Files are left alone: closing one under any of its numbers gives up all locks on it, and
        // by these the stages know who lives.
        let target = std::fs::read_link(&path).unwrap_or_default();
        if !target.to_string_lossy().starts_with("socket:") {
            continue;
        }
        let number = path
            .file_name()
            .and_then(|name| name.to_str()?.parse().ok());
        let Some(number) = number else { continue };
        let fd = pidfd_getfd(&own, number, PidfdGetfdFlags::empty())?;
        if is_internet(&fd) {
            // It is the same socket under another number.
            setsockopt(&fd, sockopt::BindToDevice, &OsString::from(DEVICE))?;
            kept += 1;
        }
    }
    match kept {
        0 => Err(io::Error::other("no socket was found")),
        _ => Ok(()),
    }
}

fn is_internet(fd: &OwnedFd) -> bool {
    let name = getsockname::<SockaddrStorage>(fd.as_raw_fd());
    let family = name.ok().and_then(|name| name.family());
    matches!(family, Some(AddressFamily::Inet | AddressFamily::Inet6))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test says by panicking what is wrong")]
mod tests {
    use super::*;
    use nix::sys::socket::getsockopt;
    use std::net::UdpSocket;

    #[test]
    fn sockets_of_the_internet_are_kept_and_others_left() {
        let open = UdpSocket::bind("0.0.0.0:0").unwrap();
        let (_one, _other) = std::os::unix::net::UnixStream::pair().unwrap();
        keep().unwrap();
        let device = getsockopt(&open, sockopt::BindToDevice).unwrap();
        assert_eq!(device.to_str().unwrap().trim_end_matches('\0'), DEVICE);
    }
}
