//! Who may ask.
//!
//! A port of the loopback address can be reached by everybody who is logged in on this computer, so every address begins
//! with a secret key: who was not told it gets nothing. It can be reached, too, by every page that the same browser shows: by
//! its address (other origins), or by a foreign name that was made to point to it (DNS rebinding). So the name that was
//! asked for must be ours, what was sent by a foreign page is refused, and an order must carry a second secret that only our
//! page holds.

use std::net::SocketAddr;

use axum::http::{HeaderMap, HeaderName, Method, Uri, header};

/// Header in which the page sends the secret.
pub const TOKEN: HeaderName = HeaderName::from_static("x-lobestone-token");
const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");
const SEC_FETCH_MODE: HeaderName = HeaderName::from_static("sec-fetch-mode");
const SEC_FETCH_DEST: HeaderName = HeaderName::from_static("sec-fetch-dest");

pub struct Guard {
    /// What `Host` may be.
    hosts: [String; 2],
    /// First part of every path.
    key: String,
    /// The same for the report and its figures: their scripts know their own address, and thus no other.
    report_key: String,
    token: String,
}

fn secret() -> String {
    format!("{:032x}", rand::random::<u128>())
}

/// In a time that does not tell how much of it is right.
fn same(given: &str, secret: &str) -> bool {
    let differences = given.bytes().zip(secret.bytes()).fold(0, |d, (a, b)| d | (a ^ b));
    given.len() == secret.len() && differences == 0
}

impl Guard {
    /// With secrets that were never used before.
    pub fn new(address: SocketAddr) -> Self {
        Guard {
            hosts: [address.to_string(), format!("localhost:{}", address.port())],
            key: secret(),
            report_key: secret(),
            token: secret(),
        }
    }

    /// Path of the page.
    pub fn page(&self) -> String {
        format!("/{}/", self.key)
    }

    /// Path of the report.
    pub fn report(&self) -> String {
        format!("/{}/report", self.report_key)
    }

    pub fn token(&self) -> &str {
        &self.token
    }

    /// # Errors
    /// Why the request is refused, in a sentence.
    pub fn check(&self, method: &Method, uri: &Uri, headers: &HeaderMap) -> Result<(), &'static str> {
        self.check_host(uri, headers)?;
        self.check_key(uri)?;
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

    fn check_key(&self, uri: &Uri) -> Result<(), &'static str> {
        let mut parts = uri.path().splitn(3, '/').skip(1);
        let (given, rest) = (parts.next().unwrap_or(""), parts.next().unwrap_or(""));
        let key = if is_report(rest) {
            &self.report_key
        } else {
            &self.key
        };
        match same(given, key) {
            true => Ok(()),
            false => Err(
                "this page opens with the whole address only that lobestone printed when it was started: it carries \
                          a secret, and another one every time",
            ),
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
        let figure = uri
            .path()
            .splitn(3, '/')
            .nth(2)
            .is_some_and(|rest| rest.starts_with("report/"));
        // Somebody who knows the address follows a link to it (the file that `--open` shows first).
        let is = |name: &HeaderName, value: &str| only(headers, name.clone()) == Some(value);
        let opened =
            uri.path() == self.page() && is(&SEC_FETCH_MODE, "navigate") && is(&SEC_FETCH_DEST, "document");
        match headers.get(SEC_FETCH_SITE).map(|v| v.as_bytes()) {
            None | Some(b"same-origin" | b"none") => Ok(()),
            Some(_) if figure || opened => Ok(()),
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

/// Is this, behind the key, the report or a figure of it?
fn is_report(rest: &str) -> bool {
    rest == "report" || rest.starts_with("report/")
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
        guard.key = "page".into();
        guard.report_key = "shown".into();
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
            assert_eq!(
                allowed(Method::GET, "/page/", &[("host", host)]),
                expected,
                "{host}"
            );
        }
        assert!(!allowed(Method::GET, "/page/", &[]));
        assert!(!allowed(
            Method::GET,
            "/page/",
            &[("host", OURS), ("host", "evil.example")]
        ));
        assert!(!allowed(
            Method::GET,
            "http://evil.example/page/",
            &[("host", OURS)]
        ));
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
            assert_eq!(
                allowed(Method::POST, "/page/order", &headers),
                expected,
                "{origin}"
            );
            assert_eq!(
                allowed(Method::GET, "/page/state", &headers),
                expected,
                "{origin}"
            );
        }
        for (site, expected) in [
            ("none", true),
            ("same-origin", true),
            ("same-site", false),
            ("cross-site", false),
        ] {
            let site = ("sec-fetch-site", site);
            assert_eq!(
                allowed(Method::GET, "/page/", &[host, site]),
                expected,
                "{site:?}"
            );
            assert_eq!(
                allowed(Method::GET, "/shown/report", &[host, site]),
                expected,
                "{site:?}"
            );
            assert!(allowed(Method::GET, "/shown/report/frf.png", &[host, site]));
        }
    }

    #[test]
    fn nothing_without_the_key() {
        let host = ("host", OURS);
        for (path, expected) in [
            ("/page/", true),
            ("/page/state", true),
            ("/shown/report", true),
            ("/shown/report/frf.png", true),
            // Who reads the report learns nothing else.
            ("/shown/", false),
            ("/shown/state", false),
            ("/page/report", false),
            ("/", false),
            ("/page2/", false),
            ("/pag/", false),
            ("//page/", false),
            ("/state", false),
            ("/x/../page/", false),
            ("/%70age/", false),
        ] {
            assert_eq!(allowed(Method::GET, path, &[host]), expected, "{path}");
        }
        let link = [
            host,
            ("sec-fetch-site", "cross-site"),
            ("sec-fetch-mode", "navigate"),
        ];
        let opened = [&link[..], &[("sec-fetch-dest", "document")]].concat();
        assert!(allowed(Method::GET, "/page/", &opened));
        assert!(!allowed(Method::GET, "/page/state", &opened));
        assert!(!allowed(
            Method::GET,
            "/page/",
            &[&link[..], &[("sec-fetch-dest", "iframe")]].concat()
        ));
    }

    #[test]
    fn an_order_needs_the_secret() {
        let host = ("host", OURS);
        for method in [Method::POST, Method::PUT, Method::DELETE, Method::OPTIONS] {
            assert!(!allowed(method.clone(), "/page/order", &[host]));
            assert!(!allowed(
                method.clone(),
                "/page/order",
                &[host, ("x-lobestone-token", "")]
            ));
            assert!(!allowed(
                method.clone(),
                "/page/order",
                &[host, ("x-lobestone-token", "Secret")]
            ));
            assert!(allowed(
                method,
                "/page/order",
                &[host, ("x-lobestone-token", "secret")]
            ));
        }
        let guard = || Guard::new(OURS.parse().unwrap());
        assert_eq!(guard().token().len(), 32);
        assert_ne!(guard().token(), guard().token());
    }
}
