#!/usr/bin/env bash
# What every package contains: the program, manual pages, completions, licences; in target/package.
#
#   packaging/files.sh [TARGET]     TARGET: for another system than this one, x86_64-unknown-linux-musl
#
# POINTMILL=PROGRAM takes a program that is there instead of building one (5 minutes): to try the packages, not to publish them.
set -euo pipefail
cd "$(dirname "$0")/.."
target="${1:-}"
if [ -z "${POINTMILL:-}" ]; then
    cargo build --release --locked --bin pointmill ${target:+--target "$target"}
    POINTMILL="${CARGO_TARGET_DIR:-target}/${target:+$target/}release/pointmill"
fi
rm -rf target/package
mkdir -p target/package/man target/package/completions
install -m 755 "$POINTMILL" target/package/pointmill
strip target/package/pointmill
program=target/package/pointmill
"$program" man -o target/package/man
gzip -9nk target/package/man/*.1
for shell in bash zsh fish; do
    "$program" completions "$shell" >"target/package/completions/pointmill.$shell"
done
gzip -9nc CHANGELOG.md >target/package/CHANGELOG.md.gz
{
    printf 'pointmill (%s-1) unstable; urgency=medium\n\n' "$("$program" --version | cut -d' ' -f2)"
    printf '  * What is new in the program: changelog.gz.\n\n'
    printf ' -- The pointmill makers <makers@pointmill.invalid>  %s\n' "$(git log -1 --format=%cD)"
} >target/package/changelog.Debian
python3 packaging/licences.py target/package/THIRD-PARTY-LICENCES.txt ${target:+"$target"}
