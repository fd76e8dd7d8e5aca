# The commands that .ci/run runs, one by one.

# Types and lints
check:
    cargo fmt --check
    cargo clippy --workspace --all-targets -- -D warnings
    RUSTDOCFLAGS=-Dwarnings cargo doc --workspace --no-deps

# Every test
test:
    cargo test --workspace

# Converts the scan in fixtures/ and validates the dataset, as the README does
demo:
    eval "$(sed -n '/^cargo run --release/p' README.md)"

# All of it
ci:
    .ci/run
