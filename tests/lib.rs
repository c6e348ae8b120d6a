//! Tests that cross the crates; see `tests/main.rs`.
