//! Which vector instructions inner loops use: chosen at run time, the same results with each.

/// A set of instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Vectors {
    /// What every processor of the architecture has.
    Portable,
    /// x86-64 with AVX2, BMI1, BMI2, LZCNT and POPCNT.
    #[cfg(target_arch = "x86_64")]
    Avx2(Detected),
}

/// Made by [`Vectors::best`] alone, so that nobody claims what the processor does not have.
#[cfg(target_arch = "x86_64")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Detected(());

impl Vectors {
    /// The best that this processor has.
    pub(crate) fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt")
        {
            return Self::Avx2(Detected(()));
        }
        Self::Portable
    }

    /// All that this processor has.
    #[cfg(test)]
    pub(crate) fn all() -> Vec<Self> {
        let mut all = vec![Self::Portable];
        all.extend(Some(Self::best()).filter(|best| *best != Self::Portable));
        all
    }
}

impl Default for Vectors {
    fn default() -> Self {
        Self::best()
    }
}

/// `vectorized! { fn name(argument: Type, …) -> Output = work; }` makes a function that takes [`Vectors`] first and then calls
/// `work`, an `#[inline(always)]` function of the same arguments, compiled for these instructions.
macro_rules! vectorized {
    ($(#[$meta:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $out:ty)? = $work:path;) => {
        $(#[$meta])*
        $vis fn $name(vectors: $crate::runtime::Vectors, $($arg: $ty),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
            fn with_avx2($($arg: $ty),*) $(-> $out)? {
                $work($($arg),*)
            }
            match vectors {
                $crate::runtime::Vectors::Portable => $work($($arg),*),
                #[cfg(target_arch = "x86_64")]
                // SAFETY: the processor has these instructions, or there were no `Detected`.
                $crate::runtime::Vectors::Avx2(_) => unsafe { with_avx2($($arg),*) },
            }
        }
    };
}
pub(crate) use vectorized;
