//! Who may talk to the server: pages that it served itself, and, from other machines, those who know the token.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};

use axum::http::{HeaderMap, header};

/// What is demanded of a request.
#[derive(Debug)]
pub(super) struct Access {
    /// Demanded when the server can be reached from other machines.
    token: Option<String>,
}

impl Access {
    /// For a server that listens on `address`.
    ///
    /// # Errors
    /// When the machine has no randomness for a token.
    pub(super) fn new(address: SocketAddr) -> Result<Self, getrandom::Error> {
        let token = if address.ip().is_loopback() { None } else { Some(random_text()?) };
        Ok(Self { token })
    }

    /// The page's address, as far as possible one that other machines can use.
    pub(super) fn url(&self, mut address: SocketAddr) -> String {
        if address.ip().is_unspecified()
            && let Some(ip) = own_address()
        {
            address.set_ip(ip);
        }
        match &self.token {
            None => format!("http://{address}/"),
            Some(token) => format!("http://{address}/?token={token}"),
        }
    }

    /// Why a request is refused. Browsers say which page made it; programs that are none do not.
    pub(super) fn check(&self, headers: &HeaderMap, token: &str) -> Result<(), &'static str> {
        let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
        let host = text(header::HOST).ok_or("a request without `Host`")?;
        if let Some(expected) = &self.token {
            if !same(expected, token) {
                return Err("this server asks for a token; open the address that it printed when it started");
            }
        } else if !is_this_machine(host) {
            // Another name may have been made to point here by somebody else's page.
            return Err("this server answers to `localhost` and 127.0.0.1 alone");
        }
        match headers.get(header::ORIGIN) {
            None => Ok(()),
            Some(origin) => {
                let origin = origin.to_str().unwrap_or("");
                let from = origin.strip_prefix("http://").or(origin.strip_prefix("https://"));
                if from == Some(host) { Ok(()) } else { Err("a request by another site's page") }
            }
        }
    }
}

/// The address by which this machine speaks to others; nothing is sent to find it out.
fn own_address() -> Option<IpAddr> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).ok()?;
    // An address for documentation, which leads nowhere: it serves to choose a network interface.
    socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9)).ok()?;
    socket.local_addr().ok().map(|address| address.ip()).filter(|ip| !ip.is_unspecified())
}

/// Whether a `Host` header names this machine, on whatever port: tunnels change it.
fn is_this_machine(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) => name,
        _ => host,
    };
    ["localhost", "127.0.0.1", "[::1]"].contains(&name)
}

/// Compares without telling by its time how much is right.
pub(super) fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b)) == 0
}

/// 128 random bits as text.
pub(super) fn random_text() -> Result<String, getrandom::Error> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(address: &str, headers: &[(&'static str, &str)], token: &str) -> bool {
        let access = Access::new(address.parse().expect("an address")).expect("randomness");
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.insert(*name, value.parse().expect("a value"));
        }
        let token = if token == "right" { access.token.clone().unwrap_or_default() } else { token.into() };
        access.check(&map, &token).is_ok()
    }

    #[test]
    fn this_machine_needs_no_token_but_the_right_names() {
        let local = "127.0.0.1:8080";
        assert!(check(local, &[("host", "localhost:8080")], ""));
        assert!(check(local, &[("host", "[::1]:9"), ("origin", "http://[::1]:9")], ""));
        assert!(!check(local, &[], ""));
        assert!(!check(local, &[("host", "evil.example:8080")], ""), "a name that was made to point here");
        assert!(!check(local, &[("host", "localhost:8080"), ("origin", "http://evil.example")], ""));
        assert!(!check(local, &[("host", "localhost:8080"), ("origin", "null")], ""));
        assert!(!check(local, &[("host", "localhost:8080"), ("origin", "http://localhost:80")], ""));
    }

    #[test]
    fn others_need_the_token() {
        let open = "0.0.0.0:8080";
        assert!(check(open, &[("host", "box:8080"), ("origin", "http://box:8080")], "right"));
        assert!(!check(open, &[("host", "box:8080")], ""));
        assert!(!check(open, &[("host", "localhost:8080")], "0123456789abcdef0123456789abcdef"));
        assert!(!check(open, &[("host", "box:8080"), ("origin", "http://evil.example")], "right"));
    }
}
