//! Datasets and scans in the browser, and pages beside datasets.

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, ChildStdout, Stdio};
use std::time::{Duration, SystemTime};

#[cfg(unix)]
use nix::sys::signal::Signal;
use pointmill_testkit::files::fixture;
use pointmill_testkit::las::Las;
use serde_json::Value;

#[cfg(unix)]
use crate::signals::send;
use crate::support::Dir;

/// The program while it serves; killed if it was not stopped.
struct Serving {
    child: Child,
    /// What follows the first line.
    out: BufReader<ChildStdout>,
    /// `http://127.0.0.1:1234/`
    url: String,
}

impl Serving {
    fn start(dir: &Dir, args: &[&str]) -> Self {
        let args = ["view", "--no-open"].iter().chain(args);
        let mut command = dir.command(args);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut url = String::new();
        out.read_line(&mut url).unwrap();
        if url.is_empty() {
            panic!("{}", String::from_utf8_lossy(&child.wait_with_output().unwrap().stderr));
        }
        Self { child, out, url: url.trim_end().to_owned() }
    }

    /// The body of a successful answer.
    fn get(&self, target: &str) -> Vec<u8> {
        let address = self.url.strip_prefix("http://").unwrap().trim_end_matches('/');
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let request = format!("GET {target} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
        assert!(bytes.starts_with(b"HTTP/1.1 200"), "{target}: {}", String::from_utf8_lossy(&bytes));
        bytes.split_off(end + 4)
    }

    fn scene(&self, number: usize) -> Value {
        serde_json::from_slice(&self.get(&format!("/api/{number}/scene"))).unwrap()
    }

    /// Ends it as Ctrl-C does; exit code and lines on standard error.
    #[cfg(unix)]
    fn interrupt(mut self) -> (Option<i32>, String) {
        send(&self.child, Signal::SIGINT);
        let mut lines = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut lines).unwrap();
        (self.child.wait().unwrap().code(), lines)
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(unix)]
#[test]
fn datasets_are_served_until_ctrl_c() {
    let dir = Dir::new();
    let (octree, batches) = (fixture("potree2/default"), fixture("batches/example.qbatch"));
    let serving = Serving::start(&dir, &[octree.to_str().unwrap(), batches.to_str().unwrap()]);
    assert!(serving.url.starts_with("http://127.0.0.1:"), "{}", serving.url);
    let page = String::from_utf8(serving.get("/")).unwrap();
    assert!(page.contains(r#""scenes":["api/0","api/1"]"#));
    assert_eq!((&serving.scene(0)["kind"], &serving.scene(1)["kind"]), (&"octree".into(), &"batches".into()));
    assert_eq!(serving.get("/data/0/octree.bin"), fs::read(octree.join("octree.bin")).unwrap());
    let (code, lines) = serving.interrupt();
    assert_eq!(code, Some(130), "{lines}");
    assert!(lines.ends_with("pointmill: interrupted; the server has stopped\n"), "{lines}");
    assert!(dir.names().is_empty());
}

#[cfg(unix)]
#[test]
fn a_scan_becomes_a_temporary_dataset() {
    let dir = Dir::new();
    dir.write("scans/a.las", &Las::terrain(3000, 1).bytes());
    fs::create_dir(dir.path("temp")).unwrap();
    let serving = Serving::start(&dir, &["scans/a.las", "--temp-dir", "temp", "--threads", "1"]);
    let scene = serving.scene(0);
    assert_eq!((&scene["points"], &scene["name"]), (&3000.into(), &"a".into()));
    assert_eq!(fs::read_dir(dir.path("temp")).unwrap().count(), 1);
    let (code, lines) = serving.interrupt();
    assert_eq!(code, Some(130), "{lines}");
    assert_eq!(fs::read_dir(dir.path("temp")).unwrap().count(), 0, "{lines}");
    assert_eq!(fs::read_dir(dir.path("scans")).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn a_conversion_that_is_interrupted_leaves_nothing() {
    let dir = Dir::new();
    dir.write("big.las", &Las::terrain(1_500_000, 2).bytes());
    fs::create_dir(dir.path("temp")).unwrap();
    let args = ["view", "big.las", "--no-open", "--temp-dir", "temp", "--progress", "json", "--threads", "1"];
    let mut child = dir.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.by_ref().any(|line| line.contains("\"build\"")), "it never builds");
    send(&child, Signal::SIGINT);
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert!(rest.last().unwrap().starts_with("pointmill: interrupted"), "{rest:?}");
    assert_eq!(fs::read_dir(dir.path("temp")).unwrap().count(), 0, "{rest:?}");
}

#[test]
fn a_dataset_that_is_kept_is_used_again() {
    let dir = Dir::new();
    let scan = dir.write("a.las", &Las::terrain(3000, 1).bytes());
    let made = |path: &Path| fs::metadata(path).unwrap().modified().unwrap();
    let metadata = dir.path("a.las.pointmill/metadata.json");
    assert_eq!(Serving::start(&dir, &["a.las", "--keep"]).scene(0)["points"], 3000);
    assert_eq!(dir.names(), ["a.las", "a.las.pointmill"]);
    let first = made(&metadata);
    assert_eq!(Serving::start(&dir, &["a.las", "--keep"]).scene(0)["points"], 3000);
    assert_eq!(made(&metadata), first);
    // a scan that is newer is converted again
    fs::write(&scan, Las::terrain(2000, 1).bytes()).unwrap();
    fs::File::options()
        .write(true)
        .open(&scan)
        .unwrap()
        .set_modified(SystemTime::now() + Duration::from_secs(9))
        .unwrap();
    assert_eq!(Serving::start(&dir, &["a.las", "--keep"]).scene(0)["points"], 2000);
    // what was made of others, or by others, is left alone
    dir.write("b.las", &Las::terrain(10, 1).bytes());
    fs::rename(dir.path("a.las.pointmill"), dir.path("b.las.pointmill")).unwrap();
    let line = ["b.las.pointmill", "not made of these scans", "--keep"];
    dir.run(["view", "b.las", "--keep", "--no-open"]).failed_with(2, &line);
    fs::remove_dir_all(dir.path("b.las.pointmill")).unwrap();
    dir.write("b.las.pointmill/diary", b"dear");
    dir.run(["view", "b.las", "--keep", "--no-open"]).failed_with(2, &line);
    assert_eq!(fs::read(dir.path("b.las.pointmill/diary")).unwrap(), b"dear");
}

#[test]
fn a_port_that_is_in_use_is_named() {
    let dir = Dir::new();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let dataset = fixture("bintree/files");
    let args = ["view", dataset.to_str().unwrap(), "--no-open", "--port", &port];
    dir.run(args).failed_with(5, &[&port, "in use", "--port"]);
}

#[test]
fn what_cannot_be_shown_is_one_line() {
    let dir = Dir::new();
    dir.write("letter.las", b"dear");
    dir.write("cut/metadata.json", b"{\"version\": \"2.0\",");
    dir.write("a.las", &Las::terrain(10, 1).bytes());
    dir.succeed(["convert", "a.las", "-o", "two", "-q", "--to", "bintree", "--to", "batches"]);
    let before = dir.names();
    let table: [(&[&str], i32, &[&str]); 8] = [
        (&[], 2, &["no input"]),
        (&["nothing"], 2, &["nothing"]),
        (&["letter.las"], 3, &["letter.las"]),
        (&["cut"], 3, &["metadata.json"]),
        (&["two"], 2, &["several datasets", "two/bintree"]),
        (&["two/bintree", "--keep"], 2, &["--keep"]),
        (&["a.las", "--temp-dir", "nowhere"], 2, &["nowhere", "--temp-dir"]),
        (&["a.las", "--port", "0"], 2, &["--port"]),
    ];
    for (args, code, words) in table {
        dir.run(["view", "--no-open"].iter().chain(args)).failed_with(code, words);
        assert_eq!(dir.names(), before, "{args:?}");
    }
}

#[test]
fn the_address_is_printed_as_json_too() {
    let dir = Dir::new();
    let dataset = fixture("copc/format6.copc.laz");
    let mut serving = Serving::start(&dir, &[dataset.to_str().unwrap(), "--json", "-q"]);
    assert_eq!(serving.url, "{", "one object");
    let mut text = "{".to_owned();
    let mut lines = serving.out.by_ref().lines().map(Result::unwrap);
    while serde_json::from_str::<Value>(&text).is_err() {
        text += &lines.next().unwrap_or_else(|| panic!("{text}"));
    }
    let object: Value = serde_json::from_str(&text).unwrap();
    assert!(object["url"].as_str().unwrap().starts_with("http://127.0.0.1:"), "{text}");
    assert!(object["datasets"][0].as_str().unwrap().ends_with("format6.copc.laz"), "{text}");
}

#[test]
fn a_page_is_written_beside_the_dataset() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(1000, 1).bytes());
    for kind in ["potree2", "potree1", "bintree", "batches"] {
        let out = format!("{kind} 1.0");
        dir.succeed(["convert", "a.las", "-o", &out, "--to", kind, "--page", "-q"]);
        let page = fs::read_to_string(dir.path(&format!("{out}.html"))).unwrap();
        let config = page.split("id=\"config\">").nth(1).unwrap().split("</script>").next().unwrap();
        let config: Value = serde_json::from_str(config).unwrap();
        let scene = serde_json::json!({ "kind": kind, "name": "a", "url": format!("{kind}%201.0/") });
        assert_eq!((&config["mode"], &config["scenes"][0]), (&"static".into(), &scene), "{config}");
    }
    let before = dir.names();
    dir.run(["convert", "a.las", "-o", "potree2 1.0", "--page"]).failed_with(2, &["exists"]);
    dir.succeed(["convert", "a.las", "-o", "potree2 1.0", "--page", "--overwrite", "-q"]);
    assert_eq!(dir.names(), before);
}

#[test]
fn a_page_replaces_no_file_of_others_and_is_for_what_it_can_show() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(1000, 1).bytes());
    dir.write("out.html", b"<html>mine</html>");
    let before = dir.names();
    let table: [(&[&str], i32, &[&str]); 6] = [
        (&["--page"], 2, &["out.html", "no page of pointmill"]),
        (&["--page", "--overwrite"], 2, &["out.html", "no page of pointmill"]),
        (&["--page", "--to", "copc"], 4, &["COPC", "pointmill view"]),
        (&["--page", "--to", "batches", "--compress", "zstd"], 4, &["compressed", "pointmill view"]),
        (&["--page", "--to", "potree1", "--archive"], 4, &["archive", "pointmill view"]),
        (&["--page", "--to", "bintree", "--to", "batches"], 2, &["one format"]),
    ];
    for (args, code, words) in table {
        dir.run(["convert", "a.las", "-o", "out"].iter().chain(args)).failed_with(code, words);
        assert_eq!(dir.names(), before, "{args:?}");
    }
    assert_eq!(fs::read(dir.path("out.html")).unwrap(), b"<html>mine</html>");
}
