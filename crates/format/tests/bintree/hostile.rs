//! Bytes that lie: an error that says what is wrong, never a panic, never memory without end.
