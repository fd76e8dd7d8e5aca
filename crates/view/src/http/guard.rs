//! Who is answered: browsers that were given a name of this machine, with GET and HEAD.

use hyper::header::HOST;
use hyper::{Method, Request};

use crate::refusal::Refusal;

/// Names of this machine.
const NAMES: [&str; 3] = ["127.0.0.1", "localhost", "[::1]"];

/// Refuses other methods, and requests under another name: a page of the web whose name leads to this machine would be
/// served its own origin. The port is not compared, so that the server can be reached through a tunnel.
pub(super) fn check<B>(request: &Request<B>) -> Result<(), Refusal> {
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return Err(Refusal { status: 405, line: "only GET and HEAD are answered".to_owned() });
    }
    let mut hosts = request.headers().get_all(HOST).iter();
    let (first, more) = (hosts.next().and_then(|host| host.to_str().ok()), hosts.next());
    // of an absolute address that name counts
    let is_ours = first.is_some_and(is_local) && more.is_none() && request.uri().host().is_none_or(is_local);
    if is_ours {
        return Ok(());
    }
    Err(Refusal { status: 403, line: "only requests to 127.0.0.1 or localhost are answered".to_owned() })
}

fn is_local(host: &str) -> bool {
    NAMES.iter().any(|name| {
        let rest = host.get(..name.len()).filter(|start| start.eq_ignore_ascii_case(name)).map(|_| &host[name.len()..]);
        rest.is_some_and(|rest| {
            rest.is_empty() || rest.strip_prefix(':').is_some_and(|port| port.bytes().all(|b| b.is_ascii_digit()))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_this_machine_are_answered() {
        for host in ["127.0.0.1", "127.0.0.1:8080", "localhost:1", "LocalHost", "[::1]:80", "[::1]"] {
            assert!(is_local(host), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "localhost.evil.example",
            "127.0.0.1.evil.example:80",
            "localhost:80.x",
            "0.0.0.0",
            "127.0.0.2",
            "user@localhost",
            "localhost:a",
            "é",
        ] {
            assert!(!is_local(host), "{host}");
        }
    }

    #[test]
    fn a_request_has_one_host() {
        let request = |hosts: &[&str], uri: &str| {
            let mut request = Request::builder().uri(uri);
            for host in hosts {
                request = request.header(HOST, *host);
            }
            check(&request.body(()).unwrap()).map_err(|refusal| refusal.status)
        };
        assert_eq!(request(&["localhost:9"], "/"), Ok(()));
        assert_eq!(request(&[], "/"), Err(403));
        assert_eq!(request(&["localhost", "evil.example"], "/"), Err(403));
        assert_eq!(request(&["localhost"], "http://evil.example/"), Err(403));
    }
}
