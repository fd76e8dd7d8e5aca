//! Mistakes over all commands and options: each is one line that names what is wrong and what to do, in words for people,
//! with the right exit code, and leaves nothing behind.

use std::fs;

use pointmill_testkit::las::Las;

use crate::support::{Dir, Ended};

/// Command line (separated by `~`), exit code, and what the line must say.
type Mistake = (&'static str, i32, &'static [&'static str]);

/// Words of programmers, of the libraries below, and of the parser of the command line.
const FORBIDDEN: [&str; 22] = [
    "os error",
    "target type",
    "invalid digit",
    "non-zero type",
    "Some(",
    "None",
    "Ok(",
    "Err(",
    "panicked",
    "unwrap",
    "at line",
    "expected struct",
    "usize",
    "u16",
    "u64",
    "i64",
    "f64",
    "UTF-8 sequence",
    "StorageFull",
    "Os {",
    "Pattern syntax",
    "ceiling of 0",
];

/// A folder with good and bad inputs, and datasets.
fn folder() -> Dir {
    let dir = Dir::new();
    let las = Las::terrain(200, 1).bytes();
    dir.write("a.las", &las);
    dir.write("cut.las", &las[..300]);
    dir.write("header.las", &las[..100]);
    dir.write("empty.las", b"");
    let mut absurd = las;
    absurd[147..155].copy_from_slice(&5e-310f64.to_le_bytes());
    dir.write("absurd.las", &absurd);
    dir.write("b.xyz", b"1 2 3 4\n2 3 4 5\n3 4 5 6\n");
    dir.write("comma.xyz", b"1,234 5,678 87\n1,500 2,500 88\n");
    dir.write("notes.txt", b"hello\n");
    dir.write("page.las", b"<html>not found</html>");
    dir.write("a.zip", b"PK\x03\x04 and more");
    dir.write("broken.ply", b"ply\nformat ascii 1.0\n");
    dir.write("broken.pcd", b"# .PCD\nVERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE Q F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2 3\n");
    dir.write("list", b"nowhere.las\n");
    dir.write("nul", b"a.las\0b.xyz\0");
    dir.write("matrix.txt", b"1 2 x\n");
    dir.write("home/letter.txt", b"dear\n");
    fs::create_dir(dir.path("hollow")).unwrap();
    dir.succeed(["convert", "a.las", "-o", "ds", "-q"]);
    dir.succeed(["convert", "a.las", "-o", "two", "-q", "--to", "bintree", "--to", "batches"]);
    for (name, file, bytes) in [
        ("syntax", "metadata.json", &b"{\"version\": \"2.0\",\n x}"[..]),
        ("hole", "octree.bin", b""),
        ("tree", "index.json", b"{\"version\": 1"),
    ] {
        let from = if name == "tree" { "two/bintree" } else { "ds" };
        fs::create_dir(dir.path(name)).unwrap();
        for entry in fs::read_dir(dir.path(from)).unwrap().flatten().filter(|e| e.path().is_file()) {
            fs::copy(entry.path(), dir.path(name).join(entry.file_name())).unwrap();
        }
        dir.write(&format!("{name}/{file}"), bytes);
    }
    fs::create_dir(dir.path("lost")).unwrap();
    fs::copy(dir.path("ds/metadata.json"), dir.path("lost/metadata.json")).unwrap();
    dir
}

/// That the run failed as it must: one line, this code, these words and no others of a kind.
fn check(arguments: &str, ended: &Ended, code: i32, words: &[&str]) {
    let stderr = ended.stderr();
    assert_eq!(ended.code(), code, "{arguments}: {stderr}");
    assert_eq!(stderr.lines().count(), 1, "{arguments}: {stderr}");
    assert!(stderr.starts_with("error: ") && stderr.ends_with('\n'), "{arguments}: {stderr}");
    let odd = |c: char| c != '\n' && (c.is_control() || "\u{202e}\u{2066}\u{2028}\u{200b}".contains(c));
    assert!(!stderr.contains(odd), "{arguments}: {stderr:?}");
    assert!(stderr.len() < 700, "{arguments}: {stderr}");
    for word in FORBIDDEN {
        assert!(!stderr.contains(word), "{arguments}: `{word}` is no word for users: {stderr}");
    }
    for word in words {
        assert!(stderr.contains(word), "{arguments}: `{word}` is not in: {stderr}");
    }
}

fn check_all(table: &[Mistake]) {
    let dir = folder();
    let before = dir.names();
    for (arguments, code, words) in table {
        let typed: Vec<&str> = if arguments.is_empty() { Vec::new() } else { arguments.split('~').collect() };
        check(arguments, &dir.run(&typed), *code, words);
        assert_eq!(dir.names(), before, "{arguments}");
    }
}

#[test]
fn commands_and_options_that_are_none() {
    check_all(&[
        (
            "",
            2,
            &[
                "no command",
                "convert, job, export, measure, validate, extract, info, preview, view, completions, man",
                "see 'pointmill --help'",
            ],
        ),
        ("convrt", 2, &["'convrt'", "did you mean convert?"]),
        ("bogus", 2, &["no command 'bogus'", "convert, job, export, measure, validate"]),
        ("--bogus", 2, &["no option --bogus", "pointmill --help"]),
        ("help~bogus", 2, &["'bogus'"]),
        ("convert", 2, &["--output OUT is missing", "see 'pointmill convert --help'"]),
        ("convert~a.las", 2, &["--output OUT is missing"]),
        ("convert~a.las~-o", 2, &["--output needs a value"]),
        ("convert~a.las~-o~", 2, &["--output needs a value"]),
        ("convert~~-o~o", 2, &["INPUT needs a value"]),
        ("convert~-o~o", 2, &["no input", "--files-from"]),
        ("convert~a.las~-o~o~--memry~2G", 2, &["no option --memry", "did you mean --memory?"]),
        ("convert~a.las~-o~o~-x", 2, &["no option -x"]),
        ("convert~a.las~-o~o~--quality~5", 2, &["no option --quality"]),
        ("convert~a.las~-o~o~-v~-q", 2, &["--verbose and --quiet exclude each other"]),
        ("convert~a.las~-o~o~-o~p", 2, &["--output is given twice"]),
        ("convert~a.las~-o~o~--dry-run~--dry-run", 2, &["--dry-run is given twice"]),
        ("convert~a.las~-o~o~--json=yes", 2, &["--json takes no value"]),
        ("validate", 2, &["DATASET is missing", "pointmill validate --help"]),
        ("validate~ds~ds", 2, &["'ds' is one argument too many"]),
        ("validate~ds~--against", 2, &["--against needs a value"]),
        ("validate~ds~--bogus", 2, &["no option --bogus"]),
        ("info", 2, &["PATH... is missing", "pointmill info --help"]),
        ("info~a.las~--depp", 2, &["no option --depp", "did you mean --deep?"]),
        ("extract", 2, &["--output DIR and SCAN are missing"]),
        ("extract~a.las", 2, &["--output DIR is missing"]),
        ("extract~a.las~-o~ex~--unreadable~maybe", 2, &["--unreadable 'maybe'", "skip, fail"]),
    ]);
}

#[test]
fn values_that_are_none() {
    check_all(&[
        (
            "convert~a.las~-o~o~--to~potree",
            2,
            &["--to 'potree'", "potree2, potree1, copc, bintree, batches", "did you mean potree2?"],
        ),
        ("convert~a.las~-o~o~--to~obj", 2, &["--to 'obj'", "expected one of potree2, potree1, copc, bintree, batches"]),
        ("convert~a.las~-o~o~--to~potree2~--to~potree2", 2, &["--to", "named twice"]),
        ("convert~a.las~-o~o~--memory~some", 2, &["--memory 'some'", "2GiB"]),
        ("convert~a.las~-o~o~--memory~0", 2, &["--memory '0'", "2GiB"]),
        ("convert~a.las~-o~o~--memory~-5", 2, &["--memory '-5'", "2GiB"]),
        ("convert~a.las~-o~o~--memory~1e3", 2, &["--memory '1e3'"]),
        ("convert~a.las~-o~o~--memory~9999999999TiB", 2, &["--memory"]),
        ("convert~a.las~-o~o~--memory~2", 6, &["2 bytes", "--memory"]),
        ("convert~a.las~-o~o~--threads~1000~--memory~300MiB", 6, &["300 MiB", "or fewer --threads"]),
        ("convert~a.las~-o~o~--memory~1MB", 6, &["976 KiB", "--memory"]),
        ("convert~a.las~-o~o~--threads~0", 2, &["--threads '0'", "from 1 to 1024"]),
        ("convert~a.las~-o~o~--threads~60000", 2, &["--threads '60000'", "from 1 to 1024"]),
        ("convert~a.las~-o~o~--threads~70000", 2, &["from 1 to 1024"]),
        ("convert~a.las~-o~o~--threads~x", 2, &["--threads 'x'"]),
        ("convert~a.las~-o~o~--threads~-1", 2, &["--threads '-1'"]),
        ("convert~a.las~-o~o~--every~0", 2, &["--every '0'", "from 1 on"]),
        ("convert~a.las~-o~o~--every~-1", 2, &["--every '-1'"]),
        ("convert~a.las~-o~o~--every~99999999999999999999999", 2, &["--every '999"]),
        ("convert~a.las~-o~o~--sampling~random~--seed~99999999999999999999999", 2, &["--seed '999"]),
        ("convert~a.las~-o~o~--class~x", 2, &["--class 'x'", "such as 2,6"]),
        ("convert~a.las~-o~o~--class~2,,6", 2, &["--class"]),
        ("convert~a.las~-o~o~--class~99999999999999999999", 2, &["--class"]),
        ("convert~a.las~-o~o~--class~77", 3, &["no points left", "200 of other classes"]),
        ("convert~a.las~-o~o~--spacing~0", 2, &["--spacing '0'"]),
        ("convert~a.las~-o~o~--spacing~-1", 2, &["--spacing '-1'"]),
        ("convert~a.las~-o~o~--spacing~inf", 2, &["--spacing 'inf'"]),
        ("convert~a.las~-o~o~--spacing~1000", 2, &["--spacing", "must be between", "for this scene"]),
        ("convert~a.las~-o~o~--leaf-capacity~0", 2, &["--leaf-capacity '0'", "from 1 to 1000000"]),
        ("convert~a.las~-o~o~--leaf-capacity~99999999999", 2, &["from 1 to 1000000"]),
        ("convert~a.las~-o~o~--to~bintree~--capacity~99999999999", 2, &["--capacity", "from 1 to 4294967295"]),
        ("convert~a.las~-o~o~--to~bintree~--split~half", 2, &["--split 'half'", "mean, median, midpoint"]),
        ("convert~a.las~-o~o~--to~bintree~--layout~tar", 2, &["--layout 'tar'", "files, packed"]),
        ("convert~a.las~-o~o~--encoding~brotli~--brotli-quality~12", 2, &["--brotli-quality '12'", "from 0 to 11"]),
        ("convert~a.las~-o~o~--encoding~zip", 2, &["--encoding 'zip'", "default, brotli"]),
        ("convert~a.las~-o~o~--sampling~best", 2, &["--sampling 'best'", "poisson, grid, random"]),
        ("convert~a.las~-o~o~--bounds~1", 2, &["--bounds '1'", "xmin,ymin,zmin..xmax,ymax,zmax"]),
        ("convert~a.las~-o~o~--bounds~5,0,0..1,1,1", 2, &["--bounds", "the box is empty"]),
        ("convert~a.las~-o~o~--bounds~nan,0,0..1,1,1", 2, &["--bounds", "two corners"]),
        ("convert~a.las~-o~o~--bounds~0,0,0..1,1,1", 3, &["no points left", "outside the bounds"]),
        ("convert~a.las~-o~o~--scale~0", 2, &["--scale '0'", "a number above 0"]),
        ("convert~a.las~-o~o~--scale~-0.1", 2, &["--scale '-0.1'"]),
        ("convert~a.las~-o~o~--scale~nan", 2, &["--scale 'nan'"]),
        ("convert~a.las~-o~o~--scale~5e-310", 2, &["--scale '5e-310'", "1e-15"]),
        ("convert~a.las~-o~o~--scale~1e300", 2, &["--scale '1e300'"]),
        ("convert~a.las~-o~o~--attributes~", 2, &["--attributes ''", "intensity,rgb"]),
        ("convert~a.las~-o~o~--attributes~rgb,,intensity", 2, &["--attributes", "no name"]),
        ("convert~a.las~-o~o~--attributes~colour", 2, &["--attributes", "\"colour\"", "the inputs have", "intensity"]),
        ("convert~a.las~-o~o~--duplicates~some", 2, &["--duplicates 'some'", "keep, drop"]),
        ("convert~a.las~-o~o~--rgb-depth~12", 2, &["--rgb-depth '12'", "auto, 8, 16"]),
        ("convert~a.las~-o~o~--checkpoint~0", 2, &["--checkpoint '0'", "auto, always, never, or a number of points"]),
        ("convert~a.las~-o~o~--verify=all", 2, &["--verify 'all'", "dataset, scans"]),
        ("convert~a.las~-o~o~--progress~dots", 2, &["--progress 'dots'", "auto, bar, json, none"]),
        ("convert~a.las~-o~o~--to~batches~--planes~15", 2, &["--planes '15'", "10, 20, 30 or auto"]),
        ("convert~a.las~-o~o~--to~batches~--lod-cell~0", 2, &["--lod-cell '0'"]),
        ("convert~a.las~-o~o~--to~batches~--compress~zip", 2, &["--compress 'zip'", "zstd"]),
        ("convert~a.las~-o~o~--to~batches~--compress~zstd:99", 2, &["--compress 'zstd:99'", "1 to 19"]),
        ("validate~ds~--threads~60000", 2, &["--threads '60000'", "from 1 to 1024"]),
    ]);
}

#[test]
fn options_that_nothing_would_follow() {
    check_all(&[
        ("convert~a.las~-o~o~--seed~1", 2, &["--seed requires --sampling random"]),
        ("convert~a.las~-o~o~--sampling~grid~--seed~1", 2, &["--seed requires --sampling random"]),
        ("convert~a.las~-o~o~--brotli-quality~5", 2, &["--brotli-quality requires --encoding brotli"]),
        ("convert~a.las~-o~o~--compress~zstd", 2, &["--compress requires --to batches"]),
        ("convert~a.las~-o~o~--capacity~9", 2, &["--capacity requires --to bintree"]),
        ("convert~a.las~-o~o~--to~batches~--sampling~grid", 2, &["--sampling requires --to potree2"]),
        ("convert~a.las~-o~o~--to~bintree~--leaf-capacity~5", 2, &["--leaf-capacity requires --to potree2"]),
        ("convert~a.las~-o~o~--to~batches~--encoding~brotli", 2, &["--encoding requires --to potree2"]),
        ("convert~a.las~-o~o~--to~bintree~--planes~10", 2, &["--planes requires --to batches"]),
        ("convert~a.las~-o~o~--columns~x,y,z", 2, &["--columns", "no input is a text scan"]),
        ("convert~a.las~-o~o~--separator~;", 2, &["--separator", "no input is a text scan"]),
        ("info~a.las~--decimal~comma", 2, &["--decimal", "no input is a text scan"]),
        ("convert~a.las~-o~o~--scan~5", 2, &["--scan 5", "E57"]),
        ("convert~a.las~-o~o~--scan~", 2, &["--scan needs a value"]),
        ("validate~ds~--crs~EPSG:25832", 2, &["--crs requires --units or --reproject"]),
        ("validate~ds~--separator~;", 2, &["--separator requires --against"]),
        ("validate~ds~--units~ft", 2, &["--units requires --against"]),
        ("info~a.las~--crs~EPSG:25832", 2, &["--crs requires --units or --reproject"]),
    ]);
}

#[test]
fn systems_and_places_that_are_none() {
    check_all(&[
        ("convert~a.las~-o~o~--crs~EPSG:999999", 2, &["--crs: EPSG:999999 is not known", "+proj="]),
        ("convert~a.las~-o~o~--crs~EPSG:25832+99999", 2, &["--crs: EPSG:99999 is not known"]),
        ("convert~a.las~-o~o~--crs~EPSG:", 2, &["--crs", "EPSG:n"]),
        ("convert~a.las~-o~o~--crs~nonsense", 2, &["--crs", "\"nonsense\" is not EPSG:n"]),
        ("convert~a.las~-o~o~--crs~", 2, &["--crs"]),
        ("convert~a.las~-o~o~--crs~+proj=nope", 2, &["--crs", "projection nope"]),
        ("convert~a.las~-o~o~--crs~+proj=utm +zone=99", 2, &["--crs", "zone 99"]),
        ("convert~a.las~-o~o~--crs~+proj=tmerc +lon_0=x", 2, &["--crs", "lon_0 x"]),
        ("convert~a.las~-o~o~--crs~PROJCS[\"x", 2, &["--crs", "brackets"]),
        ("convert~a.las~-o~o~--crs~PROJCS[\"x\",GEOGCS[\"y\"]]]", 2, &["--crs", "after its last bracket"]),
        ("convert~a.las~-o~o~--crs~PROJCS[x,y]", 2, &["--crs", "no name in quotes"]),
        ("convert~a.las~-o~o~--crs~+init=epsg:999999", 2, &["--crs: EPSG:999999 is not known"]),
        ("convert~a.las~-o~o~--reproject~EPSG:999999", 2, &["--reproject: EPSG:999999 is not known"]),
        ("convert~a.las~-o~o~--reproject~nonsense", 2, &["--reproject", "nonsense"]),
        ("convert~a.las~-o~o~--reproject~EPSG:25832", 4, &["a.las", "--crs"]),
        ("convert~a.las~-o~o~--units~parsec", 2, &["--units 'parsec'", "mm, cm, m, ft, us-ft"]),
        ("convert~a.las~-o~o~--axes~z-up", 2, &["--axes 'z-up'", "y-up"]),
        ("convert~a.las~-o~o~--transform~1 2 3", 2, &["--transform", "3 numbers", "16"]),
        ("convert~a.las~-o~o~--transform~nowhere", 2, &["--transform", "nowhere", "16 numbers"]),
        ("convert~a.las~-o~o~--transform~matrix.txt", 2, &["--transform", "matrix.txt", "more than numbers"]),
        ("convert~a.las~-o~o~--transform~1 0 0 1e300 0 1 0 0 0 0 1 0 0 0 0 1", 2, &["--transform", "1e300"]),
        ("convert~a.las~-o~o~--transform~0 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", 2, &["--transform", "singular"]),
    ]);
}

#[test]
fn inputs_that_cannot_be_read() {
    check_all(&[
        ("convert~nowhere.las~-o~o", 2, &["nowhere.las: no such file or folder"]),
        ("convert~*.zzz~-o~o", 2, &["*.zzz: no file matches"]),
        ("convert~a[.las~-o~o", 2, &["a[.las", "no such file"]),
        ("convert~a.las/b~-o~o", 5, &["a.las/b", "Not a directory"]),
        ("convert~hollow~-o~o", 3, &["hollow: no scan found", "supported: LAS"]),
        ("convert~home~-o~o", 3, &["home: no scan found", "letter.txt"]),
        ("convert~notes.txt~-o~o", 4, &["notes.txt", "supported are LAS"]),
        ("convert~a.zip~-o~o", 4, &["a.zip", "unpack it"]),
        ("convert~page.las~-o~o", 3, &["page.las", "byte 0"]),
        ("convert~empty.las~-o~o", 3, &["empty.las", "empty"]),
        ("convert~cut.las~-o~o", 3, &["cut.las", "--unreadable skip"]),
        ("convert~header.las~-o~o", 3, &["header.las", "byte 100", "cut short"]),
        ("convert~absurd.las~-o~o", 3, &["absurd.las", "scale of z", "5e-310", "byte 147"]),
        ("info~absurd.las", 3, &["absurd.las", "byte 147"]),
        ("convert~broken.ply~-o~o", 3, &["broken.ply", "end_header"]),
        ("convert~broken.pcd~-o~o", 3, &["broken.pcd", "TYPE Q and SIZE 4"]),
        ("convert~comma.xyz~-o~o", 3, &["comma.xyz", "--decimal comma"]),
        ("convert~b.xyz~-o~o~--separator~|", 3, &["b.xyz", "separator '|'", "--separator"]),
        ("convert~b.xyz~-o~o~--separator~", 2, &["--separator", "one character"]),
        ("convert~b.xyz~-o~o~--separator~ab", 2, &["--separator 'ab'"]),
        ("convert~b.xyz~-o~o~--separator~5", 2, &["--separator '5'", "part of a number"]),
        ("convert~b.xyz~-o~o~--separator~→", 2, &["--separator '→'"]),
        ("convert~b.xyz~-o~o~--columns~x,,y", 2, &["--columns", "column 2 has no name", "-"]),
        ("convert~b.xyz~-o~o~--columns~x,z,i,t", 2, &["--columns", "there is no y"]),
        ("convert~b.xyz~-o~o~--columns~x,y,z,x", 2, &["--columns", "x stands twice"]),
        ("convert~b.xyz~-o~o~--columns~x,y,z,q:foo", 2, &["--columns", "foo", "uint8"]),
        ("convert~b.xyz~-o~o~--columns~x,y,z", 3, &["b.xyz", "3 columns are named", "row has 4"]),
        ("convert~b.xyz~-o~o~--decimal~dot", 2, &["--decimal 'dot'", "auto, point, comma"]),
        ("convert~--files-from~nowhere~-o~o", 2, &["nowhere: no such list"]),
        ("convert~--files-from~home~-o~o", 5, &["home", "Is a directory"]),
        ("convert~--files-from~list~-o~o", 2, &["nowhere.las"]),
        ("convert~--files-from~nul~-o~o", 2, &["nul", "one path per line"]),
        ("info~nowhere", 2, &["nowhere: no such file or folder"]),
        ("info~notes.txt", 4, &["notes.txt", "supported are"]),
        ("info~hollow", 3, &["hollow: no scan found"]),
        ("info~syntax", 3, &["syntax", "JSON", "byte"]),
        ("extract~nowhere~-o~ex", 2, &["nowhere: no such file"]),
        ("extract~a.las~-o~ex", 4, &["a.las", "E57"]),
        ("extract~home~-o~ex", 5, &["home", "a folder"]),
        ("extract~notes.txt~-o~ex", 4, &["notes.txt"]),
        ("validate~ds~--against~nowhere", 2, &["nowhere: no such file or folder"]),
        ("validate~ds~--against~header.las", 3, &["header.las", "cut short"]),
    ]);
}

#[test]
fn outputs_and_datasets_that_are_none() {
    check_all(&[
        ("convert~a.las~-o~ds", 2, &["ds: the output exists already", "--overwrite"]),
        ("convert~a.las~-o~home~--overwrite", 2, &["home"]),
        ("convert~a.las~-o~a.las", 2, &["a.las", "choose another"]),
        ("convert~a.las~-o~b.xyz~--overwrite", 2, &["b.xyz"]),
        ("convert~a.las~-o~o~--temp-dir~nowhere", 2, &["nowhere", "--temp-dir"]),
        ("convert~a.las~-o~o~--temp-dir~a.las", 2, &["a.las", "--temp-dir"]),
        ("convert~a.las~-o~o~--report~nowhere/r.json", 2, &["nowhere/r.json", "report"]),
        ("convert~a.las~-o~o~--report~home", 2, &["home", "report"]),
        ("convert~a.las~-o~o~--report~a.las", 2, &["a.las", "report"]),
        ("validate~nowhere", 2, &["nowhere: no such dataset"]),
        ("validate~a.las", 2, &["a.las", "metadata.json"]),
        ("validate~home", 2, &["home", "metadata.json"]),
        ("validate~lost", 7, &["lost", "hierarchy.bin is missing"]),
        ("info~tree", 3, &["tree", "index.json"]),
    ]);
}

#[cfg(unix)]
#[test]
fn names_that_terminals_would_obey_are_shown_without_it() {
    let dir = Dir::new();
    let nasty = "\u{1b}[31mred\u{7}\nline\u{202e}gpj\u{9b}2J.las";
    dir.write(nasty, &Las::terrain(200, 1).bytes()[..300]);
    check("convert", &dir.run(["convert", nasty, "-o", "o"]), 3, &["[31mred"]);
    check("convert", &dir.run(["convert", "nowhere\u{1b}]0;title\u{7}", "-o", "o"]), 2, &["no such file"]);
    check("usage", &dir.run(["convert", "a", "-o", "o", "--memory", "1\u{1b}[2J"]), 2, &["--memory"]);
    check("usage", &dir.run(["convert", "a", "-o", "o", "--\u{1b}[2J\n"]), 2, &["no option"]);
    let clean = |text: String| !text.contains(|c: char| c != '\n' && (c.is_control() || c == '\u{202e}'));
    dir.write(nasty, &Las::terrain(200, 1).bytes());
    for arguments in [&["info", nasty][..], &["info", nasty, "--json"], &["convert", nasty, "-o", nasty, "--dry-run"]] {
        let ended = dir.succeed(arguments);
        assert!(clean(ended.stdout()) && clean(ended.stderr()), "{arguments:?}: {:?}", ended.stdout());
    }
    let json: serde_json::Value = serde_json::from_str(&dir.succeed(["info", nasty, "--json"]).stdout()).unwrap();
    assert_eq!(json[0]["path"], nasty, "programs get the name as it is");
    for progress in ["none", "json", "bar"] {
        let ended = dir.run(["convert", nasty, "-o", "o\u{1b}", "--progress", progress, "-v", "--json", "--overwrite"]);
        assert_eq!(ended.code(), 0, "{}", ended.stderr());
        // a bar moves the cursor itself; it is hidden where standard error is no terminal
        assert!(clean(ended.stdout()) && clean(ended.stderr()), "{progress}: {:?}", ended.stderr());
    }
    let ended = dir.run(["validate", "o\u{1b}", "--against", nasty]);
    assert!(clean(ended.stdout()) && clean(ended.stderr()), "{:?}", ended.stdout());
}
