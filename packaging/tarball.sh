#!/usr/bin/env bash
# A tarball that unpacks and runs anywhere with the C library of the machine that builds it, or a newer one: program, manual
# pages, completions, licences. It is at target/pointmill-VERSION-ARCHITECTURE.tar.gz.
set -euo pipefail
cd "$(dirname "$0")/.."
packaging/files.sh
version=$(target/release/pointmill --version | cut -d' ' -f2)
name="pointmill-$version-$(uname -m)-$(uname -s | tr '[:upper:]' '[:lower:]')"
rm -rf "target/$name"
mkdir -p "target/$name"
cp target/release/pointmill README.md CHANGELOG.md LICENSE-APACHE LICENSE-MIT target/package/THIRD-PARTY-LICENCES.txt "target/$name"
strip "target/$name/pointmill"
cp -r target/package/completions "target/$name"
mkdir "target/$name/man"
cp target/package/man/*.1 "target/$name/man"
# the same files, the same bytes
tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$(git log -1 --format=%ct)" -C target -cf - "$name" | gzip -9n >"target/$name.tar.gz"
if command -v objdump >/dev/null; then
    objdump -T "target/$name/pointmill" | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -1 | sed 's/GLIBC_/needs glibc /'
fi
echo "target/$name.tar.gz"
