//! What no browser sends: refused or served, and the server answers the next request.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use pointmill_testkit::files::fixture;
use pointmill_testkit::random::Random;

use super::client::{Answer, serve};

#[test]
fn garbage_is_refused() {
    let served = serve(&[&fixture("potree2/default")]);
    let mut random = Random::new(16);
    for i in 0..200 {
        let length = 1 + random.below(300) as usize;
        let mut bytes: Vec<u8> = (0..length).map(|_| random.below(256) as u8).collect();
        bytes.extend_from_slice(b"\r\n\r\n");
        if i % 2 == 0 {
            bytes.splice(0..0, *b"GET /");
        }
        let answer = served.raw(&bytes);
        assert!(answer.is_empty() || answer.starts_with(b"HTTP/1.1 4"), "{:?}", String::from_utf8_lossy(&answer));
    }
    assert_eq!(served.get("/api/0/scene").status, 200);
    assert!(served.lines().is_empty());
}

#[test]
fn long_addresses_and_heads_are_refused() {
    let served = serve(&[&fixture("potree2/default")]);
    let long = "a".repeat(100_000);
    for target in [format!("/{long}"), format!("/data/0/{long}"), format!("/api/0/points?units={long}")] {
        let answer = served.get(&target);
        assert!((400..500).contains(&answer.status), "{}", answer.status);
    }
    // several times what the server keeps of a head: no read, however much it brings at once, has the end of it
    let answer = served.request("GET", "/", &format!("X: {}\r\n", long.repeat(30)));
    assert_eq!(answer.status, 431);
    let units = vec!["r"; 300].join(",");
    let (status, line) = served.refused(&format!("/api/0/points?units={units}"));
    assert_eq!((status, &*line), (400, "units: at most 256 per request"));
    let repeated = vec!["r"; 256].join(",");
    served.bytes(&format!("/api/0/points?units={repeated}"));
}

#[test]
fn bodies_are_not_read() {
    let served = serve(&[&fixture("potree2/default")]);
    let request = b"GET /api/0/scene HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\nabc";
    let mut stream = served.connect();
    stream.write_all(request).unwrap();
    let mut start = [0; 12];
    stream.read_exact(&mut start).unwrap();
    assert_eq!(&start, b"HTTP/1.1 200");
}

#[test]
fn half_requests_keep_nobody_waiting() {
    let served = serve(&[&fixture("potree2/default")]);
    let half: Vec<TcpStream> = (0..200)
        .map(|_| {
            let mut stream = served.connect();
            stream.write_all(b"GET /api/0/scene HTTP/1.1\r\nHo").unwrap();
            stream
        })
        .collect();
    let begin = Instant::now();
    assert_eq!(served.get("/api/0/scene").status, 200);
    assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", begin.elapsed());
    drop(half);
}

#[test]
fn two_thousand_connections_at_once_are_all_answered() {
    let served = serve(&[&fixture("potree2/default")]);
    crowd(&served, 2000);
}

#[test]
#[ignore = "long; needs 20,000 open files"]
fn ten_thousand_connections_at_once_are_all_answered() {
    let served = serve(&[&fixture("potree2/default")]);
    crowd(&served, 10_000);
}

/// All are connected before the first is read.
fn crowd(served: &super::client::Served, count: usize) {
    let request = b"GET /api/0/points?units=r HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    let mut streams = Vec::new();
    for _ in 0..count {
        // the system may have no more files
        match TcpStream::connect_timeout(&served.address, Duration::from_secs(30)) {
            Ok(mut stream) => {
                stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
                stream.write_all(request).unwrap();
                streams.push(stream);
            }
            Err(_) => {
                // the server is in this process, and needs some of the files
                streams.truncate(streams.len().saturating_sub(300));
                break;
            }
        }
    }
    let connected = streams.len();
    assert!(connected >= 500, "{connected} of {count} connected");
    for mut stream in streams {
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        assert_eq!(Answer::parse(&bytes).status, 200);
    }
    assert_eq!(served.get("/api/0/scene").status, 200);
    assert!(served.lines().is_empty(), "{:?}", served.lines());
}
