//! Limits on the number of clients, so that one of them cannot take all of them.

use std::net::IpAddr;

/// Unfinished handshakes at once. A viewer's takes milliseconds, or a round trip of a slow link: a
/// larger number are no viewers.
pub(crate) const HANDSHAKES_MAX: usize = 32;
/// An IPv6 client can choose the bits after these at will.
const IPV6_NETWORK_BITS: u32 = 64;

/// How many viewers there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewerLimits {
    /// At once.
    pub total: usize,
    /// From one address. Loopback is exempt, because all viewers behind ssh have it.
    pub per_address: usize,
}

impl ViewerLimits {
    /// Whether there is room for one more, or why not.
    pub(crate) fn check(
        &self,
        newcomer: IpAddr,
        viewers: impl Iterator<Item = IpAddr>,
    ) -> Result<(), String> {
        let newcomer = client(newcomer);
        let (mut total, mut of_client) = (0, 0);
        for viewer in viewers {
            total += 1;
            of_client += usize::from(client(viewer) == newcomer);
        }
        if total >= self.total {
            return Err(format!("{total} viewers watch, view.clients_max"));
        }
        if of_client >= self.per_address && !newcomer.is_loopback() {
            let key = "view.clients_max_per_address";
            return Err(format!("{of_client} viewers watch from there, {key}"));
        }
        Ok(())
    }
}

/// Which handshake makes room for one more: the oldest of the client that has the most. `waiting`:
/// their addresses, the oldest first.
pub(crate) fn to_evict(waiting: &[IpAddr]) -> Option<usize> {
    let clients: Vec<IpAddr> = waiting.iter().copied().map(client).collect();
    let count = |client: &IpAddr| clients.iter().filter(|other| *other == client).count();
    let most = clients.iter().map(count).max()?;
    clients.iter().position(|client| count(client) == most)
}

/// What all addresses of one client have in common: the whole address, or its IPv6 network.
fn client(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(v6) if !v6.is_loopback() => {
            let network = v6.to_bits() >> IPV6_NETWORK_BITS << IPV6_NETWORK_BITS;
            IpAddr::V6(network.into())
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn addresses(texts: &[&str]) -> Vec<IpAddr> {
        texts.iter().map(|text| text.parse().unwrap()).collect()
    }

    #[test]
    fn one_address_does_not_take_all_connections() {
        let limits = ViewerLimits {
            total: 4,
            per_address: 2,
        };
        let check = |newcomer: &str, viewers: &[&str]| {
            let viewers = addresses(viewers).into_iter();
            limits.check(newcomer.parse().unwrap(), viewers)
        };
        assert_eq!(check("10.0.0.1", &["10.0.0.1", "10.0.0.2"]), Ok(()));
        let refused = check("10.0.0.1", &["10.0.0.1", "::ffff:10.0.0.1"]).unwrap_err();
        assert!(refused.contains("clients_max_per_address"), "{refused}");
        // Neighbours in a network of IPv6 are one client; those of another network are not.
        assert!(check("fd00::1", &["fd00::2", "fd00::3"]).is_err());
        assert_eq!(check("fd00:0:0:1::1", &["fd00::2", "fd00::3"]), Ok(()));
        // All ssh tunnels end on loopback.
        for loopback in ["127.0.0.1", "::1", "::ffff:127.0.0.1"] {
            assert_eq!(check(loopback, &[loopback; 3]), Ok(()), "{loopback}");
            assert!(check(loopback, &[loopback; 4]).is_err(), "{loopback}");
        }
    }

    #[test]
    fn a_crowd_makes_room_before_a_single_client_does() {
        let waiting = addresses(&["10.0.0.9", "fd00::1", "10.0.0.1", "10.0.0.1", "fd00::2"]);
        assert_eq!(to_evict(&waiting), Some(1));
        assert_eq!(to_evict(&waiting[..2]), Some(0));
        assert_eq!(to_evict(&[]), None);
    }
}
