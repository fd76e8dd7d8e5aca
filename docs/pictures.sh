#!/usr/bin/env bash
# Makes the pictures of README.md from a scan in fixtures/.
set -euo pipefail
cd "$(dirname "$0")/.."
program=${POINTMILL:-}
if [ -z "$program" ]; then
    cargo build --profile quick
    program=target/quick/pointmill
fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$program" convert fixtures/las/autzen_trim.laz -o "$scratch/autzen" --quiet
mkdir -p docs/pictures
picture() { # name, options
    local name=$1
    shift
    "$program" preview "$scratch/autzen" -o "docs/pictures/$name.png" --overwrite --quiet --size 480x240 "$@"
}
picture colour
picture height --colour height
picture levels --colour level --boxes
