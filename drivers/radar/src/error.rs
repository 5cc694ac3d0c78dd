//! Why a radar cannot even be tried.

use randt_config::Origins;

/// A configuration that no radar fits, or a host that gives nothing to sleep on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The address is none.
    #[error(
        "radar.address {address:?} is not an address; expected IP:PORT such as {example} (names are not looked up)"
    )]
    Address {
        /// What was given.
        address: String,
        /// What would do.
        example: &'static str,
    },
    /// The interface is no address.
    #[error(
        "radar.interface {0:?} is not the IP of one of this host's interfaces, such as 192.168.0.10"
    )]
    Interface(String),
    /// A multicast group that cannot be joined.
    #[error("radar.address {0}: only IPv4 groups can be joined")]
    Group(std::net::SocketAddr),
    /// Nothing can be recorded there.
    #[error("record.dense {}: {source}", folder.display())]
    Record {
        /// The folder.
        folder: std::path::PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The kernel refuses an epoll descriptor.
    #[error("nothing to wait on: {0}")]
    Poller(std::io::Error),
}

impl Error {
    pub(crate) fn address(address: &str, example: &'static str) -> Self {
        let address = address.to_owned();
        Self::Address { address, example }
    }

    /// As an error of the configuration, where it is one: it has the origin of the value, and ends
    /// a process as bad configuration.
    pub fn in_configuration(self, origins: &Origins) -> Box<dyn std::error::Error + Send + Sync> {
        let (key, found, expected) = match &self {
            Self::Address { address, example } => (
                "address",
                address.clone(),
                format!("IP:PORT, such as {example} (names are not looked up)"),
            ),
            Self::Interface(interface) => (
                "interface",
                interface.clone(),
                "the IP of one of this host's interfaces, such as 192.168.0.10".to_owned(),
            ),
            Self::Group(address) => (
                "address",
                address.to_string(),
                "an IPv4 group where it is a group".to_owned(),
            ),
            Self::Record { .. } | Self::Poller(_) => return self.into(),
        };
        randt_config::Error::value(origins, ("radar", key), &found, expected).into()
    }
}
