#!/usr/bin/env bash
# A tarball that unpacks and runs: program, manual pages, completions, licences; at target/pointmill-VERSION-SYSTEM.tar.gz.
#
#   packaging/tarball.sh              runs with the C library (glibc) of the machine that builds it, or a newer one: it says which
#   packaging/tarball.sh static       has the C library (musl) in it, and runs on any Linux of this architecture; needs
#                                     `rustup target add ARCHITECTURE-unknown-linux-musl` and musl-gcc (Debian: musl-tools)
#
# POINTMILL: see files.sh.
set -euo pipefail
cd "$(dirname "$0")/.."
case "${1:-}" in
    "") target="" ;;
    static) target="$(uname -m)-unknown-linux-musl" ;;
    *) echo "usage: packaging/tarball.sh [static]" >&2 && exit 2 ;;
esac
packaging/files.sh ${target:+"$target"}
version=$(target/package/pointmill --version | cut -d' ' -f2)
name="pointmill-$version-$(uname -m)-$(uname -s | tr '[:upper:]' '[:lower:]')${target:+-static}"
rm -rf "target/$name"
mkdir -p "target/$name/man"
cp README.md CHANGELOG.md LICENSE-APACHE LICENSE-MIT "target/$name"
cp -r target/package/{pointmill,completions,THIRD-PARTY-LICENCES.txt} "target/$name"
cp target/package/man/*.1 "target/$name/man"
# the same files, the same bytes
tar --sort=name --owner=0 --group=0 --numeric-owner --mode=u=rwX,go=rX --mtime="@$(git log -1 --format=%ct)" \
    -C target -cf - "$name" | gzip -9n >"target/$name.tar.gz"
if command -v objdump >/dev/null; then
    objdump -T "target/$name/pointmill" | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -1 | sed 's/GLIBC_/needs glibc /' || true
fi
echo "target/$name.tar.gz"
