#!/usr/bin/env bash
# A Debian package, at target/debian/pointmill_VERSION_ARCHITECTURE.deb. Takes cargo-deb from crates.io if it is not there.
# POINTMILL: see files.sh.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v cargo-deb >/dev/null || cargo install cargo-deb --locked
packaging/files.sh
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct) # the same files, the same bytes
export SOURCE_DATE_EPOCH
cargo deb --no-build --no-strip --locked --output target/debian
