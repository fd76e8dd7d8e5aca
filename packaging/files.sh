#!/usr/bin/env bash
# What every package contains beside the program: manual pages, completions, licences; in target/package.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked
program=target/release/pointmill
rm -rf target/package
mkdir -p target/package/man target/package/completions
"$program" man -o target/package/man
gzip -9nk target/package/man/*.1
for shell in bash zsh fish; do
    "$program" completions "$shell" >"target/package/completions/pointmill.$shell"
done
python3 packaging/licences.py target/package/THIRD-PARTY-LICENCES.txt
