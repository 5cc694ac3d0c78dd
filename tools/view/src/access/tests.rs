//! Requests as browsers and viewers send them, and forged ones.

use super::*;

const OWN_NAME: &str = "robot";

/// A handshake with these headers.
fn request(target: &str, headers: &[(&str, &str)]) -> Request {
    let mut request = Request::new(());
    *request.uri_mut() = target.parse().unwrap();
    for (name, value) in headers {
        let name: HeaderName = name.parse().unwrap();
        request.headers_mut().append(name, value.parse().unwrap());
    }
    request
}

/// A policy with what a configuration would add.
fn policy(origins: &str, host_names: &str) -> AccessPolicy {
    let origins = origins
        .split_whitespace()
        .map(|text| WebOrigin::parse(text).unwrap());
    let names = host_names.split_whitespace();
    let names = names.map(|text| Host::parse(text).unwrap());
    AccessPolicy::new(&WebOrigins(origins.collect()), &HostNames(names.collect()))
}

fn judged(
    origins: &str,
    host_names: &str,
    host: &str,
    origin: Option<&str>,
) -> Result<(), Refusal> {
    let mut headers = vec![("Host", host)];
    headers.extend(origin.map(|origin| ("Origin", origin)));
    policy(origins, host_names).check(&request("/", &headers), OWN_NAME)
}

#[test]
fn viewers_of_all_kinds_may_watch() {
    assert_eq!(policy("", "").origins.len(), VIEWERS.len(), "each is read");
    for host in [
        "localhost:8765",
        "127.0.0.1:8765",
        "[::1]:8765",
        "robot.local:8765",
        "10.0.0.5",
    ] {
        for origin in [
            // A program that is no browser.
            None,
            Some("file://"),
            Some("https://app.foxglove.dev"),
            Some("https://lichtblick-suite.github.io"),
            // Lichtblick from its container or a build of one's own, on the operator's machine.
            Some("http://localhost:8080"),
            Some("http://127.0.0.1:8080"),
        ] {
            assert_eq!(judged("", "", host, origin), Ok(()), "{host} {origin:?}");
        }
    }
    // The same container on the robot.
    let by_address = judged("", "", "10.0.0.5:8765", Some("http://10.0.0.5:8080"));
    assert_eq!(by_address, Ok(()));
}

#[test]
fn pages_of_others_may_not() {
    for origin in [
        "https://evil.example",
        "http://evil.example:8765",
        // A frame in a sandbox, a data: URL, a file in Firefox.
        "null",
        "",
        "https://app.foxglove.dev.evil.example",
        "https://evil.example/https://app.foxglove.dev",
        "https://app.foxglove.dev@evil.example",
        "http://app.foxglove.dev",
        "https://app.foxglove.dev:8443",
        // Any page may embed this one in a frame, and load its own code there.
        "https://embed.foxglove.dev",
        "https://foxglove.dev",
        "https://evil.github.io",
        "http://localhost.evil.example",
        "http://127.0.0.1.evil.example",
        "http://10.0.0.5",
        "file:///",
        "chrome-extension://abc",
        "https://app.foxglove.dev, https://evil.example",
    ] {
        let found = judged("", "", "127.0.0.1:8765", Some(origin));
        assert_eq!(found, Err(Refusal::Origin(origin.to_owned())), "{origin:?}");
    }
}

#[test]
fn a_name_that_was_rebound_to_this_machine_is_refused() {
    for host in [
        "evil.example:8765",
        "localhost.evil.example",
        "127.0.0.1.evil.example:8765",
        "robot.evil.example",
        "localhost.",
        "user@localhost",
        "localhost:80@evil.example",
        "",
    ] {
        // Its page is of the same name, and of the same port where that is wanted.
        for origin in [None, Some("http://evil.example:8765"), Some("file://")] {
            let found = judged("", "", host, origin);
            assert_eq!(
                found,
                Err(Refusal::Host(host.to_owned())),
                "{host:?} {origin:?}"
            );
        }
    }
    // Not even by a name that is known: by a name both are the same when it was rebound.
    for host in ["robot:8765", "robot.local:8765", "known.example:8765"] {
        let origin = format!("http://{host}");
        let found = judged("", "known.example", host, Some(&origin));
        assert_eq!(found, Err(Refusal::Origin(origin)));
    }
}

#[test]
fn what_the_configuration_adds_may_watch() {
    let origins = "https://viewer.example:8443 http://robot.local:8080";
    let ours =
        |host: &str, origin: &str| judged(origins, "Viewer.example gate", host, Some(origin));
    assert_eq!(
        ours("viewer.example:8765", "https://viewer.example:8443"),
        Ok(())
    );
    assert_eq!(ours("GATE", "HTTPS://Viewer.Example:8443"), Ok(()));
    assert_eq!(ours("robot.local:8765", "http://robot.local:8080"), Ok(()));
    assert!(ours("gate", "https://viewer.example").is_err());
    assert!(ours("gate.example", "https://viewer.example:8443").is_err());
}

#[test]
fn a_request_is_read_in_one_way_only() {
    let rules = policy("", "");
    let good = ("Host", "localhost:8765");
    let check = |target: &str, headers: &[(&str, &str)]| {
        let found = rules.check(&request(target, headers), OWN_NAME);
        found.map_err(|refusal| (refusal.status().as_u16(), refusal.to_string()))
    };
    assert_eq!(check("/", &[good]), Ok(()));
    assert_eq!(check("/any?path", &[("hOsT", "LOCALHOST:8765")]), Ok(()));
    let evil = ("Origin", "https://evil.example");
    let friend = ("Origin", "file://");
    for (target, headers, words) in [
        ("/", &[][..], "no Host header"),
        ("/", &[good, good], "two Host"),
        ("/", &[good, ("host", "evil.example")], "two Host"),
        ("/", &[good, friend, evil], "two Origin"),
        ("/", &[good, ("origin", "file://"), friend], "two Origin"),
        ("ws://evil.example/", &[good], "a target"),
        ("http://localhost:8765/", &[good], "a target"),
        ("evil.example:80", &[good], "a target"),
        ("*", &[good], "a target"),
    ] {
        let (status, answer) = check(target, headers).unwrap_err();
        assert_eq!(status, 400);
        assert!(answer.contains(words), "{target} {headers:?}: {answer}");
    }
    let mut broken = request("/", &[good]);
    let value = tungstenite::http::HeaderValue::from_bytes(b"file://\xff").unwrap();
    broken.headers_mut().append(ORIGIN, value);
    assert!(rules.check(&broken, OWN_NAME).is_err());
}

#[test]
fn a_clients_words_are_short_in_the_journal_and_absent_in_the_answer() {
    let long = format!("https://{}\u{1b}[31m", "x".repeat(5000));
    let refusal = Refusal::Origin(shown(&long));
    assert!(refusal.to_string().len() < 2 * SHOWN_MAX);
    let refusal = Refusal::Host("evil\u{1b}[31m\n<script>".to_owned());
    assert!(!refusal.to_string().contains(['\n', '\u{1b}']), "{refusal}");
    assert!(!refusal.answer().contains("evil"));
}
