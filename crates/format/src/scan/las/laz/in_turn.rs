//! The same step for each chunk that is decoded in turn.

/// Does something for lane 0 and, where `L` is 2, then for lane 1: written out, since the compiler would make a loop of
/// it, or a function, with the decoders in memory instead of in registers.
macro_rules! in_turn {
    (|$lane:ident| $step:expr) => {{
        {
            let $lane = 0;
            $step;
        }
        if L > 1 {
            let $lane = 1;
            $step;
        }
    }};
}

pub(super) use in_turn;
