//! Who may ask.
//!
//! A page on the loopback address can be reached by every page that the same browser shows: by its address (other
//! origins), or by a foreign name that was made to point to it (DNS rebinding). So the name that was asked for must be
//! ours, what was sent by a foreign page is refused, and an order must carry a secret that only our page holds.

use std::net::SocketAddr;

use axum::http::{HeaderMap, HeaderName, Method, Uri, header};

/// Header in which the page sends the secret.
pub const TOKEN: HeaderName = HeaderName::from_static("x-lobestone-token");
const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

pub struct Guard {
    /// What `Host` may be.
    hosts: [String; 2],
    token: String,
}

impl Guard {
    /// With a secret that was never used before.
    pub fn new(address: SocketAddr) -> Self {
        Guard {
            hosts: [address.to_string(), format!("localhost:{}", address.port())],
            token: format!("{:032x}", rand::random::<u128>()),
        }
    }

    pub fn token(&self) -> &str {
        &self.token
    }

    /// # Errors
    /// Why the request is refused, in a sentence.
    pub fn check(&self, method: &Method, uri: &Uri, headers: &HeaderMap) -> Result<(), &'static str> {
        self.check_host(uri, headers)?;
        self.check_origin(uri, headers)?;
        match *method {
            Method::GET | Method::HEAD => Ok(()),
            _ => self.check_token(headers),
        }
    }

    fn check_host(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), &'static str> {
        let ours = |host: &str| self.hosts.iter().any(|h| h.eq_ignore_ascii_case(host));
        let one = only(headers, header::HOST).is_some_and(ours);
        // As a proxy is asked; then this is the name that counts.
        let absolute = uri.authority().is_none_or(|a| ours(a.as_str()));
        match one && absolute {
            true => Ok(()),
            false => Err("this page answers to its own address only (127.0.0.1 or localhost, with its port)"),
        }
    }

    fn check_origin(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), &'static str> {
        let foreign = Err("another web page asked for this; open the page by typing its address");
        if headers.contains_key(header::ORIGIN) {
            let host = only(headers, header::ORIGIN).and_then(|o| o.strip_prefix("http://"));
            if !host.is_some_and(|host| self.hosts.iter().any(|h| h == host)) {
                return foreign;
            }
        }
        // The report stands in a frame without an origin of its own. What it links to, its figures, the browser
        // therefore takes for asked for by a stranger; whom it does not show them (Cross-Origin-Resource-Policy).
        let figure = uri.path().starts_with("/report/");
        match headers.get(SEC_FETCH_SITE).map(|v| v.as_bytes()) {
            None | Some(b"same-origin" | b"none") => Ok(()),
            Some(_) if figure => Ok(()),
            Some(_) => foreign,
        }
    }

    fn check_token(&self, headers: &HeaderMap) -> Result<(), &'static str> {
        match only(headers, TOKEN) == Some(self.token.as_str()) {
            true => Ok(()),
            false => Err("this order does not come from the page as it is now; reload the page"),
        }
    }
}

/// The header's value where it stands there once.
fn only(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    match (values.next(), values.next()) {
        (Some(value), None) => value.to_str().ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: &str = "127.0.0.1:8017";

    fn allowed(method: Method, uri: &str, headers: &[(&'static str, &str)]) -> bool {
        let mut guard = Guard::new(OURS.parse().unwrap());
        guard.token = "secret".into();
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(HeaderName::from_static(name), value.parse().unwrap());
        }
        guard.check(&method, &uri.parse().unwrap(), &map).is_ok()
    }

    #[test]
    fn only_its_own_names() {
        for (host, expected) in [
            (OURS, true),
            ("localhost:8017", true),
            ("LocalHost:8017", true),
            ("127.0.0.1", false),
            ("127.0.0.1:80", false),
            ("evil.example:8017", false),
            ("localhost.evil.example:8017", false),
            ("", false),
        ] {
            assert_eq!(allowed(Method::GET, "/", &[("host", host)]), expected, "{host}");
        }
        assert!(!allowed(Method::GET, "/", &[]));
        assert!(!allowed(
            Method::GET,
            "/",
            &[("host", OURS), ("host", "evil.example")]
        ));
        assert!(!allowed(Method::GET, "http://evil.example/", &[("host", OURS)]));
    }

    #[test]
    fn no_other_origin() {
        let host = ("host", OURS);
        for (origin, expected) in [
            ("http://127.0.0.1:8017", true),
            ("http://localhost:8017", true),
            ("http://127.0.0.1:8018", false),
            ("https://127.0.0.1:8017", false),
            ("http://evil.example", false),
            ("null", false),
            ("", false),
        ] {
            let headers = [host, ("origin", origin), ("x-lobestone-token", "secret")];
            assert_eq!(allowed(Method::POST, "/order", &headers), expected, "{origin}");
            assert_eq!(allowed(Method::GET, "/state", &headers), expected, "{origin}");
        }
        for (site, expected) in [
            ("none", true),
            ("same-origin", true),
            ("same-site", false),
            ("cross-site", false),
        ] {
            let site = ("sec-fetch-site", site);
            assert_eq!(allowed(Method::GET, "/", &[host, site]), expected, "{site:?}");
            assert_eq!(
                allowed(Method::GET, "/report", &[host, site]),
                expected,
                "{site:?}"
            );
            assert!(allowed(Method::GET, "/report/frf.png", &[host, site]));
        }
    }

    #[test]
    fn an_order_needs_the_secret() {
        let host = ("host", OURS);
        for method in [Method::POST, Method::PUT, Method::DELETE, Method::OPTIONS] {
            assert!(!allowed(method.clone(), "/order", &[host]));
            assert!(!allowed(
                method.clone(),
                "/order",
                &[host, ("x-lobestone-token", "")]
            ));
            assert!(!allowed(
                method.clone(),
                "/order",
                &[host, ("x-lobestone-token", "Secret")]
            ));
            assert!(allowed(
                method,
                "/order",
                &[host, ("x-lobestone-token", "secret")]
            ));
        }
        let guard = || Guard::new(OURS.parse().unwrap());
        assert_eq!(guard().token().len(), 32);
        assert_ne!(guard().token(), guard().token());
    }
}
