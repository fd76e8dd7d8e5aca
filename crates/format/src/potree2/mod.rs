//! Potree 2.0 datasets (`docs/formats/potree2.md`).
