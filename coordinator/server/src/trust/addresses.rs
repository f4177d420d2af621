//! Where other machines can reach this one: what a token's file tells its holder.

use std::net::{IpAddr, SocketAddr, UdpSocket};

use wire::tls::token_file::ADDRESSES_MAX;

/// The addresses to tell, for a coordinator that listens there: those that the operator named, or else the one that
/// it listens on, or, where it listens on all, those by which this machine reaches others.
pub(crate) fn of(advertised: &[String], listens: SocketAddr) -> Vec<String> {
    if !advertised.is_empty() {
        return advertised.iter().take(ADDRESSES_MAX).cloned().collect();
    }
    if !listens.ip().is_unspecified() {
        return vec![listens.to_string()];
    }
    let port = listens.port();
    // Documentation's addresses, which lie behind the default route, if there is one.
    let outside = match listens {
        SocketAddr::V4(_) => &["192.0.2.1:9"][..],
        SocketAddr::V6(_) => &["[2001:db8::1]:9", "192.0.2.1:9"],
    };
    let own = outside.iter().filter_map(|there| towards(there));
    let mut all: Vec<String> = own
        .map(|ip| SocketAddr::new(ip, port).to_string())
        .collect();
    if all.is_empty() {
        let loopback: IpAddr = match listens {
            SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
            SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
        };
        all.push(SocketAddr::new(loopback, port).to_string());
    }
    all
}

/// The address of this machine from which a route leads there. Nothing is sent.
fn towards(there: &str) -> Option<IpAddr> {
    let there: SocketAddr = there.parse().ok()?;
    let any: SocketAddr = match there {
        SocketAddr::V4(_) => (std::net::Ipv4Addr::UNSPECIFIED, 0).into(),
        SocketAddr::V6(_) => (std::net::Ipv6Addr::UNSPECIFIED, 0).into(),
    };
    let socket = UdpSocket::bind(any).ok()?;
    socket.connect(there).ok()?;
    let ip = socket.local_addr().ok()?.ip();
    Some(ip).filter(|ip| !ip.is_unspecified() && !ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_operator_says_comes_first() {
        let listens: SocketAddr = "0.0.0.0:7".parse().unwrap();
        let named = ["farm.example:7".to_owned()];
        assert_eq!(of(&named, listens), named);
        assert_eq!(of(&[], "192.0.2.9:7".parse().unwrap()), ["192.0.2.9:7"]);
        let found = of(&[], listens);
        assert!(!found.is_empty());
        assert!(
            found
                .iter()
                .all(|address| address.ends_with(":7") && !address.starts_with("0."))
        );
    }
}
