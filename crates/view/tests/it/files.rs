//! Raw files: ranges, types, and no way out of the dataset.

use std::fs;

use pointmill_testkit::files::{fixture, fixture_bytes};

use super::client::{Answer, serve};

#[test]
fn a_file_is_served_whole_or_by_ranges() {
    let served = serve(&[&fixture("potree2/default")]);
    let file = fixture_bytes("potree2/default/octree.bin");
    let range = |range: &str| served.request("GET", "/data/0/octree.bin", &format!("Range: {range}\r\n"));
    let whole = served.get("/data/0/octree.bin");
    assert_eq!((whole.status, &whole.body), (200, &file));
    assert_eq!(whole.header("accept-ranges"), Some("bytes"));
    assert_eq!(whole.header("content-type"), Some("application/octet-stream"));
    let len = file.len();
    for (asked, from, to) in
        [("bytes=0-9", 0, 10), ("bytes=100-", 100, len), ("bytes=-7", len - 7, len), ("bytes=5-99999999", 5, len)]
    {
        let part = range(asked);
        assert_eq!((part.status, &part.body[..]), (206, &file[from..to]), "{asked}");
        assert_eq!(part.header("content-range"), Some(&*format!("bytes {from}-{}/{len}", to - 1)), "{asked}");
    }
    for absurd in [
        "bytes=99999-",
        "bytes=9-1",
        "bytes=99999999999999999999999-",
        "bytes=a-b",
        "bytes=",
        "bytes=-0",
        "bytes=0-1,4-5",
    ] {
        let answer = range(absurd);
        assert!(matches!(answer.status, 200 | 416), "{absurd}: {}", answer.status);
        assert!(answer.status == 416 || answer.body == file, "{absurd}");
    }
    let head = served.request("HEAD", "/data/0/octree.bin", "");
    assert_eq!((head.status, head.body.len(), head.header("content-length")), (200, 0, Some(&*len.to_string())));
    let json = served.get("/data/0/metadata.json");
    assert_eq!(json.header("content-type"), Some("application/json"));
    assert_eq!(json.header("cache-control"), Some("no-cache"));
    assert_eq!(json.header("access-control-allow-origin"), None, "pages of the web read nothing");
}

#[test]
fn a_dataset_of_one_file_has_no_other() {
    let served = serve(&[&fixture("copc/format6.copc.laz"), &fixture("batches/example.qbatch")]);
    assert_eq!(served.bytes("/data/0/format6.copc.laz"), fixture_bytes("copc/format6.copc.laz"));
    assert_eq!(served.bytes("/data/1/example.qbatch"), fixture_bytes("batches/example.qbatch"));
    assert_eq!(served.json("/api/1/scene")["file"], "example.qbatch");
    for other in
        ["/data/0/format8.copc.laz", "/data/0/", "/data/0", "/data/0/format6.copc.laz/", "/data/2/example.qbatch"]
    {
        assert_eq!(served.refused(other).0, 404, "{other}");
    }
}

#[test]
fn nothing_leads_out_of_the_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("data set");
    fs::create_dir_all(dataset.join("sub/.hidden")).unwrap();
    for file in ["metadata.json", "hierarchy.bin", "octree.bin"] {
        fs::copy(fixture("potree2/default").join(file), dataset.join(file)).unwrap();
    }
    for secret in ["secret", "data set/.secret", "data set/sub/.hidden/file"] {
        fs::write(folder.path().join(secret), "secret").unwrap();
    }
    fs::write(dataset.join("sub/ü %.txt"), "open").unwrap();
    let served = serve(&[&dataset]);
    assert_eq!(served.bytes("/data/0/sub/%C3%BC%20%25.txt"), b"open");
    let root = folder.path().display();
    let mut bad: Vec<String> = [
        "../secret",
        "%2e%2e/secret",
        "..%2fsecret",
        "%2e%2e%2fsecret",
        "sub/../../secret",
        "sub/..%5c..%5csecret",
        ".secret",
        "%2esecret",
        "sub/.hidden/file",
        "sub",
        "sub/",
        "",
        ".",
        "//secret",
        "sub//%C3%BC%20%25.txt",
        "octree.bin%00",
        "octree.bin/",
        "%252e%252e/secret",
        "metadata.json%2f..%2foctree.bin",
        "%ff",
    ]
    .iter()
    .map(|path| format!("/data/0/{path}"))
    .collect();
    bad.extend([format!("/data/0/{root}/secret"), format!("/data/0//{root}/secret"), "/../secret".to_owned()]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder.path().join("secret"), dataset.join("link")).unwrap();
        std::os::unix::fs::symlink(folder.path(), dataset.join("up")).unwrap();
        std::os::unix::fs::symlink(dataset.join("octree.bin"), dataset.join("inside")).unwrap();
        bad.extend(["/data/0/link", "/data/0/up/secret", "/data/0/up/data%20set/.secret"].map(str::to_owned));
        assert_eq!(served.bytes("/data/0/inside"), fixture_bytes("potree2/default/octree.bin"));
    }
    for target in bad {
        let answer = served.get(&target);
        assert_eq!(answer.status, 404, "{target}: {}", String::from_utf8_lossy(&answer.body));
        answer.refusal();
    }
    assert!(served.lines().is_empty(), "{:?}", served.lines());
}

#[test]
fn the_page_is_served_with_the_datasets() {
    let served = serve(&[&fixture("potree2/default"), &fixture("bintree/files")]);
    let page = served.get("/");
    assert_eq!(page.header("content-type"), Some("text/html; charset=utf-8"));
    let policy = page.header("content-security-policy").unwrap();
    assert!(policy.contains("frame-ancestors 'none'") && policy.contains("connect-src 'self'"), "{policy}");
    let text = String::from_utf8(page.body).unwrap();
    assert!(text.contains(r#""scenes":["api/0","api/1"]"#) && text.contains(pointmill_view::GENERATOR), "{text}");
    assert_eq!(served.get("/favicon.ico").status, 204);
    assert_eq!(served.refused("/index.html").0, 404);
}

#[test]
fn other_hosts_and_other_methods_are_refused() {
    let served = serve(&[&fixture("potree2/default")]);
    for head in ["Host: evil.example", "Host: evil.example\r\nHost: localhost", "X: y"] {
        let request = format!("GET /api/0/scene HTTP/1.1\r\n{head}\r\nConnection: close\r\n\r\n");
        assert_eq!(Answer::parse(&served.raw(request.as_bytes())).refusal().0, 403, "{head}");
    }
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "PATCH", "BREW"] {
        for (target, allowed) in [("/", "GET, HEAD"), ("/api/0/scene", "GET")] {
            let answer = served.request(method, target, "");
            assert_eq!((answer.status, answer.header("allow")), (405, Some(allowed)), "{method} {target}");
        }
    }
    assert_eq!(served.request("HEAD", "/", "").status, 200);
    assert_eq!(served.request("HEAD", "/api/0/points?units=r", "").status, 405, "nothing is decoded for a head");
}
