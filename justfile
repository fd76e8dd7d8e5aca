# The commands that .ci/run runs, one by one.

# Types and lints
check:
    cargo fmt --check
    cargo clippy --workspace --all-targets -- -D warnings
    RUSTDOCFLAGS=-Dwarnings cargo doc --workspace --no-deps

# Every test
test:
    cargo test --workspace

# Each feature of the format crate by itself
features:
    for feature in `sed -n '/^\[features\]/,/^\[dep/s/^\([a-z0-9]*\) = .*/\1/p' crates/format/Cargo.toml`; do \
        cargo clippy -q -p pointmill-format --all-targets --no-default-features --features $feature -- -D warnings && \
        cargo test -q -p pointmill-format --lib --no-default-features --features $feature || exit 1; \
    done

# Converts the scan in fixtures/ and validates the dataset, as the README does
demo:
    eval "$(sed -n '/^cargo run/p' README.md)"

# Datasets in the clients that people use, in a browser
clients:
    tests/clients/run

# All of it
ci:
    .ci/run
