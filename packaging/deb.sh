#!/usr/bin/env bash
# A Debian package, at target/debian/pointmill_VERSION_ARCHITECTURE.deb. Takes cargo-deb from crates.io if it is not there.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v cargo-deb >/dev/null || cargo install cargo-deb --locked
packaging/files.sh
cargo deb --no-build --locked
