//! The committed header is the one that the code makes.

use std::path::Path;

#[test]
fn the_header_is_that_of_the_code() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::Builder::new().with_crate(root).with_config(config).generate().unwrap();
    let mut made = Vec::new();
    bindings.write(&mut made);
    let path = root.join("include/pointmill.h");
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let made = String::from_utf8(made).unwrap();
    if made != committed {
        let fresh = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pointmill.h");
        std::fs::write(&fresh, made).unwrap();
        panic!("the header is not that of the code: look at it and copy {} to {}", fresh.display(), path.display());
    }
}
